"""What to spend the redundancy on: H(q) and its gradient."""

from cartctl.objectives.base import Objective
from cartctl.objectives.clearance import Clearance, SelfClearance, SmoothClearance
from cartctl.objectives.joint_range import JointRange

__all__ = ["Clearance", "JointRange", "Objective", "SelfClearance", "SmoothClearance"]
