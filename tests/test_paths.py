"""Paths: pose, twist and acceleration agree, rest at both ends, shapes as stated, bad input refused."""

from __future__ import annotations

import copy
import math
import pickle
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.interpolate import make_interp_spline

from cartctl.errors import CartctlError, NonFiniteError, ParameterError, PathError, ShapeError
from cartctl.paths import (
    Circle,
    Ellipse,
    Line,
    Lissajous,
    Path,
    PathSample,
    Polygon,
    SmoothTrapezoid,
    Waypoints,
)
from cartctl.paths.so3 import Turn, left_rates, right_rates, vector_rates

EXACT = 1e-12  # closed forms, m and rad
FD = 1e-6  # finite differences against the peak of the derivative

coordinates = st.floats(-1.5, 1.5)
vectors = st.tuples(coordinates, coordinates, coordinates).map(np.array)
unit_vectors = vectors.filter(lambda v: np.linalg.norm(v) > 0.1).map(lambda v: v / np.linalg.norm(v))
rotations = st.builds(lambda axis, angle: pin.exp3(axis * angle), unit_vectors, st.floats(0.0, 3.1))
poses = st.builds(pin.SE3, rotations, vectors)
places = st.one_of(vectors, poses, poses.map(lambda m: m.homogeneous))
orientations = st.one_of(st.none(), rotations)
lengths = st.floats(0.05, 1.0)
durations = st.floats(0.5, 10.0)
laps = st.integers(1, 3)
angles = st.floats(-7.0, 7.0)
timings = st.one_of(st.just("quintic"), st.just("trapezoid"), st.floats(0.1, 0.5).map(SmoothTrapezoid))


@st.composite
def lines(draw) -> Line:
    kind = draw(st.sampled_from(["points", "poses", "mixed"]))
    start = draw(vectors if kind == "points" else poses)
    end = draw(poses if kind == "poses" else vectors)
    a, b = (getattr(x, "translation", x) for x in (start, end))
    assume(np.linalg.norm(b - a) > 0.05)
    return Line(start, end, draw(durations), draw(timings))


circles = st.builds(
    Circle,
    center=places,
    radius=lengths,
    period=durations,
    laps=laps,
    normal=st.one_of(st.none(), unit_vectors),
    orientation=orientations,
    start_angle=angles,
    timing=timings,
)
ellipses = st.builds(
    Ellipse,
    center=places,
    semi_axes=st.tuples(lengths, lengths),
    period=durations,
    laps=laps,
    normal=st.one_of(st.none(), unit_vectors),
    start_angle=angles,
    timing=timings,
)
lissajous = st.builds(
    Lissajous,
    center=places,
    amplitudes=st.tuples(lengths, lengths, lengths),
    frequencies=st.sampled_from([(1, 2, 0), (1, 1, 1), (3, 2, 1), (0, 0, 1)]),
    phases=st.tuples(angles, angles, angles),
    period=durations,
    laps=laps,
    orientation=orientations,
    timing=timings,
)


def edges_of(vertices, closed: bool) -> list[float]:
    corners = [*vertices, vertices[0]] if closed else [*vertices]
    return [float(np.linalg.norm(b - a)) for a, b in pairwise(corners)]


@st.composite
def polygons(draw, rounded: bool | None = None) -> Polygon:
    closed = draw(st.booleans())
    vertices = np.array(draw(st.lists(vectors, min_size=3, max_size=5)))
    edges = edges_of(vertices, closed)
    assume(min(edges) > 0.2)
    share = draw(st.sampled_from([0.0, 0.2, 0.5])) if rounded is None else 0.3 * rounded
    return Polygon(
        vertices,
        duration=draw(durations),
        blend=share * min(edges),
        closed=closed,
        laps=draw(laps) if closed else 1,
        orientation=draw(orientations),
        timing=draw(timings),
    )


@st.composite
def waypoints(draw, stop: bool = False) -> Waypoints:
    chosen = draw(st.lists(draw(st.sampled_from([vectors, poses])), min_size=2, max_size=5))
    positions = [getattr(p, "translation", p) for p in chosen]
    assume(all(np.linalg.norm(b - a) > 0.1 for a, b in pairwise(positions)))
    gaps = draw(st.lists(st.floats(0.5, 2.0), min_size=len(chosen), max_size=len(chosen)))
    if draw(st.booleans()):
        return Waypoints(chosen, times=np.cumsum(gaps) - gaps[0] * draw(st.sampled_from([0, 1])), stop=stop)
    return Waypoints(chosen, duration=draw(durations), stop=stop, timing=draw(timings))


KINDS = {
    "line": lines(),
    "circle": circles,
    "ellipse": ellipses,
    "lissajous": lissajous,
    "polygon": polygons(),
    "waypoints": waypoints(),
    "stops": waypoints(stop=True),
}
every_kind = pytest.mark.parametrize("kind", KINDS)


