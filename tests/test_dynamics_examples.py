"""Published exercises of dynamics: the equations from tables and matrices, held against the printed results."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import cartctl as cc
from cartctl import dynamics as dyn
from cartctl.dynamics.dh_model import pinocchio_model
from tests.worked_examples import compare, real

DATA = Path(__file__).parent / "data/dynamics_examples.json"
ITEMS = {item["id"]: item for item in json.loads(DATA.read_text())}
ANSWERS = {}
Link = dyn.DHLink


def example(identifier):
    def register(function):
        ANSWERS[identifier] = function
        return function

    return register


@pytest.mark.parametrize("identifier", ITEMS)
def test_worked_example(identifier):
    compare(ITEMS[identifier], ANSWERS[identifier](ITEMS[identifier]["inputs"]))


def three_ways(arm, q, **values):
    """M(q) by Euler-Lagrange in symbols, by moving frames and by Pinocchio: the same."""
    numbers = arm.with_values(**values)
    M = dyn.euler_lagrange(arm).numeric(**values).M(q)
    np.testing.assert_allclose(dyn.moving_frames(numbers, q, np.zeros(arm.n)).mass_matrix, M, atol=1e-14)
    np.testing.assert_allclose(robot_of(numbers).state(q).mass_matrix, M, atol=1e-14)
    assert dyn.check_inertia_matrix(lambda p: robot_of(numbers).state(p).mass_matrix, arm.n, samples=5)
    return M


def robot_of(arm):
    return cc.Robot(pinocchio_model(arm))


# ---------------------------------------------------------------- energy, factorisations, time scaling


@example("r2-2020-04-15-q5")
def _(given):
    """The rate of the energy needs no mass: any planar 3R on a horizontal plane."""
    state = cc.planar([1.0, 0.8, 0.6]).state(real(given["q"]), real(given["qdot"]))
    return {"Edot": dyn.energy_rate(state, given["u"])}


@example("r2-2020-04-15-q6")
def _(given):
    a, point = "a1 a2 a3".split(), given["check_point_chosen_here"]
    e = dyn.from_inertia_matrix([[f"{a[0]} + {a[1]}*sin(q2)^2 + {a[2]}*cos(q2)^2", 0], [0, "a4"]])
    where = dict(zip([*map(str, e.q), *map(str, e.dq)], [0.0, point["q2"], *point["dq"]], strict=True))
    where |= dict(zip(a, point["a"], strict=True)) | {"a4": 0.5}

    def at(matrix):
        return np.array(matrix.subs(where), dtype=float)

    plain = at(e.M_dot - 2 * e.S_plain)
    assert np.abs(plain + plain.T).max() > 0.1 and abs(point["dq"] @ plain @ point["dq"]) < 1e-15
    np.testing.assert_allclose(at(e.S_plain * e.dq), at(e.c), atol=1e-15)
    numeric = e.numeric(**dict(zip(a, point["a"], strict=True)), a4=0.5)
    np.testing.assert_allclose(numeric.S([0.0, point["q2"]], point["dq"]), at(e.S), atol=1e-15)
    return {"N_at_point": at(e.M_dot - 2 * e.S)}


@example("r2-2020-04-15-q9")
def _(given):
    """A swing-up from hanging, accelerating and braking at the full rate: sampled, then scaled."""
    m, d, T, U = (float(given[k]) for k in ("m", "d", "T", "U"))
    link = Link("R", a=d, mass=m, inertia=(0, 0, given["I"] - m * d * d))  # I is about the joint
    robot = robot_of(dyn.DHArm([link], gravity=(given["g0"], 0, 0)))
    A = 4 * math.pi / T**2
    t = np.linspace(0.0, T, 2001)[:, None]
    a = np.where(t < T / 2, A, -A)
    q = np.where(t < T / 2, A * t**2 / 2, math.pi - A * (T - t) ** 2 / 2)
    v = np.where(t < T / 2, A * t, A * (T - t))
    a = np.vstack([a, [A]])  # both accelerations at the switch, where gravity is largest
    q, v = np.vstack([q, [math.pi / 2]]), np.vstack([v, [A * T / 2]])
    torque, static = dyn.motion_torques(robot, q, v, a)
    found = dyn.time_scaling(torque, static, [U])
    assert found.slows_down and q[found.sample, 0] == pytest.approx(math.pi / 2)
    return {"A": A, "u_gmax": static.max(), "u_max": torque.max(), "k": found.factor, "T_new": found.factor * T}


@example("r2-2020-07-15-ex4")
def _(given):
    """Two instants of a motion of a hanging 2R, each with one torque too large."""
    L, m, T = given["l"], given["m"], given["T"]
    links = [Link("R", a=L, mass=m, com=(-L / 2, 0, 0), inertia=(0, 0, m * L**2 / 12)) for _ in range(2)]
    robot = robot_of(dyn.DHArm(links, gravity=(given["g0"], 0, 0)))
    g = np.array([robot.state(real(given[k])).gravity for k in ("q_t1", "q_t2")])
    # the other joint's torque at each instant is not given: it is at rest with gravity
    torque = np.array([[given["tau1_t1"], g[0, 1]], [g[1, 0], given["tau2_t2"]]])
    each = [dyn.time_scaling(torque[i], g[i], given["taumax"]).factor for i in range(2)]
    found = dyn.time_scaling(torque, g, given["taumax"])
    assert (found.sample, found.joint) == (1, 1)
    return {
        "g1": g[0, 0],
        "g2": g[1, 1],
        "k1": each[0],
        "k2": each[1],
        "T_new": T * found.factor,
        "tau1_new": found.torque[0, 0],
        "tau2_new": found.torque[1, 1],
    }


@example("r2-2021-04-14-ex3")
def _(given):
    """A PR arm whose slide is held: 2 alpha in least time, passing where the link points along the slide. I is that
    about the joint."""
    d, U = given["dc2"], given["U"]
    arm = dyn.DHArm(
        [
            Link("P", alpha="-pi/2", mass="m1"),
            Link("R", a="l2", mass="m2", com=("d - l2", 0, 0), inertia=(0, 0, "I - m2*d^2")),
        ],
        gravity=(0, 0, 0),
    )
    e = dyn.euler_lagrange(arm).numeric(m1=given["m1"], m2=given["m2"], d=d, I=given["I"])
    A = U[1] / e.M([0.0, 0.0])[1, 1]
    T = 2 * math.sqrt(2 * real(given["alpha"]) / A)
    u = e.torque([0.0, -math.pi / 2], [0.0, A * T / 2], [0.0, A])
    assert u[1] == pytest.approx(U[1]) and abs(u[0]) < U[0]
    return {"A2max": A, "T": T, "u1_mid": u[0]}


# ---------------------------------------------------------------- inertia matrices


@example("r2-2020-04-15-q7-q8")
def _(given):
    """PPR along y, then x: in joint coordinates, then at the tip, in (x, y, angle)."""
    p = given["check_point_chosen_here"]
    m, L, q = p["m"], p["l3"], real(p["q"])
    arm = dyn.DHArm(
        [  # z0 along y, z1 along x, z2 out of the plane, x2 along -y
            Link("P", alpha="pi/2", mass="m1"),
            Link("P", alpha="pi/2", theta="-pi/2", mass="m2"),
            Link("R", a="l", theta="pi/2", mass="m3", com=("d - l", 0, 0), inertia=(0, 0, "I3")),
        ]
    )
    M = three_ways(arm, q, m1=m[0], m2=m[1], m3=m[2], d=p["dc3"], l=L, I3=p["I3"])
    J = [[0.0, 1.0, -L * math.sin(q[2])], [1.0, 0.0, L * math.cos(q[2])], [0.0, 0.0, 1.0]]
    return {"M_at_point": M, "Mp_at_point": dyn.cartesian_inertia(J, M).matrix}


@example("r2-2019-04-29-ex2")
def _(given):
    """PRP: along y, about z, normal to link 2. The velocity terms as printed, too."""
    p = given["check_point_chosen_here"]
    m, L, d, (I2, I3), q = p["m"], p["l2"], p["dc2"], p["I"], real(p["q"])
    arm = dyn.DHArm(
        [
            Link("P", alpha="pi/2", mass="m1"),
            Link("R", a="l2", alpha="-pi/2", mass="m2", com=("dc2 - l2", 0, 0), inertia=(0, "I2", 0)),
            Link("P", mass="m3", inertia=(0, "I3", 0)),
        ],
        gravity=(0, 0, 0),
    )
    values = {"m1": m[0], "m2": m[1], "m3": m[2], "l2": L, "dc2": d, "I2": I2, "I3": I3}
    v = np.array([0.4, -0.7, 1.1])
    s2, c2, a3, a4 = math.sin(q[1]), math.cos(q[1]), m[2], m[1] * d
    printed = [
        -(a3 * (L * s2 + q[2] * c2) + a4 * s2) * v[1] ** 2 - 2 * a3 * s2 * v[1] * v[2],
        2 * a3 * q[2] * v[1] * v[2],
        -a3 * q[2] * v[1] ** 2,
    ]
    np.testing.assert_allclose(dyn.euler_lagrange(arm).numeric(**values).c(q, v), printed, atol=1e-14)
    return {"M_at_point": three_ways(arm, q, **values)}


@example("r2-2020-09-11-ex3")
def _(given):
    """An RP arm whose slide is normal to its first link: equally heavy in every direction, there."""
    q, L, d2 = given["q"], given["l1"], given["d2"]
    arm = dyn.DHArm(
        [
            Link("R", a="l1", alpha="pi/2", mass="m1", com=("d1 - l1", 0, 0), inertia=(0, "I1", 0)),
            Link("P", mass="m2", inertia=(0, "I2", 0)),
        ]
    )
    values = {"m1": given["m1"], "d1": given["d1"], "I1": given["I1"], "m2": given["m2"], "l1": L}
    M = three_ways(arm, q, I2=given["I2_that_reproduces"], **values)
    c, s, r = math.cos(q[0]), math.sin(q[0]), q[1] + d2
    return {"M": M, "Mp": dyn.cartesian_inertia([[r * c - L * s, s], [L * c + r * s, -c]], M).matrix}


@example("r2-2021-09-10-ex2")
def _(given):
    """Three equal thin rods: the toolkit's own planar arm is made of them."""
    robot = cc.planar([given["L"]] * 3, [given["m"]] * 3)
    state = robot.state(real(given["q"]))
    found = dyn.cartesian_inertia(state.jacobian("tool")[:2], state.mass_matrix)
    return {"M": state.mass_matrix, "Mp": found.matrix, "eig": found.inertias}


