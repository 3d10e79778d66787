"""Published exercises: Jacobians from the inputs, solved here, held against the printed results.

One function an item returns what it computes under the item's own keys; the test compares the checked ones, each to
the digits it was printed with.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from cartctl import DLS, Equation, Problem, Status, analysis, solve, spatial, statics
from cartctl.algebra.nullspace import projector
from tests import oracles
from tests.worked_examples import ITEMS, Answers, real

ANSWERS = Answers()
example, pytest_generate_tests = ANSWERS.example, ANSWERS.parametrize


def pinv(A):
    """A#, column by column through the solver."""
    A = np.asarray(A, dtype=float)
    return np.column_stack([solve(Problem([(A, e)]), "pinv").u for e in np.eye(A.shape[0])])


def rates(solver, *equations, **more):
    return solve(Problem(list(equations), **more), solver).u


def test_worked_example(identifier):
    ANSWERS.check(identifier)


# ---------------------------------------------------------------- pseudo-inverse and damping


@example("slides-dls-2R")
def _(given):
    """mu2 is lambda squared; the undamped solution is the pseudo-inverse's."""
    J, v = oracles.planar_jacobian(given["L"], np.radians(given["q_deg"])), real(given["xdot"])
    damped = {mu2: rates(DLS(math.sqrt(mu2)), (J, v)) for mu2 in given["mu2"]}
    return {
        "dq_mu2_0": rates("pinv", (J, v)),
        "dq_mu2_1e3": damped[0.001],
        "dq_mu2_10": damped[10],
        "norm_dq": [np.linalg.norm(u) for u in damped.values()],
        "norm_err": [np.linalg.norm(v - J @ u) for u in damped.values()],
    }


@example("r1-2016-09-12-ex2")
def _(given):
    """RPR: the prismatic axis is skewed by beta, the last link turns from it."""
    q1, q2, q3 = real(given["q"])
    l1, l3, beta = given["l1"], given["l3"], real(given["beta"])
    along, last = q1 + beta, q1 + beta + q3
    p = l1 * ray(q1) + q2 * ray(along) + l3 * ray(last)
    J = np.column_stack([normal(p), ray(along), l3 * normal(ray(last))])
    u = rates("pinv", (J, real(given["pdot"])))
    other = ITEMS["r1-2016-09-12-ex2"]["expected"]["other"]
    return {"J": J, "dq": u, "norm": np.linalg.norm(u), "other_residual": np.linalg.norm(J @ other - given["pdot"])}


def ray(angle):
    return np.array([math.cos(angle), math.sin(angle)])


def normal(p):
    """z x p."""
    return np.array([-p[1], p[0]])


@example("r1-2017-02-03-ex3")
def _(given):
    """Gains along and across the path, in the path's axes."""
    lengths, q = [given["l"]] * 3, real(given["q0"])
    J, t = oracles.planar_jacobian(lengths, q), real(given["tangent"])
    R = np.column_stack([t, normal(t)])
    gain = R @ np.diag(given["gains"]) @ R.T
    error = np.array(given["pi"]) - oracles.planar_point(lengths, q)
    return {"J": J, "pinv": pinv(J), "RKRt": gain, "err": error, "dq": rates("pinv", (J, gain @ error))}


@example("r1-2021-09-10-ex1")
def _(given):
    L = given["check_point_chosen_here"]["L"]
    J = np.array([[1.0, -L, 0.0], [0.0, L, L], [0.0, 1.0, 1.0]])
    u = rates("pinv", (J, [1.0, 0.0, 1.0]))
    return {"dq11": rates("pinv", (J, [0.0, L, 1.0])), "dq2": u, "Jdq2": J @ u}


@example("r1-2023-06-12")
def _(given):
    a1, a3, a4 = given["check_point_chosen_here"]["a"]
    J = np.zeros((6, 4))
    J[1, :2], J[2, 2:], J[4, 2:], J[5, :2] = (a1 + a3 + a4, a3 + a4), (a3 + a4, a4), -1.0, 1.0
    solution = solve(Problem([(J, given["Va"])]), "pinv")
    assert solution.status is Status.OPTIMAL
    return {"at_point": solution.u, "residual": solution.residuals[0]}


@example("r1-2024-02-16-ex3")
def _(given):
    """Folded and stretched 2R arms at the points of the path."""
    answers = {}
    for point, angle, folded in [("A", math.pi / 2, True), ("B", 0.0, False)]:
        q = [angle, math.pi if folded else 0.0]
        np.testing.assert_allclose(oracles.planar_point(given["L"], q), given[point], atol=1e-12)
        answers[f"q{point}_prime"] = rates("pinv", (oracles.planar_jacobian(given["L"], q), given[f"dp_{point}"]))
    return answers


