"""The closed loop of one robot: tasks, solver and level, and all that lasts from step to step."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, ClassVar

import numpy as np

from cartctl import checks
from cartctl.algebra.problem import Problem
from cartctl.algebra.solution import Solution, Status
from cartctl.checks import LARGEST, FloatArray, is_moderate
from cartctl.compiled.fused_step import FusedStep
from cartctl.compiled.lasting import Memory
from cartctl.compiled.workspace import Workspace
from cartctl.constraints import Constraint
from cartctl.errors import (
    ParameterError,
    UnsupportedJoint,
    UnsupportedProblem,
)
from cartctl.levels import Command, Level, Secondary, get_level
from cartctl.levels.base import Confines
from cartctl.levels.metrics import as_state_metric
from cartctl.levels.midway import ROUNDS, Midway
from cartctl.levels.singularity import Guard
from cartctl.levels.torque import TorqueLevel
from cartctl.levels.torque_fused import FusedTorque, fuses
from cartctl.levels.velocity import VelocityLevel
from cartctl.levels.yielding import missed
from cartctl.model.limits import Limits
from cartctl.model.robot import Robot
from cartctl.model.state import State
from cartctl.motion.clock import PathClocks
from cartctl.motion.confining import Confining
from cartctl.motion.extremal_start import onto_extremal_set
from cartctl.motion.fallback import slowed, within_reach
from cartctl.motion.given import checked_objective, checked_switches, checked_tasks, clocked, warn_of_unstable_gains
from cartctl.motion.limiting import ROBOT_LIMITS, RobotLimits, usable_limits
from cartctl.objectives.base import Objective
from cartctl.solvers import Solver, get_solver
from cartctl.solvers.sns import SNS
from cartctl.tasks.base import Task


class Controller:
    """A robot with tasks, highest priority first, resolved by one solver at one level.

    tasks: one Task or more. solver: a name from :func:`cartctl.solvers`, or an instance. level: ``"velocity"``,
    ``"acceleration"`` or ``"torque"``. limits: Limits, None (off), or by default the robot's own where the solver
    honours bounds, else off with one warning; ``controller.limits`` may be assigned while running.
    objective: an Objective for the null space. metric: None or ``"identity"``, ``"inertia"`` (least kinetic energy),
    ``"joint-limits"`` (Chan & Dubey), of torques ``"inverse-inertia"`` or ``"inverse-inertia-squared"``, an (nv,) or
    (nv, nv) array, or a function of the State that returns one. dt: s, the step it is called with; a gain that cannot
    be stable at it is a CartctlWarning. soft_start: s over which the objective rises to its full share, so that the
    null space does not start with a jump.

    constraints: Constraints such as ``cc.FrameBox(...)``. disabled: names of joints that brake and stand still. jerk:
    whether ``limits.jerk_*`` are kept, too. path_clock: whether a path waits for a hand that is slowed down, so that it
    stays on its path; by default where the solver scales, at the velocity level. approach: whether commands are held
    back, under limits, so that the robot can stop at its target, at the edge of its reach and at the constraints, and
    whether a robot that gets no nearer to targets at rest slows down until it does (:mod:`cartctl.levels.patience`).
    singularity: what becomes of a task near a singularity of its own Jacobian, whatever the solver: ``"truncate"``,
    ``"damp"``, ``"slow-down"``, ``"avoid"``, ``"halt"``, an inverse policy such as ``cc.Damped(0.05)``,
    ``cc.SlowDown(0.1)``, ``cc.AvoidSingularity(2.0)``, ``cc.Halt(0.02)``, or None: the solver's own business. Where a
    command was cut, the status is SINGULAR, and the solution's problem is what was left of it.

    Raises NoTasksError, ProblemError, TimeStepError, FrameNotFound, JointNotFound, SolverNotFound, LevelNotFound,
    UnsupportedProblem, UnderactuatedRobot, MetricError, ParameterError, NonFiniteError.

    >>> import cartctl as cc
    >>> robot = cc.load("panda")
    >>> tip = cc.FrameTask(robot.tool, "position", target=[0.5, 0.2, 0.5])
    >>> controller = cc.Controller(robot, tip, solver="projected-gradient", objective=cc.JointRange(), limits=None)
    >>> controller.step(robot.home).velocity.shape
    (7,)
    """

    _fuses: ClassVar[bool] = True  # whether a step may be taken at one stroke; tests compare it with the general way

    def __init__(
        self,
        robot: Robot,
        tasks: Task | Sequence[Task],
        solver: str | Solver | type[Solver] = "pinv",
        level: str | Level = "velocity",
        limits: Limits | RobotLimits | None = ROBOT_LIMITS,
        objective: Objective | None = None,
        metric: str | FloatArray | Callable[[State], FloatArray] | None = None,
        dt: float = 1e-3,
        soft_start: float = 0.0,
        *,
        constraints: Sequence[Constraint] = (),
        disabled: str | Sequence[str] = (),
        jerk: bool = False,
        path_clock: bool | None = None,
        approach: bool = True,
        singularity: Any = None,
    ) -> None:
        if not isinstance(robot, Robot):
            raise ParameterError(f"robot is a {type(robot).__name__}; expected a Robot from cc.load(...)")
        self._given = {
            "robot": robot, "tasks": tasks, "solver": solver, "level": level, "objective": objective, "metric": metric,
            "dt": dt, "soft_start": soft_start, "constraints": constraints, "disabled": disabled, "jerk": jerk,
            "path_clock": path_clock, "approach": approach, "singularity": singularity,
        }  # fmt: skip
        self.robot = robot
        self.tasks = checked_tasks(tasks, robot)
        self.solver = get_solver(solver)
        self.level = get_level(level)
        self.level.check(self.solver)
        self.level.check_robot(robot)
        checked_switches(path_clock=path_clock, approach=approach)
        self._limits = usable_limits(limits, robot, self.solver, self.level)
        self._guard = Guard(singularity, self.level, robot, self.tasks)
        self.objective = self._guard.objective(checked_objective(objective, self.solver, robot))
        if self.objective is not objective:
            checked_objective(self.objective, self.solver, robot, "another singularity policy")
        self.metric = metric
        self._extend = getattr(self.solver, "gain", None) if self.solver.extends else None
        self.dt = checks.duration("dt", dt)
        warn_of_unstable_gains(self.tasks, self.dt, self.level.stable_below)
        self.soft_start = checks.number("soft_start", soft_start, low=0.0)
        self._metric = as_state_metric(metric, robot.nv, self.level.metrics)
        self._weighing = metric if isinstance(metric, str) else "identity" if metric is None else ""
        self._alone = self._secondary(0.0)
        self.solver.prepare()
        self._fused = self._fused_way()
        self._constraints, self._disabled, self._jerk, self._approach = constraints, disabled, jerk, approach
        waiting = clocked(path_clock, self.tasks, self.solver.scales or self._guard.waits, self.level)
        self._clocks = PathClocks(waiting)
        self._waiting = [task for task, waits in zip(self.tasks, waiting, strict=True) if waits]
        self._confining = self._confined_by(self._limits)
        self._last: Solution | None = None
        self._step_times: list[float] = []
        self._state = State(robot)
        self._zeros = np.zeros(robot.nv)
        self._zeros.flags.writeable = False
        self._anchors: list[Any] | None = None
        self._started: float | None = None
        self._stroke = self._at_one_stroke()
        if self._stroke is None:
            self._confining.prepare()
        self._ahead = False  # whether what lasts is with the stroke, and what is here is out of date

    def replace(self, **changes: Any) -> Controller:
        """A new Controller with some arguments changed, as in ``controller.replace(solver="hqp")``; it starts afresh.

        It works under the limits in force here, unless it is given others. Raises as the constructor does,
        UnsupportedProblem where a solver honours no limits and ``limits=None`` does not say so.
        """
        unknown = [name for name in changes if name not in self._given and name != "limits"]
        if unknown:
            known = ", ".join([*self._given, "limits"])
            raise ParameterError(f"a Controller has no argument {unknown[0]!r}; expected one of {known}")
        return Controller(**{"limits": self._limits, **self._given, **changes})

    def reset(self) -> None:
        """Forget all that lasts from step to step, as before the first one."""
        self._ahead = False
        self._anchors = None
        self._started = None
        self._last = None
        self._clocks.reset()
        self._confining.reset()
        self._guard.reset()

    @property
    def limits(self) -> Limits | None:
        """The joint limits in force; assign Limits to change them while running, or None to lift them."""
        return self._limits

    @limits.setter
    def limits(self, limits: Limits | None) -> None:
        limits = usable_limits(limits, self.robot, self.solver, self.level)
        confining = self._confined_by(limits)
        self._fall_back()
        self._confining, self._limits = confining, limits
        self._stroke = self._at_one_stroke()
        if self._stroke is None:
            confining.prepare()

    def workspace(self) -> Workspace:
        """A store for compiled loops, as before the first step.

        Raises UnsupportedProblem, UnsupportedJoint for what such a loop does not hold: constraints, jerk limits,
        approaches of others, other tasks and solvers.
        """
        packed, braking = self._confining.compiled()
        waits = [task in self._waiting for task in self.tasks]
        return Workspace(self.robot, self.tasks, self.solver, packed, braking, waits, self.dt)

    def _confined_by(self, limits: Limits | None) -> Confining:
        given = (self._constraints, self._disabled, self._jerk, self._approach)
        return Confining(self.robot, self.level, self.solver, limits, *given, self.dt, self._waiting, len(self.tasks))

    def _fused_way(self) -> FusedTorque | None:
        """Level and solver in one, where there is such a way for them; else they are asked one after the other."""
        if self._guard.acts or not isinstance(self.level, TorqueLevel):
            return None
        if not fuses(self.level, self.solver, self._metric):
            return None
        return FusedTorque(self.level, self.solver, self.tasks, self.robot.nv)

    def _at_one_stroke(self) -> FusedStep | None:
        """The whole step in compiled code, at the velocity level, where there is such a way for everything given."""
        plain = self.metric is None or (isinstance(self.metric, str) and self.metric == "identity")
        if not (self._fuses and type(self.level) is VelocityLevel and plain):
            return None
        if self.objective is not None or self._guard.policy is not None:
            return None
        try:
            return FusedStep(self.workspace())
        except (UnsupportedProblem, UnsupportedJoint):
            return None

    def _hand_over(self, stroke: FusedStep) -> None:
        """Let that way go on from where the general one has come to."""
        lasting = (*self._clocks.kept, self._confining.bends(self.tasks), self._confining.patience)
        stroke.lasting.resume(Memory(self._anchors, self._started, self._step_times, *lasting))
        self._ahead = True

    def _fall_back(self) -> None:
        """Take what lasts back from the stroke."""
        if not self._ahead or self._stroke is None:
            return
        memory = self._stroke.lasting.memory
        self._ahead = False
        self._anchors, self._started, self._last = memory.anchors, memory.started, None
        if memory.anchors is not None:
            self._step_times = memory.times
        self._clocks.resume(memory.delays, memory.shares, memory.paces, memory.last)
        self._confining.resume(self.tasks, memory.bent, memory.patience)

    @property
    def step_times(self) -> list[float]:
        """Each task's own time at the last step."""
        times = self._stroke.lasting.step_times if self._ahead and self._stroke is not None else None
        return self._step_times if times is None else times

    def times(self, t: float) -> list[float]:
        """Each task's own time when everybody else's is t: later by what its path has waited."""
        return self._stroke.lasting.times(t) if self._ahead and self._stroke is not None else self._clocks.times(t)

    def start(self, q0: FloatArray) -> FloatArray:
        """Where a rollout from q0 (nq,) begins: q0, or for a solver that keeps an objective extremal, on that set.

        Raises ShapeError, NonFiniteError, ConfigurationError. A CartctlWarning where the set is not reached.
        """
        q0 = self.robot.check_configuration(q0, "q0")
        if not self.solver.extends or self.objective is None:
            return q0
        return onto_extremal_set(self.robot, self.tasks, self.objective, q0)

    def step(self, q: FloatArray, v: FloatArray | None = None, t: float = 0.0) -> Command:
        """The command at configuration q (nq,), velocity v (nv,) (zeros if None) and time t in s.

        Raises ShapeError, NonFiniteError, ConfigurationError, TargetError; afterwards the next good step works as if
        nothing had happened. A singularity is a status of ``command.solution``.
        """
        stroke = self._stroke
        if stroke is None:
            return self._stepped(q, v, t)
        if self.solver is stroke.solver and self.tasks is stroke.tasks and self.objective is None:
            if not self._ahead:
                self._hand_over(stroke)
            command = stroke.step(q, v, t)
            if command is not None:
                return command
        ahead = self._ahead
        self._fall_back()
        try:
            return self._stepped(q, v, t)
        except BaseException:  # a refused step leaves no trace
            self._ahead = ahead
            raise

    def _stepped(self, q: FloatArray, v: FloatArray | None, t: float) -> Command:
        """The general way: a Problem by the level, answered by the solver."""
        state = self.observe(q, v, t)
        if self.level.loads is not None:
            self.level.loads.time = t
        anchors = self._anchors if self._anchors is not None else [task.anchor(state) for task in self.tasks]
        metric = self._metric if self._metric is None or isinstance(self._metric, np.ndarray) else self._metric(state)
        started = t if self._started is None else self._started
        secondary = self._alone if self.objective is None else self._secondary(t - started)
        times = self._clocks.times(t)
        confines = self._confining.at(state, self.tasks, self._clocks.paces)
        midway, found = self._confining.midway, None
        if self._fused is not None:
            found = self._fused.answer(state, times, anchors, secondary, confines, self._last)
        if found is None:
            problem, references = self.level.problem(state, self.tasks, times, anchors, secondary, metric, confines)
            if self.objective is None:
                self._confining.slow_down(self.tasks, problem, state)
            else:
                self._confining.look_away()
            left, guarded, halted = self._guard.guard(problem, state)
            solution = self._halt(left, state) if halted else self._solve(left, state, self._last)
            close = midway is not None and not halted and midway.concerns(left, solution.u)
        else:
            solution, references, close = found
            solution.recovering, guarded, left = self._confining.recovering, False, None
        if close and midway is not None:
            solution = self._over_the_step(midway, left, solution, state, confines)
        solution.guarded = guarded
        self._anchors, self._started = anchors, started  # only now: a refused step leaves no trace
        self._last = solution
        self._step_times = times
        if self._waiting:
            self._clocks.tick(t, times, references, problem.equations, solution.u, self.tasks)
        if found is None and self.objective is None:
            self._confining.look_on(self.tasks, references, problem, state, solution.u)
        return self.level.command(solution, references, state)

    @property
    def constraints(self) -> tuple[Constraint, ...]:
        """The Cartesian constraints that are kept."""
        return self._confining.constraints

    @property
    def singularity(self) -> Any:
        """The policy in force near singularities, None where that is the solver's own business."""
        return self._guard.policy

    @property
    def halted(self) -> bool:
        """Whether ``singularity="halt"`` has stopped the robot; :meth:`reset` lets it go on."""
        return self._guard.halted

    def _halt(self, problem: Problem, state: State) -> Solution:
        """To rest, as fast as the bounds allow; no task is followed."""
        u = problem.clip(self._confining.stopping(problem, state))
        still = np.zeros(len(problem.equations))
        solution = Solution(problem, u, self.solver.name, status=Status.SINGULAR, scales=still)
        solution.recovering = self._confining.recovering
        return solution

    def _over_the_step(
        self, midway: Midway, problem: Problem | None, solution: Solution, state: State, confines: Confines
    ) -> Solution:
        """The answer that keeps the bounds over the step, and not only at its beginning; None: its own problem."""
        for k in range(ROUNDS):
            blocks = midway.better(solution.u, state, confines, again=k > 0)
            if blocks is None:
                break
            p = problem = problem or solution.problem
            bounds = (p.lower, p.upper, blocks)
            p = Problem.trusted(p.equations, p.metric, p.reference, *bounds)
            solution = self._solve(p, state, solution, at=midway.state)
        return solution

    def _solve(self, problem: Problem, state: State, start: Solution | None, at: State | None = None) -> Solution:
        """The solver's answer, from an earlier one; where limits exclude each other they yield in their order.

        A task with no feasible scale but 0 is asked for what it can do. at: where M and h are taken from, if not from
        the state.
        """
        solution = self.solver.solve(problem, start)
        yielded: tuple[str, ...] = ()
        if problem.constraints is not None and missed(solution):
            yielded = ("constraints",)
            if self._confining.yields:
                problem, best, yielded = self._confining.widened(problem, state, at)
                solution = self.solver.solve(problem)
                if missed(solution):
                    solution = Solution(problem, best, self.solver.name, status=Status.INFEASIBLE)
        if self._stands_still(solution) and (reachable := within_reach(problem, self.solver.solve)) is not None:
            problem, solution = reachable, self.solver.solve(reachable)
        if _skipped(solution) or (self._confining.yields and solution.failed):
            stopping = self._confining.stopping(problem, state, at)
            again = slowed(problem, ~(solution.scales == 1.0), stopping)
            solution = self.solver.solve(again, solution)
            if self._confining.yields and (_skipped(solution) or solution.failed):
                skipped = np.full(len(again.equations), np.nan)  # what is left is to brake, within all bounds
                solution = Solution(again, stopping, self.solver.name, status=Status.SKIPPED, scales=skipped)
        solution.recovering, solution.yielded = self._confining.recovering, yielded
        return solution

    def _stands_still(self, solution: Solution) -> bool:
        """Whether the first task's command is scaled to nothing, or has no scale, and a task has lost rank."""
        if not (solution.lost_rank and isinstance(self.solver, SNS)):
            return False
        return solution.problem.equations[0].fit == "scale" and not bool(solution.scales[0] > 0.0)

    def _secondary(self, elapsed: float) -> Secondary:
        """The objective, its share rising as 3 x^2 - 2 x^3 over the soft start."""
        x = 1.0 if elapsed >= self.soft_start else max(elapsed, 0.0) / self.soft_start
        spends = "reference" in self.solver.honours
        return Secondary(self.objective, x * x * (3.0 - 2.0 * x), self._extend, self._weighing, spends)

    def observe(self, q: FloatArray, v: FloatArray | None = None, t: float = 0.0) -> State:
        """The controller's own State, moved to (q, v); valid until the next call. Raises as :meth:`step`."""
        robot = self.robot
        if not (
            type(q) is np.ndarray
            and q.dtype == np.float64
            and q.shape == (robot.nq,)
            and is_moderate(q)
            and robot.is_on_manifold(q)
        ):
            q = robot.check_configuration(q)
        if v is None:
            v = self._zeros
        elif not (type(v) is np.ndarray and v.dtype == np.float64 and v.shape == (robot.nv,) and is_moderate(v)):
            v = checks.vector("v", v, robot.nv, largest=LARGEST)
        if not (type(t) is float and math.isfinite(t)):
            checks.number("t", t)
        self._state.set(q, v, t)
        return self._state

    @property
    def anchors(self) -> list[Any]:
        """What each task holds on to since the first step."""
        anchors = self._stroke.lasting.anchors if self._ahead and self._stroke is not None else self._anchors
        return [None] * len(self.tasks) if anchors is None else anchors


def _skipped(solution: Solution) -> bool:
    """Whether a task has no feasible scale; of few numbers, a loop knows sooner than an array."""
    return any(s != s for s in solution.scales.tolist())
