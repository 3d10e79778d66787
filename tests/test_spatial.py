"""Rotations and twists against other formulas: quaternions, finite differences, Pinocchio."""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cartctl import spatial
from cartctl.errors import CartctlError, ParameterError
from tests import oracles
from tests import tolerances as tol


def unit(seed):
    a = np.random.default_rng(seed).normal(size=3)
    return a / np.linalg.norm(a)


UNIT = oracles.SEEDS.map(unit)
AXES = st.one_of(UNIT, st.sampled_from([s * e for e in np.eye(3) for s in (1.0, -1.0)]))
NEAR_HALF = st.floats(-15.0, -1.0).map(lambda e: math.pi - 10.0**e)
ANGLES = st.one_of(st.floats(0.0, math.pi), NEAR_HALF, st.floats(-15.0, -1.0).map(lambda e: 10.0**e))
TURNS = st.floats(-10.0, 10.0)


@given(oracles.SEEDS)
def test_skew_and_cross(seed):
    a, b = np.random.default_rng(seed).normal(size=(2, 3))
    expected = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    np.testing.assert_allclose(spatial.skew(a) @ b, expected, atol=tol.ROTATION)
    np.testing.assert_allclose(spatial.cross(a, b), expected, atol=tol.ROTATION)
    np.testing.assert_array_equal(spatial.skew(a), -spatial.skew(a).T)
    np.testing.assert_array_equal(spatial.skew(a), oracles.skew(a))


# ---------------------------------------------------------------- Rodrigues and the logarithm


@given(AXES, TURNS)
def test_rodrigues(axis, angle):
    R = spatial.rotation_about(axis, angle)
    np.testing.assert_allclose(R, oracles.rotation(axis, angle), atol=tol.ROTATION)
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=tol.ROTATION)
    assert np.linalg.det(R) == pytest.approx(1.0, abs=tol.ROTATION)


@given(AXES, ANGLES)
def test_log_undoes_rodrigues(axis, angle):
    """From the identity to a hair below the half turn: the vector comes back, in full precision."""
    phi = spatial.log3(spatial.rotation_about(axis, angle))
    assert phi.shape == (3,) and np.linalg.norm(phi) <= math.pi + tol.LOG
    if angle < math.pi - 1e-7:
        np.testing.assert_allclose(phi, angle * axis, atol=tol.LOG)
    else:  # the sign of the axis hangs on round-off
        error = min(np.linalg.norm(phi - angle * axis), np.linalg.norm(phi + angle * axis))
        assert error <= 2.0 * (math.pi - angle) + tol.LOG


@given(AXES)
def test_the_half_turn(axis):
    R = 2.0 * np.outer(axis, axis) - np.eye(3)
    phi = spatial.log3(R)
    assert np.linalg.norm(phi) == pytest.approx(math.pi, abs=tol.LOG)
    np.testing.assert_allclose(np.abs(phi @ axis), math.pi, atol=tol.LOG)
    back = spatial.rotation_about(phi / np.linalg.norm(phi), float(np.linalg.norm(phi)))
    np.testing.assert_allclose(back, R, atol=tol.LOG)


@given(oracles.SEEDS)
def test_rodrigues_undoes_log(seed):
    R = oracles.random_rotation(np.random.default_rng(seed))
    phi = spatial.log3(R)
    angle = float(np.linalg.norm(phi))
    np.testing.assert_allclose(spatial.rotation_about(phi / angle, angle), R, atol=tol.LOG)
    np.testing.assert_allclose(phi, pin.log3(R), atol=tol.HALF_TURN)
    np.testing.assert_allclose(spatial.log3(R.T), -phi, atol=tol.LOG)


@given(AXES, st.floats(-16.0, -3.0))
def test_small_angles_keep_their_relative_precision(axis, exponent):
    """A pose error of 1e-12 rad is no zero."""
    angle = 10.0**exponent
    R = np.eye(3) + angle * spatial.skew(axis) + 0.5 * angle**2 * spatial.skew(axis) @ spatial.skew(axis)
    np.testing.assert_allclose(spatial.log3(R), angle * axis, atol=angle * 1e-6)


def test_log_of_the_identity_is_zero():
    np.testing.assert_array_equal(spatial.log3(np.eye(3)), 0.0)


