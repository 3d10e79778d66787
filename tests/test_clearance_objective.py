"""Clearance as an objective and as a task: the published example, differences, and what the loop makes of it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

import cartctl as cc
from cartctl.errors import CartctlError, NonFiniteError, ParameterError, TargetError
from tests.robots_for_tests import kinova, panda, planar, talos
from tests.worked_examples import ITEMS

PUBLISHED = ITEMS["r2-2024-04-24-ex1"]
ARMS: dict[str, Callable[[], cc.Robot]] = {"planar": planar, "panda": panda, "kinova": kinova, "talos": talos}


# ---------------------------------------------------------------- a disc beside a planar arm, published


def disc() -> tuple[cc.Robot, np.ndarray, cc.Scene, cc.Clearance, str]:
    given = PUBLISHED["inputs"]
    robot = cc.planar(given["L"])
    elbow = next(
        name for name in robot.frame_names if np.allclose(robot.state(robot.neutral).position(name), [2, 0, 0])
    )
    scene = cc.Scene().sphere("disc", given["r"], at=[*given["C"], 0.0])
    clearance = cc.Clearance(scene, points=[elbow], within=np.inf)
    return robot, np.array([0.0, np.pi / 2, -np.pi / 2]), scene, clearance, elbow


def test_the_published_clearance_and_its_gradient() -> None:
    """The source's gradient is half of the true one."""
    wanted = PUBLISHED["expected"]
    robot, q, _, clearance, elbow = disc()
    state = robot.state(q)
    assert clearance.value(state) == pytest.approx(wanted["H"], abs=1e-9)
    np.testing.assert_allclose(clearance.gradient(state), 2.0 * np.array(wanted["gradH_used"]), atol=2e-4)
    np.testing.assert_allclose(state.jacobian(elbow)[:2], wanted["Jm"], atol=1e-12)


def test_the_published_projected_gradient_step() -> None:
    """k = 0.5 on the true gradient is the source's step 1 on its half."""
    robot, q, scene, _, elbow = disc()
    clearance = cc.Clearance(scene, 0.5, points=[elbow], within=np.inf)
    state = robot.state(q)
    Je = state.jacobian(robot.tool)[:2]
    problem = cc.Problem([(Je, PUBLISHED["inputs"]["ve"])], reference=clearance.direction(state))
    solution = cc.solve(problem, "projected-gradient")
    np.testing.assert_allclose(solution.u, PUBLISHED["expected"]["dq_PG"], atol=6e-5)
    np.testing.assert_allclose(state.jacobian(elbow)[:2] @ solution.u, PUBLISHED["expected"]["vm"], atol=6e-5)


@pytest.mark.parametrize("which", ["A", "B"])
def test_the_published_task_priority_steps(which: str) -> None:
    """The velocity of the closest point below that of the tip: A as the gradient step had it, B along the clearance."""
    robot, q, _, clearance, elbow = disc()
    state = robot.state(q)
    contact = clearance.arrangement(robot).closest(state)
    tip, point = state.jacobian(robot.tool)[:2], state.jacobian(elbow)[:2]
    speed = np.linalg.norm(PUBLISHED["expected"]["vm_B"])
    vm = PUBLISHED["expected"]["vm"] if which == "A" else speed * contact.normal[0][:2]
    if which == "B":
        np.testing.assert_allclose(vm, PUBLISHED["expected"]["vm_B"], atol=6e-5)
    solution = cc.solve(cc.Problem([(tip, PUBLISHED["inputs"]["ve"]), (point, vm)]), "task-priority")
    np.testing.assert_allclose(solution.u, PUBLISHED["expected"][f"dq_TP_{which}"], atol=1e-4)
    if which == "B":
        np.testing.assert_allclose(tip @ solution.u, PUBLISHED["inputs"]["ve"], atol=1e-9)
        assert solution.residuals[1] == pytest.approx(np.linalg.norm(PUBLISHED["expected"]["err_B"]), abs=1e-4)


# ---------------------------------------------------------------- gradients


def scene_of_balls(rng: np.random.Generator) -> cc.Scene:
    scene = cc.Scene()
    for k in range(6):
        scene.sphere(f"ball {k}", 0.1, at=rng.uniform([-0.8, -0.8, 0.0], [0.8, 0.8, 1.0]))
    return scene


def slopes(objective: cc.Objective, robot: cc.Robot, q: np.ndarray, u: np.ndarray) -> tuple[float, float, float]:
    h = 1e-6
    H = [objective.value(robot.state(robot.integrate(q, s * h * u))) for s in (-1.0, 0.0, 1.0)]
    return (H[1] - H[0]) / h, (H[2] - H[0]) / (2 * h), (H[2] - H[1]) / h