@example("r2-2020-07-15-ex2")
def _(given):
    """PRRR in absolute angles: tip position and the angle of the first turning link."""

    def J(q):
        c, s = np.cos(q[1:]), np.sin(q[1:])
        return np.array([[1.0, *(-s * given["L"])], [0.0, *(c * given["L"])], [0.0, 1.0, 0.0, 0.0]])

    def tip(q):
        return [q[0] + np.dot(given["L"], np.cos(q[1:])), given["h"] + np.dot(given["L"], np.sin(q[1:]))]

    q0, qs = real(given["q0"]), real(given["qs"])
    singular = solve(Problem([(J(qs), given["rdots"])]), "pinv")
    assert singular.status is Status.SINGULAR
    np.testing.assert_allclose(singular.residuals, 0.0, atol=1e-12)  # singular, and executed exactly
    return {
        "pinv0": pinv(J(q0)),
        "dq0": rates("pinv", (J(q0), given["rdot0"])),
        "pinvs": pinv(J(qs)),
        "dqs": singular.u,
        "rank_s": 4 - round(np.trace(projector(J(qs)))),
        "Ps": tip(qs),
    }


# ---------------------------------------------------------------- metrics


@example("r2-2018-04-26-ex4")
def _(given):
    """PPR in metres and in centimetres."""

    def J(length):
        return np.column_stack([np.eye(2), length * normal(ray(real(given["q3"])))])

    metres, centimetres = (J(given["l_m"]), given["pdot_m"]), (J(given["l_cm"]), given["pdot_cm"])
    return {
        "pinv_m": pinv(metres[0]),
        "dq_m": rates("pinv", metres),
        "dq_cm": rates("pinv", centimetres),
        "dq_w_l2_m": rates("pinv", metres, metric=[1, 1, given["l_m"] ** 2]),
        "dq_w_l2_cm": rates("pinv", centimetres, metric=np.diag([1.0, 1.0, given["l_cm"] ** 2])),
        "dq_w1000_m": rates("pinv", metres, metric=[1, 1, 1000]),
    }


@example("r2-2023-04-19-ex3")
def _(given):
    m1, m2, m3, m4 = given["check_point_chosen_here"]["m"]
    M = np.array(
        [
            [m1 + m2 + m3 + m4, 0, m3 + m4, 0],
            [0, m2 + m3 + m4, 0, m4],
            [m3 + m4, 0, m3 + m4, 0],
            [0, m4, 0, m4],
        ]
    )
    J = np.hstack([np.eye(2), np.eye(2)])
    weighted = np.column_stack([rates("pinv", (J, e), metric=M) for e in np.eye(2)])
    return {"JM": weighted, "Jpinv": pinv(J)}


@example("r2-2018-01-11-ex1")
def _(given):
    point = given["check_point_chosen_here"]
    q1, q2 = point["q"]
    M = np.diag([point["I1"] + point["I2"] + point["m2"] * (q2 - point["dc2"]) ** 2, point["m2"]])
    return {"at_point": rates("pinv", ([[q2 * math.cos(q1), math.sin(q1)]], [1.0]), metric=M)}


@example("r2-2022-04-13-ex5")
def _(given):
    """Torques: A = J M^-1, command c + J M^-1 g; the metrics I and M^-2 agree."""
    point = given["check_point_chosen_here"]
    M = np.diag([point["a"], point["c"]])  # cos(q2) = 0 takes the coupling away
    A = np.array([[1.0, 0.0]]) @ np.linalg.inv(M)
    torque = Equation(A, [point["ydd"]], drift=-A @ point["g"])
    one, other = rates("pinv", torque), rates("pinv", torque, metric=np.linalg.inv(M @ M))
    np.testing.assert_allclose(one, other, atol=1e-12)
    return {"at_point": one}


@example("r2-2010-06-15")
def _(given):
    point = given["check_point_chosen_here"]
    q1, q2 = point["q"]
    J = np.array([[(point["d2"] + q2) * math.cos(q1), math.sin(q1)]])
    return {"at_point": pinv(J / np.array([point["b11"], point["b22"]]))[:, 0]}


# ---------------------------------------------------------------- null space


