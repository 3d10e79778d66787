"""A clock for every path: a target waits for a hand that was slowed down, so that it stays on its path.

While a task is delivered at the share s, its own time advances by s dt. s is what was really achieved,
``s = b . (A u + d) / b . b`` within [0, 1], times the pace at which the path was asked for; so the clock runs full time
wherever nothing is held back.
"""

from __future__ import annotations

from collections.abc import Sequence

from cartctl.algebra.problem import Equation
from cartctl.checks import FloatArray
from cartctl.tasks.base import Reference, Task


class PathClocks:
    """How far the targets of several tasks are behind the time that everybody else's clock shows."""

    def __init__(self, running: Sequence[bool]) -> None:
        self._running = tuple(running)
        self._any = any(self._running)
        self.reset()

    def reset(self) -> None:
        """Show the same time as everybody else's."""
        self._delays = [0.0] * len(self._running)
        self._shares = [1.0] * len(self._running)
        self._paces = [1.0] * len(self._running)
        self._last: float | None = None

    @property
    def paces(self) -> list[float]:
        """The share of its speed at which each path was asked for in the last step."""
        return self._paces

    @property
    def kept(self) -> tuple[list[float], list[float], list[float], float | None]:
        """Delays, shares, paces, and when the last step was: what :meth:`resume` goes on from."""
        return self._delays, self._shares, self._paces, self._last

    def resume(
        self, delays: Sequence[float], shares: Sequence[float], paces: Sequence[float], last: float | None
    ) -> None:
        """Go on from another clock."""
        self._delays, self._shares, self._paces, self._last = list(delays), list(shares), list(paces), last

    def times(self, t: float) -> list[float]:
        """The targets' times at time t."""
        if not self._any or self._last is None:
            return [t - delay for delay in self._delays]
        passed = max(t - self._last, 0.0)
        return [t - d - (1.0 - s) * passed for d, s in zip(self._delays, self._shares, strict=True)]

    def tick(
        self,
        t: float,
        times: Sequence[float],
        references: Sequence[Reference],
        equations: Sequence[Equation],
        u: FloatArray,
        tasks: Sequence[Task],
    ) -> None:
        """Take note of a step made at time t: what was commanded, and what u delivers of it."""
        if not self._any:
            return
        self._delays = [t - own for own in times]
        self._last = t
        self._paces = [r.pace for r in references]
        self._shares = [
            1.0 if task.rests or not running else r.pace * delivered(e, u)
            for r, e, task, running in zip(references, equations, tasks, self._running, strict=False)
        ]


def delivered(e: Equation, u: FloatArray) -> float:
    """``b . (A u + d) / b . b``, in [0, 1]; 1 where nothing is commanded."""
    asked = float(e.b @ e.b)
    if asked == 0.0:
        return 1.0
    moved = e.A @ u if e.drift is None else e.A @ u + e.drift
    return min(max(float(e.b @ moved) / asked, 0.0), 1.0)