@pytest.mark.parametrize("within", [0.15, 0.3, np.inf])
@pytest.mark.parametrize("name", list(ARMS))
def test_gradients_by_differences(name: str, within: float) -> None:
    robot, rng = ARMS[name](), np.random.default_rng(1)
    objectives: list[cc.Objective] = [cc.Clearance(scene_of_balls(rng), within=within)]
    if name != "planar":
        objectives.append(cc.SelfClearance(within=within))
    for objective in objectives:
        felt, kinks = 0, 0
        for _ in range(40):
            q, u = robot.random_configuration(rng), rng.normal(size=robot.nv)
            behind, central, ahead = slopes(objective, robot, q, u)
            if abs(ahead - behind) > 1e-3 * (1.0 + abs(central)):
                kinks += 1
                continue
            gradient = objective.gradient(robot.state(q))
            assert gradient.shape == (robot.nv,)
            assert gradient @ u == pytest.approx(central, abs=1e-5)
            felt += bool(abs(central) > 1e-3)
        assert felt >= 5 and kinks <= 2


def test_the_smoothed_distance_lies_below_the_smallest_by_a_bounded_amount() -> None:
    robot, rng = panda(), np.random.default_rng(2)
    objective = cc.Clearance(scene_of_balls(rng), smoothing=0.03, within=np.inf)
    pairs = len(objective.arrangement(robot).pairs)
    for _ in range(50):
        state = robot.state(robot.random_configuration(rng))
        least = float(objective.arrangement(robot).closest(state).distance[0])
        assert least - 0.03 * np.log(pairs) <= objective.value(state) <= least + 1e-12


def test_far_away_nothing_is_felt_and_it_sets_in_smoothly() -> None:
    """A ball from far to near: value and slope along its way have no step."""
    robot, values, norms = panda(), [], []
    state = robot.state(robot.home)
    hand = state.position("panda_hand_tcp")
    reach = np.arange(0.6, 0.05, -5e-4)
    scene = cc.Scene().sphere("ball", 0.05, at=hand)
    objective = cc.Clearance(scene, points=["panda_hand_tcp"], within=0.3)
    for r in reach:
        scene.move("ball", hand + [r, 0.0, 0.0])
        values.append(objective.value(state))
        norms.append(np.linalg.norm(objective.gradient(state)))
    assert values[0] == 0.3 and norms[0] == 0.0
    assert abs(values[-1] - (reach[-1] - 0.05)) < 1e-6 and norms[-1] > 0.1
    assert np.abs(np.diff(values)).max() <= 1.19 * 5e-4 + 1e-9
    assert np.abs(np.diff(norms)).max() < 0.03 * max(norms)


def test_no_obstacle_is_no_reason_to_move() -> None:
    robot = panda()
    state = robot.state(robot.home)
    for within in (0.3, np.inf):
        objective = cc.Clearance(cc.Scene(), within=within)
        assert np.isfinite(objective.value(state)) and not objective.gradient(state).any()


# ---------------------------------------------------------------- in the loop


def beside_the_elbow(robot: cc.Robot, gap: float = 0.06) -> cc.Scene:
    elbow = robot.state(robot.home).position("panda_link4")
    return cc.Scene().sphere("ball", 0.08, at=elbow + [0.0, 0.08 + 0.07 + gap, 0.0])


@pytest.mark.parametrize("solver", ["projected-gradient", "reduced-gradient", "task-priority", "sns"])
def test_the_null_space_moves_away_while_the_hand_holds(solver: str) -> None:
    robot = panda()
    scene = beside_the_elbow(robot)
    objective = cc.Clearance(scene, 4.0)
    limits = robot.limits if solver == "sns" else None
    controller = cc.Controller(
        robot, cc.FrameTask(robot.tool), solver, limits=limits, objective=objective, dt=5e-3, approach=False
    )
    q, v, H = robot.home, np.zeros(7), [objective.value(robot.state(robot.home))]
    for k in range(200):
        command = controller.step(q, v, k * 5e-3)
        assert command.velocity is not None
        twist = robot.state(q).jacobian(robot.tool) @ command.velocity
        asked = 20.0 * np.asarray(command.references[0].error)
        assert np.abs(twist - asked).max() < 1e-9
        v = command.velocity
        q = robot.integrate(q, 5e-3 * v)
        H.append(objective.value(robot.state(q)))
    assert H[-1] > H[0] + 0.03
    assert np.diff(H).min() > -1e-5


