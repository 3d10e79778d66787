"""Rotations, twists and wrenches: frames, exponentials, screws, Euler angles; arrays in, arrays out.

``cc.spatial``; needs no Pinocchio. Twists and wrenches are ordered linear part first. Euler sequences are intrinsic
unless asked for about fixed axes, and written in capitals ("ZYZ": about z, then the new y, then the new z).
"""

from cartctl.spatial.euler import (
    EULER_SEQUENCES,
    EulerLock,
    euler_angles,
    euler_lock,
    euler_rates,
    euler_rotation,
)
from cartctl.spatial.frames import (
    adjoint,
    inverse_pose,
    move_twist,
    move_wrench,
    other_order,
    pose,
    velocity_conversion,
    wrench_adjoint,
)
from cartctl.spatial.motions import ad, exp6, hat, log6, vee
from cartctl.spatial.pose_error import pose_error
from cartctl.spatial.rotations import exp3, log3
from cartctl.spatial.screws import Screw, displacement_screw, twist_screw, wrench_screw
from cartctl.spatial.vectors import cross, rotation_about, skew

__all__ = [
    "EULER_SEQUENCES",
    "EulerLock",
    "Screw",
    "ad",
    "adjoint",
    "cross",
    "displacement_screw",
    "euler_angles",
    "euler_lock",
    "euler_rates",
    "euler_rotation",
    "exp3",
    "exp6",
    "hat",
    "inverse_pose",
    "log3",
    "log6",
    "move_twist",
    "move_wrench",
    "other_order",
    "pose",
    "pose_error",
    "rotation_about",
    "skew",
    "twist_screw",
    "vee",
    "velocity_conversion",
    "wrench_adjoint",
    "wrench_screw",
]
