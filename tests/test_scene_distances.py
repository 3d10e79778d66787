"""Distances of links and obstacles: closed forms, finite differences, coal on the true shapes, and who is watched."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin
import pytest

import cartctl as cc
from cartctl.errors import CartctlError, FrameNotFound, ParameterError, ShapeError, TargetError, UrdfError
from cartctl.model.scene import Arrangement, excluded, with_itself, with_scene
from cartctl.model.scene.bodies import robot_parts
from cartctl.model.scene.enclosing import enclosed
from tests.oracles import random_rotation
from tests.robots_for_tests import kinova, panda, planar, talos

ARMS = {"planar": planar, "panda": panda, "kinova": kinova, "talos": talos}


def pose(rng: np.random.Generator, spread: float = 1.0) -> np.ndarray:
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = random_rotation(rng), rng.uniform(-spread, spread, 3)
    return T


def random_scene(rng: np.random.Generator) -> cc.Scene:
    scene = cc.Scene().plane("floor", rng.normal(size=3), -0.9)
    scene.sphere("big", 0.3, at=[0.3, 0.2, 0.4]).sphere("ball", 0.1, at=pose(rng)).box(
        "box", rng.uniform(0.1, 0.5, 3), at=pose(rng)
    )
    scene.capsule("bar", 0.05, 0.6, at=pose(rng)).cylinder("post", 0.1, 0.5, at=pose(rng))
    return scene.mesh("rock", rng.normal(size=(60, 3)) * 0.1, at=pose(rng))


# ---------------------------------------------------------------- closed forms


def distance(scene: cc.Scene, point: np.ndarray, radius: float) -> float:
    """From a ball about a point: the tool of an arm moved there by its base."""
    robot = cc.planar([0.5], name="one")
    shift = np.asarray(point) - robot.state(robot.home).position(robot.tool)
    moved = cc.Scene()
    for obstacle in scene.obstacles:
        place = np.array(obstacle.pose(0.0).homogeneous)
        place[:3, 3] -= shift
        moved._add(obstacle.name, obstacle.parts, place, None, ())
    arrangement = with_scene(robot, moved, {robot.tool: radius})
    return float(arrangement.closest(robot.state(robot.home)).distance[0])


def test_balls_boxes_capsules_and_planes_by_their_formulas() -> None:
    rng = np.random.default_rng(0)
    for _ in range(60):
        T, p, r = pose(rng), rng.uniform(-2.0, 2.0, 3), rng.uniform(0.01, 0.2)
        local = T[:3, :3].T @ (p - T[:3, 3])
        ball = np.linalg.norm(local) - 0.3 - r
        half = rng.uniform(0.05, 0.6, 3)
        over = np.abs(local) - half
        box = np.linalg.norm(np.maximum(over, 0.0)) + min(over.max(), 0.0) - r
        bar = np.linalg.norm(local - [0.0, 0.0, np.clip(local[2], -0.4, 0.4)]) - 0.1 - r
        n = rng.normal(size=3)
        plane = (n @ p - 0.2) / np.linalg.norm(n) - r
        for scene, wanted in (
            (cc.Scene().sphere("a", 0.3, at=T), ball),
            (cc.Scene().box("a", 2.0 * half, at=T), box),
            (cc.Scene().capsule("a", 0.1, 0.8, at=T), bar),
            (cc.Scene().plane("a", n, 0.2), plane),
        ):
            assert distance(scene, p, r) == pytest.approx(wanted, abs=2e-7), scene


def test_a_cylinder_is_at_most_one_percent_too_wide() -> None:
    rng = np.random.default_rng(1)
    for _ in range(60):
        p, r = rng.uniform(-1.0, 1.0, 3), 0.02
        wide, high = np.hypot(p[0], p[1]) - 0.3, abs(p[2]) - 0.25
        exact = np.linalg.norm(np.maximum([wide, high], 0.0)) + min(max(wide, high), 0.0) - r
        found = distance(cc.Scene().cylinder("a", 0.3, 0.5, at=[0.0, 0.0, 0.0]), p, r)
        assert exact - 0.01 * 0.3 <= found <= exact + 1e-7


# ---------------------------------------------------------------- gradients, the broad phase, the true shapes


def one_sided(arrangement: Arrangement, robot: cc.Robot, q: np.ndarray, u: np.ndarray, pairs: np.ndarray) -> np.ndarray:
    """The rates of the distances along u, (3, K): behind, central, ahead."""
    h, d = 1e-6, []
    for sign in (-1.0, 0.0, 1.0):
        arrangement.update(robot.state(robot.integrate(q, sign * h * u)))
        d.append(arrangement.measure(pairs).distance)
    return np.array([d[1] - d[0], 0.5 * (d[2] - d[0]), d[2] - d[1]]) / h


@pytest.mark.parametrize("name", list(ARMS))
@pytest.mark.parametrize("own", [False, True])
def test_gradients_by_differences(name: str, own: bool) -> None:
    """At random states, overlapping pairs included; only where the closest corners change is there no gradient."""
    if own and name == "planar":
        robot = cc.planar([0.6, 0.5, 0.4, 0.3])
    else:
        robot = ARMS[name]()
    rng = np.random.default_rng(2)
    arrangement = with_itself(robot) if own else with_scene(robot, random_scene(rng))
    checked, kinks, overlapping = 0, 0, 0
    for _ in range(25):
        q, u = robot.random_configuration(rng), rng.normal(size=robot.nv)
        state = robot.state(q)
        found = arrangement.within(state, 0.4)
        if not len(found.pairs):
            continue
        G = arrangement.gradients(state, found) @ u
        behind, central, ahead = one_sided(arrangement, robot, q, u, found.pairs)
        smooth = np.abs(ahead - behind) < 1e-4 * (1.0 + np.abs(central))
        kinks += int((~smooth).sum())
        checked += int(smooth.sum())
        overlapping += int((found.distance[smooth] < 0.0).sum())
        np.testing.assert_allclose(G[smooth], central[smooth], atol=2e-6 * (1.0 + np.abs(u).sum()))
    assert checked > 20 and kinks < 0.02 * checked
    assert overlapping > 0


@pytest.mark.parametrize("name", list(ARMS))
def test_no_near_pair_is_passed_over(name: str) -> None:
    """What the balls and boxes leave out is measured, too: all of it is as far as they say."""
    robot, rng = ARMS[name](), np.random.default_rng(3)
    arrangement = with_scene(robot, random_scene(rng))
    spared = 0
    for _ in range(20):
        state = robot.state(robot.random_configuration(rng))
        arrangement.update(state)
        every = arrangement.measure(np.arange(len(arrangement.pairs)))
        assert (arrangement.bounds() <= every.distance + 1e-9).all()
        near = arrangement.within(state, 0.1)
        np.testing.assert_array_equal(near.pairs, np.flatnonzero(every.distance < 0.1))
        closest = arrangement.closest(state)
        assert closest.distance[0] == pytest.approx(every.distance.min(), abs=1e-9)
        spared += int((arrangement.bounds() >= 0.1).sum())
        lengths = np.linalg.norm(every.normal, axis=1)
        np.testing.assert_allclose(lengths, 1.0, atol=1e-9)
        gap = np.einsum("ki,ki->k", every.normal, every.first - every.second)
        np.testing.assert_allclose(gap, every.distance, atol=1e-6)
    assert spared > 0.3 * 20 * len(arrangement.pairs)


def test_wrapped_links_hold_the_meshes_and_are_not_much_larger() -> None:
    """The Panda's collision meshes by coal's own triangles: never nearer than our parts say, 7 mm farther at most."""
    robot, rng = panda(), np.random.default_rng(4)
    scene = cc.Scene().sphere("ball", 0.1, at=[0.4, 0.2, 0.5])
    arrangement = with_scene(robot, scene)
    true, data = robot.collision_model, robot.model.createData()
    ball, place = coal.Sphere(0.1), pin.SE3(np.eye(3), np.array([0.4, 0.2, 0.5]))
    excess = []
    for _ in range(30):
        q = robot.random_configuration(rng)
        ours = arrangement.closest(robot.state(q)).distance[0]
        shapes = pin.GeometryData(true)
        pin.updateGeometryPlacements(robot.model, data, true, shapes, q)
        distances = [
            coal.distance(
                g.geometry,
                coal.Transform3s(shapes.oMg[k].rotation, shapes.oMg[k].translation),
                ball,
                coal.Transform3s(place.rotation, place.translation),
                coal.DistanceRequest(),
                coal.DistanceResult(),
            )
            for k, g in enumerate(true.geometryObjects)
            if g.parentJoint > 0
        ]
        if min(distances) > 0.01:
            excess.append(min(distances) - ours)
    assert min(excess) >= -1e-6 and max(excess) < 7e-3


def test_wrapping_covers_every_point() -> None:
    rng = np.random.default_rng(5)
    for points in (rng.normal(size=(400, 3)), rng.normal(size=(9, 3)), rng.normal(size=(50, 3)) * [1, 1, 0]):
        shape = enclosed(points)
        assert len(shape.points) <= 32 or not points[:, 2].any()
        for p in points:
            result = coal.DistanceResult()
            place = coal.Transform3s(np.eye(3), p)
            gap = coal.distance(
                shape.coal, coal.Transform3s.Identity(), coal.Sphere(0.0), place, coal.DistanceRequest(), result
            )
            assert gap < 1e-6
    assert enclosed(rng.normal(size=(3, 3))).radius == 0.0


# ---------------------------------------------------------------- who is watched


def test_neighbours_and_what_touches_at_home_are_not_watched() -> None:
    robot = panda()
    reasons = excluded(robot)
    assert reasons["panda_link1", "panda_link2"] == "adjacent"
    assert not any("panda_link0" in pair and "panda_hand" in pair for pair in reasons)
    arrangement = with_itself(robot)
    watched = {tuple(sorted(arrangement.names(k))) for k in range(len(arrangement.pairs))}
    assert not watched & set(reasons) and ("panda_hand", "panda_link0") in watched
    assert arrangement.closest(robot.state(robot.home)).distance[0] > 0.0
    free = excluded(talos())
    assert set(free.values()) <= {"adjacent", "home", "always"} and len(free) > 20


def test_an_srdf_leaves_out_what_it_disables(tmp_path: Path) -> None:
    file = tmp_path / "panda.srdf"
    file.write_text(
        '<robot name="p"><disable_collisions link1="panda_link0" link2="panda_hand" reason="Never"/></robot>'
    )
    arrangement = with_itself(panda(), file)
    watched = {tuple(sorted(arrangement.names(k))) for k in range(len(arrangement.pairs))}
    assert ("panda_hand", "panda_link0") not in watched and ("panda_link0", "panda_link5") in watched
    bad = tmp_path / "bad.srdf"
    for text in ("<robot>", '<!DOCTYPE r [<!ENTITY a "b">]><robot>&a;</robot>'):
        bad.write_text(text)
        with pytest.raises(UrdfError, match="bad.srdf"):
            with_itself(panda(), bad)
    with pytest.raises(ParameterError, match="srdf"):
        with_itself(panda(), 3)


def test_what_is_carried_counts_as_the_robot() -> None:
    """A stick in the hand: it has nothing to do with the hand, but with a wall and with the arm's foot."""
    robot = panda()
    scene = cc.Scene().capsule("stick", 0.01, 0.4, at=[0.0, 0.0, 0.15], frame="panda_hand_tcp")
    scene.box("wall", [0.1, 2.0, 2.0], at=[1.2, 0.0, 0.5])
    arrangement = with_scene(robot, scene)
    pairs = {arrangement.names(k) for k in range(len(arrangement.pairs))}
    assert ("stick", "wall") in pairs and ("panda_link0", "stick") in pairs
    assert ("panda_hand", "stick") not in pairs and ("panda_link7", "stick") not in pairs
    state = robot.state(robot.home)
    stick = next(k for k in range(len(arrangement.pairs)) if arrangement.names(k) == ("stick", "wall"))
    arrangement.update(state)
    found = arrangement.measure(np.array([stick]))
    hand = state.placement("panda_hand_tcp")
    ends = [(hand * pin.SE3(np.eye(3), np.array([0.0, 0.0, z]))).translation[0] for z in (-0.05, 0.35)]
    assert found.distance[0] == pytest.approx(1.15 - max(ends) - 0.01, abs=1e-7)
    foot = next(k for k in range(len(arrangement.pairs)) if arrangement.names(k) == ("panda_link0", "stick"))
    u = np.random.default_rng(6).normal(size=7)
    contact = arrangement.measure(np.array([foot]))
    slope = arrangement.gradients(state, contact) @ u
    np.testing.assert_allclose(slope, one_sided(arrangement, robot, robot.home, u, contact.pairs)[1], atol=1e-6)


