"""Statics against Newton-Euler with external forces, energies along a run, linear programmes and least squares."""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import linprog

import cartctl as cc
from cartctl import analysis, spatial, statics
from cartctl.errors import CartctlError, MetricError, NonFiniteError, ParameterError, ShapeError
from tests import oracles
from tests import tolerances as tol

INF = math.inf
SHAPES = st.tuples(st.integers(1, 7), st.integers(1, 9))


def some_jacobian(rng, shape, deficient):
    m, n = shape
    return oracles.matrix(rng, m, n, rng.integers(0, min(m, n)) if deficient else None)


# ---------------------------------------------------------------- tau = J^T w


@given(oracles.SEEDS)
def test_torques_are_those_of_newton_and_euler(seed):
    """rnea with an external force at the tool, at rest, less gravity."""
    robot = cc.load("panda")
    rng = np.random.default_rng(seed)
    q = rng.uniform(robot.limits.position_lower, robot.limits.position_upper)
    state, wrench = robot.state(q), rng.normal(size=6)
    data, frame = robot.model.createData(), robot.frame_id("panda_hand_tcp")
    pin.framesForwardKinematics(robot.model, data, q)
    aligned = pin.SE3(data.oMf[frame].rotation.T, np.zeros(3))  # world axes seen from the hand
    joint = robot.model.frames[frame].parentJoint
    on_joint = robot.model.frames[frame].placement.act(aligned.act(pin.Force(wrench)))
    forces = [pin.Force.Zero() for _ in range(robot.model.njoints)]
    forces[joint] = on_joint
    rest = np.zeros(robot.nv)
    expected = pin.rnea(robot.model, data, q, rest, rest, forces) - state.gravity
    J = state.jacobian("panda_hand_tcp")
    np.testing.assert_allclose(statics.holding_torques(J, wrench), expected, atol=1e-12)
    np.testing.assert_allclose(statics.exerting_torques(J, -wrench), expected, atol=1e-12)


@given(oracles.SEEDS)
def test_the_frame_does_not_matter(seed):
    """Jacobian and wrench moved to another frame of the hand: the same torques."""
    rng = np.random.default_rng(seed)
    J, wrench = rng.normal(size=(6, 7)), rng.normal(size=6)
    T = spatial.pose(oracles.random_rotation(rng), rng.normal(size=3))
    moved = statics.exerting_torques(spatial.move_twist(T, J), spatial.move_wrench(T, wrench))
    np.testing.assert_allclose(moved, statics.exerting_torques(J, wrench), atol=1e-12)


@pytest.fixture(scope="module")
def reach():
    """A Panda that reaches for another pose, turning its hand as it goes."""
    robot = cc.load("panda")
    hand = cc.FrameTask("panda_hand_tcp", gain=4.0)
    start = robot.state(robot.home).placement("panda_hand_tcp")
    turn = spatial.rotation_about(np.array([0.6, 0.0, 0.8]), 0.7)
    goal = spatial.pose(turn @ start.rotation, start.translation + np.array([-0.1, 0.15, 0.1]))
    hand.target = goal
    controller = cc.Controller(robot, hand, solver="pinv", limits=None, dt=1e-3)
    return robot, cc.simulate(controller, duration=1.0)


def midpoints(robot, run):
    """(J, displacement of the hand by its poses alone, dq, pose) of every step, at its middle."""
    before = robot.state(run.q[0]).placement("panda_hand_tcp")
    for a, b in zip(run.q[:-1], run.q[1:], strict=True):
        after = robot.state(b).placement("panda_hand_tcp")
        middle = robot.state(0.5 * (a + b))
        moved = np.concatenate(
            [after.translation - before.translation, spatial.log3(after.rotation @ before.rotation.T)]
        )
        yield middle.jacobian("panda_hand_tcp"), moved, b - a, middle.placement("panda_hand_tcp")
        before = after


