"""The figures of the method pages: each a function that draws on axes and returns its caption."""

from __future__ import annotations

from pictures import bounded, conflicts, damping, redundancy, stacked

FIGURES = {
    "pinv": stacked.pinv,
    "dls": damping.dls,
    "dls-manipulability": damping.dls_manipulability,
    "dls-sigma": damping.dls_sigma,
    "numerical-filtering": damping.numerical_filtering,
    "sdls": damping.sdls,
    "transpose": stacked.transpose,
    "main-variables": stacked.main_variables,
    "projected-gradient": redundancy.projected_gradient,
    "reduced-gradient": redundancy.reduced_gradient,
    "extended-jacobian": redundancy.extended_jacobian,
    "task-priority": conflicts.task_priority,
    "singularity-robust-priority": conflicts.singularity_robust_priority,
    "reverse-priority": conflicts.reverse_priority,
    "task-scaling": bounded.task_scaling,
    "sns": bounded.sns,
    "sns-greedy": bounded.sns_greedy,
    "qp": bounded.qp,
    "hqp": bounded.hqp,
}
