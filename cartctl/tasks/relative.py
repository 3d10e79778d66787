"""The pose of one frame seen from another that moves too: two hands holding one thing, a tool over a turntable."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from cartctl.algebra.svd import scale
from cartctl.checks import FloatArray
from cartctl.model.robot import Robot
from cartctl.model.state import State
from cartctl.spatial.rotations import cross, skew
from cartctl.tasks.pose import PoseTask


class RelativeFrameTask(PoseTask):
    """Bring ``frame`` to a target pose in the axes and origin of ``reference_frame``.

    ``^r T_f = T_r^-1 T_f``; with d = p_f - p_r its rate in the reference's axes is
    ``[R_r^T (v_f - v_r - omega_r x d); R_r^T (omega_f - omega_r)]``. axes, gain, target, orientation, length, weight,
    fit and name as in :class:`cartctl.FrameTask`, target and axes being the reference frame's.

    Raises ParameterError, TargetError, NonFiniteError; FrameNotFound when a controller is made.
    """

    kind: ClassVar[str] = "relative"

    def __init__(
        self,
        frame: str,
        reference_frame: str,
        axes: Any = "pose",
        gain: Any = 20.0,
        *,
        target: Any = None,
        orientation: str = "angle-axis",
        length: float = 1.0,
        weight: float = 1.0,
        fit: str = "scale",
        name: str | None = None,
    ) -> None:
        self.reference_frame = reference_frame
        label = name or f"{frame} from {reference_frame}"
        super().__init__(frame, axes, target, orientation, length, gain=gain, weight=weight, fit=fit, name=label)

    def check(self, robot: Robot) -> None:
        """Both frames must exist."""
        super().check(robot)
        robot.frame_id(self.reference_frame)

    def pose(self, state: State) -> tuple[FloatArray, FloatArray]:
        """Position and rotation of the frame in the reference frame."""
        relative = state.place(self.reference_frame).pose.actInv(state.place(self._frame).pose)
        return relative.translation, relative.rotation

    def pose_jacobian(self, state: State) -> FloatArray:
        """``J`` (6, nv) of the relative pose, in the reference frame's axes."""
        Jf, Jr = state.jacobian(self._frame), state.jacobian(self.reference_frame)
        Rt = state.rotation(self.reference_frame).T
        linear = Jf[:3] - Jr[:3] + skew(self._offset(state)) @ Jr[3:]
        return np.concatenate([Rt @ linear, Rt @ (Jf[3:] - Jr[3:])])

    def size(self, state: State) -> float:
        """The norm of both frames' Jacobians: what their difference may be the round-off of."""
        return scale(state.jacobian(self._frame)) + scale(state.jacobian(self.reference_frame))

    def pose_drift(self, state: State) -> FloatArray:
        """``J_dot v`` (6,): the relative acceleration at zero joint acceleration, Coriolis terms included."""
        af, ar = state.drift(self._frame), state.drift(self.reference_frame)
        vf, vr = state.twist(self._frame), state.twist(self.reference_frame)
        Rt, d, w = state.rotation(self.reference_frame).T, self._offset(state), vr[3:]
        relative = vf[:3] - vr[:3] - cross(w, d)
        linear = af[:3] - ar[:3] - cross(ar[3:], d) - cross(w, vf[:3] - vr[:3]) - cross(w, relative)
        angular = af[3:] - ar[3:] - cross(w, vf[3:])
        return np.concatenate([Rt @ linear, Rt @ angular])

    def _offset(self, state: State) -> FloatArray:
        return state.position(self._frame) - state.position(self.reference_frame)
