"""Pairs of parts, where they are at a state, and the distances of those that are near.

Distances, witness points and normals are coal's, through Pinocchio's geometry; balls and boxes about the parts say
which pairs need one. d is negative where two overlap, by how far they must be moved apart; n points from the second
part to the first, so that the distance grows along n whatever its sign, and ``dd/dq = n^T (J_p1 - J_p2)``.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from cartctl.checks import FloatArray, IntArray
from cartctl.errors import ParameterError
from cartctl.model.robot import Robot
from cartctl.model.scene import kernel
from cartctl.model.scene.bodies import Part
from cartctl.model.state import State
from cartctl.spatial import log3

_EXACT = 1e-9  # of coal's iterations: shapes with corners need few


class Contacts(NamedTuple):
    """Pairs that are near, K of them: which (K,), distance (K,) m, n (K, 3), the two closest points (K, 3) each."""

    pairs: IntArray
    distance: FloatArray
    normal: FloatArray
    first: FloatArray
    second: FloatArray


class Arrangement:
    """The pairs of one robot's parts with each other or with obstacles; belongs to one thread.

    pairs: of indices of parts, the first of which hangs on the robot.
    """

    def __init__(self, robot: Robot, parts: Sequence[Part], pairs: Sequence[tuple[int, int]]) -> None:
        self.robot, self.parts, self.pairs = robot, tuple(parts), tuple(pairs)
        self.support = _support(robot)
        self.indices: IntArray = np.array(self.pairs, dtype=np.int64).reshape(-1)
        self.table, self.points = _table(self.parts)
        self._local = np.array([_flat(part.pose) for part in parts]).reshape(-1, 12)
        self._moving = [k for k, part in enumerate(parts) if part.obstacle is not None and part.obstacle.moves]
        self._shapes = _shapes(self.parts, self.pairs)
        self._data = pin.GeometryData(self._shapes)
        for request in self._data.distanceRequests:
            request.gjk_tolerance = request.epa_tolerance = _EXACT
        self._objects = [self._shapes.geometryObjects[k] for k in self._moving]
        self._kernels = (
            kernel.place.compiled,
            kernel.haste.compiled,
            kernel.bounds.compiled,
            kernel.gradients.compiled,
        )
        self._choose = kernel.choose.compiled
        self._at: tuple[State, int] | None = None
        self.world = np.empty((len(parts), 12))

    def update(self, state: State) -> None:
        """Put everything where it is at a state."""
        if self._at is not None and self._at[0] is state and self._at[1] == state.stamp:
            return
        for k, thing in zip(self._moving, self._objects, strict=True):
            pose = self.parts[k].obstacle.pose(state.time)  # type: ignore[union-attr]
            thing.placement = pose
            self._local[k] = _flat(pose)
        self._kernels[0](state.joint_poses, self.table, self._local, self.world)
        state.place_shapes(self._shapes, self._data)
        self._at = (state, state.stamp)

    def ahead(self, state: State, dt: float) -> FloatArray:
        """World poses (N, 12) with what is on a path where it will be a step later; call :meth:`update` before."""
        if not self._moving:
            return self.world
        world: FloatArray = self.world.copy()
        for k in self._moving:
            world[k] = _flat(self.parts[k].obstacle.pose(state.time + dt))  # type: ignore[union-attr]
        return world

    def haste(self, state: State, rates: FloatArray, dt: float, ahead: FloatArray) -> FloatArray:
        """(N, 3): the largest speed of any point of a part, m/s; how much one step bends its way, in m and m/s."""
        out = np.empty((len(self.parts), 3))
        self._kernels[1](self.world, self.table, state.spatial_jacobian, self.support, rates, dt, out)
        for k in self._moving:
            R = ahead[k, :9].reshape(3, 3) @ self.world[k, :9].reshape(3, 3).T
            middle = self.parts[k].shape.middle
            shift = _applied(ahead[k], middle) - _applied(self.world[k], middle)
            turn = float(np.linalg.norm(log3(R))) * self.parts[k].shape.reach
            out[k, 0] = (float(np.linalg.norm(shift)) + turn) / dt
        return out

    def imminent(
        self, haste: FloatArray, margin: float, deceleration: float, dt: float, near: float, error: float
    ) -> Contacts:
        """The pairs that could come into a margin if nothing slowed them, see :func:`kernel.choose`."""
        chosen = np.empty(len(self.pairs), dtype=np.int64)
        count = self._choose(self.world, self.table, self.indices, haste, margin, deceleration, dt, near, error, chosen)
        return self.measure(chosen[:count])

    def bounds(self) -> FloatArray:
        """Lower bounds (P,) of all distances, m."""
        out = np.empty(len(self.pairs))
        self._kernels[2](self.world, self.table, self.indices, out)
        return out

    def measure(self, pairs: IntArray) -> Contacts:
        """The distances of some of the pairs, given by their index."""
        shapes, data, count = self._shapes, self._data, len(pairs)
        distance, vectors = np.empty(count), np.empty((3, count, 3))
        for k, pair in enumerate(pairs.tolist()):
            found = pin.computeDistance(shapes, data, pair)
            distance[k] = found.min_distance
            vectors[0, k], vectors[1, k], vectors[2, k] = (
                found.normal,
                found.getNearestPoint1(),
                found.getNearestPoint2(),
            )
        return Contacts(pairs, distance, -vectors[0], vectors[1], vectors[2])

    def within(self, state: State, reach: float) -> Contacts:
        """All pairs whose distance may be below ``reach``, m."""
        self.update(state)
        found = self.measure(np.flatnonzero(self.bounds() < reach))
        near = found.distance < reach
        return found if near.all() else Contacts(*(part[near] for part in found))  # type: ignore[arg-type]

    def closest(self, state: State) -> Contacts:
        """The closest pair, as one contact; none where there is no pair."""
        self.update(state)
        bounds = self.bounds()
        best, least = None, np.inf
        for pair in np.argsort(bounds).tolist():
            if bounds[pair] >= least:
                break
            found = self.measure(np.array([pair]))
            if found.distance[0] < least:
                best, least = found, found.distance[0]
        return self.measure(np.empty(0, dtype=np.int64)) if best is None else best

    def gradients(self, state: State, contacts: Contacts) -> FloatArray:
        """``n^T (J_p1 - J_p2)`` (K, nv), m/rad, or 1 for what slides."""
        pairs, _, n, first, second = contacts
        out = np.empty((len(pairs), self.robot.nv))
        self._kernels[3](self.table, self.indices, pairs, n, first, second, state.spatial_jacobian, self.support, out)
        return out

    def names(self, pair: int) -> tuple[str, str]:
        """What the two parts of a pair belong to."""
        i, j = self.pairs[pair]
        return self.parts[i].name, self.parts[j].name


def _support(robot: Robot) -> FloatArray:
    """(njoints, nv): 1 where a coordinate moves what hangs on a joint."""
    model = robot.model
    support = np.zeros((model.njoints, model.nv))
    for j in range(1, model.njoints):
        joint = model.joints[j]
        support[j] = support[int(model.parents[j])]
        support[j, joint.idx_v : joint.idx_v + joint.nv] = 1.0
    return support


def _table(parts: Sequence[Part]) -> tuple[FloatArray, FloatArray]:
    """What the kernels read of every part, and all points (M, 3) one after the other."""
    table = np.zeros((len(parts), kernel.WIDTH))
    first = 0
    for row, part in zip(table, parts, strict=True):
        shape = part.shape
        if shape.plane and part.joint:
            raise ParameterError(f"plane {part.name!r} hangs on a joint; expected a plane in the world")
        row[:6] = part.joint, first, first + len(shape.points), shape.plane, shape.radius, shape.reach
        row[6:9], row[9:] = shape.half, shape.middle
        first += len(shape.points)
    points = np.concatenate([part.shape.points for part in parts]) if parts else np.empty((0, 3))
    return table, np.ascontiguousarray(points)


def _shapes(parts: Sequence[Part], pairs: Sequence[tuple[int, int]]) -> Any:
    shapes = pin.GeometryModel()
    for k, part in enumerate(parts):
        shapes.addGeometryObject(pin.GeometryObject(f"{k} {part.name}", part.joint, part.pose, part.shape.coal))
    for i, j in pairs:
        shapes.addCollisionPair(pin.CollisionPair(i, j))
    return shapes


def _flat(pose: pin.SE3) -> FloatArray:
    return np.concatenate([pose.rotation.ravel(), pose.translation])


def _applied(row: FloatArray, point: FloatArray) -> FloatArray:
    return row[:9].reshape(3, 3) @ point + row[9:]