@pytest.mark.parametrize("level", ["velocity", "acceleration"])
def test_a_task_keeps_its_distance_below_the_hand(level: str) -> None:
    """A ball comes beside the elbow and stays: the elbow makes way, the hand stays within its feedback's error."""
    robot = panda()
    elbow = robot.state(robot.home).position("panda_link4")
    path = cc.Line(elbow + [0.0, 0.5, 0.0], elbow + [0.0, 0.17, 0.0], duration=2.0)
    scene = cc.Scene().sphere("ball", 0.08, at=path)
    hand, away = cc.FrameTask(robot.tool), cc.ClearanceTask(scene, 0.05)
    what = cc.AccelerationLevel(damping=2.0) if level == "acceleration" else level
    controller = cc.Controller(robot, [hand, away], "sns", level=what, dt=5e-3)
    run = cc.simulate(controller, robot.home, duration=4.0)
    watch = cc.Avoid(scene)
    found = [watch.closest(robot.state(q, time=t)) for q, t in zip(run.q, run.time, strict=True)]
    distances = np.array([f.distance for f in found if f is not None])
    assert distances.min() > 0.03 and 0.03 < distances[-1] < 0.1
    start, end = (robot.state(q).position(robot.tool) for q in (run.q[0], run.q[-1]))
    assert np.linalg.norm(start - end) < 1e-3
    still = [watch.closest(robot.state(robot.home, time=t)) for t in (0.0, 4.0)]
    assert still[0].distance > 0.2 and still[1].distance < 0.02  # it would have been nearly hit


def test_a_tasks_jacobian_and_drift_by_differences() -> None:
    robot, rng, h = panda(), np.random.default_rng(4), 1e-5
    path = cc.Line([0.5, 0.4, 0.5], [0.5, -0.4, 0.5], duration=2.0)
    scene = scene_of_balls(rng).sphere("moving", 0.1, at=path)
    task, seen, kinks = cc.ClearanceTask(scene, 0.1, band=0.2), 0, 0
    while seen < 25:
        q, v, t = robot.random_configuration(rng), rng.normal(size=7), rng.uniform(0.3, 1.7)
        states = [robot.state(robot.integrate(q, s * h * v), v, t + s * h) for s in (-1.0, 0.0, 1.0)]
        d = [task.distance(s) for s in states]
        J = task.jacobian(states[1])
        if not J.any():
            assert d[1] == pytest.approx(0.3, abs=0.2)
            continue
        seen += 1
        fixed = [task.distance(robot.state(robot.integrate(q, s * h * v), v, t)) for s in (-1.0, 1.0)]
        if abs(d[2] - 2 * d[1] + d[0]) > 1e-7:
            kinks += 1
            continue
        assert J.shape == (1, 7)
        assert float(J[0] @ v) == pytest.approx((fixed[1] - fixed[0]) / (2 * h), abs=1e-5)
        H = 1e-4
        wide = [task.distance(robot.state(robot.integrate(q, s * H * v), v, t + s * H)) for s in (-1.0, 0.0, 1.0)]
        second = (wide[2] - 2 * wide[1] + wide[0]) / H**2
        assert task.drift(states[1])[0] == pytest.approx(second, abs=0.02 * (1.0 + abs(second)))
    assert kinks < 5


def test_a_task_comes_and_goes_without_a_jump() -> None:
    """At the edge of the band it asks for the rate there is; beyond, for nothing."""
    robot = panda()
    v = np.array([0.3, -0.2, 0.1, 0.2, -0.1, 0.3, 0.2])
    state = robot.state(robot.home, v)
    hand = state.position("panda_hand_tcp")
    scene = cc.Scene().sphere("ball", 0.05, at=hand)
    task = cc.ClearanceTask(scene, 0.05, 10.0, band=0.1, points=["panda_hand_tcp"])
    gaps = []
    for r in np.linspace(0.2, 0.09, 200):
        scene.move("ball", hand + [r, 0.0, 0.0])
        now = robot.state(robot.home, v)
        reference, J = task.reference(now, 0.0, None), task.jacobian(now)
        if not J.any():
            assert not reference.error.any() and reference.rate is None
            continue
        gaps.append(float(10.0 * reference.error[0] + reference.rate[0] - J[0] @ v))
    assert len(gaps) > 100 and abs(gaps[0]) < 1e-3
    assert np.abs(np.diff(gaps)).max() < 0.02


def test_misuse_is_refused() -> None:
    scene = cc.Scene().sphere("ball", 0.1, at=[1, 0, 0])
    for bad, error in (
        (lambda: cc.Clearance("scene"), ParameterError),
        (lambda: cc.Clearance(scene, 0.0), ParameterError),
        (lambda: cc.Clearance(scene, smoothing=0.0), ParameterError),
        (lambda: cc.SelfClearance(within=np.nan), NonFiniteError),
        (lambda: cc.ClearanceTask(3), ParameterError),
        (lambda: cc.ClearanceTask(scene, -0.1), ParameterError),
        (lambda: cc.ClearanceTask(scene, band=0.0), ParameterError),
        (lambda: cc.ClearanceTask(scene, lambda t: 0.1), TargetError),
    ):
        with pytest.raises(error) as caught:
            bad()
        assert isinstance(caught.value, CartctlError)