def joints(path: Path) -> list[float]:
    """Times at which the third derivative may jump: between pieces, at the ends of a trapezoid's ramps."""
    if isinstance(path, Polygon):
        sharp = edges_of(path.vertices, path.closed)
        vertices = np.cumsum([0.0, *sharp]) / sum(sharp)
        stops = vertices if path.blend == 0.0 else np.array([0.0, 1.0])
        near = path.blend / sum(sharp)
        corners = [v + d for v in vertices[1:-1] for d in (-near, near)] if near else []
        lap = [path.timing.inverse(c) for c in corners]
        legs = [(lap_k + a, lap_k + b) for lap_k in range(path.laps) for a, b in pairwise(stops)]
        found = [x / path.laps * path.duration for a, b in legs for x in (a, *(a + t * (b - a) for t in lap), b)]
        spans = [(a / path.laps * path.duration, b / path.laps * path.duration) for a, b in legs]
    elif isinstance(path, Waypoints):
        found = path.passing_times.tolist()
        spans = list(pairwise(found)) if path.stop else []
    else:
        found, spans = [0.0, path.duration], [(0.0, path.duration)]
    if isinstance(path.timing, SmoothTrapezoid):
        found += [a + r * (b - a) for a, b in spans for r in (path.timing.ramp, 1.0 - path.timing.ramp)]
    return found


def difference(f, t: float, h: float):
    """Central difference of fourth order."""
    return (8.0 * (f(t + h) - f(t - h)) - (f(t + 2 * h) - f(t - 2 * h))) / (12.0 * h)


def fields(sample: PathSample) -> list[np.ndarray]:
    rotation = [] if sample.rotation is None else [sample.rotation]
    return [sample.position, *rotation, sample.twist, sample.acceleration]


def same(a: PathSample, b: PathSample, tolerance: float = 0.0) -> None:
    assert (a.rotation is None) == (b.rotation is None)
    for x, y in zip(fields(a), fields(b), strict=True):
        np.testing.assert_allclose(x, y, rtol=0, atol=tolerance)


# What every path promises


@every_kind
@settings(max_examples=60, deadline=None)
@given(data=st.data())
def test_twist_and_acceleration_are_derivatives(kind, data):
    path = data.draw(KINDS[kind])
    h = 2e-5 * path.duration
    t = data.draw(st.floats(0.01, 0.99)) * path.duration
    assume(all(abs(t - joint) > 3 * h for joint in joints(path)))
    here = path(t)
    twist = np.zeros(6)
    twist[:3] = difference(lambda x: path(x).position, t, h)
    if here.rotation is not None:
        twist[3:] = difference(lambda x: pin.log3(path(x).rotation @ here.rotation.T), t, h)
    peaks = [path(x) for x in np.linspace(0.0, path.duration, 101).tolist()]
    speed = max(np.abs(s.twist).max() for s in peaks)
    np.testing.assert_allclose(here.twist, twist, rtol=0, atol=FD * speed)
    acceleration = difference(lambda x: path(x).twist, t, h)
    peak = max(np.abs(s.acceleration).max() for s in peaks)
    np.testing.assert_allclose(here.acceleration, acceleration, rtol=0, atol=10 * FD * peak)


@every_kind
@settings(max_examples=25, deadline=None)
@given(data=st.data())
def test_velocity_and_acceleration_are_continuous_at_the_joints(kind, data):
    path = data.draw(KINDS[kind])
    peaks = [path(x) for x in np.linspace(0.0, path.duration, 101).tolist()]
    speed = max(np.abs(s.twist).max() for s in peaks)
    peak = max(np.abs(s.acceleration).max() for s in peaks)
    h = 1e-8 * path.duration
    for joint in joints(path):
        before, after = path(joint - h), path(joint + h)
        np.testing.assert_allclose(before.position, after.position, atol=1e-5)
        if before.rotation is not None:
            np.testing.assert_allclose(before.rotation, after.rotation, atol=1e-5)
        np.testing.assert_allclose(before.twist, after.twist, atol=1e-4 * speed)
        np.testing.assert_allclose(before.acceleration, after.acceleration, atol=1e-4 * peak)


@every_kind
@settings(max_examples=25, deadline=None)
@given(data=st.data())
def test_rests_at_both_ends_and_holds_beyond(kind, data):
    path = data.draw(KINDS[kind])
    for end, beyond in ((0.0, -1.0), (path.duration, path.duration + 100.0)):
        assert not path(end).twist.any() and not path(end).acceleration.any()
        same(path(end), path(beyond))
    near = path(path.duration * (1 - 1e-9))
    np.testing.assert_allclose(near.position, path(path.duration).position, atol=1e-9)


@every_kind
@settings(max_examples=25, deadline=None)
@given(data=st.data())
def test_cycles_begin_where_the_path_begins(kind, data):
    path = data.draw(KINDS[kind])
    times = path.cycle_times()
    if not path.closed:
        assert times.shape == (0,)
        return
    assert times.shape == (getattr(path, "laps", 1) + 1,)
    assert (times[0], times[-1]) == (0.0, path.duration)
    assert (np.diff(times) > 0).all()
    for t in times.tolist():
        np.testing.assert_allclose(path(t).position, path(0.0).position, atol=EXACT * 100)


