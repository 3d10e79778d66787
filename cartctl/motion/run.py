"""A run remembers every step: what was asked, what was done, how well."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cartctl.checks import FloatArray
from cartctl.errors import RunFileError
from cartctl.model.robot import Robot
from cartctl.motion.energy import EnergyBooks

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from cartctl.motion.metrics import Metrics
    from cartctl.motion.surroundings import ObstacleRecord


@dataclass(eq=False)
class TaskRecord:
    """One task over a run of N steps.

    name, kind, frame: what it was. units: one a row, "m", "rad" or "". error: (N+1, m) target minus value. scale: (N,)
    share of the command delivered. singular_values: (N+1, min(m, nv)) of its Jacobian. pose, target: (N+1, 7)
    x y z qx qy qz qw or (N+1, 3), None where there is nothing to draw. rows: which rows of the frame's pose in the
    world's axes it moves, 0-2 linear, 3-5 angular; None where it moves something else.
    """

    name: str
    kind: str
    frame: str | None
    units: list[str]
    error: FloatArray
    scale: FloatArray
    singular_values: FloatArray
    pose: FloatArray | None
    target: FloatArray | None
    rows: list[int] | None = None


class Run:
    """Every step of a rollout of N steps; made by :func:`cartctl.simulate` or :meth:`load`.

    time (N+1,) s, q (N+1, nq), v (N+1, nv): the states, the last one after the last step. command (N, nv): what the
    level commands, velocities (rad/s, m/s), accelerations (rad/s^2, m/s^2) or torques (N m, N), by ``meta["level"]``.
    status (N,), solve_time (N,) s: one a step. tasks: a TaskRecord each. torque (N, nv): what drove the plant, N m or
    N, and energy: EnergyBooks of N+1 samples; None for a kinematic run. obstacles: an ObstacleRecord of each that the
    controller minds. meta: robot, solver and its parameters, level, dt, date, versions, ``interrupted``.
    """

    def __init__(
        self,
        *,
        meta: dict[str, Any],
        time: FloatArray,
        q: FloatArray,
        v: FloatArray,
        command: FloatArray,
        status: list[str],
        solve_time: FloatArray,
        tasks: list[TaskRecord],
        torque: FloatArray | None = None,
        energy: EnergyBooks | None = None,
        obstacles: Sequence[ObstacleRecord] = (),
        robot: Robot | None = None,
    ) -> None:
        self.meta, self.time, self.q, self.v = meta, time, q, v
        self.command, self.status, self.solve_time, self.tasks = command, status, solve_time, tasks
        self.torque, self.energy, self.obstacles = torque, energy, list(obstacles)
        self._robot = robot

    @property
    def robot(self) -> Robot:
        """The robot, loaded again where the run comes from a file; raises RunFileError for a model without a source."""
        if self._robot is None:
            from cartctl.model.loading import reload

            spec = self.meta.get("robot")
            if spec is None:
                raise RunFileError("the run's robot came from a model in memory; set run.robot to it first")
            self._robot = reload(spec)
        return self._robot

    @robot.setter
    def robot(self, robot: Robot) -> None:
        self._robot = robot

    @property
    def interrupted(self) -> bool:
        """Whether the rollout ended before its time."""
        return bool(self.meta.get("interrupted"))

    def metrics(self, after: float = 0.0) -> Metrics:
        """How well it went; tracking errors from ``after`` s past the start. Raises ParameterError."""
        from cartctl.motion.metrics import measure

        return measure(self, after)

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write everything to a .npz file, whole or not at all."""
        from cartctl.motion.storage import save

        return save(self, Path(path))

    @staticmethod
    def load(path: str | os.PathLike[str]) -> Run:
        """Read a saved run; raises RunFileError."""
        from cartctl.motion.storage import load

        return load(Path(path))

    def to_csv(self, path: str | os.PathLike[str]) -> Path:
        """Write one row a sample as CSV, columns named by joint and task."""
        from cartctl.motion.export import to_csv

        return to_csv(self, Path(path))

    def to_parquet(self, path: str | os.PathLike[str]) -> Path:
        """Write one row a sample as Parquet, columns named by joint and task."""
        from cartctl.motion.export import to_parquet

        return to_parquet(self, Path(path))

    def plot(self, path: str | os.PathLike[str] | None = None) -> Figure:
        """A figure of errors, joints, rates, torques, singular values and step time; written to ``path`` if given."""
        from cartctl.report import plot_run, save_figure

        figure = plot_run(self)
        if path is not None:
            save_figure(figure, path)
        return figure

    def html(self, path: str | os.PathLike[str]) -> Path:
        """One self-contained HTML file with the moving robot, its target and its trace."""
        from cartctl.report import write_html

        return write_html(self, Path(path))

    def __len__(self) -> int:
        return len(self.command)

    def __repr__(self) -> str:
        tail = ", interrupted" if self.interrupted else ""
        return f"Run({self.meta.get('robot_name')!r}, {self.meta.get('solver')!r}, {len(self)} steps{tail})"
