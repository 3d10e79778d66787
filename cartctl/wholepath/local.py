"""What the local methods make of the same path: each simulated, sampled, and judged as the plan is."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cartctl.checks import FloatArray
from cartctl.errors import CartctlError, CartctlWarning, ParameterError
from cartctl.model.limits import Limits
from cartctl.motion.controller import Controller
from cartctl.motion.run import Run
from cartctl.motion.simulate import simulate
from cartctl.objectives import JointRange
from cartctl.solvers import Solver, get_solver
from cartctl.tasks.base import Task
from cartctl.wholepath.costs.base import PathCost
from cartctl.wholepath.costs.speed import has_inertia
from cartctl.wholepath.manifold import Projected, look
from cartctl.wholepath.rows import Rows
from cartctl.wholepath.setting import Setting
from cartctl.wholepath.sqp import excess_of
from cartctl.wholepath.trace import Trace

ON_TASK = 1e-3  # m or rad: a local method that is farther from its task at some sample does not do it
_STEP = 7e-3  # s, the longest step of a local method


@dataclass(frozen=True, eq=False)
class LocalMethod:
    """One local method on the path of a plan.

    name, run: what it was and did. cost: by the plan's quadrature at the plan's samples; inf where the run broke off.
    residual: the largest task error at a sample, m or rad. excess: the worst violation of a limit, in half-ranges, <= 0
    inside. drift: the largest joint distance over a lap of a closed path, rad or m, None for an open one.
    """

    name: str
    run: Run
    cost: float
    residual: float
    excess: float
    drift: float | None

    @property
    def on_task(self) -> bool:
        """Whether it does its task, to a millimetre or milliradian at every sample."""
        return self.residual <= ON_TASK

    @property
    def keeps(self) -> bool:
        """Whether it does its task within the limits."""
        return self.on_task and self.excess <= 1e-9


def controllers(setting: Setting, tasks: Sequence[Task], methods: Sequence[Any] | None) -> list[tuple[str, Controller]]:
    """The local methods asked for, by name; raises what :class:`cartctl.Controller` raises, ParameterError."""
    dt = setting.h / max(int(np.ceil(setting.h / _STEP - 1e-9)), 1)
    common: dict[str, Any] = {"robot": setting.robot, "tasks": list(tasks), "dt": dt}
    limits = setting.limits
    if methods is None:
        spare = JointRange() if np.isfinite(setting.robot.limits.position_upper).any() else None
        heavy = has_inertia(setting.robot)
        found = [("pinv", Controller(solver="pinv", limits=None, **common))]
        if heavy:
            found.append(("pinv, inertia", Controller(solver="pinv", limits=None, metric="inertia", **common)))
        if spare is not None:
            how: dict[str, Any] = {
                "solver": "projected-gradient",
                "limits": None,
                "objective": spare,
                "soft_start": 0.5,
            }
            found.append(("projected-gradient, joint range", Controller(**how, **common)))
        if limits is not None:
            held: dict[str, Any] = {"solver": "sns", "limits": limits, "path_clock": False}  # the timing is given
            found.append(("sns", Controller(**held, **common)))
            if heavy:
                found.append(("sns, inertia", Controller(metric="inertia", **held, **common)))
        return found
    named: dict[str, Controller] = {}
    for method in _listed(methods):
        name, controller = _controller(method, limits, common)
        same = sum(known == name or known.startswith(f"{name} (") for known in named)
        named[f"{name} ({same + 1})" if same else name] = controller
    return list(named.items())


def _listed(methods: Any) -> list[Any]:
    if isinstance(methods, (str, Solver, Controller)):
        return [methods]
    if not isinstance(methods, Sequence):
        raise ParameterError(f"methods is a {type(methods).__name__}; expected names of solvers, or Controllers")
    return list(methods)


def _controller(method: Any, limits: Limits | None, common: dict[str, Any]) -> tuple[str, Controller]:
    if isinstance(method, Controller):
        if method.robot is not common["robot"]:
            raise ParameterError("methods holds a Controller of another robot; expected one of the plan's own")
        metric = f", {method.metric}" if isinstance(method.metric, str) else ""
        return method.solver.name + metric, method
    solver = get_solver(method)
    held = limits if "bounds" in solver.honours else None
    return solver.name, Controller(solver=solver, limits=held, **common)


def rolled_out(
    setting: Setting, cost: PathCost, name: str, controller: Controller, start: FloatArray
) -> tuple[LocalMethod, FloatArray | None]:
    """The method's run from ``start``, judged, and its joint path Q (S, nq) at the samples, None if it broke off."""
    every = int(round(setting.h / controller.dt))
    if abs(every * controller.dt - setting.h) > 1e-9 * setting.h:
        raise ParameterError(
            f"a Controller in methods has dt = {controller.dt:g} s; expected a whole part of the time between two "
            f"samples, {setting.h:g} s"
        )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", CartctlWarning)
        run = simulate(controller, start, (setting.size - 1) * setting.h, t0=float(setting.times[0]))
    Q = run.q[::every]
    if len(Q) != setting.size:
        return LocalMethod(name, run, np.inf, np.inf, np.inf, None), None
    try:
        with np.errstate(all="ignore"):
            E, J = look(setting, Q)
            trace = Trace(setting, Projected(Q, E, J, np.ones(len(Q), dtype=bool)))
            value = float(cost.value(trace))
            excess = -np.inf if setting.limits is None else excess_of(Rows(setting.limits), trace)
    except CartctlError:
        return LocalMethod(name, run, np.inf, np.inf, np.inf, None), None
    residual = float(np.linalg.norm(E, axis=1).max())
    drift = run.metrics().path_drift if len(run) else None
    return LocalMethod(name, run, value if np.isfinite(value) else np.inf, residual, excess, drift), Q
