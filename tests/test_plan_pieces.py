"""The parts of the planner, each against an independent way to the same numbers."""

from __future__ import annotations

import numpy as np
import pytest
import qpsolvers
import scipy.sparse as sp

import cartctl as cc
from cartctl.wholepath.banded import Factor
from cartctl.wholepath.blocks import Layout, Quadratic
from cartctl.wholepath.manifold import kernels, newton, project
from cartctl.wholepath.qp import Programmes, nearest
from cartctl.wholepath.resampled import joined, resampled
from cartctl.wholepath.rows import Rows
from cartctl.wholepath.selfmotion import curves
from cartctl.wholepath.sqp import layout_of
from cartctl.wholepath.trace import Trace
from tests.plans_for_tests import circle, setting, unprojected, wandering
from tests.robots_for_tests import kinova, panda

SEEDS = range(6)


def chain(rng: np.random.Generator, n: int, reach: int, around: bool) -> sp.csc_matrix:
    """Positive definite, neighbours up to ``reach`` apart, the ends neighbours if ``around``."""
    P = np.zeros((n, n))
    for k in range(n):
        at = [(k + j) % n for j in range(reach + 1)] if around else list(range(k, min(k + reach + 1, n)))
        a = rng.normal(size=len(at))
        P[np.ix_(at, at)] += np.outer(a, a)
    return sp.csc_matrix(P + 0.05 * np.eye(n))


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("around", [False, True])
def test_factorisations(seed: int, around: bool) -> None:
    rng = np.random.default_rng(seed)
    for n in (1, 2, 9, 10, 31):
        P, b = chain(rng, n, min(2, n - 1), around), rng.normal(size=n)
        factor = Factor.of(P)
        assert factor is not None
        assert np.allclose(factor.solve(b), np.linalg.solve(P.toarray(), b), rtol=1e-9, atol=1e-9)
        assert factor.L.shape[0] <= 6 or n < 10  # banded, closed or not
        assert Factor.of(P - 100.0 * sp.eye_array(n, format="csc")) is None


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("around", [False, True])
def test_programmes_are_those_of_an_exact_solver(seed: int, around: bool) -> None:
    """Three in a row, so that the second is warm: the same minimum as DAQP's, rows kept to 1e-6."""
    rng, n = np.random.default_rng(seed), 24
    programmes = Programmes()
    P, A = chain(rng, n, 1, around), sp.csr_matrix(sp.random(60, n, 0.2, rng=rng) + 0.01 * np.ones((60, n)))
    g, low, high = 3.0 * rng.normal(size=n), -rng.uniform(0.1, 1.0, 60), rng.uniform(0.1, 1.0, 60)
    for k in range(3):
        factor = Factor.of(P)
        step = programmes.solve(P, factor, g, A, low, high)
        exact = qpsolvers.solve_qp(
            P.toarray(), g, np.vstack([A.toarray(), -A.toarray()]), np.concatenate([high, -low]), solver="daqp"
        )
        cost = [0.5 * y @ P @ y + g @ y for y in (step.y, exact)]
        assert step.how.startswith("osqp")
        assert cost[0] == pytest.approx(cost[1], rel=1e-4, abs=1e-6)
        assert (A @ step.y <= high + 1e-4).all() and (A @ step.y >= low - 1e-4).all()
        g = g * (1.0 + 1e-3 * (k + 1))
    assert programmes.setups < programmes.calls  # the same rows: updated, not set up
    inside = programmes.solve(P, Factor.of(P), 1e-4 * g, A, low, high)
    assert inside.how == "direct" and np.allclose(P @ inside.y, -1e-4 * g, atol=1e-9)