@every_kind
@settings(max_examples=25, deadline=None)
@given(data=st.data())
def test_samples_are_well_formed_and_never_shared(kind, data):
    path = data.draw(KINDS[kind])
    t = data.draw(st.floats(-0.2, 1.2)) * path.duration
    first, expected = path(t), copy.deepcopy(path(t))
    assert [first.position.shape, first.twist.shape, first.acceleration.shape] == [(3,), (6,), (6,)]
    assert path.has_orientation == (first.rotation is not None)
    for x in fields(first):
        assert x.dtype == np.float64 and np.isfinite(x).all()
        if x.flags.writeable:
            x += 1.0
    same(path(t), expected)
    if expected.rotation is not None:
        np.testing.assert_allclose(expected.rotation.T @ expected.rotation, np.eye(3), atol=EXACT)


@every_kind
@settings(max_examples=15, deadline=None)
@given(data=st.data())
def test_rebuilt_copied_and_pickled_paths_are_the_same_path(kind, data):
    path = data.draw(KINDS[kind])
    for other in (replace(path), copy.deepcopy(path), pickle.loads(pickle.dumps(path))):
        assert other.duration == path.duration
        for t in np.linspace(0.0, path.duration, 7).tolist():
            same(path(t), other(t), EXACT * 100)


@every_kind
@settings(max_examples=10, deadline=None)
@given(data=st.data())
def test_polyline_goes_from_end_to_end_of_a_lap(kind, data):
    path = data.draw(KINDS[kind])
    points = path.polyline(50)
    assert points.shape == (50, 3)
    np.testing.assert_allclose(points[0], path(0.0).position, atol=EXACT)
    np.testing.assert_allclose(points[-1], path(path.duration).position, atol=EXACT * 100)
    assert np.ptp(points, axis=0).max() > 1e-3


@every_kind
@settings(max_examples=5, deadline=None)
@given(data=st.data())
def test_any_kind_of_number_is_a_time(kind, data):
    path = data.draw(KINDS[kind])
    for t in (1, np.float64(1.0), np.float32(1.0), np.array(1.0), np.int64(1)):
        same(path(t), path(1.0))
    for t in (math.nan, math.inf, -math.inf, np.float64("nan")):
        with pytest.raises(NonFiniteError, match="path time t"):
            path(t)
    for t in ("1.0", None, True, 1j, np.zeros(2)):
        with pytest.raises(ParameterError, match="path time t"):
            path(t)


# Line


@settings(deadline=None)
@given(poses, poses, st.floats(0.0, 1.0))
def test_line_formula(start, end, fraction):
    assume(np.linalg.norm(end.translation - start.translation) > 1e-3)
    line = Line(start, end, duration=2.0)
    s = line.timing(fraction).s
    sample = line(2.0 * fraction)
    np.testing.assert_allclose(
        sample.position, start.translation + s * (end.translation - start.translation), atol=EXACT
    )
    phi = pin.log3(start.rotation.T @ end.rotation)
    np.testing.assert_allclose(sample.rotation, start.rotation @ pin.exp3(s * phi), atol=EXACT)
    same(Line(start.homogeneous, end.homogeneous, duration=2.0)(2.0 * fraction), sample, EXACT)


def test_line_peaks_at_1_875_times_its_mean_speed():
    line = Line((0.1, 0.2, 0.3), (0.4, 0.6, 0.3), duration=2.0)
    assert np.linalg.norm(line(1.0).twist[:3]) == pytest.approx(1.875 * 0.5 / 2.0, rel=1e-14)
    assert not line.closed and line.has_orientation is False


@settings(deadline=None)
@given(poses, vectors)
def test_a_pose_and_a_point_keep_the_orientation(pose, point):
    assume(np.linalg.norm(point - pose.translation) > 1e-3)
    for line in (Line(pose, point, duration=1.0), Line(point, pose, duration=1.0)):
        np.testing.assert_allclose(line(0.3).rotation, pose.rotation, atol=EXACT)
        assert not line(0.3).twist[3:].any()


def test_a_turn_in_place_and_a_half_turn():
    start = pin.SE3(pin.exp3(np.array([0.3, -0.2, 0.5])), np.array([0.1, 0.2, 0.3]))
    for axis in np.vstack((np.eye(3), np.ones((1, 3)) / math.sqrt(3))):
        end = pin.SE3(start.rotation @ (2 * np.outer(axis, axis) - np.eye(3)), start.translation)
        line = Line(start, end, duration=3.0)
        np.testing.assert_allclose(line(3.0).rotation, end.rotation, atol=1e-8)
        assert np.linalg.norm(line(1.5).twist[3:]) == pytest.approx(1.875 * math.pi / 3.0, rel=1e-7)
        assert not line(1.5).twist[:3].any()


