"""Tables of Denavit-Hartenberg parameters: moving frames, Euler-Lagrange and Newton-Euler are one and the same."""

from __future__ import annotations

import math
import subprocess
import sys

import numpy as np
import pinocchio as pin
import pytest
import sympy

import cartctl as cc
from cartctl import dynamics as dyn
from cartctl.dynamics.dh_model import pinocchio_model
from cartctl.dynamics.expressions import expression, names, number
from cartctl.errors import NonFiniteError, ParameterError, ShapeError
from tests.arms_for_tests import body


def random_arm(seed: int, n: int, angles=(0.0, math.pi / 2, -math.pi / 2, None)) -> dyn.DHArm:
    """R and P mixed, offsets, bodies off their frames, rotors; alpha and theta at right angles or anywhere (None)."""
    rng = np.random.default_rng(seed)

    def angle():
        chosen = angles[int(rng.integers(len(angles)))]
        return float(np.round(rng.uniform(-3, 3), 3)) if chosen is None else chosen

    links = []
    for _ in range(n):
        solid = body(rng)
        links.append(
            dyn.DHLink(
                "RRP"[int(rng.integers(3))],
                a=round(rng.uniform(-0.5, 0.5), 3),
                alpha=angle(),
                d=round(rng.uniform(-0.5, 0.5), 3),
                theta=angle(),
                mass=solid.mass,
                com=np.round(solid.lever, 3),
                inertia=solid.inertia,
                rotor=round(rng.uniform(0.0, 0.2), 3),
            )
        )
    return dyn.DHArm(links, np.round(rng.normal(size=3) * 9.81, 3))


@pytest.mark.parametrize("seed", range(25))
def test_moving_frames_are_pinocchios_velocities_energies_and_mass_matrix(seed):
    """Also with prismatic links that turn with the joints before them."""
    arm = random_arm(seed, 1 + seed % 7)
    robot, rng = cc.Robot(pinocchio_model(arm)), np.random.default_rng(seed)
    state = robot.state(rng.normal(size=arm.n), rng.normal(size=arm.n))
    found = dyn.moving_frames(arm, state.q, state.v)
    np.testing.assert_allclose(found.mass_matrix, state.mass_matrix, atol=1e-13 * np.abs(state.mass_matrix).max())
    assert found.kinetic == pytest.approx(dyn.energy(state).kinetic, rel=1e-12)
    assert sum(link.kinetic for link in found.links) == pytest.approx(found.kinetic)
    for i, link in enumerate(found.links, start=1):
        R, twist = state.rotation(f"link{i}"), state.twist(f"link{i}")
        np.testing.assert_allclose(R @ link.linear, twist[:3], atol=1e-12)
        np.testing.assert_allclose(R @ link.angular, twist[3:], atol=1e-12)
        np.testing.assert_allclose(
            link.com, link.linear + np.cross(link.angular, np.array(arm.links[i - 1].com, float)), atol=1e-12
        )


def test_a_prismatic_link_behind_a_revolute_joint_turns_and_that_counts():
    arm = dyn.DHArm(
        [
            dyn.DHLink("R", alpha="pi/2", mass=1.0, inertia=(0.1, 0.1, 0.1)),
            dyn.DHLink("P", mass=2.0, com=(0, 0, -0.2), inertia=(0.3, 0.4, 0.5)),
        ]
    )
    found = dyn.moving_frames(arm, [0.7, 0.9], [1.5, 0.0])
    np.testing.assert_allclose(found.links[1].angular, [0.0, 1.5, 0.0], atol=1e-15)
    turning = 0.5 * 2.0 * (0.7 * 1.5) ** 2 + 0.5 * 0.4 * 1.5**2
    assert found.links[1].kinetic == pytest.approx(turning)  # without its rotation 0.5 * 2.0 * (0.7 * 1.5)^2 alone
    assert found.mass_matrix[0, 0] == pytest.approx(0.1 + 0.4 + 2.0 * 0.7**2)


