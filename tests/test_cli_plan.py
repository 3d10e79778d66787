"""``cartctl plan`` as its users meet it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import cartctl as cc
from cartctl.cli.choices import PLAN_OBJECTIVES
from cartctl.wholepath.costs import NAMED
from tests.test_cli import arm, assert_readable, cartctl, plain, the_error  # noqa: F401

QUICK = ("--samples", "16", "--period", "3", "--radius", "0.08")


def test_a_plan_with_its_files(arm: str, plain: None) -> None:  # noqa: F811
    result = cartctl("plan", arm, *QUICK, "--closed", "--free-start", "--objective", "joint-speed")
    assert result.exit_code == 0, result.output
    assert_readable(result.stdout)
    for words in ("start free, closed", "joint-speed", "sns", "of plan's", "task error, m", "100 %"):
        assert words in result.stdout, words
    run = cc.Run.load("out/three-circle-plan-joint-speed.npz")
    assert np.linalg.norm(run.robot.difference(run.q[0], run.q[-1])) < 1e-8
    assert run.metrics().tasks[0].max_m < 1e-6 and run.meta["plan"]["status"] == "OPTIMAL"
    assert Path("out/three-circle-plan-joint-speed.html").is_file()
    assert Path("out/three-circle-plan-joint-speed-report.png").stat().st_size > 1e4


def test_a_plan_that_cannot_be_says_why(arm: str, plain: None) -> None:  # noqa: F811
    result = cartctl(
        "plan", arm, "--samples", "16", "--period", "0.2", "--radius", "0.15", "--objective", "joint-speed"
    )
    assert result.exit_code == 1
    assert "no plan: sample" in result.stderr and "velocity of joint" in result.stderr
    assert "not feasible" in result.stdout and "Traceback" not in result.output


def test_without_limits(arm: str, plain: None) -> None:  # noqa: F811
    result = cartctl("plan", arm, *QUICK[:2], "--period", "0.3", "--no-limits", "--objective", "joint-speed")
    assert result.exit_code == 0, result.output
    assert "not asked for" in result.stdout and "sns" not in result.stdout


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--objective", "energy"), "unknown objective"),
        (("--objective", "joint-speed", "--samples", "2"), "samples is 2"),
        ((), "plan with the objective 'joint-speed'"),
        (("--radius", "-1"), "--radius"),
    ],
)
def test_misuse(arm: str, options: tuple[str, ...], words: str) -> None:  # noqa: F811
    assert words in the_error(cartctl("plan", arm, *options))


def test_the_objectives_are_the_planners() -> None:
    assert tuple(NAMED) == PLAN_OBJECTIVES
