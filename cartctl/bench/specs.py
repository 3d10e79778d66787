"""The tables inside a scenario, as plain data: each function checks one kind and fills in its defaults.

task       kind = "frame" (default), "relative", "com", "posture" or "joint"; target: see below; gain 1/s; axes, frame,
           reference_frame, length, weight, fit, name, as the classes of :mod:`cartctl.tasks` have them
target     kind = "hold", or relative to where the frame is when the run begins, in world axes:
           "circle" radius, period, laps, normal, towards; "line" offset, period, laps (there and back);
           "polygon" offsets, period, laps, blend; "via" offsets, period (rests at each); "step" offset (a constant);
           "turn" axis, angle, period (and back); "path" offsets, period (a smooth curve through all)
           or absolute: "point" position
start      "home", or posture = {joint = value}, random = spread (rad or m about it, inside the limits)
obstacle   shape = "sphere", "box", "capsule", "cylinder" or "plane"; name; at; radius, size, length, normal, offset;
           to, period: it moves there, once; frame; ignore
constraint kind = "half-space" normal, offset; "box" lower, upper; "speed" linear, angular; frame
limits     "robot", "none", or velocity, acceleration, torque (the same for all joints) and *_share of the robot's own
plant      masses (a factor), noise (N m), payload (kg, at the tool): only where torques drive the robot
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from cartctl import checks
from cartctl.bench import fields as f
from cartctl.bench.fields import Fields, under
from cartctl.errors import ScenarioError

Table = dict[str, Any]
_TASKS = ("frame", "relative", "com", "posture", "joint")
_SHAPES = ("sphere", "box", "capsule", "cylinder", "plane")
_TARGETS: dict[str, dict[str, tuple[Any, Any]]] = {
    "hold": {},
    "circle": {
        "radius": (f.positive, ...),
        "period": (f.positive, 4.0),
        "laps": (f.whole, 1),
        "normal": (f.point, [0.0, 0.0, 1.0]),
        "towards": (f.point, None),
    },
    "line": {"offset": (f.point, ...), "period": (f.positive, 4.0), "laps": (f.whole, 1)},
    "polygon": {
        "offsets": (f.points, ...),
        "period": (f.positive, 4.0),
        "laps": (f.whole, 1),
        "blend": (f.not_negative, 0.0),
    },
    "via": {"offsets": (f.points, ...), "period": (f.positive, 4.0)},
    "path": {"offsets": (f.points, ...), "period": (f.positive, 4.0)},
    "step": {"offset": (f.point, ...)},
    "turn": {"axis": (f.point, ...), "angle": (f.positive, ...), "period": (f.positive, 4.0)},
    "point": {"position": (f.point, ...)},
}


def task_spec(value: Any) -> Table:
    """One task."""
    given = Fields(value)
    kind = given.take("kind", f.one_of(*_TASKS), "frame")
    made: Table = {"kind": kind}
    made["gain"] = given.take("gain", f.not_negative, 1.0 if kind == "posture" else 20.0)
    made["weight"] = given.take("weight", f.not_negative, 1.0)
    made["fit"] = given.take(
        "fit", f.one_of("scale", "least_squares"), "least_squares" if kind == "posture" else "scale"
    )
    made["name"] = given.take("name", f.text, None)
    if kind in ("frame", "relative", "com"):
        made["axes"] = given.take("axes", f.text, "position" if kind == "com" else "pose")
    if kind in ("frame", "relative"):
        made["frame"] = given.take("frame", f.text, None)
        made["length"] = given.take("length", f.positive, 1.0)
    if kind == "relative":
        made["reference_frame"] = given.take("reference_frame", f.text)
    if kind in ("posture", "joint"):
        made["posture"] = given.take("posture", _posture, None)
    else:
        made["target"] = given.take("target", lambda _, each: target_spec(each), {"kind": "hold"})
    given.end()
    if kind == "relative" and made["target"]["kind"] != "hold":
        raise ScenarioError("a relative task holds its frames as they are; expected kind 'hold'", ("target", "kind"))
    return made


def target_spec(value: Any) -> Table:
    """Where a task is to go."""
    given = Fields(value)
    kind = given.take("kind", f.one_of(*_TARGETS))
    made: Table = {"kind": kind}
    for key, (check, default) in _TARGETS[kind].items():
        made[key] = given.take(key, check) if default is ... else given.take(key, check, default)
    given.end()
    return made


def start_spec(name: str, value: Any) -> str | Table:
    """Where the robot begins."""
    if isinstance(value, str):
        return f.one_of("home")(name, value)
    given = Fields(value)
    made: Table = {
        "posture": given.take("posture", _posture, {}),
        "random": given.take("random", f.not_negative, 0.0),
    }
    given.end()
    return made


def limits_spec(name: str, value: Any) -> str | Table:
    """What the joints may do."""
    if isinstance(value, str):
        return f.one_of("robot", "none")(name, value)
    given = Fields(value)
    made: Table = {}
    for quantity in ("velocity", "acceleration", "jerk", "torque"):
        for key in (quantity, f"{quantity}_share"):
            made[key] = given.take(key, f.bound, None)
        if made[quantity] is not None and made[f"{quantity}_share"] is not None:
            raise ScenarioError(f"{quantity} and {quantity}_share are both given; expected one of them", (quantity,))
    given.end()
    return made


def obstacle_spec(value: Any) -> Table:
    """Something in the way."""
    given = Fields(value)
    shape = given.take("shape", f.one_of(*_SHAPES))
    made: Table = {"shape": shape, "name": given.take("name", f.text)}
    made["ignore"] = list(given.take("ignore", _patterns, ()))
    if shape == "plane":
        made["normal"] = given.take("normal", f.point)
        made["offset"] = given.take("offset", checks.number, 0.0)
    else:
        made["at"] = given.take("at", f.point)
        made["frame"] = given.take("frame", f.text, None)
        made["to"] = given.take("to", f.point, None)
        made["period"] = given.take("period", f.positive, 2.0)
    if shape in ("sphere", "capsule", "cylinder"):
        made["radius"] = given.take("radius", f.positive)
    if shape in ("capsule", "cylinder"):
        made["length"] = given.take("length", f.positive)
    if shape == "box":
        made["size"] = given.take("size", f.point)
    given.end()
    return made


def constraint_spec(value: Any) -> Table:
    """What a frame must not do."""
    given = Fields(value)
    kind = given.take("kind", f.one_of("half-space", "box", "speed"))
    made: Table = {"kind": kind, "frame": given.take("frame", f.text, None)}
    if kind == "half-space":
        made["normal"] = given.take("normal", f.point)
        made["offset"] = given.take("offset", checks.number)
    elif kind == "box":
        made["lower"] = given.take("lower", _corner)
        made["upper"] = given.take("upper", _corner)
    else:
        made["linear"] = given.take("linear", f.positive, None)
        made["angular"] = given.take("angular", f.positive, None)
    given.end()
    return made


def plant_spec(value: Any) -> Table:
    """How the robot that is there differs from the model; empty where it does not."""
    given = Fields(value)
    made = {key: given.take(key, check) for key, check in _PLANT.items() if key in given}
    for key in _PLANT:
        given.take(key, lambda _, each: each, None)
    given.end()
    return made


_PLANT = {"masses": f.positive, "noise": f.not_negative, "payload": f.not_negative}


def _patterns(name: str, value: Any) -> tuple[str, ...]:
    """Names of links, none to begin with."""
    return f.words(name, value) if value else ()


def _posture(name: str, value: Any) -> Table:
    """Joint name -> rad or m."""
    if not isinstance(value, Mapping):
        raise ScenarioError(f"{name} is {value!r:.60}; expected a table of joint names and values")
    made = {}
    for joint, angle in value.items():
        with under(str(joint)):
            made[str(joint)] = checks.number(str(joint), angle)
    return made


def _corner(name: str, value: Any) -> list[float]:
    return [float(x) for x in checks.vector(name, value, 3, infinite=True)]