def test_log_does_not_jump_on_the_way_to_the_half_turn():
    axis = np.array([1.0, -2.0, 0.5]) / np.linalg.norm([1.0, -2.0, 0.5])
    angles = math.pi - np.logspace(-1, -12, 200)
    steps = np.array([spatial.log3(spatial.rotation_about(axis, a)) for a in angles])
    np.testing.assert_allclose(steps, angles[:, None] * axis, atol=1e-12)


@given(oracles.SEEDS, AXES, ANGLES)
def test_pose_error(seed, axis, angle):
    """[p_d - p; log3(R_d R^T)]: the angle-axis from where the frame is to where it shall be, in world axes."""
    rng = np.random.default_rng(seed)
    R, p, p_d = oracles.random_rotation(rng), rng.normal(size=3), rng.normal(size=3)
    R_d = spatial.rotation_about(axis, min(angle, 3.0)) @ R
    error = np.full(6, np.nan)
    spatial.pose_error(p, R, p_d, R_d, error)
    np.testing.assert_allclose(error[:3], p_d - p, atol=tol.ROTATION)
    np.testing.assert_allclose(error[3:], min(angle, 3.0) * axis, atol=tol.LOG)


# ---------------------------------------------------------------- Euler angles


def intrinsic(sequence, phi):
    """R from elementary rotations, in quaternions."""
    R = np.eye(3)
    for axis, angle in zip(sequence, phi, strict=True):
        R = R @ oracles.rotation(np.eye(3)["XYZ".index(axis)], angle)
    return R


def test_all_twelve_sequences_are_there():
    assert len(spatial.EULER_SEQUENCES) == len(set(spatial.EULER_SEQUENCES)) == 12
    assert {"ZYX", "XYZ", "ZYZ", "ZXZ", "YZY"} <= set(spatial.EULER_SEQUENCES)


@pytest.mark.parametrize("sequence", spatial.EULER_SEQUENCES)
@given(seed=oracles.SEEDS)
def test_euler_rates_by_finite_differences(sequence, seed):
    """S(omega) = R_dot R^T with R_dot from central differences of R(phi + t phi_dot)."""
    rng = np.random.default_rng(seed)
    phi, rate, h = rng.uniform(-math.pi, math.pi, 3), rng.normal(size=3), 1e-6
    R_dot = (intrinsic(sequence, phi + h * rate) - intrinsic(sequence, phi - h * rate)) / (2.0 * h)
    S = R_dot @ intrinsic(sequence, phi).T
    omega = spatial.euler_rates(sequence, phi) @ rate
    np.testing.assert_allclose(omega, [S[2, 1], S[0, 2], S[1, 0]], atol=tol.DIFFERENCE)


@pytest.mark.parametrize("sequence", spatial.EULER_SEQUENCES)
@given(seed=oracles.SEEDS)
def test_determinant_and_locks(sequence, seed):
    """|det T| = |sin phi_2| for sequences like ZYZ and |cos phi_2| for sequences like XYZ."""
    phi = np.random.default_rng(seed).uniform(-math.pi, math.pi, 3)
    proper = sequence[0] == sequence[2]
    size = abs(math.sin(phi[1])) if proper else abs(math.cos(phi[1]))
    assert abs(np.linalg.det(spatial.euler_rates(sequence, phi))) == pytest.approx(size, abs=tol.ROTATION)
    for lock in (0.0, math.pi) if proper else (0.5 * math.pi, -0.5 * math.pi):
        T = spatial.euler_rates(sequence, np.array([phi[0], lock, phi[2]]))
        assert abs(np.linalg.det(T)) <= tol.ROTATION and np.linalg.matrix_rank(T, tol=1e-9) == 2


@pytest.mark.parametrize("sequence", spatial.EULER_SEQUENCES)
@given(seed=oracles.SEEDS, locked=st.booleans(), mirrored=st.booleans())
def test_euler_angles_give_the_rotation_back(sequence, seed, locked, mirrored):
    rng = np.random.default_rng(seed)
    phi = rng.uniform(-math.pi, math.pi, 3)
    if locked:
        phi[1] = (math.pi * mirrored) if sequence[0] == sequence[2] else math.pi * (mirrored - 0.5)
    R = intrinsic(sequence, phi)
    again = spatial.euler_angles(sequence, R)
    assert again.shape == (3,) and np.isfinite(again).all()
    np.testing.assert_allclose(intrinsic(sequence, again), R, atol=1e-7 if locked else tol.PENROSE * 1e3)
    if locked:
        assert again[2] == pytest.approx(0.0, abs=tol.ROTATION)


