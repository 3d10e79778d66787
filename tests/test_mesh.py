"""Meshes of the report: welding, thinning, shading, the shapes it builds, and the Collada files it reads."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from defusedxml import DefusedXmlException

from cartctl.report import shapes
from cartctl.report.collada import read_collada
from cartctl.report.mesh import Mesh, merge, shade, thin, weld

GREEN = (0.2, 0.6, 0.3)

COLLADA = """<?xml version="1.0"?>{doctype}
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
 <asset><unit name="cm" meter="0.01"/><up_axis>Z_UP</up_axis></asset>
 <library_images><image id="i"><init_from>{image}</init_from></image></library_images>
 <library_effects>
  <effect id="red-e"><profile_COMMON><technique><phong><diffuse><color>1 0 0.2 1</color></diffuse></phong></technique>
  </profile_COMMON></effect>
  <effect id="picture-e"><profile_COMMON><technique><phong><diffuse><texture texture="i"/></diffuse></phong></technique>
  </profile_COMMON></effect>
 </library_effects>
 <library_materials><material id="red"><instance_effect url="#red-e"/></material>
  <material id="picture"><instance_effect url="#picture-e"/></material></library_materials>
 <library_geometries><geometry id="g"><mesh>
  <source id="p"><float_array id="pa" count="15">0 0 0 100 0 0 100 100 0 0 100 0 50 50 100</float_array></source>
  <source id="n"><float_array id="na" count="3">0 0 1</float_array></source>
  <vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
  <polylist count="1" material="A"><input semantic="NORMAL" source="#n" offset="0"/>
   <input semantic="VERTEX" source="#v" offset="1"/><vcount>4</vcount><p>0 0 0 1 0 2 0 3</p></polylist>
  <triangles count="2" material="B"><input semantic="VERTEX" source="#v" offset="0"/><p>0 1 4 1 2 {last}</p></triangles>
 </mesh></geometry></library_geometries>
 <library_visual_scenes><visual_scene id="s">
  <node><translate>10 20 30</translate><rotate>0 0 1 90</rotate>{inner}
   <node><scale>1 2 1</scale><instance_geometry url="#g"><bind_material><technique_common>
    <instance_material symbol="A" target="#red"/><instance_material symbol="B" target="#picture"/>
   </technique_common></bind_material></instance_geometry></node></node>
 </visual_scene></library_visual_scenes>
</COLLADA>"""


def collada(folder: Path, doctype: str = "", image: str = "x.png", last: int = 4, inner: str = "") -> Path:
    """Write the test's Collada file: a pyramid without two of its sides."""
    path = folder / "mesh.dae"
    path.write_text(COLLADA.format(doctype=doctype, image=image, last=last, inner=inner))
    return path


def volume(mesh: Mesh) -> float:
    """Return the enclosed volume (divergence theorem), positive where the triangles face outwards."""
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


@pytest.mark.parametrize(
    ("mesh", "expected", "tolerance"),
    [
        (shapes.box([0.1, 0.2, 0.3], GREEN), 8 * 0.1 * 0.2 * 0.3, 1e-12),
        (shapes.sphere(0.3, GREEN), 4 / 3 * np.pi * 0.3**3, 0.01),
        (shapes.cylinder(0.2, 0.5, GREEN), np.pi * 0.2**2, 0.005),
        (shapes.capsule(0.2, 0.5, GREEN), np.pi * 0.2**2 + 4 / 3 * np.pi * 0.2**3, 0.01),
        (shapes.cone(0.2, 0.5, GREEN), np.pi * 0.2**2 / 3, 0.005),
        (shapes.segment([0.1, 0.2, 0.3], [0.4, -0.2, 0.3], 0.1, GREEN), np.pi * (0.005 + 0.004 / 3), 0.01),
    ],
)
def test_shapes_have_their_volume_and_face_outwards(mesh: Mesh, expected: float, tolerance: float) -> None:
    assert volume(mesh) == pytest.approx(expected, rel=tolerance)
    mirrored = mesh.scaled([-1.0, 2.0, 1.0])
    assert volume(mirrored) == pytest.approx(2 * expected, rel=tolerance)  # still outwards


def test_tube_follows_its_points_in_order() -> None:
    s = np.linspace(0, 3, 40)
    points = np.stack([np.cos(s), np.sin(s), 0.3 * s], axis=1)
    tube = shapes.tube(points, 0.02, GREEN, sides=8)
    rings = tube.vertices.reshape(40, 8, 3)
    np.testing.assert_allclose(np.linalg.norm(rings - points[:, None], axis=2), 0.02, rtol=1e-9)
    assert tube.faces.shape == (39 * 16, 3)
    assert (np.diff(tube.faces.min(axis=1).reshape(39, 16).min(axis=1)) > 0).all()


def test_tube_survives_a_turn_on_the_spot() -> None:
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0.5, 0, 0], [0.5, 1, 0]])
    assert np.isfinite(shapes.tube(points, 0.1, GREEN).vertices).all()


