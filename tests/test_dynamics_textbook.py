"""Equations of motion in symbols: the textbooks' expressions and their print, character by character."""

from __future__ import annotations

import numpy as np
import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st

from cartctl import dynamics as dyn
from cartctl.dynamics.textbook import compact
from cartctl.dynamics.trigsum import Ground

Link = dyn.DHLink
DOWN = (0, "-g0", 0)

ARMS = {
    "planar 2R": dyn.DHArm(
        [
            Link("R", a="l1", mass="m1", com=("dc1 - l1", 0, 0), inertia=(0, 0, "I1")),
            Link("R", a="l2", mass="m2", com=("dc2 - l2", 0, 0), inertia=(0, 0, "I2")),
        ],
        DOWN,
    ),
    "planar RP": dyn.DHArm(
        [
            Link("R", alpha="pi/2", theta="pi/2", mass="m1", com=(0, 0, "dc1"), inertia=(0, "I1", 0)),
            Link("P", mass="m2", com=(0, 0, "-dc2"), inertia=(0, "I2", 0)),
        ],
        DOWN,
    ),
    "planar PR": dyn.DHArm(
        [
            Link("P", alpha="-pi/2", mass="m1"),
            Link("R", a="l2", mass="m2", com=("dc2 - l2", 0, 0), inertia=(0, 0, "I2")),
        ],
        ("g0", 0, 0),
    ),
    "planar 3R": dyn.DHArm(
        [Link("R", a=f"l{i}", mass=f"m{i}", com=(f"dc{i} - l{i}", 0, 0), inertia=(0, 0, f"I{i}")) for i in (1, 2, 3)],
        DOWN,
    ),
}
PRINTED = {
    "planar 2R": """
T1 = 1/2 (I1 + m1 dc1^2) dq1^2
T2 = 1/2 (I2 + m2 dc2^2) (dq1 + dq2)^2 + 1/2 m2 l1^2 dq1^2 + m2 l1 dc2 (dq1 + dq2) cos(q2) dq1
U1 = m1 dc1 g0 sin(q1)
U2 = m2 l1 g0 sin(q1) + m2 dc2 g0 sin(q1 + q2)
M11 = I1 + I2 + m1 dc1^2 + m2 (l1^2 + dc2^2) + 2 m2 l1 dc2 cos(q2)
M12 = I2 + m2 dc2^2 + m2 l1 dc2 cos(q2)
M22 = I2 + m2 dc2^2
c1 = -m2 l1 dc2 (2 dq1 + dq2) sin(q2) dq2
c2 = m2 l1 dc2 sin(q2) dq1^2
g1 = g0 (m1 dc1 + m2 l1) cos(q1) + m2 dc2 g0 cos(q1 + q2)
g2 = m2 dc2 g0 cos(q1 + q2)
""",
    "planar RP": """
T1 = 1/2 (I1 + m1 dc1^2) dq1^2
T2 = 1/2 m2 dq2^2 + 1/2 (I2 + m2 (q2 - dc2)^2) dq1^2
U1 = m1 dc1 g0 sin(q1)
U2 = m2 g0 (q2 - dc2) sin(q1)
M11 = I1 + I2 + m1 dc1^2 + m2 (q2 - dc2)^2
M12 = 0
M22 = m2
c1 = 2 m2 (q2 - dc2) dq1 dq2
c2 = -m2 (q2 - dc2) dq1^2
g1 = g0 (m1 dc1 + m2 (q2 - dc2)) cos(q1)
g2 = m2 g0 sin(q1)
""",
    "planar PR": """
T1 = 1/2 m1 dq1^2
T2 = 1/2 m2 dq1^2 + 1/2 (I2 + m2 dc2^2) dq2^2 - m2 dc2 cos(q2) dq1 dq2
U1 = 0
U2 = -m2 dc2 g0 cos(q2)
M11 = m1 + m2
M12 = -m2 dc2 cos(q2)
M22 = I2 + m2 dc2^2
c1 = m2 dc2 sin(q2) dq2^2
c2 = 0
g1 = 0
g2 = m2 dc2 g0 sin(q2)
""",
    "planar 3R": """
T1 = 1/2 (I1 + m1 dc1^2) dq1^2
T2 = 1/2 (I2 + m2 dc2^2) (dq1 + dq2)^2 + 1/2 m2 l1^2 dq1^2 + m2 l1 dc2 (dq1 + dq2) cos(q2) dq1
U1 = m1 dc1 g0 sin(q1)
U2 = m2 l1 g0 sin(q1) + m2 dc2 g0 sin(q1 + q2)
U3 = m3 l1 g0 sin(q1) + m3 l2 g0 sin(q1 + q2) + m3 dc3 g0 sin(q1 + q2 + q3)
M13 = I3 + m3 dc3^2 + m3 l2 dc3 cos(q3) + m3 l1 dc3 cos(q2 + q3)
M22 = I2 + I3 + m2 dc2^2 + m3 (l2^2 + dc3^2) + 2 m3 l2 dc3 cos(q3)
M23 = I3 + m3 dc3^2 + m3 l2 dc3 cos(q3)
M33 = I3 + m3 dc3^2
c3 = m3 l2 dc3 (dq1 + dq2)^2 sin(q3) + m3 l1 dc3 sin(q2 + q3) dq1^2
g3 = m3 dc3 g0 cos(q1 + q2 + q3)
""",
    "spatial 3R": """
M11 = I1y + m1 A^2 + m3 E^2 + (I2y + m2 (L2 - C)^2 + m3 L2^2) cos(q2)^2 + I2x sin(q2)^2 + \
(I3y + m3 (L3 - D)^2) cos(q2 + q3)^2 + I3x sin(q2 + q3)^2 + 2 m3 L2 (L3 - D) cos(q2) cos(q2 + q3)
M12 = -m3 L2 E sin(q2) - m3 E (L3 - D) sin(q2 + q3)
M13 = -m3 E (L3 - D) sin(q2 + q3)
M22 = I2z + I3z + m2 (L2 - C)^2 + m3 (L2^2 + (L3 - D)^2) + 2 m3 L2 (L3 - D) cos(q3)
M23 = I3z + m3 (L3 - D)^2 + m3 L2 (L3 - D) cos(q3)
M33 = I3z + m3 (L3 - D)^2
g1 = 0
g3 = m3 g0 (L3 - D) cos(q2 + q3)
""",
}
ARMS["spatial 3R"] = dyn.DHArm(
    [
        Link("R", alpha="pi/2", d="L1", mass="m1", com=("A", "-F", 0), inertia=("I1x", "I1y", "I1z")),
        Link("R", a="L2", mass="m2", com=("-C", 0, 0), inertia=("I2x", "I2y", "I2z")),
        Link("R", a="L3", mass="m3", com=("-D", 0, "E"), inertia=("I3x", "I3y", "I3z")),
    ],
    (0, 0, "-g0"),
)