# Circle, ellipse, Lissajous


@settings(deadline=None)
@given(circles, st.floats(0.0, 1.0))
def test_circle_stays_at_its_radius_in_its_plane_and_turns_about_its_normal(circle, fraction):
    sample = circle(fraction * circle.duration)
    r = sample.position - circle.center
    assert np.linalg.norm(r) == pytest.approx(circle.radius, rel=1e-12)
    assert r @ circle.normal == pytest.approx(0.0, abs=EXACT)
    assert np.cross(r, sample.twist[:3]) @ circle.normal >= -EXACT
    angle = circle.start_angle + 2 * math.pi * circle.laps * circle.timing(fraction).s
    y = np.cross(circle.normal, circle.x_axis)
    expected = circle.radius * (math.cos(angle) * circle.x_axis + math.sin(angle) * y)
    np.testing.assert_allclose(r, expected, atol=1e-11)
    assert circle.duration == circle.laps * circle.period


@settings(deadline=None)
@given(poses, st.floats(-3.0, 3.0))
def test_circle_about_a_pose_lies_in_its_xy_plane_and_holds_its_rotation(pose, angle):
    circle = Circle(pose, radius=0.2, start_angle=angle)
    sample = circle(0.0)
    local = pose.rotation.T @ (sample.position - pose.translation)
    np.testing.assert_allclose(local, [0.2 * math.cos(angle), 0.2 * math.sin(angle), 0.0], atol=EXACT)
    np.testing.assert_allclose(sample.rotation, pose.rotation, atol=EXACT)
    other = Circle(pose, normal=(0, 0, -3), orientation=np.eye(3))
    np.testing.assert_array_equal(other.normal, [0, 0, -1])
    np.testing.assert_array_equal(other(1.0).rotation, np.eye(3))


def test_circle_defaults_to_the_horizontal_plane_from_world_x():
    circle = Circle((0.5, 0.1, 0.4))
    np.testing.assert_allclose(circle(0.0).position, [0.6, 0.1, 0.4], atol=EXACT)
    np.testing.assert_allclose(circle(2.0).position, [0.4, 0.1, 0.4], atol=EXACT)
    assert circle.closed and not circle.has_orientation and circle.duration == 4.0
    steep = Circle((0, 0, 0), normal=(1, 0, 0))
    np.testing.assert_allclose(steep(0.0).position, [0, 0.1, 0], atol=EXACT)


@settings(deadline=None)
@given(st.integers(2, 50), timings)
def test_cycle_times_invert_the_timing_law(count, timing):
    circle = Circle((0, 0, 0), period=1.7, laps=count, timing=timing)
    for k, t in enumerate(circle.cycle_times().tolist()):
        assert circle.timing(t / circle.duration).s == pytest.approx(k / count, abs=1e-12)


@settings(deadline=None)
@given(st.one_of(vectors, poses), lengths, unit_vectors, unit_vectors)
def test_circle_starting_at_a_pose_begins_there(start, radius, normal, towards):
    assume(np.linalg.norm(np.cross(normal, towards)) > 0.01)
    circle = Circle.starting_at(start, radius, normal=normal, towards=towards, period=2.0, laps=2)
    place = start if isinstance(start, np.ndarray) else start.translation
    np.testing.assert_allclose(circle(0.0).position, place, atol=EXACT)
    inward = circle.center - place
    assert np.linalg.norm(inward) == pytest.approx(radius)
    assert inward @ normal == pytest.approx(0.0, abs=EXACT)
    assert inward @ towards > 0.0
    assert circle.has_orientation == isinstance(start, pin.SE3)
    if isinstance(start, pin.SE3):
        np.testing.assert_allclose(circle(0.7).rotation, start.rotation, atol=EXACT)


def test_circle_starting_at_a_pose_leans_towards_the_origin_unless_told():
    circle = Circle.starting_at((0.3, 0.4, 0.5), radius=0.1)
    np.testing.assert_allclose(circle.center, [0.24, 0.32, 0.5], atol=EXACT)
    with pytest.raises(PathError, match="towards .* is parallel to the normal"):
        Circle.starting_at((0.0, 0.0, 0.5))
    with pytest.raises(PathError, match="towards .* is parallel to the normal"):
        Circle.starting_at((0.3, 0.0, 0.5), towards=(0, 0, 2))


@settings(deadline=None)
@given(ellipses, st.floats(0.0, 1.0))
def test_ellipse_equation(ellipse, fraction):
    r = ellipse(fraction * ellipse.duration).position - ellipse.center
    a, b = ellipse.semi_axes
    x, y = r @ ellipse.x_axis, r @ np.cross(ellipse.normal, ellipse.x_axis)
    assert (x / a) ** 2 + (y / b) ** 2 == pytest.approx(1.0, abs=1e-10)
    assert r @ ellipse.normal == pytest.approx(0.0, abs=EXACT)


