"""What the redundancy may be spent on, by name: the objective, how strongly by default, and that in words."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

from cartctl.objectives import (
    GravityTorque,
    InverseCondition,
    JointRange,
    KineticEnergy,
    Manipulability,
    Objective,
    Posture,
    SmallestSingularValue,
)
from cartctl.objectives.frame_measure import FrameMeasure


class Known(NamedTuple):
    """An objective by its gain, a gain for an arm of about a metre, and what it is for."""

    make: Callable[[float], Objective]
    gain: float
    words: str


KNOWN: dict[str, Known] = {
    "joint-range": Known(lambda k: JointRange(gain=k), 100.0, "keeps the joints near mid-range"),
    "posture": Known(lambda k: Posture(gain=k), 1.0, "keeps the joints near home"),
    "manipulability": Known(lambda k: Manipulability(gain=k), 10.0, "keeps the hand able to move every way"),
    "smallest-singular-value": Known(lambda k: SmallestSingularValue(gain=k), 5.0, "keeps the hand's worst way open"),
    "inverse-condition": Known(lambda k: InverseCondition(gain=k), 5.0, "keeps the hand as able one way as another"),
    "kinetic-energy": Known(lambda k: KineticEnergy(gain=k), 1.0, "prefers postures of little inertia to the motion"),
    "gravity-torque": Known(lambda k: GravityTorque(gain=k), 1e-3, "prefers postures that take little torque to hold"),
}


def aimed(objective: Objective | None, frame: str, axes: str) -> Objective | None:
    """The objective, of the frame and the axes that the task moves."""
    return replace(objective, frame=frame, axes=axes) if isinstance(objective, FrameMeasure) else objective


def in_words(objective: Objective) -> str:
    """Name, gain, and what it is for."""
    for name, known in KNOWN.items():
        if type(known.make(1.0)) is type(objective):
            return f"{name}, gain {objective.gain:g}, {known.words}"
    return repr(objective)