@example("r2-2021-01-12-ex1")
def _(given):
    """The tip rests while the arm sinks: u0 = -alpha g(q)."""
    L, m, q = np.array(given["L"]), given["m"], real(given["q"])
    g = np.zeros(3)
    for k in range(3):  # link k's centre is half-way along it
        lengths = L.copy()
        lengths[k] /= 2.0
        g += m[k] * given["g0"] * oracles.planar_jacobian(lengths, q, k + 1)[1]
    J = oracles.planar_jacobian(L, q)
    u = rates("projected-gradient", (J, [0.0, 0.0]), reference=-given["alpha"] * g)
    return {"J": J, "pinv": pinv(J), "g": g, "dq": u, "p": oracles.planar_point(L, q)}


@example("r2-2024-06-12-ex2")
def _(given):
    """Pointing at a moving target; joint range in the null space."""
    q, low, high = real(given["q"]), *real(given["qlim"]).T
    p, J = oracles.planar_point(given["L"], q), oracles.planar_jacobian(given["L"], q)
    offset = (q - (low + high) / 2.0) / (high - low)
    gradient = offset / (high - low) / 4.0
    line = np.array(given["pt"]) - p  # from the tip to the target
    wanted = math.atan2(line[1], line[0])
    direction = np.array([-line[1], line[0]]) / (line @ line)  # d(wanted) / d(target)
    error = wanted - q.sum()
    Jr = -direction[None] @ J - np.ones((1, 4))  # d(error) / dq
    flipped = -np.array(given["ptdot"])  # as the printed numbers have it
    command = -direction @ flipped - given["k"] * error
    u = rates("projected-gradient", (Jr, [command]), reference=-given["beta"] * gradient)
    return {
        "p": p,
        "Jp": J,
        "H": offset @ offset / 8.0,
        "gradH": gradient,
        "alpha_d": wanted,
        "e_r": error,
        "Jr": Jr,
        "dq_with_target_velocity_sign_flipped": u,
    }


@example("r2-2022-02-03-ex2")
def _(given):
    """Accelerations nearest to -Kd q_dot, drift J_dot q_dot, with and without a rate for the last link."""
    L, q, v = given["L"], real(given["q"]), np.array(given["qdot"])
    J = oracles.planar_jacobian(L, q)
    position = Equation(J, given["pdd"], drift=planar_drift(L, q, v))
    angle = (np.ones((1, 4)), [0.0])
    return {
        "ddq_a": rates("projected-gradient", position, reference=-v),
        "ddq_b": rates("projected-gradient", position, angle, reference=-v),
        "p": oracles.planar_point(L, q),
        "phi": q.sum(),
        "pdot": J @ v,
        "omega": v.sum(),
    }


def planar_drift(lengths, q, v):
    """J_dot v: every link's centripetal acceleration."""
    return -sum(length * w**2 * ray(a) for length, a, w in zip(lengths, np.cumsum(q), np.cumsum(v), strict=True))


@example("r1-2019-09-11-ex1")
def _(given):
    """A spatial elbow arm in motion, and the same with a shorter upper arm, singular."""

    def arm(a2):
        d1, a3 = given["DH"][0][2], given["DH"][2][1]
        q1, q2, q3 = real(given["q"])
        w1, w2, w3 = given["qdot"]
        out, up = np.array([math.cos(q1), math.sin(q1), 0.0]), np.array([0.0, 0.0, 1.0])
        side = np.cross(up, out)
        hinge = np.cross(out, up)  # joints 2 and 3 lift the arm
        upper = a2 * (math.cos(q2) * out + math.sin(q2) * up)
        fore = a3 * (math.cos(q2 + q3) * out + math.sin(q2 + q3) * up)
        p = upper + fore
        J = np.column_stack([np.cross(up, p), np.cross(hinge, p), np.cross(hinge, fore)])
        radius = p @ out
        tangential = w1 * (-(w2 * (upper + fore) + w3 * fore) @ up)  # w1 times how fast the radius grows
        drift = -(w2**2) * upper - (w2 + w3) ** 2 * fore - w1**2 * radius * out + 2.0 * tangential * side
        assert d1 > 0.0
        return J, drift

    J, drift = arm(given["DH"][1][1])
    J_singular, drift_singular = arm(given["a2_singular"])
    regular = solve(Problem([Equation(J, np.zeros(3), drift=drift)]), "pinv")
    singular = solve(Problem([Equation(J_singular, np.zeros(3), drift=drift_singular)]), "pinv")
    assert (regular.status, singular.status) == (Status.OPTIMAL, Status.SINGULAR)
    return {
        "J": J,
        "drift": drift,
        "ddq": regular.u,
        "J_sing": J_singular,
        "drift_sing": drift_singular,
        "ddq_sing": singular.u,
        "pdd_sing": J_singular @ singular.u + drift_singular,
    }


# ---------------------------------------------------------------- several tasks