@settings(deadline=None)
@given(lissajous, st.floats(0.0, 1.0))
def test_lissajous_formula(figure, fraction):
    s = figure.timing(fraction).s
    turns = 2 * math.pi * figure.laps * s * np.array(figure.frequencies)
    expected = figure.center + figure.axes @ (figure.amplitudes * np.sin(turns + figure.phases))
    np.testing.assert_allclose(figure(fraction * figure.duration).position, expected, atol=1e-11)


@settings(deadline=None)
@given(poses)
def test_lissajous_about_a_pose_has_its_axes(pose):
    figure = Lissajous(pose, (0.1, 0.2, 0.0), (1, 2, 0))
    np.testing.assert_allclose(figure(0.0).position, pose.translation, atol=EXACT)
    np.testing.assert_allclose(figure(1.0).rotation, pose.rotation, atol=EXACT)
    local = pose.rotation.T @ (figure(0.9).position - pose.translation)
    assert local[2] == pytest.approx(0.0, abs=EXACT) and abs(local[0]) > 1e-3


# Polygon

SQUARE = np.array([(0, 0, 0.2), (1, 0, 0.2), (1, 1, 0.2), (0, 1, 0.2)], dtype=float)


@settings(deadline=None, max_examples=50)
@given(polygons(rounded=True), st.data())
def test_rounded_corners_stay_close_and_edges_stay_straight(polygon, data):
    corners = [*polygon.vertices, polygon.vertices[0]] if polygon.closed else [*polygon.vertices]
    starts, steps = np.array(corners[:-1]), np.diff(corners, axis=0)
    lap = polygon.duration / polygon.laps
    trace = np.array([polygon(t).position for t in np.linspace(0.0, lap, 200).tolist()])
    for p in trace:
        share = np.clip(np.einsum("ij,ij->i", p - starts, steps) / (steps**2).sum(1), 0.0, 1.0)
        off = np.linalg.norm(starts + share[:, None] * steps - p, axis=1).min()
        if off > 1e-9:
            assert np.linalg.norm(polygon.vertices - p, axis=1).min() < polygon.blend + 1e-9
    lengths = np.linalg.norm(steps, axis=1)
    ends = np.cumsum(lengths)
    for k, (u, w) in enumerate(pairwise(steps / lengths[:, None])):
        t = lap * polygon.timing.inverse(ends[k] / ends[-1])
        sample, blend = polygon(t), polygon.blend
        nearest = corners[k + 1] + 3 / 16 * blend * (w - u)
        np.testing.assert_allclose(sample.position, nearest, atol=1e-10)
        sigma_dot = ends[-1] / lap * polygon.timing(t / lap).s_dot
        np.testing.assert_allclose(sample.twist[:3], sigma_dot * (u + w) / 2, atol=1e-9)
        middle = lap * polygon.timing.inverse((ends[k] - lengths[k] / 2) / ends[-1])
        np.testing.assert_allclose(polygon(middle).position, corners[k] + steps[k] / 2, atol=1e-10)


@settings(deadline=None, max_examples=30)
@given(polygons(rounded=False))
def test_without_a_blend_it_stops_at_every_corner(polygon):
    lengths = edges_of(polygon.vertices, polygon.closed)
    times = np.cumsum([0.0, *lengths]) / sum(lengths) * polygon.duration / polygon.laps
    corners = [*polygon.vertices, polygon.vertices[0]]
    for t, corner in zip(times.tolist(), corners, strict=False):
        sample = polygon(t)
        np.testing.assert_allclose(sample.position, corner, atol=1e-10)
        np.testing.assert_allclose(sample.twist, 0.0, atol=1e-10)
        np.testing.assert_allclose(sample.acceleration, 0.0, atol=1e-10)


def test_polygon_speed_is_the_mean_along_the_edges():
    polygon = Polygon(SQUARE, speed=0.5, laps=2, blend=0.1)
    assert polygon.duration == pytest.approx(16.0)
    np.testing.assert_allclose(polygon.cycle_times(), [0.0, 8.0, 16.0])
    peak = max(np.linalg.norm(polygon(t).twist) for t in np.linspace(0, 8, 801).tolist())
    assert peak == pytest.approx(1.875 * 0.5, rel=1e-2)
    assert replace(polygon, blend=0.2).duration == polygon.duration
    open_one = Polygon(SQUARE, speed=0.5, closed=False)
    assert open_one.duration == pytest.approx(6.0) and not open_one.closed


def test_the_largest_blend_is_named_and_fits():
    Polygon(SQUARE, duration=4.0, blend=0.5)
    with pytest.raises(PathError, match="blend is 0.6 m: expected at most 0.5 m, as edge 1"):
        Polygon(SQUARE, duration=4.0, blend=0.6)
    Polygon([(0, 0, 0), (1, 0, 0), (1, 2, 0)], closed=False, duration=1.0, blend=1.0)


# Waypoints


