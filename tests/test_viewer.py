"""The live viewer: the robot keeps its state whatever is switched, stays calm, and is seen by this machine only."""

from __future__ import annotations

import re
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from typer.testing import CliRunner

import cartctl as cc
from cartctl.cli.app import app
from cartctl.errors import MissingDependencyError, ParameterError
from cartctl.viewer.aim import towards
from cartctl.viewer.method import LEVELS, NONE, OWN, Method, name_of, usable_solvers
from cartctl.viewer.pace import FPS, Pace
from cartctl.viewer.reading import Reading
from cartctl.viewer.session import Session, unwound
from cartctl.viewer.status import status_html, trouble_html
from cartctl.viewer.workshop import Workshop
from tests.chromium import Tab, browser, difference, needs_chromium, share
from tests.standing_arm import ARM, HOME

DT = 4e-3
BLUE = (60, 95, 150)  # two links, lit


@pytest.fixture
def urdf(tmp_path: Path) -> Path:
    path = tmp_path / "three.urdf"
    path.write_text(ARM)
    return path


@pytest.fixture
def controller(urdf: Path) -> cc.Controller:
    robot = cc.load(str(urdf), home=HOME)
    hand = cc.FrameTask("tip", "xz", gain=10.0)
    return cc.Controller(robot, hand, "sns", objective=cc.JointRange(), dt=DT, soft_start=0.1)


def moved(controller: cc.Controller, offset: list[float]) -> pin.SE3:
    """The hand's pose at home, moved."""
    pose = controller.robot.state(controller.robot.home).placement("tip")
    pose.translation += np.array(offset)
    return pose


def run(session: Session, seconds: float) -> None:
    for _ in range(round(seconds / session.controller.dt)):
        session.step()


# --- the robot and its controllers --------------------------------------------------------------------------------


@pytest.mark.parametrize(("solver", "level"), [("hqp", "velocity"), ("dls", "velocity"), ("sns", "acceleration")])
def test_another_method_goes_on_where_the_robot_is(controller: cc.Controller, solver: str, level: str) -> None:
    session = Session(controller)
    controller.tasks[0].target = moved(controller, [-0.3, 0.0, 0.2])
    run(session, 0.2)
    q, v, t = session.q, session.v, session.t
    assert np.abs(v).max() > 0.1  # it is on its way
    session.switch(Method(solver, level).controller(controller, controller.robot.limits))
    assert (session.q == q).all() and (session.v == v).all() and session.t == t
    session.step()
    assert np.abs(session.q - q).max() < 10 * DT * 2.0 and session.trouble == ""
    run(session, 4.0)
    assert np.linalg.norm(session.command.references[0].error) < 1e-4  # type: ignore[union-attr]


def test_it_moves_as_a_simulation_does(controller: cc.Controller) -> None:
    controller.tasks[0].target = moved(controller, [-0.2, 0.0, 0.1])
    session = Session(controller)
    run(session, 0.4)
    twin = cc.simulate(controller, duration=0.4)
    np.testing.assert_allclose(session.q, twin.q[-1], atol=1e-12)
    np.testing.assert_allclose(session.v, twin.v[-1], atol=1e-12)
    driven = controller.replace(level="torque", metric="inverse-inertia")
    session = Session(driven)
    run(session, 0.4)
    np.testing.assert_allclose(session.q, cc.simulate(driven, duration=0.4).q[-1], atol=1e-9)


@pytest.mark.parametrize("level", ["velocity", "acceleration"])
def test_a_target_out_of_reach_is_stood_before(controller: cc.Controller, level: str) -> None:
    session = Session(controller.replace(level=level))
    controller.tasks[0].target = moved(controller, [1.5, 0.0, 0.9])
    run(session, 8.0)
    assert np.linalg.norm(session.command.references[0].error) > 0.5  # type: ignore[union-attr]
    assert np.abs(session.v).max() < 1e-3 and session.trouble == ""
    reading = Reading.of(session.controller, session.q, session.v, session.command)  # type: ignore[arg-type]
    assert reading.stands and "cannot be reached" in status_html(reading, 100.0, 1.0, [])
    controller.tasks[0].target = moved(controller, [-0.1, 0.0, 0.0])
    run(session, 0.1)
    assert not Reading.of(session.controller, session.q, session.v, session.command).stands  # type: ignore[arg-type]