@example("r2-2017-03-29-ex1")
def _(given):
    p = given["check_point_chosen_here"]
    names = [[f"I{i}{a}" for a in "xyz"] for i in (1, 2, 3)]
    arm = dyn.DHArm(
        [
            Link("R", alpha="pi/2", d="L1", mass="m1", com=("A", "-F", 0), inertia=names[0]),
            Link("R", a="L2", mass="m2", com=("-C", 0, 0), inertia=names[1]),
            Link("R", a="L3", mass="m3", com=("-D", 0, "E"), inertia=names[2]),
        ]
    )
    values = {k: p[k] for k in "ACDEF"} | numbered("L", p["L"]) | numbered("m", p["m"]) | inertias(names, p["I"])
    level = arm.with_values(**(values | {"E": 0.0}))
    M = dyn.moving_frames(level, real(p["q"]), np.zeros(3)).mass_matrix
    assert np.abs(M[0, 1:]).max() < 1e-15  # block diagonal without the offset E
    return {"B_at_point": three_ways(arm, real(p["q"]), **values)}


@example("r2-2022-04-13-ex3")
def _(given):
    p = given["check_point_chosen_here"]
    names = [[f"I{i}{a}" for a in "xyz"] for i in (1, 2, 3)]
    arm = dyn.DHArm(
        [
            Link("R", a="l1", mass="m1", com=("dc1 - l1", 0, 0), inertia=names[0]),
            Link("R", alpha="pi/2", d="l2", mass="m2", com=(0, "dc2 - l2", 0), inertia=names[1]),
            Link("R", a="l3", mass="m3", com=("dc3 - l3", 0, 0), inertia=names[2]),
        ]
    )
    values = numbered("l", p["l"]) | numbered("dc", p["dc"]) | numbered("m", p["m"]) | inertias(names, p["I"])
    e = dyn.euler_lagrange(arm)
    assert e.text(e.M[0, 2]) == "-m3 l1 dc3 sin(q2) sin(q3)" and e.M[1, 2] == 0
    assert e.text(e.M[1, 1]) == "I2y + (I3y + m3 dc3^2) cos(q3)^2 + I3x sin(q3)^2"
    return {"M_at_point": three_ways(arm, real(p["q"]), **values)}


