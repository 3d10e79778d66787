"""Published exercises of statics: torques that balance forces and moments, at singularities and in a closed chain."""

from __future__ import annotations

import math

import numpy as np

from cartctl import statics
from tests import oracles
from tests import tolerances as tol
from tests.worked_examples import ITEMS, Answers, real

ANSWERS = Answers()
example, pytest_generate_tests = ANSWERS.example, ANSWERS.parametrize


def test_worked_example(identifier):
    ANSWERS.check(identifier)


@example("r1-2020-06-05-ex2")
def _(given):
    """Planar RRP, rows v_x, v_y, omega. At the first singularity the wrench asked for is one the structure carries."""
    Js = {name: planar_rrp(given["l1"], real(given[name])) for name in ("q0", "qs1", "qs2")}
    for q, J in ((real(given[name]), J) for name, J in Js.items()):
        np.testing.assert_allclose(np.linalg.det(J), given["l1"] * math.cos(q[1]), atol=tol.EXACT)
    carried = statics.balanced_wrench(Js["qs1"], np.zeros(3), tolerance=1e-12).internal
    assert carried.shape == (3, 1)
    np.testing.assert_allclose(np.cross(carried[:, 0], given["F"]), 0.0, atol=tol.EXACT)
    tau = {name: statics.holding_torques(J, given["F"]) for name, J in Js.items()}
    back = statics.balanced_wrench(Js["q0"], tau["q0"])  # regular: the only wrench with these torques
    np.testing.assert_allclose(-back.wrench, given["F"], atol=tol.ORACLE)
    return {"tau0": tau["q0"], "tau_s1": tau["qs1"], "tau_s2": tau["qs2"]}


def planar_rrp(l1, q):
    along = np.array([math.cos(q[0] + q[1]), math.sin(q[0] + q[1])])
    second = q[2] * along
    tip = second + l1 * np.array([math.cos(q[0]), math.sin(q[0])])
    return np.array([[-tip[1], -second[1], along[0]], [tip[0], second[0], along[1]], [1.0, 1.0, 0.0]])


@example("r1-2017-01-11-statics")
def _(given):
    """An elbow arm stretched out along x: a pull and a twist along itself need no torque."""
    y = np.array([0.0, -1.0, 0.0])  # positive angles lift the arm
    joints = [
        oracles.Joint("revolute", np.array([0.0, 0.0, 1.0]), np.eye(3), np.zeros(3)),
        oracles.Joint("revolute", y, np.eye(3), np.array([0.0, 0.0, given["d1"]])),
        oracles.Joint("revolute", y, np.eye(3), np.array([given["a2"], 0.0, 0.0])),
    ]
    J = oracles.chain_jacobian(joints, np.eye(3), np.array([given["a3"], 0.0, 0.0]), given["q"])
    free = np.array([*given["F0"], *given["M0"]], dtype=float)
    internal = statics.balanced_wrench(J, np.zeros(3)).internal
    assert internal.shape == (6, 3)
    np.testing.assert_allclose(internal @ (internal.T @ free), free, atol=tol.EXACT)
    return {
        "tau": statics.holding_torques(J, [*given["F"], *given["M"]]),
        "tau0": statics.holding_torques(J, free),
    }


@example("slides-two-2R-statics")
def _(given):
    """Tip against tip: a closed chain without load, whose forces are all internal."""
    JA, JB = (oracles.planar_jacobian(given["L"], real(given[q])) for q in ("qA", "qB"))
    F_A, F_B = real(given["F_A"]), real(given["F_B_in_frame_B"])
    chain = statics.ClosedChain([JA, JB])
    pushing = np.concatenate([F_A, F_B])
    held = chain.hold(squeeze=pushing)
    np.testing.assert_allclose(np.concatenate(held.wrenches), pushing, atol=tol.EXACT)
    assert chain.internal.shape == (4, 2) and chain.motions.shape == (6, 2)
    joints = chain.motions[:4]
    np.testing.assert_allclose(np.concatenate(held.torques) @ joints, 0.0, atol=tol.EXACT)
    again = chain.contacts(held.torques)
    np.testing.assert_allclose(np.concatenate(again.wrenches), pushing, atol=tol.ORACLE)
    return {"JA": JA, "JB": JB, "tauA_slide": held.torques[0], "tauB_slide": held.torques[1]}


def test_the_worst_direction_of_a_force_under_torque_limits():
    """PRR folded back on itself: the largest force that may point anywhere is the one joint 3 bounds."""
    given = ITEMS["r2-2014-10-27-ex2"]["inputs"]
    J = np.hstack([[[1.0], [0.0]], oracles.planar_jacobian(given["l"], real(given["q"][1:]))])
    limits = np.array(given["limits"], dtype=float)
    size, joint = statics.wrench_capacity(J, -limits, limits)
    np.testing.assert_allclose(size, ITEMS["r2-2014-10-27-ex2"]["expected"]["F_max"])
    assert joint == 2
    angle = real(given["F_dir"])
    worst = statics.wrench_range(J, [math.cos(angle), math.sin(angle)], -limits, limits)
    np.testing.assert_allclose([worst.lowest, worst.highest], [-size, size])
