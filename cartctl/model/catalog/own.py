"""Robots whose URDF is ours: the lectures' arms and two KUKA arms. Figures and sources: urdf/README.md."""

from __future__ import annotations

from math import pi, radians

from cartctl.model.catalog.entry import LibraryEntry, joints, sources

_README = "urdf/README.md"
_TIP = "the tip of the last link"
_NONE = "ours: none"


def planar(n: int) -> LibraryEntry:
    """Return the planar arm of n revolute joints, links of 1 m and 1 kg, at home along an arc."""
    written = f"urdf:planar_{n}r.urdf" if n in (2, 3, 4) else f"planar:{n}"
    return LibraryEntry(
        name=f"planar{n}R",
        summary=f"planar arm of the lectures, {n} dof, links of 1 m in the x-y plane",
        urdf=written,
        tool="tool",
        home=joints("joint{}", 0.0, *[pi / n] * (n - 1)),
        sources=sources(
            "ours, a textbook arm", _TIP, "ours: an arc, each joint but the first at 180/n deg", _NONE, _NONE
        ),
    )


_PPR = LibraryEntry(
    name="ppr",
    summary="planar PPR arm of the lectures, 3 dof, two orthogonal slides and a link of 1 m",
    urdf="urdf:ppr.urdf",
    tool="tool",
    home={"joint1": 0.0, "joint2": 0.0, "joint3": pi / 4},
    sources=sources("ours, a textbook arm", _TIP, "ours: slides midway, link at 45 deg", _NONE, _NONE),
)

_ELBOW = LibraryEntry(
    name="elbow3R",
    summary="spatial elbow arm of the lectures, 3 dof, base yaw, shoulder and elbow, links of 1 m",
    urdf="urdf:elbow_3r.urdf",
    tool="tool",
    home={"joint1": 0.0, "joint2": pi / 4, "joint3": -pi / 2},
    sources=sources("ours, a textbook arm", _TIP, "ours: elbow up, bent by 90 deg", _NONE, _NONE),
)

_LWR = LibraryEntry(
    name="lwr",
    summary="KUKA LWR IV+ arm, 7 dof, inertias partly estimated",
    urdf="urdf:kuka_lwr4.urdf",
    tool="tool",
    home=joints("lwr_joint{}", 0.0, -pi / 6, 0.0, pi / 2, 0.0, -pi / 3, 0.0),
    acceleration={"lwr_joint?": radians(300.0)},
    sources=sources(
        f"ours; {_README} names the source of each figure and what is estimated",
        "the flange, 78 mm from the wrist centre",
        "ours: elbow bent by 90 deg, flange down",
        "300 deg/s^2: the limit of published experiments (Flacco, De Luca, Khatib), no data sheet's",
    ),
)

_IIWA = LibraryEntry(
    name="iiwa14",
    summary="KUKA LBR iiwa 14 R820 arm, 7 dof, inertias estimated",
    urdf="urdf:kuka_iiwa14.urdf",
    tool="tool",
    home=joints("iiwa_joint{}", 0.0, pi / 6, 0.0, -pi / 2, 0.0, pi / 3, 0.0),
    acceleration=joints("iiwa_joint{}", 8.57, 8.57, 8.74, 11.36, 12.23, 15.72, 15.72),
    sources=sources(
        f"ours; {_README} names the source of each figure and what is estimated",
        "the flange, 126 mm from the wrist centre",
        "ours: elbow bent by 90 deg, flange down",
        "measured, not KUKA's: Drake's iiwa_description, after a Chalmers thesis (20.500.12380/256658)",
    ),
)

ENTRIES = (planar(2), planar(3), planar(4), _PPR, _ELBOW, _LWR, _IIWA)
