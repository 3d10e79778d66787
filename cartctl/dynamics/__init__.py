"""The textbook terms of rigid-body dynamics, beside what Pinocchio computes: ``from cartctl import dynamics``.

Of a robot at a State: Christoffel symbols, factorisations of the velocity terms, energies, gravity in any direction.
Of arrays: the Cartesian inertia, the check of an inertia matrix, uniform time scaling, uniform bodies. Of a table of
Denavit-Hartenberg parameters: the moving-frames recursion and the equations of motion, as numbers or as the textbooks
print them (SymPy, the extra ``symbolic``).
"""

from cartctl.dynamics.bodies import Body, box, cone, cylinder, disk, ellipsoid, point_mass, rod, sphere
from cartctl.dynamics.cartesian import CartesianInertia, cartesian_inertia
from cartctl.dynamics.christoffel import christoffel, coriolis, mass_matrix_derivatives, mass_matrix_rate
from cartctl.dynamics.dh import DHArm, DHLink
from cartctl.dynamics.energy import Energy, energy, energy_rate, gravity_torques, velocity_torques
from cartctl.dynamics.inertia_check import InertiaCheck, check_inertia_matrix
from cartctl.dynamics.lagrange import euler_lagrange, from_inertia_matrix
from cartctl.dynamics.moving_frames import LinkMotion, MovingFrames, moving_frames
from cartctl.dynamics.scaling import TimeScaling, motion_torques, time_scaling

__all__ = [
    "Body",
    "CartesianInertia",
    "DHArm",
    "DHLink",
    "Energy",
    "InertiaCheck",
    "LinkMotion",
    "MovingFrames",
    "TimeScaling",
    "box",
    "cartesian_inertia",
    "check_inertia_matrix",
    "christoffel",
    "cone",
    "coriolis",
    "cylinder",
    "disk",
    "ellipsoid",
    "energy",
    "energy_rate",
    "euler_lagrange",
    "from_inertia_matrix",
    "gravity_torques",
    "mass_matrix_derivatives",
    "mass_matrix_rate",
    "motion_torques",
    "moving_frames",
    "point_mass",
    "rod",
    "sphere",
    "time_scaling",
    "velocity_torques",
]
