"""What a motion must not do, as rows on the command of one step."""

from cartctl.constraints.base import Constraint, Rows, stacked
from cartctl.constraints.clearance import Avoid, AvoidSelf, ClearanceConstraint
from cartctl.constraints.frame_box import FrameBox
from cartctl.constraints.frame_speed import FrameSpeed
from cartctl.constraints.half_space import HalfSpace
from cartctl.constraints.intervals import Box
from cartctl.constraints.position import PositionConstraint

__all__ = [
    "Avoid",
    "AvoidSelf",
    "Box",
    "ClearanceConstraint",
    "Constraint",
    "FrameBox",
    "FrameSpeed",
    "HalfSpace",
    "PositionConstraint",
    "Rows",
    "stacked",
]
