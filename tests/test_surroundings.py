"""Obstacles in a run: noted sample by sample, kept in the file, drawn in the page where they are."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import cartctl as cc
from cartctl.errors import RunFileError
from cartctl.report import surroundings
from tests.chromium import difference, needs_chromium, share, shoot
from tests.robots_for_tests import panda, planar

BRICK = tuple(round(255 * x) for x in surroundings.RGB)
DT = 0.01


def scene_of(tool: str) -> cc.Scene:
    scene = cc.Scene().sphere("ball", 0.1, cc.Line([1.0, -1.0, 0.5], [1.0, 1.0, 0.5], duration=1.0))
    scene.box("box", [0.2, 0.4, 0.6], [0.0, 1.2, 0.3]).capsule("held", 0.02, 0.1, [0.3, 0.0, 0.0], frame=tool)
    return scene.plane("floor", [0.0, 0.0, 2.0], -1.0)


def run_of(robot: cc.Robot, scene: cc.Scene, seconds: float = 0.5, **how: object) -> cc.Run:
    task = cc.PostureTask(robot.home + 0.3, gain=3.0, fit="scale")
    how = how or {"constraints": [cc.Avoid(scene, 0.01)]}
    return cc.simulate(cc.Controller(robot, task, "sns", dt=DT, **how), robot.home, seconds)  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def run() -> cc.Run:
    return run_of(planar(), scene_of(planar().tool))


def test_poses_are_those_of_every_sample(run: cc.Run) -> None:
    robot, found = planar(), {o.name: o for o in run.obstacles}
    assert list(found) == ["ball", "box", "held", "floor"]
    path = cc.Line([1.0, -1.0, 0.5], [1.0, 1.0, 0.5], duration=1.0)
    assert found["ball"].pose.shape == (len(run.time), 7)
    for k, t in enumerate(run.time):
        np.testing.assert_allclose(found["ball"].pose[k, :3], path(t).position, atol=1e-12)
        at = robot.state(run.q[k]).placement(robot.tool)
        held = pin.XYZQUATToSE3(found["held"].pose[k])
        expected = at * pin.SE3(np.eye(3), np.array([0.3, 0.0, 0.0]))
        np.testing.assert_allclose(held.homogeneous, expected.homogeneous, atol=1e-12)
    np.testing.assert_array_equal(found["box"].pose, [[0.0, 1.2, 0.3, 0.0, 0.0, 0.0, 1.0]])
    assert found["floor"].plane and found["floor"].pose[0, 2] == pytest.approx(-0.5)  # 2 z <= -1
    np.testing.assert_allclose(np.ptp(found["box"].points, axis=0), [0.2, 0.4, 0.6])


def test_they_are_kept_in_the_file(run: cc.Run, tmp_path: Path) -> None:
    again = cc.Run.load(run.save(tmp_path / "run.npz"))
    assert len(again.obstacles) == 4
    for a, b in zip(run.obstacles, again.obstacles, strict=True):
        assert (a.name, a.plane) == (b.name, b.plane)
        for field in ("points", "sizes", "radii", "pose"):
            np.testing.assert_array_equal(getattr(a, field), getattr(b, field))
    run.obstacles[0].pose[3, 1] = np.nan
    with pytest.raises(RunFileError, match="nan or inf"):
        cc.Run.load(run.save(tmp_path / "bad.npz"))
    run.obstacles[0].pose[3, 1] = 0.0


def test_every_kind_of_thing_that_minds_a_scene_is_asked_and_each_scene_once() -> None:
    robot = planar()
    ways = (
        lambda s: {"constraints": [cc.Avoid(s), cc.Avoid(s, 0.02)]},
        lambda s: {"objective": cc.Clearance(s)},
        lambda s: {"objective": 2.0 * cc.JointRange() + cc.Clearance(s)},
    )
    for way in ways:
        scene = cc.Scene().sphere("ball", 0.1, [3.0, 3.0, 0.0])
        assert [o.name for o in run_of(robot, scene, 0.05, **way(scene)).obstacles] == ["ball"]
    task = cc.ClearanceTask(scene, 0.3)
    found = cc.simulate(cc.Controller(robot, task, "sns", dt=DT), robot.home, 0.05)
    assert [o.name for o in found.obstacles] == ["ball"]
    assert run_of(robot, scene, 0.05, objective=cc.JointRange()).obstacles == []


def test_what_a_sensor_moves_or_takes_away_while_running() -> None:
    robot, scene = planar(), cc.Scene().sphere("seen", 0.1, [2.5, 0.0, 0.0]).sphere("gone", 0.1, [0.0, 3.0, 0.0])

    class Looking(cc.PostureTask):
        def reference(self, state, t, anchor):  # type: ignore[no-untyped-def]
            if 0.095 < t < 0.105:
                scene.move("seen", [2.5, 0.5, 0.0])
                if any(o.name == "gone" for o in scene.obstacles):
                    scene.remove("gone").sphere("new", 0.1, [4.0, 0.0, 0.0])
            return super().reference(state, t, anchor)

    controller = cc.Controller(robot, Looking(), "sns", dt=DT, constraints=[cc.Avoid(scene)])
    run = cc.simulate(controller, robot.home, 0.2)
    seen, gone = run.obstacles
    assert (seen.name, gone.name) == ("seen", "gone")
    assert seen.pose[5, 1] == 0.0 and seen.pose[15, 1] == 0.5
    np.testing.assert_array_equal(gone.pose, [[0.0, 3.0, 0.0, 0.0, 0.0, 0.0, 1.0]])


def test_meshes_enclose_their_shapes_and_face_outwards(run: cc.Run) -> None:
    for record in run.obstacles:
        mesh = surroundings._mesh(record, 2.0)
        assert mesh is not None
        low, high = mesh.bounds()
        if record.plane:
            assert high[2] == pytest.approx(0.0) and low[0] < -1.0
            continue
        wide = record.radii.max()
        np.testing.assert_allclose([low, high], [record.points.min(0) - wide, record.points.max(0) + wide], atol=2e-3)
        a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
        assert float(np.einsum("ij,ij->", a, np.cross(b, c))) > 0.0  # six times the volume: outwards


def test_flat_and_odd_meshes_are_drawn() -> None:
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    scene = cc.Scene().mesh("triangles", square, [3, 0, 0], faces=[[0, 1, 2], [0, 2, 3]], convex=False)
    scene.mesh("hull", np.concatenate([square, square + [0, 0, 1]]), [0, 3, 0])
    run = run_of(planar(), scene, 0.03)
    for record, faces in zip(run.obstacles, (4, 12), strict=True):
        mesh = surroundings._mesh(record, 1.0)
        assert mesh is not None and len(mesh.faces) >= faces and np.isfinite(mesh.vertices).all()
    around = np.random.default_rng(0).normal(size=(50, 3))
    assert len(surroundings.seen(run.obstacles, around)) == 6 + 8
    assert not len(surroundings.seen(run.obstacles, 1e-3 * around))  # too far for the camera to mind


@needs_chromium
@pytest.mark.chromium
def test_browser_shows_them_and_moves_them(tmp_path: Path) -> None:
    robot = panda()
    hand = robot.state(robot.home).position(robot.tool)
    scene = cc.Scene().sphere("ball", 0.12, cc.Line(hand + [0.0, -0.6, 0.2], hand + [0.0, 0.6, 0.2], duration=1.0))
    task = cc.PostureTask(gain=1.0)
    plain = cc.simulate(cc.Controller(robot, task, "sns", dt=DT), robot.home, 1.0)
    run = cc.simulate(cc.Controller(robot, task, "sns", dt=DT, objective=cc.Clearance(scene)), robot.home, 1.0)
    pages = [run.html(tmp_path / "run.html"), plain.html(tmp_path / "plain.html")]
    early, late = shoot(pages[0], "#t=0.1", 600), shoot(pages[0], "#t=0.9", 600)
    without = shoot(pages[1], "#t=0.1", 600)
    assert not early.console and not early.requests
    assert difference(early, late, slice(100, 700)) > 0.005
    red = [float(((s.pixels[..., 0].astype(int) - s.pixels[..., 2]) > 40).mean()) for s in (early, late, without)]
    assert min(red[:2]) > 0.005 + red[2], red
    assert "obstacle</li>" in pages[0].read_text() and "obstacle</li>" not in pages[1].read_text()
    assert share(early, BRICK, 8) < 0.5 * red[0]  # translucent: what is behind shows through