@settings(deadline=None, max_examples=50)
@given(st.booleans(), st.data())
def test_waypoints_are_met_at_their_times(stop, data):
    path = data.draw(waypoints(stop=stop))
    for t, pose in zip(path.passing_times.tolist(), path.poses, strict=True):
        sample = path(t)
        np.testing.assert_allclose(sample.position, getattr(pose, "translation", pose), atol=1e-11)
        if path.has_orientation:
            np.testing.assert_allclose(sample.rotation, pose.rotation, atol=1e-11)
        if stop:
            assert np.abs(sample.twist).max() < 1e-9


@settings(deadline=None, max_examples=30)
@given(st.lists(vectors, min_size=2, max_size=6), unit_vectors, st.data())
def test_spline_is_the_minimum_jerk_spline_for_positions_and_for_turns_about_one_axis(points, axis, data):
    turns = data.draw(st.lists(st.floats(-1.5, 1.5), min_size=len(points), max_size=len(points)))
    times = np.cumsum(data.draw(st.lists(st.floats(0.5, 2.0), min_size=len(points), max_size=len(points))))
    assume(np.ptp(points, axis=0).max() > 0.1)
    path = Waypoints([pin.SE3(pin.exp3(axis * a), p) for a, p in zip(turns, points, strict=True)], times)
    values = np.column_stack((points, np.outer(turns, axis)))
    rest = [(1, np.zeros(6)), (2, np.zeros(6))]
    spline = make_interp_spline(times, values, k=5, bc_type=(rest, rest))
    for t in np.linspace(times[0], times[-1], 9)[1:-1].tolist():
        sample, expected = path(t), spline(t)
        np.testing.assert_allclose(sample.position, expected[:3], atol=1e-8)
        np.testing.assert_allclose(sample.rotation, pin.exp3(expected[3:]), atol=1e-8)
        np.testing.assert_allclose(sample.twist, spline(t, 1), atol=1e-7)
        np.testing.assert_allclose(sample.acceleration, spline(t, 2), atol=1e-6)


@settings(deadline=None, max_examples=30)
@given(vectors, vectors, st.lists(st.floats(0.1, 0.9), min_size=1, max_size=4, unique=True), st.floats(0.0, 1.0))
def test_waypoints_along_a_line_move_as_the_line_does(start, end, shares, fraction):
    assume(np.linalg.norm(end - start) > 0.1)
    shares = [0.0, *sorted(shares), 1.0]
    assume(min(np.diff(shares)) > 0.02)
    path = Waypoints([start + s * (end - start) for s in shares], duration=3.0)
    same(path(3.0 * fraction), Line(start, end, duration=3.0)(3.0 * fraction), 1e-7)


def test_stops_may_wait_and_the_first_pose_is_held_until_its_time():
    path = Waypoints([(0, 0, 0), (1, 0, 0), (1, 0, 0), (0, 0, 0)], times=[0.5, 1.5, 2.0, 4.0], stop=True)
    same(path(0.4), path(0.0))
    same(path(1.7), path(1.5), EXACT)
    np.testing.assert_allclose(path(3.0).position, [0.5, 0, 0], atol=EXACT)
    assert path.closed and path.duration == 4.0
    np.testing.assert_array_equal(path.cycle_times(), [0.0, 4.0])


def test_stops_share_the_duration_by_distance_with_turns_counted_by_the_characteristic_length():
    turned = pin.SE3(pin.exp3(np.array([0, 0, 0.5])), np.array([1.0, 0, 0]))
    moved = pin.SE3(np.eye(3), np.array([1.0, 0, 0]))
    poses_ = [pin.SE3.Identity(), moved, turned]
    np.testing.assert_allclose(Waypoints(poses_, duration=3.0, stop=True).passing_times, [0, 2, 3])
    quick = Waypoints(poses_, duration=3.0, stop=True, characteristic_length=4.0)
    np.testing.assert_allclose(quick.passing_times, [0, 1, 3])


@settings(deadline=None, max_examples=20)
@given(poses, poses, st.floats(0.0, 1.0))
def test_closed_needs_the_orientation_back_as_well(start, via, angle):
    assume(np.linalg.norm(via.translation - start.translation) > 0.1)
    last = pin.SE3(start.rotation @ pin.exp3(np.array([angle, 0, 0])), start.translation)
    assume(angle == 0.0 or angle > 1e-3)
    assert Waypoints([start, via, last], duration=2.0).closed == (angle == 0.0)


# Rotation kinematics


