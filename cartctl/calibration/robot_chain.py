"""Any robot's chain to a frame, with six placement parameters and an offset for every joint."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np
import pinocchio as pin

from cartctl.calibration.chain import Chain, configurations, six_names
from cartctl.calibration.conversion import as_robot, joints_to
from cartctl.calibration.motions import Fixed, Motion, Product, Step, correctable, corrected, placed
from cartctl.checks import FloatArray
from cartctl.model.robot import Robot
from cartctl.spatial.frames import as_pose


class RobotChain(Chain):
    """The chain from a robot's base to ``frame`` (its tool by default), of any URDF or Pinocchio model.

        T(q) = T_base C_base  prod_i (M_i C_i exp(S_i (q_i + o_i)))  M_frame  T_tool C_tool

    M_i is the placement of joint i, S_i its axis, C = Tx Ty Tz Rx Ry Rz a small correction in the joint's own axes,
    with parameters ``<joint>.x`` ... ``<joint>.rz``, o_i its ``<joint>.offset``. base, tool: (4, 4) or pin.SE3, what
    lies before the robot's base (the robot as the measuring device sees it) and behind its frame (the target), with
    ``base.x`` ... ``tool.rz``. Groups: each joint's name, ``placements`` (all joints), ``offsets``, ``base``, ``tool``.
    Configurations are the robot's, (N, nq).

    Raises UnsupportedJoint for a chain with joints of several axes, mimic joints or a moving base; FrameNotFound,
    ParameterError, ShapeError, NonFiniteError.
    """

    def __init__(self, robot: Any, frame: str | None = None, *, base: Any = None, tool: Any = None) -> None:
        self.source = as_robot(robot)
        self.name = self.source.name
        self.frame = self.source.tool if frame is None else frame
        self.joints = joints_to(self.source, self.frame)
        self.base = np.eye(4) if base is None else np.array(as_pose("base", base))
        self.tool = np.eye(4) if tool is None else np.array(as_pose("tool", tool))
        self.corrections: dict[str, FloatArray] = {}

    @cached_property
    def product(self) -> Product:
        """The factors: base, placements with their corrections, axes, frame, tool."""
        steps: list[Step] = [*correctable("base", self.base)]
        for i, joint in enumerate(self.joints):
            place = self.source.model.jointPlacements[joint.number].homogeneous
            steps += correctable(joint.label, place @ self.corrections.get(joint.name, np.eye(4)))
            steps.append(Motion(joint.turns, joint.axis, name=f"{joint.label}.offset", joint=i))
        steps.append(Fixed(np.array(self._frame().placement.homogeneous)))
        return Product([*steps, *correctable("tool", self.tool)], len(self.joints))

    def _frame(self) -> pin.Frame:
        return self.source.model.frames[self.source.frame_id(self.frame)]

    @property
    def groups(self) -> Mapping[str, Sequence[str]]:
        """One a joint, ``placements``, ``offsets``, ``base``, ``tool``."""
        single = {joint.label: six_names(joint.label) for joint in self.joints}
        return {
            **single,
            "placements": [name for six in single.values() for name in six],
            "offsets": [f"{joint.label}.offset" for joint in self.joints],
            "base": six_names("base"),
            "tool": six_names("tool"),
        }

    @property
    def usual(self) -> Sequence[str]:
        """The placements of all joints."""
        return self.groups["placements"]

    def coordinates(self, q: Any) -> FloatArray:
        """The coordinates of the chain's joints at the configurations q (N, nq) of the robot, (N, n), rad or m.

        Raises ShapeError, NonFiniteError, ConfigurationError.
        """
        array = configurations(q, self.source.nq)
        rows = [self.source.model.joints[joint.number].idx_v for joint in self.joints]
        if not self.source.has_plain_coordinates:
            checked = [self.source.check_configuration(row, f"q[{i}]") for i, row in enumerate(array)]
            array = np.array([self.source.coordinates(row) for row in checked])
        return array[:, rows]

    def changed(self, delta: Mapping[str, float]) -> RobotChain:
        """The chain with ``delta`` added; corrections follow those there are. Raises ParameterNotFound."""
        self.select(list(delta)) if delta else ()
        other = RobotChain(
            self.source,
            self.frame,
            base=corrected(self.base, [delta.get(n, 0.0) for n in six_names("base")]),
            tool=corrected(self.tool, [delta.get(n, 0.0) for n in six_names("tool")]),
        )
        for joint in self.joints:
            before = self.corrections.get(joint.name, np.eye(4))
            moved = corrected(before, [delta.get(n, 0.0) for n in six_names(joint.label)])
            moved = moved @ placed(joint.turns, joint.axis, delta.get(f"{joint.label}.offset", 0.0))
            if not np.array_equal(moved, np.eye(4)):
                other.corrections[joint.name] = moved
        return other

    @cached_property
    def robot(self) -> Robot:
        """The robot with its corrected placements; base and tool are the chain's, and not in it."""
        found = copy.copy(self.source)
        found.model = self.source.model.copy()
        for joint in self.joints:
            if joint.name in self.corrections:
                C = self.corrections[joint.name]
                place = found.model.jointPlacements[joint.number] * pin.SE3(C[:3, :3], C[:3, 3])
                found.model.jointPlacements[joint.number] = place
        found.spec = found.spec if not self.corrections else None  # no file says what it is now
        return found

    def urdf(self) -> str:
        """The robot's own URDF with corrected origins, all else as it was; a model without one becomes a bare chain.

        A tool that is no identity is a new link ``calibrated_tool`` on the frame, a base a new root
        ``calibrated_base``.
        """
        from cartctl.calibration.urdf import robot_urdf

        return robot_urdf(self)