def test_what_runs_away_rests_and_goes_on_when_asked_for_less(controller: cc.Controller) -> None:
    session = Session(controller.replace(solver="pinv", limits=None, objective=None))
    controller.tasks[0].target = moved(controller, [-1.5, 0.0, 1.5])  # 10/s times 2 m
    session.step()
    assert "run away" in session.trouble and not session.v.any()
    np.testing.assert_array_equal(session.q, controller.robot.home)
    controller.tasks[0].target = moved(controller, [-0.05, 0.0, 0.05])
    run(session, 2.0)
    assert session.trouble == "" and np.linalg.norm(session.command.references[0].error) < 1e-6  # type: ignore[union-attr]


def test_a_refused_step_is_told_in_words(controller: cc.Controller) -> None:
    session = Session(controller)
    session.q = np.full(3, 1e12)
    session.step()
    assert "1e+12" in session.trouble and not session.v.any()


def test_joints_that_wound_up_are_turned_back(controller: cc.Controller) -> None:
    robot = controller.robot
    q = robot.home + 2.0 * np.pi * np.array([3.0, -1.0, 0.0])
    session = Session(controller.replace(solver="dls", limits=None, objective=None))
    session.q = q
    session.switch(controller.replace(solver="dls", limits=None, objective=None))
    np.testing.assert_array_equal(session.q, q)
    session.switch(controller)
    np.testing.assert_allclose(session.q, robot.home, atol=1e-12)
    rng = np.random.default_rng(4)
    for _ in range(50):
        q = rng.uniform(-20.0, 20.0, 3)
        back = unwound(robot, q)
        assert robot.state(back).placement("tip").isApprox(robot.state(q).placement("tip"), 1e-9)
        outside = np.abs(back) > np.array([2.8, 2.5, 2.5])
        assert (np.abs(back[outside]) <= np.pi + 1e-9).all()


def test_home_is_home_at_rest(controller: cc.Controller) -> None:
    session = Session(controller)
    controller.tasks[0].target = moved(controller, [-0.3, 0.0, 0.2])
    run(session, 0.2)
    session.home(controller.robot.home)
    assert (session.q == controller.robot.home).all() and not session.v.any()


# --- what may be chosen -----------------------------------------------------------------------------------------------


def test_every_solver_and_level_works_or_says_why_not(controller: cc.Controller) -> None:
    robot = controller.robot
    assert set(usable_solvers()) == set(cc.solvers())
    for solver in ("sns", "hqp", "pinv", "dls", "task-scaling"):
        for level in LEVELS:
            made = Method(solver, level).controller(controller, robot.limits)
            assert (made.solver.name, made.level.name) == (solver, level)
            bounded = "bounds" in made.solver.honours
            assert (made.limits is robot.limits) == bounded
            assert ("limits" in Method(solver, level).remark()) == (not bounded)
            assert made.tasks == controller.tasks
    with pytest.raises(cc.CartctlError, match="extremal"):
        Method("extended-jacobian", "acceleration").controller(controller, robot.limits)


def test_objectives_by_name_and_strength(controller: cc.Controller) -> None:
    state = controller.robot.state(controller.robot.home)
    plain = Method("sns", "velocity").controller(controller, controller.robot.limits).objective
    strong = Method("sns", "velocity", "joint-range", 10.0).controller(controller, controller.robot.limits).objective
    np.testing.assert_allclose(strong.direction(state), 10.0 * plain.direction(state), atol=1e-12)  # type: ignore[union-attr]
    assert np.linalg.norm(plain.direction(state)) > 1e-3  # type: ignore[union-attr]
    able = Method("sns", "velocity", "manipulability").controller(controller, controller.robot.limits).objective
    assert able is not None and able.frame == "tip" and able.axes == "x z"
    assert Method("sns", "velocity", NONE).controller(controller, controller.robot.limits).objective is None
    assert Method("pinv", "velocity", "posture").controller(controller, controller.robot.limits).objective is None
    assert "null space" in Method("pinv", "velocity", "posture").remark()
    assert [name_of(o) for o in (None, cc.JointRange(), cc.JointRange(gain=3.0))] == [NONE, "joint-range", OWN]