@settings(deadline=None)
@given(unit_vectors, st.one_of(st.floats(0.0, 1e-3), st.floats(0.9, 1.1), st.floats(0.0, 6.2)), vectors, vectors)
def test_rates_of_a_rotation_vector_by_finite_differences(axis, angle, rate, rate_dot):
    theta, h = axis * angle, 1e-4

    def vector(t):
        return theta + rate * t + 0.5 * rate_dot * t * t

    R = pin.exp3(theta)
    omega, alpha = left_rates(theta, rate, rate_dot)
    np.testing.assert_allclose(omega, difference(lambda t: pin.log3(pin.exp3(vector(t)) @ R.T), 0.0, h), atol=1e-9)
    slope = difference(lambda t: left_rates(vector(t), rate + rate_dot * t, rate_dot)[0], 0.0, h)
    np.testing.assert_allclose(alpha, slope, atol=1e-9)
    body_omega, body_alpha = right_rates(theta, rate, rate_dot)
    np.testing.assert_allclose(body_omega, pin.Jexp3(theta) @ rate, atol=1e-9)
    np.testing.assert_allclose(R @ body_omega, omega, atol=1e-10)
    np.testing.assert_allclose(R @ body_alpha, alpha, atol=1e-10)
    if angle < 3.2:
        back = vector_rates(theta, body_omega, body_alpha)
        np.testing.assert_allclose(back, (rate, rate_dot), atol=1e-8)


@settings(deadline=None)
@given(rotations, rotations, st.floats(0.0, 1.0))
def test_a_turn_goes_the_shorter_way_about_a_fixed_axis(first, last, s):
    turn = Turn(first, last)
    np.testing.assert_allclose(turn(0.0), first, atol=EXACT)
    np.testing.assert_allclose(turn(1.0), last, atol=1e-9)
    assert turn.angle <= math.pi + EXACT
    np.testing.assert_allclose(turn(s) @ first.T, pin.exp3(s * np.array(turn.vector)), atol=1e-11)


# What is refused

