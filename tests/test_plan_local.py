"""Plans against local methods on random paths: a few are planned here, many are stored by benchmarks/plan_paths.py."""

from __future__ import annotations

import csv
import sys
from pathlib import Path

import numpy as np
import pytest

import cartctl as cc

BENCHMARKS = Path(__file__).resolve().parents[1] / "benchmarks"
SAMPLES = 40


@pytest.mark.parametrize("name", ["panda", "lwr"])
def test_never_worse_than_a_local_method_within_the_limits(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """By the same quadrature, from the same start; better on most paths, if only by a little."""
    monkeypatch.setattr(sys, "path", [str(BENCHMARKS), *sys.path])
    from plan_paths import limits_of, planned, random_path

    robot, rng, better, counted = cc.load(name), np.random.default_rng(8), 0, 0
    limits = limits_of(robot)
    for _ in range(5):
        q0, _, _, path = random_path(robot, rng)
        hand = cc.FrameTask(robot.tool, target=path)
        heavy = cc.Controller(robot, hand, "pinv", limits=None, metric="inertia", dt=path.duration / (SAMPLES - 1) / 10)
        report = planned(robot, limits, q0, path, SAMPLES, methods=["pinv", heavy]).report
        if report.best is None:
            continue
        counted += 1
        assert report.feasible and report.excess <= 0.0, report.message
        assert max(report.residual) < 1e-6
        assert report.cost <= report.best.cost * (1.0 + 1e-9)
        better += report.cost < report.best.cost * (1.0 - 1e-6)
    assert counted >= 2 and better > counted / 2


def test_what_is_stored_says_the_same() -> None:
    with (BENCHMARKS / "results" / "plan_paths.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert {r["robot"] for r in rows} == {"panda", "lwr"} and len(rows) >= 50
    ratios = np.array([float(r["ratio"]) for r in rows])
    assert ratios.max() <= 1.0 and (ratios < 1.0 - 1e-6).sum() > 0.9 * len(rows)
    for r in rows:
        assert r["status"] in ("OPTIMAL", "NOT_CONVERGED")
        assert float(r["residual_m"]) < 1e-6 and float(r["residual_rad"]) < 1e-6 and float(r["excess"]) <= 0.0