def test_ignored_links_and_immovable_ones_are_left_out() -> None:
    robot = panda()
    arrangement = with_scene(robot, cc.Scene().box("table", [1, 1, 0.1], at=[0, 0, -0.05], ignore="panda_link[1-2]"))
    names = {arrangement.names(k)[0] for k in range(len(arrangement.pairs))}
    assert "panda_link0" not in names and "panda_link1" not in names and "panda_link3" in names


def test_paths_move_obstacles_with_the_states_time() -> None:
    robot = panda()
    path = cc.Line([1.0, 0.0, 1.0], [1.0, 0.0, 0.2], duration=2.0)
    arrangement = with_scene(robot, cc.Scene().sphere("ball", 0.05, at=path), ["panda_hand_tcp"])
    for t in (0.0, 0.7, 1.4, 5.0):
        state = robot.state(robot.home, time=t)
        wanted = np.linalg.norm(path(t).position - state.position("panda_hand_tcp")) - 0.05
        assert arrangement.closest(state).distance[0] == pytest.approx(wanted, abs=1e-8)


def test_a_mesh_as_it_is_and_as_its_hull(tmp_path: Path) -> None:
    """An L of two triangles: the hull fills its corner, the triangles do not."""
    vertices = np.array([[0, 0, 0], [0, 1, 0], [1, 0, 0], [0, 0, 1], [0, 1, 1e-3]], dtype=float)
    faces = [[0, 1, 2], [0, 1, 3]]
    file = tmp_path / "l.obj"
    file.write_text("".join(f"v {x} {y} {z}\n" for x, y, z in vertices) + "f 1 2 3\nf 1 2 4\n")
    p = np.array([0.25, 0.2, 0.25])
    hull = distance(cc.Scene().mesh("l", vertices, at=[0, 0, 0]), p, 0.01)
    assert hull < 0.0
    for source, given in ((vertices, faces), (str(file), None)):
        surface = distance(cc.Scene().mesh("l", source, at=[0, 0, 0], faces=given, convex=False), p, 0.01)
        assert surface == pytest.approx(0.24, abs=1e-7)


