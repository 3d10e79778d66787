"""Sets of scenarios: those shipped with the package, and files of one's own."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from importlib.resources import files
from pathlib import Path
from typing import Any

from cartctl.bench.building import Stage
from cartctl.bench.fields import Fields, Keys, text, under
from cartctl.bench.scenario import Scenario
from cartctl.bench.toml import line_of, lines, parse
from cartctl.errors import LookupFailure, ScenarioError

SHIPPED = ("lectures", "arms", "singular", "limits", "obstacles", "dual-arm-humanoid", "torque")


class ScenarioNotFound(LookupFailure):
    """No scenario, set or file of that name."""

    kind = "scenario or set"


@dataclass(frozen=True)
class ScenarioSet:
    """Scenarios of one file. source: what to call it in messages."""

    name: str
    title: str
    scenarios: tuple[Scenario, ...]
    source: str
    content: str

    def check(self) -> None:
        """Build every scenario once; raises ScenarioError with file, line and key."""
        for i, scenario in enumerate(self.scenarios):
            try:
                Stage(scenario)
            except ScenarioError as error:
                raise _placed(error, self.source, self.content, ("scenario", i)) from None


def shipped(name: str) -> ScenarioSet:
    """A set of the package; raises ScenarioNotFound."""
    if name not in SHIPPED:
        raise ScenarioNotFound(name, SHIPPED)
    place = files("cartctl.bench") / "data" / f"{name}.toml"
    return _read(name, f"{name}.toml", place.read_text(encoding="utf-8"))


def load_set(path: Path) -> ScenarioSet:
    """A set of one's own; raises ScenarioError with file, line and key."""
    try:
        content = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        why = getattr(error, "strerror", None) or "it is not UTF-8"
        raise ScenarioError(f"{path} cannot be read: {why}; expected a .toml file of scenarios") from None
    return _read(path.stem, str(path), content)


def select(names: Iterable[str]) -> list[ScenarioSet]:
    """Sets cut down to what is named: sets, scenarios, patterns such as ``*-circle``, .toml files, ``all``.

    Each scenario comes once. Raises ScenarioNotFound with the closest names, ScenarioError.
    """
    wanted = list(dict.fromkeys(names))
    own = [load_set(Path(name)) for name in wanted if name.endswith(".toml")]
    known = [*(shipped(name) for name in SHIPPED), *own]
    for name in wanted:
        if not name.endswith(".toml") and not any(_chosen(group, [name]) for group in known):
            raise ScenarioNotFound(name, ["all", *SHIPPED, *(s.name for g in known for s in g.scenarios)])
    return _unique([_cut(group, _chosen(group, wanted)) for group in known])


def _chosen(group: ScenarioSet, wanted: Sequence[str]) -> list[Scenario]:
    whole = {group.name, group.source if group.source.endswith(".toml") else "", "all"}
    if any(name in whole and (name != "all" or group.name in SHIPPED) for name in wanted):
        return list(group.scenarios)
    return [s for s in group.scenarios if any(fnmatchcase(s.name, pattern) for pattern in wanted)]


def _cut(group: ScenarioSet, kept: Sequence[Scenario]) -> ScenarioSet:
    return ScenarioSet(group.name, group.title, tuple(kept), group.source, group.content)


def _unique(groups: Sequence[ScenarioSet]) -> list[ScenarioSet]:
    """Those that hold anything; two different scenarios of one name are refused."""
    seen: dict[str, str] = {}
    for group in groups:
        for scenario in group.scenarios:
            if scenario.name in seen:
                raise ScenarioError(
                    f"name {scenario.name!r} is there in {seen[scenario.name]} and in {group.source}; rename one"
                )
            seen[scenario.name] = group.source
    return [group for group in groups if group.scenarios]


def _read(name: str, source: str, content: str) -> ScenarioSet:
    table = parse(content, source)
    try:
        return _checked(name, source, content, table)
    except ScenarioError as error:
        raise _placed(error, source, content) from None


def _checked(name: str, source: str, content: str, table: dict[str, Any]) -> ScenarioSet:
    given = Fields(table)
    head = Fields(given.take("set", lambda _, value: value, {}))
    with under("set"):
        title = head.take("title", text, name)
        head.end()
    defaults = given.take("defaults", lambda _, value: value, {})
    entries = given.take("scenario", lambda _, value: value)
    given.end()
    Fields(defaults)
    if not isinstance(entries, list) or not entries:
        raise ScenarioError("expected at least one [[scenario]]", ("scenario",))
    made: list[Scenario] = []
    for i, entry in enumerate(entries):
        with under("scenario", i):
            Fields(entry)
            scenario = Scenario.from_dict({**defaults, **entry})
            if any(scenario.name == other.name for other in made):
                raise ScenarioError(f"name {scenario.name!r} is there twice; expected one of each", ("name",))
            made.append(scenario)
    return ScenarioSet(name, title, tuple(made), source, content)


def _placed(error: ScenarioError, source: str, content: str, before: Keys = ()) -> ScenarioError:
    """The same with file and line; what the scenario has from the defaults is blamed on them."""
    if error.place:
        return error
    keys, places = (*before, *error.keys), lines(content)
    own, shared = keys, ("defaults", *keys[2:])
    if len(keys) > 2 and keys[:1] == ("scenario",) and keys[:3] not in places and shared[:2] in places:
        own = shared
    return ScenarioError(error.reason, keys, f"{source}, line {line_of(places, own)}")
