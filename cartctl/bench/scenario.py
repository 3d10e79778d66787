"""A scenario: a robot, what it shall do, from where, under which limits, for how long. Plain data, checked once."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
from typing import Any

from cartctl.bench import fields as f
from cartctl.bench.fields import Fields, under
from cartctl.bench.specs import constraint_spec, limits_spec, obstacle_spec, plant_spec, start_spec, task_spec
from cartctl.errors import ScenarioError
from cartctl.levels import levels as known_levels
from cartctl.objectives.named import KNOWN

LARGEST_STEPS = 1_000_000


@dataclass(frozen=True)
class Scenario:
    """What every method of a bench is put to. Plain data, as in the TOML file of the same keys.

    name: unique among those of one bench. robot: a name from ``cc.robots()``, or the path of a .urdf. tasks: highest
    priority first, each a table such as ``{"target": {"kind": "circle", "radius": 0.1, "period": 4.0}}``
    (:mod:`cartctl.bench.specs` lists the keys). duration, dt: s. levels: at which it is run. start: ``"home"``, or
    ``{"posture": {joint: value}}`` and ``{"random": spread}``, rad or m about it. limits: ``"robot"``, ``"none"``, or
    a table such as ``{"velocity": 1.5}`` or ``{"velocity_share": 0.5}``. scene: obstacles; margin: m that robots keep
    from them. constraints: half-spaces, boxes, speeds. objective, objective_gain, metric: of the null space, for
    methods that have one. plant: what differs from the model where torques drive it. root_joint, package_dirs: as in
    ``cc.load``. settle: s before which errors and violations do not count, for starts off the path or outside limits.
    tolerance, tolerance_rad: RMS error, m and rad, up to which the first task counts as solved.

    Raises ScenarioError, which names the key.
    """

    name: str
    robot: str
    tasks: Sequence[Mapping[str, Any]]
    duration: float
    dt: float = 5e-3
    summary: str = ""
    levels: Sequence[str] = ("velocity",)
    start: str | Mapping[str, Any] = "home"
    limits: str | Mapping[str, Any] = "robot"
    scene: Sequence[Mapping[str, Any]] = ()
    margin: float = 0.01
    constraints: Sequence[Mapping[str, Any]] = ()
    objective: str = "none"
    objective_gain: float | None = None
    metric: str = "none"
    plant: Mapping[str, Any] = field(default_factory=dict)
    root_joint: str = "fixed"
    package_dirs: Sequence[str] = ()
    settle: float = 0.0
    tolerance: float = 5e-3
    tolerance_rad: float = 0.05

    def __post_init__(self) -> None:
        for name, check in _CHECKS.items():
            with under(name):
                object.__setattr__(self, name, check(name, getattr(self, name)))
        if self.duration / self.dt > LARGEST_STEPS:
            steps = self.duration / self.dt
            raise ScenarioError(
                f"duration {self.duration:g} s in steps of {self.dt:g} s is {steps:.3g} steps; expected at most "
                f"{LARGEST_STEPS}",
                ("duration",),
            )
        if self.settle >= self.duration:
            raise ScenarioError(f"settle is {self.settle:g} s; expected less than the duration", ("settle",))

    @classmethod
    def from_dict(cls, table: Mapping[str, Any]) -> Scenario:
        """A scenario of the keys of a file; raises ScenarioError for unknown and missing ones."""
        given = Fields(table)
        needed = {"name", "robot", "tasks", "duration"}
        values = {name: given.take(name, lambda _, value: value) for name in _CHECKS if name in needed or name in given}
        for name in _CHECKS:  # so that a misspelt key finds its neighbour
            given.take(name, lambda _, value: value, None)
        given.end()
        return cls(**values)

    def to_dict(self) -> dict[str, Any]:
        """The keys that are not at their defaults, as a file would have them."""
        given = json.loads(json.dumps(asdict(self)))
        defaults: dict[str, Any] = {
            each.name: [] if each.name in _LISTS else {} if each.name == "plant" else each.default
            for each in fields(self)
        } | {"levels": ["velocity"]}
        return {name: value for name, value in given.items() if value != defaults[name]}

    @property
    def digest(self) -> str:
        """Twelve letters that change with whatever counts, which the summary does not."""
        counted = {name: value for name, value in asdict(self).items() if name not in ("summary", "levels")}
        return hashlib.sha256(json.dumps(counted, sort_keys=True).encode()).hexdigest()[:12]


_LISTS = ("scene", "constraints", "package_dirs")


def _tables(check: Any, least: int = 0) -> Any:
    def checked(name: str, value: Any) -> tuple[dict[str, Any], ...]:
        if isinstance(value, (str, Mapping)) or not isinstance(value, Sequence) or len(value) < least:
            raise ScenarioError(
                f"{name} is {value!r:.60}; expected a list of {'at least one table' if least else 'tables'}"
            )
        made = []
        for i, each in enumerate(value):
            with under(i):
                made.append(check(each))
        return tuple(made)

    return checked


def _level_names(name: str, value: Any) -> tuple[str, ...]:
    return tuple(f.one_of(*known_levels())(name, each) for each in f.words(name, value))


def _objective_gain(name: str, value: Any) -> float | None:
    return None if value is None else f.positive(name, value)


def _any_text(name: str, value: Any) -> str:
    if not isinstance(value, str):
        raise ScenarioError(f"{name} is {value!r}; expected text")
    return value


def _folders(name: str, value: Any) -> tuple[str, ...]:
    return f.words(name, value) if value else ()


_CHECKS: dict[str, Any] = {
    "name": f.text,
    "summary": _any_text,
    "robot": f.text,
    "tasks": _tables(task_spec, least=1),
    "duration": f.positive,
    "dt": f.positive,
    "levels": _level_names,
    "start": start_spec,
    "limits": limits_spec,
    "scene": _tables(obstacle_spec),
    "margin": f.not_negative,
    "constraints": _tables(constraint_spec),
    "objective": f.one_of("none", *KNOWN),
    "objective_gain": _objective_gain,
    "metric": f.one_of("none", "identity", "inertia", "joint-limits", "inverse-inertia", "inverse-inertia-squared"),
    "plant": lambda _, value: plant_spec(value),
    "root_joint": f.one_of("fixed", "planar", "free_flyer"),
    "package_dirs": _folders,
    "settle": f.not_negative,
    "tolerance": f.bound,
    "tolerance_rad": f.bound,
}
