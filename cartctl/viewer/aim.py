"""Where the hand is sent: to the handle at once, or, for a robot without limits, there at a bounded speed."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

_SPEED = 1.0  # sizes of the robot, and rad, a second


def towards(start: pin.SE3, end: pin.SE3, seconds: float, size: float) -> pin.SE3:
    """The pose on the way from start to end, by position and by rotation, that is reached within ``seconds``.

    size: of the robot, m.
    """
    way = np.asarray(end.translation - start.translation)
    turn = pin.log3(start.rotation.T @ end.rotation)
    parts = [
        _share(float(np.linalg.norm(way)), _SPEED * size * seconds),
        _share(float(np.linalg.norm(turn)), _SPEED * seconds),
    ]
    return pin.SE3(start.rotation @ pin.exp3(parts[1] * turn), start.translation + parts[0] * way)


def _share(whole: float, most: float) -> float:
    return 1.0 if whole <= most else most / whole