def test_a_controller_replaced_differs_only_in_what_was_named(controller: cc.Controller) -> None:
    slow = controller.robot.limits.replace(velocity_upper=0.5)
    controller.limits = slow
    other = controller.replace(solver="hqp", dt=1e-3)
    assert (other.solver.name, other.dt, other.level.name) == ("hqp", 1e-3, "velocity")
    assert other.limits is slow and other.objective is controller.objective and other.soft_start == 0.1
    with pytest.raises(ParameterError, match="no argument 'speed'"):
        controller.replace(speed=3)
    with pytest.raises(cc.CartctlError, match="honours no limits"):
        controller.replace(solver="pinv")


def test_the_workshop_makes_the_last_wish(controller: cc.Controller) -> None:
    workshop = Workshop(controller)
    robot = controller.robot
    try:
        for solver in ("pinv", "dls", "hqp"):
            workshop.ask(Method(solver, "velocity"), robot.limits, robot.home)
        method, made = _collected(workshop)
        assert method.solver == "hqp" and isinstance(made, cc.Controller) and made.solver.name == "hqp"
        assert workshop.collect() is None and not workshop.busy
        workshop.ask(Method("extended-jacobian", "torque"), robot.limits, robot.home)
        method, made = _collected(workshop)
        assert isinstance(made, str) and "extremal" in made
    finally:
        workshop.close()


def _collected(workshop: Workshop) -> tuple[Method, cc.Controller | str]:
    end = time.monotonic() + 120.0
    while (done := workshop.collect()) is None:
        assert time.monotonic() < end
        time.sleep(0.01)
    return done


# --- time, aims, words ------------------------------------------------------------------------------------------------


def test_steps_follow_the_clock_and_lost_time_is_given_up() -> None:
    now = [10.0]
    pace = Pace(DT, lambda: now[0])
    made = 0
    for _ in range(300):
        now[0] += 1.0 / FPS
        made += pace.due()
        pace.made(pace.due())
    assert made == 2500 and pace.speed == pytest.approx(1.0, abs=0.01)
    now[0] += 60.0  # as after a laptop's sleep
    assert pace.due() == 25
    for _ in range(300):  # a loop that makes half of what is due
        now[0] += 1.0 / FPS
        pace.made(4)
        assert pace.due() <= 25
    assert pace.speed == pytest.approx(4 * DT * FPS, abs=0.01)


def test_the_aim_comes_nearer_at_a_bounded_speed_and_arrives() -> None:
    rng = np.random.default_rng(2)
    for _ in range(20):
        start, end = pin.SE3.Random(), pin.SE3(pin.exp3(rng.normal(size=3)), 3.0 * rng.normal(size=3))
        aim, count = start, 0
        while not aim.isApprox(end, 1e-12) and count < 500:
            after = towards(aim, end, 0.1, 2.0)
            assert np.linalg.norm(after.translation - aim.translation) <= 0.2 + 1e-9
            assert np.linalg.norm(pin.log3(aim.rotation.T @ after.rotation)) <= 0.1 + 1e-9
            aim, count = after, count + 1
        way = np.linalg.norm(end.translation - start.translation)
        turn = np.linalg.norm(pin.log3(start.rotation.T @ end.rotation))
        assert count == max(int(np.ceil(way / 0.2 - 1e-9)), int(np.ceil(turn / 0.1 - 1e-9)))