@example("r2-2020-04-15-q4")
def _(given):
    q = real(given["q"])
    first, second = np.ones((1, 3)), oracles.planar_jacobian(given["L"], q)
    J, v = np.vstack([first, second]), np.array([given["v_orient"], *given["v_tip"]], dtype=float)
    stacked = rates("pinv", (J, v))
    ranked = solve(Problem([(first, v[:1]), (second, v[1:])]), "task-priority")
    return {
        "J": J,
        "dq_pinv": stacked,
        "err_pinv": np.abs(v - J @ stacked),
        "dq_tp": ranked.u,
        "err_tp": v - J @ ranked.u,
        "J2P1": second @ projector(first),
        "norm_err_tip_tp": ranked.residuals[1],
    }


@example("r2-2022-06-10-ex2")
def _(given):
    """A tip task over a mid-arm task. In case b J2 P1 is zero up to round-off and must not be inverted."""
    answers = {}
    for case in "ab":
        q = real(given[f"q_{case}"])
        tip, middle = oracles.planar_jacobian(given["L"], q), oracles.planar_jacobian(given["L"], q, 2)
        u = rates("task-priority", (tip, given["v1"]), (middle, given["v2"]))
        answers |= {f"dq_{case}": u, f"r_{case}": np.concatenate([tip @ u, middle @ u])}
    return answers


@example("r2-2024-04-24-ex1")
def _(given):
    """Clearance from a disc: in the null space, then as a second task."""
    q, L = real(given["q"]), given["L"]
    Je, Jm = oracles.planar_jacobian(L, q), oracles.planar_jacobian(L, q, 2)
    line = oracles.planar_point(L, q, 2) - given["C"]
    distance = np.linalg.norm(line)
    gradient = 0.5 * Jm.T @ line / distance  # the source's; the factor is a slip of its own
    u = rates("projected-gradient", (Je, given["ve"]), reference=gradient)
    away = ITEMS["r2-2024-04-24-ex1"]["expected"]["vm_B"]
    np.testing.assert_allclose(away / np.linalg.norm(away), line / distance, atol=1e-4)
    first = (Je, given["ve"])
    return {
        "Je": Je,
        "Jm": Jm,
        "H": distance - given["r"],
        "gradH_used": gradient,
        "Je_pinv": pinv(Je),
        "dq_PG": u,
        "vm": Jm @ u,
        "dq_TP_A": rates("task-priority", first, (Jm, Jm @ u)),
        "vm_B": away,
        "dq_TP_B": rates("task-priority", first, (Jm, away)),
        "err_B": away - Jm @ rates("task-priority", first, (Jm, away)),
    }


@example("r1-2016-02-04-ex3")
def _(given):
    """Mid-arm and tip velocities, stacked: square and regular."""
    q = real(given["q"])
    middle, tip = oracles.planar_jacobian(given["L"], q, 2), oracles.planar_jacobian(given["L"], q)
    u = rates("pinv", (middle, given["vM"]), (tip, given["vE"]))
    return {"J_MM": middle[:, :2], "J_EM": tip[:, :2], "J_EE": tip[:, 2:], "dq": u}


@example("r2-2013-01-09-ex1")
def _(given):
    """det of the stack is -cos q3 sin(q2 - q1), absolute angles; at its zeros the stack is singular."""
    rng = np.random.default_rng(13)
    worst = 0.0

    def tasks(q):
        c, s = np.cos(q), np.sin(q)
        return np.array([-s, c]) * given["L"], np.array([[c[0], c[1], 0.0]])

    for _ in range(50):
        q = rng.uniform(-math.pi, math.pi, 3)
        tip, height = tasks(q)
        worst = max(worst, abs(np.linalg.det(np.vstack([tip, height])) + math.cos(q[2]) * math.sin(q[1] - q[0])))
        q[2] = math.pi / 2.0
        tip, height = tasks(q)
        problem = Problem([(tip, rng.normal(size=2)), (height, rng.normal(size=1))])
        for solver in ("pinv", "task-priority"):
            assert solve(problem, solver).status is Status.SINGULAR
    return {"identity_residual": worst}


# ---------------------------------------------------------------- manipulability and forces


