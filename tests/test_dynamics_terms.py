"""Christoffel symbols, factorisations, energies and gravity of a robot: differences, identities, Pinocchio."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import cartctl as cc
from cartctl.dynamics.christoffel import KINDS, christoffel_of
from cartctl.errors import NonFiniteError, ParameterError, ShapeError, UnsupportedJoint
from tests.arms_for_tests import chain, generated, with_joint
from tests.robots_for_tests import ROBOTS, random_state

FIXED = {k: make for k, make in ROBOTS.items() if k != "talos"}
FIXED |= {"generated12": lambda: generated(3), "generated5": lambda: generated(4, 5)}
SKEW = 1e-10  # of M_dot - 2 S, per unit of M_dot
TURNING = [pin.JointModelPlanar, pin.JointModelSpherical, pin.JointModelFreeFlyer]


def states(name, count=5):
    robot, rng = FIXED[name](), np.random.default_rng(len(name))
    return [random_state(robot, rng) for _ in range(count)]


def relative(a, b):
    return np.abs(a - b).max() / max(np.abs(b).max(), 1e-9)


def skewness(N, size):
    return np.abs(N + N.T).max() / size


def differenced(state, step=1e-5):
    """dM/dq along every tangent coordinate, fourth order."""
    robot = state.robot

    def M(d):
        return robot.state(robot.integrate(state.q, d)).mass_matrix

    units = step * np.eye(robot.nv)
    return np.array([(8 * (M(e) - M(-e)) - (M(2 * e) - M(-2 * e))) / (12 * step) for e in units])


@pytest.mark.parametrize("name", [*FIXED, "talos"])
def test_mass_matrix_derivatives_are_the_differences(name):
    robot = (FIXED | ROBOTS)[name]()
    state = random_state(robot, np.random.default_rng(1))
    D = cc.dynamics.mass_matrix_derivatives(state)
    assert D.shape == (robot.nv,) * 3
    assert np.abs(D - differenced(state)).max() < 1e-8 * np.abs(state.mass_matrix).max()
    np.testing.assert_array_equal(D, D.transpose(0, 2, 1))


@pytest.mark.parametrize("joint", [*TURNING, pin.JointModelTranslation, lambda: pin.JointModelHX(0.3)])
def test_derivatives_at_joints_of_several_freedoms(joint):
    robot = with_joint(joint())
    rng = np.random.default_rng(2)
    q = pin.randomConfiguration(robot.model, -np.ones(robot.nq), np.ones(robot.nq))
    state = robot.state(q, rng.normal(size=robot.nv))
    assert relative(cc.dynamics.mass_matrix_derivatives(state), differenced(state)) < 1e-8
    S, M_dot = cc.dynamics.coriolis(state, "pinocchio"), cc.dynamics.mass_matrix_rate(state)
    assert relative(S @ state.v, cc.dynamics.velocity_torques(state)) < 1e-12
    assert skewness(M_dot - 2 * S, np.abs(M_dot).max()) < SKEW


@pytest.mark.parametrize("name", FIXED)
def test_every_factorisation_gives_the_velocity_torques(name):
    for state in states(name):
        c = state.nonlinear_effects - state.gravity
        symbols = cc.dynamics.christoffel(state)
        size = np.abs(c).max() + np.abs(state.gravity).max()  # c is a difference of torques of that size
        assert np.abs(np.array([state.v @ C @ state.v for C in symbols]) - c).max() < 1e-13 * size * state.robot.nv
        for kind in KINDS:
            assert np.abs(cc.dynamics.coriolis(state, kind) @ state.v - c).max() < 1e-13 * size * state.robot.nv
        np.testing.assert_allclose(cc.dynamics.velocity_torques(state), c)
        np.testing.assert_array_equal(symbols, symbols.transpose(0, 2, 1))


@pytest.mark.parametrize("name", ["panda", "kinova", "planar", "generated12", "generated5"])
def test_only_two_factorisations_leave_a_skew_symmetric_matrix(name):
    for state in states(name, 20):
        M_dot = cc.dynamics.mass_matrix_rate(state)
        S = {kind: cc.dynamics.coriolis(state, kind) for kind in KINDS}
        size = np.abs(M_dot).max()
        assert skewness(M_dot - 2 * S["christoffel"], size) < SKEW
        assert skewness(M_dot - 2 * S["pinocchio"], size) < SKEW
        assert relative(S["pinocchio"], S["christoffel"]) < SKEW
        rest = M_dot - 2 * S["plain"]
        assert skewness(rest, size) > 1e-2  # visibly not, and yet it does no work
        assert abs(state.v @ rest @ state.v) < 1e-12 * size * (state.v @ state.v)


def test_the_rate_is_the_change_of_the_mass_matrix_in_time():
    for name in ("panda", "kinova", "generated12"):
        state = states(name, 1)[0]
        robot, h = state.robot, 1e-5
        later, before = (robot.state(robot.integrate(state.q, s * h * state.v)).mass_matrix for s in (1, -1))
        assert relative(cc.dynamics.mass_matrix_rate(state), (later - before) / (2 * h)) < 1e-7


def test_the_first_joint_of_a_fixed_base_does_not_matter_to_the_mass_matrix():
    for name in ("panda", "generated12"):
        state = states(name, 1)[0]
        D = cc.dynamics.mass_matrix_derivatives(state)
        assert np.abs(D[0]).max() < 1e-13 * np.abs(D).max()


def test_symbols_of_a_function_of_ones_own():
    """A polar arm, M = diag(a1 + a2 s2^2 + a3 c2^2, a4)."""
    slope = 1.7 * np.sin(2 * 0.6)
    C = christoffel_of(np.array([np.zeros((2, 2)), np.diag([slope, 0.0])]))
    np.testing.assert_allclose(C, [[[0, slope / 2], [slope / 2, 0]], [[-slope / 2, 0], [0, 0]]])


# ---------------------------------------------------------------- what is refused


@pytest.mark.parametrize("joint", TURNING)
def test_no_symbols_where_velocities_are_no_rates(joint):
    robot = with_joint(joint())
    state = robot.state(robot.neutral, np.ones(robot.nv))
    for ask in (cc.dynamics.christoffel, cc.dynamics.coriolis, lambda s: cc.dynamics.coriolis(s, "plain")):
        with pytest.raises(UnsupportedJoint, match=r"joint1.*coriolis\(state, .pinocchio.\)"):
            ask(state)


def test_a_christoffel_formula_on_a_free_flyer_would_be_wrong():
    """The refusal is no formality: the formula misses the velocity torques."""
    robot = with_joint(pin.JointModelFreeFlyer())
    q = pin.randomConfiguration(robot.model, -np.ones(robot.nq), np.ones(robot.nq))
    state = robot.state(q, np.random.default_rng(0).normal(size=robot.nv))
    c = christoffel_of(cc.dynamics.mass_matrix_derivatives(state)) @ state.v @ state.v
    assert np.abs(c - cc.dynamics.velocity_torques(state)).max() > 0.1


@pytest.mark.parametrize(
    "joint",
    [
        pin.JointModelSphericalZYX,
        lambda: pin.JointModelComposite(pin.JointModelRX()),
    ],
)
def test_joints_pinocchio_differentiates_wrongly_are_refused(joint):
    robot = chain(np.random.default_rng(0), [pin.JointModelRY(), joint(), pin.JointModelRZ()])
    state = robot.state(np.full(robot.nq, 0.3), np.ones(robot.nv))
    for kind in KINDS:
        with pytest.raises(UnsupportedJoint, match="'joint1'.*split it"):
            cc.dynamics.coriolis(state, kind)


def test_mimic_joints_are_refused():
    model = chain(np.random.default_rng(0), [pin.JointModelRZ(), pin.JointModelRZ(), pin.JointModelRZ()]).model
    robot = cc.Robot(pin.transformJointIntoMimic(model, 2, 3, 1.5, 0.2))
    state = robot.state([0.3, 0.4], [0.5, 0.6])
    for kind in KINDS:
        with pytest.raises(UnsupportedJoint, match="'joint2'.*locked"):
            cc.dynamics.coriolis(state, kind)
    h = 1e-5  # what stays right: c = d/dt (M v) - dT/dq
    p, m = (robot.state(state.q + s * h * state.v).mass_matrix for s in (1, -1))
    slope = [
        (robot.state(state.q + e, state.v).mass_matrix - robot.state(state.q - e, state.v).mass_matrix) / (2 * h)
        for e in h * np.eye(2)
    ]
    c = (p - m) / (2 * h) @ state.v - 0.5 * np.array([state.v @ d @ state.v for d in slope])
    np.testing.assert_allclose(cc.dynamics.velocity_torques(state), c, atol=1e-7)


def test_misuse_is_named():
    state = states("planar", 1)[0]
    with pytest.raises(ParameterError, match="kind is 'skew'"):
        cc.dynamics.coriolis(state, "skew")
    with pytest.raises(ShapeError, match="torque"):
        cc.dynamics.energy_rate(state, [1.0])
    terms = ("christoffel", "coriolis", "mass_matrix_derivatives", "mass_matrix_rate", "velocity_torques")
    for name in (*terms, "energy", "gravity_torques"):
        with pytest.raises(ParameterError, match=r"state is a Robot; expected a State, such as robot.state"):
            getattr(cc.dynamics, name)(state.robot)
    with pytest.raises(ParameterError, match="state is a Robot"):
        cc.dynamics.energy_rate(state.robot, [1.0])
    with pytest.raises(NonFiniteError, match="gravity"):
        cc.dynamics.energy(state, gravity=[0.0, np.nan, 0.0])


# ---------------------------------------------------------------- energy


@pytest.mark.parametrize("name", [*FIXED, "talos"])
def test_energies_are_pinocchios(name):
    robot = (FIXED | ROBOTS)[name]()
    state = random_state(robot, np.random.default_rng(5))
    data, found = robot.model.createData(), cc.dynamics.energy(state)
    kinetic = pin.computeKineticEnergy(robot.model, data, state.q, state.v)
    potential = pin.computePotentialEnergy(robot.model, data, state.q)
    assert found.kinetic == pytest.approx(kinetic, rel=1e-12)
    assert found.potential == pytest.approx(potential, rel=1e-12, abs=1e-12)
    assert found.total == found.kinetic + found.potential


def test_rotor_inertia_is_part_of_the_kinetic_energy():
    model = generated(7, 4).model
    model.armature = np.array([0.5, 1.0, 1.5, 2.0])
    state = random_state(cc.Robot(model), np.random.default_rng(0))
    bare = random_state(generated(7, 4), np.random.default_rng(0))
    gain = cc.dynamics.energy(state).kinetic - cc.dynamics.energy(bare).kinetic
    assert gain == pytest.approx(0.5 * model.armature @ state.v**2)


@pytest.mark.parametrize("name", [*FIXED, "talos"])
def test_gravity_is_the_slope_of_the_potential_energy_in_every_direction(name):
    robot, rng = (FIXED | ROBOTS)[name](), np.random.default_rng(6)
    for field in [None, *(9.81 * rng.normal(size=(4, 3)))]:
        state = random_state(robot, rng)
        h, slope = 1e-5, np.empty(robot.nv)
        for k, e in enumerate(h * np.eye(robot.nv)):
            up, down = (robot.state(robot.integrate(state.q, s * e)) for s in (1, -1))
            slope[k] = (cc.dynamics.energy(up, field).potential - cc.dynamics.energy(down, field).potential) / (2 * h)
        g = cc.dynamics.gravity_torques(state, field)
        size = max(np.abs(g).max(), abs(cc.dynamics.energy(state, field).potential))
        assert np.abs(g - slope).max() < 1e-9 * max(size, 1.0)
        turned = robot.model.copy()
        turned.gravity = pin.Motion(state.robot.gravity if field is None else field, np.zeros(3))
        expected = pin.computeGeneralizedGravity(turned, turned.createData(), state.q)
        assert np.abs(g - expected).max() < 1e-12 * max(size, 1.0)


@pytest.mark.parametrize("name", ["panda", "kinova", "generated12"])
def test_the_energy_changes_by_the_work_of_the_torques(name):
    """E_dot = v^T u along a motion under wild torques: forward dynamics, RK4 with the work as one more state."""
    robot, rng = FIXED[name](), np.random.default_rng(8)
    model, data, h = robot.model, robot.model.createData(), 1e-4
    amplitude = rng.normal(size=robot.nv) * (1.0 + np.abs(robot.state(robot.home).gravity))

    def rate(q, v, t):
        u = amplitude * np.sin(7.0 * t + np.arange(robot.nv))
        return pin.aba(model, data, q, v, u), cc.dynamics.energy_rate(robot.state(q, v), u)

    q, v, t, work = robot.random_configuration(rng), 0.3 * rng.normal(size=robot.nv), 0.0, 0.0
    start, books = cc.dynamics.energy(robot.state(q, v)).total, []
    for _ in range(500):
        k = []
        for share, last in ((0.0, None), (0.5, 0), (0.5, 1), (1.0, 2)):
            dq = np.zeros(robot.nv) if last is None else share * h * k[last][0]
            dv = np.zeros(robot.nv) if last is None else share * h * k[last][1]
            a, power = rate(robot.integrate(q, dq), v + dv, t + share * h)
            k.append((v + dv, a, power))
        q = robot.integrate(q, h / 6 * (k[0][0] + 2 * k[1][0] + 2 * k[2][0] + k[3][0]))
        v = v + h / 6 * (k[0][1] + 2 * k[1][1] + 2 * k[2][1] + k[3][1])
        work += h / 6 * (k[0][2] + 2 * k[1][2] + 2 * k[2][2] + k[3][2])
        t += h
        books.append((cc.dynamics.energy(robot.state(q, v)).total - start, work))
    gained, worked = np.array(books).T
    assert np.abs(worked).max() > 1e-2  # there is something to book
    assert np.abs(gained - worked).max() < 1e-6 * np.abs(worked).max()