POSE = pin.SE3.Identity()
MIRROR = np.diag([1.0, 1.0, -1.0])
A, B = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0)
REFUSED = {
    "line of no length": (lambda: Line(A, A, duration=1.0), PathError, "Line end is its start"),
    "line of no length, poses": (lambda: Line(POSE, POSE, duration=1.0), PathError, "Line end is its start"),
    "line to nan": (lambda: Line(A, (math.nan, 0, 0), duration=1.0), NonFiniteError, "Line end is"),
    "line from a pair": (lambda: Line((0, 0), B, duration=1.0), ShapeError, r"Line start has shape \(2,\)"),
    "line from a string": (lambda: Line("home", B, duration=1.0), ParameterError, "Line start is 'home'"),
    "line from ragged": (lambda: Line([[1], [1, 2]], B, duration=1.0), ShapeError, "Line start is"),
    "line from bools": (lambda: Line([True, 0.0, 0.0], B, duration=1.0), ParameterError, "Line start is"),
    "line from far": (lambda: Line((1e300, 0, 0), B, duration=1.0), ParameterError, "at most 1e"),
    "line from a mirror": (
        lambda: Line(np.diag([1.0, 1.0, -1.0, 1.0]), B, duration=1.0),
        PathError,
        "Line start rotation is not a rotation",
    ),
    "line from a projection": (lambda: Line(np.ones((4, 4)), B, duration=1.0), PathError, "ends in 0 0 0 1"),
    "no time": (
        lambda: Line(A, B, duration=0.0),
        PathError,
        "Line duration is 0 s: expected a positive number",
    ),
    "negative time": (lambda: Line(A, B, duration=-2.0), PathError, "Line duration is -2 s"),
    "infinite time": (lambda: Line(A, B, duration=math.inf), NonFiniteError, "Line duration is inf"),
    "time in words": (
        lambda: Line(A, B, duration="2"),
        ParameterError,
        "Line duration is '2': expected a number",
    ),
    "time as a bool": (lambda: Line(A, B, duration=True), ParameterError, "Line duration is True"),
    "huge time": (lambda: Line(A, B, duration=10**400), NonFiniteError, "Line duration is inf"),
    "radius": (
        lambda: Circle(A, radius=-0.1),
        PathError,
        "Circle radius is -0.1 m: expected a positive number",
    ),
    "nan radius": (lambda: Circle(A, radius=math.nan), NonFiniteError, "Circle radius is nan"),
    "period": (lambda: Circle(A, period=0), PathError, "Circle period is 0 s"),
    "laps": (lambda: Circle(A, laps=0), PathError, "Circle laps is 0: expected an integer from 1"),
    "half laps": (lambda: Circle(A, laps=1.5), ParameterError, "Circle laps is 1.5: expected an integer"),
    "bool laps": (lambda: Circle(A, laps=True), ParameterError, "Circle laps is True"),
    "no normal": (lambda: Circle(A, normal=(0, 0, 0)), PathError, "Circle normal is .* not a zero vector"),
    "nan normal": (lambda: Circle(A, normal=(0, 0, math.nan)), NonFiniteError, "Circle normal"),
    "steep x_axis": (lambda: Circle(A, x_axis=(1, 0, 1)), PathError, "Circle x_axis leans 45 degrees"),
    "shear": (
        lambda: Circle(A, orientation=np.eye(3) + np.eye(3, k=1)),
        PathError,
        "Circle orientation is not a rotation: .* expected at most 1e-06",
    ),
    "mirror": (lambda: Circle(A, orientation=MIRROR), PathError, r"det R = -1; expected"),
    "flat orientation": (
        lambda: Circle(A, orientation=np.zeros(9)),
        ShapeError,
        r"has shape \(9,\): expected \(3, 3\)",
    ),
    "start angle": (lambda: Circle(A, start_angle="0"), ParameterError, "Circle start_angle is '0'"),
    "semi-axis": (lambda: Ellipse(A, (0.1, 0.0)), PathError, "Ellipse semi_axes is 0 m"),
    "semi-axes": (lambda: Ellipse(A, (0.1,)), ShapeError, "Ellipse semi_axes has shape"),
    "still figure": (lambda: Lissajous(A, (0.1, 0, 0), (0, 1, 1)), PathError, "stand still"),
    "frequency": (
        lambda: Lissajous(A, (1, 1, 1), (1.0, 2, 3)),
        ParameterError,
        "frequencies is 1.0: expected an int",
    ),
    "frequencies": (lambda: Lissajous(A, (1, 1, 1), (1, 2)), ShapeError, "frequencies has shape"),
    "one vertex": (lambda: Polygon([A], duration=1.0), PathError, "expected at least 2"),
    "repeated vertex": (lambda: Polygon([A, B, B], duration=1.0), PathError, "vertices 1 and 2 coincide"),
    "repeated first": (
        lambda: Polygon([A, B, A], duration=1.0),
        PathError,
        "does not repeat its first vertex",
    ),
    "flat vertices": (lambda: Polygon(A, duration=1.0), ShapeError, r"expected \(n, 3\)"),
    "no timing": (lambda: Polygon([A, B]), PathError, "neither duration nor speed"),
    "two timings": (lambda: Polygon([A, B], duration=1.0, speed=1.0), PathError, "expected one of them"),
    "speed": (lambda: Polygon([A, B], speed=0.0), PathError, "Polygon speed is 0 m/s"),
    "blend": (lambda: Polygon([A, B], duration=1.0, blend=-0.1), PathError, "Polygon blend is -0.1 m"),
    "laps when open": (
        lambda: Polygon([A, B], duration=1.0, laps=2, closed=False),
        PathError,
        "closed is False",
    ),
    "closed": (lambda: Polygon([A, B], duration=1.0, closed="yes"), ParameterError, "closed is 'yes'"),
    "one waypoint": (lambda: Waypoints([A], duration=1.0), PathError, "expected at least 2"),
    "no waypoints": (lambda: Waypoints([], duration=1.0), PathError, "expected at least 2"),
    "not a list": (lambda: Waypoints(POSE, duration=1.0), ParameterError, "expected a list"),
    "a bad waypoint": (
        lambda: Waypoints([A, (1, 2)], duration=1.0),
        ShapeError,
        "Waypoints pose 1 has shape",
    ),
    "mixture": (lambda: Waypoints([A, POSE], duration=1.0), ShapeError, "pose 0 is a point, pose 1 a pose"),
    "times stand": (lambda: Waypoints([A, B, A], times=[0, 1, 1]), PathError, "times 1 and 2 are 1 and 1 s"),
    "times of bools": (lambda: Waypoints([A, B], times=[False, True]), ParameterError, "Waypoints times"),
    "times begin": (lambda: Waypoints([A, B], times=[-1, 1]), PathError, "times begin at -1 s"),
    "times missing": (lambda: Waypoints([A, B, A], times=[0, 1]), ShapeError, r"expected \(3,\)"),
    "nan times": (lambda: Waypoints([A, B], times=[0, math.nan]), NonFiniteError, "Waypoints times"),
    "no times": (lambda: Waypoints([A, B]), PathError, "neither times nor duration"),
    "both times": (lambda: Waypoints([A, B], times=[0, 1], duration=2.0), PathError, "expected one of them"),
    "nowhere": (lambda: Waypoints([A, A], times=[0, 1]), PathError, "expected different ones"),
    "pause": (
        lambda: Waypoints([A, A, B], duration=1.0),
        PathError,
        "poses 0 and 1 coincide: expected times=",
    ),
    "drawing": (lambda: Circle(A).polyline(1), PathError, "polyline samples is 1"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_refused(case):
    make, error, message = REFUSED[case]
    with pytest.raises(error, match=message) as caught:
        make()
    assert isinstance(caught.value, CartctlError)
    assert "\n" not in str(caught.value)


def test_inputs_are_copied_and_a_nearly_exact_rotation_is_projected():
    center, rotation = np.array([0.1, 0.2, 0.3]), pin.exp3(np.array([0.3, 0.1, -0.4])).round(7)
    circle = Circle(center, orientation=rotation)
    before = copy.deepcopy(circle(1.0))
    center += 1.0
    rotation += 1.0
    same(circle(1.0), before)
    np.testing.assert_allclose(before.rotation @ before.rotation.T, np.eye(3), atol=1e-15)
    pose = pin.SE3.Identity()
    line = Line(pose, B, duration=1.0)
    pose.translation = np.array([5.0, 5.0, 5.0])
    np.testing.assert_array_equal(line(0.0).position, A)
