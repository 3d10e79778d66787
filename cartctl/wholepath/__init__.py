"""Whole-path resolution: the joint path of least integral cost, subject to tasks and limits at every sample."""

from cartctl.wholepath.as_run import Plan
from cartctl.wholepath.costs import JointSpeed, PathCost, SquaredTorque
from cartctl.wholepath.local import LocalMethod
from cartctl.wholepath.planning import plan
from cartctl.wholepath.report import PlanReport, PlanStatus, Start

__all__ = [
    "JointSpeed",
    "LocalMethod",
    "PathCost",
    "Plan",
    "PlanReport",
    "PlanStatus",
    "SquaredTorque",
    "Start",
    "plan",
]
