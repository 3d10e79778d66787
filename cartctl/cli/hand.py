"""A frame of a robot at home: which rows of its pose the robot can move, and how far its arm reaches."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from typing import Any

import numpy as np
import pinocchio as pin

from cartctl.checks import FloatArray
from cartctl.errors import ParameterError
from cartctl.model.axes import pose_rows
from cartctl.model.robot import Robot

LETTERS = "xyz"
_SINGULAR = 1e-6  # of the largest singular value
_SHARE = 0.075  # of the arm's length: 0.1 m for arms the size of a man's


@dataclass(frozen=True)
class Hand:
    """A frame of a robot at home, and what it can do from there."""

    robot: Robot
    frame: str

    @cached_property
    def pose(self) -> pin.SE3:
        """Where it is in the world."""
        return self.robot.state(self.robot.home).placement(self.frame)

    def singular_values(self, axes: Any = "pose") -> FloatArray:
        """Of its Jacobian's rows ``axes`` at home, (min(m, nv),); raises ParameterError for unknown axes."""
        J = self.robot.state(self.robot.home).jacobian(self.frame)
        return _svd(J[list(pose_rows(axes))])

    def is_singular(self, axes: Any) -> bool:
        """Whether home is a singular posture for these axes."""
        values = self.singular_values(axes)
        return bool(values[-1] < _SINGULAR * values[0])

    @cached_property
    def axes(self) -> str:
        """The rows it can move: "pose", else "position", else the letters of what is left.

        Raises ParameterError where nothing moves it.
        """
        J = self._jacobians()
        if self.robot.nv >= 6 and _rank(J) == 6:
            return "pose"
        rank = _rank(J[:, :3])
        if rank == 0:
            raise ParameterError(
                f"no joint of {self.robot.name!r} moves the origin of frame {self.frame!r}; choose another --frame"
            )
        best = max(combinations(range(3), rank), key=lambda rows: float(_svd(J[:, rows])[:, -1].max()))
        return "position" if rank == 3 else "".join(LETTERS[row] for row in best)

    @cached_property
    def shoulder(self) -> FloatArray:
        """The origin of the first joint that moves it, (3,) m."""
        joints = self._chain()
        return self._origins(joints)[0] if joints else np.zeros(3)

    @cached_property
    def size(self) -> float:
        """A path's radius that should fit: a share of the arm's length, rounded to 1, 2 or 5, in m."""
        joints = self._chain()
        points = [*self._origins(joints), self.pose.translation]
        length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
        return _rounded(_SHARE * length) if length > 0.0 else 0.1

    def plane(self, axes: str) -> str:
        """The plane of two world axes in which it can move."""
        letters = "".join(LETTERS[row] for row in pose_rows(axes) if row < 3)
        return letters if len(letters) == 2 else {"z": "xz"}.get(letters, "xy")

    def _jacobians(self) -> FloatArray:
        """At home and nearby, (3, 6, nv): a posture may be singular, three at random are not."""
        robot, rng = self.robot, np.random.default_rng(0)
        postures = [robot.home, *(robot.integrate(robot.home, rng.uniform(-0.3, 0.3, robot.nv)) for _ in range(2))]
        return np.array([robot.state(q).jacobian(self.frame) for q in postures])

    def _chain(self) -> list[int]:
        """Pinocchio's indices of the joints from the first one to the hand, a moving base left out."""
        model = self.robot.model
        joint, chain = model.frames[self.robot.frame_id(self.frame)].parentJoint, []
        while joint > 0:
            chain.append(joint)
            joint = model.parents[joint]
        return [j for j in reversed(chain) if model.joints[j].nv == 1]

    def _origins(self, joints: list[int]) -> list[FloatArray]:
        data = self.robot.model.createData()
        pin.forwardKinematics(self.robot.model, data, self.robot.home)
        return [np.array(data.oMi[j].translation) for j in joints]


def _svd(J: FloatArray) -> FloatArray:
    return np.asarray(np.linalg.svd(J, compute_uv=False), dtype=np.float64)


def _rank(J: FloatArray) -> int:
    """The largest rank of a stack of matrices."""
    s = _svd(J)
    return int((s > _SINGULAR * max(float(s.max()), 1e-12)).sum(axis=-1).max())


def _rounded(size: float) -> float:
    """``size`` rounded to 1, 2 or 5 times a power of ten."""
    power = 10.0 ** np.floor(np.log10(size))
    nearest: float = min((1.0, 2.0, 5.0, 10.0), key=lambda step: abs(np.log(step * power / size)))
    return float(f"{nearest * power:.1g}")
