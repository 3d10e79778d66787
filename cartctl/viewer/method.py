"""What may be changed while the robot moves: solver, level, objective; and the controller that follows from it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from cartctl.errors import CartctlError
from cartctl.levels import Level, get_level
from cartctl.model.limits import Limits
from cartctl.motion.controller import Controller
from cartctl.objectives.base import Objective
from cartctl.objectives.named import KNOWN, aimed
from cartctl.solvers import Solver, get_solver, solvers
from cartctl.tasks import FrameTask

LEVELS = ("velocity", "acceleration", "torque")
OWN, NONE = "as given", "none"  # objectives that are no names
_ROWS = ("x", "y", "z", "rx", "ry", "rz")
_TORQUE_METRIC = "inverse-inertia"


def usable_solvers() -> list[str]:
    """The names of those that need nothing but a name."""
    return [name for name in solvers() if _made(name) is not None]


@dataclass(frozen=True)
class Method:
    """A choice. objective: a name of ``cartctl.objectives.named``, ``OWN`` or ``NONE``. strength: times its gain."""

    solver: str
    level: str
    objective: str = OWN
    strength: float = 1.0

    def controller(self, base: Controller, limits: Limits) -> Controller:
        """``base`` by this method, under ``limits`` where solver and level honour any.

        Raises as :class:`cartctl.Controller`.
        """
        same = self.solver == base.solver.name
        solver = base.solver if same else get_solver(self.solver)
        level = base.level if self.level == base.level.name else get_level(self.level)
        able = "bounds" in solver.honours and level.bounds is not None
        return base.replace(
            solver=solver, level=level, limits=limits if able else None, objective=self._objective(base, solver),
            metric=_metric(base, solver, level),
        )  # fmt: skip

    def remark(self) -> str:
        """What of the choice this solver cannot honour and the robot therefore does without, "" for nothing."""
        solver = get_solver(self.solver)
        missing = (
            [] if "bounds" in solver.honours else ["knows no limits: the target is only approached at a bounded speed"]
        )
        if self.objective != NONE and not _spends(solver):
            missing.append("has no room for an objective in its null space")
        return f"{self.solver} {', and '.join(missing)}." if missing else ""

    def _objective(self, base: Controller, solver: Solver) -> Objective | None:
        """None where the solver has no room for one."""
        if self.objective == NONE or not _spends(solver):
            return None
        chosen = base.objective
        if self.objective != OWN:
            known = KNOWN[self.objective]
            chosen = known.make(known.gain)
            hand = next((task for task in base.tasks if isinstance(task, FrameTask)), None)
            if hand is not None:
                chosen = aimed(chosen, hand.frame, " ".join(_ROWS[row] for row in hand.rows))
        return chosen if chosen is None or self.strength == 1.0 else self.strength * chosen


def name_of(objective: Objective | None) -> str:
    """The name that stands for an objective, ``OWN`` for one that has none."""
    if objective is None:
        return NONE
    for name, known in KNOWN.items():
        if type(known.make(known.gain)) is type(objective) and objective.gain == known.gain:
            return name
    return OWN


def _spends(solver: Solver) -> bool:
    return "reference" in solver.honours or solver.extends


def _made(name: str) -> Solver | None:
    try:
        return get_solver(name)
    except (CartctlError, TypeError):  # it needs more than its name
        return None


def _metric(base: Controller, solver: Solver, level: Level) -> Any:
    """The controller's own where the level knows it; of torques, the dynamically consistent one."""
    own = base.metric
    if own is not None and (not isinstance(own, str) or own in level.metrics) and solver.takes_metric:
        return own
    return _TORQUE_METRIC if level.name == "torque" and solver.takes_metric else None
