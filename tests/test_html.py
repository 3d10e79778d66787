"""The HTML report: what it holds, what it must not do, and what a real browser makes of it."""

from __future__ import annotations

import base64
import hashlib
import json
import os
import re
import socket
import subprocess
import time
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
import umsgpack
import zmq

from cartctl.errors import ParameterError
from cartctl.report import write_html
from cartctl.report.html import page, quantity
from tests.chromium import Tab, difference, needs_chromium, share, shoot
from tests.report_runs import panda_run, planar_run, robot_of, run_of

HOSTILE = '</script><script>document.title="pwned"</script><img src=x onerror=alert(1)>&amp;"\'--><b>ü$title{}'
BLUE, RED = (40, 80, 140), (150, 60, 45)  # the planar robot's links, lit


class Reader(HTMLParser):
    """Takes a page apart as a browser would."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.texts: dict[str, list[str]] = {}
        self.open: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        self.open.append(tag)
        self.texts.setdefault(tag, []).append("")

    def handle_endtag(self, tag: str) -> None:
        while self.open and self.open.pop() != tag:
            pass

    def handle_data(self, data: str) -> None:
        for tag in set(self.open):
            self.texts[tag][-1] += data

    def scripts(self, kind: str | None) -> list[str]:
        kinds = [attrs.get("type") for tag, attrs in self.tags if tag == "script"]
        return [text for text, found in zip(self.texts["script"], kinds, strict=True) if found == kind]


def commands_of(text: str) -> list[dict[str, Any]]:
    """Unpack what the page sends to its viewer."""
    (scene,) = Reader(text).scripts("application/json")
    return [umsgpack.unpackb(base64.b64decode(c)) for c in json.loads(scene)["commands"]]


def tracks_of(text: str) -> dict[str, dict[str, tuple[np.ndarray, np.ndarray]]]:
    """Return path -> property -> (times in s, values) of the page's animation."""
    (animation,) = [c for c in commands_of(text) if c["type"] == "set_animation"]
    assert animation["options"]["play"] and animation["options"]["repetitions"] == float("inf")
    out: dict[str, Any] = {}
    for entry in animation["animations"]:
        for track in entry["clip"]["tracks"]:
            keys = track["keys"]
            time = np.array([k["time"] for k in keys]) / entry["clip"]["fps"]
            out.setdefault(entry["path"], {})[track["name"]] = (time, np.array([k["value"] for k in keys]))
    return out


@pytest.fixture(scope="module")
def planar() -> Any:
    return planar_run()


