"""A task below others, held back before the edge of what those leave to it.

With N the null space of the tasks above, a task below has J N to move with, which loses rank in postures where J is far
from losing it: a hand in place that cannot turn any further. What is left of b beside the motion that the tasks above
ask for is held back along the singular directions of J N, as :mod:`cartctl.levels.approach` does it along those of J.
On the way the tasks above bend, too: along a motion v in their null space, ``h = J_dot(v) v - J A# A_dot(v) v``.

Where a direction of J N is lost, the task asks for ``J u - g = s (b - g)``, g what the motion above does to it:
slowed down as a whole, it still leaves that as it is. ``J u = s b`` would ask others to undo part of g, which they
cannot: s is 0 in one step and 1 in the next, by the sign of what is left of g.

That is for targets at rest and solvers that rank tasks; one that weighs them takes what they ask as it is.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cartctl.checks import FloatArray
from cartctl.levels.approach_kernel import ASKED, ROWS, is_beyond
from cartctl.levels.beneath_kernel import held_beneath, narrowed
from cartctl.levels.calming import Above
from cartctl.levels.left_out import keep
from cartctl.model.state import State
from cartctl.tasks.base import Task


class Beneath(NamedTuple):
    """b (m,) held back, the speed left to what ranks below (inf far from the edge), and g (m,), None if b is whole."""

    b: FloatArray
    edge: float
    given: FloatArray | None


class Means(NamedTuple):
    """The joints' figures, the box on the next velocity, seconds of a step; whether commands scale; if fenced."""

    joints: FloatArray
    lower: FloatArray
    upper: FloatArray
    dt: float
    scales: bool
    fenced: bool


def hold_beneath(
    above: Above,
    task: Task,
    state: State,
    J: FloatArray,
    b: FloatArray,
    error: FloatArray,
    size: float,
    means: Means,
    box: tuple[FloatArray, FloatArray] | None,
) -> Beneath:
    """``b`` (m,) held back, and what comes of it.

    box: where joints are kept at their bounds, for a solver that does not scale.
    """
    (m, n), rows = J.shape, above.rows
    k, M = min(m, n), rows.shape[0]
    U, Vt, D, stood = np.empty((m, k)), np.empty((k, n)), np.empty((ROWS, k)), np.empty(n)
    back, base, rest = np.empty((m, M)), np.empty(m), np.empty(m)
    joints, lower, upper, dt, scales, fenced = means
    narrowed.compiled(
        rows, above.asked, J, b, error, joints, lower, upper, dt, size, fenced, U, Vt, D, back, base, rest, stood
    )
    along = Vt[D[ASKED] != 0.0]
    own, others = np.zeros((m, len(along))), np.zeros((M, len(along)))
    if len(along):
        own = task.curvatures(state, along)
        others = np.concatenate([other.curvatures(state, along) for other in above.tasks])
    out = b.copy()
    edge = held_beneath.compiled(
        error, base, rest, U, Vt, D, joints, back, own, others, dt, size, scales, not fenced, out
    )
    if box is not None and not scales and is_beyond(edge, D, k, size):
        keep(stood, *box)
    apart = is_beyond(np.inf, D, k, size) and base.any() and (out != b).any()
    return Beneath(out, edge, base if apart else None)
