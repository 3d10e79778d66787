"""Load cells: the lecture's matrix, weight and bias taken away, and found again from readings."""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

import cartctl as cc
from cartctl import spatial, statics
from cartctl.errors import NonFiniteError, ParameterError, ShapeError
from tests import oracles
from tests import tolerances as tol

L2, L3 = 0.8, 0.55


def halfway(q3):
    """The cell in the middle of link 2, seen from the tip of link 3 of a planar arm: both with x along their link."""
    R = np.array([[math.cos(q3), math.sin(q3), 0.0], [-math.sin(q3), math.cos(q3), 0.0], [0.0, 0.0, 1.0]])
    return spatial.pose(R, [-L3 - L2 / 2 * math.cos(q3), L2 / 2 * math.sin(q3), 0.0])


@given(st.floats(-3.1, 3.1))
def test_the_lectures_load_cell_matrix(q3):
    c, s = math.cos(q3), math.sin(q3)
    printed = [
        [c, s, 0.0, 0.0, 0.0, 0.0],
        [-s, c, 0.0, 0.0, 0.0, 0.0],
        [0.0, 0.0, 1.0, 0.0, 0.0, 0.0],
        [0.0, 0.0, L2 / 2 * s, c, s, 0.0],
        [0.0, 0.0, L3 + L2 / 2 * c, -s, c, 0.0],
        [L3 * s, -L3 * c - L2 / 2 * c**2 - L2 / 2 * s**2, 0.0, 0.0, 0.0, 1.0],
    ]
    np.testing.assert_allclose(statics.LoadCell(halfway(q3)).to_tool, printed, atol=tol.ROTATION)
    reading = np.array([3.0, -2.0, 1.0, 0.4, -0.7, 0.9])
    contact = statics.LoadCell(pin.SE3(halfway(q3))).contact(reading, np.eye(3))
    np.testing.assert_allclose(contact, printed @ reading, atol=tol.LOG)


@given(oracles.SEEDS)
def test_the_placement_is_the_arms(seed):
    """From the arm's own kinematics: the torques of joints 1 and 2 are the same from either wrench."""
    robot = cc.planar([0.4, L2, L3])
    q = np.random.default_rng(seed).uniform(-3.0, 3.0, 3)
    state = robot.state(q)
    tip = state.placement("tool")
    R = spatial.rotation_about(np.array([0.0, 0.0, 1.0]), q[0] + q[1])
    elbow = 0.4 * np.array([math.cos(q[0]), math.sin(q[0]), 0.0])
    cell = spatial.pose(R, elbow + R @ [L2 / 2, 0.0, 0.0])
    placement = spatial.inverse_pose(tip) @ cell
    np.testing.assert_allclose(placement, halfway(q[2]), atol=tol.LOG)
    reading = np.random.default_rng(seed + 1).normal(size=6)
    at_tip = statics.LoadCell(placement).contact(reading, R)
    J = np.kron(np.eye(2), tip.rotation.T) @ state.jacobian("tool")
    J_cell = spatial.move_twist(spatial.inverse_pose(placement), J)
    np.testing.assert_allclose(
        statics.exerting_torques(J, at_tip), statics.exerting_torques(J_cell, reading), atol=tol.LOG
    )


def some_cell(rng):
    placement = spatial.pose(oracles.random_rotation(rng), rng.uniform(-0.2, 0.2, 3))
    bias = rng.normal(size=6) * [5.0, 5.0, 5.0, 0.3, 0.3, 0.3]
    return statics.LoadCell(placement, rng.uniform(0.2, 3.0), rng.uniform(-0.1, 0.1, 3), bias)


def reading_of(cell, R, contact):
    """From the world's side: the weight at the centre of mass and the contact, each moved to the cell by Pinocchio."""
    at_com = pin.SE3(R.T, np.asarray(cell.com))  # a frame in the centre of mass with the world's axes
    weight = at_com.act(pin.Force(cell.mass * np.asarray(cell.gravity), np.zeros(3)))
    return cell.bias + weight.vector + pin.SE3(cell.placement).actInv(pin.Force(contact)).vector


@given(oracles.SEEDS)
def test_weight_and_bias_are_taken_away(seed):
    rng = np.random.default_rng(seed)
    cell, R, contact = some_cell(rng), oracles.random_rotation(rng), rng.normal(size=6)
    np.testing.assert_allclose(cell.contact(reading_of(cell, R, contact), R), contact, atol=1e-12)
    assert np.linalg.norm(cell.weight(R)[:3]) == pytest.approx(cell.mass * 9.81)


