"""Integral costs of whole paths."""

from cartctl.wholepath.costs.base import PathCost
from cartctl.wholepath.costs.pointwise import Integral, TaskMiss
from cartctl.wholepath.costs.speed import JointSpeed, PathEnergy
from cartctl.wholepath.costs.sums import NAMED, CostSum, as_cost
from cartctl.wholepath.costs.torque import SquaredTorque

__all__ = [
    "NAMED",
    "CostSum",
    "Integral",
    "JointSpeed",
    "PathCost",
    "PathEnergy",
    "SquaredTorque",
    "TaskMiss",
    "as_cost",
]
