"""What a hand shall do, whatever the method: a robot, a frame of it, the axes that count, a path, a time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path as FilePath

import cartctl as cc
from cartctl import checks
from cartctl.cli.choices import SINGULARITIES, choice, posture
from cartctl.cli.console import say
from cartctl.cli.hand import Hand
from cartctl.cli.method import TORQUE_METRIC, limit_options, metric_of
from cartctl.cli.shapes import Shape
from cartctl.errors import ParameterError
from cartctl.model.axes import pose_rows

_SETTLE = 0.5  # s after the path's end
_SOFT_START = 0.5  # s in which the objective rises, so that the rates do not jump


@dataclass(frozen=True)
class Place:
    """The options that name a hand: of which robot, from where, which frame and axes of it."""

    robot: str
    package_dirs: Sequence[FilePath] | None
    root_joint: str | None
    home: Sequence[str] | None
    frame: str | None
    axes: str | None

    def hand(self) -> Hand:
        """The robot, loaded, and the frame of it; raises what :func:`cartctl.load` raises."""
        robot = cc.load(
            self.robot,
            package_dirs=self.package_dirs or (),
            root_joint=self.root_joint,
            home=posture(self.home or ()),
        )
        return Hand(robot, robot.tool if self.frame is None else self.frame)


@dataclass(frozen=True)
class Way:
    """The options that name a path."""

    kind: str
    plane: str | None
    size: float | None
    period: float
    laps: int


@dataclass(frozen=True)
class Pace:
    """The options that tell how it is followed.

    level, metric; gain in 1/s, step and duration in s; what becomes of it near a singularity.
    """

    level: str
    metric: str | None
    gain: float
    dt: float
    duration: float | None
    singularity: str | None = None


class Course:
    """A robot's hand, the path it shall follow, and for how long.

    Raises what :func:`cartctl.load`, the hand and the paths raise.
    """

    def __init__(self, place: Place, way: Way, pace: Pace) -> None:
        self.hand = place.hand()
        self.robot = self.hand.robot
        self.axes = self.hand.axes if place.axes is None else place.axes
        if all(row >= 3 for row in pose_rows(self.axes)):
            raise ParameterError(
                f"--axes is {self.axes!r}, which holds no position, so no path moves it; add x, y or z"
            )
        self.shape = Shape.fitting(self.hand, self.axes, way.kind, way.plane, way.size, way.period, way.laps)
        self._chosen = place.axes is None and self.axes != "pose"
        if pace.singularity is not None:
            choice("singularity", pace.singularity, SINGULARITIES)
        self._pace = pace
        target = self.shape.path(self.hand)
        self.task = cc.FrameTask(self.hand.frame, axes=self.axes, gain=pace.gain, target=target)
        end = pace.duration
        self.end = target.duration + _SETTLE if end is None else checks.number("--duration", end, low=pace.dt)

    def controller(self, solver: cc.Solver, objective: cc.Objective | None) -> cc.Controller:
        """The loop that follows it; raises as :class:`cartctl.Controller`."""
        pace = self._pace
        return cc.Controller(
            self.robot, self.task, solver, pace.level, objective=objective,
            metric=metric_of(solver, pace.level, pace.metric), dt=pace.dt,
            soft_start=_SOFT_START, singularity=pace.singularity, **limit_options(solver, pace.level),
        )  # fmt: skip

    def facts(self) -> list[tuple[str, str]]:
        """What it is, defaults included."""
        robot = self.robot
        found = " (where this robot can move)" if self._chosen else ""
        return [
            ("robot", f"{robot.name}, {robot.nv} degrees of freedom, {self.spare} redundant"),
            ("hand", f"{self.hand.frame}, axes {self.axes}{found}"),
            ("path", f"{self.shape}, {self.end:g} s in all"),
        ]

    def pace(self) -> str:
        """Level, metric, gain, step, and the policy near singularities."""
        weighed = self._pace.metric or (TORQUE_METRIC if self._pace.level == "torque" else None)
        metric = f", metric {weighed}" if weighed else ""
        near = f", near a singularity: {self._pace.singularity}" if self._pace.singularity else ""
        return f"{self._pace.level} level{metric}, gain {self.task.gain:g} 1/s, step {1e3 * self._pace.dt:g} ms{near}"

    @property
    def spare(self) -> int:
        """Degrees of redundancy: joints less rows of the task."""
        return max(self.robot.nv - len(self.task.units(self.robot)), 0)

    def warn(self) -> None:
        """Say it where home is singular, or outside the robot's limits."""
        robot, limits = self.robot, self.robot.limits
        at = robot.coordinates(robot.home)
        outside = (at < limits.position_lower) | (at > limits.position_upper)
        if outside.any():
            names = ", ".join(name for name, out in zip(robot.dof_names, outside, strict=True) if out)
            say("warning", f"home is outside the limits of {names}", "bold yellow")
        if self.hand.is_singular(self.axes):
            advice = "start elsewhere with --home JOINT=VALUE, or damp with --solver dls"
            say("warning", f"home is singular for axes {self.axes}; {advice}", "bold yellow")
