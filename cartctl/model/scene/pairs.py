"""Which parts can meet at all: with a scene, and among a robot's own links.

Left out are pairs on one joint or on a joint and the next, what an SRDF disables, and pairs that no motion of the
robot can part or that touch at home, by less than a centimetre: neighbours whose shapes reach into each other.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any
from weakref import WeakKeyDictionary
from xml.etree.ElementTree import ParseError

import numpy as np
from defusedxml import DefusedXmlException
from defusedxml import ElementTree as SafeTree

from cartctl.errors import ParameterError, UrdfError
from cartctl.model.robot import Robot
from cartctl.model.scene.arrangement import Arrangement
from cartctl.model.scene.bodies import Part, obstacle_parts, point_parts, robot_parts
from cartctl.model.scene.scene import Scene

_SAMPLES = 200  # postures in which a pair that always touches does
_TOUCH = 0.01  # m: nearer than this counts as touching
_known: WeakKeyDictionary[Robot, dict[tuple[str, str], str]] = WeakKeyDictionary()


def with_scene(robot: Robot, scene: Scene, points: Any = None) -> Arrangement:
    """The links of a robot, or balls about the frames in ``points``, against all obstacles.

    What is attached to a frame counts as a part of the robot against everything else, and against the links it neither
    hangs beside nor touches at home. Raises FrameNotFound, ParameterError.
    """
    own = list(robot_parts(robot) if points is None else point_parts(robot, points))
    things = list(obstacle_parts(robot, scene.obstacles))
    parts = own + things
    pairs = []
    for j in range(len(own), len(parts)):
        thing = parts[j]
        others = [*range(len(own)), *(k for k in range(len(own), len(parts)) if parts[k].joint and not thing.joint)]
        pairs += [(i, j) for i in others if _can_meet(robot, parts[i], thing)]
    carried = [(i, j) for i, j in pairs if parts[j].joint]
    if carried:
        touching = _touching_at_home(robot, parts, carried)
        pairs = [pair for pair in pairs if pair not in touching]
    return Arrangement(robot, parts, pairs)


def with_itself(robot: Robot, srdf: Any = None) -> Arrangement:
    """The links of a robot against each other. srdf: a file whose disabled pairs are left out, too.

    Raises UrdfError.
    """
    parts = robot_parts(robot)
    left_out = excluded(robot) if srdf is None else excluded(robot) | disabled_by(srdf)
    pairs = [
        (i, j)
        for i in range(len(parts))
        for j in range(i)
        if parts[i].name != parts[j].name and _key(parts[i].name, parts[j].name) not in left_out
    ]
    return Arrangement(robot, parts, [(i, j) if parts[i].joint else (j, i) for i, j in pairs])


def excluded(robot: Robot) -> dict[tuple[str, str], str]:
    """Pairs of links that are not watched, each with the reason: "adjacent", "always" or "home"."""
    if robot not in _known:
        parts = robot_parts(robot)
        found: dict[tuple[str, str], str] = {}
        pairs = []
        for i in range(len(parts)):
            for j in range(i):
                if not _apart(robot, parts[i].joint, parts[j].joint):
                    found[_key(parts[i].name, parts[j].name)] = "adjacent"
                elif parts[i].name != parts[j].name:
                    pairs.append((i, j))
        pairs = [(i, j) for i, j in pairs if _key(parts[i].name, parts[j].name) not in found]
        for i, j in _touching_at_home(robot, parts, pairs):
            found[_key(parts[i].name, parts[j].name)] = "home"
        _known[robot] = found | _never_parted(robot, parts, pairs)
    return dict(_known[robot])


def disabled_by(srdf: Any) -> dict[tuple[str, str], str]:
    """The pairs of links an SRDF disables; raises UrdfError."""
    if not isinstance(srdf, (str, os.PathLike)):
        raise ParameterError(f"srdf is a {type(srdf).__name__}; expected the path of an .srdf file")
    try:
        root = SafeTree.fromstring(Path(srdf).read_bytes(), forbid_entities=True, forbid_external=True)
    except (OSError, ValueError, ParseError, DefusedXmlException) as error:
        raise UrdfError(f"{os.fspath(srdf)!r} cannot be read: {error}; expected an .srdf file") from None
    found = [(e.get("link1"), e.get("link2")) for e in root.iter("disable_collisions")]
    return {_key(a, b): "srdf" for a, b in found if a and b}


def _key(a: str, b: str) -> tuple[str, str]:
    return (a, b) if a < b else (b, a)


def _can_meet(robot: Robot, part: Part, thing: Part) -> bool:
    """Whether the robot can change a distance, and nobody said that it does not matter."""
    assert thing.obstacle is not None
    patterns = thing.obstacle.ignore + (part.obstacle.ignore if part.obstacle else ())
    if any(fnmatchcase(part.name, p) or (part.obstacle and fnmatchcase(thing.name, p)) for p in patterns):
        return False
    return _apart(robot, part.joint, thing.joint) if thing.joint else part.joint > 0


def _apart(robot: Robot, a: int, b: int) -> bool:
    """Whether there is more than one joint between two."""
    parents = robot.model.parents
    return a != b and (not a or int(parents[a]) != b) and (not b or int(parents[b]) != a)


def _touching_at_home(robot: Robot, parts: Sequence[Part], pairs: list[tuple[int, int]]) -> set[tuple[int, int]]:
    found = Arrangement(robot, parts, pairs).within(robot.state(robot.home), _TOUCH)
    return {pairs[k] for k in found.pairs.tolist()}


def _never_parted(robot: Robot, parts: Sequence[Part], pairs: list[tuple[int, int]]) -> dict[tuple[str, str], str]:
    """Pairs that touch in every one of many random postures."""
    arrangement, rng = Arrangement(robot, parts, pairs), np.random.default_rng(0)
    left = set(range(len(pairs)))
    for _ in range(_SAMPLES):
        if not left:
            break
        left &= set(arrangement.within(robot.state(robot.random_configuration(rng)), _TOUCH).pairs.tolist())
    return {_key(parts[pairs[k][0]].name, parts[pairs[k][1]].name): "always" for k in left}
