"""The race: where a tool fails its row says so and the others go on; all are told the same; checks see what is off."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import cartctl as cc

ROOT = Path(__file__).parent.parent
RACE = ROOT / "benchmarks" / "race"


@pytest.fixture(scope="module")
def modules():
    """The race's modules, as its script finds them."""
    sys.path.insert(0, str(RACE))
    try:
        import checks
        import jobs
        import peer
        import race
        import words
    finally:
        sys.path.remove(str(RACE))
    return jobs, peer, race, checks, words


@pytest.fixture(scope="module")
def job(modules):
    return modules[0].track_job(1)


def test_every_script_of_a_tool_has_its_pins_and_takes_part(modules):
    """And the Makefile finds an environment for it by the script's name."""
    _, _, race, _, _ = modules
    pinned = {}
    for script in RACE.glob("*_*.py"):
        if found := re.findall(r"^requires: (.+)$", script.read_text(), re.MULTILINE):
            assert len(found) == 1 and all(re.fullmatch(r"[\w-]+==[\d.]+", pin) for pin in found[0].split()), script
            pinned[script.name] = script.stem.partition("_")[2]
    assert pinned == {script: home for _, _, script, home, _ in race.ENTRIES if home}
    assert {s.name for s in RACE.glob("*_*.py")} == {script for _, _, script, _, _ in race.ENTRIES}


def test_the_urdf_everybody_gets_is_the_robot(job):
    robot, rng = cc.load("panda"), np.random.default_rng(3)
    model = pin.buildModelFromXML(str(job["urdf"]))
    data, frame, limits = model.createData(), model.getFrameId(str(job["frame"])), robot.limits
    assert list(model.names)[1:] == list(job["joints"])
    for ours, theirs in (
        (limits.position_lower, model.lowerPositionLimit),
        (limits.position_upper, model.upperPositionLimit),
        (limits.velocity_upper, model.velocityLimit),
    ):
        assert np.array_equal(ours, theirs)
    for q in rng.uniform(limits.position_lower, limits.position_upper, (50, 7)):
        pin.framesForwardKinematics(model, data, q)
        apart = data.oMf[frame].inverse() * robot.state(q).placement(robot.tool)
        assert np.linalg.norm(pin.log6(apart).vector) < 1e-12


SCRIPTS = {
    "good": "print('{0.5}')\nserve((), lambda: print(7.5) or {'q': Q, 'steps': np.array(len(Q) - 1)})",
    "absent": "import no_such_tool",
    "dead": "import os\nrounds = []\n"
    "serve((), lambda: os.abort() if len(rounds) > 1 else rounds.append(0) or {'q': Q, 'steps': np.array(4000)})",
    "stuck": "import time\nrounds = []\n"
    "serve((), lambda: time.sleep(60) if rounds else rounds.append(0) or {'q': Q, 'steps': np.array(4000)})",
    "mute": "import sys\nserve((), lambda: {'q': Q})\nsys.exit('no answers')",
    "lost": "serve((), lambda: {'q': np.where(np.arange(len(Q))[:, None] > 5, np.nan, Q), 'steps': np.array(4000)})",
}


def test_a_tool_that_fails_is_a_row_and_the_others_go_on(modules, job, tmp_path, monkeypatch):
    _, peer, race, _, words = modules
    monkeypatch.setenv("PYTHONPATH", str(RACE))
    np.savez(tmp_path / "track.npz", **job)
    racing = []
    for name, text in SCRIPTS.items():
        script = tmp_path / f"{name}.py"
        script.write_text(
            "import numpy as np\nfrom worker import job, serve\n"
            f"Q = np.tile(job()['home'], (len(job()['positions']), 1))\n{text}\n"
        )
        entry = ("track", name, script, "", ())
        racing.append(peer.Peer(entry, tmp_path, tmp_path / "track.npz", tmp_path, patience=5.0))
        racing[-1].ready()
    for _ in range(3):
        for each in racing:
            each.round()
    rows = {row["who"]: row for row in race.lines(racing, job, [1.0, 1.1])}
    assert all(each.process.poll() is not None for each in racing)
    assert len(racing[0].times) == 3 and rows["good"]["ratio"] == "1.00" and float(rows["good"]["median_us"]) > 0.0
    limits, home = cc.load("panda").limits, job["home"]
    margin = min((home - limits.position_lower).min(), (limits.position_upper - home).min())
    assert rows["good"]["success"] == f"limits kept by {margin:.2g}"  # it stands still
    for name, reason in {
        "absent": "exit status 1: ModuleNotFoundError: No module named 'no_such_tool'",
        "dead": "signal 6",
        "stuck": "signal 9",
        "mute": "exit status 1: no answers",
    }.items():
        assert rows[name]["success"] == "did not finish" and rows[name]["median_us"] == "", name
        assert rows[name]["error"].startswith(reason), rows[name]
    assert len(racing[2].times) == 1 and rows["dead"]["rounds"] == "1"
    assert rows["lost"]["success"] == "not numbers all along the path" and "27965 not finite" in rows["lost"]["error"]
    with pytest.raises(SystemExit, match=r"README.md is left as it is: no figures of cartctl Controller.step"):
        words.write(list(rows.values()))


def test_the_check_sees_what_is_off(modules, job):
    """A path of known distance from the job's, one beyond a limit, and one too fast."""
    checked, robot = modules[3].checked_track, cc.load("panda")
    still = np.tile(robot.home, (len(job["positions"]), 1))
    away = np.linalg.norm(job["positions"] - job["positions"][0], axis=1).max()
    found = checked(job, {"q": still})
    assert float(found["error"].split()[0]) == pytest.approx(1e6 * away, rel=1e-2)
    assert found["error"].split(", ")[1] == "0 urad off the path" or float(found["error"].split()[2]) < 1e-3
    turned = still.copy()
    turned[:, 6] += 0.01
    assert checked(job, {"q": turned})["error"].endswith(", 1e+04 urad off the path")
    beyond = still.copy()
    beyond[-1000:] = np.linspace(still[0], still[0], 1000)
    beyond[-1000:, 0] = np.linspace(still[0, 0], robot.limits.position_upper[0] + 0.02, 1000)
    assert float(checked(job, {"q": beyond})["success"].removeprefix("limits exceeded by ")) > 0.019
    fast = still.copy()
    fast[2000:, 3] += 1e-3 * (robot.limits.velocity_upper[3] + 0.5)
    assert checked(job, {"q": fast})["success"] == "limits exceeded by 0.5"


def test_the_paragraph_names_who_did_not_finish(modules):
    words = modules[4]
    rows = words.rows()
    (pink,) = [r for r in rows if r["who"] == "pink"]
    lost = [{**r, "median_us": "", "success": "did not finish", "error": "signal 11"} if r is pink else r for r in rows]
    assert "; pink did not finish." in " ".join(words.paragraph(lost).split())
    assert "did not finish" not in words.paragraph(rows)
