"""Torque level: u = tau, A = J M^-1, b as at the acceleration level, drift J_dot v - J M^-1 h (dynamic)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np

from cartctl import checks
from cartctl.algebra.problem import Equation, Problem
from cartctl.algebra.solution import Solution
from cartctl.algebra.svd import scale
from cartctl.checks import FloatArray, is_finite
from cartctl.constraints import Box, Constraint, Rows
from cartctl.dynamics.friction import Friction
from cartctl.levels.acceleration import AccelerationLevel, check_solver
from cartctl.levels.acceleration_bounds import AccelerationBounds
from cartctl.levels.base import UNCONFINED, Command, Confines, Level, Motion, Secondary, require_finite
from cartctl.levels.bounds import JointBounds
from cartctl.levels.inertia import by_inertia, singular
from cartctl.levels.loads import Loads, require_actuated
from cartctl.levels.metrics import DYNAMIC, Named
from cartctl.levels.torque_bounds import through_inertia_rows
from cartctl.levels.torque_kernel import through_inertia
from cartctl.levels.torque_reference import drawn_to
from cartctl.model.robot import Robot
from cartctl.model.state import State
from cartctl.model.wrench import Wrench
from cartctl.solvers import Solver
from cartctl.tasks.base import Reference, Task

_NONE = np.zeros(0)


# What tasks of m rows ask of a, ``J a + drift = r_ddot + 2 k (r_dot - J v) + k^2 e``: J; drift, error, rate,
# acceleration, k, or k of each row, for the kernel; rows of each; the references. A bare tuple, for a hot loop.
Asked = tuple[FloatArray, tuple[Any, ...], Sequence[int], list[Reference]]


class TorqueLevel(Level):
    """u = tau (nv,), N m or N: ``J M^-1 tau + (J_dot v - J M^-1 h) = r_ddot_ref + K_d e_dot + K_p e`` for every task.

    ``M a + h = tau`` with h the Coriolis, centrifugal and gravity torques, friction and known wrenches
    (:mod:`cartctl.levels.loads`). The metric on tau gives the classical norms: ``"identity"`` least torque,
    ``"inverse-inertia"`` the dynamically consistent choice ``tau = J^T Lambda c`` of the operational space (Khatib
    1987), ``"inverse-inertia-squared"`` least acceleration, ``tau = M J# c``.

    damping: D >= 0, a number or (nv,), of motion in the null space. With the two metrics of inertia
    ``u0 = h - M D v`` (+ ``k M grad H``), D in 1/s; with any other ``u0 = h - D v`` (+ ``k grad H``), D in N m s/rad.
    0 without an objective is the classical form, ``u0 = 0``: its null space falls under gravity, and with least torques
    it is known to gain speed without bound (Hollerbach & Suh 1987); these favour light joints, a wrist may spin even
    damped. Damping needs a solver that honours a reference. None means 0 where the solver takes none, else 20 1/s, or
    ``D_i = min(3 N m s/rad + 10 M_ii /s, 300 M_ii /s)``, which a step of some ms can follow at light joints, too.

    Torque bounds are a box; position, velocity and acceleration limits rows ``C = M^-1``, near them those of the middle
    of the step (:mod:`cartctl.levels.midway`); they yield in the order of :mod:`cartctl.levels.yielding`.

    Raises ParameterError, NonFiniteError; ShapeError, FrameNotFound, UnderactuatedRobot when a controller is made.
    """

    name: ClassVar[str] = "torque"
    bounds: ClassVar[type[JointBounds] | None] = AccelerationBounds
    stable_below: ClassVar[float] = 1.0
    limits_are_rows: ClassVar[bool] = True
    metrics: ClassVar[Named] = DYNAMIC

    def __init__(
        self,
        damping: float | FloatArray | None = None,
        *,
        friction: Friction | None = None,
        wrenches: Wrench | Sequence[Wrench] = (),
    ) -> None:
        self.damping = None if damping is None else checks.amounts("damping", damping)
        self._damps = damping is not None and bool(np.any(self.damping))
        self.loads: Loads = Loads(friction, wrenches)
        self._motion = AccelerationLevel()
        self._kernel: Any = through_inertia

    def check(self, solver: Solver) -> None:
        """As at the acceleration level; refuses damping with a solver that takes no reference."""
        check_solver(self.name, solver, self._damps and self.damping is not None)
        self._kernel = through_inertia.compiled

    def check_robot(self, robot: Robot) -> None:
        """Every coordinate needs a motor, and the inertia matrix has to be definite."""
        super().check_robot(robot)
        require_actuated(robot)

    def problem(
        self,
        state: State,
        tasks: Sequence[Task],
        times: Sequence[float],
        anchors: Sequence[Any],
        secondary: Secondary,
        metric: FloatArray | None,
        confines: Confines = UNCONFINED,
    ) -> tuple[Problem, list[Reference]]:
        """The problem of this instant, and the references it was made from; raises NonFiniteError, ShapeError."""
        lower, upper, outside, _, torque = confines
        M = state.mass_matrix  # before the Jacobians, which come along
        J, rest, sizes, references = self.asked(state, tasks, times, anchors)
        h = self.loads.effects(state)
        low, high = (_NONE, _NONE) if lower is None or upper is None else (lower, upper)
        (m, nv), r = J.shape, low.shape[0]
        rows, sides = np.empty((m + r, nv)), np.empty((2, m + r))
        if not self._kernel(M, h, state.v, J, *rest, low, high, rows, sides):
            raise singular(state)
        asked, known = sides
        equations, start = [], 0
        for k, task in enumerate(tasks):
            end = start + sizes[k]
            equations.append(_equation(task, state, J[start:end], rows[start:end], asked[start:end], known[start:end]))
            start = end
        blocks = (rows[m:], asked[m:], known[m:]) if r else None
        if outside is not None:
            blocks = through_inertia_rows(state, h, blocks, outside)
        u0 = drawn_to(state, h, secondary, self.damping)
        least, most = (None, None) if torque is None else torque
        return Problem.trusted(tuple(equations), metric, u0, least, most, blocks), references

    def asked(
        self,
        state: State,
        tasks: Sequence[Task],
        times: Sequence[float],
        anchors: Sequence[Any],
    ) -> Asked:
        """The tasks' rows on a; of one task in pieces, for the kernel to put together."""
        if len(tasks) == 1:
            task = tasks[0]
            reference = task.reference(state, times[0], anchors[0])
            J, gain = task.jacobian(state), task.gain
            drift = task.drift(state)
            rate = _NONE if reference.rate is None else reference.rate
            acceleration = _NONE if reference.acceleration is None else reference.acceleration
            k = (0.0, gain) if isinstance(gain, np.ndarray) else (gain, _NONE)
            return J, (drift, reference.error, rate, acceleration, *k), J.shape[:1], [reference]
        problem, references = self._motion.problem(state, tasks, times, anchors, Secondary(), None)
        J, b, drift = (np.concatenate([getattr(e, name) for e in problem.equations]) for name in ("A", "b", "drift"))
        return J, (drift, b, _NONE, b, 0.0, _NONE), problem.sizes, references

    def rows(self, constraint: Constraint, state: State, dt: float, box: Box | None) -> Rows:
        """The rows of a constraint on a."""
        return constraint.acceleration_rows(state, dt, box)

    def motion(self, state: State) -> Motion:
        """``a = M^-1 (tau - h)``; u is the torque."""
        n, h = state.robot.nv, self.loads.effects(state)
        T = by_inertia(state, np.eye(n))
        return Motion(T, -(T @ h), np.eye(n), np.zeros(n))

    def stopping(self, state: State, dt: float) -> FloatArray:
        """``h - M v/dt``."""
        return self.loads.effects(state) - state.mass_matrix @ (state.v / dt)

    def command(self, solution: Solution, references: Sequence[Reference], state: State) -> Command:
        """U is the torque."""
        return Command(solution, references, torque=solution.u)


def _equation(task: Task, state: State, J: FloatArray, A: FloatArray, b: FloatArray, drift: FloatArray) -> Equation:
    """One task's rows; raises NonFiniteError."""
    if not (is_finite(b) and is_finite(drift)):
        require_finite(b, f"the command of task {task.name!r}")
        require_finite(drift, f"the drift of task {task.name!r}")
    natural = task.size(state)
    if natural:
        natural *= _stretch(J, A)
    return Equation.trusted(A, b, drift, task.fit, task.weight, task.name, natural)


def _stretch(J: FloatArray, A: FloatArray) -> float:
    """How much larger ``A = J M^-1`` is than J."""
    size = scale(J)
    return scale(A) / size if size > 0.0 else 1.0
