"""Parallel axes that a URDF writes with 12 digits: dust of 1e-13 in a Jacobian decides nothing."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

import cartctl as cc

DATA = Path(__file__).parent / "data"


def arm(seed: int, dust: float) -> cc.Problem:
    """Six joints, the second and third about parallel axes: an orientation, then a posture or an elbow, in a box.

    The box is a step of an accelerating arm's: as wide for each joint, and joints at one speed have one box.
    """
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(3, 6))
    A /= np.linalg.norm(A, axis=0)
    A[:, 0], A[:, 2] = [0.0, 0.0, -1.0], -A[:, 1]
    A[2, 1:3] = 0.0
    clean = A.copy()
    A += dust * rng.normal(size=A.shape) * np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
    v = 0.4 * rng.normal(size=6)
    v[4] = v[3]
    v[5] = v[3] if seed % 2 else v[5]
    half = 0.02
    elbow = np.zeros((3, 6))
    elbow[:, :3] = 0.4 * rng.normal(size=(3, 3))
    asked = cc.Equation(A, clean @ (v + 0.5 * half * rng.uniform(-1.0, 1.0, 6)) / rng.uniform(0.01, 0.3), name="hand")
    lower = [cc.Equation(elbow, 0.1 * rng.normal(size=3), fit="least_squares", name="elbow")] if seed % 3 else []
    posture = cc.Equation(np.eye(6), 10.0 * rng.normal(size=6), fit="least_squares", name="posture")
    return cc.Problem([asked, *lower, posture], lower=v - half, upper=v + half)


def test_dust_decides_nothing() -> None:
    for seed in range(800):  # three of them end elsewhere if a joint that depends on others by all but dust counts
        clean, dusty = cc.solve(arm(seed, 0.0), "sns"), cc.solve(arm(seed, 1e-13), "sns")
        assert dusty.outcome == clean.outcome, seed
        np.testing.assert_allclose(dusty.scales, clean.scales, atol=1e-9, err_msg=str(seed))
        np.testing.assert_allclose(dusty.u, clean.u, atol=1e-7, err_msg=str(seed))
        assert dusty.status is not cc.Status.UNPROVEN and dusty.certificate().holds(), seed


def test_a_large_level_that_comes_to_no_end_is_skipped_with_a_proof() -> None:
    """60 joints, a task whose largest scale is 0: of two contradictions each puts the other in its place for ever."""
    x = np.load(DATA / "large_nearly_singular.npz")
    fits = ["scale", "scale", "scale", "least_squares"]
    equations = [cc.Equation(x[f"A{k}"], x[f"b{k}"], fit=fit) for k, fit in enumerate(fits)]
    problem = cc.Problem(
        equations, lower=x["lower"], upper=x["upper"], constraints=(x["C"], x["c_lower"], x["c_upper"])
    )
    found = cc.solve(problem, "sns")
    assert found.status is cc.Status.SKIPPED
    np.testing.assert_array_equal(found.scales, [1.0, 1.0, np.nan, 1.0])
    assert found.certificate().holds()


def test_a_small_share_of_a_large_proof_counts() -> None:
    """Shares of 1e11 and 1e7 in what limits a scale: the small one is no round-off of the others."""
    given = json.loads((DATA / "stretched_arm.json").read_text())
    A, b = np.array(given["A"]), np.array(given["b"])
    hand, elbow = cc.Equation(A[:2], b[:2]), cc.Equation(A[2:], b[2:])
    found = cc.solve(cc.Problem([hand, elbow], lower=given["lower"], upper=given["upper"]), "sns")
    assert found.status is cc.Status.SKIPPED and found.certificate().holds()
    np.testing.assert_allclose(found.scales, [0.007778873765953, np.nan], rtol=1e-9)


def test_a_scale_leaves_levels_below_a_point_that_exists() -> None:
    """A bound is missed by 1e-7 where 1e-14 less of the scale makes room for it: the posture below found no point."""
    given = {key: np.array(value) for key, value in json.loads((DATA / "folded_arm.json").read_text()).items()}
    A, b = given["A"], given["b"]
    hand = cc.Equation(A[:3], b[:3], drift=given["drift"])
    elbow = cc.Equation(A[3:], b[3:], fit="least_squares")
    box = {"lower": given["lower"], "upper": given["upper"]}
    found = cc.solve(cc.Problem([hand, elbow], **box, reference=given["reference"]), "sns")
    assert found.status is cc.Status.SCALED and found.certificate().holds()
    np.testing.assert_allclose(found.scales, [4.4798852335e-04, 1.0], rtol=1e-9)
