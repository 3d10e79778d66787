"""What is left to a task below one at the edge: the nearest that a motion of bounded speed in the null space gets."""

from __future__ import annotations

import numpy as np
import pytest

from cartctl.levels.calming import Above


def stacked(rng: np.random.Generator, calm: float, degenerate: bool) -> tuple[Above, np.ndarray, np.ndarray]:
    """Two tasks above, and one below: a posture, whose null-space part has one singular value, or rows of all sizes."""
    above = Above(ranked=True)
    for m in (2, 1):
        above.add(rng.normal(size=(m, 7)), rng.normal(size=m), calm)
    J = np.eye(7) if degenerate else rng.normal(size=(4, 7)) * np.array([[1.0], [1e-2], [1e-4], [1.0]])
    return above, J, 3.0 * rng.normal(size=J.shape[0])


def parts(above: Above) -> tuple[np.ndarray, np.ndarray]:
    """The least motion that does what is asked above, and a basis of the null space."""
    rows, asked = np.concatenate(above._rows), np.concatenate(above._asked)
    return np.linalg.pinv(rows) @ asked, np.linalg.svd(rows)[2][len(rows) :].T


@pytest.mark.parametrize("degenerate", [False, True])
def test_no_motion_as_slow_comes_nearer(degenerate: bool) -> None:
    rng = np.random.default_rng(7)
    for calm in (0.0, 1e-6, 0.1, 1.0, 10.0):
        for _ in range(20):
            above, J, b = stacked(rng, calm, degenerate)
            given, N = parts(above)
            held = above.calmed(J, b, None)
            w = np.linalg.lstsq(J @ N, held - J @ given, rcond=1e-12)[0]
            assert np.linalg.norm(w) <= calm * (1.0 + 1e-6) + 1e-12
            np.testing.assert_allclose(J @ (given + N @ w), held, atol=1e-9)
            missed = np.linalg.norm(b - held)
            for other in rng.normal(size=(50, N.shape[1])):
                near = w + 1e-3 * other
                near *= min(1.0, calm / np.linalg.norm(near))
                assert np.linalg.norm(b - J @ (given + N @ near)) >= missed - 1e-9


def test_it_does_not_depend_on_how_the_rows_are_turned() -> None:
    """Singular vectors of equal singular values may be any."""
    rng = np.random.default_rng(8)
    for _ in range(20):
        above, J, b = stacked(rng, 0.5, True)
        turn = np.linalg.qr(rng.normal(size=(7, 7)))[0]
        np.testing.assert_allclose(above.calmed(turn @ J, turn @ b, None), turn @ above.calmed(J, b, None), atol=1e-10)


def test_joints_that_are_kept_have_no_part() -> None:
    rng = np.random.default_rng(9)
    for _ in range(20):
        above, J, b = stacked(rng, 0.3, False)
        upper = np.where(rng.random(7) < 0.3, 0.0, 1.0)
        without = Above(ranked=True)
        for rows, asked in zip(above._rows, above._asked, strict=True):
            without.add(rows[:, upper > 0.0], asked, 0.3)
        held = above.calmed(J, b, (np.zeros(7), upper))
        np.testing.assert_allclose(held, without.calmed(J[:, upper > 0.0], b, None), atol=1e-9)


def test_what_is_slow_enough_is_left_as_it_is() -> None:
    rng = np.random.default_rng(10)
    for _ in range(20):
        above, J, _ = stacked(rng, 1.0, True)
        given, N = parts(above)
        w = rng.normal(size=4)
        b = given + N @ (0.9 * w / np.linalg.norm(w))
        np.testing.assert_allclose(above.calmed(J, b, None), b, atol=1e-12)