def extrinsic(sequence, phi):
    """R from elementary rotations about axes that stay: the last one leftmost."""
    return intrinsic(sequence[::-1], phi[::-1])


FORMS = {"moving": intrinsic, "fixed": extrinsic}


@pytest.mark.parametrize("about", FORMS)
@pytest.mark.parametrize("sequence", spatial.EULER_SEQUENCES)
@given(seed=oracles.SEEDS)
def test_every_form_of_the_rates_by_finite_differences(sequence, about, seed):
    """S(omega) = R_dot R^T in the base's axes, R^T R_dot in the body's."""
    rng = np.random.default_rng(seed)
    phi, rate, h = rng.uniform(-math.pi, math.pi, 3), rng.normal(size=3), 1e-6
    R = FORMS[about](sequence, phi)
    np.testing.assert_allclose(spatial.euler_rotation(sequence, phi, about), R, atol=tol.ROTATION)
    R_dot = (FORMS[about](sequence, phi + h * rate) - FORMS[about](sequence, phi - h * rate)) / (2.0 * h)
    base = spatial.euler_rates(sequence, phi, about) @ rate
    body = spatial.euler_rates(sequence, phi, about, "body") @ rate
    np.testing.assert_allclose(base, spatial.vee(R_dot @ R.T), atol=tol.DIFFERENCE)
    np.testing.assert_allclose(body, spatial.vee(R.T @ R_dot), atol=tol.DIFFERENCE)
    np.testing.assert_allclose(R @ body, base, atol=tol.LOG)


@pytest.mark.parametrize("about", FORMS)
@pytest.mark.parametrize("sequence", spatial.EULER_SEQUENCES)
@given(seed=oracles.SEEDS)
def test_the_lock_says_what_the_matrix_says(sequence, about, seed):
    """det T with its sign, how far phi_2 is from the nearest zero of it, and the direction that is being lost."""
    rng = np.random.default_rng(seed)
    phi = rng.uniform(-2.0 * math.pi, 2.0 * math.pi, 3)
    lock = spatial.euler_lock(sequence, phi, about)
    T = spatial.euler_rates(sequence, phi, about)
    assert lock.determinant == pytest.approx(np.linalg.det(T), abs=tol.ROTATION * 10)
    assert np.linalg.det(spatial.euler_rates(sequence, phi, about, "body")) == pytest.approx(lock.determinant)
    zeros = np.arange(-6, 7) * math.pi + (0.0 if sequence[0] == sequence[2] else math.pi / 2.0)
    assert lock.distance == pytest.approx(np.abs(zeros - phi[1]).min(), abs=tol.LOG)
    far = 2 if about == "moving" else 0
    assert np.linalg.norm(lock.lost) == pytest.approx(1.0)
    assert np.linalg.solve(T, lock.lost)[far] * lock.determinant == pytest.approx(1.0 if far else -1.0)
    phi[1] = rng.choice(zeros)
    locked = spatial.euler_lock(sequence, phi, about)
    np.testing.assert_allclose(locked.lost @ spatial.euler_rates(sequence, phi, about), 0.0, atol=tol.LOG)
    np.testing.assert_allclose([locked.determinant, locked.distance], 0.0, atol=tol.LOG)


@pytest.mark.parametrize("sequence", spatial.EULER_SEQUENCES)
@given(seed=oracles.SEEDS)
def test_angles_about_fixed_axes(sequence, seed):
    R = oracles.random_rotation(np.random.default_rng(seed))
    phi = spatial.euler_angles(sequence, R, about="fixed")
    np.testing.assert_allclose(extrinsic(sequence, phi), R, atol=tol.PENROSE * 1e3)
    np.testing.assert_allclose(
        np.cos(phi), np.cos(spatial.euler_angles(sequence[::-1], R)[::-1]), atol=tol.PENROSE * 1e3
    )