def test_a_reading_is_the_state_against_the_limits(controller: cc.Controller) -> None:
    limits = controller.robot.limits.replace(velocity_lower=-4.0)
    controller.robot.limits = limits
    session = Session(controller)
    controller.tasks[0].target = moved(controller, [-0.6, 0.0, 0.3])
    run(session, 0.3)
    reading = Reading.of(controller, session.q, session.v, session.command)  # type: ignore[arg-type]
    for i, joint in enumerate(reading.joints):
        low, high = limits.position_lower[i], limits.position_upper[i]
        assert joint.position == pytest.approx((session.q[i] - low) / (high - low))
        assert joint.rate == pytest.approx(session.v[i] / (2.0 if session.v[i] > 0 else 4.0))
        assert joint.torque is None
    assert {np.sign(v) for v in session.v} == {-1.0, 1.0}  # both directions were met
    solution = session.command.solution  # type: ignore[union-attr]
    assert reading.status is solution.status and reading.scales == [solution.scales[0]]
    assert [joint.saturated for joint in reading.joints] == [int(s) for s in solution.saturated]
    ((name, metre, radian),) = reading.errors
    assert (name, radian) == ("tip", None)
    assert metre == pytest.approx(np.linalg.norm(session.command.references[0].error))  # type: ignore[union-attr]


def test_the_status_shows_what_was_read_and_no_markup_of_a_urdf(controller: cc.Controller) -> None:
    session = Session(controller)
    controller.tasks[0].target = moved(controller, [-0.9, 0.0, 0.3])
    run(session, 0.05)
    reading = Reading.of(controller, session.q, session.v, session.command)  # type: ignore[arg-type]
    text = status_html(reading, 123.4, 0.5, [1e-1, 1e-2, 1e-3])
    assert "<b>" not in text and "&lt;b&gt;one" in text
    assert reading.status.name in text and "123 µs" in text and "50 % of real time" in text
    saturated = sum(joint.saturated != 0 for joint in reading.joints)
    assert saturated and len(re.findall("[▲▼]", text)) == saturated
    (points,) = re.findall(r'points="([^"]*)"', text)
    heights = [float(pair.split(",")[1]) for pair in points.split()]
    assert np.diff(heights) == pytest.approx([44 / 6, 44 / 6], abs=0.11)  # a decade each, downwards
    assert trouble_html("") == "" and "<i>" not in trouble_html("<i>x")


# --- who may look -----------------------------------------------------------------------------------------------------


def test_without_the_extra_it_says_what_to_install(
    controller: cc.Controller, urdf: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "viser", None)
    with pytest.raises(MissingDependencyError, match=r"pip install 'cartctl\[play\]'"):
        cc.play(controller)
    result = CliRunner().invoke(app, ["play", str(urdf)])
    assert result.exit_code == 2 and "pip install 'cartctl[play]'" in result.stderr
    assert "Traceback" not in result.output


def test_what_cannot_be_played_is_refused(controller: cc.Controller) -> None:
    pytest.importorskip("viser")
    with pytest.raises(ParameterError, match="expected a cc.Controller"):
        cc.play("panda")  # type: ignore[arg-type]
    with pytest.raises(ParameterError, match="PostureTask; expected a FrameTask"):
        cc.play(controller.replace(tasks=[cc.PostureTask()]))
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        with pytest.raises(ParameterError, match="next free one"):
            cc.play(controller, port=taken.getsockname()[1], open_page=False)


@contextmanager
def shown(controller: cc.Controller) -> Iterator[tuple[Any, Any]]:
    """The viewer at work in a thread: its Show and its Window."""
    from cartctl.viewer.live import Show
    from cartctl.viewer.window import Window

    window = Window(0)
    show = Show(controller, [t for t in controller.tasks if isinstance(t, cc.FrameTask)], window)
    ended = threading.Event()

    def work() -> None:
        while not ended.is_set():
            show.picture()

    thread = threading.Thread(target=work)
    thread.start()
    try:
        yield show, window
    finally:
        ended.set()
        thread.join(10.0)
        window.close()


def wait(condition: Any, seconds: float = 60.0) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "it did not come true"
        time.sleep(0.02)


