"""Reading a URDF as data: parsed without entities, checked as a tree, meshes resolved.

What Pinocchio's own parser sees is the text written back from here, so its messages to the console never meet a
user, and nothing of the original file beyond its elements gets through.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree.ElementTree import Element, ParseError, tostring

from defusedxml import DefusedXmlException
from defusedxml import ElementTree as SafeTree

from cartctl.errors import CartctlError, MalformedUrdfError, MissingUrdfError, NoJointsError, UnsafeUrdfError, UrdfError
from cartctl.model.meshes import MeshFolders

MOVABLE = ("revolute", "continuous", "prismatic")
_UNSUPPORTED = ("planar", "floating", "spherical")
_LENGTHS = {"xyz": 3, "rpy": 3, "size": 3}
_LARGEST = 1e6  # of a length, mass or inertia; beyond it nothing is a robot
_MOST_JOINTS = 1000
_NOISE = 1e-12  # CAD exports write -5e-20 for a zero
_NEVER_NEGATIVE = {("mass", "value"), ("inertia", "ixx"), ("inertia", "iyy"), ("inertia", "izz"), ("sphere", "radius")}
_NUMERIC = {
    "xyz", "rpy", "size", "radius", "length", "scale", "value", "ixx", "ixy", "ixz", "iyy", "iyz", "izz", "lower",
    "upper", "effort", "velocity", "multiplier", "offset", "damping", "friction",
}  # fmt: skip


@dataclass(frozen=True)
class Mimic:
    """``q = multiplier * q_master + offset``."""

    master: str
    multiplier: float
    offset: float


@dataclass
class Urdf:
    """A checked URDF. joints: name -> type of every movable joint. missing: meshes that were not found."""

    root: Element
    label: str
    joints: dict[str, str]
    mimics: dict[str, Mimic]
    missing: list[str] = field(default_factory=list)

    @property
    def name(self) -> str:
        """The robot's own name in the file."""
        return self.root.get("name") or "robot"

    def text(self, mimicking: set[str] | None = None) -> str:
        """The URDF as text; ``<mimic>`` is kept only for the joints in ``mimicking`` (all if None)."""
        if mimicking is None:
            return tostring(self.root, encoding="unicode")
        stripped = [
            (j, m) for j in self.root.findall("joint") if j.get("name") not in mimicking for m in j.findall("mimic")
        ]
        for joint, mimic in stripped:
            joint.remove(mimic)
        text = tostring(self.root, encoding="unicode")
        for joint, mimic in stripped:
            joint.append(mimic)
        return text


def read(path: Path) -> bytes:
    """The bytes of a URDF file; raises UrdfError where there is none."""
    try:
        if path.is_dir():
            raise MissingUrdfError(f"{path} is a folder; expected a .urdf file")
        return path.read_bytes()
    except FileNotFoundError:
        raise MissingUrdfError(
            f"{path}: no such file; expected the path of a .urdf file or a name from cc.robots()"
        ) from None
    except CartctlError:
        raise
    except (OSError, ValueError) as error:
        why = error.strerror if isinstance(error, OSError) else str(error)
        raise MissingUrdfError(f"{str(path)[:80]!r} cannot be read: {why}") from None
    except RuntimeError as error:
        raise UrdfError(f"{path} cannot be read: {error}") from None


def parse(data: str | bytes, label: str, folders: MeshFolders) -> Urdf:
    """Parse and check a URDF; raises UrdfError naming ``label`` and what is wrong with it."""
    root = _parse_xml(data, label)
    if root.tag != "robot":
        raise MalformedUrdfError(f"{label}: the root element is <{root.tag}>; expected <robot>")
    if any(str(e.tag).startswith("{http") and "xacro" in str(e.tag) for e in root.iter()):
        raise UrdfError(f"{label} is a xacro file; expand it first: xacro {label} > robot.urdf")
    _check_numbers(root, label)
    joints = _check_tree(root, label)
    movable = {name: kind for name, kind in joints.items() if kind in MOVABLE}
    if not movable:
        raise NoJointsError(
            f"{label} holds {len(joints)} joints, none that moves; expected revolute, continuous or prismatic ones"
        )
    if len(joints) > _MOST_JOINTS:
        raise UrdfError(f"{label} holds {len(joints)} joints; expected at most {_MOST_JOINTS}")
    if not root.get("name"):
        root.set("name", "robot")
    urdf = Urdf(root, label, movable, _mimics(root, label, movable))
    _resolve_meshes(urdf, folders)
    return urdf


def _parse_xml(data: str | bytes, label: str) -> Element:
    try:
        return SafeTree.fromstring(data, forbid_dtd=False, forbid_entities=True, forbid_external=True)  # type: ignore[no-any-return]
    except DefusedXmlException as error:
        raise UnsafeUrdfError(f"{label} declares XML entities ({type(error).__name__}); expected plain URDF") from None
    except ParseError as error:
        raise MalformedUrdfError(f"{label} is not well-formed XML: {error}") from None
    except (ValueError, LookupError) as error:  # unknown encodings, stray NULs
        raise MalformedUrdfError(f"{label} cannot be decoded: {error}") from None


