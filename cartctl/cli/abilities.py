"""What a robot's hand can do at its home: the analysis of its Jacobian in a few lines."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from cartctl import analysis
from cartctl.checks import FloatArray
from cartctl.cli.console import number
from cartctl.cli.hand import Hand
from cartctl.errors import ParameterError

if TYPE_CHECKING:
    from cartctl.analysis import Block, Summary
    from cartctl.model.robot import Robot


def abilities(robot: Robot, frame: str | None, axes: str | None) -> list[tuple[str, str]]:
    """Name and value of each line; raises FrameNotFound, ParameterError."""
    hand = Hand(robot, robot.tool if frame is None else frame)
    found = analysis.summary(robot.state(robot.home), hand.frame, _axes(hand) if axes is None else axes)
    blocks = [("m/s", "N", found.position), ("rad/s", "N m", found.orientation)]
    return [
        *([] if frame is None else [("frame", hand.frame)]),
        ("its Jacobian", _rank(found)),
        *([("lost", ", ".join(found.singularity.names))] if found.singularity.occurs else []),
        ("singular values", _row(found.spectrum.values)),
        *_measures(found),
        *[("velocity ellipsoid", f"{_row(block.velocity.lengths)} {speed}") for speed, _, block in blocks if block],
        *[("force ellipsoid", f"{_forces(block)} {force}") for _, force, block in blocks if block],
    ]


def _axes(hand: Hand) -> str:
    """The rows it can move; all where none."""
    try:
        return hand.axes
    except ParameterError:
        return "pose"


def _rank(found: Summary) -> str:
    rank, spare = found.spectrum.rank, found.spectrum.redundancy
    return f"{' '.join(found.names)} at home: rank {rank} of {len(found.names)}, degree of redundancy {spare}"


def _measures(found: Summary) -> list[tuple[str, str]]:
    spectrum = found.spectrum
    lines = [("manipulability", number(spectrum.manipulability))]
    if math.isfinite(spectrum.condition):
        lines.insert(0, ("condition", number(spectrum.condition)))
    if spectrum.determinant is not None:
        lines.append(("determinant", number(spectrum.determinant)))
    return lines


def _row(values: FloatArray) -> str:
    return "  ".join(number(float(value)) for value in values)


def _forces(block: Block) -> str:
    """Along a lost direction the structure bears any force."""
    return "  ".join("any" if np.isinf(length) else number(float(length)) for length in block.force.lengths)
