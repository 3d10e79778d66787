"""Time as the wall has it: how many steps are due, and how well a loop keeps up."""

from __future__ import annotations

import time
from collections.abc import Callable

FPS = 30.0  # pictures a second
_LATE = 0.1  # s behind the wall from which on the lost time is given up
_WINDOW = 0.5  # s over which the speed is told


class Pace:
    """Steps of ``dt`` s kept level with a clock (s): :meth:`due` says how many to make before the next picture.

    A loop that cannot keep up runs slower than real time instead of falling ever further behind; ``speed`` says by how
    much, 1 for real time.
    """

    def __init__(self, dt: float, clock: Callable[[], float] = time.monotonic) -> None:
        self.dt, self._clock = dt, clock
        self.speed = 1.0
        self.restart()

    def restart(self) -> None:
        """Begin anew, after a standstill."""
        self._begun = self._told = self._clock()
        self._made = self._made_then = 0

    def due(self) -> int:
        """The steps that are missing now."""
        now = self._clock()
        missing = int((now - self._begun) / self.dt) - self._made
        most = max(int(_LATE / self.dt), 1)
        if missing > most:
            self._begun += (missing - most) * self.dt
            missing = most
        return max(missing, 0)

    def made(self, steps: int) -> None:
        """Take note of steps that were made."""
        self._made += steps
        now = self._clock()
        if now - self._told >= _WINDOW:
            self.speed = (self._made - self._made_then) * self.dt / (now - self._told)
            self._told, self._made_then = now, self._made

    def spare(self, since: float) -> float:
        """Seconds left of a picture that was begun at ``since``."""
        return max(1.0 / FPS - (self._clock() - since), 0.0)

    def now(self) -> float:
        """The clock's time, s."""
        return self._clock()
