"""Several solvers on one course, one after the other; those that refuse are remembered with their reason."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

import cartctl as cc
from cartctl.cli.console import progress, say
from cartctl.cli.course import Course
from cartctl.cli.method import make_solver, spends_redundancy
from cartctl.errors import ProblemError, UnsupportedProblem
from cartctl.objectives.named import aimed, in_words
from cartctl.report import Comparison


class Contest:
    """The solvers that take the course, each with its damping or None; ``runs`` and ``refused`` fill as it goes on.

    Raises what the controller raises for options that no solver could take.
    """

    def __init__(self, course: Course, dampings: Mapping[str, float | None], goal: cc.Objective | None) -> None:
        self.course, self.size = course, len(dampings)
        self.goal = aimed(goal, course.hand.frame, course.axes)
        self.controllers: dict[str, cc.Controller] = {}
        self.refused: dict[str, str] = {}
        self.runs: dict[str, cc.Run] = {}
        for name, damping in dampings.items():
            try:
                solver = make_solver(name, damping)
                self.controllers[name] = course.controller(solver, goal if spends_redundancy(solver) else None)
            except (UnsupportedProblem, ProblemError) as error:
                self.refused[name] = str(error)

    def run(self, place: Callable[[str], Path]) -> bool:
        """Let each have its turn and save it to ``place`` of its name at once; whether Ctrl-C left all of them one."""
        end, name = self.course.end, ""
        total = len(self.controllers)
        try:
            with progress("comparing") as tell:
                for turn, (name, controller) in enumerate(self.controllers.items()):

                    def told(k: int, n: int, turn: int = turn, name: str = name) -> None:
                        tell(turn * n + k, total * n, f"{turn + 1} of {total}: {name}")

                    try:
                        run = cc.simulate(controller, duration=end, progress=told)
                    except (UnsupportedProblem, ProblemError) as error:
                        self.refused[name] = str(error)
                    else:
                        run.save(place(name))
                        self.runs[name] = run
        except KeyboardInterrupt:
            kept = "what is done follows" if self.runs else "nothing is done yet"
            say("interrupted", f"during {name}, {len(self.runs)} of {self.size} solvers done; {kept}", "bold yellow")
            return False
        return True

    def comparison(self) -> Comparison:
        """The runs that are done, at least one."""
        notes = {name: ", ".join(self._notes(name, run)) for name, run in self.runs.items()}
        return Comparison(self.runs, refused=self.refused, notes=notes, objective=self.goal)

    def _notes(self, name: str, run: cc.Run) -> list[str]:
        controller = self.controllers[name]
        said = {
            "no objective": self.goal is not None and controller.objective is None,
            "no limits": controller.limits is None,
            "starts elsewhere": not np.array_equal(run.q[0], self.course.robot.home),
        }
        return [words for words, holds in said.items() if holds]

    def reasons(self) -> str:
        """Why each was refused."""
        return "; ".join(f"{name}: {reason}" for name, reason in self.refused.items())

    def purpose(self) -> str:
        """Which solvers are led by the objective."""
        if self.goal is None:
            return "none"
        led = [name for name, controller in self.controllers.items() if controller.objective is not None]
        if not led:
            return "none, since no solver here has a null-space term"
        rest = "" if len(led) == self.size else f"; for {len(led)} of {self.size}, the others have no null-space term"
        return in_words(self.goal) + rest

    def limits(self) -> str:
        """Which solvers keep the limits."""
        able = [name for name, controller in self.controllers.items() if controller.limits is not None]
        if len(able) == len(self.controllers) and able:
            return "enforced"
        who = f"enforced by {', '.join(able)}, the others run" if able else "not enforced: the solvers run"
        return f"{who} without them; violations are counted"
