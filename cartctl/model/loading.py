"""From a name or a URDF to a Robot: locked joints, root joint, mimic joints, gravity."""

from __future__ import annotations

import os
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from fnmatch import fnmatchcase
from functools import reduce
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from cartctl import checks
from cartctl.errors import CartctlWarning, JointNotFound, ParameterError, RobotNotFound, UrdfError
from cartctl.model import urdf as urdf_file
from cartctl.model.console import console_of_c
from cartctl.model.library import LibraryEntry, find, robots
from cartctl.model.meshes import MeshFolders
from cartctl.model.payload import Payload
from cartctl.model.planar import PlanarLimits, planar_urdf
from cartctl.model.robot import Robot
from cartctl.model.urdf import Urdf
from cartctl.model.visuals import Geometry

_ROOTS = {"fixed": None, "planar": pin.JointModelPlanar, "free_flyer": pin.JointModelFreeFlyer}
EARTH = (0.0, 0.0, -9.81)


def load(
    source: str | os.PathLike[str],
    *,
    package_dirs: Sequence[str | os.PathLike[str]] = (),
    root_joint: str | None = None,
    active_joints: Sequence[str] | None = None,
    fingers: bool = False,
    tool: str | None = None,
    home: Mapping[str, float] | None = None,
    gravity: Sequence[float] = EARTH,
) -> Robot:
    """A robot by name (see :func:`cartctl.robots`) or from a URDF file.

    source: a name, or a path to a .urdf. package_dirs: folders in which ``package://`` names and meshes are looked up.
    root_joint: ``"fixed"``, ``"planar"`` or ``"free_flyer"``. active_joints: the joints that stay movable, all others
    are locked at ``home``; by default all but those the library locks. fingers: keep those too. tool: name of the tool
    frame. home: joint name -> rad or m, over the library's. gravity: (3,), m/s^2.

    Raises RobotNotFound, UrdfError, JointNotFound, FrameNotFound, ParameterError, ShapeError, NonFiniteError. Missing
    meshes are one CartctlWarning.

    >>> import cartctl as cc
    >>> robot = cc.load("panda")
    >>> robot.nv, robot.tool
    (7, 'panda_hand_tcp')
    """
    if not isinstance(source, (str, os.PathLike)):
        raise ParameterError(f"source is a {type(source).__name__}; expected a name from cc.robots() or a path")
    if home is not None and not isinstance(home, Mapping):
        raise ParameterError(f"home is a {type(home).__name__}; expected a mapping of joint names to rad or m")
    checks.choice("root_joint", root_joint or "fixed", tuple(_ROOTS))
    entry = _entry(source)
    label = entry.name if entry else str(source)
    parsed = _parse(source, entry, package_dirs)
    root = root_joint or (entry.root_joint if entry else "fixed")
    posture = {**(entry.home if entry else {}), **(home or {})}
    for joint in home or {}:
        if joint not in parsed.joints:
            raise JointNotFound(joint, parsed.joints, "in home=")
    active = _active(parsed, active_joints, () if fingers or entry is None else entry.locked)
    text = parsed.text(mimicking=_mimicking(parsed, active))
    model = _lock(_build(text, root, label), active, posture, parsed)
    model.gravity = _gravity(gravity)
    model.name = entry.name if entry else parsed.name
    if parsed.missing:
        warnings.warn(_missing(label, parsed.missing), CartctlWarning, stacklevel=2)
    return Robot(
        model,
        tool=tool or (entry.tool if entry else None),
        home=posture,
        acceleration=entry.acceleration if entry else None,
        jerk=entry.jerk if entry else None,
        geometry=Geometry(text, collada_y_up=entry is not None and entry.collada_y_up),
        spec={
            "source": label if entry else str(Path(source).resolve()),
            "package_dirs": [str(Path(d).resolve()) for d in package_dirs],
            "root_joint": root,
            "active_joints": None if active_joints is None else list(active_joints),
            "fingers": bool(fingers),
            "tool": tool,
            "home": dict(home) if home else None,
            "gravity": [float(x) for x in gravity],
        },
    )


def _entry(source: str | os.PathLike[str]) -> LibraryEntry | None:
    """The library's entry, or None where ``source`` is a path."""
    text = os.fspath(source)
    looks_like_path = (
        not isinstance(source, str) or text.lower().endswith((".urdf", ".xml", ".xacro")) or os.sep in text
    )
    if looks_like_path or _is_file(text):
        return None
    if not text.strip():
        raise RobotNotFound(text, robots(), "or a path to a .urdf file")
    return find(text)


def _is_file(text: str) -> bool:
    try:
        return Path(text).is_file()
    except (OSError, ValueError):  # too long for a path, or a NUL
        return False


def _parse(source: Any, entry: LibraryEntry | None, package_dirs: Sequence[Any]) -> Urdf:
    if entry is None:
        path = Path(source)
        data: str | bytes = urdf_file.read(path)
        return urdf_file.parse(data, str(source), MeshFolders.of(path, package_dirs))
    folders = MeshFolders.of(entry.urdf_path(), [*entry.package_dirs(), *package_dirs])
    return urdf_file.parse(entry.urdf_text(), entry.name, folders)