def test_the_page_is_for_this_machine_only(controller: cc.Controller, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("viser")
    with shown(controller) as (_, window):
        port = int(window.url.rpartition(":")[2])
        assert window.url.startswith("http://127.0.0.1:")
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.connect(("192.0.2.1", 9))  # sends nothing; tells this machine's address
            outside = probe.getsockname()[0]
        with socket.create_connection(("127.0.0.1", port), timeout=5.0):
            pass
        for host in {outside, "127.0.0.2"} - {"127.0.0.1"}:
            with pytest.raises(OSError, match="refused"), socket.create_connection((host, port), timeout=5.0):
                pass
        assert window.server.request_share_url() is None
        assert not window.watched and not window.deserted  # nobody has been here yet
    assert capsys.readouterr().out == ""


def test_it_ends_when_nobody_comes_back(controller: cc.Controller, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("viser")
    from cartctl.viewer import live, window

    monkeypatch.setattr(window, "_GRACE", 0.3)
    opened: list[live.Window] = []
    monkeypatch.setattr(live, "Window", lambda *given: opened.append(window.Window(*given)) or opened[0])
    thread = threading.Thread(target=lambda: cc.play(controller, port=0, open_page=False))
    thread.start()
    wait(lambda: opened)
    first, second = SimpleNamespace(client_id=0), SimpleNamespace(client_id=1)
    opened[0]._comes(first)
    opened[0]._goes(first)
    opened[0]._comes(second)  # the page was loaded again
    time.sleep(0.6)
    assert thread.is_alive() and opened[0].watched
    opened[0]._goes(second)
    thread.join(20.0)
    assert not thread.is_alive()


def test_what_is_changed_on_the_page_is_done(controller: cc.Controller) -> None:
    pytest.importorskip("viser")
    controller.tasks[0].gain = np.array([10.0, 12.0])
    with shown(controller) as (show, _):
        session, panel, handle = show.session, show.panel, show.scene.handles[0]
        handle.position = tuple(np.array(handle.position) + [-0.2, 0.0, 0.1])
        wanted = show.scene.target(0).translation
        wait(lambda: np.linalg.norm(controller.robot.state(session.q).position("tip") - wanted) < 1e-4)
        panel.ellipsoid.value = True
        ball = show.scene._ellipsoids[0]
        wait(lambda: ball.visible and np.allclose(ball.position, wanted, atol=1e-3))
        J = controller.robot.state(session.q).jacobian("tip")[:3]
        reach = np.linalg.svd(J, compute_uv=False)
        assert np.allclose(sorted(ball.scale), sorted(np.maximum(0.25 * reach, 1e-3)), atol=1e-2)
        panel._solver.value = "pinv"
        wait(lambda: session.controller.solver.name == "pinv")
        wait(lambda: "knows no limits" in panel.trouble.content)
        assert session.controller.limits is None and session.controller.objective is None
        panel._level.value, panel._solver.value = "acceleration", "extended-jacobian"
        wait(lambda: "extremal" in panel.trouble.content)
        wait(lambda: panel.method.solver == "pinv")  # what cannot be is not left standing there
        assert session.controller.solver.name == "pinv"
        panel._solver.value = "sns"
        wait(lambda: session.controller.solver.name == "sns")
        assert (controller.tasks[0].gain == [10.0, 12.0]).all()  # until somebody moves the slider
        panel._speed.value, panel._gain.value = 50, 5.0
        wait(lambda: session.controller.limits.velocity_upper[0] == 1.0 and controller.tasks[0].gain == 5.0)
        panel._objective.value = NONE  # or the null space moves on from home
        wait(lambda: session.controller.objective is None)
        with panel._lock:
            panel._pressed.add("home")
        wait(lambda: np.allclose(session.q, controller.robot.home, atol=1e-6))
        wait(lambda: show.scene.target(0).isApprox(moved(controller, [0.0, 0.0, 0.0]), 1e-6))


def test_playing_leaves_the_tasks_as_they_were(controller: cc.Controller, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("viser")
    path = cc.Circle.starting_at(moved(controller, [0, 0, 0]), 0.1, normal=[0, 1, 0])
    controller.tasks[0].target = path
    asked: list[str] = []

    def stop(url: str) -> None:
        asked.append(url)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        cc.play(controller, port=0, open_page=False, ready=stop)
    assert controller.tasks[0].target is path and controller.tasks[0].gain == 10.0
    with pytest.raises(OSError, match="refused"):
        socket.create_connection(("127.0.0.1", int(asked[0].rpartition(":")[2])), timeout=5.0)


# --- in a browser -----------------------------------------------------------------------------------------------------


@contextmanager
def visited(controller: cc.Controller) -> Iterator[tuple[Any, Any, Tab]]:
    """The viewer and a browser, which is closed first."""
    with shown(controller) as (show, window):
        with browser((1120, 640)) as tab:
            yield show, window, tab
        wait(lambda: window.deserted)


@needs_chromium
@pytest.mark.chromium
def test_a_browser_shows_the_robot_and_drags_it(controller: cc.Controller, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("viser")
    from cartctl.viewer import window as module

    monkeypatch.setattr(module, "_GRACE", 1.0)
    with visited(controller) as (show, window, tab):
        tab.open(window.url)
        wait(lambda: window.watched)
        tab.until("document.body.innerText.includes('OPTIMAL')")
        wait(lambda: share(tab.picture(), BLUE, 60) > 0.001)  # two of its links
        before, start, low = tab.picture(), show.session.q, moved(controller, [0.0, 0.0, -0.05]).translation[2]
        arrow = on_screen(show, show.scene.target(0).translation + [0.0, 0.0, 0.2 * show.scene.size], (1120, 640))
        for _ in range(5):  # a handle that is not drawn yet does not hear the mouse
            tab.drag(arrow, (arrow[0], arrow[1] + 90.0))
            time.sleep(1.0)
            wanted = show.scene.target(0).translation
            if wanted[2] < low:
                break
        assert wanted[2] < low, "the handle did not move"
        wait(lambda: np.linalg.norm(controller.robot.state(show.session.q).position("tip") - wanted) < 1e-4)
        assert np.abs(show.session.q - start).max() > 0.05
        wait(lambda: difference(before, tab.picture(), columns=slice(0, 740)) > 0.005)
        after = tab.picture()
        assert {url.split("/")[2] for url in after.requests} == {window.url.split("/")[2]}
        assert not [line for line in after.console if "deprecated" not in line]
        assert not window.deserted
    assert window.deserted  # the browser was closed


def on_screen(show: Any, point: np.ndarray, size: tuple[int, int]) -> tuple[float, float]:
    """Where a point is seen, in px."""
    camera = show.scene._server.initial_camera
    forward = camera.look_at - camera.position
    forward = forward / np.linalg.norm(forward)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right = right / np.linalg.norm(right)
    way = point - camera.position
    scale = 0.5 * size[1] / np.tan(0.5 * camera.fov) / (way @ forward)
    return 0.5 * size[0] + scale * (way @ right), 0.5 * size[1] - scale * (way @ np.cross(right, forward))


@pytest.mark.parametrize("words", [[], ["--level", "torque", "--solver", "hqp"]])
def test_ctrl_c_ends_it_without_a_traceback(urdf: Path, words: list[str]) -> None:
    pytest.importorskip("viser")
    command = [sys.executable, "-m", "cartctl", "play", str(urdf), "--no-open", "--port", "0", *words]
    home = [part for name, value in HOME.items() for part in ("--home", f"{name}={value}")]
    with subprocess.Popen([*command, *home], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        page = next(line for line in process.stdout if "http://127.0.0.1:" in line)
        port = int(re.findall(r"127\.0\.0\.1:(\d+)", page)[0])
        with socket.create_connection(("127.0.0.1", port), timeout=10.0):
            pass
        time.sleep(0.5)
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=60.0)
    assert process.returncode == 130
    assert err.split() == ["stopped:", "by", "Ctrl-C"] and "Traceback" not in out