@pytest.mark.parametrize("seed", range(12))
def test_euler_lagrange_is_newton_euler(seed):
    """Random tables of R and P joints: the equations, derived in symbols, give rnea's torques at random states."""
    arm = random_arm(seed, 1 + seed % 3, angles=(0.0, math.pi / 2, -math.pi / 2))
    symbols, robot = dyn.euler_lagrange(arm), cc.Robot(pinocchio_model(arm))
    equations, rng = symbols.numeric(), np.random.default_rng(seed)
    printed = sympy.lambdify([list(symbols.q), list(symbols.dq)], [symbols.M, symbols.c, symbols.g, symbols.S])
    for _ in range(5):
        q, v, a = rng.normal(size=(3, arm.n))
        state, data = robot.state(q, v), robot.model.createData()
        expected = pin.rnea(robot.model, data, q, v, a)
        size = np.abs(expected).max()
        assert np.abs(equations.torque(q, v, a) - expected).max() < 1e-12 * size
        np.testing.assert_allclose(equations.M(q), state.mass_matrix, atol=1e-13 * size)
        np.testing.assert_allclose(equations.c(q, v), dyn.velocity_torques(state), atol=1e-12 * size)
        np.testing.assert_allclose(equations.g(q), state.gravity, atol=1e-12 * size)
        np.testing.assert_allclose(equations.S(q, v), dyn.coriolis(state), atol=1e-12 * size)
        own = equations.M(q), equations.c(q, v), equations.g(q), equations.S(q, v)
        for shown, numbers in zip(printed(q, v), own, strict=True):  # what is printed is what is computed
            np.testing.assert_allclose(np.reshape(shown, numbers.shape), numbers, atol=1e-12 * size)
        energy = dyn.energy(state)
        assert equations.T(q, v) == pytest.approx(energy.kinetic, rel=1e-11)
        assert equations.U(q) == pytest.approx(energy.potential, rel=1e-11, abs=1e-11 * size)


@pytest.mark.parametrize(("seed", "n"), [(100, 2), (101, 2), (102, 3)])
def test_any_twist_angle(seed, n):
    """Angles that are no right ones stay exact, as cosines and sines of themselves."""
    arm = random_arm(seed, n, angles=(None,))
    equations, robot = dyn.euler_lagrange(arm).numeric(), cc.Robot(pinocchio_model(arm))
    q, v, a = np.random.default_rng(seed).normal(size=(3, n))
    expected = pin.rnea(robot.model, robot.model.createData(), q, v, a)
    np.testing.assert_allclose(equations.torque(q, v, a), expected, atol=1e-12 * np.abs(expected).max())


def test_names_get_values_at_any_time():
    """Symbols first, or numbers first: the same functions."""
    link = {"mass": "m", "com": ("-l/2", 0, 0), "inertia": (0, "m*l^2/12", "m*l^2/12"), "a": "l"}
    arm = dyn.DHArm([dyn.DHLink("R", alpha="beta", **link), dyn.DHLink("P", **link)], gravity=(0, "-g0", 0))
    values = {"m": 1.3, "l": 0.8, "g0": 9.81, "beta": 0.4}
    first, then = dyn.euler_lagrange(arm).numeric(**values), arm.with_values(**values)
    q, v, a = np.random.default_rng(0).normal(size=(3, 2))
    model = pinocchio_model(then)
    expected = pin.rnea(model, model.createData(), q, v, a)
    np.testing.assert_allclose(first.torque(q, v, a), expected, rtol=1e-12)
    np.testing.assert_allclose(dyn.euler_lagrange(then).numeric().torque(q, v, a), expected, rtol=1e-12)


# ---------------------------------------------------------------- formulas


def test_formulas_are_read_and_never_run():
    assert number("x", "-2*(a + 3)^2/pi + sqrt(4)", {"a": 1.0}) == pytest.approx(-32 / math.pi + 2)
    assert names("m1*dc1**2 + E*I*sin(q1)") == {"m1", "dc1", "E", "I", "q1"}
    assert expression("x", "E*I + 0.1").subs({sympy.Symbol("E"): 2, sympy.Symbol("I"): 3}) == sympy.Rational(61, 10)
    for text in (
        "__import__('os')",
        "a.b",
        "f(x)",
        "[1]",
        "a if b else c",
        "'text'",
        "a**b",
        "9**9999",
        "",
        "a b",
        "1j",
    ):
        with pytest.raises(ParameterError, match="expected a number or a formula"):
            dyn.DHLink("R", mass=text)
    with pytest.raises(ParameterError, match="2001 characters"):
        dyn.DHLink("R", mass="1" * 2001)
    assert names(dyn.DHLink("R", mass=sympy.Symbol("m") ** 2 / 3).mass) == {"m"}