@pytest.fixture(scope="module")
def planar_page(planar: Any, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_html(planar, tmp_path_factory.mktemp("page") / "planar.html")


@pytest.fixture(scope="module")
def panda_page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_html(panda_run(), tmp_path_factory.mktemp("page") / "panda.html")


# --- writing -------------------------------------------------------------------------------------------------------


def test_writes_without_server_socket_or_subprocess(
    planar: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("the report reached out")

    for owner, name in ((socket.socket, "connect"), (socket.socket, "bind"), (zmq.Context, "socket")):
        monkeypatch.setattr(owner, name, refuse)
    monkeypatch.setattr(subprocess, "Popen", refuse)
    target = tmp_path / "new" / "folders" / "run.html"
    assert write_html(planar, target) == target
    assert [p.name for p in target.parent.iterdir()] == ["run.html"]


def test_a_failed_write_leaves_the_old_file_alone(planar: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    target = tmp_path / "run.html"
    target.write_text("old")

    def fail(*_: object) -> None:
        raise OSError("disk full")

    monkeypatch.setattr(os, "replace", fail)
    with pytest.raises(OSError, match="disk full"):
        write_html(planar, target)
    assert target.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["run.html"]


def test_refuses_a_folder_and_a_run_without_samples(planar: Any, tmp_path: Path) -> None:
    for path in (None, 3, b"page.html"):
        with pytest.raises(ParameterError, match="path is .*; expected the name of a file"):
            write_html(planar, path)  # type: ignore[arg-type]
    with pytest.raises(ParameterError, match="folder"):
        write_html(planar, tmp_path)
    empty = planar_run()
    empty.time, empty.q, empty.v = empty.time[:0], empty.q[:0], empty.v[:0]
    with pytest.raises(ParameterError, match="no sample"):
        write_html(empty, tmp_path / "run.html")


def test_a_run_of_one_sample_stands_still(tmp_path: Path) -> None:
    run = planar_run()
    arrays = {"q": run.q, "v": run.v, "error": run.tasks[0].error, "sigma": run.tasks[0].singular_values,
              "pose": run.tasks[0].pose, "target": run.tasks[0].target}  # fmt: skip
    still = run_of(run.robot, 0.005, {k: np.array(v)[:1] for k, v in arrays.items()}, run.tasks[0].units)
    commands = commands_of(page(still))
    assert not [c for c in commands if c["type"] == "set_animation"]
    assert [c for c in commands if c["type"] == "set_object" and c["path"].startswith("/meshcat/robot/")]


# --- what the page holds -------------------------------------------------------------------------------------------


def test_bodies_move_as_the_joints_do_and_in_real_time(planar: Any, planar_page: Path) -> None:
    tracks = tracks_of(planar_page.read_text(encoding="utf-8"))
    model, data = planar.robot.model, planar.robot.model.createData()
    moving = {path: t for path, t in tracks.items() if path.startswith("/meshcat/robot/")}
    assert len(moving) == model.njoints - 1
    for path, track in moving.items():
        joint = 1 + sorted(moving).index(path)
        times, positions = track[".position"]
        assert times[0] == 0 and times[-1] == pytest.approx(planar.time[-1], rel=1e-6)
        assert np.diff(times).max() < 1.5 / 30
        for k in (0, 7, len(times) // 2, len(times) - 1):
            pin.forwardKinematics(model, data, planar.q[np.argmin(np.abs(planar.time - times[k]))])
            np.testing.assert_allclose(positions[k], data.oMi[joint].translation, atol=1e-6)
            x, y, z, w = track[".quaternion"][1][k]
            np.testing.assert_allclose(pin.Quaternion(w, x, y, z).matrix(), data.oMi[joint].rotation, atol=1e-6)


def test_target_moves_and_the_actual_path_grows(planar: Any, planar_page: Path) -> None:
    text = planar_page.read_text(encoding="utf-8")
    tracks = tracks_of(text)
    times, positions = tracks["/meshcat/task0/target"][".position"]
    wanted = [np.interp(times, planar.time, planar.tasks[0].target[:, i]) for i in range(3)]
    np.testing.assert_allclose(positions, np.transpose(wanted), atol=1e-4)
    _, counts = tracks["/meshcat/task0/traced/line/<object>"][".geometry[drawRange].count"]
    (tube,) = [c for c in commands_of(text) if c["type"] == "set_object" and c["path"] == "/meshcat/task0/traced/line"]
    index = tube["object"]["geometries"][0]["data"]["index"]["array"].data
    assert counts[0] == 0 and (np.diff(counts) >= 0).all()
    assert counts[-1] == len(index) / 2  # 16-bit indices


def test_robot_without_visuals_is_drawn_from_its_joints() -> None:
    run = planar_run(visuals=False)
    drawn = {c["path"]: c for c in commands_of(page(run)) if c["type"] == "set_object" and "/robot/" in c["path"]}
    assert len(drawn) == run.robot.model.njoints - 1
    reach = []
    for command in drawn.values():
        position = command["object"]["geometries"][0]["data"]["attributes"]["position"]["array"].data
        reach.append(np.frombuffer(position, np.float32).reshape(-1, 3)[:, 0].max())
    assert 0.5 < max(reach) < 0.56 and 0.4 < min(reach) < 0.46  # the links are 0.5 and 0.4 m long


def test_a_robot_with_neither_visuals_nor_joints_still_makes_a_page() -> None:
    model = pin.Model()
    still = np.tile([0.1, 0, 0, 0, 0, 0, 1], (3, 1))
    arrays = {"q": np.zeros((3, 0)), "v": np.zeros((3, 0)), "error": np.zeros((3, 3)), "sigma": np.zeros((3, 0)),
              "pose": still, "target": still}  # fmt: skip
    run = run_of(robot_of(model, pin.GeometryModel(), "universe", "nothing"), 0.1, arrays, ["m"] * 3)
    run.metrics = lambda after=0.0: type("M", (), {"tasks": []})()  # type: ignore[method-assign]
    assert "nothing" in page(run)


def test_caption_tells_the_errors(planar: Any, planar_page: Path) -> None:
    reader = Reader(planar_page.read_text(encoding="utf-8"))
    task = planar.metrics().tasks[0]
    (table,) = reader.texts["table"]
    assert f"{1e3 * task.rms_m:.3g} mm" in table and f"{1e3 * task.max_m:.3g} mm" in table
    assert reader.texts["h1"] == ["planar"]
    assert "dls" in reader.texts["header"][0] and "1.00 s in 200 steps" in reader.texts["header"][0]


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.0123456, "12.3 mm"), (1.5, "1.5 m"), (3.2e-5, "32 µm"), (4e-9, "4 nm"), (0.0, "0 nm"), (1e-14, "0 nm")],
)
def test_quantities_choose_their_unit(value: float, text: str) -> None:
    assert quantity(value, ("m", "mm", "µm", "nm")) == text


def test_panda_with_its_meshes_stays_small(panda_page: Path) -> None:
    assert 2e6 < panda_page.stat().st_size < 8e6


# --- what it must not do -------------------------------------------------------------------------------------------


def test_hostile_names_are_only_shown() -> None:
    run = planar_run(HOSTILE)
    run.tasks[0].name = HOSTILE
    run.meta["solver"] = HOSTILE
    reader = Reader(page(run))
    assert reader.texts["h1"] == [HOSTILE]
    assert HOSTILE in reader.texts["tbody"][0] and HOSTILE in reader.texts["title"][0]
    assert not {"img", "b", "iframe", "object"} & {tag for tag, _ in reader.tags}
    assert len(reader.scripts(None)) == 2  # the viewer and the player
    assert not any(name.startswith("on") for _, attrs in reader.tags for name in attrs)


def test_page_refers_to_nothing_outside_itself(planar_page: Path) -> None:
    reader = Reader(planar_page.read_text(encoding="utf-8"))
    for tag, attrs in reader.tags:
        for name in ("src", "href", "action", "data", "poster", "srcset"):
            assert (attrs.get(name) or "data:").startswith("data:"), f"<{tag} {name}={attrs[name]!r}>"
    assert not re.search(r"@import|url\(", reader.texts["style"][0])
    for script in reader.scripts(None):
        assert set(re.findall(r"https?://[^\s\"'`)]*", script)) <= {"http://www.w3.org/1999/xhtml"}


def test_policy_allows_these_scripts_and_no_request(planar_page: Path) -> None:
    reader = Reader(planar_page.read_text(encoding="utf-8"))
    metas = [attrs for tag, attrs in reader.tags if tag == "meta"]
    (policy,) = [a["content"] for a in metas if a.get("http-equiv") == "Content-Security-Policy"]
    rules = {name: set(sources) for name, *sources in (rule.split() for rule in str(policy).split(";"))}
    digests = [base64.b64encode(hashlib.sha256(s.encode()).digest()).decode() for s in reader.scripts(None)]
    assert rules.pop("script-src") == {f"'sha256-{digest}'" for digest in digests}
    assert rules == {"default-src": {"'none'"}, "style-src": {"'unsafe-inline'"}, "img-src": {"data:", "blob:"}}


# --- in a browser --------------------------------------------------------------------------------------------------


@needs_chromium
@pytest.mark.chromium
def test_browser_draws_the_robot_and_moves_it(planar_page: Path, tab: Tab) -> None:
    early, late = tab.look(planar_page, "#t=0.05"), tab.look(planar_page, "#t=0.5")
    for shot in (early, late):
        assert not shot.console and not shot.requests
        assert share(shot, BLUE, 40) > 0.01 and share(shot, RED, 40) > 0.01  # both links
        assert share(shot, (230, 159, 0)) > 5e-4  # the desired path
    middle = slice(100, 700)  # without the player's moving slider
    assert difference(early, late, middle) > 0.01
    assert share(late, (0, 114, 178)) > share(early, (0, 114, 178)) + 2e-4  # the actual path has grown
    again = shoot(planar_page, "#t=0.5", 900)  # in a browser of its own
    assert difference(late, again, middle) < 1e-3  # a moment in the address stands still


@needs_chromium
@pytest.mark.chromium
def test_browser_plays_by_itself(planar_page: Path, tab: Tab) -> None:
    first = tab.look(planar_page, "", (1000, 400))
    began = tab.ask("Number(document.getElementById('time').value)")
    tab.until(f"Math.abs(Number(document.getElementById('time').value) - {began}) > 0.2")
    until = time.monotonic() + 60.0
    while (
        difference(first, second := tab.picture(), slice(20, 320), slice(0, 560)) <= 0.01
    ):  # a busy machine draws late
        assert time.monotonic() < until
    assert not second.console and not second.requests


@needs_chromium
@pytest.mark.chromium
def test_browser_fits_the_robot_into_a_phone(planar_page: Path, tab: Tab) -> None:
    shot = tab.look(planar_page, "#t=0.5", (412, 800))
    assert share(shot, BLUE, 40) > 0.005 and share(shot, RED, 40) > 0.005
    edge = np.concatenate([shot.pixels[:, :6], shot.pixels[:, -6:]], axis=1)
    assert not (np.abs(edge.astype(int) - RED).max(axis=2) <= 40).any()


@needs_chromium
@pytest.mark.chromium
def test_browser_shows_the_panda(panda_page: Path, tab: Tab) -> None:
    shot = tab.look(panda_page, "#t=1.3")
    assert not shot.console and not shot.requests
    middle = shot.pixels[60:640, 440:900].astype(int)
    light = (middle.min(axis=2) > 170) & (np.ptp(middle, axis=2) < 6)  # its covers are white, the background is blueish
    dark = middle.max(axis=2) < 60  # its joints are black
    assert light.mean() > 0.05 and dark.mean() > 0.005
    assert share(shot, (230, 159, 0)) > 5e-4


@needs_chromium
@pytest.mark.chromium
def test_hostile_names_do_nothing_in_a_browser(tmp_path: Path, tab: Tab) -> None:
    run = planar_run(HOSTILE)
    run.tasks[0].name = HOSTILE
    shot = tab.look(write_html(run, tmp_path / "run.html"), "#t=0.5")
    assert not shot.console and not shot.requests and share(shot, RED, 40) > 0.01


@needs_chromium
@pytest.mark.chromium
def test_a_request_would_be_noticed(tmp_path: Path) -> None:
    probe = tmp_path / "probe.html"
    probe.write_text("<img src='http://example.com/x.png'><script>console.error('oops')</script>")
    shot = shoot(probe, "", 600, (300, 200))
    assert shot.requests == ["http://example.com/x.png"] and shot.console == ["oops"]