def test_joint_work_is_cartesian_work_along_a_run(reach):
    """Of springs between the hand and a fixed pose: both are the energy the springs give away, whatever the path."""
    robot, run = reach
    stiff, twisting, anchor = 300.0, 20.0, np.array([0.2, -0.3, 0.4])
    R0 = robot.state(run.q[0]).rotation("panda_hand_tcp")

    def spring(pose):
        return -np.concatenate([stiff * (pose.translation - anchor), twisting * spatial.log3(pose.rotation @ R0.T)])

    def energy(q):
        pose = robot.state(q).placement("panda_hand_tcp")
        turned = spatial.log3(pose.rotation @ R0.T)
        return 0.5 * stiff * np.sum((pose.translation - anchor) ** 2) + 0.5 * twisting * turned @ turned

    joint = cartesian = 0.0
    for J, moved, dq, pose in midpoints(robot, run):
        joint += statics.exerting_torques(J, spring(pose)) @ dq
        cartesian += spring(pose) @ moved
    given_away = energy(run.q[0]) - energy(run.q[-1])
    assert abs(given_away) > 5.0  # J
    assert joint == pytest.approx(given_away, rel=1e-5)
    assert cartesian == pytest.approx(given_away, rel=1e-5)


def test_joint_work_is_cartesian_work_of_any_wrench(reach):
    """No energy behind it: a wrench that changes with time."""
    robot, run = reach
    rng = np.random.default_rng(3)
    amplitude, phase = rng.normal(size=6) * 10.0, rng.uniform(0.0, 6.0, 6)
    joint = cartesian = 0.0
    for k, (J, moved, dq, _) in enumerate(midpoints(robot, run)):
        wrench = amplitude * np.sin(7.0 * (k + 0.5) * 1e-3 + phase)
        joint += statics.exerting_torques(J, wrench) @ dq
        cartesian += wrench @ moved
    assert abs(joint) > 0.5
    assert joint == pytest.approx(cartesian, rel=1e-5)


# ---------------------------------------------------------------- the wrench that goes with torques


@given(oracles.SEEDS, SHAPES, st.booleans(), oracles.METRICS)
def test_the_balanced_wrench(seed, shape, deficient, kind):
    rng = np.random.default_rng(seed)
    J = some_jacobian(rng, shape, deficient)
    m, n = shape
    torque, W = rng.normal(size=n), oracles.metric(rng, m, kind)
    rank = np.linalg.matrix_rank(J, tol=oracles.GAP)
    found = statics.balanced_wrench(J, torque, W)
    np.testing.assert_allclose(found.wrench, oracles.constrained_minimum(J.T, torque, W), atol=tol.ORACLE * 10)
    np.testing.assert_allclose(J.T @ found.wrench + found.unbalanced, torque, atol=tol.PENROSE * 10)
    np.testing.assert_allclose(J @ found.unbalanced, 0.0, atol=tol.PENROSE * 10)
    assert found.internal.shape == (m, m - rank) == (m, np.linalg.matrix_rank(found.internal, tol=oracles.GAP))
    np.testing.assert_allclose(J.T @ found.internal, 0.0, atol=tol.PENROSE * 10)
    if rank:  # virtual work: what is balanced does the wrench's work in every motion
        v = rng.normal(size=n)
        assert torque @ v == pytest.approx(found.wrench @ (J @ v) + found.unbalanced @ v, abs=1e-10)


@given(oracles.SEEDS, SHAPES, st.booleans())
def test_a_wrench_that_was_exerted_comes_back(seed, shape, deficient):
    """... up to what the structure carries, which has no torque."""
    rng = np.random.default_rng(seed)
    J = some_jacobian(rng, shape, deficient)
    wrench = rng.normal(size=shape[0])
    found = statics.balanced_wrench(J, statics.exerting_torques(J, wrench))
    lost = wrench - found.wrench
    inner = found.internal
    np.testing.assert_allclose(inner @ (inner.T @ lost), lost, atol=tol.ORACLE)
    np.testing.assert_allclose(found.unbalanced, 0.0, atol=tol.ORACLE)


