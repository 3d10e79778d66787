"""The ghost: the posture that the same motion of the hand would have led to without anything in the null space."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from cartctl.algebra.svd import svd
from cartctl.report.mesh import Array, IntArray

if TYPE_CHECKING:
    from cartctl.model.robot import Robot
    from cartctl.motion.run import Run, TaskRecord

_PART = 0.02  # s between two postures of the ghost, at most
_MOST = 20_000  # postures in between
_ROUNDS = 2  # of correction each
_STEP = 0.3  # rad or m that a joint may go in a round
_DAMPING = 1e-2  # of the largest singular value
_SEEN = 2e-2  # rad or m that the ghost must be away from the robot to be worth a picture


def ghost_postures(run: Run, shown: IntArray) -> Array | None:
    """Return the ghost's configurations (k, nq) at the samples ``shown``, None where there is none to be seen.

    From the same start it follows the path that the hand of the first task did go, by the least joint rates of all that
    do so: ``q_dot = J# r_dot``, kept on the path by feedback, and without limits (Whitney 1969). What sets it apart
    from the robot is all that the null space held: the objective, tasks of lower priority, and what limits forced.
    """
    record = next((r for r in run.tasks if r.rows and r.pose is not None and r.pose.shape[1] == 7), None)
    if record is None or len(record.rows or ()) >= run.robot.nv or len(shown) < 2:
        return None
    q = np.array(run.q[0])
    out = [q]
    way = _samples(run.time, shown)
    state = {int(k): i for i, k in enumerate(shown)}
    data = pin.Data(run.robot.model)
    for k in way[1:]:
        q = _follow(run.robot, data, record, q, record.pose[k])  # type: ignore[index]
        if int(k) in state:
            out.append(q)
    ghosts = np.array(out)
    apart = max(float(np.abs(run.robot.difference(a, b)).max()) for a, b in zip(run.q[shown], ghosts, strict=True))
    return ghosts if apart > _SEEN else None


def _samples(time: Array, shown: IntArray) -> IntArray:
    """The samples that are shown, and enough between them."""
    step = max(round(_PART / max(float(np.median(np.diff(time))), 1e-9)), -(-len(time) // _MOST), 1)
    return np.unique(np.concatenate([shown, np.arange(0, len(time), step)])).astype(np.int64)


def _follow(robot: Robot, data: pin.Data, record: TaskRecord, q: Array, pose: Array) -> Array:
    """The configuration near q whose hand is at ``pose`` x y z qx qy qz qw, by steps in the range of J^T."""
    rows, frame = record.rows or [], robot.frame_id(str(record.frame))
    wanted = pin.XYZQUATToSE3(pose)
    for _ in range(_ROUNDS):
        J = pin.computeFrameJacobian(robot.model, data, q, frame, pin.LOCAL_WORLD_ALIGNED)[rows]
        pin.framesForwardKinematics(robot.model, data, q)
        here = data.oMf[frame]
        error = np.concatenate([wanted.translation - here.translation, pin.log3(wanted.rotation @ here.rotation.T)])[
            rows
        ]
        U, s, Vt = svd(np.asfortranarray(J))
        kept = len(s)
        weak = np.maximum(_DAMPING * s[0] - s, 0.0) if s[0] > 0.0 else s  # damped below a share of the largest only
        gains = np.divide(s, s**2 + weak**2, out=np.zeros_like(s), where=s > 0.0)
        step = Vt[:kept].T @ (gains * (U[:, :kept].T @ error))
        q = robot.integrate(q, step * min(1.0, _STEP / max(float(np.abs(step).max(initial=0.0)), 1e-12)))
    return q
