"""Published exercises, continued: gradients, augmentation, task scaling, main variables and reverse priority.

Items of their own as in tests/test_worked_examples.py, and further methods on the items that are answered there.
"""

from __future__ import annotations

import math
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

from cartctl import Equation, Problem, Status, solve
from tests import oracles
from tests import tolerances as tol
from tests.test_worked_examples import pinv, planar_drift, rates
from tests.worked_examples import ITEMS, Answers, real

ANSWERS = Answers()
example, pytest_generate_tests = ANSWERS.example, ANSWERS.parametrize


def test_worked_example(identifier):
    ANSWERS.check(identifier)


def test_every_answer_has_its_item():
    assert set(every_answer()) <= set(ITEMS)


def test_every_item_is_answered_once():
    assert sorted(every_answer()) == sorted(ITEMS)


def every_answer():
    """The identifiers that the files of worked examples answer, with repetitions."""
    files = sorted(Path(__file__).parent.glob("test_worked_examples*.py"))
    return [name for file in files for name in getattr(import_module(f"tests.{file.stem}"), "ANSWERS", ())]


# ---------------------------------------------------------------- reduced gradient, extended Jacobian


@example("r2-2017-03-29-ex4")
def _(given):
    """Planar 3R: joints 1 and 3 do the task, joint 2 climbs H; then the tip of link 2 stays on a circle."""
    q, L = real(given["q"]), given["L"]
    J, v = oracles.planar_jacobian(L, q), real(given["v"])
    gradient = np.array([0.0, math.sin(2 * q[1]), math.sin(2 * q[2])])
    u = solve(Problem([(J, v)], reference=gradient), "reduced-gradient")
    assert u.status is Status.OPTIMAL
    slope = np.linalg.solve(J[:, [0, 2]], J[:, 1])  # of the basic joints with joint 2
    offset = oracles.planar_point(L, q, 2) - np.array(given["circle"]["center"])
    assert offset @ offset == pytest.approx(given["circle"]["R2"])
    added = (2.0 * offset @ oracles.planar_jacobian(L, q, 2))[None]
    return {
        "J": J,
        "minors": [np.linalg.det(np.delete(J, k, axis=1)) for k in range(3)],
        "Ja_inv": np.column_stack([rates("reduced-gradient", (J, e))[[0, 2]] for e in np.eye(2)]),
        "gradH": gradient,
        "reduced_gradient": gradient[1] - slope @ gradient[[0, 2]],
        "dq_RG": u.u,
        "Je": np.vstack([J, added]),
        "dq_ext": rates("extended-jacobian", (J, v), (added, [0.0])),
        "dq_ext_second": rates("extended-jacobian", (J, real(given["v_second"])), (added, [0.0])),
    }


def test_block_inversion_is_a_square_solve():
    """Mid-arm and tip velocities of a planar 4R fill the Jacobian."""
    item = ITEMS["r1-2016-02-04-ex3"]
    given, q = item["inputs"], real(item["inputs"]["q"])
    middle, tip = oracles.planar_jacobian(given["L"], q, 2), oracles.planar_jacobian(given["L"], q)
    for name in ("extended-jacobian", "task-priority", "reverse-priority", "main-variables", "reduced-gradient"):
        u = rates(name, (middle, given["vM"]), (tip, given["vE"]))
        np.testing.assert_allclose(u, item["expected"]["dq"], atol=item["tolerance"])


def test_reduced_over_projected_gradient_on_a_ppr():
    """The PPR of the units example: 1 + l^2, in the unit of l; the two slides are the minor while l < 1."""
    given = ITEMS["r2-2018-04-26-ex4"]["inputs"]
    q3 = real(given["q3"])
    for length in (0.5, given["l_m"]):
        J = np.array([[1.0, 0.0, -length * math.sin(q3)], [0.0, 1.0, length * math.cos(q3)]])
        p = Problem([(J, [0.0, 0.0])], reference=[0.0, 0.0, 1.0])
        reduced, projected = solve(p, "reduced-gradient").u, solve(p, "projected-gradient").u
        if max(abs(J[:, 2])) < 1.0:
            np.testing.assert_allclose(reduced, (1.0 + length**2) * projected, atol=tol.EXACT)


# ---------------------------------------------------------------- task scaling


@example("slides-sns-4R")
def _(given):
    """Planar 4R under symmetric speed limits: all joints slowed alike."""
    J, limit = oracles.planar_jacobian(given["L"], real(given["q"])), np.array(given["Vmax"], dtype=float)
    scaled = solve(Problem([(J, given["xdot"])], lower=-limit, upper=limit), "task-scaling")
    assert scaled.status is Status.SCALED
    assert scaled.saturated.tolist() == [1, 0, 0, 0]
    return {
        "J": J,
        "dq_pinv": rates("pinv", (J, given["xdot"])),
        "scale_direct": scaled.scales[0],
        "dq_scaled": scaled.u,
    }


@example("r2-2018-07-11-ex2")
def _(given):
    """A planar 4R at rest under acceleration bounds."""
    J, limit = oracles.planar_jacobian(given["L"], real(given["q"])), np.array(given["Amax"], dtype=float)
    scaled = solve(Problem([(J, given["a"])], lower=-limit, upper=limit), "task-scaling")
    assert scaled.saturated.tolist() == [0, 0, 0, 1]
    return {
        "J": J,
        "pinv": pinv(J),
        "ddq_pinv": rates("pinv", (J, given["a"])),
        "scale_needed_pinv": 1.0 / scaled.scales[0],
        "ddq_scaled": scaled.u,
        "a_scaled": J @ scaled.u,
    }


