"""Chains as URDF text: a robot's own file with corrected origins, or a bare chain where there is no file."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np
import pinocchio as pin
from defusedxml import ElementTree as SafeTree

from cartctl.calibration.conversion import segments
from cartctl.calibration.dh_chain import DHChain
from cartctl.calibration.robot_chain import RobotChain
from cartctl.checks import FloatArray
from cartctl.errors import UrdfError
from cartctl.model import urdf as urdf_file
from cartctl.model.library import find
from cartctl.model.planar import PlanarLimits, planar_urdf

BASE, TOOL = "calibrated_base", "calibrated_tool"
_TURN, _SLIDE = 2.0 * math.pi, 10.0  # ranges of joints of which nobody knows any


def chain_urdf(chain: DHChain) -> str:
    """See :meth:`cartctl.DHChain.urdf`."""
    parts, limits = segments(chain), (_TURN, _SLIDE)
    robot, link = Element("robot", name=chain.name), "base"
    SubElement(robot, "link", name=link)
    for i, (letter, place) in enumerate(zip(chain.joints or "", parts.before, strict=True), start=1):
        turns = letter == "R"
        reach = limits[0] if turns else limits[1]
        joint = _joint(robot, f"joint{i}", "revolute" if turns else "prismatic", link, f"link{i}", place)
        SubElement(joint, "axis", xyz="0 0 1")
        SubElement(joint, "limit", lower=_number(-reach), upper=_number(reach), velocity="0", effort="0")
        link = f"link{i}"
        SubElement(robot, "link", name=link)
    _joint(robot, "tool_joint", "fixed", link, "tool", parts.tool)
    SubElement(robot, "link", name="tool")
    return _text(robot)


def robot_urdf(chain: RobotChain) -> str:
    """See :meth:`RobotChain.urdf`; raises UrdfError where the robot's own file is gone or another."""
    source = _own_text(chain)
    if source is None:
        return _bare(chain)
    root = SafeTree.fromstring(source, forbid_dtd=False, forbid_entities=True, forbid_external=True)
    joints = {joint.get("name"): joint for joint in root.findall("joint")}
    for name, C in chain.corrections.items():
        if name not in joints:
            raise UrdfError(f"the URDF of {chain.name!r} has no joint {name!r} any more; load the robot again")
        _replace_origin(joints[name], _origin(joints[name]) @ C)
    if not np.array_equal(chain.tool, np.eye(4)):
        links = {link.get("name") for link in root.findall("link")}
        holder = chain.frame if chain.frame in links else _child(joints.get(chain.frame))
        if holder is None:
            raise UrdfError(
                f"frame {chain.frame!r} is no link of the URDF of {chain.name!r}, so no tool can hang on it"
            )
        SubElement(root, "link", name=TOOL)
        _joint(root, f"{TOOL}_joint", "fixed", holder, TOOL, chain.tool)
    if not np.array_equal(chain.base, np.eye(4)):
        held = {_child(joint) for joint in joints.values()}
        first = next(str(link.get("name")) for link in root.findall("link") if link.get("name") not in held)
        SubElement(root, "link", name=BASE)
        _joint(root, f"{BASE}_joint", "fixed", BASE, first, chain.base)
    return _text(root)


def tool_link(chain: RobotChain) -> str:
    """The link of :func:`robot_urdf` that is the chain's end."""
    if chain.source.spec is None:
        return "tool"
    return chain.frame if np.array_equal(chain.tool, np.eye(4)) else TOOL


def mesh_folders(chain: RobotChain) -> list[Path]:
    """The folders that :func:`cartctl.load` wants as package_dirs to find the meshes of :func:`robot_urdf`."""
    spec = chain.source.spec
    if spec is None or "lengths" in spec:
        return []
    given = [Path(folder) for folder in spec["package_dirs"]]
    path = Path(spec["source"])
    if path.is_absolute():
        return [*given, path.parent]
    entry = find(spec["source"])
    home = entry.urdf_path()
    own = [] if home is None or entry.package_dirs() else [home.parent]
    return [*given, *entry.package_dirs(), *own]