def test_misuse_is_named():
    arm = dyn.DHArm([dyn.DHLink("R", a="l", mass="m")])
    for bad, error, text in (
        (lambda: dyn.DHLink("X"), ParameterError, "joint is 'X'"),
        (lambda: dyn.DHLink("R", mass=-1.0), ParameterError, "mass is -1"),
        (lambda: dyn.DHLink("R", a=math.inf), NonFiniteError, "a is inf"),
        (lambda: dyn.DHLink("R", com=(0, 0)), ShapeError, "com has 2"),
        (lambda: dyn.DHLink("R", inertia=[1.0, 2.0]), ShapeError, "inertia"),
        (lambda: dyn.DHLink("R", inertia=[[1, "x", 0], ["y", 1, 0], [0, 0, 1]]), ParameterError, "symmetric"),
        (lambda: dyn.DHArm([]), ParameterError, "links"),
        (lambda: dyn.DHArm([dyn.DHLink("R", a="dq1")]), ParameterError, "'dq1' stands in the table"),
        (lambda: arm.with_values(l=1.0), ParameterError, "'m'"),
        (lambda: arm.with_values(l=1.0, m=1.0, k=1.0), ParameterError, "'k'"),
        (lambda: dyn.DHArm([dyn.DHLink("R", a="1/l")]).with_values(l=0.0), ParameterError, "a of link 1"),
        (lambda: dyn.DHArm([dyn.DHLink("R", a="sqrt(l)")]).with_values(l=-1.0), ParameterError, "a of link 1"),
        (lambda: dyn.moving_frames(arm, [0.0], [0.0]), ParameterError, r"\['l', 'm'\]"),
        (lambda: pinocchio_model(arm), ParameterError, r"\['l', 'm'\]"),
        (lambda: dyn.euler_lagrange(arm).numeric(l=1.0), ParameterError, "m has no value"),
        (lambda: dyn.euler_lagrange(arm).numeric(l=1.0, m=1.0, k=2.0), ParameterError, "there is no k"),
        (lambda: dyn.from_inertia_matrix([["a", "b"]]), ShapeError, "square"),
        (lambda: dyn.from_inertia_matrix([["a + q3", 0], [0, "b"]]), ParameterError, "'q3' stands in M or U"),
        (lambda: dyn.from_inertia_matrix([["a", 0], [0, "b*dq1"]]), ParameterError, "'dq1' stands in M or U"),
        (lambda: dyn.from_inertia_matrix([["a"]], U="cos(q2)"), ParameterError, "coordinates q1 to q1"),
        (lambda: dyn.DHArm(None), ShapeError, "links is None"),
        (lambda: dyn.euler_lagrange("arm"), ParameterError, "arm is a str"),
        (lambda: dyn.moving_frames(3, [0.0], [0.0]), ParameterError, "arm is a int"),
        (lambda: dyn.euler_lagrange(arm).numeric(l=1.0, m=1.0).M([1e300]), ParameterError, r"q\[0\] is 1e\+300"),
        (lambda: dyn.euler_lagrange(arm).numeric(l=1.0, m=1.0).c([0.0], [1e200]), ParameterError, r"dq\[0\]"),
        (lambda: dyn.from_inertia_matrix([["a", "b"], ["c", "d"]]), ParameterError, "symmetric"),
    ):
        with pytest.raises(error, match=text):
            bad()


def test_without_sympy_numbers_work_and_symbols_say_what_to_install():
    code = """
import sys
sys.modules["sympy"] = None
import cartctl as cc
from cartctl.errors import MissingDependencyError
arm = cc.dynamics.DHArm([cc.dynamics.DHLink("R", a="l", mass="2*m", com=("-l/2", 0, 0))])
M = cc.dynamics.moving_frames(arm.with_values(l=2.0, m=1.5), [0.3], [1.0]).mass_matrix
assert abs(M[0, 0] - 3.0) < 1e-12, M
try:
    cc.dynamics.euler_lagrange(arm)
except MissingDependencyError as error:
    assert "cartctl[symbolic]" in str(error)
else:
    raise SystemExit("no error")
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
