"""One controller's step in two flat arrays, integers and numbers: where each thing stands in them.

Crossing from Python into compiled code costs as much for each array as a row of arithmetic, and handing sixty arrays
from function to function takes long to compile; so what lasts and the room to work in are views of two arrays.
"""

from __future__ import annotations

from typing import NamedTuple

from cartctl.checks import FloatArray, IntArray
from cartctl.compiled.approach_kernel import Room
from cartctl.compiled.motion_kernel import Chain
from cartctl.kernels import lean_part
from cartctl.levels.approach_kernel import ROWS as DIRECTION_ROWS
from cartctl.levels.patience_kernel import HEAD as PATIENCE_HEAD
from cartctl.levels.patience_kernel import PATIENCE, forget

# the integers' head
NQ, NV, TASKS, ROWS, LARGEST, BOUNDED, HELD, LAST, BEGINS, COUNT, SOLVER, STEPS = 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11
LOOKS, INTS_HEAD = 12, 13  # LOOKS: that it is looked, and nothing more
# the numbers' head: six of room at its end
DT, PARAMETER, BEFORE, START, BEGAN, SIX, HEAD = 0, 1, 2, 3, 4, 5, 11

# rows of ``wide``, nv each: 11 of the limits, 4 of the approach, then
LIMITS, JOINTS, U, AT, LOWER, UPPER, X, STOOD, J, A = 0, 11, 15, 16, 17, 18, 19, 20, 21, 27
# rows of ``high``, one column a row of a task
POINT, FOUND, GAIN, UNIT, TURNING, ERROR, RATE, BEND, B, B_AGAIN, D_AGAIN, GIVEN, HIGH = range(13)
# rows of ``each``, one column a task
KIND, COUNTED, FITTED, WEIGHT, OPEN_POSITION, OPEN_ROTATION, PATH, WAITS, WHOLE = 0, 1, 2, 3, 4, 5, 6, 7, 8
NATURAL, PACE, SCALE, DELAY, SHARE, OWN, AGAIN, MADE, CURVED, CALM, PACED, MISSED, SIZE, EACH = range(9, 23)
SAMPLE, CURVE = 25, 24  # numbers of a path's sample, and of a curve whose samples are worked out here
BESIDE = DIRECTION_ROWS + 3  # rows of ``square`` between two matrices and the memories of the singular vectors


class Store(NamedTuple):
    """The blocks that the two arrays are made of."""

    ints: IntArray
    head: FloatArray
    twelve: FloatArray  # (2 nv + 4 p + 1, 12) poses: places and frames of joints, then of tasks
    wide: FloatArray  # (A + M + 3 r, nv)
    square: FloatArray  # (2 r + BESIDE + 2 p r, r)
    high: FloatArray  # (HIGH, M)
    each: FloatArray  # (EACH, p)
    samples: FloatArray  # (SAMPLE p,)
    curves: FloatArray  # (CURVE p,)
    bent: FloatArray  # (2 p (nv + 1),) how the arm was bent, then the same before this step
    patience: FloatArray  # (PATIENCE_HEAD + 3 p + nv,) as levels.patience_kernel has it


class Index(NamedTuple):
    """What is counted."""

    order: IntArray  # (nv,) room
    active: IntArray  # (nv + 2,) the engine's guess
    first: IntArray  # (p + 1,) where each task's rows begin
    joint: IntArray  # (p,) that carries its frame
    counts: IntArray  # (p,) its rows
    fits: IntArray  # (p,) their kind
    again: IntArray  # (p,) the same when asked again
    dof: IntArray  # (M,) which of the six rows of its frame a row is, or which tangent coordinate


@lean_part
def opened(ints: IntArray, floats: FloatArray) -> Store:
    """The blocks, as views."""
    n, p, m, r = ints[NV], ints[TASKS], ints[ROWS], ints[LARGEST]
    twelve, wide, square = 2 * n + 4 * p + 1, A + m + 3 * r, 2 * r + BESIDE + 2 * p * r
    a = HEAD + 12 * twelve
    b = a + wide * n
    c = b + square * r
    d = c + HIGH * m
    e = d + EACH * p
    f = e + SAMPLE * p
    g = f + CURVE * p
    h = g + 2 * p * (n + 1)
    return Store(
        ints,
        floats[:HEAD],
        floats[HEAD:a].reshape((twelve, 12)),
        floats[a:b].reshape((wide, n)),
        floats[b:c].reshape((square, r)),
        floats[c:d].reshape((HIGH, m)),
        floats[d:e].reshape((EACH, p)),
        floats[e:f],
        floats[f:g],
        floats[g:h],
        floats[h:],
    )