def test_a_robot_without_shapes_is_its_skeleton() -> None:
    robot = cc.Robot(panda().model, tool="panda_hand_tcp")
    parts = robot_parts(robot)
    assert len(parts) >= 5 and all(part.shape.radius > 0.005 for part in parts)
    state = robot.state(robot.home)
    arrangement = with_scene(robot, cc.Scene().sphere("ball", 0.05, at=state.position("panda_link4")))
    assert arrangement.closest(state).distance[0] < 0.0


# ---------------------------------------------------------------- misuse


@pytest.mark.parametrize(
    ("bad", "error"),
    [
        (lambda s: s.sphere("a", -1.0, at=[0, 0, 0]), ParameterError),
        (lambda s: s.sphere("a", 0.1, at=[0, 0]), TargetError),
        (lambda s: s.sphere("a", 0.1, at=np.ones((4, 4))), TargetError),
        (lambda s: s.sphere("", 0.1, at=[0, 0, 0]), ParameterError),
        (lambda s: s.sphere("ball", 0.1, at=[0, 0, 0]), ParameterError),
        (lambda s: s.box("a", [1, 1], at=[0, 0, 0]), ShapeError),
        (lambda s: s.box("a", [1, 1, 0], at=[0, 0, 0]), ParameterError),
        (lambda s: s.plane("a", [0, 0, 0]), ParameterError),
        (lambda s: s.mesh("a", "/no/such.stl", at=[0, 0, 0]), UrdfError),
        (lambda s: s.mesh("a", np.eye(3), at=[0, 0, 0], convex=False), ParameterError),
        (lambda s: s.mesh("a", np.eye(3), at=[0, 0, 0], faces=[[0, 1, 7]], convex=False), ParameterError),
        (lambda s: s.sphere("a", 0.1, at=cc.Line([0, 0, 0], [1, 0, 0], duration=1.0), frame="x"), ParameterError),
        (lambda s: s.sphere("a", 0.1, at=[0, 0, 0], ignore=3), ParameterError),
        (lambda s: s.move("nobody", [0, 0, 0]), ParameterError),
        (lambda s: s.remove("nobody"), ParameterError),
        (lambda s: with_scene(panda(), s.sphere("a", 0.1, at=[0, 0, 0], frame="hnd")), FrameNotFound),
    ],
)
def test_misuse_is_refused(bad: Callable[[cc.Scene], object], error: type[CartctlError]) -> None:
    scene = cc.Scene().sphere("ball", 0.1, at=[1, 0, 0])
    with pytest.raises(error):
        bad(scene)


def test_a_scene_may_change_while_it_is_in_use() -> None:
    robot = panda()
    scene = cc.Scene().sphere("ball", 0.1, at=[1.0, 0.0, 0.5])
    constraint = cc.Avoid(scene, points=["panda_hand_tcp"])
    state = robot.state(robot.home)
    before = constraint.excess(state)
    scene.move("ball", [0.8, 0.0, 0.5])
    assert constraint.excess(state) == pytest.approx(before + 0.0, abs=0.25) and constraint.excess(state) > before
    scene.remove("ball")
    assert constraint.excess(state) == -np.inf and constraint.closest(state) is None
    assert constraint.velocity_rows(state, 1e-3).C.shape == (0, 7)
