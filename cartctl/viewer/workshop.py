"""Controllers made aside, so that the robot keeps moving while one is prepared: compiling may take a while."""

from __future__ import annotations

import threading

from cartctl.checks import FloatArray
from cartctl.errors import CartctlError
from cartctl.model.limits import Limits
from cartctl.motion.controller import Controller
from cartctl.viewer.method import Method


class Workshop:
    """Makes the controller last asked for, in a thread of its own; earlier wishes that still wait are dropped.

    base: the controller whose robot and tasks all of them have.
    """

    def __init__(self, base: Controller) -> None:
        self._base = base
        self._lock = threading.Condition()
        self._wish: tuple[Method, Limits, FloatArray] | None = None
        self._ready: tuple[Method, Controller | str] | None = None
        self._busy = self._closed = False
        threading.Thread(target=self._work, name="cartctl workshop", daemon=True).start()

    def ask(self, method: Method, limits: Limits, q: FloatArray) -> None:
        """Wish for a controller by ``method``, to be tried once at q (nq,)."""
        with self._lock:
            self._wish, self._ready = (method, limits, q), None
            self._lock.notify()

    def collect(self) -> tuple[Method, Controller | str] | None:
        """What has become ready since: the controller, or why there is none."""
        with self._lock:
            ready, self._ready = self._ready, None
        return ready

    @property
    def busy(self) -> bool:
        """Whether a wish is not fulfilled yet."""
        with self._lock:
            return self._busy or self._wish is not None

    def close(self) -> None:
        """Make no more; what is under way is left to itself."""
        with self._lock:
            self._closed = True
            self._lock.notify()

    def _work(self) -> None:
        while True:
            with self._lock:
                while self._wish is None and not self._closed:
                    self._lock.wait()
                if self._closed or self._wish is None:
                    return
                (method, limits, q), self._wish, self._busy = self._wish, None, True
            made: Controller | str
            try:
                made = method.controller(self._base, limits)
                made.step(q)  # compiles what it needs
            except CartctlError as error:
                made = str(error)
            except Exception as error:  # a bug of a solver's must not end the viewer without a word
                made = f"unexpected {type(error).__name__}: {error}"
            with self._lock:
                self._busy = False
                if self._wish is None:
                    self._ready = (method, made)
