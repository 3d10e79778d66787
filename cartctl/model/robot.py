"""A robot: a Pinocchio model with names, limits, a home posture and a tool frame."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pinocchio as pin

from cartctl import checks
from cartctl.checks import FloatArray
from cartctl.errors import ConfigurationError, FrameNotFound, JointNotFound, ParameterError
from cartctl.model.hessian import carried, order_of
from cartctl.model.limits import Limits
from cartctl.model.payload import Payload, carrying
from cartctl.model.state import State
from cartctl.model.visuals import Geometry

_BASE_DOFS = {3: ("vx", "vy", "wz"), 6: ("vx", "vy", "vz", "wx", "wy", "wz")}
_UNIT = 1e-6  # how far a quaternion or (cos, sin) pair may be from unit norm


class Robot:
    """A robot as data, made by :func:`cartctl.load` or from a Pinocchio model of your own (which is copied).

    model: the Pinocchio model. nq, nv: sizes of q and v. joint_names: movable joints in order, single_joints those of
    one dof. continuous: (nv,) which turn without end. single: (nv,) which are a joint of their own, and not of a moving
    base. dof_names: (nv,) one name a tangent coordinate. limits: Limits, (nv,) each. home: (nq,) a posture away from
    singularities. tool: the name of the tool frame. mimics: whether joints mimic others. carried: (nv, nv), whether dof
    i carries the axis of dof j, as [i, j]: where ``order[i] <= order[j]``, order (nv,). spec: what :func:`cartctl.load`
    needs to load it again, None for a model of your own.

    Raises FrameNotFound, JointNotFound.
    """

    def __init__(
        self,
        model: pin.Model,
        *,
        name: str | None = None,
        tool: str | None = None,
        home: Mapping[str, float] | None = None,
        acceleration: Mapping[str, float] | None = None,
        jerk: Mapping[str, float] | None = None,
        geometry: Geometry | None = None,
        spec: Mapping[str, Any] | None = None,
    ) -> None:
        if not isinstance(model, pin.Model):
            raise ParameterError(f"model is a {type(model).__name__}; expected a pinocchio.Model, or use cc.load(...)")
        self.model = model.copy()
        self.name = name or model.name
        self.spec = None if spec is None else dict(spec)
        self.nq: int = model.nq
        self.nv: int = model.nv
        self.joint_names = tuple(n for n, j in zip(model.names, model.joints, strict=True) if j.nv > 0 and j.idx_v >= 0)
        self.dof_names = _dof_names(model)
        ids = [(frame.name, i) for i, frame in enumerate(model.frames)]
        self._frame_ids = dict(reversed(ids))  # of two with one name, the first
        self.frame_names = tuple(dict.fromkeys(name for name, _ in ids))
        self._joints = {n: model.joints[model.getJointId(n)] for n in self.joint_names}
        self.single_joints = tuple(n for n, j in self._joints.items() if j.nv == 1)
        self.continuous = np.zeros(model.nv, dtype=bool)
        for joint in self._joints.values():
            self.continuous[joint.idx_v] = joint.nq == 2 and joint.nv == 1
        self.single = np.zeros(model.nv, dtype=bool)
        for name in self.single_joints:
            self.single[self._joints[name].idx_v] = True
        self.mimics = len(model.mimicking_joints) > 0
        self.order = order_of(model)
        self.carried = carried(self.order)
        self._plain = all(j.nq == j.nv for j in self._joints.values())
        self.neutral = _read_only(pin.neutral(model))
        self.has_plain_coordinates = self._plain and not self.neutral.any()  # q itself is comparable with the limits
        self.limits = Limits.of_model(model, self.dof_names, acceleration or {}, jerk or {})
        self.home = _read_only(self._home(home or {}))
        self.tool = self._tool(tool)
        self._geometry = geometry
        self._rest = _read_only(np.zeros(self.nv))

    @property
    def gravity(self) -> FloatArray:
        """The acceleration of gravity in the world, (3,), m/s^2."""
        return np.array(self.model.gravity.linear)

    @property
    def visual_model(self) -> pin.GeometryModel:
        """The visual geometries; empty where the robot has none."""
        return pin.GeometryModel() if self._geometry is None else self._geometry.visual(self.model)

    @property
    def collision_model(self) -> pin.GeometryModel:
        """The collision geometries; empty where the robot has none."""
        return pin.GeometryModel() if self._geometry is None else self._geometry.collision(self.model)

    def frame_id(self, frame: str) -> int:
        """Pinocchio's index of a frame; raises FrameNotFound with the closest names."""
        try:
            return self._frame_ids[frame]  # type: ignore[no-any-return]
        except (KeyError, TypeError):
            raise FrameNotFound(frame, self.frame_names, f"(frames of {self.name!r}: robot.frame_names)") from None

    def dof(self, joint: str) -> int:
        """The tangent coordinate of a one-dof joint; raises JointNotFound."""
        if joint not in self._joints or self._joints[joint].nv != 1:
            raise JointNotFound(joint, self.single_joints, f"(joints of {self.name!r})")
        return int(self._joints[joint].idx_v)

    def is_prismatic(self, joint: str) -> bool:
        """Whether a one-dof joint slides instead of turning; raises JointNotFound."""
        self.dof(joint)
        return "JointModelP" in self._joints[joint].shortname()

    def state(self, q: Any, v: Any = None, time: float = 0.0) -> State:
        """The robot at q (nq,) and v (nv,), zeros if None; time in s, for obstacles that move.

        Raises ShapeError, NonFiniteError, ConfigurationError.
        """
        state = State(self)
        state.set(
            self.check_configuration(q),
            self._rest if v is None else checks.vector("v", v, self.nv, largest=checks.LARGEST),
            checks.number("time", time),
        )
        return state

    def check_configuration(self, q: Any, name: str = "q") -> FloatArray:
        """``q`` as a read-only (nq,) copy, checked; raises ShapeError, NonFiniteError, ConfigurationError."""
        checked = checks.vector(name, q, self.nq, largest=checks.LARGEST)
        if not self.is_on_manifold(checked):
            raise ConfigurationError(self._off_manifold(checked, name))
        return checked

    def _off_manifold(self, q: FloatArray, name: str) -> str:
        """Which joint's numbers are no rotation."""
        bad = "a joint has numbers that are no rotation"
        for joint_name, joint in self._joints.items():
            count = {0: 0, 1: 4 if joint.nv == 6 else 2}[joint.nq - joint.nv]
            end = joint.idx_q + joint.nq
            norm = float(np.linalg.norm(q[end - count : end])) if count else 1.0
            if abs(norm - 1.0) > _UNIT:
                what = "quaternion" if joint.nv == 6 else "(cos, sin) pair"
                bad = f"the {what} of joint {joint_name!r} has norm {norm:.6g}"
        return f"{name}: {bad}; expected norm 1, as pin.normalize(robot.model, q)"

    def is_on_manifold(self, q: FloatArray) -> bool:
        """Whether all quaternions and (cos, sin) pairs in q have unit norm."""
        return self._plain or bool(pin.isNormalized(self.model, q, _UNIT))

    def carrying(self, payload: Payload) -> Robot:
        """The same robot with a load in its model: another Robot; raises FrameNotFound, ParameterError."""
        return carrying(self, payload)

    def integrate(self, q: FloatArray, displacement: FloatArray) -> FloatArray:
        """``q (+) displacement``, (nq,); raises ShapeError, NonFiniteError."""
        return pin.integrate(self.model, _sound("q", q, self.nq), _sound("displacement", displacement, self.nv))  # type: ignore[no-any-return]

    def difference(self, q0: FloatArray, q1: FloatArray) -> FloatArray:
        """``q1 (-) q0``, (nv,): the displacement that leads from q0 to q1."""
        return pin.difference(self.model, _sound("q0", q0, self.nq), _sound("q1", q1, self.nq))  # type: ignore[no-any-return]

    def coordinates(self, q: FloatArray) -> FloatArray:
        """(nv,) joint coordinates of q, comparable with ``limits.position_*``; continuous joints in (-pi, pi]."""
        return pin.difference(self.model, self.neutral, _sound("q", q, self.nq))  # type: ignore[no-any-return]

    def configuration(self, values: Mapping[str, float], base: FloatArray | None = None) -> FloatArray:
        """(nq,) ``base`` (neutral if None) with the joints named in ``values`` at rad or m; raises JointNotFound."""
        q = np.array(self.neutral if base is None else _sound("base", base, self.nq))
        for name, value in values.items():
            self.dof(name)
            joint = self._joints[name]
            value = checks.number(f"joint {name!r}", value)
            q[joint.idx_q : joint.idx_q + joint.nq] = value if joint.nq == 1 else (np.cos(value), np.sin(value))
        return q

    def random_configuration(self, rng: np.random.Generator) -> FloatArray:
        """(nq,) uniform inside the position limits; unlimited joints in +-pi or +-1 m, bases in +-1 m, any rotation."""
        if not isinstance(rng, np.random.Generator):
            raise ParameterError(f"rng is a {type(rng).__name__}; expected numpy.random.default_rng(seed)")
        q = pin.randomConfiguration(self.model, np.full(self.nq, -1.0), np.full(self.nq, 1.0))
        low, high = self.limits.position_lower, self.limits.position_upper
        values = {}
        for name, joint in self._joints.items():
            if joint.nv == 1:
                i, reach = joint.idx_v, 1.0 if self.is_prismatic(name) else np.pi
                values[name] = rng.uniform(
                    low[i] if np.isfinite(low[i]) else -reach, high[i] if np.isfinite(high[i]) else reach
                )
            elif joint.nv == 3:
                angle = rng.uniform(-np.pi, np.pi)
                q[joint.idx_q : joint.idx_q + 4] = *rng.uniform(-1, 1, 2), np.cos(angle), np.sin(angle)
            else:
                quaternion = rng.normal(size=4)
                q[joint.idx_q : joint.idx_q + 7] = (
                    *rng.uniform(-1, 1, 3),
                    *(quaternion / np.linalg.norm(quaternion)),
                )
        return self.configuration(values, q)

    def _home(self, given: Mapping[str, float]) -> FloatArray:
        """Zero where the limits allow it with room to spare, else mid-range; then what is ``given``."""
        values = {}
        for name, joint in self._joints.items():
            if joint.nv == 1:
                low, high = self.limits.position_lower[joint.idx_v], self.limits.position_upper[joint.idx_v]
                margin = 0.05 * (high - low)
                values[name] = (
                    0.0 if not np.isfinite(margin) or low + margin <= 0.0 <= high - margin else 0.5 * (low + high)
                )
        return self.configuration(values | {n: v for n, v in given.items() if n in self._joints})

    def _tool(self, tool: str | None) -> str:
        """The given frame, or the last one: where a serial arm's URDF ends."""
        if tool is None:
            return self.frame_names[-1]  # type: ignore[no-any-return]
        self.frame_id(tool)
        return tool

    def __repr__(self) -> str:
        return f"Robot({self.name!r}, nq={self.nq}, nv={self.nv}, tool={self.tool!r})"


def _dof_names(model: pin.Model) -> list[str]:
    names = [""] * model.nv
    for name, joint in zip(model.names, model.joints, strict=True):
        if joint.idx_v < 0 or joint.nv == 0:
            continue
        for k in range(joint.nv):
            names[joint.idx_v + k] = name if joint.nv == 1 else f"{name}.{_BASE_DOFS[joint.nv][k]}"
    return names


def _read_only(array: Any) -> FloatArray:
    copy = np.array(array, dtype=np.float64)
    copy.flags.writeable = False
    return copy


def _sound(name: str, value: Any, size: int) -> FloatArray:
    """``value`` itself if it is a sound (size,) array, else a checked copy; raises ShapeError, NonFiniteError."""
    if type(value) is np.ndarray and value.dtype == np.float64 and value.shape == (size,) and checks.is_moderate(value):
        return value
    return checks.vector(name, value, size, largest=checks.LARGEST)