def _own_text(chain: RobotChain) -> str | bytes | None:
    """The URDF the robot was loaded from, None for a Pinocchio model of the user's own."""
    spec = chain.source.spec
    if spec is None:
        return None
    if "lengths" in spec:
        limits = spec.get("limits")
        limits = None if limits is None else PlanarLimits(**limits)
        return planar_urdf(spec["lengths"], spec["masses"], joints=spec["joints"], name=spec["name"], limits=limits)
    path = Path(spec["source"])
    return urdf_file.read(path) if path.is_absolute() else find(spec["source"]).urdf_text()


def _bare(chain: RobotChain) -> str:
    """The joints alone, with their ranges."""
    model = chain.source.model
    robot, link, carried = Element("robot", name=chain.name or "robot"), "base", chain.base
    SubElement(robot, "link", name=link)
    for i, joint in enumerate(chain.joints, start=1):
        place = carried @ model.jointPlacements[joint.number].homogeneous
        place = place @ chain.corrections.get(joint.name, np.eye(4))
        index = model.joints[joint.number].idx_v
        low = float(chain.source.limits.position_lower[index])
        high = float(chain.source.limits.position_upper[index])
        endless = not (math.isfinite(low) and math.isfinite(high))
        ringed = bool(chain.source.continuous[index])
        kind = "continuous" if ringed else "revolute" if joint.turns else "prismatic"
        element = _joint(robot, joint.name, kind, link, f"link{i}", place)
        SubElement(element, "axis", xyz=_numbers(joint.axis))
        if not ringed:
            reach = _TURN if joint.turns else _SLIDE
            low, high = (-reach, reach) if endless else (low, high)
            SubElement(element, "limit", lower=_number(low), upper=_number(high), velocity="0", effort="0")
        link, carried = f"link{i}", np.eye(4)
        SubElement(robot, "link", name=link)
    frame = model.frames[chain.source.frame_id(chain.frame)].placement.homogeneous
    _joint(robot, "tool_joint", "fixed", link, "tool", frame @ chain.tool)
    SubElement(robot, "link", name="tool")
    return _text(robot)


def _joint(robot: Element, name: str, kind: str, parent: str, child: str, place: FloatArray) -> Element:
    joint = SubElement(robot, "joint", name=name, type=kind)
    SubElement(joint, "parent", link=parent)
    SubElement(joint, "child", link=child)
    _replace_origin(joint, place)
    return joint


def _replace_origin(joint: Element, T: FloatArray) -> None:
    """Roll, pitch and yaw about fixed axes: ``R = Rz(yaw) Ry(pitch) Rx(roll)``."""
    for old in joint.findall("origin"):
        joint.remove(old)
    rpy = pin.rpy.matrixToRpy(np.array(T[:3, :3]))
    joint.insert(0, Element("origin", xyz=_numbers(T[:3, 3]), rpy=_numbers(rpy)))


def _origin(joint: Element) -> FloatArray:
    T, origin = np.eye(4), joint.find("origin")
    if origin is not None:
        T[:3, 3] = [float(x) for x in origin.get("xyz", "0 0 0").split()]
        T[:3, :3] = pin.rpy.rpyToMatrix(*(float(x) for x in origin.get("rpy", "0 0 0").split()))
    return T


def _child(joint: Element | None) -> str | None:
    element = None if joint is None else joint.find("child")
    return None if element is None else element.get("link")


def _number(value: float) -> str:
    return f"{value:.17g}"


def _numbers(values: Sequence[float] | FloatArray) -> str:
    return " ".join(_number(float(x)) for x in values)


def _text(root: Element) -> str:
    indent(root)
    return '<?xml version="1.0"?>\n' + tostring(root, encoding="unicode") + "\n"
