"""Random robots, configurations, velocities and tasks: what must hold for every step."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

import cartctl as cc
from tests.robots_for_tests import ROBOTS, along

SEEDS = st.integers(0, 2**32 - 1)
SOLVERS = sorted(name for name in cc.solvers() if not cc.solvers.get_solver(name).extends)
NAMES = st.sampled_from(sorted(ROBOTS))


@st.composite
def situations(draw: st.DrawFn) -> tuple[cc.Robot, list[cc.Task], np.random.Generator]:
    """A robot with one to three tasks of any kind, random axes, gains, weights and targets."""
    robot = ROBOTS[draw(NAMES)]()
    rng = np.random.default_rng(draw(SEEDS))
    frames = st.sampled_from([robot.tool, *robot.frame_names[2 :: max(1, len(robot.frame_names) // 6)]])
    mask = st.lists(st.booleans(), min_size=6, max_size=6).filter(any)
    options = st.fixed_dictionaries({"gain": st.floats(0.0, 50.0), "weight": st.floats(1e-3, 10.0)})
    kinds = st.sampled_from(["frame", "tool axes", "relative", "com", "posture", "function"])
    tasks: list[cc.Task] = []
    for kind in draw(st.lists(kinds, min_size=1, max_size=3)):
        frame, axes, o = draw(frames), draw(mask), draw(options)
        target = robot.state(robot.random_configuration(rng)).placement(frame)
        if kind == "frame":
            tasks.append(cc.FrameTask(frame, axes, target=target, length=draw(st.floats(0.05, 5.0)), **o))
        elif kind == "tool axes":
            tasks.append(cc.FrameTask(frame, axes, target=target, expressed_in=frame, **o))
        elif kind == "relative":
            tasks.append(cc.RelativeFrameTask(frame, robot.frame_names[-1], axes, target=target, **o))
        elif kind == "com":
            tasks.append(cc.ComTask(target=rng.normal(size=3), **o))
        elif kind == "posture":
            tasks.append(cc.PostureTask(**o))
        else:
            tasks.append(cc.FunctionTask(lambda s, f=frame: s.position(f) ** 2, target=rng.normal(size=3), **o))
    return robot, tasks, rng


@given(situations(), st.sampled_from(SOLVERS), st.booleans())
def test_every_step_is_finite_and_grades_itself_honestly(
    situation: tuple[cc.Robot, list[cc.Task], np.random.Generator], solver: str, inertia: bool
) -> None:
    robot, tasks, rng = situation
    metric = "inertia" if inertia and cc.solvers.get_solver(solver).takes_metric else None
    controller = cc.Controller(robot, tasks, solver=solver, limits=None, metric=metric)
    command = controller.step(robot.random_configuration(rng), rng.normal(size=robot.nv), float(rng.normal()))
    solution = command.solution
    assert command.velocity.shape == (robot.nv,) and np.isfinite(command.velocity).all()
    assert np.isfinite(solution.residuals).all()
    if controller.solver.scales:  # contradicting tasks are slowed down, or asked again in another way
        assert not ((solution.scales < 0.0) | (solution.scales > 1.0)).any()  # nan: left out
        return
    assert (solution.scales == 1.0).all()
    for equation, reference, task in zip(solution.problem.equations, command.references, controller.tasks, strict=True):
        np.testing.assert_allclose(equation.b, task.gain * reference.error, atol=1e-12)
    if solution.status is cc.Status.OPTIMAL:
        size = np.linalg.norm(command.velocity)
        for equation, residual in zip(solution.problem.equations, solution.residuals, strict=True):
            assert residual <= 1e-8 * (1.0 + np.linalg.norm(equation.A) * size + np.linalg.norm(equation.b))


@given(NAMES, SEEDS, st.integers(1, 2))
def test_a_small_step_reduces_every_error_that_can_be_reduced(name: str, seed: int, count: int) -> None:
    robot, rng = ROBOTS[name](), np.random.default_rng(seed)
    q = robot.random_configuration(rng)
    near = robot.state(robot.integrate(q, 0.05 * rng.normal(size=robot.nv)))
    frame = cc.FrameTask(robot.tool, "xy", gain=1.0, target=near.position(robot.tool))
    tasks = [frame, cc.PostureTask(gain=1.0, target=robot.coordinates(near.q)[-len(robot.single_joints) :])][:count]
    controller = cc.Controller(robot, tasks, solver="task-priority", limits=None)
    command = controller.step(q)
    if command.solution.residuals[0] > 1e-9 or np.linalg.norm(command.velocity) > 5.0:
        return  # singular here: the error cannot all be taken back
    state = robot.state(q)
    after = along(robot, state, 1e-4 * command.velocity)
    before_error = command.references[0].error
    after_error = frame.reference(after, 0.0, None).error
    np.testing.assert_allclose(after_error, (1.0 - 1e-4) * before_error, atol=1e-6)


@given(SEEDS)
def test_the_null_space_never_moves_the_hand(seed: int) -> None:
    robot, rng = ROBOTS["panda"](), np.random.default_rng(seed)

    class Random(cc.Objective):
        gain = 10.0
        slope = rng.normal(size=7)

        def value(self, state: cc.State) -> float:
            return float(self.slope @ state.q)

        def gradient(self, state: cc.State) -> np.ndarray:
            return self.slope

    q = robot.random_configuration(rng)
    hand = cc.FrameTask(robot.tool)
    for solver in ("projected-gradient", "task-priority", "dls"):
        controller = cc.Controller(robot, hand, solver=solver, limits=None, objective=Random())
        u = controller.step(q).velocity
        J = robot.state(q).jacobian(robot.tool)
        assert np.linalg.norm(J @ u) <= 1e-12 * np.linalg.norm(J) * (1.0 + np.linalg.norm(u))
