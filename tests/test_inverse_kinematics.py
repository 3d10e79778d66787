"""Pose inverse kinematics: every answer checked by Pinocchio, on arms, continuous joints and branches of humanoids."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pinocchio as pin
import pytest

import cartctl as cc
from cartctl.compiled.reach import Reached

NEAR, ALIGNED = 1e-4, 1e-3


def poses(robot: cc.Robot, n: int, seed: int, frame: str | None = None) -> list[pin.SE3]:
    rng = np.random.default_rng(seed)
    return [robot.state(robot.random_configuration(rng)).placement(frame or robot.tool) for _ in range(n)]


def verified(robot: cc.Robot, targets, answer, frame: str | None = None) -> np.ndarray:
    """Whether each answer holds, by Pinocchio alone; what the answer says of itself must be so."""
    holds = []
    for q, target, away, turned in zip(answer.q, targets, answer.position_error, answer.orientation_error, strict=True):
        pose = robot.state(q).placement(frame or robot.tool)
        apart = np.linalg.norm(pose.translation - target.translation)
        angle = np.linalg.norm(pin.log3(target.rotation @ pose.rotation.T))
        assert apart == pytest.approx(away, abs=1e-9) and angle == pytest.approx(turned, abs=1e-7)
        at = robot.coordinates(q)
        inside = (at >= robot.limits.position_lower) & (at <= robot.limits.position_upper)
        assert inside[~robot.continuous].all(), "an attempt may miss its target, never a limit"
        holds.append(apart <= NEAR and angle <= ALIGNED)
    return np.array(holds)


@pytest.mark.parametrize("name", ["panda", "iiwa14", "kinova", "ur5", "pr2", "talos", "so101", "planar2R"])
def test_reachable_poses_are_reached(name):
    robot = cc.load(name)
    targets = poses(robot, 200, seed=1)
    answer = cc.inverse_kinematics(robot, targets)
    holds = verified(robot, targets, answer)
    np.testing.assert_array_equal(answer.success, holds)
    assert holds.all()
    assert all(status is Reached.REACHED for status in answer.status)


def test_ten_thousand_panda_poses():
    """At least 99.9 % of random reachable poses, within 0.1 mm and 1 mrad and inside the limits."""
    robot = cc.load("panda")
    rng = np.random.default_rng(9)
    low, high = robot.limits.position_lower, robot.limits.position_upper
    targets = [robot.state(q).placement(robot.tool) for q in rng.uniform(low, high, (10_000, 7))]
    answer = cc.inverse_kinematics(robot, targets)
    holds = verified(robot, targets, answer)
    np.testing.assert_array_equal(answer.success, holds)
    assert holds.mean() >= 0.999


def test_a_target_out_of_reach_comes_back_with_the_best_attempt():
    robot = cc.load("panda")
    far = robot.state(robot.home).placement(robot.tool)
    far.translation = np.array([3.0, 0.0, 0.5])
    answer = cc.inverse_kinematics(robot, far, restarts=10)
    assert not answer.success[0] and answer.status[0] in (Reached.LIMITED, Reached.MISSED)
    assert np.isfinite(answer.q).all() and answer.restarts[0] == 10
    reach = np.linalg.norm(robot.state(answer.q[0]).position(robot.tool) - far.translation)
    assert reach == pytest.approx(answer.position_error[0], abs=1e-9)
    assert reach < np.linalg.norm(robot.state(robot.home).position(robot.tool) - far.translation)
    assert not verified(robot, [far], answer).any()


def test_a_single_target_in_every_form():
    robot = cc.load("panda")
    (target,) = poses(robot, 1, seed=4)
    forms = [target, target.homogeneous, [target], [target.homogeneous], target.homogeneous[None]]
    answers = [cc.inverse_kinematics(robot, form).q for form in forms]
    for q in answers:
        assert q.shape == (1, 7)
        np.testing.assert_array_equal(q, answers[0])


def test_independent_of_batch_order_and_threads():
    robot = cc.load("kinova")
    targets = poses(robot, 60, seed=6)
    whole = cc.inverse_kinematics(robot, targets, threads=1)
    order = np.random.default_rng(0).permutation(60)
    shuffled = cc.inverse_kinematics(robot, [targets[i] for i in order], threads=3)
    np.testing.assert_array_equal(shuffled.q, whole.q[order])
    np.testing.assert_array_equal(cc.inverse_kinematics(robot, targets[7]).q[0], whole.q[7])
    assert (cc.inverse_kinematics(robot, targets, seed=1).q != whole.q).any()


def test_the_first_attempt_begins_at_q0():
    """From close by, the answer is close by; other joints stay where q0 has them."""
    robot = cc.load("talos")
    rng = np.random.default_rng(3)
    for _ in range(20):
        q0 = robot.random_configuration(rng)
        near = robot.integrate(q0, 1e-3 * rng.normal(size=robot.nv))
        near = np.clip(near, robot.limits.position_lower, robot.limits.position_upper)
        target = robot.state(near).placement(robot.tool)
        answer = cc.inverse_kinematics(robot, target, q0=q0)
        assert answer.success[0] and answer.restarts[0] == 0
        assert np.linalg.norm(answer.q[0] - q0) < 0.2
        still = ~np.any(robot.state(q0).jacobian(robot.tool), axis=0)
        np.testing.assert_array_equal(answer.q[0][still], q0[still])


def test_restarts_keep_joints_that_do_not_move_the_frame():
    robot = cc.load("talos")
    still = ~np.any(robot.state(robot.home).jacobian(robot.tool), axis=0)
    answer = cc.inverse_kinematics(robot, poses(robot, 20, seed=8))
    np.testing.assert_array_equal(answer.q[:, still], np.tile(robot.home[still], (20, 1)))


def test_the_nearest_of_several_answers():
    robot = cc.load("panda")
    targets, gaps = poses(robot, 30, seed=5), []
    for count in (1, 12):
        answer = cc.inverse_kinematics(robot, targets, q0=robot.home, candidates=count)
        assert verified(robot, targets, answer).all()
        gaps.append(np.linalg.norm(answer.q - robot.home, axis=1))
    assert (gaps[1] <= gaps[0] + 1e-12).all() and gaps[1].mean() < 0.95 * gaps[0].mean()


@pytest.mark.parametrize("objective", [cc.JointRange(), cc.Manipulability("panda_hand_tcp")])
def test_the_self_motion_ends_where_the_objective_does(objective):
    robot = cc.load("panda")
    targets = poses(robot, 8, seed=12)
    plain = cc.inverse_kinematics(robot, targets)
    best = cc.inverse_kinematics(robot, targets, objective=objective)
    assert verified(robot, targets, best).all()
    sign = 1.0 if objective.maximise else -1.0
    values = [[sign * objective.value(robot.state(q)) for q in answer.q] for answer in (plain, best)]
    assert (np.array(values[1]) >= np.array(values[0])).all()
    extremal = 0
    for q in best.q:
        state = robot.state(q)
        low, high = robot.limits.position_lower, robot.limits.position_upper
        if ((q - low < 1e-9) | (high - q < 1e-9)).any():
            continue  # held by a limit: the slope need not vanish
        z = np.linalg.svd(state.jacobian(robot.tool))[2][6:]
        slope = objective.gradient(state)
        extremal += 1
        assert np.linalg.norm(z @ slope) <= 1e-2 * np.linalg.norm(slope)
    assert extremal >= 3


def test_limits_of_ones_own():
    robot = cc.load("panda")
    narrow = robot.limits.replace(
        position_lower=np.maximum(robot.limits.position_lower, robot.home - 0.4),
        position_upper=np.minimum(robot.limits.position_upper, robot.home + 0.4),
    )
    rng = np.random.default_rng(2)
    q = rng.uniform(narrow.position_lower, narrow.position_upper, (50, 7))
    targets = [robot.state(row).placement(robot.tool) for row in q]
    answer = cc.inverse_kinematics(robot, targets, limits=narrow)
    assert answer.success.all() and verified(robot, targets, answer).all()
    assert (answer.q >= narrow.position_lower).all() and (answer.q <= narrow.position_upper).all()


def test_misuse_is_refused():
    robot = cc.load("panda")
    (target,) = poses(robot, 1, seed=4)
    bent = target.homogeneous
    bent[0, 0] += 0.1
    far = target.homogeneous
    far[0, 3] = 1e200  # whose square is no number any more
    wrong = [
        (cc.errors.TargetError, "shape", {"targets": np.zeros((2, 3))}),
        (cc.errors.TargetError, r"targets\[1\] is off a pose", {"targets": [target.homogeneous, bent]}),
        (cc.errors.NonFiniteError, "nan", {"targets": np.full((4, 4), np.nan)}),
        (cc.errors.TargetError, "expected a pose", {"targets": cc.Line(target, [0.5, 0.0, 0.5], duration=1.0)}),
        (cc.errors.TargetError, "expected a pose", {"targets": [target, "home"]}),
        (cc.errors.ParameterError, r"targets\[0, 0, 3\] is 1e\+200", {"targets": far}),
        (cc.errors.FrameNotFound, "hand", {"frame": "panda_hnd"}),
        (cc.errors.ShapeError, "q0 has shape", {"q0": np.zeros(6)}),
        (cc.errors.ParameterError, "restarts", {"restarts": -1}),
        (cc.errors.ParameterError, "position_tolerance", {"position_tolerance": 0.0}),
        (cc.errors.ParameterError, "candidates is 3", {"candidates": 3}),
        (cc.errors.ParameterError, "objective is a str", {"objective": "manipulability"}),
        (cc.errors.ParameterError, "threads", {"threads": 0}),
        (cc.errors.ParameterError, "limits is a float", {"limits": 1.0}),
    ]
    for error, words, changes in wrong:
        with pytest.raises(error, match=words):
            cc.inverse_kinematics(robot, **{"targets": target, **changes})
    with pytest.raises(cc.errors.UnsupportedJoint, match="'root_joint' is a FreeFlyer"):
        cc.inverse_kinematics(cc.load("talos", root_joint="free_flyer"), target)


def test_interpreted_and_compiled_agree():
    code = """
import numpy as np, cartctl as cc
robot, rng = cc.load("panda"), np.random.default_rng(1)
targets = [robot.state(robot.random_configuration(rng)).placement(robot.tool) for _ in range(3)]
print(cc.inverse_kinematics(robot, targets).q.tolist())
"""
    answers = []
    for off in ("0", "1"):
        env = {**os.environ, "NUMBA_DISABLE_JIT": off, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}
        done = subprocess.run([sys.executable, "-c", code], env=env, capture_output=True, text=True, check=True)
        answers.append(np.array(eval(done.stdout)))  # noqa: S307 - printed above
    np.testing.assert_allclose(answers[0], answers[1], atol=1e-6)  # the same descent, round-off magnified on its way
