"""Planar arms of any number of joints, as URDF text: one source for the lectures' 2R, 3R, 4R and PPR.

The arm moves in the x-y plane of the world, so the usual gravity along -z does no work on it. Link i carries
its frame at joint i, x along the link; joint i + 1 sits at (l_i, 0, 0). With all joints revolute the tip is
at p = sum_i l_i (cos a_i, sin a_i), a_i = q_1 + ... + q_i. Links are thin uniform rods, m l^2 / 12 about the
centre of mass.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from cartctl import checks
from cartctl.checks import FloatArray
from cartctl.errors import ParameterError, ShapeError

_AXES = {"R": "0 0 1", "X": "1 0 0", "Y": "0 1 0"}
_DARK, _TIP, _LINKS = "0.22 0.25 0.3 1", "0.93 0.38 0.16 1", ("0.18 0.44 0.72 1", "0.55 0.73 0.88 1")
_HEAD = """<?xml version="1.0"?>
<!-- BSD-3-Clause, the cartctl developers. Written by cartctl.model.planar.planar_urdf: edit that, not this.
     Geometry, masses and limits are a textbook arm's, chosen by us; they belong to no product. -->
"""


@dataclass(frozen=True)
class PlanarLimits:
    """Symmetric limits of every revolute and every sliding joint; the defaults are ours, no robot's."""

    angle: float = math.pi  # rad
    rate: float = math.pi  # rad/s
    torque: float = 100.0  # N m
    stroke: float = 2.0  # m, to either side
    speed: float = 1.0  # m/s
    force: float = 200.0  # N

    def __post_init__(self) -> None:
        """Raise ParameterError or NonFiniteError for a limit that is not a positive number."""
        for field in fields(self):
            checks.number(f"PlanarLimits.{field.name}", getattr(self, field.name), low=0.0, strict=True)


def planar_urdf(
    lengths: Sequence[float] | FloatArray,
    masses: Sequence[float] | FloatArray | None = None,
    *,
    joints: str | None = None,
    name: str | None = None,
    limits: PlanarLimits | None = None,
) -> str:
    """Write the URDF of a planar arm with n >= 1 links of the given lengths, m, and masses, kg, (n,) each.

    ``masses`` defaults to 1 kg/m, and to 1 kg for a carriage without length. ``joints`` has one letter a
    joint: R turns about z, X and Y slide along those axes of the link before (``"XYR"`` is the textbook PPR);
    all R by default. A sliding link may have length 0. The frame ``tool`` is the end of the last link.

    Raises ShapeError, NonFiniteError or ParameterError for data that describe no arm.
    """
    sizes: list[float] = checks.vector("lengths", lengths).tolist()
    weights = [x or 1.0 for x in sizes] if masses is None else checks.vector("masses", masses).tolist()
    kinds = "R" * len(sizes) if joints is None else joints
    _check(sizes, weights, kinds)
    limits, radius = limits or PlanarLimits(), 0.05 * (max(sizes) or 1.0)
    robot = Element("robot", name=name or _default_name(kinds))
    link, offset = _base(robot, radius), 0.0
    for i, (kind, length, mass) in enumerate(zip(kinds, sizes, weights, strict=True), start=1):
        _rail(link, kind, limits, radius)
        _joint(robot, f"joint{i}", kind, link, f"link{i}", offset, limits)
        link, offset = SubElement(robot, "link", name=f"link{i}"), length
        _inertia(link, length, mass, radius)
        _body(link, kind, length, radius, _LINKS[i % 2])
    _joint(robot, "tool_joint", "fixed", link, "tool", offset, limits)
    tool = SubElement(robot, "link", name="tool")
    _shape(tool, "visual", "sphere", (0, 0, 0), colour=_TIP, radius=1.3 * radius)
    indent(robot)
    return _HEAD + tostring(robot, encoding="unicode") + "\n"


def _check(lengths: list[float], masses: list[float], kinds: str) -> None:
    if not lengths:
        raise ShapeError("lengths is empty; expected one length a link, e.g. planar_urdf([1.0, 1.0])")
    if not isinstance(kinds, str) or set(kinds) - set(_AXES):
        raise ParameterError(f"joints is {kinds!r}; expected a string of the letters R, X and Y")
    for label, size in (("masses", len(masses)), ("joints", len(kinds))):
        if size != len(lengths):
            raise ShapeError(f"{label} has {size} entries; expected {len(lengths)}, one for each length")
    for i, (kind, length, mass) in enumerate(zip(kinds, lengths, masses, strict=True)):
        checks.number(f"lengths[{i}]", length, low=0.0, strict=kind == "R")
        checks.number(f"masses[{i}]", mass, low=0.0, strict=True)


