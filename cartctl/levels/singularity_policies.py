"""What a controller does with a task near its singularity, by name: the same for every solver.

An inverse policy (:mod:`cartctl.algebra.inverses`) belongs to methods that go through an SVD; these act on the command
of the masked task before any method sees it, so that sns, hqp and qp have them, too. With the SVD of the task's own
Jacobian, ``J = U diag(sigma) V^T``, and its command c:

- ``"truncate"``, ``"damp"``, or any linear inverse policy: ``c' = J J# c = U diag(sigma phi(sigma)) U^T c``, what the
  pseudo-inverse of that policy would deliver. A method that meets c' exactly then answers as that pseudo-inverse.
- ``"slow-down"``: :class:`SlowDown`. ``"avoid"``: :class:`AvoidSingularity`. ``"halt"``: :class:`Halt`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from cartctl import checks
from cartctl.algebra.inverses import InversePolicy, NumericalFiltering, Truncated
from cartctl.algebra.svd import norm
from cartctl.checks import FloatArray
from cartctl.errors import ParameterError

_NOTHING = 1e-9  # of a command: a part along a singular direction below this is round-off


@dataclass(frozen=True)
class SlowDown:
    """Slow the task's command until no direction near the singularity asks too much of the joints.

    ``c' = s c``, ``s = min(1, min_i sigma_i |c| / (eps |u_i^T c|))`` over the directions with sigma_i < eps: along
    each, joint rates stay below |c| / eps. The hand keeps its direction, a path waits, and s reaches 0 where the
    command needs a direction that is lost; along the other directions nothing is slowed. Velocity level. threshold:
    eps > 0, in the units of the singular values.
    """

    threshold: float = 0.04

    def __post_init__(self) -> None:
        object.__setattr__(self, "threshold", checks.number("threshold", self.threshold, low=0.0, strict=True))

    def left(self, U: FloatArray, s: FloatArray, c: FloatArray) -> FloatArray:
        """``c'`` (m,), from the thin SVD's U (m, k) and s (k,)."""
        parts, size = U.T @ c, norm(c)
        asked = np.abs(parts)
        urgent = self.threshold * asked > s * size  # where joint rates would be above |c| / eps
        if not urgent.any():
            return c
        nothing = urgent & (asked <= _NOTHING * size)
        if nothing.any():
            c, urgent = c - U[:, nothing] @ parts[nothing], urgent & ~nothing
        if urgent.any():
            c = c * (float((s[urgent] / asked[urgent]).min()) * size / self.threshold)
        return c


@dataclass(frozen=True)
class Halt:
    """Stop the robot where a task's smallest singular value falls below a threshold; reset the controller to go on.

    Every joint comes to rest as fast as the bounds on u allow, and stays: the solver is not asked, objectives are not
    followed. threshold: eps > 0, in the units of the singular values. A task whose Jacobian can never have full rank is
    halted at once: mask the axes that the robot cannot move.
    """

    threshold: float = 0.01

    def __post_init__(self) -> None:
        object.__setattr__(self, "threshold", checks.number("threshold", self.threshold, low=0.0, strict=True))


@dataclass(frozen=True)
class AvoidSingularity:
    """Spend the redundancy on the manipulability of the first task, beside the controller's own objective.

    ``u0 += k grad w / w_0``, ``w = sqrt(det(J J^T))`` (Yoshikawa 1985), J the masked task's, w_0 its median over random
    postures. A task without joints to spare has no use for it, and a solver without a null-space term refuses it. gain:
    k > 0, (rad/s) per 1/rad.
    """

    gain: float = 1.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "gain", checks.number("gain", self.gain, low=0.0, strict=True))


Policy = SlowDown | Halt | AvoidSingularity | InversePolicy

NAMED: dict[str, Callable[[], Policy]] = {
    "truncate": lambda: Truncated(1e-2),
    "damp": lambda: NumericalFiltering(beta=0.0),
    "slow-down": SlowDown,
    "avoid": AvoidSingularity,
    "halt": Halt,
}


def as_policy(singularity: Any) -> Policy | None:
    """A policy by name or as given, None for none; raises ParameterError."""
    if isinstance(singularity, str):
        return NAMED[checks.choice("singularity", singularity, tuple(NAMED))]()
    if isinstance(singularity, InversePolicy):
        if not singularity.linear:
            raise ParameterError(
                f"singularity is {singularity!r}, which is not linear in the command; expected another inverse policy, "
                "or solver='sdls'"
            )
        return singularity
    if singularity is None or isinstance(singularity, SlowDown | Halt | AvoidSingularity):
        return singularity
    raise ParameterError(
        f"singularity is {singularity!r}; expected one of {', '.join(map(repr, NAMED))}, a policy such as "
        "cc.SlowDown(), or None"
    )
