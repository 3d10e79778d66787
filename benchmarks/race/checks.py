"""Whether answers hold, by Pinocchio, whoever gave them."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from jobs import ALIGNED, NEAR

import cartctl as cc


def checked_ik(data: dict[str, np.ndarray], found: dict[str, np.ndarray]) -> dict[str, str]:
    """Answers that hold, by Pinocchio; and those claimed that do not."""
    robot, holds = cc.load("panda"), []
    low, high = data["limits"]
    for q, T in zip(found["q"], data["targets"], strict=True):
        pose = robot.state(q).placement(robot.tool)
        apart = np.linalg.norm(pose.translation - T[:3, 3])
        turned = np.linalg.norm(pin.log3(T[:3, :3] @ pose.rotation.T))
        holds.append(apart <= NEAR and turned <= ALIGNED and bool(((q >= low - 1e-9) & (q <= high + 1e-9)).all()))
    share = np.mean(holds)
    claimed = int((found["claimed"] & ~np.array(holds)).sum())
    return {"success": f"{100.0 * share:.2f} %", "error": f"{claimed} claimed and not so"}


def checked_track(data: dict[str, np.ndarray], found: dict[str, np.ndarray]) -> dict[str, str]:
    """How far the hand strays from the path, in place and in orientation, and the largest excess of a limit."""
    robot, Q = cc.load("panda"), found["q"]
    limits = robot.limits
    if Q.shape != (len(data["positions"]), robot.nq) or not np.isfinite(Q).all():
        return {
            "success": "not numbers all along the path",
            "error": f"{Q.shape}, {(~np.isfinite(Q)).sum()} not finite",
        }
    poses = [robot.state(q).placement(robot.tool) for q in Q]
    apart = max(np.linalg.norm(pose.translation - p) for pose, p in zip(poses, data["positions"], strict=True))
    turned = max(np.linalg.norm(pin.log3(data["rotation"] @ pose.rotation.T)) for pose in poses)
    speed = np.abs(np.diff(Q, axis=0)).max(axis=0) / float(data["dt"])
    excess = max(
        float((limits.position_lower - Q).max()),
        float((Q - limits.position_upper).max()),
        float((speed - limits.velocity_upper).max()),
    )
    return {
        "success": f"limits kept by {-excess:.2g}" if excess <= 0.0 else f"limits exceeded by {excess:.2g}",
        "error": f"{1e6 * apart:.3g} um, {1e6 * turned:.3g} urad off the path",
    }