def _default_name(kinds: str) -> str:
    turning = set(kinds) == {"R"}
    return f"planar{len(kinds)}R" if turning else kinds.translate(str.maketrans("XYR", "ppr"))


def _num(*values: float) -> str:
    return " ".join(f"{value:.15g}" for value in values)


def _base(robot: Element, radius: float) -> Element:
    link = SubElement(robot, "link", name="base")
    wide, below = 2 * radius, (0, 0, -2.5 * radius)
    _shape(link, "visual", "cylinder", below, colour=_DARK, radius=wide, length=wide)
    return link


def _inertia(link: Element, length: float, mass: float, radius: float) -> None:
    # A rod without thickness has no inertia about itself, which no rigid body has: that one is a cylinder's.
    cube = mass * (4 * radius) ** 2 / 6
    along, across = (mass * radius**2 / 2, mass * length**2 / 12) if length else (cube, cube)
    inertial = SubElement(link, "inertial")
    SubElement(inertial, "origin", xyz=_num(length / 2, 0, 0))
    SubElement(inertial, "mass", value=_num(mass))
    moments = {"ixx": _num(along), "iyy": _num(across), "izz": _num(across)}
    SubElement(inertial, "inertia", {**moments, "ixy": "0", "ixz": "0", "iyz": "0"})


def _body(link: Element, kind: str, length: float, radius: float, colour: str) -> None:
    """Joint drum or carriage, and the rod: drawn, and the larger of them taken for collisions."""
    box = (4 * radius, 4 * radius, 2.4 * radius)
    if kind == "R":
        _shape(link, "visual", "cylinder", (0, 0, 0), colour=_DARK, radius=1.6 * radius, length=3 * radius)
    else:
        _shape(link, "visual", "box", (0, 0, 0), colour=_DARK, size=box)
    if not length:
        return _shape(link, "collision", "box", (0, 0, 0), size=box)
    middle, along_x = (length / 2, 0, 0), (0, math.pi / 2, 0)
    for tag, paint in (("visual", colour), ("collision", "")):
        _shape(link, tag, "cylinder", middle, along_x, paint, radius=radius, length=length)


def _rail(link: Element, kind: str, limits: PlanarLimits, radius: float) -> None:
    """Draw the rail on which the next link slides; only a picture, so it never collides."""
    if kind == "R":
        return
    size = [0.8 * radius, 0.8 * radius, 0.6 * radius]
    size["XY".index(kind)] = 2 * limits.stroke + 4 * radius
    _shape(link, "visual", "box", (0, 0, -1.5 * radius), colour=_LINKS[1], size=size)


def _joint(
    robot: Element, name: str, kind: str, parent: Element, child: str, offset: float, limits: PlanarLimits
) -> None:
    joint_type = {"R": "revolute", "X": "prismatic", "Y": "prismatic"}.get(kind, "fixed")
    joint = SubElement(robot, "joint", name=name, type=joint_type)
    SubElement(joint, "parent", link=parent.get("name", ""))
    SubElement(joint, "child", link=child)
    SubElement(joint, "origin", xyz=_num(offset, 0, 0))
    if joint_type == "fixed":
        return
    turning = (limits.angle, limits.rate, limits.torque)
    reach, velocity, effort = turning if kind == "R" else (limits.stroke, limits.speed, limits.force)
    SubElement(joint, "axis", xyz=_AXES[kind])
    bounds = {"lower": _num(-reach), "upper": _num(reach), "velocity": _num(velocity), "effort": _num(effort)}
    SubElement(joint, "limit", bounds)


def _shape(
    link: Element,
    tag: str,
    primitive: str,
    xyz: Sequence[float],
    rpy: Sequence[float] = (0, 0, 0),
    colour: str = "",
    **dimensions: float | Sequence[float],
) -> None:
    shape = SubElement(link, tag)
    SubElement(shape, "origin", xyz=_num(*xyz), rpy=_num(*rpy))
    sizes = {key: _num(x) if isinstance(x, float) else _num(*x) for key, x in dimensions.items()}
    SubElement(SubElement(shape, "geometry"), primitive, sizes)
    if colour:
        SubElement(SubElement(shape, "material", name=f"rgba {colour}"), "color", rgba=colour)
