"""A planned joint path as a Run: its velocities are the commands, held from sample to sample."""

from __future__ import annotations

from typing import Any

import numpy as np

from cartctl.algebra.svd import singular_values
from cartctl.motion.recorder import cycles_of, provenance, world_rows
from cartctl.motion.run import Run, TaskRecord
from cartctl.tasks.base import Task
from cartctl.wholepath.report import PlanReport
from cartctl.wholepath.rows import Rows
from cartctl.wholepath.trace import Trace


class Plan(Run):
    """A Run whose commands are a plan's velocities, with the plan's ``report``.

    Everything a Run has: metrics, ``save``, ``plot``, ``html``. ``solve_time`` is the time of planning, shared evenly.
    ``status`` is INFEASIBLE at steps that miss a task or exceed a limit. A saved plan comes back as a Run, its report
    as numbers in ``meta["plan"]``.
    """

    report: PlanReport


def as_plan(trace: Trace, report: PlanReport) -> Plan:
    """The run of a joint path."""
    setting = trace.setting
    robot, steps = setting.robot, len(trace.V)
    before = trace.V[0] if trace.before is None else trace.before
    plan = Plan(
        meta=_meta(trace, report),
        time=np.array(setting.times),
        q=np.array(trace.Q),
        v=np.concatenate([before[None], trace.V]),
        command=np.array(trace.V),
        status=_statuses(trace),
        solve_time=np.full(steps, report.seconds / steps),
        tasks=[
            *(_record(trace, task, anchor) for task, anchor in zip(setting.tasks, setting.anchors, strict=True)),
            *(_record(trace, task, anchor) for task, anchor in zip(setting.soft, setting.soft_anchors, strict=True)),
        ],
        robot=robot,
    )
    plan.report = report
    return plan


def _record(trace: Trace, task: Task, anchor: Any) -> TaskRecord:
    errors, spreads, values, targets = [], [], [], []
    for state in trace.states():
        errors.append(task.reference(state, state.time, anchor).error)
        spreads.append(singular_values(np.asfortranarray(task.jacobian(state))))
        seen = task.observe(state, state.time, anchor)
        if seen is not None:
            values.append(np.array(seen.value))
            targets.append(np.array(seen.target))
    return TaskRecord(
        name=task.name,
        kind=task.kind,
        frame=task.frame,
        units=task.units(trace.setting.robot),
        error=np.array(errors),
        scale=np.ones(len(trace.V)),
        singular_values=np.array(spreads),
        pose=np.array(values) if values else None,
        target=np.array(targets) if targets else None,
        rows=world_rows(task),
    )


def _statuses(trace: Trace) -> list[str]:
    bad = ~trace.met[:-1] | ~trace.met[1:]
    if trace.setting.limits is not None:
        bad |= Rows(trace.setting.limits).violated(trace)
    return ["INFEASIBLE" if b else "OPTIMAL" for b in bad]


def _meta(trace: Trace, report: PlanReport) -> dict[str, Any]:
    setting = trace.setting
    robot = setting.robot
    return {
        "robot": robot.spec,
        "robot_name": robot.name,
        "joints": list(robot.dof_names),
        "solver": "plan",
        "solver_parameters": {"closed": str(setting.closed), "rest": str(setting.rest)},
        "level": "velocity",
        "objective": report.objective,
        "singularity": None,
        "metric": "identity",
        "dt": setting.h,
        "cycles": cycles_of([getattr(task, "target", None) for task in (*setting.tasks, *setting.soft)]),
        "interrupted": False,
        "plan": report.summary(),
        **provenance(),
    }