@pytest.mark.parametrize("name", ARMS)
def test_the_print_is_the_textbooks(name):
    printed = str(dyn.euler_lagrange(ARMS[name])).splitlines()
    for line in PRINTED[name].strip().splitlines():
        assert line in printed, "\n".join(printed)
    if name in ("planar 2R", "planar RP", "planar PR"):  # of the others, the lines that books print alike
        assert printed == PRINTED[name].strip().splitlines()


@pytest.mark.parametrize("name", ARMS)
def test_the_terms_are_those_of_lagranges_equation(name):
    """d/dt (dL/d dq) - dL/dq, literally, from T and U; M_dot - 2 S skew; T = 1/2 dq^T M dq."""
    e = dyn.euler_lagrange(ARMS[name])
    L = e.T - e.U
    values = {s: sympy.Rational(k + 3, 7) for k, s in enumerate(sorted(L.free_symbols - set(e.q) - set(e.dq), key=str))}
    L = L.xreplace(values)
    for i in range(e.n):
        p = L.diff(e.dq[i])
        left = sum(p.diff(e.q[k]) * e.dq[k] + p.diff(e.dq[k]) * e.ddq[k] for k in range(e.n)) - L.diff(e.q[i])
        point = {s: sympy.Float(0.3 + 0.17 * k) for k, s in enumerate([*e.q, *e.dq, *e.ddq])}
        assert abs((left - e.torque[i].xreplace(values)).subs(point).evalf(30)) < 1e-14
    N = (e.M_dot - 2 * e.S).xreplace(values)
    plain = (e.M_dot - 2 * e.S_plain).xreplace(values)
    assert (N + N.T).subs(point).norm() < 1e-14
    assert (e.S_plain * e.dq - e.c).xreplace(values).subs(point).norm() < 1e-14
    assert (plain + plain.T).subs(point).norm() > 1e-2
    assert sympy.expand(((e.dq.T * e.M * e.dq)[0] / 2 - e.T).xreplace(values).subs(point)) == pytest.approx(
        0, abs=1e-14
    )