@example("r2-2023-04-19-ex4")
def _(given):
    """RPR: the slide turns with the first joint, about its own z."""
    p = given["check_point_chosen_here"]
    arm = dyn.DHArm(
        [
            Link("R", alpha="pi/2", d="l1", mass="m1", com=(0, "-dc1", 0), inertia=(0, "I1", 0)),
            Link("P", alpha="-pi/2", theta="pi/2", mass="m2", com=(0, "dc2", 0), inertia=("I2", 0, 0)),
            Link("R", a="l3", mass="m3", com=("dc3 - l3", 0, 0), inertia=("I3", "I3", "I3")),
        ]
    )
    values = {k: p[k] for k in ("l1", "l3", "I1", "I2", "I3")} | numbered("dc", p["dc"]) | numbered("m", p["m"])
    return {"M_at_point": three_ways(arm, real(p["q"]), **values)}


def numbered(name, values):
    return {f"{name}{i}": x for i, x in enumerate(values, start=1)}


def inertias(names, values):
    return {n: x for row, numbers in zip(names, values, strict=True) for n, x in zip(row, numbers, strict=True)}


# ---------------------------------------------------------------- whole arms


@example("mr-dynamics-3link")
def _(given):
    """Screw axes at the zero posture, one of them longer than 1: that joint turns faster than its coordinate."""
    model, parent, behind = pin.Model(), 0, pin.SE3.Identity()
    model.gravity = pin.Motion(real(given["g"]), np.zeros(3))
    home, length, screws = pin.SE3.Identity(), [], real(given["Slist_rows"])
    for i, (screw, step) in enumerate(zip(screws, ("M01", "M12", "M23"), strict=True)):
        omega, v = screw[:3], screw[3:]
        length.append(np.linalg.norm(omega))
        joint = pin.SE3(np.eye(3), np.cross(omega, v) / length[-1] ** 2)
        axis = pin.JointModelRevoluteUnaligned(omega / length[-1])
        parent = model.addJoint(parent, axis, behind.actInv(joint), f"joint{i}")
        home, behind = home * pin.SE3(np.array(given[step])), joint
        G = given["G_diag_inertia_then_mass"][i]
        model.appendBodyToJoint(parent, pin.Inertia(G[3], np.zeros(3), np.diag(G[:3])), joint.actInv(home))
    tip = behind.actInv(home * pin.SE3(np.array(given["M34"])))
    model.addFrame(pin.Frame("tip", parent, tip, pin.FrameType.OP_FRAME))
    robot, D = cc.Robot(model), np.array(length)
    state = robot.state(D * given["theta"], D * given["dtheta"])
    moment_force = real(given["Ftip_m_then_f"])
    wrench = state.rotation("tip") @ moment_force[3:], state.rotation("tip") @ moment_force[:3]
    M = D[:, None] * state.mass_matrix * D
    c, g = D * dyn.velocity_torques(state), D * dyn.gravity_torques(state)
    np.testing.assert_allclose(D * (dyn.coriolis(state) @ state.v), c, atol=1e-12)
    JtF = D * (state.jacobian("tip").T @ np.concatenate(wrench))
    return {"M": M, "c": c, "grav": g, "JtF": JtF, "tau": M @ given["ddtheta"] + c + g + JtF}