@example("r1-2012-01-11-bonus")
def _(given):
    """The best posture of a planar 3R on the source's grid; its closed form against the singular values."""
    l1, l2, l3 = given["L"]

    def closed(q2, q3):
        a, b = l1 * (l2 * np.sin(q2) + l3 * np.sin(q2 + q3)), l3 * (l1 * np.sin(q2 + q3) + l2 * np.sin(q3))
        return np.sqrt(a**2 + b**2 + (l2 * l3 * np.sin(q3)) ** 2)

    def manipulability(q2, q3):
        return analysis.manipulability(oracles.planar_jacobian(given["L"], [0.7, q2, q3]))

    angles = np.arange(0.0, math.pi, given["grid"])
    grid = closed(angles[:, None], angles[None])
    best = [angles[i] for i in np.unravel_index(np.argmax(grid), grid.shape)]
    some = np.random.default_rng(12).uniform(-math.pi, math.pi, (50, 2))
    return {
        "H_max": manipulability(*best),
        "q2_q3": best,
        "closed_form_residual": max(abs(manipulability(*q) - closed(*q)) for q in some),
        "H_at_printed": manipulability(*ITEMS["r1-2012-01-11-bonus"]["expected"]["q2_q3"]),
    }


@example("r2-2014-10-27-ex2")
def _(given):
    """PRR: the largest force in the direction that joint 3 alone bounds, and the torques that balance it."""
    length, limits = np.array(given["l"]), np.array(given["limits"], dtype=float)
    J = np.hstack([[[1.0], [0.0]], oracles.planar_jacobian(length, real(given["q"][1:]))])
    force = given["F_norm"] * ray(real(given["F_dir"]))
    bearable = analysis.force_ellipsoid(J[:, 2:], metric=limits[2:] ** 2)
    assert bearable.along(force) == pytest.approx(given["F_norm"])
    return {"tau": statics.holding_torques(J, force), "rank": analysis.rank(J)}


# ---------------------------------------------------------------- Euler angles


@example("r1-2014-01-09-ex2")
def _(given):
    """Shortest cubic reorientations: |omega| = |T(phi) phi_dot| peaks at the limit."""
    limit, shortest = real(given["Omega"]), []
    for start in given["phi_in"]:
        for end in given["phi_fin"]:
            phi, change = real(start), real(end) - real(start)
            np.testing.assert_allclose(spatial.euler_rotation("YZY", phi), given["R_in"], atol=1e-9)
            np.testing.assert_allclose(spatial.euler_rotation("YZY", phi + change), given["R_fin"], atol=1e-9)
            speeds = [
                6.0 * s * (1.0 - s) * spatial.euler_rates("YZY", phi + change * s**2 * (3.0 - 2.0 * s)) @ change
                for s in np.linspace(0.0, 1.0, 2001)
            ]
            shortest.append(np.linalg.norm(speeds, axis=1).max() / limit)
    return {"T_min": shortest, "T_at_check": spatial.euler_rates("YZY", np.array([0.3, 0.8, -1.1]))}


@example("slides-rpy-rate")
def _(given):
    """Roll-pitch-yaw is XYZ about fixed axes."""
    point = given["check_point_chosen_here"]
    phi = [0.7, point["beta"], point["gamma"]]
    return {
        "T_at_point": spatial.euler_rates("XYZ", phi, about="fixed"),
        "det": spatial.euler_lock("XYZ", phi, about="fixed").determinant,
    }


@example("r1-2021-02-04-q7")
def _(given):
    start, end, T = real(given["phi_in"]), real(given["phi_fin"]), given["T"]
    final = np.linalg.solve(spatial.euler_rates("XYZ", end), given["w_fin"])
    t = 0.5 * T
    blend, tail = 10 * t**3 - 15 * t**4 + 6 * t**5, -4 * t**3 + 7 * t**4 - 3 * t**5
    middle = start + (end - start) * blend + final * tail
    return {
        "rate_fin": final,
        "phi_mid": middle,
        "R_mid": spatial.euler_rotation("XYZ", middle),
        "T_mid": spatial.euler_rates("XYZ", middle),
    }


# ---------------------------------------------------------------- screws


def displaced(column, angle):
    """The pose after ``angle`` along a screw axis (omega, v)."""
    return spatial.exp6(angle * spatial.other_order(column))


@example("mr-jacobian-space")
def _(given):
    """Column i: the screw carried along by the joints before it."""
    columns, carried = [], np.eye(4)
    for column, angle in zip(given["Slist_columns"], given["theta"], strict=True):
        columns.append(spatial.adjoint(carried, "angular-first") @ column)
        carried = carried @ displaced(column, angle)
    return {"Js": np.column_stack(columns)}


@example("mr-jacobian-body")
def _(given):
    """Column i: the screw seen from behind the joints after it."""
    columns, ahead = [], np.eye(4)
    for column, angle in zip(given["Blist_columns"][::-1], given["theta"][::-1], strict=True):
        columns.append(spatial.adjoint(spatial.inverse_pose(ahead), "angular-first") @ column)
        ahead = displaced(column, angle) @ ahead
    return {"Jb": np.column_stack(columns[::-1])}