def test_a_stretched_arm_carries_a_pull_without_torque():
    """... and turns on the spot under a pair of torques that no force balances."""
    J = oracles.planar_jacobian([1.0, 0.5], [0.6, 0.0])
    along = np.array([math.cos(0.6), math.sin(0.6)])
    found = statics.balanced_wrench(J, [3.0, 1.0])
    np.testing.assert_allclose(np.abs(found.internal[:, 0] @ along), 1.0)
    np.testing.assert_allclose(statics.holding_torques(J, 250.0 * along), 0.0, atol=1e-12)
    np.testing.assert_allclose(found.wrench, 2.0 * np.array([-along[1], along[0]]))  # 1.5 f = 3, 0.5 f = 1
    np.testing.assert_allclose(found.unbalanced, 0.0, atol=1e-14)
    jump = statics.balanced_wrench(J, [1.0, -3.0])
    np.testing.assert_allclose([jump.wrench, jump.unbalanced], [[0.0, 0.0], [1.0, -3.0]], atol=1e-14)
    ellipsoid = analysis.force_ellipsoid(J)  # the same direction, without end
    assert ellipsoid.along(along) == INF and ellipsoid.along([1.0, 0.0]) < INF


def test_a_lost_direction_is_the_callers_to_declare():
    J = oracles.planar_jacobian([1.0, 0.5], [0.6, 1e-7])
    assert statics.balanced_wrench(J, [3.0, 1.0]).internal.shape == (2, 0)
    assert statics.balanced_wrench(J, [3.0, 1.0], tolerance=1e-6).internal.shape == (2, 1)


# ---------------------------------------------------------------- torque limits


def linear_programme(J, direction, lower, upper, load, sign):
    rows = (J.T @ direction)[:, None]
    A, b = np.vstack([rows, -rows]), np.concatenate([upper - load, load - lower])
    finite = np.isfinite(b)
    answer = linprog([-sign], A_ub=A[finite], b_ub=b[finite], bounds=[(None, None)])
    return {0: lambda: answer.x[0], 2: lambda: -sign * INF, 3: lambda: sign * INF}[answer.status]()


@given(oracles.SEEDS, SHAPES, st.booleans())
def test_the_range_of_a_push(seed, shape, loaded):
    rng = np.random.default_rng(seed)
    m, n = shape
    J, d = rng.normal(size=(m, n)), rng.normal(size=m)
    lower, upper = -rng.uniform(0.1, 5.0, n), rng.uniform(0.1, 5.0, n)
    lower[rng.random(n) < 0.2], upper[rng.random(n) < 0.2] = -INF, INF
    load = rng.normal(size=n) * (3.0 if loaded else 0.05)
    found = statics.wrench_range(J, d, lower, upper, load)
    np.testing.assert_allclose(found.lowest, linear_programme(J, d, lower, upper, load, -1.0), rtol=1e-7, atol=1e-9)
    np.testing.assert_allclose(found.highest, linear_programme(J, d, lower, upper, load, 1.0), rtol=1e-7, atol=1e-9)
    if found.empty:
        return
    for s, joint in ((found.lowest, found.lowest_joint), (found.highest, found.highest_joint)):
        if math.isinf(s):
            assert joint == -1
            continue
        torque = load + s * statics.exerting_torques(J, d)
        assert (torque <= upper + 1e-9).all() and (torque >= lower - 1e-9).all()
        assert min(abs(torque[joint] - upper[joint]), abs(torque[joint] - lower[joint])) < 1e-9


