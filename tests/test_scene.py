"""The scene of the report: which samples it shows, where it looks from, what it makes of a robot's visuals."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import coal
import meshcat.geometry as mg
import numpy as np
import pinocchio as pin
import pytest

from cartctl.errors import CartctlWarning
from cartctl.report.actor import spaced
from cartctl.report.bodies import TRIANGLES, bodies, surface
from cartctl.report.camera import ASPECT, FOV, view
from cartctl.report.html import page
from cartctl.report.mesh import weld
from cartctl.report.recorder import Recorder
from cartctl.report.shapes import lathe, sphere
from cartctl.report.timeline import FRAMES, frames
from tests.report_runs import planar_run


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(17)


def seen(points: np.ndarray, look: Any, zoom: float = 1.0) -> tuple[float, float]:
    """Return how far the points reach across and up, in units of half the window's height (pinhole camera)."""
    z = look.offset / np.linalg.norm(look.offset)
    x = np.cross([0, 0, 1], z) / np.linalg.norm(np.cross([0, 0, 1], z))
    relative = points - (look.center + look.offset)
    depth = -relative @ z
    assert (depth > 0).all()
    scale = zoom / np.tan(np.deg2rad(FOV) / 2)
    across, up = (np.abs(relative @ axis / depth).max() * scale for axis in (x, np.cross(z, x)))
    return float(across), float(up)


@pytest.mark.parametrize("stretch", [(1, 1, 1), (2, 2, 0.1), (0.1, 1, 1), (1, 0.1, 1), (0.02, 0.02, 0.02), (5, 1, 3)])
def test_view_shows_everything_and_wastes_little(stretch: tuple[float, ...], rng: np.random.Generator) -> None:
    points = rng.uniform(-1, 1, (500, 3)) * stretch + rng.uniform(-3, 3, 3)
    look = view(points)
    across, up = seen(points, look)
    assert across < ASPECT and up < 1.0
    assert max(across / ASPECT, up) > 0.8
    narrow = 0.5 * look.aspect  # the page zooms out by aspect / look.aspect
    assert seen(points, look, zoom=narrow / look.aspect)[0] < narrow


@pytest.mark.parametrize(("step", "count"), [(1e-3, 4001), (0.1, 41), (1 / 30, 200), (1e-3, 2), (0.05, 30_000)])
def test_frames_cover_the_run_at_thirty_a_second(step: float, count: int) -> None:
    time = 5.0 + step * np.arange(count)
    kept = frames(time)
    assert kept[0] == 0 and kept[-1] == count - 1 and (np.diff(kept) > 0).all()
    assert len(kept) <= min(FRAMES, count, np.ceil((time[-1] - time[0]) * 30) + 1)
    gaps = np.diff(time[kept])
    assert gaps.max() <= max(step, 1 / 30, (time[-1] - time[0]) / (FRAMES - 1)) + step + 1e-9
    np.testing.assert_array_equal(frames(time[:1]), [0])


def test_spaced_points_keep_their_distance_along_the_path(rng: np.random.Generator) -> None:
    points = np.cumsum(rng.normal(scale=1e-3, size=(5000, 3)), axis=0)
    kept = spaced(points, 0.01)
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    assert kept[0] == 0 and (np.diff(length[kept]) > 0).all() and np.diff(length[kept]).max() < 0.02
    assert len(spaced(points, 1e-9, most=100)) <= 101
    np.testing.assert_array_equal(spaced(np.ones((50, 3)), 0.01), [0])


def test_the_same_run_gives_the_same_page() -> None:
    first, second = page(planar_run()), page(planar_run())
    assert first == second


def test_recorder_hides_identifiers_and_keeps_them_apart() -> None:
    recorder = Recorder()
    vis = recorder.visualizer()
    box = mg.Mesh(mg.Box([1, 2, 3]), mg.MeshPhongMaterial())
    vis["a"].set_object(box)
    vis["b"].set_object(mg.Sphere(1.0))
    packed = b"".join(recorder.commands)
    assert box.uuid.encode() not in packed and box.geometry.uuid.encode() not in packed
    assert set(re.findall(rb"id\d", packed)) == {f"id{k}".encode() for k in range(6)}  # twice an object of two parts


def geometry_of(shape: Any, path: str = "", color: tuple[float, ...] = (0.1, 0.5, 0.9, 1.0), own: bool = False) -> Any:
    """Return a visual at joint 0 as Pinocchio would load it."""
    scale = np.ones(3)
    return pin.GeometryObject("part", 0, 0, pin.SE3.Identity(), shape, path, scale, not own, np.array(color))


@pytest.mark.parametrize(
    ("shape", "half"),
    [
        (coal.Box(0.2, 0.4, 0.6), (0.1, 0.2, 0.3)),
        (coal.Sphere(0.3), (0.3, 0.3, 0.3)),
        (coal.Cylinder(0.2, 0.8), (0.2, 0.2, 0.4)),
        (coal.Capsule(0.2, 0.8), (0.2, 0.2, 0.6)),
        (coal.Cone(0.2, 0.8), (0.2, 0.2, 0.4)),
        (coal.Ellipsoid(0.1, 0.2, 0.3), (0.1, 0.2, 0.3)),
    ],
)
def test_primitives_have_their_size_and_colour(shape: Any, half: tuple[float, ...]) -> None:
    mesh = surface(geometry_of(shape))
    assert mesh is not None
    np.testing.assert_allclose(mesh.bounds(), [np.negative(half), half], atol=4e-3)
    np.testing.assert_array_equal(mesh.colors[0], [26, 128, 230])


def bvh(mesh: Any) -> Any:
    """Return a mesh as coal keeps it."""
    model = coal.BVHModelOBBRSS()
    model.beginModel(len(mesh.faces), len(mesh.vertices))
    for face in mesh.faces:
        model.addTriangle(*mesh.vertices[face])
    model.endModel()
    return model


def test_a_broken_collada_file_costs_only_its_colours(tmp_path: Path) -> None:
    ball = weld(sphere(0.3, (1, 0, 0)))
    path = tmp_path / "broken.dae"
    path.write_text("<COLLADA><library_geometries>")
    with pytest.warns(CartctlWarning, match=r"broken\.dae"):
        mesh = surface(geometry_of(bvh(ball), str(path), own=True))
    assert mesh is not None
    np.testing.assert_allclose(mesh.bounds(), ball.bounds(), atol=1e-9)


def test_large_robots_are_thinned_and_invisible_parts_left_out() -> None:
    angle = np.linspace(-np.pi / 2, np.pi / 2, 600)
    fine = weld(lathe(np.stack([np.cos(angle), np.sin(angle)], axis=1), (1, 1, 1), sides=250))
    assert len(fine.faces) > TRIANGLES
    visual = pin.GeometryModel()
    visual.addGeometryObject(geometry_of(bvh(fine)))
    hidden = geometry_of(coal.Sphere(5.0), color=(1, 1, 1, 0.0))
    hidden.name = "hidden"
    visual.addGeometryObject(hidden)
    (body,) = bodies(pin.Model(), visual)
    assert TRIANGLES / 10 < len(body.mesh.faces) <= TRIANGLES
    np.testing.assert_allclose(body.mesh.bounds(), [[-1] * 3, [1] * 3], atol=0.02)
