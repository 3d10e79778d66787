"""Peers: the protocol with one written here, those that are installed, and those that are not."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from typing import Any

import pytest

from cartctl import bench
from cartctl.bench.building import Stage
from cartctl.bench.methods import MethodNotFound, methods
from cartctl.bench.peers import peers, rollout
from cartctl.bench.table import results
from cartctl.errors import ParameterError
from tests.bench_scenarios import short

# A peer as anybody could write it: it knows json and nothing of cartctl, and stands still, or walks away.
STILL = """
import json, sys
def roll(request):
    n = len(request["targets"])
    q = [[x + {speed} * k * request["dt"] for x in request["q0"]] for k in range(n + 1)]
    return {{"q": q, "times": [1e-5] * n, "version": "1.2"}}
if __name__ == "__main__":
    print("some chatter of a package")
    print(json.dumps(roll(json.load(sys.stdin))))
"""
HAND = {"axes": "position", "target": {"kind": "circle", "radius": 0.1, "period": 1.0}}


@pytest.fixture
def still(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    file = tmp_path / "still.py"
    file.write_text(STILL.format(speed=0.0))
    monkeypatch.setenv("CARTCTL_PEERS", f"still={file}")
    return file


def panda(**changes: Any) -> Any:
    return short(**{"robot": "panda", "limits": "robot", "tasks": [HAND], "duration": 0.2, **changes})


@pytest.mark.parametrize("own_python", [False, True])
def test_a_peer_stands_in_the_same_table(
    tmp_path: Path, still: Path, monkeypatch: pytest.MonkeyPatch, own_python: bool
) -> None:
    if own_python:
        monkeypatch.setenv("CARTCTL_PEER_STILL", sys.executable)
    bench.run(panda(), ["pinv", "still"], out=tmp_path / "out")
    mine, other = results(tmp_path / "out")
    assert other["solver"] == "still" and other["peer"] and other["outcome"] == "done" and not mine["peer"]
    assert other["steps"] == mine["steps"] == 20 and other["effort"] == 0.0 and other["step_p50"] == 1e-5
    stage = Stage(panda())  # standing still, the error is how far the target went
    path, start = stage.tasks[0].target, stage.robot.state(stage.start).position(stage.robot.tool)
    away = max(float(((path(0.01 * k).position - start) ** 2).sum()) ** 0.5 for k in range(21))
    assert other["max_m"] == pytest.approx(away, rel=1e-9) and mine["max_m"] < 0.1 * away


def test_a_peers_motion_is_measured_as_all_are(tmp_path: Path, still: Path) -> None:
    still.write_text(STILL.format(speed=5.0))  # rad/s, beyond every limit
    bench.run(panda(), "still", out=tmp_path / "out")
    (row,) = results(tmp_path / "out")
    assert row["effort"] == pytest.approx(7 * 25.0 * 0.2) and row["violations"] > 0 and not row["valid"]


def test_what_a_peer_is_asked_says_everything(still: Path) -> None:
    request = rollout.ask(Stage(panda(tasks=[HAND, {"kind": "posture"}])))
    assert request["joints"] == [f"panda_joint{k}" for k in range(1, 8)] and request["frame"] == "panda_hand_tcp"
    assert request["position_only"] and request["posture"] and len(request["targets"]) == 20
    assert max(request["upper"]) < 4.0 and max(request["acceleration"]) == 20.0 and "<robot" in request["urdf"]


@pytest.mark.parametrize(
    ("scenario", "level", "words"),
    [
        ({}, "acceleration", "velocities only"),
        ({"tasks": [HAND, HAND]}, "velocity", "a single task"),
        ({"tasks": [{"kind": "com"}]}, "velocity", "one frame's task"),
        ({"tasks": [{"axes": "xy"}]}, "velocity", "a whole pose or a position"),
        ({"robot": "kinova", "tasks": [{}]}, "velocity", "one number each"),
        ({"scene": [{"shape": "sphere", "name": "b", "radius": 0.1, "at": [2, 2, 2]}]}, "velocity", "no obstacles"),
    ],
)
def test_what_no_peer_can_is_skipped_with_the_reason(
    tmp_path: Path, still: Path, scenario: dict[str, Any], level: str, words: str
) -> None:
    bench.run(panda(**scenario), "still", out=tmp_path / "out", levels=[level])
    (row,) = results(tmp_path / "out")
    assert row["outcome"] == "skipped" and words in row["reason"] and not row["valid"]


def test_a_peer_that_is_not_there_is_skipped_with_the_way_to_get_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    find = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name, *more: None if name == "pink" else find(name, *more))
    monkeypatch.delenv("CARTCTL_PEER_PINK", raising=False)
    bench.run(panda(), "pink", out=tmp_path)
    (row,) = results(tmp_path)
    assert row["outcome"] == "skipped"
    assert row["reason"] == (
        "pink is not installed; pip install pin-pink, or set CARTCTL_PEER_PINK to a Python that has it"
    )


@pytest.mark.parametrize(
    ("source", "words"),
    [
        ("raise SystemExit('no licence')", "ended with 1: no licence"),
        ('print(\'{"q": [[0.0]], "times": []}\')', "answered with q of shape (1, 1)"),
    ],
)
def test_a_peer_that_fails_is_named(
    tmp_path: Path, still: Path, monkeypatch: pytest.MonkeyPatch, source: str, words: str
) -> None:
    still.write_text(source)
    monkeypatch.setenv("CARTCTL_PEER_STILL", sys.executable)
    bench.run(panda(), "still", out=tmp_path / "out")
    (row,) = results(tmp_path / "out")
    assert row["outcome"] == "skipped" and words in row["reason"]


def test_bad_names_and_variables_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(MethodNotFound, match="did you mean 'placo'"):
        methods(["plako"])
    assert {m.name for m in methods(["peers"])} == {"pink", "roboticstoolbox", "placo"}
    monkeypatch.setenv("CARTCTL_PEERS", "nonsense")
    with pytest.raises(ParameterError, match="CARTCTL_PEERS holds 'nonsense'"):
        peers()
    monkeypatch.delenv("CARTCTL_PEERS")
    monkeypatch.setenv("CARTCTL_PEER_PLACO", "/no/such/python")
    assert "is no file; expected a Python" in peers()["placo"].missing()


@pytest.mark.parametrize("name", ["pink", "roboticstoolbox", "placo"])
@pytest.mark.parametrize("axes", ["pose", "position"])
def test_peers_that_are_here_follow_a_circle(tmp_path: Path, name: str, axes: str) -> None:
    """Independent of cartctl's solvers: a wrong frame, order of joints or target would be centimetres."""
    if reason := peers()[name].missing():
        pytest.skip(reason)
    circle = {"axes": axes, "target": {"kind": "circle", "radius": 0.05, "period": 2.0}}
    bench.run(panda(tasks=[circle], duration=1.0), name, out=tmp_path)
    (row,) = results(tmp_path)
    assert row["outcome"] == "done" and row["valid"], row["reason"]
    assert row["max_m"] < 2e-4 and (row["max_rad"] or 0.0) < 2e-3 and row["effort"] > 0.01
