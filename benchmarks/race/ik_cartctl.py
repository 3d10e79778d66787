"""Pose inverse kinematics of all targets by ``cc.inverse_kinematics``, on one thread."""

from __future__ import annotations

from worker import job, serve

import cartctl as cc

data = job()
robot = cc.load("panda")


def work() -> dict:
    """All targets in one call, from matrices to checked answers."""
    found = cc.inverse_kinematics(robot, data["targets"], threads=1)
    return {"q": found.q, "claimed": found.success}


serve(("cartctl", "pin", "numba", "numpy"), work)