def test_given_an_inertia_matrix():
    """The polar arm: both factorisations as they are printed in the exercise."""
    e = dyn.from_inertia_matrix([["a1 + a2*sin(q2)^2 + a3*cos(q2)^2", 0], [0, "a4"]])
    assert str(e).splitlines()[2:7] == [
        "M11 = a1 + a3 cos(q2)^2 + a2 sin(q2)^2",
        "M12 = 0",
        "M22 = a4",
        "c1 = (a2 - a3) sin(2 q2) dq1 dq2",
        "c2 = -1/2 (a2 - a3) sin(2 q2) dq1^2",
    ]
    assert e.text(e.S[0, 1]) == "1/2 (a2 - a3) sin(2 q2) dq1" and e.text(e.S_plain[0, 1]) == "0"
    assert e.text(e.C[1][0, 0]) == "-1/2 (a2 - a3) sin(2 q2)"
    pendulum = dyn.from_inertia_matrix([["I"]], U="-m*g0*d*cos(q1)")
    assert pendulum.text(pendulum.g[0]) == "d g0 m sin(q1)"


def test_latex():
    text = dyn.euler_lagrange(ARMS["planar 2R"]).latex()
    assert "M_{12} &=" in text and r"\dot{q}_{1}" in text and r"\cos{\left(q_{2} \right)}" in text


def test_coordinates_as_lengths_and_as_angles_at_once():
    """A cam: q1 both slides and turns; both count in the derivatives."""
    e = dyn.from_inertia_matrix([["m*(1 + q1*sin(q1))"]])
    q, dq, m = e.q[0], e.dq[0], sympy.Symbol("m")
    assert sympy.expand(e.c[0] - m * (sympy.sin(q) + q * sympy.cos(q)) * dq**2 / 2) == 0


SYMBOLS = sympy.symbols("a b q1 q2 q3")


@st.composite
def polynomials(draw):
    """Sums of products of powers of sines and cosines of q1, q2, q3, q1 + q2, 2 q3 with symbols and fractions."""
    a, b, q1, q2, q3 = SYMBOLS
    atoms = [f(x) for x in (q1, q2, q3, q1 + q2, 2 * q3 - q1) for f in (sympy.sin, sympy.cos)] + [a, b, sympy.S.One]
    total = sympy.S.Zero
    for _ in range(draw(st.integers(1, 6))):
        term = sympy.Rational(draw(st.integers(-6, 6)), draw(st.integers(1, 4)))
        for _ in range(draw(st.integers(0, 4))):
            term *= draw(st.sampled_from(atoms))
        total += term
    return total


@given(polynomials())
@settings(max_examples=150, deadline=None)
def test_compact_is_the_same_function(total):
    ground = Ground([total])
    found = compact(ground.convert(total))
    f, g = (sympy.lambdify(SYMBOLS, x) for x in (total, found))
    for point in np.random.default_rng(0).normal(size=(4, 5)):
        assert f(*point) == pytest.approx(g(*point), abs=1e-10)
    derivative, slope = ground.convert(total).diff(SYMBOLS[3]), total.diff(SYMBOLS[3])
    f, g = (sympy.lambdify(SYMBOLS, x) for x in (slope, compact(derivative)))
    assert f(*point) == pytest.approx(g(*point), abs=1e-10)


def test_equal_means_equal():
    q = sympy.symbols("q1 q2")
    c, s = sympy.cos, sympy.sin
    ground = Ground([])
    assert not ground.convert(s(q[0]) ** 2 + c(q[0]) ** 2 - 1)
    assert not ground.convert(c(q[0] + q[1]) - c(q[0]) * c(q[1]) + s(q[0]) * s(q[1]))
    assert not ground.convert(s(q[0] + sympy.pi / 2) - c(-q[0]))
    assert ground.convert(c(3 * q[0])) == ground.convert(4 * c(q[0]) ** 3 - 3 * c(q[0]))
    assert ground.convert(c(q[0])) != ground.convert(c(q[1]))