@given(oracles.SEEDS, SHAPES, oracles.METRICS)
def test_the_capacity_in_every_direction(seed, shape, kind):
    """No direction bears less, and the one of the joint named bears no more."""
    rng = np.random.default_rng(seed)
    m, n = shape
    J, W = rng.normal(size=(m, n)), oracles.metric(rng, m, kind)
    full = oracles.full_metric(W, m)
    lower, upper = -rng.uniform(1.0, 5.0, n), rng.uniform(1.0, 5.0, n)
    load = rng.uniform(-0.5, 0.5, n)
    size, joint = statics.wrench_capacity(J, lower, upper, load, W)
    for d in rng.normal(size=(20, m)):
        unit = d / math.sqrt(d @ full @ d)
        found = statics.wrench_range(J, unit, lower, upper, load)
        assert min(found.highest, -found.lowest) >= size * (1.0 - 1e-12)
    worst = np.linalg.solve(full, J[:, joint])
    found = statics.wrench_range(J, worst / math.sqrt(worst @ full @ worst), lower, upper, load)
    assert min(found.highest, -found.lowest) == pytest.approx(size)


@pytest.mark.parametrize("size", [1e-300, 1e300])
def test_links_of_any_length(size):
    """The wrenches scale against the Jacobian; nothing under- or overflows on the way."""
    J, limit = size * np.eye(2), np.ones(2)
    assert statics.wrench_capacity(J, -limit, limit).size == pytest.approx(1.0 / size)
    assert statics.wrench_range(J, [1.0, 0.0], -limit, limit).highest == pytest.approx(1.0 / size)
    np.testing.assert_allclose(statics.balanced_wrench(J, limit).wrench, 1.0 / size)


def test_what_no_limit_stops_and_what_none_allows():
    J = oracles.planar_jacobian([1.0, 1.0], [0.3, 0.0])
    along, limit = np.array([math.cos(0.3), math.sin(0.3)]), np.array([10.0, 5.0])
    assert statics.wrench_range(J, along, -limit, limit) == (-INF, INF, -1, -1)
    heavy = statics.wrench_range(J, along, -limit, limit, load=[0.0, 6.0])
    assert heavy.empty and heavy.lowest_joint == 1
    assert statics.wrench_capacity(J, -limit, limit, load=[0.0, 6.0]) == (0.0, 1)
    assert statics.wrench_capacity(np.zeros((2, 2)), -limit, limit) == (INF, -1)
    across = np.array([-along[1], along[0]])
    relieved = statics.wrench_range(J, across, -limit, limit, load=[12.0, 0.0])  # only a push the right way helps
    np.testing.assert_allclose(relieved[:2], [-5.0, -1.0])
    assert relieved[2:] == (1, 0) and not relieved.empty


# ---------------------------------------------------------------- closed chains


def two_pandas(rng):
    """Two arms that hold one object, hands placed anywhere on it: Jacobians and grasps, in each hand's own axes."""
    robot = cc.load("panda")
    jacobians, placements = [], []
    for _ in range(2):
        q = rng.uniform(robot.limits.position_lower, robot.limits.position_upper)
        state = robot.state(q)
        R = state.rotation("panda_hand_tcp")
        jacobians.append(np.kron(np.eye(2), R.T) @ state.jacobian("panda_hand_tcp"))
        placements.append(spatial.pose(oracles.random_rotation(rng), rng.uniform(-0.3, 0.3, 3)))
    return jacobians, placements


