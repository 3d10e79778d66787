"""Profiles, means and regressions against what can be worked out by hand."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cartctl.bench.regressions import WATCHED, compare
from cartctl.bench.schema import COLUMNS, FIGURES
from cartctl.bench.statistics import PENALTY, present, scores, tallies
from cartctl.errors import ParameterError


def row(solver: str, scenario: str = "a", **figures: Any) -> dict[str, Any]:
    given = {"solver": solver, "scenario": scenario, "level": "velocity", "repeat": 0, "seed": 0, "outcome": "done"}
    return {c.name: None for c in COLUMNS} | given | {"valid": True, "solved": True} | figures


ROWS = [
    row("p", "a", effort=1.0), row("q", "a", effort=2.0), row("r", "a", effort=4.0),
    row("p", "b", effort=6.0), row("q", "b", effort=3.0), row("r", "b", effort=3.0, valid=False),
    row("p", "c", valid=False), row("q", "c", outcome="failed", valid=False), row("r", "c", valid=False),
]  # fmt: skip


def test_profiles_are_shares_of_cells() -> None:
    """By hand: ratios a: 1 2 4; b: 2 1 inf; c is left out, for nobody has a value there."""
    found = scores(ROWS, "effort")
    assert found.solvers == ("p", "q", "r") and len(found.cells) == 2
    rho = found.profile(np.array([1.0, 1.99, 2.0, 4.0, 1e9]))
    assert rho.tolist() == [[0.5, 0.5, 1.0, 1.0, 1.0], [0.5, 0.5, 1.0, 1.0, 1.0], [0.0, 0.0, 0.0, 0.5, 0.5]]


def test_means_are_shifted_geometric_and_the_best_is_one() -> None:
    """By hand: s = median(1, 2, 4, 6, 3) = 3; r counts ten times the worst valid one in b."""
    means = {
        "p": math.sqrt((1.0 + 3.0) * (6.0 + 3.0)) - 3.0,
        "q": math.sqrt((2.0 + 3.0) * (3.0 + 3.0)) - 3.0,
        "r": math.sqrt((4.0 + 3.0) * (PENALTY * 6.0 + 3.0)) - 3.0,
    }
    best = min(means.values())
    assert scores(ROWS, "effort").means() == pytest.approx({name: m / best for name, m in means.items()})


def test_what_should_be_high_is_turned_round() -> None:
    rows = [row("p", manipulability=0.5), row("q", manipulability=0.25), row("r", manipulability=0.0)]
    assert scores(rows, "manipulability").ratios()[0] == pytest.approx([1.0, 2.0, 0.5e6])  # 0 counts as the floor


def test_round_off_makes_no_ratio() -> None:
    rows = [row("p", rms_m=1e-15), row("q", rms_m=1e-9), row("r", rms_m=1e-3)]
    assert scores(rows, "rms_m").ratios()[0] == pytest.approx([1.0, 1.0, 1e3])


@given(st.lists(st.lists(st.floats(1e-3, 1e3), min_size=3, max_size=3), min_size=1, max_size=8), st.floats(0.1, 10.0))
def test_profiles_rise_and_do_not_depend_on_units(cells: list[list[float]], unit: float) -> None:
    def of(factor: float) -> Any:
        rows = [row(s, str(k), effort=factor * t) for k, c in enumerate(cells) for s, t in zip("pqr", c, strict=True)]
        return scores(rows, "effort")

    found, taus = of(1.0), np.geomspace(1.0, 1e7, 50)
    rho = found.profile(taus)
    assert (np.diff(rho, axis=1) >= 0.0).all() and (rho[:, -1] == 1.0).all()
    assert rho[:, 0].sum() >= 1.0  # in every cell somebody is the best
    assert min(found.means().values()) == 1.0
    assert of(unit).means() == pytest.approx(found.means(), rel=1e-6)


def test_nothing_valid_is_no_trouble() -> None:
    found = scores([row("p", valid=False)], "effort")
    assert found.means() == {} and found.profile(np.ones(3)).shape == (1, 3)


def test_peers_that_are_not_there_are_left_out() -> None:
    rows = [row("p"), row("pink", outcome="skipped", valid=False), row("q", outcome="refused", valid=False)]
    assert {r["solver"] for r in present(rows)} == {"p", "q"}
    refused = tallies(rows)["q"]
    assert (refused.runs, refused.done, refused.valid) == (1, 0, 0)


def test_nothing_has_changed_is_no_regression() -> None:
    verdict = compare(ROWS, ROWS)
    assert not verdict.regressions and not verdict.improvements and verdict.compared == 9


@pytest.mark.parametrize(
    ("before", "after", "worse"),
    [
        ({"effort": 1.0}, {"effort": 1.04}, None),
        ({"effort": 1.0}, {"effort": 1.06}, "effort"),
        ({"rms_m": 1e-9}, {"rms_m": 9e-7}, None),  # both count as nothing
        ({"rms_m": 1e-9}, {"rms_m": 3e-6}, "rms_m"),
        ({"manipulability": 1.0}, {"manipulability": 0.9}, "manipulability"),
        ({"manipulability": 0.9}, {"manipulability": 1.0}, None),
        ({"margin": 0.01}, {"margin": -0.01}, "margin"),
        ({"flips": 3}, {"flips": 4}, None),
        ({"flips": 3}, {"flips": 9}, "flips"),
        ({"violations": 0}, {"violations": 2}, "violations"),
        ({"effort": 1.0}, {"effort": None}, "effort"),
        ({}, {"solved": False}, "solved"),
        ({}, {"outcome": "failed"}, "outcome"),
        ({"outcome": "failed"}, {}, None),
        ({"step_p50": 1e-4}, {"step_p50": 9e-4}, None),  # times are watched only on request
    ],
)
def test_regressions_are_what_became_worse(before: Any, after: Any, worse: str | None) -> None:
    verdict = compare([row("p", **before)], [row("p", **after)])
    assert [r.figure for r in verdict.regressions] == ([] if worse is None else [worse])
    assert (verdict.improvements == []) or worse is None


def test_times_and_tolerance_can_be_chosen() -> None:
    slow = [row("p", step_p50=9e-4, effort=1.2)]
    verdict = compare([row("p", step_p50=1e-4, effort=1.0)], slow, 0.3, [*WATCHED, "step_p50"])
    assert [r.figure for r in verdict.regressions] == ["step_p50"]
    with pytest.raises(ParameterError, match="tolerance is -1"):
        compare(slow, slow, -1.0)
    with pytest.raises(ParameterError, match="figure 'efort' is not one of"):
        compare(slow, slow, 0.1, ["efort"])
    assert set(WATCHED) < set(FIGURES)


def test_runs_that_are_gone_are_regressions_unless_allowed() -> None:
    before, after = [row("p"), row("q")], [row("p"), row("new")]
    verdict = compare(before, after)
    assert [r.figure for r in verdict.regressions] == ["gone"] and (verdict.gone, verdict.new) == (1, 1)
    assert not compare(before, after, allow_missing=True).regressions
