"""Configurations where a task is singular, or where tasks conflict: found from random starts.

The smallest singular value sigma of the stacked, normalised Jacobian A(q) is brought to zero by nonlinear least squares
on the n residuals ``r(q) = A(q)^T u(q) = sigma v``, u and v its singular vectors: smooth through sigma = 0, where sigma
itself has a kink, so that convergence is quadratic. One task has its rows normalised; of several, each has its rows
made orthonormal, which leaves the angles between the tasks and hides each task's own singularities.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.optimize import least_squares

from cartctl import checks
from cartctl.algebra.svd import singular_values, svd
from cartctl.analysis.algorithmic import AlgorithmicSingularity, algorithmic_singularity, orthonormal_rows
from cartctl.analysis.box import Box, Space, space_of
from cartctl.analysis.generic import ranks
from cartctl.analysis.kinematic import POSE_NAMES, KinematicSingularity, kinematic_singularity
from cartctl.checks import FloatArray
from cartctl.errors import ParameterError

if TYPE_CHECKING:
    from cartctl.model.robot import Robot

_STEPS = 60  # evaluations a start, those for differences not counted; a start that succeeds takes about ten
_TOLERANCE = 1e-6
Judge = Callable[[list[FloatArray]], "KinematicSingularity | AlgorithmicSingularity"]


@dataclass(frozen=True, eq=False)
class SingularConfiguration:
    """q with sigma_min of the normalised stack there, and what is the matter."""

    q: FloatArray
    sigma: float
    singularity: KinematicSingularity | AlgorithmicSingularity


@dataclass(frozen=True, eq=False)
class Search:
    """What a search found: one configuration a start that succeeded, the most singular first.

    closest: the least sigma_min of all starts, those without success included: how near one can come.
    """

    found: tuple[SingularConfiguration, ...]
    closest: SingularConfiguration
    starts: int


def find_algorithmic_singularities(
    place: Robot | Box, tasks: Sequence[Any], *, starts: int = 20, seed: int = 0, tolerance: float = _TOLERANCE
) -> Search:
    """Configurations inside the limits where the tasks, each of full rank, together have less.

    place, tasks: as in :func:`generic_rank`, two tasks or more. tolerance: relative, what counts as a zero singular
    value. Finding none proves nothing. Raises ParameterError where there is nothing to find: a task singular
    everywhere, or more rows than joints; further what :func:`generic_rank` raises.
    """
    if not isinstance(tasks, Sequence) or len(tasks) < 2:
        raise ParameterError(f"tasks is {tasks!r}; expected a sequence of at least two tasks that may conflict")
    for k, task in enumerate(tasks, 1):
        _regular(space_of(place, [task]), f"task {k}", seed, tolerance)
    space = space_of(place, tasks)
    rows = sum(J.shape[0] for J in space.jacobians(space.sample(np.random.default_rng(seed))))
    if rows > space.n:
        raise ParameterError(f"the tasks have {rows} rows for {space.n} joints; expected at most one row a joint")
    return _search(space, _orthonormal, lambda Js: algorithmic_singularity(*Js, tolerance=tolerance), starts, seed)


def find_kinematic_singularities(
    place: Robot | Box, task: Any, *, starts: int = 20, seed: int = 0, tolerance: float = _TOLERANCE
) -> Search:
    """Configurations inside the limits where ``rank J < m``; arguments and errors as for several tasks."""
    space = space_of(place, [task])
    _regular(space, "the task", seed, tolerance)
    rows = getattr(task, "rows", None)  # of a pose or of a position: their directions have names
    names = None if rows is None else [POSE_NAMES[row] for row in rows]
    return _search(space, _normalised, lambda Js: kinematic_singularity(Js[0], names, tolerance), starts, seed)


def _regular(space: Space, name: str, seed: int, tolerance: float) -> None:
    generic = ranks(space, 5, seed, checks.number("tolerance", tolerance, low=0.0, strict=True))
    if generic.singular_everywhere or generic.rows == 0:
        raise ParameterError(
            f"{name} has rank {generic.rank} of {generic.rows} at every configuration; "
            "expected rows that the robot can move, such as axes='xy'"
        )


def _search(
    space: Space, normalise: Callable[[list[FloatArray]], FloatArray], judge: Judge, starts: int, seed: int
) -> Search:
    rng = np.random.default_rng(seed)
    ends = []
    for _ in range(int(checks.number("starts", starts, low=1.0))):
        q = _descend(space, normalise, space.sample(rng))
        jacobians = space.jacobians(q)
        ends.append(SingularConfiguration(q, float(singular_values(normalise(jacobians))[-1]), judge(jacobians)))
    ends.sort(key=lambda end: end.sigma)
    return Search(tuple(end for end in ends if end.singularity.occurs), ends[0], len(ends))


def _descend(space: Space, normalise: Callable[[list[FloatArray]], FloatArray], start: FloatArray) -> FloatArray:
    """The end of a descent of sigma_min from ``start``."""
    lower, upper = space.room(start)
    lower, upper = np.minimum(lower, 0.0), np.maximum(upper, 0.0)  # a start is inside, whatever round-off says
    free = upper > lower
    last: list[FloatArray] = []

    def displaced(x: FloatArray) -> FloatArray:
        displacement = np.zeros(space.n)
        displacement[free] = x
        return space.moved(start, displacement)

    def residual(x: FloatArray) -> FloatArray:
        A = normalise(space.jacobians(displaced(x)))
        u = svd(A).U[:, -1]
        if last and u @ last[-1] < 0.0:  # singular vectors come with either sign
            u = -u
        last[:] = [u]
        return A.T @ u  # type: ignore[no-any-return]

    if not free.any():
        return start
    end = least_squares(
        residual,
        np.zeros(int(free.sum())),
        bounds=(lower[free], upper[free]),
        xtol=1e-12,
        ftol=None,
        gtol=1e-15,
        max_nfev=_STEPS,
    )
    return displaced(end.x)


def _orthonormal(jacobians: list[FloatArray]) -> FloatArray:
    return np.asfortranarray(np.vstack([orthonormal_rows(J) for J in jacobians]))


def _normalised(jacobians: list[FloatArray]) -> FloatArray:
    """Each row over its norm; rows of zeros stay."""
    A = np.vstack(jacobians)
    sizes = np.linalg.norm(A, axis=1, keepdims=True)
    return np.asfortranarray(A / np.where(sizes > 0.0, sizes, 1.0))
