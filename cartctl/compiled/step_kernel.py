"""One step of a controller on its store, in one call for each solver: look, hold back, answer, keep what lasts."""

from __future__ import annotations

from cartctl.checks import FloatArray, IntArray
from cartctl.compiled import store_kernel as at
from cartctl.compiled.answer_kernel import FAILED, by_ranks, exact, least_squares, made, told
from cartctl.compiled.hold_kernel import hold_back
from cartctl.compiled.look_kernel import ASTRAY, RECOVERING, REFUSED, look
from cartctl.compiled.store_kernel import Store, index_in, opened
from cartctl.kernels import kernel, lean_part
from cartctl.levels.patience_kernel import SHARE, slow_down

OUTCOME, BITS = 63, 64  # what a step returns: its status and the bits beside that, and times BITS those of looking
LEFT = BITS * (REFUSED | ASTRAY)
TASKS, HELD, LOOKS, SCALE, AGAIN = at.TASKS, at.HELD, at.LOOKS, at.SCALE, at.AGAIN
JOINTS, LOWER, UPPER, DT = at.JOINTS, at.LOWER, at.UPPER, at.DT


@lean_part
def _begun(s: Store) -> None:
    for k in range(s.ints[TASKS]):
        s.each[SCALE, k], s.each[AGAIN, k] = 1.0, 0.0


@lean_part
def _ended(s: Store, t: float, bits: int, outcome: int, u: FloatArray, out: FloatArray) -> int:
    """Nothing is kept of a step that failed where somebody else will answer it, who then wants a copy."""
    if outcome & 15 != FAILED or out.shape[0] == 0:
        made(s, t)
        if out.shape[0] > 0:
            told(s, u, out)
    return BITS * bits + outcome


@kernel("int(out_int_store, out_store, vector, vector, float, out_store, out_store)", fast=True, lean=True)
def step_sns(
    ints: IntArray, floats: FloatArray, q: FloatArray, v: FloatArray, t: float, u: FloatArray, out: FloatArray
) -> int:
    """A step from q (nq,), v (nv,) at time t by the exact engine: how it went, LEFT where there is no answer.

    Paths have been sampled at the tasks' own times. u (nv,) and out, room for a copy of the step
    (:func:`cartctl.compiled.answer_kernel.told_size`), may both be empty: u is then taken from the store.
    """
    s = opened(ints, floats)
    bits = look(s, q, v, t)
    if BITS * bits & LEFT or ints[LOOKS] != 0:
        return BITS * bits
    if ints[HELD] != 0:
        hold_back(s)
        if bits & RECOVERING == 0 and s.patience[SHARE] < 1.0:
            joints = s.wide[JOINTS : JOINTS + 4]
            slow_down(v, joints, s.patience[SHARE], s.head[DT], False, s.wide[LOWER], s.wide[UPPER])
    _begun(s)
    return _ended(s, t, bits, exact(s), u, out)


@kernel("int(out_int_store, out_store, vector, vector, float, out_store, out_store)", fast=True, lean=True)
def step_dls(
    ints: IntArray, floats: FloatArray, q: FloatArray, v: FloatArray, t: float, u: FloatArray, out: FloatArray
) -> int:
    """The same by damped least squares, which knows no bounds to be held back for."""
    s = opened(ints, floats)
    bits = look(s, q, v, t)
    if BITS * bits & LEFT or ints[LOOKS] != 0:
        return BITS * bits
    _begun(s)
    return _ended(s, t, bits, least_squares(s, index_in(s).first), u, out)


@kernel("int(out_int_store, out_store, vector, vector, float, out_store, out_store)", fast=True, lean=True)
def step_ranks(
    ints: IntArray, floats: FloatArray, q: FloatArray, v: FloatArray, t: float, u: FloatArray, out: FloatArray
) -> int:
    """The same by task priority."""
    s = opened(ints, floats)
    bits = look(s, q, v, t)
    if BITS * bits & LEFT or ints[LOOKS] != 0:
        return BITS * bits
    _begun(s)
    return _ended(s, t, bits, by_ranks(s), u, out)