@given(oracles.SEEDS)
def test_two_arms_carry_a_load_and_squeeze(seed):
    rng = np.random.default_rng(seed)
    jacobians, placements = two_pandas(rng)
    chain = statics.ClosedChain(jacobians, [spatial.wrench_adjoint(T) for T in placements])
    load, squeeze = rng.normal(size=6) * 20.0, rng.normal(size=12) * 5.0
    found = chain.hold(load, squeeze)
    force, moment = load[:3].copy(), load[3:].copy()
    for T, w in zip(placements, found.wrenches, strict=True):  # Newton and Euler for the object
        f, m = T[:3, :3] @ w[:3], T[:3, :3] @ w[3:]
        force += f
        moment += m + np.cross(T[:3, 3], f)
    np.testing.assert_allclose(np.concatenate([force, moment, found.unbalanced]), 0.0, atol=1e-11)
    for J, w, torque in zip(jacobians, found.wrenches, found.torques, strict=True):
        np.testing.assert_allclose(torque, J.T @ w, atol=1e-12)
    assert chain.internal.shape == (12, 6)
    unsqueezed = np.concatenate(chain.hold(load).wrenches)
    added = np.concatenate(found.wrenches) - unsqueezed
    np.testing.assert_allclose(chain.grasp @ added, 0.0, atol=1e-11)
    np.testing.assert_allclose(chain.internal.T @ added, chain.internal.T @ squeeze, atol=1e-11)
    np.testing.assert_allclose(chain.internal.T @ unsqueezed, 0.0, atol=1e-11)


@given(oracles.SEEDS)
def test_virtual_work_in_a_closed_chain(seed):
    """Squeezing does no work in any motion the chain allows; carrying does the load's, in reverse."""
    rng = np.random.default_rng(seed)
    jacobians, placements = two_pandas(rng)
    chain = statics.ClosedChain(jacobians, [spatial.wrench_adjoint(T) for T in placements])
    motions = chain.motions
    assert motions.shape == (20, 8)  # 14 joints less 6 rows of closure
    v, xi = motions[:14], motions[14:]
    for J, T, joints in zip(jacobians, placements, (v[:7], v[7:]), strict=True):
        np.testing.assert_allclose(J @ joints, spatial.move_twist(spatial.inverse_pose(T), xi), atol=1e-12)
    squeezing = np.concatenate(chain.hold(squeeze=rng.normal(size=12)).torques)
    np.testing.assert_allclose(squeezing @ v, 0.0, atol=1e-11)
    load = rng.normal(size=6)
    carrying = np.concatenate(chain.hold(load, rng.normal(size=12)).torques)
    np.testing.assert_allclose(carrying @ v, -load @ xi, atol=1e-11)


@given(oracles.SEEDS)
def test_contact_wrenches_from_torques(seed):
    """Two hands and their squeeze are determined by 14 torques; what sets the chain moving is not in them."""
    rng = np.random.default_rng(seed)
    jacobians, placements = two_pandas(rng)
    chain = statics.ClosedChain(jacobians, [spatial.wrench_adjoint(T) for T in placements])
    load = rng.normal(size=6)
    held = chain.hold(load, rng.normal(size=12))
    found = chain.contacts(held.torques, load)
    scale = max(1.0, *(np.linalg.cond(J) for J in jacobians))
    np.testing.assert_allclose(found.wrenches, held.wrenches, atol=1e-12 * scale)
    np.testing.assert_allclose(found.unbalanced, 0.0, atol=1e-11)
    tilted = [tau + rng.normal(size=7) for tau in held.torques]
    found = chain.contacts(tilted, load)
    residual = np.concatenate([*np.subtract(tilted, found.torques), -found.unbalanced])
    stack = np.block([[jacobians[0].T, np.zeros((7, 6))], [np.zeros((7, 6)), jacobians[1].T], [chain.grasp]])
    np.testing.assert_allclose(stack.T @ residual, 0.0, atol=1e-10)  # normal equations


