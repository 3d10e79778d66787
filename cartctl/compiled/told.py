"""What a fused step tells whoever asks: a Command whose Solution, Problem and references are put together then."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from cartctl.algebra.problem import Equation, Problem
from cartctl.algebra.solution import Solution
from cartctl.checks import FloatArray
from cartctl.compiled.answer_kernel import AGAIN_BIT, LOST_BIT
from cartctl.compiled.workspace import NAMES
from cartctl.levels.base import Command
from cartctl.levels.calming import Above
from cartctl.solvers import Solver
from cartctl.tasks.base import Reference


class Told:
    """How the copies of steps are read, as :func:`cartctl.compiled.answer_kernel.told_size` lays them out.

    parts: where each task's rows begin and end. named: fit, weight and name of each. moving: which follow a path.
    """

    def __init__(
        self,
        nv: int,
        parts: Sequence[tuple[int, int]],
        named: Sequence[tuple[str, float, str]],
        moving: Sequence[bool],
        bounded: bool,
        scaled: bool,
        solver: Solver,
    ) -> None:
        self._nv, self._parts, self._named, self._moving = nv, parts, named, moving
        self._bounded, self._scaled, self._solver = bounded, scaled, solver
        self._m, self._p = parts[-1][1], len(parts)

    def references(self, out: FloatArray) -> list[Reference]:
        """Each task's error, and its target's rates."""
        a, m = 2 * self._nv + 5 * self._p, self._m
        error, rate, bend = (out[a + i * m : a + (i + 1) * m] for i in range(3))
        paces = self._of_tasks(out, 2).tolist()
        return [
            Reference(error[i:j], rate[i:j], bend[i:j], pace) if moves else Reference(error[i:j])
            for (i, j), moves, pace in zip(self._parts, self._moving, paces, strict=True)
        ]

    def solution(self, u: FloatArray, out: FloatArray, outcome: int, recovering: bool) -> Solution:
        """The answer, its problem to be put together when somebody asks."""
        solver = self._solver
        scales = self._of_tasks(out, 0) if self._scaled else None
        problem = partial(self._problem, out, outcome)
        status, lost = NAMES[outcome & 15], outcome & LOST_BIT != 0
        solution = Solution(problem, u, solver.name, solver, status, lost, scales)
        solution.recovering = recovering
        return solution

    def _of_tasks(self, out: FloatArray, which: int) -> FloatArray:
        a = 2 * self._nv + which * self._p
        return out[a : a + self._p]

    def _problem(self, out: FloatArray, outcome: int) -> Problem:
        """The problem that was answered last, with what was asked again."""
        n, m = self._nv, self._m
        a = 2 * n + 5 * self._p + 3 * m
        b, b_again, d_again = (out[a + i * m : a + (i + 1) * m] for i in range(3))
        given = out[a + 3 * m : a + 4 * m]
        A, natural = out[a + 4 * m :].reshape(m, n), self._of_tasks(out, 1).tolist()
        again = self._of_tasks(out, 3) if outcome & AGAIN_BIT else [0.0] * self._p
        calm = self._of_tasks(out, 4).tolist()
        equations: list[Equation] = []
        for k, (i, j) in enumerate(self._parts):
            fit, weight, name = self._named[k]
            asked, drift = b[i:j], None
            if calm[k]:
                above = Above(ranked=True)
                for e in equations:
                    above.add(e.A, b[: e.A.shape[0]], calm[k])
                asked = above.calmed(A[i:j], asked, (out[:n], out[n : 2 * n]) if self._bounded else None)
            if given[i:j].any():
                asked, drift = asked - given[i:j], -given[i:j]
            if again[k]:
                asked, drift = b_again[i:j], d_again[i:j] if k == 0 else None
                fit = "scale" if k == 0 else "least_squares"
            equations.append(Equation.trusted(A[i:j], asked, drift, fit, weight, name, natural[k]))
        lower, upper = (out[:n], out[n : 2 * n]) if self._bounded else (None, None)
        return Problem.trusted(tuple(equations), None, None, lower, upper)


class FusedCommand(Command):
    """A Command that holds a copy of its step, and makes solution and references of it when asked."""

    __slots__ = ("_known", "_said", "_step")
    acceleration = None
    _torque = None

    def __init__(self, u: FloatArray, step: tuple[Told, FloatArray, int, bool]) -> None:
        self.velocity = u
        self._step = step  # two attributes, and no more until somebody asks

    @property
    def solution(self) -> Solution:  # type: ignore[override]
        """The Solution behind it."""
        try:
            return self._known
        except AttributeError:
            told, out, outcome, recovering = self._step
            assert self.velocity is not None
            self._known: Solution = told.solution(self.velocity, out, outcome, recovering)
            return self._known

    @property
    def references(self) -> list[Reference]:  # type: ignore[override]
        """Each task's error and target rates at this step."""
        try:
            return self._said
        except AttributeError:
            self._said: list[Reference] = self._step[0].references(self._step[1])
            return self._said
