"""From joint axes to Denavit-Hartenberg frames, by the rule of the common normal.

z_i lies along the axis of joint i + 1, x_i along the common normal from z_{i-1} to z_i, y_i completes the frame. Then
theta_i is the angle from x_{i-1} to x_i about z_{i-1}, d_i the distance along it, a_i the distance from z_{i-1} to z_i
along x_i, alpha_i the angle between them about it (Denavit & Hartenberg 1955). Where the rule leaves a choice:

    axes intersect   the origin is their point, x_i = z_{i-1} x z_i
    axes parallel    of all common normals the one with d_i = 0
    axes coincide    x_i = x_{i-1}, and the origin stays

Axes that are nearly parallel would have their feet metres or kilometres away; they get Hayati's angle beta about y_i,
with d_i = 0, so that the table stays as exact and as moderate as the axes (Hayati 1983).
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from cartctl import checks
from cartctl.calibration.dh_chain import DHChain
from cartctl.calibration.motions import AXES, placed
from cartctl.checks import FloatArray
from cartctl.errors import ParameterError
from cartctl.spatial.frames import as_pose, inverse_pose
from cartctl.spatial.rotations import cross

NEARLY = 1e-4  # rad between axes that count as nearly parallel
WIDELY = 0.1  # the same where Hayati's parameters are wanted
_POINT = 1e-12  # m, below which two points are one
_DUST = 1e-14  # m or rad, what round-off leaves of a zero


class Link(NamedTuple):
    """``Rz(theta) Tz(d) Tx(a) Rx(alpha) Ry(beta)``, from a frame on one axis to a frame on the next."""

    theta: float
    d: float
    a: float
    alpha: float
    beta: float

    def pose(self) -> FloatArray:
        """The product, (4, 4)."""
        x, y, z = AXES["x"], AXES["y"], AXES["z"]
        along = placed(True, z, self.theta) @ placed(False, z, self.d) @ placed(False, x, self.a)
        return along @ placed(True, x, self.alpha) @ placed(True, y, self.beta)


def table_of_axes(
    points: Any,
    directions: Any,
    joints: str | None = None,
    *,
    tool: Any = None,
    convention: str = "standard",
    hayati: bool = False,
    name: str = "dh",
) -> DHChain:
    """The chain whose joint axes, at q = 0 and seen from the base, pass through ``points`` along ``directions``.

    points, directions: (n, 3), m, directions of any length but 0. tool: the pose of the end at q = 0, (4, 4) or
    pin.SE3; None puts it into the last frame. The first normal leads from the base's z to the first axis, the last one
    to the tool's z; what these cannot express is in the chain's base and tool. hayati: mark the rows between axes
    within 0.1 rad of parallel as Hayati's, with beta in place of d.

    Raises ShapeError, NonFiniteError, ParameterError for a direction of length 0.
    """
    axes = checks.matrix("directions", directions, None, 3)
    n = len(axes)
    origins = checks.matrix("points", points, n, 3)
    length = np.linalg.norm(axes, axis=1)
    if not n or (length < 1e-9).any():
        raise ParameterError(f"directions holds {axes.tolist()!r:.80}; expected n >= 1 directions of length above 0")
    axes = axes / length[:, None]
    near = WIDELY if hayati else NEARLY
    frame, links, marked = np.eye(4), list[Link](), list[int]()
    end = None if tool is None else as_pose("tool", tool)
    lines = [(origins[i], axes[i]) for i in range(n)] + ([] if end is None else [(end[:3, 3], end[:3, 2])])
    for k, (point, axis) in enumerate(lines):
        link, parallel = link_to(frame, point, axis, near)
        frame = frame @ link.pose()
        links.append(link)
        if hayati and parallel and 0 < k < n:
            marked.append(k)
    if end is None:
        links.append(Link(0.0, 0.0, 0.0, 0.0, 0.0))
        rest = np.eye(4)
    else:
        rest = inverse_pose(frame) @ end
    return _chain(links, rest, marked, joints or "R" * n, convention, name)


def link_to(frame: FloatArray, point: FloatArray, axis: FloatArray, near: float = NEARLY) -> tuple[Link, bool]:
    """The link from a frame (4, 4) to the line through ``point`` along the unit ``axis``; whether they are parallel."""
    x, y, z, origin = frame[:3, 0], frame[:3, 1], frame[:3, 2], frame[:3, 3]
    normal = cross(z, axis)
    sine = math.hypot(*normal.tolist())
    if sine > near:
        normal = normal / sine
        gap = point - origin
        a = float(gap @ normal)
        if a < -_POINT:
            normal, a = -normal, -a
        # feet: origin + d z on the one axis, where the plane of the normal and the other axis cuts it
        d = float(cross(gap, axis) @ cross(z, axis)) / (sine * sine)
        theta = math.atan2(float(normal @ y), float(normal @ x))
        alpha = math.atan2(float(cross(z, axis) @ normal), float(z @ axis))
        return Link(*map(_clean, (theta, d, a, alpha, 0.0))), False
    # the next origin: where the line cuts the plane through this one across z
    gap = point - origin
    gap = gap - axis * (float(gap @ z) / float(axis @ z))
    a = math.hypot(*gap.tolist())
    theta = math.atan2(float(gap @ y), float(gap @ x)) if a > _POINT else 0.0
    c, s = math.cos(theta), math.sin(theta)
    along, across = c * x + s * y, c * y - s * x
    beta = math.asin(min(1.0, max(-1.0, float(axis @ along))))
    alpha = math.atan2(-float(axis @ across), float(axis @ z))
    return Link(*map(_clean, (theta, 0.0, a if a > _POINT else 0.0, alpha, beta))), True


def _chain(links: list[Link], rest: FloatArray, marked: list[int], joints: str, convention: str, name: str) -> DHChain:
    """The n + 1 links as n rows: the modified convention takes a, alpha, beta from the link before."""
    checks.choice("convention", convention, ("standard", "modified"))
    first, last = links[0], links[-1]
    if convention == "standard":
        far, base, tool = links[1:], first.pose(), rest
        rows = tuple(marked)
    else:
        far = links[:-1]
        base = Link(first.theta, first.d, 0.0, 0.0, 0.0).pose()
        tool = Link(0.0, 0.0, last.a, last.alpha, last.beta).pose() @ rest
        rows = tuple(k + 1 for k in marked)
    rows = tuple(i for i in rows if joints[i - 1 : i] == "R")
    return DHChain(
        a=[link.a for link in far],
        alpha=[link.alpha for link in far],
        beta=[link.beta for link in far],
        d=[link.d for link in links[1:]],
        theta=[link.theta for link in links[1:]],
        joints=joints,
        convention=convention,
        hayati=rows,
        base=base,
        tool=tool,
        name=name,
    )


def _clean(value: float) -> float:
    return 0.0 if abs(value) < _DUST else value