def puma(given):
    rows = zip(*(given[k] for k in ("alpha", "a", "d", "m", "r", "I_diag_at_com", "Jm", "G")), strict=True)
    links = [
        Link("R", alpha=alpha, a=a, d=d, mass=m, com=r, inertia=Ic, rotor=G * G * Jm)
        for alpha, a, d, m, r, Ic, Jm, G in rows
    ]
    return dyn.DHArm(links, gravity=(0, 0, -given["g"]))


@example("rtb-puma560-dynamics")
def _(given):
    """The arm with its motors; the torques at unit rate include friction on the motor side."""
    arm, q, one = puma(given), given["q"], np.ones(6)
    state = robot_of(arm).state(q, one)
    np.testing.assert_allclose(dyn.moving_frames(arm, q, one).mass_matrix, state.mass_matrix, atol=1e-13)
    gear = np.abs(given["G"])
    friction = gear**2 * given["B"] + gear * np.array(given["Tc"])[:, 0]
    c, g = dyn.velocity_torques(state), dyn.gravity_torques(state)
    return {
        "inertia": state.mass_matrix,
        "gravload": g,
        "rne_acc1": state.mass_matrix @ one + g,
        "rne_vel1_acc1": state.mass_matrix @ one + c + g + friction,
        "rne_vel1": c + g + friction,
    }


@example("rtb-puma560-opspace-inertia")
def _(given):
    state = robot_of(puma(ITEMS["rtb-puma560-dynamics"]["inputs"])).state(given["q"])
    return {"Mx": dyn.cartesian_inertia(state.jacobian("link6"), state.mass_matrix).matrix}


def test_the_arms_energy_in_symbols_is_the_numbers():
    """The first three links of the Puma with their motors, through Euler-Lagrange."""
    given = ITEMS["rtb-puma560-dynamics"]["inputs"]
    arm = dyn.DHArm(puma(given).links[:3], gravity=(0, 0, -given["g"]))
    e, robot = dyn.euler_lagrange(arm).numeric(), robot_of(arm)
    q, v, a = np.random.default_rng(0).normal(size=(3, 3))
    expected = pin.rnea(robot.model, robot.model.createData(), q, v, a)
    np.testing.assert_allclose(e.torque(q, v, a), expected, atol=1e-12 * np.abs(expected).max())