@given(oracles.SEEDS)
def test_roll_pitch_and_yaw_are_pinocchios(seed):
    """XYZ about fixed axes is what URDF and Pinocchio call rpy."""
    rpy = np.random.default_rng(seed).uniform(-1.5, 1.5, 3)
    R = pin.rpy.rpyToMatrix(rpy)
    np.testing.assert_allclose(spatial.euler_rotation("XYZ", rpy, "fixed"), R, atol=tol.ROTATION)
    np.testing.assert_allclose(spatial.euler_angles("XYZ", R, "fixed"), rpy, atol=tol.PENROSE * 1e3)
    frames = {"base": pin.ReferenceFrame.WORLD, "body": pin.ReferenceFrame.LOCAL}
    for axes, frame in frames.items():
        T = pin.rpy.computeRpyJacobian(rpy, frame)
        np.testing.assert_allclose(spatial.euler_rates("XYZ", rpy, "fixed", axes), T, atol=tol.ROTATION)


def test_the_printed_matrix_of_zyz():
    """[[0, -s_phi, c_phi s_theta], [0, c_phi, s_phi s_theta], [1, 0, c_theta]] maps rates to omega."""
    phi, theta = 0.7, -1.1
    T = [
        [0.0, -math.sin(phi), math.cos(phi) * math.sin(theta)],
        [0.0, math.cos(phi), math.sin(phi) * math.sin(theta)],
        [1.0, 0.0, math.cos(theta)],
    ]
    np.testing.assert_allclose(spatial.euler_rates("ZYZ", [phi, theta, 2.0]), T, atol=tol.ROTATION)


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: spatial.euler_rotation("XYZ", np.zeros(3), "rotating"), "'moving', 'fixed'"),
        (lambda: spatial.euler_angles("XYZ", np.eye(3), about=None), "about is None"),
        (lambda: spatial.euler_rates("XYZ", np.zeros(3), axes="tool"), "'base', 'body'"),
        (lambda: spatial.euler_lock("xyz", np.zeros(3)), "sequence is 'xyz'"),
        (lambda: spatial.euler_angles("XYZ", np.zeros((3, 3))), "expected a rotation matrix"),
        (lambda: spatial.log3(np.ones((3, 3))), "expected a rotation matrix"),
        (lambda: spatial.euler_lock("XYZ", np.zeros(3), "base"), "about is 'base'"),
    ],
)
def test_unknown_options_are_named(call, says):
    with pytest.raises(ParameterError) as caught:
        call()
    assert says in str(caught.value)


# ---------------------------------------------------------------- velocity conversion


@given(oracles.SEEDS)
def test_velocity_conversion_is_the_inverse_adjoint(seed):
    rng = np.random.default_rng(seed)
    R, p, twist = oracles.random_rotation(rng), rng.normal(size=3), rng.normal(size=6)
    V = spatial.velocity_conversion(R, p)
    np.testing.assert_allclose(V, pin.SE3(R, p).toActionMatrixInverse(), atol=tol.ROTATION)
    moved = pin.SE3(R, p).actInv(pin.Motion(twist[:3], twist[3:])).vector
    np.testing.assert_allclose(V @ twist, moved, atol=tol.LOG)
    np.testing.assert_allclose(V @ spatial.velocity_conversion(R.T, -R.T @ p), np.eye(6), atol=tol.LOG)
    wrench = rng.normal(size=6)  # power is the same in both frames
    assert (V.T @ wrench) @ twist == pytest.approx(wrench @ (V @ twist), abs=tol.LOG)


@given(oracles.SEEDS, st.integers(1, 9))
def test_the_lectures_jacobian_is_pinocchios(seed, n):
    """Revolute and prismatic joints with any axis, placed anywhere: tool origin, world axes."""
    rng = np.random.default_rng(seed)
    chain = oracles.random_chain(rng, n)
    q = rng.uniform(-3.0, 3.0, n)
    model = oracles.pinocchio_chain(*chain)
    data = model.createData()
    J = pin.computeFrameJacobian(model, data, q, model.getFrameId("tool"), pin.LOCAL_WORLD_ALIGNED)
    J = J.reshape(6, n)  # Pinocchio hands out (6,) where nv is 1
    np.testing.assert_allclose(oracles.chain_jacobian(*chain, q), J, atol=tol.JACOBIAN * 10 * n)


