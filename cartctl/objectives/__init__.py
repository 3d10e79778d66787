"""What to spend the redundancy on: H(q) and its gradient, one a file."""

from cartctl.objectives.base import Objective
from cartctl.objectives.clearance import Clearance, SelfClearance, SmoothClearance
from cartctl.objectives.function import FunctionObjective
from cartctl.objectives.gravity_torque import GravityTorque
from cartctl.objectives.inverse_condition import InverseCondition
from cartctl.objectives.inverse_manipulability import InverseManipulability
from cartctl.objectives.joint_range import JointRange
from cartctl.objectives.kinetic_energy import KineticEnergy
from cartctl.objectives.manipulability import Manipulability
from cartctl.objectives.posture import Posture
from cartctl.objectives.smallest_singular_value import SmallestSingularValue
from cartctl.objectives.torque_distribution import TorqueDistribution
from cartctl.objectives.torque_per_force import TorquePerForce
from cartctl.objectives.velocity_ratio import VelocityRatio
from cartctl.objectives.weighted_sum import WeightedSum

__all__ = [
    "Clearance",
    "FunctionObjective",
    "GravityTorque",
    "InverseCondition",
    "InverseManipulability",
    "JointRange",
    "KineticEnergy",
    "Manipulability",
    "Objective",
    "Posture",
    "SelfClearance",
    "SmallestSingularValue",
    "SmoothClearance",
    "TorqueDistribution",
    "TorquePerForce",
    "VelocityRatio",
    "WeightedSum",
]