def sizes(n: int, p: int, m: int, r: int) -> tuple[int, int]:
    """How long the two arrays are."""
    floats = HEAD + 12 * (2 * n + 4 * p + 1) + (A + m + 3 * r) * n + (2 * r + BESIDE + 2 * p * r) * r
    floats += HIGH * m + (EACH + SAMPLE + CURVE) * p + 2 * p * (n + 1) + PATIENCE_HEAD + 3 * p + n
    return INTS_HEAD + 5 * n + 2 + 5 * p + 1 + m, floats


@lean_part
def chain_in(s: Store) -> Chain:
    """The tree."""
    n, a = s.ints[NV], INTS_HEAD
    return Chain(s.ints[a : a + n], s.ints[a + n : a + 2 * n], s.ints[a + 2 * n : a + 3 * n], s.twelve[:n])


@lean_part
def index_in(s: Store) -> Index:
    """The integers behind the tree's."""
    n, p, m = s.ints[NV], s.ints[TASKS], s.ints[ROWS]
    a = INTS_HEAD + 3 * n
    b, c = a + n, a + 2 * n + 2
    d = c + p + 1
    return Index(
        s.ints[a:b],
        s.ints[b:c],
        s.ints[c:d],
        s.ints[d : d + p],
        s.ints[d + p : d + 2 * p],
        s.ints[d + 2 * p : d + 3 * p],
        s.ints[d + 3 * p : d + 4 * p],
        s.ints[d + 4 * p : d + 4 * p + m],
    )


@lean_part
def room_in(s: Store) -> Room:
    """Room for the approach."""
    r = s.ints[LARGEST]
    a, b = A + s.ints[ROWS], 2 * r + DIRECTION_ROWS
    return Room(
        index_in(s).order,
        s.head[SIX:HEAD],
        s.square[b],
        s.square[:r],
        s.wide[a : a + r],
        s.square[r : 2 * r],
        s.wide[a + r : a + 2 * r],
        s.square[2 * r : b],
        s.square[b + 1],
        s.square[b + 2],
        s.wide[X],
        s.wide[STOOD],
        s.wide[a + 2 * r : a + 3 * r],
        s.head[:0],
        s.wide[:0],
    )


@lean_part
def straightened(s: Store) -> None:
    """Begin anew with singular vectors that were turned from step to step, before round-off has bent them."""
    r, p = s.ints[LARGEST], s.ints[TASKS]
    begin = 2 * r + BESIDE
    for i in range(2 * p * r):
        for j in range(r):
            s.square[begin + i, j] = 1.0 if i % r == j else 0.0


@lean_part
def forgotten(s: Store) -> None:
    """As before the first step."""
    p = s.ints[TASKS]
    s.ints[BEGINS], s.ints[COUNT], s.head[BEFORE], s.head[BEGAN] = 1, 0, 0.0, 0.0
    index_in(s).active[0] = 0
    for k in range(p):
        s.each[DELAY, k], s.each[SHARE, k], s.each[PACE, k], s.each[PACED, k] = 0.0, 1.0, 1.0, 1.0
    for i in range(s.bent.shape[0]):
        s.bent[i] = 0.0
    forget(s.patience, p, s.patience[PATIENCE])


@lean_part
def own_times(s: Store, t: float) -> None:
    """Each task's own time, later by what its path has waited: as :meth:`cartctl.motion.clock.PathClocks.times`."""
    passed = 0.0 if s.ints[BEGINS] != 0 else max(t - s.head[BEFORE], 0.0)
    for k in range(s.ints[TASKS]):
        s.each[OWN, k] = t - s.each[DELAY, k] - (1.0 - s.each[SHARE, k]) * passed