@given(oracles.SEEDS, st.integers(3, 12))
def test_a_cell_is_found_from_readings(seed, count):
    rng = np.random.default_rng(seed)
    cell = some_cell(rng)
    turns = [
        spatial.rotation_about(np.eye(3)[k % 2], 0.4 + 1.1 * k) @ oracles.random_rotation(rng) for k in range(count)
    ]
    readings = [reading_of(cell, R, np.zeros(6)) for R in turns]
    downs = np.array([R.T @ cell.gravity for R in turns])
    spread = np.linalg.svd(downs - downs.mean(axis=0))[1][1]
    found = statics.fit_load_cell(turns, readings, cell.placement)
    scale = 1e-12 * max(1.0, 10.0 / spread)
    for name in ("mass", "com", "bias", "placement"):
        np.testing.assert_allclose(getattr(found, name), getattr(cell, name), atol=1e3 * scale)


def test_noise_is_averaged():
    """400 readings with 0.1 N and 0.01 N m of noise leave a twentieth of it or so."""
    rng = np.random.default_rng(4)
    cell = some_cell(rng)
    turns = [oracles.random_rotation(rng) for _ in range(400)]
    noise = rng.normal(size=(400, 6)) * [0.1, 0.1, 0.1, 0.01, 0.01, 0.01]
    found = statics.fit_load_cell(
        turns, [reading_of(cell, R, np.zeros(6)) + e for R, e in zip(turns, noise, strict=True)]
    )
    np.testing.assert_allclose(found.bias[:3], cell.bias[:3], atol=0.02)
    np.testing.assert_allclose(found.bias[3:], cell.bias[3:], atol=0.002)
    assert found.mass == pytest.approx(cell.mass, abs=2e-3)
    np.testing.assert_allclose(found.com * found.mass, cell.com * cell.mass, atol=3e-4)


def test_three_ways_down_are_enough_and_two_are_not():
    rng = np.random.default_rng(5)
    cell = some_cell(rng)
    down = [spatial.rotation_about(np.array([1.0, 0.0, 0.0]), a) for a in (0.0, 0.5, 1.0)]
    readings = [reading_of(cell, R, np.zeros(6)) for R in down]
    found = statics.fit_load_cell(down, readings, cell.placement)
    np.testing.assert_allclose(found.com, cell.com, atol=1e-12)
    with pytest.raises(ParameterError, match="leave 1 of 6 unknowns open"):
        statics.fit_load_cell(down[:2], readings[:2])
    spun = [spatial.rotation_about(np.array([0.0, 0.0, 1.0]), a) for a in (0.0, 0.5, 1.0, 2.0)]
    with pytest.raises(ParameterError, match="leave 1 of 4 unknowns open"):  # about the vertical: always the same down
        statics.fit_load_cell(spun, [reading_of(cell, R, np.zeros(6)) for R in spun])


@pytest.mark.parametrize(
    ("call", "error", "says"),
    [
        (lambda: statics.LoadCell(np.eye(3)), ShapeError, "placement has shape (3, 3)"),
        (lambda: statics.LoadCell(mass=-1.0), ParameterError, "mass is -1"),
        (lambda: statics.LoadCell(bias=np.zeros(3)), ShapeError, "bias has shape (3,)"),
        (lambda: statics.LoadCell(com=[0.0, np.nan, 0.0]), NonFiniteError, "com[1] is nan"),
        (lambda: statics.LoadCell().weight(2.0 * np.eye(3)), ParameterError, "expected a rotation matrix"),
        (lambda: statics.LoadCell().contact(np.zeros(3), np.eye(3)), ShapeError, "reading has shape (3,)"),
        (lambda: statics.fit_load_cell([], []), ParameterError, "0 orientations"),
        (lambda: statics.fit_load_cell([np.eye(3)], []), ShapeError, "readings has 0 entries; expected 1"),
        (lambda: statics.fit_load_cell(None, []), ShapeError, "rotations is None"),
        (lambda: statics.fit_load_cell([np.zeros((3, 3))], np.zeros((1, 6))), ParameterError, "rotations[0]"),
        (lambda: statics.fit_load_cell(WAYS, np.zeros((3, 6))), ParameterError, "mass of 0 kg"),
    ],
)
def test_misuse_is_named(call, error, says):
    with pytest.raises(error) as caught:
        call()
    assert says in str(caught.value) and "\n" not in str(caught.value)


WAYS = [spatial.rotation_about(np.array([1.0, 0.0, 0.0]), a) for a in (0.0, 0.5, 1.0)]
