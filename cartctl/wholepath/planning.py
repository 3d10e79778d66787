"""``cc.plan``: the best joint path for tasks with path targets, not only the best next step."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from time import perf_counter
from typing import Any

import numpy as np

from cartctl import checks
from cartctl.checks import FloatArray
from cartctl.errors import CartctlWarning, NoTasksError, ParameterError, ProblemError, ShapeError, TargetError
from cartctl.model.limits import Limits
from cartctl.model.robot import Robot
from cartctl.motion.limiting import ROBOT_LIMITS, RobotLimits
from cartctl.motion.recorder import cycles_of
from cartctl.motion.run import Run
from cartctl.objectives.base import Objective
from cartctl.tasks.base import Task
from cartctl.tasks.clearance import ClearanceTask
from cartctl.wholepath.as_run import Plan, as_plan
from cartctl.wholepath.between import Bound, bound_between
from cartctl.wholepath.costs import CostSum, PathCost, TaskMiss, as_cost
from cartctl.wholepath.local import LocalMethod, controllers, rolled_out
from cartctl.wholepath.manifold import newton
from cartctl.wholepath.report import PlanReport
from cartctl.wholepath.rows import Rows
from cartctl.wholepath.search import Outcome, Seed, search
from cartctl.wholepath.setting import Setting, remembering
from cartctl.wholepath.sqp import excess_of
from cartctl.wholepath.trace import Trace
from cartctl.wholepath.verdict import judged

_STARTS_AT = 1e-6  # m or rad: how far a given q0 may be from the task at the first sample
_MOST = 100_000  # samples


def plan(
    robot: Robot,
    tasks: Task | Sequence[Task],
    duration: float | None = None,
    samples: int = 200,
    objective: str | Objective | PathCost = "kinetic-energy",
    limits: Limits | RobotLimits | None = ROBOT_LIMITS,
    closed: bool = False,
    q0: Any = None,
    *,
    rest: bool = True,
    methods: Sequence[Any] | None = None,
    starts: Sequence[Run | FloatArray] = (),
    iterations: int = 60,
    seed: int = 0,
    progress: Callable[[str], None] | None = None,
) -> Plan:
    """The joint path that minimises an integral cost, with the tasks met at every sample: a Plan, which is a Run.

    ``min J(q_0, ..., q_N)`` subject to ``r(q_k) = r_d(t_k)``, ``q_k`` within the position limits, ``v_k = (q_{k+1} (-)
    q_k)/h`` within the velocity limits, ``(v_k - v_{k-1})/h`` within the acceleration limits, by sequential quadratic
    programming on the set where the tasks are met, from several starts (METHODS.md, section 7; Nakamura 1991, chapter
    6; Martin, Baillieul & Hollerbach 1989). The best local optimum that was found: not proven to be the global one.

    tasks: as a Controller takes them, at least one with a path. Those with ``fit="scale"`` are met at every sample, in
    any order; those with ``fit="least_squares"`` (a PostureTask) add ``integral weight/2 ||e||^2 dt`` to the cost.
    duration: s, that of the longest path if None. samples: N + 1, both ends included. objective: ``"kinetic-energy"``,
    ``"joint-speed"``, ``"joint-range"``, ``"inverse-manipulability"``, ``"self-clearance"``, ``"torque"``; an Objective
    such as ``cc.Clearance(scene)``; a cost such as ``cc.JointSpeed(weights)``, ``cc.SquaredTorque("limits")``; or a sum
    of them. limits: by default the robot's own, None for none; torque and jerk limits do not count. closed: whether the
    last configuration must be the first one. q0 (nq,): where the path starts, on its task; None leaves that free.

    rest: whether the motion starts and ends at rest (which is told by the acceleration limits, and by torques).
    methods: the local methods to compare with, and to start from: names of solvers or Controllers; None takes
    ``pinv`` with and without the inertia metric (with masses), ``projected-gradient``, under limits ``sns`` likewise.
    starts: Runs, or joint paths (any number of samples, nq) over the same time, to start from as well. iterations: of
    each fine search, at most. seed: of the random postures. progress(words) is told what is being done.

    Where the tasks cannot be met, or the limits not be kept, ``plan.report.status`` says so, ``plan.report.message``
    which sample and which limit, and a CartctlWarning says it at once; the path is then the least bad one found.

    Raises NoTasksError, ProblemError, ParameterError, TimeStepError, TargetError, ShapeError, NonFiniteError,
    FrameNotFound, ConfigurationError, and what :class:`cartctl.Controller` raises for ``methods``.
    """
    began = perf_counter()
    tell = _nobody if progress is None else progress
    if not callable(tell):
        raise ParameterError(f"progress is a {type(progress).__name__}; expected a function of words")
    setting, given = _setting(robot, tasks, duration, samples, limits, closed, q0, rest)
    cost = as_cost(objective)
    cost.check(robot)
    count = _whole("iterations", iterations, 1)
    rng = np.random.default_rng(_whole("seed", seed, 0))
    whole = _with_soft(cost, setting)
    start, setting = _started(setting)
    local: list[tuple[LocalMethod, FloatArray | None]] = []
    for name, controller in controllers(setting, given, methods):
        tell(f"simulating {name}")
        local.append(rolled_out(setting, whole, name, controller, start))
    seeds = [Seed("held", np.repeat(start[None], setting.size, axis=0), setting.times), *_given(setting, starts)]
    tell("searching")
    outcome = search(setting, whole, local, seeds, count, rng, tell)
    report = _report(outcome, [method for method, _ in local], whole, rng, began)
    if not report.feasible:
        warnings.warn(f"no plan: {report.message}", CartctlWarning, stacklevel=2)
    return as_plan(outcome.best.trace, report)


def _nobody(words: str) -> None:
    """Tell nobody."""


def _setting(
    robot: Robot,
    tasks: Task | Sequence[Task],
    duration: float | None,
    samples: int,
    limits: Limits | RobotLimits | None,
    closed: bool,
    q0: Any,
    rest: bool,
) -> tuple[Setting, list[Task]]:
    """What is asked for, checked, and the tasks as they were given."""
    if not isinstance(robot, Robot):
        raise ParameterError(f"robot is a {type(robot).__name__}; expected a Robot from cc.load(...)")
    given = [tasks] if isinstance(tasks, Task) else tasks
    if not isinstance(given, Sequence):
        raise ProblemError(f"tasks is a {type(tasks).__name__}; expected a Task or a sequence of tasks")
    given = list(given)
    for k, task in enumerate(given):
        if not isinstance(task, Task):
            raise ProblemError(f"tasks[{k}] is a {type(task).__name__}; expected a Task")
        if isinstance(task, ClearanceTask):
            raise ProblemError(
                f"tasks[{k}] is a ClearanceTask, which sets in near obstacles only; plan with "
                "objective=cc.Clearance(scene), alone or in a sum"
            )
        task.check(robot)
    hard = [task for task in given if task.fit == "scale"]
    soft = [task for task in given if task.fit != "scale"]
    if not hard:
        raise NoTasksError('tasks holds none with fit="scale"; expected at least one that is met at every sample')
    for name, value in (("closed", closed), ("rest", rest)):
        if not isinstance(value, bool):
            raise ParameterError(f"{name} is {value!r}; expected True or False")
    total = _duration(hard, duration)
    count = _whole("samples", samples, 3)
    start = None if q0 is None else robot.check_configuration(q0, "q0")
    state = robot.state(robot.home if start is None else start)
    anchors = tuple(task.anchor(state) for task in hard), tuple(task.anchor(state) for task in soft)
    setting = Setting(
        robot, remembering(hard), remembering(soft), *anchors, np.linspace(0.0, total, count), _limits(limits, robot),
        start, closed, rest, robot.state(robot.home),
    )  # fmt: skip
    return setting, given


def _duration(tasks: Sequence[Task], duration: float | None) -> float:
    if duration is not None:
        return checks.duration("duration", duration)
    known = [getattr(getattr(task, "target", None), "duration", None) for task in tasks]
    found = [float(d) for d in known if d is not None]
    if not found:
        raise ParameterError("duration is None, but no task follows a path that knows its own; give it in s")
    return max(found)


def _whole(name: str, value: Any, least: int) -> int:
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or not least <= value <= _MOST:
        raise ParameterError(f"{name} is {value!r}; expected a whole number from {least} to {_MOST}")
    return int(value)


def _limits(limits: Any, robot: Robot) -> Limits | None:
    if limits is ROBOT_LIMITS:
        return robot.limits
    if limits is None:
        return None
    if not isinstance(limits, Limits):
        raise ParameterError(f"limits is a {type(limits).__name__}; expected Limits such as robot.limits, or None")
    if len(limits.position_lower) != robot.nv:
        raise ShapeError(f"limits have {len(limits.position_lower)} joints; expected {robot.nv} as {robot.name!r}")
    return limits


def _with_soft(cost: PathCost, setting: Setting) -> PathCost:
    """The cost and what the tasks of least squares add to it."""
    missed = [(1.0, TaskMiss(t, a)) for t, a in zip(setting.soft, setting.soft_anchors, strict=True) if t.weight > 0.0]
    return CostSum([(1.0, cost), *missed]) if missed else cost


def _started(setting: Setting) -> tuple[FloatArray, Setting]:
    """Where the local methods start: q0, or the configuration on the task that Newton's method finds from home.

    Raises TargetError for a q0 that is not on its task, and for a closed path whose task ends elsewhere.
    """
    robot = setting.robot
    if setting.start is not None:
        error = float(np.linalg.norm(setting.errors(0, setting.start)))
        if error > _STARTS_AT:
            raise TargetError(
                f"q0 misses the tasks at t = 0 by {error:.3g} (m and rad together); expected at most {_STARTS_AT:g}: "
                "begin the path where the robot is, as cc.Circle.starting_at(...), or leave q0=None"
            )
        start = setting.start
    else:
        start = newton(setting, 0, np.array(robot.home)[None], rounds=60)[0][0]
    if setting.closed:
        gap = np.linalg.norm(setting.errors(0, start) - setting.errors(setting.size - 1, start))
        if gap > _STARTS_AT:
            raise TargetError(
                f"closed=True, but the tasks at the end are {gap:.3g} (m and rad together) away from those at the "
                "start; expected a path that ends where it begins, and a duration of whole laps"
            )
    return start, setting


def _given(setting: Setting, starts: Sequence[Run | FloatArray]) -> list[Seed]:
    """The caller's own joint paths."""
    found = []
    for i, start in enumerate(checks.listed("starts", starts)):
        path = start.q if isinstance(start, Run) else start
        Q = checks.floats(f"starts[{i}]", path)
        if Q.ndim != 2 or Q.shape[1] != setting.robot.nq or len(Q) < 2:
            raise ShapeError(f"starts[{i}] has shape {Q.shape}; expected (samples, {setting.robot.nq}) of at least two")
        Q = np.array([setting.robot.check_configuration(q, f"starts[{i}]") for q in Q])
        found.append(Seed(f"start {i + 1}", Q, np.linspace(setting.times[0], setting.times[-1], len(Q))))
    return found