@pytest.mark.parametrize("seed", SEEDS)
def test_the_way_back_inside(seed: int) -> None:
    """Zero where all rows can be kept; else the least squares of what is violated."""
    rng, n = np.random.default_rng(seed), 12
    P, A = chain(rng, n, 1, False), sp.csr_matrix(rng.normal(size=(20, n)))
    y = rng.normal(size=n)
    low, high = A @ y - 0.1, A @ y + 0.1
    found = nearest(P, A, low, high, 1e-9)
    assert (A @ found >= low - 1e-5).all() and (A @ found <= high + 1e-5).all()
    low, high = low + 3.0 * rng.normal(size=20), np.full(20, np.inf)
    low[:5], high[:5] = -np.inf, (A @ y - 5.0)[:5]

    def height(y):
        m = np.minimum(A @ y - low, 0.0) + np.maximum(A @ y - high, 0.0)
        return 0.5 * m @ m

    found = nearest(P, A, low, high, 1e-9)
    for _ in range(50):
        assert height(found) <= height(found + 0.01 * rng.normal(size=n)) + 1e-9


@pytest.mark.parametrize(("closed", "fixed"), [(False, False), (False, True), (True, False), (True, True)])
def test_reduction_to_the_free_directions(closed: bool, fixed: bool) -> None:
    rng, S, n, r = np.random.default_rng(3), 6, 4, 2
    full = Quadratic.zeros(S, n)
    full.g[:] = rng.normal(size=(S, n))
    full.H0[:] = [h + h.T for h in rng.normal(size=(S, n, n))]
    full.H1[:], full.H2[:] = rng.normal(size=(S - 1, n, n)), rng.normal(size=(S - 2, n, n))
    Z = np.array([np.linalg.qr(rng.normal(size=(n, r)))[0] for _ in range(S)])
    if closed:
        Z[-1] = Z[0]
    layout = Layout(S, r, closed, fixed)
    assert layout.size == r * (S - closed - fixed)
    H = layout.hessian(full, Z).toarray()
    assert np.allclose(H, H.T)
    for _ in range(3):
        y = rng.normal(size=layout.size)
        delta = layout.expand(Z, y)
        assert not fixed or not delta[0].any()
        assert not closed or np.array_equal(delta[0], delta[-1])
        whole = sum(d @ h @ d for d, h in zip(delta, full.H0, strict=True))
        whole += 2.0 * sum(a @ h @ b for a, h, b in zip(delta[:-1], full.H1, delta[1:], strict=True))
        whole += 2.0 * sum(a @ h @ b for a, h, b in zip(delta[:-2], full.H2, delta[2:], strict=True))
        assert y @ H @ y == pytest.approx(whole)
        assert layout.gradient(full, Z) @ y == pytest.approx(np.sum(full.g * delta))


@pytest.mark.parametrize("make", [panda, kinova, lambda: cc.load("panda", root_joint="planar")])
@pytest.mark.parametrize(("closed", "rest"), [(False, True), (False, False), (True, True), (True, False)])
def test_rows_are_the_derivatives_of_the_limits(make, closed: bool, rest: bool) -> None:
    robot, rng = make(), np.random.default_rng(4)
    n = robot.nv
    limits = robot.limits.replace(
        velocity_lower=-2.0, velocity_upper=3.0, acceleration_lower=-20.0,
        acceleration_upper=np.r_[np.inf, 15.0 * np.ones(n - 1)],
    )  # fmt: skip
    given = setting(robot, circle(robot, 0.1, axes="position"), limits=limits, closed=closed, rest=rest)
    Q, rows = wandering(given, rng, 0.05), Rows(limits, 1e-3)
    trace = unprojected(given, Q)
    layout = layout_of(trace)
    A, low, high = rows.linear(trace, layout)
    assert A.shape[0] == len(low) == len(rows.excess(trace))
    y, h = rng.normal(size=layout.size), 1e-6
    ends = []
    for sign in (1.0, -1.0):
        moved = unprojected(given, given.moved(Q, layout.expand(trace.Z, sign * h * y)))
        a, b = Rows(limits).linear(moved, layout)[1:]
        ends.append(np.where(np.isfinite(a), a, b))
    assert np.allclose(A @ y, -(ends[0] - ends[1]) / (2.0 * h), rtol=1e-5, atol=1e-5 * np.abs(A @ y).max())
    worst = rows.worst(trace)
    assert worst.excess == pytest.approx(rows.excess(trace).max())