@given(oracles.SEEDS, st.integers(1, 9))
def test_the_lectures_jacobian_from_the_packages_conversion(seed, n):
    """Column j in tool axes is the column of V that belongs to the joint's axis: 3 + i revolute, i prismatic."""
    rng = np.random.default_rng(seed)
    joints, tool_R, tool_p = oracles.random_chain(rng, n)
    letters = rng.integers(0, 3, n)
    joints = [oracles.Joint(j.kind, np.eye(3)[i], j.R, j.p) for j, i in zip(joints, letters, strict=True)]
    model = oracles.pinocchio_chain(joints, tool_R, tool_p)
    data, q, tool = model.createData(), rng.uniform(-3.0, 3.0, n), model.getFrameId("tool")
    J = pin.computeFrameJacobian(model, data, q, tool, pin.LOCAL).reshape(6, n)
    pin.framesForwardKinematics(model, data, q)
    for k, (joint, i) in enumerate(zip(joints, letters, strict=True)):
        seen = data.oMi[k + 1].actInv(data.oMf[tool])
        column = int(i) + (3 if joint.kind == "revolute" else 0)
        V = spatial.velocity_conversion(seen.rotation, seen.translation)
        np.testing.assert_allclose(V[:, column], J[:, k], atol=tol.JACOBIAN * 10 * n)


# ---------------------------------------------------------------- bad input


@pytest.mark.parametrize("sequence", ["ZYY", "xyz", "RPY", "", "ZY", None, 3, ["Z", "Y", "X"]])
def test_unknown_sequences_are_named(sequence):
    for call in (
        lambda: spatial.euler_rates(sequence, np.zeros(3)),
        lambda: spatial.euler_angles(sequence, np.eye(3)),
    ):
        with pytest.raises(ParameterError) as caught:
            call()
        line = str(caught.value)
        assert "\n" not in line and "sequence" in line and repr(sequence) in line and "'ZYX'" in line


NAN = float("nan")


@pytest.mark.parametrize(
    "call",
    [
        lambda: spatial.euler_rates("XYZ", np.array([0.1, 0.2])),
        lambda: spatial.euler_rates("XYZ", np.array([0.1, NAN, 0.3])),
        lambda: spatial.euler_angles("XYZ", np.eye(2)),
        lambda: spatial.euler_angles("XYZ", np.full((3, 3), NAN)),
        lambda: spatial.log3(np.eye(2)),
        lambda: spatial.log3(np.full((3, 3), NAN)),
        lambda: spatial.euler_angles("XYZ", 2.0 * np.eye(3)),
        lambda: spatial.euler_angles("XYZ", [[1.0, 0.5, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]),
        lambda: spatial.skew([1.0, 2.0]),
        lambda: spatial.skew([NAN, 0.0, 0.0]),
        lambda: spatial.cross([1.0, 2.0, 3.0], [0.0, NAN, 0.0]),
        lambda: spatial.cross([1e200, 1e200, 0.0], [1e200, 1e200, 0.0]),
        lambda: spatial.rotation_about([0.0, 0.0, 1.0], NAN),
        lambda: spatial.rotation_about([0.0, 0.0, 2.0], 1.0),
        lambda: spatial.velocity_conversion(np.eye(3), [NAN, 0.0, 0.0]),
        lambda: spatial.velocity_conversion(np.diag([1.0, 2.0, 1.0]), np.zeros(3)),
        lambda: spatial.move_wrench(spatial.pose(p=[1e200, 0.0, 1e200]), np.full(6, 1e200)),
        lambda: spatial.move_wrench(np.eye(4), np.full(6, 1e200)),
        lambda: spatial.move_twist(spatial.pose(p=[1.0, 2.0, 3.0]), np.full((6, 2), 1e200)),
    ],
)
def test_bad_arrays_are_refused(call):
    """No NaN comes out, no memory beyond the array is read."""
    with pytest.raises(CartctlError) as caught:
        call()
    assert "\n" not in str(caught.value)


def test_lists_are_vectors_too():
    np.testing.assert_array_equal(spatial.cross([1, 0, 0], [0, 1, 0]), [0, 0, 1])
    np.testing.assert_array_equal(spatial.skew([1, 2, 3]) @ [4, 5, 6], np.cross([1, 2, 3], [4, 5, 6]))
    np.testing.assert_allclose(spatial.rotation_about([0, 0, 1], 0.5), spatial.exp3([0, 0, 0.5]), atol=tol.ROTATION)
    V = spatial.velocity_conversion(np.eye(3).tolist(), [1, 0, 0])
    np.testing.assert_array_equal(V @ [0, 0, 0, 0, 0, 1], [0, 1, 0, 0, 0, 1])
