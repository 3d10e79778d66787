"""Proofs: unit normals that cancel, written as multipliers of the caller's own rows and bounds.

``n_e + sum_j y_j n_j = 0`` over an implied or contradicting member e and the working set. A proof vector has one entry
for every equation row, joint and constraint row; a positive one of an inequality uses its lower bound, a negative one
its upper bound. :mod:`cartctl.algebra.certificate` checks it without any of this.
"""

from __future__ import annotations

from cartctl.checks import FloatArray
from cartctl.kernels import part
from cartctl.solvers.exact.inequalities import Inequalities
from cartctl.solvers.exact.working_set import LAM, NUM, WHO, WorkingSet, Y

NOBODY = -(1 << 40)  # the code of no member


@part
def write_proof(w: WorkingSet, q: Inequalities, norm: FloatArray, implied: int, proof: FloatArray) -> None:
    """Add the members with their shares y, and the implied one with share 1, to a proof vector (may be empty)."""
    if proof.shape[0] == 0:
        return
    for j in range(w.K[NUM, 0]):
        credit(q, norm, w.K[WHO, j], w.V[Y, j], proof)
    if implied != NOBODY:
        credit(q, norm, implied, 1.0, proof)


@part
def write_multipliers(w: WorkingSet, q: Inequalities, norm: FloatArray, proof: FloatArray) -> None:
    """Add the members with their multipliers to a proof vector (may be empty)."""
    if proof.shape[0] == 0:
        return
    for j in range(w.K[NUM, 0]):
        credit(q, norm, w.K[WHO, j], w.V[LAM, j], proof)


@part
def credit(q: Inequalities, norm: FloatArray, who: int, share: float, proof: FloatArray) -> None:
    """One member's share, in units of the caller's row."""
    if who < 0:
        row = -1 - who
        proof[row] += share / norm[row] if norm[row] > 0.0 else share
        return
    i = who >> 1
    proof[norm.shape[0] + i] += (share if who & 1 == 0 else -share) / q.norm[i]