def _active(parsed: Urdf, wanted: Sequence[str] | None, locked: Sequence[str]) -> set[str]:
    """The independent joints that stay movable; joints that mimic them follow."""
    names = list(parsed.joints)
    if wanted is None:
        active = {n for n in names if not any(fnmatchcase(n, pattern) for pattern in locked)}
        return {n for n in active if n not in parsed.mimics}
    if isinstance(wanted, str):
        wanted = [wanted]
    for name in wanted:
        if name not in parsed.joints:
            raise JointNotFound(name, names)
        master = parsed.mimics[name].master if name in parsed.mimics else None
        if master is not None and master not in wanted:
            raise UrdfError(f"joint {name!r} mimics {master!r}; add {master!r} to active_joints, or leave both out")
    active = {n for n in wanted if n not in parsed.mimics}
    if not active:
        raise UrdfError("active_joints is empty; expected at least one movable joint")
    return active


def _mimicking(parsed: Urdf, active: set[str]) -> set[str]:
    """The mimic joints whose master moves."""
    followers = {n for n, m in parsed.mimics.items() if m.master in active}
    chained = [n for n, m in parsed.mimics.items() if m.master in followers]
    if chained:
        raise UrdfError(
            f"joint {chained[0]!r} mimics a joint that itself mimics another; expected an independent master"
        )
    for name in followers:
        if "continuous" in (parsed.joints[name], parsed.joints[parsed.mimics[name].master]):
            raise UrdfError(
                f"joint {name!r} mimics a continuous joint, or is one; leave its master out of active_joints"
            )
    return followers


def _build(text: str, root: str, label: str) -> pin.Model:
    joint = _ROOTS[root]
    said: list[str] = []
    try:
        with console_of_c(said):
            if joint is None:
                return pin.buildModelFromXML(text, True)
            return pin.buildModelFromXML(text, joint(), True)
    except (ValueError, RuntimeError) as error:
        why = " ".join((said[0] if said else str(error)).split()).removeprefix("Error:").strip().rstrip(".")[:200]
        advice = "; lock its mimic joints: leave them out of active_joints" if "mimic" in why.lower() else ""
        raise UrdfError(f"{label} cannot be built: {why}{advice}") from None


def _lock(model: pin.Model, active: set[str], posture: Mapping[str, float], parsed: Urdf) -> pin.Model:
    """``model`` with every joint but the active ones, their followers and the root fixed at ``posture``."""
    followers = _mimicking(parsed, active)
    frozen = [n for n in parsed.joints if n not in active and n not in followers]
    if not frozen:
        return model
    whole = Robot(model, home=posture)
    values = {n: _locked_at(n, whole, posture, parsed) for n in frozen}
    return pin.buildReducedModel(model, [model.getJointId(n) for n in frozen], whole.configuration(values, whole.home))


def _locked_at(name: str, whole: Robot, posture: Mapping[str, float], parsed: Urdf, depth: int = 0) -> float:
    """Where a locked joint stands: as asked, following its locked master, or at home."""
    if name in posture:
        return posture[name]
    mimic = parsed.mimics.get(name)
    if mimic is not None:
        if depth > len(parsed.mimics):
            raise UrdfError(f"joint {name!r} mimics itself in a circle; expected an independent master")
        return mimic.multiplier * _locked_at(mimic.master, whole, posture, parsed, depth + 1) + mimic.offset
    return float(whole.coordinates(whole.home)[whole.dof(name)])


def _missing(label: str, missing: list[str]) -> str:
    return (
        f"{label}: {len(missing)} mesh file(s) not found, the first {missing[0]!r}; loaded without these shapes "
        "(pass the folder that holds them in package_dirs=[...])"
    )


def planar(
    lengths: Sequence[float],
    masses: Sequence[float] | None = None,
    *,
    joints: str | None = None,
    name: str | None = None,
    limits: PlanarLimits | None = None,
    gravity: Sequence[float] = EARTH,
) -> Robot:
    """A planar arm with links of the given lengths (m) and masses (kg), in the x-y plane, tip frame ``tool``.

    joints, name, limits as in :func:`cartctl.model.planar.planar_urdf`. Raises as that and :func:`load`.

    >>> import cartctl as cc
    >>> arm = cc.planar([1.0, 0.5])
    >>> arm.state([0.0, 0.0]).position("tool").round(6)
    array([1.5, 0. , 0. ])
    """
    text = planar_urdf(lengths, masses, joints=joints, name=name, limits=limits)
    parsed = urdf_file.parse(text, "planar arm", MeshFolders(None, ()))
    model = _build(text, "fixed", "planar arm")
    model.gravity = _gravity(gravity)
    model.name = parsed.name
    spec = {
        "lengths": [float(x) for x in lengths],
        "masses": None if masses is None else [float(x) for x in masses],
        "joints": joints,
        "name": name,
        "limits": None if limits is None else asdict(limits),
        "gravity": [float(x) for x in gravity],
    }
    return Robot(model, tool="tool", geometry=Geometry(text), spec=spec)


def _gravity(gravity: Sequence[float]) -> pin.Motion:
    return pin.Motion(np.array(checks.vector("gravity", gravity, 3, largest=1e6)), np.zeros(3))


def reload(spec: Mapping[str, Any]) -> Robot:
    """The robot whose ``spec`` this is."""
    if "payloads" in spec:
        bare = {key: value for key, value in spec.items() if key != "payloads"}
        return reduce(Robot.carrying, (Payload(**entry) for entry in spec["payloads"]), reload(bare))
    if "lengths" not in spec:
        return load(**spec)
    limits = spec.get("limits")
    return planar(**{**spec, "limits": None if limits is None else PlanarLimits(**limits)})