@pytest.mark.parametrize("seed", SEEDS)
def test_newton_and_kernels(seed: int) -> None:
    robot, rng = panda(), np.random.default_rng(seed)
    given = setting(robot, circle(robot, 0.1))
    start = np.repeat(robot.home[None], given.size, axis=0) + 0.1 * rng.normal(size=(given.size, 7))
    found = project(given, start)
    assert found.met.all() and np.linalg.norm(found.E, axis=1).max() < 1e-8
    Z = kernels(found.J)
    assert Z.shape == (given.size, 7, 1)
    assert np.abs(found.J @ Z).max() < 1e-12 and np.allclose(np.einsum("kij,kil->kjl", Z, Z), 1.0)
    Q, met = newton(given, 3, start)
    assert met.all() and max(np.linalg.norm(given.errors(3, q)) for q in Q) < 1e-7


def test_self_motion_goes_round_and_finds_the_other_posture() -> None:
    """A 3R at an inner point: two closed curves, elbow up and down, of known length between neighbours."""
    robot = cc.planar([1.0, 1.0, 0.3])
    q0 = np.array([0.9, -2.0, 0.4])
    p0 = robot.state(q0).position("tool")
    path = cc.Line(p0, p0 + [0.1, 0.0, 0.0], duration=1.0)
    given = setting(robot, cc.FrameTask("tool", "xy", target=path), limits=None)
    l1 = np.arctan2(p0[1], p0[0])
    mirrored = np.array([2.0 * l1 - q0[0], -q0[1], -q0[2]])  # the same tip, every link the other way round
    grid = curves(given, 0, np.array([q0, mirrored, q0 + 1e-9]))
    assert sorted(set(grid.curve.tolist())) == [0, 1]
    for q in grid.Q:
        assert np.linalg.norm(robot.state(q).position("tool") - p0) < 1e-6
    for k in (0, 1):
        curve = grid.Q[grid.curve == k]
        steps = np.linalg.norm(given.shortest(np.diff(np.vstack([curve, curve[:1]]), axis=0)), axis=1)
        assert (steps < 0.7).all() and len(curve) > 20  # closed: the last one is a neighbour of the first one
        assert np.ptp(curve.sum(axis=1)) > 5.0  # the last link goes all the way round


def test_resampling_and_joining() -> None:
    robot = kinova()
    times = np.linspace(0.0, 2.0, 30)
    Q = np.array([robot.integrate(robot.home, 0.3 * np.sin(t + np.arange(robot.nv))) for t in times])
    fine = np.linspace(0.0, 2.0, 77)
    found = resampled(robot, Q, times, fine)
    wanted = [robot.integrate(robot.home, 0.3 * np.sin(t + np.arange(robot.nv))) for t in fine]
    assert max(np.linalg.norm(robot.difference(a, b)) for a, b in zip(found, wanted, strict=True)) < 1e-4
    met = joined(robot, Q)
    assert np.array_equal(met[0], met[-1]) and np.array_equal(met[0], Q[0])


def test_a_closed_trace_stays_closed() -> None:
    robot, rng = panda(), np.random.default_rng(0)
    given = setting(robot, circle(robot, 0.1), closed=True, samples=12)
    trace = Trace.through(given, np.repeat(robot.home[None], 12, axis=0))
    for _ in range(5):
        trace = trace.moved(layout_of(trace).expand(trace.Z, 0.05 * rng.normal(size=11)))
        assert np.array_equal(trace.Q[0], trace.Q[-1]) and np.array_equal(trace.Z[0], trace.Z[-1])
