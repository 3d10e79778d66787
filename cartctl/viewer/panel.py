"""The controls beside the picture. What is chosen there is read once a picture, in the loop's own thread."""

from __future__ import annotations

import threading
from typing import Any

import numpy as np

from cartctl.levels import get_level
from cartctl.motion.controller import Controller
from cartctl.objectives.named import KNOWN
from cartctl.tasks import FrameTask
from cartctl.viewer.method import LEVELS, NONE, OWN, Method, name_of, usable_solvers

_GAINS = (0.5, 40.0)  # 1/s that the slider offers at most
_NULL_SPACE = "what the redundancy is spent on"
_HINT = "Drag the arrows, squares and rings: the hand follows. Drag beside them to turn the view, scroll to zoom."
_STABLE = 0.5  # of the gain from which on the sampled loop would diverge


class Panel:
    """Widgets of viser's ``gui``, set as ``controller`` is; ``name`` of the robot."""

    def __init__(self, gui: Any, controller: Controller, hands: list[FrameTask]) -> None:
        self._gui, self._lock = gui, threading.Lock()
        self._pressed: set[str] = set()
        stable = min(get_level(name).stable_below for name in LEVELS)
        top = max(min(_GAINS[1], _STABLE * stable / controller.dt), _GAINS[0])
        gain = float(np.clip(np.max(hands[0].gain), _GAINS[0], top))
        gui.configure_theme(show_logo=False, show_share_button=False, control_width="medium", brand_color=(0, 114, 178))
        self._initial, self._moved = gain, False
        self.status = gui.add_html("")
        self.trouble = gui.add_html("")
        gui.add_button_group("", ("pause", "target to hand", "home")).on_click(self._click)
        solvers = list(dict.fromkeys([controller.solver.name, *usable_solvers()]))
        with gui.add_folder("method"):
            self._solver = gui.add_dropdown("solver", solvers, initial_value=controller.solver.name)
            self._level = gui.add_dropdown("level", LEVELS, initial_value=controller.level.name)
            own = name_of(controller.objective)
            names = [*([OWN] if own == OWN else []), NONE, *KNOWN]
            self._objective = gui.add_dropdown("null space", names, initial_value=own, hint=_NULL_SPACE)
            self._strength = gui.add_slider(
                "… strength", -2.0, 2.0, 0.1, 0.0, marks=((-2.0, "1/100"), (0.0, "1"), (2.0, "100")),
                hint="factor on the objective's gain, a power of ten",
            )  # fmt: skip
        with gui.add_folder("gains and limits"):
            self._gain = gui.add_slider("gain, 1/s", _GAINS[0], float(top), 0.5, gain, hint="how fast the error decays")
            self._speed = gui.add_slider("speed limit, %", 5, 100, 1, 100, hint="share of the robot's velocity limits")
            self._force = gui.add_slider("accel. limit, %", 5, 100, 1, 100, hint="share of its acceleration limits")
        with gui.add_folder("picture", expand_by_default=False):
            self.trace = gui.add_checkbox("trace of the hand", True)
            self.ellipsoid = gui.add_checkbox(
                "velocity ellipsoid", False, hint="what joint rates of norm 1 reach; 1 m/s is drawn as 0.25 m"
            )
        gui.add_html(f'<div style="font-size:11.5px;line-height:1.4;opacity:.65;padding:2px 10px 6px">{_HINT}</div>')

    @property
    def method(self) -> Method:
        """What is chosen."""
        strength = 10.0 ** float(self._strength.value)
        return Method(self._solver.value, self._level.value, self._objective.value, strength)

    def choose(self, method: Method) -> None:
        """Show a choice, such as the one that still works after one that did not."""
        self._solver.value, self._level.value, self._objective.value = method.solver, method.level, method.objective
        self._strength.value = float(np.log10(method.strength))

    @property
    def gain(self) -> float | None:
        """1/s, None as long as nobody has moved the slider: until then each task has its own."""
        value = float(self._gain.value)
        self._moved = self._moved or value != self._initial
        return value if self._moved else None

    @property
    def shares(self) -> tuple[float, float]:
        """Of the velocity limits, of the acceleration limits."""
        return float(self._speed.value) / 100.0, float(self._force.value) / 100.0

    def pressed(self) -> set[str]:
        """The buttons that were pressed since the last call."""
        with self._lock:
            pressed, self._pressed = self._pressed, set()
        return pressed

    def _click(self, event: Any) -> None:
        with self._lock:
            self._pressed.add(str(event.target.value))
