"""The lowest point of a sum of squared misses along a line, against its value everywhere."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cartctl.solvers.exact.line_search import lowest_at


def sums(rows, low, high, u, p, far):
    """``sum_i dist(a_i . (u + far p), [low_i, high_i])^2`` at each of far (N,)."""
    x = (rows @ u)[:, None] + (rows @ p)[:, None] * far
    return (np.maximum(low[:, None] - x, 0.0) ** 2 + np.maximum(x - high[:, None], 0.0) ** 2).sum(axis=0)


@settings(max_examples=300, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from([0.5, 1.0, 3.0, np.inf]), st.booleans())
def test_nowhere_on_the_way_is_it_lower(seed, most, whole):
    """Whole numbers start on ends of intervals, where a row is in or out by the last bit."""
    rng = np.random.default_rng(seed)
    m, n = rng.integers(1, 6), rng.integers(1, 5)
    draw = (lambda size: rng.integers(-3, 4, size) / 3.0) if whole else rng.normal
    rows, u, p = draw(size=(m, n)), draw(size=n), draw(size=n)
    low = rows @ u - np.abs(draw(size=m)) * rng.integers(0, 2, m)
    high = low + np.abs(draw(size=m)) * rng.integers(0, 2, m)
    high[0] = low[0] + 1.0  # of equations alone, the step is known to end where the sum is least
    low[rng.random(m) < 0.2], high[rng.random(m) < 0.2] = -np.inf, np.inf
    far = lowest_at(rows, low, high, u, p, most)
    assert 0.0 <= far <= most
    rate = rows @ p
    ends = [(side - rows @ u) / rate for side in (low, high)] if np.all(rate != 0.0) else []
    tried = np.concatenate([np.linspace(0.0, min(most, 20.0), 500), far + 1e-4 * np.arange(-3, 4), *ends])
    tried = tried[(tried >= 0.0) & (tried <= most) & np.isfinite(tried)]
    values = sums(rows, low, high, u, p, tried)
    here = sums(rows, low, high, u, p, np.array([far]))[0]
    if np.isfinite(here):
        assert here <= values.min() + 1e-12 * (1.0 + values.max())


@pytest.mark.parametrize("last_bit", [-1.0, 0.0, 1.0])
def test_a_row_on_the_end_of_its_interval_counts_from_there_on(last_bit):
    """Two rows miss by 1 and more of each other's way: the middle is lowest, not where the second is as far out."""
    rows, u = np.array([[1.0], [-1.0]]), np.array([-4.0 / 3.0])
    end = 4.0 / 3.0 + last_bit * np.spacing(4.0 / 3.0)
    low, high = np.array([-1.0 / 3.0, -np.inf]), np.array([np.inf, end])
    assert lowest_at(rows, low, high, u, np.array([1.0]), np.inf) == pytest.approx(1.0)  # away from the second's end
    high[1], low[1] = np.inf, end
    assert lowest_at(rows, low, high, u, np.array([1.0]), np.inf) == pytest.approx(0.5)  # leaving it