def _check_numbers(root: Element, label: str) -> None:
    for element in root.iter():
        for key, text in element.attrib.items():
            if key not in _NUMERIC or (key == "value" and element.tag != "mass"):
                continue
            try:
                numbers = [float(part) for part in text.split()]
            except ValueError:
                numbers = [math.nan]
            what = f"{label}: <{element.tag} {key}={text[:40]!r}>"
            if not all(map(math.isfinite, numbers)):
                raise UrdfError(f"{what}; expected finite numbers")
            if len(numbers) != _LENGTHS.get(key, 3 if key == "scale" else 1):
                raise UrdfError(f"{what} has {len(numbers)} numbers; expected {_LENGTHS.get(key, 1)}")
            if element.tag != "limit" and any(abs(x) > _LARGEST for x in numbers):
                raise UrdfError(f"{what}; expected magnitudes of at most {_LARGEST:g}")
            if (element.tag, key) in _NEVER_NEGATIVE and numbers[0] < -_NOISE:
                raise UrdfError(f"{what} is negative; expected at least 0")


def _check_tree(root: Element, label: str) -> dict[str, str]:
    """Names -> types of all joints, after checking that links and joints form one tree."""
    links = _unique(root.findall("link"), "link", label)
    joints = _unique(root.findall("joint"), "joint", label)
    parents: dict[str, str] = {}
    for name, joint in joints.items():
        kind = joint.get("type")
        if kind in _UNSUPPORTED:
            raise UrdfError(
                f"{label}: joint {name!r} is {kind}; expected {', '.join(MOVABLE)} or fixed (see root_joint=)"
            )
        if kind not in (*MOVABLE, "fixed"):
            raise UrdfError(f"{label}: joint {name!r} has type {kind!r}; expected {', '.join(MOVABLE)} or fixed")
        _check_motion(joint, name, kind, label)
        ends = [_end(joint, end, name, links, label) for end in ("parent", "child")]
        if ends[1] in parents:
            raise UrdfError(f"{label}: link {ends[1]!r} has two parent joints; expected a tree")
        parents[ends[1]] = ends[0]
    roots = [link for link in links if link not in parents]
    if links and len(roots) != 1:
        raise UrdfError(f"{label} has {len(roots)} root links ({', '.join(roots[:4])}); expected one tree")
    return {name: joint.get("type", "") for name, joint in joints.items()}


def _check_motion(joint: Element, name: str, kind: str, label: str) -> None:
    """A moving joint needs an axis and a range; effort and velocity, if left out, become 0: no limit known."""
    axis = joint.find("axis")
    if kind in MOVABLE and axis is not None and not any(float(x) for x in axis.get("xyz", "1 0 0").split()):
        raise UrdfError(f"{label}: joint {name!r} has the axis 0 0 0; expected a direction")
    limit = joint.find("limit")
    if limit is None:
        if kind in ("revolute", "prismatic"):
            raise UrdfError(
                f"{label}: {kind} joint {name!r} has no <limit>; expected lower and upper (or type continuous)"
            )
        return
    for key in ("effort", "velocity"):
        if limit.get(key) is None:
            limit.set(key, "0")
    low, high = float(limit.get("lower", 0.0)), float(limit.get("upper", 0.0))
    if kind != "continuous" and low > high:
        raise UrdfError(f"{label}: joint {name!r} has lower = {low:g} above upper = {high:g}; expected lower <= upper")


def _unique(elements: list[Element], what: str, label: str) -> dict[str, Element]:
    found: dict[str, Element] = {}
    for element in elements:
        name = element.get("name")
        if not name:
            raise UrdfError(f'{label}: a <{what}> has no name; expected name="..."')
        if name in found:
            raise UrdfError(f"{label}: {what} {name!r} stands there twice; expected unique names")
        found[name] = element
    return found


def _end(joint: Element, end: str, name: str, links: dict[str, Element], label: str) -> str:
    element = joint.find(end)
    link = None if element is None else element.get("link")
    if link not in links:
        raise UrdfError(
            f"{label}: joint {name!r} has the {end} link {link!r}, which is not there; expected a <link> of that name"
        )
    return str(link)


def _mimics(root: Element, label: str, movable: dict[str, str]) -> dict[str, Mimic]:
    found: dict[str, Mimic] = {}
    for joint in root.findall("joint"):
        mimic = joint.find("mimic")
        name = joint.get("name", "")
        if mimic is None or name not in movable:
            continue
        master = mimic.get("joint", "")
        if master not in movable:
            raise UrdfError(f"{label}: joint {name!r} mimics {master!r}, which is no movable joint")
        if master == name or (master in found and found[master].master == name):
            raise UrdfError(
                f"{label}: joint {name!r} mimics itself, by way of {master!r}; expected an independent master"
            )
        found[name] = Mimic(master, float(mimic.get("multiplier", 1.0)), float(mimic.get("offset", 0.0)))
    return found


def _resolve_meshes(urdf: Urdf, folders: MeshFolders) -> None:
    """Write absolute paths into the tree; drop what is missing and remember it."""
    for link in urdf.root.findall("link"):
        for shape in [*link.findall("visual"), *link.findall("collision")]:
            mesh = shape.find("geometry/mesh")
            if mesh is None:
                if shape.find("geometry/*") is None:
                    link.remove(shape)  # an empty geometry shows nothing
                continue
            filename = mesh.get("filename", "")
            path = folders.find(filename) if filename else None
            if path is None:
                urdf.missing.append(filename)
                link.remove(shape)
            else:
                mesh.set("filename", f"file://{path}")