def _report(
    outcome: Outcome, local: list[LocalMethod], cost: PathCost, rng: np.random.Generator, began: float
) -> PlanReport:
    best = outcome.best
    trace, setting = best.trace, best.trace.setting
    status, message = judged(best, rng)
    units = np.array([unit for task in setting.tasks for unit in task.units(setting.robot)])
    sizes = [
        float(np.linalg.norm(trace.E[:, units == u], axis=1).max()) if (units == u).any() else None
        for u in ("m", "rad")
    ]
    return PlanReport(
        status=status,
        message=message,
        objective=cost.name,
        cost=best.cost,
        local=tuple(local),
        residual=Bound(*sizes),
        between=bound_between(trace),
        excess=-np.inf if setting.limits is None else excess_of(Rows(setting.limits), trace),
        closure=float(np.linalg.norm(setting.robot.difference(trace.Q[0], trace.Q[-1]))),
        drift=_drift(trace),
        starts=tuple(outcome.starts),
        history=tuple(outcome.history),
        iterations=outcome.iterations,
        qps=outcome.qps,
        osqp_iterations=outcome.osqp_iterations,
        seconds=perf_counter() - began,
    )


def _drift(trace: Trace) -> float | None:
    """The largest joint distance over a lap of the first closed path."""
    setting = trace.setting
    cycles = cycles_of([getattr(task, "target", None) for task in setting.tasks])
    at = np.round((np.array(cycles) - setting.times[0]) / setting.h).astype(int)
    at = at[(at >= 0) & (at < setting.size)]
    if len(at) < 2:
        return None
    laps = zip(at[:-1], at[1:], strict=True)
    return max(float(np.linalg.norm(setting.robot.difference(trace.Q[i], trace.Q[j]))) for i, j in laps)