def test_along_is_a_rotation_onto_the_direction() -> None:
    for direction in np.random.default_rng(5).normal(size=(20, 3)):
        T = shapes.along(direction, [1, 2, 3])
        np.testing.assert_allclose(T[:3, :3] @ T[:3, :3].T, np.eye(3), atol=1e-12)
        assert np.linalg.det(T[:3, :3]) == pytest.approx(1)
        np.testing.assert_allclose(T[:3, 2], direction / np.linalg.norm(direction))
        np.testing.assert_allclose(T[:3, 3], [1, 2, 3])


def test_shading_is_sharp_on_a_box_and_smooth_on_a_sphere() -> None:
    box = shade(weld(shapes.box([0.1, 0.2, 0.3], GREEN)))
    assert len(box.vertices) == 24  # three normals a corner
    assert set(np.abs(box.normals).max(axis=1).round(9)) == {1.0}
    ball = shade(weld(shapes.sphere(0.3, GREEN)))
    assert len(ball.vertices) == len(weld(shapes.sphere(0.3, GREEN)).vertices)
    np.testing.assert_allclose(ball.normals, ball.vertices / 0.3, atol=0.03)


def test_shading_keeps_colours_apart() -> None:
    flat = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    mesh = Mesh(flat, np.array([[0, 1, 2], [0, 2, 3]]), np.array([[255, 0, 0], [0, 0, 255]], dtype=np.uint8))
    shaded = shade(mesh)
    assert len(shaded.vertices) == 6
    np.testing.assert_array_equal(shaded.colors[shaded.faces[1]], [[0, 0, 255]] * 3)
    np.testing.assert_allclose(shaded.vertices[shaded.faces[0]], flat[[0, 1, 2]])


def test_welding_joins_duplicates_and_drops_collapsed_triangles() -> None:
    ball = shapes.sphere(0.3, GREEN)
    soup = Mesh(ball.vertices[ball.faces].reshape(-1, 3), np.arange(3 * len(ball.faces)).reshape(-1, 3), ball.colors)
    welded = weld(soup)
    assert len(welded.vertices) == 48 * 24 + 2  # 24 rings and the poles
    assert len(welded.faces) == 2 * 48 * 24  # those at the poles have collapsed


def test_thinning_reaches_its_budget_and_keeps_the_shape() -> None:
    rng = np.random.default_rng(2)
    places = [shapes.along(rng.normal(size=3), 3 * rng.normal(size=3)) for _ in range(5)]
    ball = merge([weld(shapes.sphere(0.3, GREEN)).moved(place) for place in places])
    thinned = thin(ball, 4000)
    assert 500 < len(thinned.faces) <= 4000 < len(ball.faces)
    np.testing.assert_allclose(thinned.bounds(), ball.bounds(), atol=0.1)


def test_collada_is_read_with_units_transforms_and_colours(tmp_path: Path) -> None:
    mesh = read_collada(collada(tmp_path))
    corners = mesh.vertices[mesh.faces]  # (k, 3, 3)
    assert corners.shape == (4, 3, 3)  # a quad and two triangles
    # x -> y, y -> -x by the rotation, y twice as long, then the offset, all in cm
    np.testing.assert_allclose(corners[0, 1], [0.1, 0.2 + 1.0, 0.3], atol=1e-12)
    np.testing.assert_allclose(corners[0, 2], [0.1 - 2.0, 0.2 + 1.0, 0.3], atol=1e-12)
    np.testing.assert_allclose(corners[2, 2], [0.1 - 1.0, 0.2 + 0.5, 0.3 + 1.0], atol=1e-12)
    np.testing.assert_array_equal(mesh.colors, [[255, 0, 51]] * 2 + [[204, 204, 204]] * 2)


def test_collada_refuses_entities(tmp_path: Path) -> None:
    secret = tmp_path / "secret.txt"
    secret.write_text("1 2 3")
    doctype = f'<!DOCTYPE x [<!ENTITY e SYSTEM "{secret.as_uri()}">]>'
    with pytest.raises(DefusedXmlException):
        read_collada(collada(tmp_path, doctype=doctype))


def test_collada_opens_no_other_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = collada(tmp_path, image="/etc/hostname")
    opened = []
    keep = Path.open
    monkeypatch.setattr(Path, "open", lambda self, *a, **k: (opened.append(self), keep(self, *a, **k))[1])
    assert len(read_collada(path).faces) == 4
    assert set(opened) <= {path}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"last": 99}, "not there"),
        ({"inner": '<node id="loop"><instance_node url="#loop"/><instance_node url="#loop"/></node>'}, "circle"),
        ({"inner": '<instance_node url="#nowhere"/>'}, "dangling"),
    ],
)
def test_collada_refuses_contradictions(tmp_path: Path, change: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        read_collada(collada(tmp_path, **change))  # type: ignore[arg-type]