def test_point_contacts_leave_a_twist_about_their_line():
    """Two fingertips that bear forces alone cannot turn the object about the line between them."""
    points = [np.array([0.1, 0.0, 0.0]), np.array([-0.1, 0.0, 0.0])]
    grasps = [spatial.wrench_adjoint(spatial.pose(p=p))[:, :3] for p in points]
    chain = statics.ClosedChain([np.eye(3), np.eye(3)], grasps)
    found = chain.hold([0.0, 0.0, -5.0, 0.7, 0.0, 0.4])
    np.testing.assert_allclose(found.unbalanced, [0.0, 0.0, 0.0, 0.7, 0.0, 0.0], atol=1e-14)
    np.testing.assert_allclose(found.wrenches, [[0.0, -2.0, 2.5], [0.0, 2.0, 2.5]], atol=1e-14)
    np.testing.assert_allclose(np.abs(chain.internal[:, 0]), np.array([1, 0, 0, 1, 0, 0]) / math.sqrt(2.0), atol=1e-14)
    np.testing.assert_allclose(
        chain.hold(squeeze=[-3.0, 0, 0, 3.0, 1.0, 0]).torques, [[-3, 0, 0], [3, 0, 0]], atol=1e-14
    )


# ---------------------------------------------------------------- bad input


@pytest.mark.parametrize(
    ("call", "error", "says"),
    [
        (lambda: statics.exerting_torques(np.eye(2), np.zeros(3)), ShapeError, "wrench has shape (3,)"),
        (lambda: statics.holding_torques(np.zeros(3), np.zeros(3)), ShapeError, "J has shape (3,)"),
        (
            lambda: statics.exerting_torques(1e200 * np.eye(2), [1e200, 1.0]),
            ParameterError,
            "beyond the largest number",
        ),
        (lambda: statics.balanced_wrench(1e-300 * np.eye(2), [1e300, 1.0]), ParameterError, "beyond the largest"),
        (lambda: statics.balanced_wrench(np.eye(2), [np.nan, 0.0]), NonFiniteError, "torque[0] is nan"),
        (lambda: statics.balanced_wrench(np.eye(2), np.zeros(2), metric=[1.0, -1.0]), MetricError, "metric[1]"),
        (lambda: statics.balanced_wrench(np.eye(2), np.zeros(2), tolerance=-1.0), ParameterError, "tolerance is -1"),
        (lambda: statics.wrench_range(np.eye(2), np.zeros(2), -np.ones(2), np.ones(2)), ParameterError, "direction"),
        (lambda: statics.wrench_range(np.eye(2), np.ones(2), np.ones(2), -np.ones(2)), ParameterError, "lower[0] is 1"),
        (lambda: statics.wrench_capacity(np.eye(2), -np.ones(3), np.ones(2)), ShapeError, "lower has shape (3,)"),
        (lambda: statics.ClosedChain([]), ShapeError, "jacobians is empty"),
        (lambda: statics.ClosedChain([np.eye(2), np.eye(3)]), ShapeError, "jacobians[1] has 3 rows"),
        (lambda: statics.ClosedChain([np.eye(2)] * 2, [np.eye(2)]), ShapeError, "grasps has 1 entries; expected 2"),
        (lambda: statics.ClosedChain([np.eye(2)] * 2, [np.eye(2), np.eye(3)]), ShapeError, "grasps[1]"),
        (lambda: statics.ClosedChain([np.eye(2)] * 2).hold(np.zeros(3)), ShapeError, "load has shape (3,)"),
        (lambda: statics.ClosedChain([np.eye(2)] * 2).hold(squeeze=np.zeros(2)), ShapeError, "squeeze"),
        (lambda: statics.ClosedChain([np.eye(2)] * 2).contacts([np.zeros(2)]), ShapeError, "torques has 1"),
        (lambda: statics.ClosedChain(None), ShapeError, "jacobians is None"),
        (lambda: statics.ClosedChain([np.eye(2)], [[[1], [1, 2]]]), ShapeError, "grasps[0] is [[1], [1, 2]]"),
        (lambda: statics.ClosedChain([np.eye(2)] * 2).contacts([[0, 0], [0]]), ShapeError, "torques[1]"),
    ],
)
def test_misuse_is_named(call, error, says):
    with pytest.raises(error) as caught:
        call()
    assert isinstance(caught.value, CartctlError)
    assert says in str(caught.value) and "\n" not in str(caught.value)