@example("r2-2021-09-10-ex1")
def _(given):
    """The hardest braking along the tip's velocity: pdd = -lambda pd, lambda a share of a command that is too much."""
    q, limit, most = real(given["q"]), real(given["Umax"]), 1e3
    J, answers, feasible = oracles.planar_jacobian(given["L"], q), {}, {}
    for k, rate in enumerate(given["qd"], start=1):
        v = real(rate)
        drift = planar_drift(given["L"], q, v)
        braking = Equation(J, -most * (J @ v), drift=drift)
        solution = solve(Problem([braking], lower=-limit, upper=limit), "task-scaling")
        feasible[k] = solution.status is not Status.INFEASIBLE
        answers |= {
            f"a{k}": rates("pinv", (J, -(J @ v))),
            f"b{k}": rates("pinv", (J, -drift)),
            f"lam{k}": most * solution.scales[0],
            f"u{k}": solution.u,
            f"pdd{k}": J @ solution.u + drift,
        }
    assert feasible == {1: True, 2: False, 3: False}  # case 2 as a linear programme, see the note
    return answers | {"case3_feasible": float(feasible[3])}


@example("r2-2021-07-12-ex1")
def _(given):
    """A tip kept from accelerating: drift alone, which no scaling slows."""
    limit, answers = real(given["Umax"]), {}
    for k in range(1, 5):
        q, v = real(given[f"case{k}"]["q"]), real(given[f"case{k}"]["qd"])
        J, drift = oracles.planar_jacobian(given["L"], q), planar_drift(given["L"], q, v)
        hold = Equation(J, np.zeros(2), drift=drift)
        u = solve(Problem([hold]), "pinv")
        bounded = solve(Problem([hold], lower=-limit, upper=limit), "task-scaling")
        assert (u.status is Status.SINGULAR) == (k > 2)
        assert (bounded.status is Status.INFEASIBLE) == (k <= 2)
        answers |= {f"h{k}": drift, f"u{k}": u.u, f"p{k}dd": J @ u.u + drift}
        if k == 1:
            answers["pinv"] = pinv(J)
    return answers


# ---------------------------------------------------------------- dependent rows


def test_main_variables_of_dependent_rows():
    """The second row is L times the third: a command that respects it is the pseudo-inverse's, another drops a row."""
    item = ITEMS["r1-2021-09-10-ex1"]
    L = item["inputs"]["check_point_chosen_here"]["L"]
    J = np.array([[1.0, -L, 0.0], [0.0, L, L], [0.0, 1.0, 1.0]])
    consistent = solve(Problem([(J, [0.0, L, 1.0])]), "main-variables")
    np.testing.assert_allclose(consistent.u, item["expected"]["dq11"], atol=1e-3)
    np.testing.assert_allclose(consistent.residuals, 0.0, atol=tol.EXACT)
    command = np.array([1.0, 0.0, 1.0])
    other = solve(Problem([(J, command)]), "main-variables")
    missed = J @ other.u - command
    assert other.status is Status.SINGULAR and np.count_nonzero(np.abs(missed) > 1e-9) == 1
    assert other.residuals[0] == pytest.approx(np.linalg.norm(missed)) and abs(missed[0]) < 1e-9


def test_main_variables_at_a_singularity_that_is_executed_exactly():
    """PRRR, tip and an angle: rank lost, command consistent."""
    item = ITEMS["r2-2020-07-15-ex2"]
    given = item["inputs"]
    q = real(given["qs"])
    c, s = np.cos(q[1:]), np.sin(q[1:])
    J = np.array([[1.0, *(-s * given["L"])], [0.0, *(c * given["L"])], [0.0, 1.0, 0.0, 0.0]])
    solution = solve(Problem([(J, given["rdots"])]), "main-variables")
    tolerance = item["tolerance"]
    tolerance = tolerance.get("dqs", tolerance["*"]) if isinstance(tolerance, dict) else tolerance
    np.testing.assert_allclose(solution.u, item["expected"]["dqs"], atol=tolerance)
    assert solution.status is Status.SINGULAR


# ---------------------------------------------------------------- priorities


@pytest.mark.parametrize("case", ["a", "b"])
def test_all_priority_methods_keep_the_tip(case):
    """Tip over mid-arm: in case b the second task repeats the first; no method may explode or leave the tip."""
    item = ITEMS["r2-2022-06-10-ex2"]
    given, q = item["inputs"], real(item["inputs"][f"q_{case}"])
    tip, middle = oracles.planar_jacobian(given["L"], q), oracles.planar_jacobian(given["L"], q, 2)
    p = Problem([(tip, given["v1"]), (middle, given["v2"])])
    strict = solve(p, "task-priority")
    for name in ("singularity-robust-priority", "reverse-priority"):
        solution = solve(p, name)
        assert solution.residuals[0] < 1e-9 and np.linalg.norm(solution.u) < 1e3
        assert solution.residuals[1] >= strict.residuals[1] - 1e-9


def test_an_orientation_over_a_tip_velocity_in_conflict():
    """Reverse priority meets the higher task too; the lower one cannot do better than under strict priority."""
    given = ITEMS["r2-2020-04-15-q4"]["inputs"]
    first, second = np.ones((1, 3)), oracles.planar_jacobian(given["L"], real(given["q"]))
    p = Problem([(first, [given["v_orient"]]), (second, given["v_tip"])])
    strict, reverse = solve(p, "task-priority"), solve(p, "reverse-priority")
    assert reverse.residuals[0] < tol.ORACLE
    assert reverse.residuals[1] >= strict.residuals[1] - tol.ORACLE
