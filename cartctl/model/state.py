"""Everything Pinocchio computes at one state (q, v), each thing at most once and only when asked for."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from cartctl.checks import FloatArray
from cartctl.model.differences import central
from cartctl.model.hessian import jacobian_drift, jacobian_drifts, kinematic_hessian

if TYPE_CHECKING:
    from cartctl.model.robot import Robot

_WORLD_ALIGNED = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
_joint_jacobians = pin.computeJointJacobians
_frame_jacobian = pin.getFrameJacobian
_place_frame = pin.updateFramePlacement
_mass_matrix = pin.crba
_WORLD = pin.Convention.WORLD
_nonlinear_effects = pin.nonLinearEffects


class State:
    """A robot at configuration q (nq,) and velocity v (nv,), with its own Pinocchio data.

    Frame quantities are in LOCAL_WORLD_ALIGNED axes (origin at the frame, axes of the world), linear part first.
    Arrays handed out are read-only and stay valid for good. time: s, when the robot is there, for what moves by itself
    (the obstacles of a scene). Made by :meth:`cartctl.Robot.state`, which checks q and v; raises FrameNotFound for an
    unknown frame.

    >>> import cartctl as cc
    >>> state = cc.planar([1.0, 1.0]).state([0.0, 1.5707963267948966], v=[1.0, 0.0])
    >>> print(state.jacobian("tool")[:2].round(6))
    [[-1. -1.]
     [ 1.  0.]]
    >>> print(state.drift("tool")[:2].round(6))
    [-1. -1.]
    """

    __slots__ = (
        "_cache",
        "_data",
        "_frames",
        "_joints",
        "_kinematics",
        "_model",
        "_poses",
        "_rates",
        "q",
        "robot",
        "stamp",
        "time",
        "v",
    )

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self._model = robot.model
        self._data = robot.model.createData()
        self._frames: dict[str, FrameView] = {}
        self._joints: list[tuple[FloatArray, FloatArray]] = []
        self.stamp = self._rates = 0
        self.set(robot.neutral, np.zeros(robot.nv))

    def set(self, q: FloatArray, v: FloatArray, time: float = 0.0) -> None:
        """Move to (q, v), already checked, and forget all that was computed; for loops that own their state."""
        self.q = q
        self.v = v
        self.time = time
        self.stamp += 1
        self._rates += 1
        self._kinematics = False
        self._cache: dict[str, FloatArray] = {}

    def turn(self, v: FloatArray) -> None:
        """Take another velocity, already checked, where it is: what depends on q alone stays; for such loops, too."""
        self.v = v
        self._rates += 1
        self._cache.pop("h", None)
        self._cache.pop("com drift", None)

    def place(self, frame: str) -> FrameView:
        """Views of ``frame``'s pose that change with the next ``set``; :meth:`placement` copies."""
        view = self._frames.get(frame)
        if view is None:
            view = self._frames[frame] = FrameView(self._data, self.robot.frame_id(frame))
        if view.placed != self.stamp:
            self._move()
            _place_frame(self._model, self._data, view.fid)
            view.placed = self.stamp
        return view

    def _move(self) -> None:
        if not self._kinematics:
            _joint_jacobians(self._model, self._data, self.q)
            self._kinematics = True

    @property
    def joint_poses(self) -> FloatArray:
        """The pose of every joint in the world, (njoints, 12): its rotation row by row, then its origin, m."""
        if "joints" not in self._cache:
            self._move()
            if not self._joints:
                self._poses = np.empty((self._model.njoints, 12))
                for row, pose in zip(self._poses, self._data.oMi, strict=True):
                    self._joints += [(row[:9].reshape(3, 3), pose.rotation), (row[9:], pose.translation)]
            for copy, view in self._joints:
                copy[:] = view
            self._cache["joints"] = _frozen(self._poses)
        return self._cache["joints"]

    @property
    def spatial_jacobian(self) -> FloatArray:
        """(6, nv): column i is the twist of coordinate i's joint at the world's origin; what hangs on it moves so."""
        self._move()
        return self._once("J", lambda: self._data.J.reshape(6, -1))

    def place_shapes(self, shapes: pin.GeometryModel, data: pin.GeometryData) -> None:
        """Put shapes attached to the joints where they are, in ``data``."""
        self._move()
        pin.updateGeometryPlacements(self._model, self._data, shapes, data)

    def placement(self, frame: str) -> pin.SE3:
        """The pose of ``frame`` in the world."""
        return self.place(frame).pose.copy()

    def position(self, frame: str) -> FloatArray:
        """The origin of ``frame`` in the world, (3,), m."""
        return np.array(self.place(frame).translation)

    def rotation(self, frame: str) -> FloatArray:
        """The axes of ``frame`` in the world as columns, (3, 3)."""
        return np.array(self.place(frame).rotation)

    def jacobian(self, frame: str) -> FloatArray:
        """``J`` (6, nv): twist of ``frame`` = J v."""
        view = self.place(frame)
        if view.differentiated != self.stamp:
            J = _frame_jacobian(self._model, self._data, view.fid, _WORLD_ALIGNED)
            if J.ndim == 1:  # with one joint, Pinocchio hands out a vector
                J = J.reshape(6, 1)
            J.flags.writeable = False
            view.jacobian = J
            view.differentiated = self.stamp
        return view.jacobian

    def twist(self, frame: str) -> FloatArray:
        """``J v``, (6,), m/s and rad/s."""
        return self.jacobian(frame) @ self.v

    def drift(self, frame: str) -> FloatArray:
        """``J_dot v``, (6,): the classical acceleration of ``frame`` at zero joint acceleration, m/s^2 and rad/s^2."""
        view = self.place(frame)
        if view.accelerated != self._rates:
            if self.robot.mimics:
                pin.forwardKinematics(self._model, self._data, self.q, self.v, np.zeros(self._model.nv))
                motion = pin.getFrameClassicalAcceleration(self._model, self._data, view.fid, _WORLD_ALIGNED)
                view.drift = np.array(motion.vector)
            else:
                view.drift = np.empty(6)
                jacobian_drift.compiled(self.jacobian(frame), self.v, self.robot.order, view.drift)
            view.drift.flags.writeable = False
            view.accelerated = self._rates
        return view.drift

    def drifts(self, frame: str, V: FloatArray) -> FloatArray:
        """``J_dot(v_i) v_i`` for every row v_i of V (k, nv), as columns, (6, k)."""
        drifts = np.empty((6, V.shape[0]))
        if self.robot.mimics:
            own = State(self.robot)
            for i, v in enumerate(V):
                own.set(self.q, v, self.time)
                drifts[:, i] = own.drift(frame)
        else:
            jacobian_drifts.compiled(self.jacobian(frame), V, self.robot.order, drifts)
        return drifts

    def hessian(self, frame: str) -> FloatArray:
        """``dJ_aj / dq_i``, (6, nv, nv) as [a, j, i]: how :meth:`jacobian` changes along each tangent coordinate.

        Exact, in m and rad a rad (or m) squared; with mimic joints, central differences.
        """
        if self.robot.mimics:
            return self._once("H " + frame, lambda: central(self, lambda s: s.jacobian(frame)))
        return self._once("H " + frame, lambda: kinematic_hessian(self.jacobian(frame), self.robot.carried))

    @property
    def mass_matrix(self) -> FloatArray:
        """``M(q)``, (nv, nv), symmetric."""
        M = self._cache.get("M")
        if M is None:
            M = _mass_matrix(self._model, self._data, self.q, _WORLD)  # a copy of its own, both triangles filled
            M = _square(M)
            M.flags.writeable = False
            self._cache["M"] = M
            self._kinematics = True  # placements and joint Jacobians come along
        return M

    @property
    def nonlinear_effects(self) -> FloatArray:
        """``h(q, v)``, (nv,): Coriolis, centrifugal and gravity torques, N m."""
        h = self._cache.get("h")
        if h is None:
            h = _nonlinear_effects(self._model, self._data, self.q, self.v)  # a copy of its own
            h.flags.writeable = False
            self._cache["h"] = h
        return h

    @property
    def gravity(self) -> FloatArray:
        """``g(q)``, (nv,): gravity torques, N m."""
        return self._once("g", lambda: pin.computeGeneralizedGravity(self._model, self._data, self.q))

    @property
    def gravity_gradient(self) -> FloatArray:
        """``dg_j / dq_i``, (nv, nv) as [j, i], N m/rad; with mimic joints, central differences."""
        if self.robot.mimics:
            return self._once("dg", lambda: central(self, lambda s: s.gravity))
        return self._once(
            "dg", lambda: _square(pin.computeGeneralizedGravityDerivatives(self._model, self._data, self.q))
        )

    def inertia_gradient(self, a: FloatArray) -> FloatArray:
        """``d(M(q) a)_j / dq_i`` of a constant a (nv,), (nv, nv) as [j, i]; with mimic joints, central differences."""
        if self.robot.mimics:
            return central(self, lambda s: s.mass_matrix @ a)
        at_rest = np.zeros(self._model.nv)
        turned = pin.computeRNEADerivatives(self._model, self._data, self.q, at_rest, a)[0]
        return _square(np.array(turned)) - self.gravity_gradient

    @property
    def com(self) -> FloatArray:
        """The centre of mass in the world, (3,), m."""
        return self._once("com", lambda: pin.centerOfMass(self._model, self._data, self.q))

    @property
    def com_jacobian(self) -> FloatArray:
        """``J_com`` (3, nv): velocity of the centre of mass = J_com v."""
        return self._once("J_com", lambda: pin.jacobianCenterOfMass(self._model, self._data, self.q).reshape(3, -1))

    @property
    def com_drift(self) -> FloatArray:
        """``J_com_dot v``, (3,): acceleration of the centre of mass at zero joint acceleration, m/s^2."""
        return self._once("com drift", self._com_drift)

    def _com_drift(self) -> Any:
        pin.centerOfMass(self._model, self._data, self.q, self.v, np.zeros(self._model.nv))
        return self._data.acom[0]

    def _once(self, key: str, compute: Any) -> FloatArray:
        if key not in self._cache:
            self._cache[key] = _frozen(compute())
        return self._cache[key]


class FrameView:
    """One frame inside a State's data: its pose as views of Pinocchio's memory, its Jacobian and drift."""

    __slots__ = (
        "accelerated",
        "differentiated",
        "drift",
        "fid",
        "jacobian",
        "placed",
        "pose",
        "rotation",
        "translation",
    )

    def __init__(self, data: pin.Data, fid: int) -> None:
        self.fid = fid
        self.pose: pin.SE3 = data.oMf[fid]
        self.translation: FloatArray = self.pose.translation
        self.rotation: FloatArray = self.pose.rotation
        self.jacobian: FloatArray = np.zeros((6, 0))
        self.drift: FloatArray = np.zeros(6)
        self.placed = self.differentiated = self.accelerated = -1


def _frozen(array: Any) -> FloatArray:
    """A read-only copy: Pinocchio hands out views of memory that the next call overwrites."""
    copy = np.array(array, dtype=np.float64)
    copy.flags.writeable = False
    return copy


def _square(A: FloatArray) -> FloatArray:
    """A as a matrix; with one joint, Pinocchio hands out a vector."""
    return A.reshape(-1, 1) if A.ndim < 2 else A
