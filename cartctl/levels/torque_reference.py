"""What torques the null space is drawn to: u0 by metric, damping and objective.

With the metrics of inertia, u0 is mapped through M, for ``(tau - u0)^T W (tau - u0)`` then measures accelerations:
``u0 = h - M D v + k M grad H``. With least torques it is a torque itself, ``u0 = h - D v + k grad H``: that metric
favours light joints, on which ``-M D v`` is weak.
"""

from __future__ import annotations

import numpy as np

from cartctl import checks
from cartctl.checks import FloatArray
from cartctl.levels.base import Secondary, direction
from cartctl.model.state import State

DAMPING = 20.0  # 1/s
FIRM, STIFF, STIFFEST = 3.0, 10.0, 300.0  # N m s/rad, 1/s, 1/s
MAPPED = ("inverse-inertia", "inverse-inertia-squared")  # the metrics of inertia


def drawn_to(
    state: State, h: FloatArray, secondary: Secondary, damping: float | FloatArray | None
) -> FloatArray | None:
    """``u0`` (nv,); None for the classical form, and where the solver takes none. Raises ShapeError, NonFiniteError."""
    if not secondary.spends:
        return None
    mapped, objective = secondary.weighing in MAPPED, secondary.objective
    if damping is None:
        damping = DAMPING if mapped else of_inertia(state.mass_matrix.diagonal())
    elif objective is None and not np.any(damping):
        return None
    checks.fits("damping", damping, state.robot.nv)
    u0 = damping * -state.v
    if objective is not None:
        u0 = u0 + secondary.share * direction(objective, state)
    return np.asarray(h + (state.mass_matrix @ u0 if mapped else u0))


def of_inertia(inertia: FloatArray) -> FloatArray:
    """D in N m s/rad for joints of these inertias: enough for the heavy ones, not too stiff for the light ones."""
    return np.minimum(FIRM + STIFF * inertia, STIFFEST * inertia)
