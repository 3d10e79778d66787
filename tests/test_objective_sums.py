"""Weighted sums and functions of the user's own."""

from __future__ import annotations

import numpy as np
import pytest

import cartctl as cc
from cartctl.errors import NonFiniteError, ParameterError, ShapeError
from tests.objectives_for_tests import SIX


def state_of(name: str, seed: int = 1) -> cc.State:
    robot, rng = SIX[name](), np.random.default_rng(seed)
    return robot.state(robot.random_configuration(rng), rng.normal(size=robot.nv))


@pytest.mark.parametrize("name", list(SIX))
def test_a_sum_asks_for_the_sum(name: str) -> None:
    """Of what each asks for alone, gains and senses included; and its value falls along it."""
    state = state_of(name)
    low, high = cc.Posture(gain=0.7), cc.Manipulability(axes="xy", gain=3.0)
    both = 2.0 * low + high * 0.5
    assert isinstance(both, cc.WeightedSum) and not both.maximise and both.gain == 1.0
    expected = 2.0 * low.direction(state) + 0.5 * high.direction(state)
    np.testing.assert_allclose(both.direction(state), expected, rtol=1e-12, atol=1e-15)
    assert both.value(state) == pytest.approx(2.0 * 0.7 * low.value(state) - 0.5 * 3.0 * high.value(state))
    robot = state.robot
    ahead = robot.state(robot.integrate(state.q, 1e-5 * both.direction(state)))
    assert both.value(ahead) < both.value(state)


def test_the_arithmetic() -> None:
    state = state_of("panda")
    a, b, c = cc.JointRange(), cc.Manipulability(), cc.Posture()
    ga, gb, gc = (o.direction(state) for o in (a, b, c))
    for made, expected in (
        (a + b, ga + gb),
        (a - b, ga - gb),
        (-a, -ga),
        (3 * (a - 2.0 * b) + c, 3 * ga - 6 * gb + gc),
        (cc.WeightedSum([(0.5, a), (0.25, b + c)]), 0.5 * ga + 0.25 * (gb + gc)),
        (a * 2 * 3, 6 * ga),
        (np.float64(2.0) * a + np.int64(3) * b, 2 * ga + 3 * gb),
    ):
        np.testing.assert_allclose(made.direction(state), expected, rtol=1e-12, atol=1e-15)
        assert all(not isinstance(o, cc.WeightedSum) for _, o in made.terms)
    np.testing.assert_allclose((2 * a + c).hessian(state), 2 * 100.0 * a.hessian(state) + c.hessian(state), atol=1e-9)
    assert repr(2 * cc.Posture(gain=3.0) - a).startswith(
        "2 * Posture(target=None, weights=None, gain=3.0) + -1 * Joint"
    )


def test_a_sum_in_a_controller_is_checked_part_by_part() -> None:
    robot = SIX["panda"]()
    with pytest.raises(ShapeError, match=r"weights has shape \(6,\)"):
        objective = cc.JointRange() + cc.Posture(weights=np.ones(6))
        cc.Controller(robot, cc.FrameTask(robot.tool), "projected-gradient", objective=objective, limits=None)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: cc.WeightedSum([]), "terms is empty"),
        (lambda: cc.WeightedSum([(1.0, "posture")]), r"terms\[0\]\[1\] is a str; expected an Objective"),
        (lambda: cc.WeightedSum([("a", cc.Posture())]), r"terms\[0\]\[0\] is 'a'"),
        (lambda: cc.Posture() * "2", r"terms\[0\]\[0\] is '2'"),
    ],
)
def test_misuse_of_sums(make, words: str) -> None:
    with pytest.raises(ParameterError, match=words):
        make()


def test_a_sum_with_something_else_is_a_type_error() -> None:
    with pytest.raises(TypeError):
        cc.Posture() + 1.0
    with pytest.raises(TypeError):
        cc.Posture() - "x"
    with pytest.raises(ShapeError, match=r"terms\[0\] has 3 entries"):
        cc.WeightedSum([(1.0, cc.Posture(), 2.0)])


# ---------------------------------------------------------------- functions


@pytest.mark.parametrize("name", list(SIX))
def test_a_function_without_a_gradient_is_differenced(name: str) -> None:
    """Along the tangent space, continuous joints and bases included; the given gradient is taken as it is."""
    state = state_of(name)
    known = cc.FunctionObjective(lambda s: s.com[1], lambda s: s.com_jacobian[1])
    differenced = cc.FunctionObjective(lambda s: s.com[1])
    np.testing.assert_allclose(differenced.gradient(state), known.gradient(state), atol=1e-9)
    np.testing.assert_array_equal(known.gradient(state), state.com_jacobian[1])
    assert differenced.value(state) == state.com[1]


def test_up_and_down() -> None:
    state = state_of("panda")
    up = cc.FunctionObjective(lambda s: s.com[2], gain=2.0, maximise=True)
    down = cc.FunctionObjective(lambda s: s.com[2], gain=2.0)
    np.testing.assert_array_equal(up.direction(state), -down.direction(state))
    assert up.direction(state) @ state.com_jacobian[2] > 0.0
    assert repr(up) == "FunctionObjective(<lambda>, gain=2.0, maximise=True)"


@pytest.mark.parametrize(
    ("make", "error", "words"),
    [
        (lambda: cc.FunctionObjective(3.0), ParameterError, "value is 3.0; expected a function"),
        (lambda: cc.FunctionObjective(len, gradient=4), ParameterError, "gradient is 4; expected a function"),
        (lambda: cc.FunctionObjective(len, gain=0.0), ParameterError, "gain is 0"),
        (lambda: cc.FunctionObjective(len, maximise=1), ParameterError, "maximise is 1"),
    ],
)
def test_misuse_of_functions(make, error: type[Exception], words: str) -> None:
    with pytest.raises(error, match=words):
        make()


@pytest.mark.parametrize(
    ("objective", "error", "words"),
    [
        (cc.FunctionObjective(lambda s: s.com), ParameterError, "value is array"),
        (cc.FunctionObjective(lambda s: np.nan), NonFiniteError, "value is nan"),
        (cc.FunctionObjective(lambda s: 1.0, lambda s: np.ones(3)), ShapeError, r"gradient has shape \(3,\); .*\(7,\)"),
        (cc.FunctionObjective(lambda s: 1.0, lambda s: np.full(7, np.inf)), NonFiniteError, "gradient"),
    ],
)
def test_a_function_that_returns_something_else_is_refused_at_once(objective, error, words: str) -> None:
    robot = SIX["panda"]()
    with pytest.raises(error, match=words):
        cc.Controller(robot, cc.FrameTask(robot.tool), "projected-gradient", objective=objective, limits=None)
