"""Scenarios: files and objects, what is refused and where, the shipped sets, random starts."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import cartctl as cc
from cartctl.bench import sets
from cartctl.bench.building import Stage
from cartctl.bench.toml import line_of, lines, parse
from cartctl.errors import ScenarioError
from tests.bench_scenarios import short, toml

FILE = """# a comment with [brackets] and key = "value"
[set]
title = "mine"

[defaults]
dt = 0.01
robot = "planar3R"

[[scenario]]
name = "first"
duration = 1.0
tasks = [
  { axes = "xy", target = { kind = "circle", radius = 0.2 } },
  { kind = "posture", gain = 2.0 },
]

[[scenario]]
name = "second"
duration = 1.0
limits = { velocity = 1.0 }
[[scenario.tasks]]
axes = "xy"
[scenario.tasks.target]
kind = "line"
offset = [0.1, 0.0, 0.0]
"""


def refused(tmp_path: Path, content: str) -> ScenarioError:
    path = tmp_path / "mine.toml"
    path.write_text(content)
    with pytest.raises(ScenarioError) as caught:
        for group in sets.select([str(path)]):
            group.check()
    assert "\n" not in str(caught.value)
    return caught.value


def test_a_file_is_read_with_its_defaults(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(FILE)
    group = sets.load_set(path)
    group.check()
    first, second = group.scenarios
    assert group.title == "mine" and first.dt == second.dt == 0.01
    assert first.tasks[0]["target"]["radius"] == 0.2 and first.tasks[1]["kind"] == "posture"
    assert second.tasks[0]["target"]["offset"] == [0.1, 0.0, 0.0] and second.limits["velocity"] == 1.0


@pytest.mark.parametrize(
    ("old", "new", "line", "words"),
    [
        ("dt = 0.01", "dt = -0.01", 6, "dt is -0.01; expected a number above 0"),
        ('robot = "planar3R"', 'robot = "planar3Q"', 7, "did you mean 'planar3R'"),
        ("radius = 0.2", "radius = 0.0", 13, "scenario[0].tasks[0].target.radius"),
        ("radius = 0.2", "radios = 0.2", 13, "radius is missing; is it 'radios'?"),
        ('kind = "circle"', 'kind = "circel"', 13, "did you mean 'circle'?"),
        ('{ kind = "posture", gain = 2.0 }', '{ kind = "posture", gian = 2.0 }', 14, "did you mean 'gain'?"),
        ('kind = "posture", gain', 'kind = "posture", posture = { elbow = 1 }, gain', 14, "unknown joint 'elbow'"),
        ("velocity = 1.0", "velocity = nan", 20, "velocity is nan; expected a finite number"),
        ("velocity = 1.0", "velocity_ = 1.0", 20, "did you mean 'velocity'?"),
        ("offset = [0.1, 0.0, 0.0]", "offset = [0.1, 0.0]", 25, "offset has shape (2,); expected (3,)"),
        ("offset = [0.1, 0.0, 0.0]", "offset = [0.0, 0.0, 0.0]", 23, "scenario[1].tasks[0].target"),
        ('name = "second"', 'name = "first"', 18, "is there twice"),
        (
            'name = "second"\nduration = 1.0',
            'name = "second"\nduraton = 1.0',
            17,
            "duration is missing; is it 'duraton'?",
        ),
        ('name = "second"', 'name = "second"\nlevles = ["velocity"]', 19, "did you mean 'levels'?"),
        ('name = "second"', 'name = "second"\nlevels = ["torqe"]', 19, "did you mean 'torque'?"),
        ('[set]\ntitle = "mine"', '[sett]\ntitle = "mine"', 2, "did you mean 'set'?"),
        ('axes = "xy"\n[scen', 'axes = "xq"\n[scen', 22, "scenario[1].tasks[0].axes"),
        ('axes = "xy"\n[scen', 'axes = "xy"\nframe = "tol"\n[scen', 23, "unknown frame 'tol'; did you mean 'tool'?"),
        ("duration = 1.0\nlimits", "duration = 1e9\nlimits", 19, "expected at most 1000000"),
        ('title = "mine"', 'title = "mine', 3, "expected TOML"),
    ],
)
def test_what_is_wrong_is_named_by_line_and_key(tmp_path: Path, old: str, new: str, line: int, words: str) -> None:
    assert old in FILE
    error = refused(tmp_path, FILE.replace(old, new))
    assert f"mine.toml, line {line}: " in str(error) and words in str(error), str(error)


def test_files_that_are_none_are_refused(tmp_path: Path) -> None:
    assert "at least one [[scenario]]" in str(refused(tmp_path, "scenario = []\n"))
    assert "scenario is missing; expected it here" in str(refused(tmp_path, ""))
    with pytest.raises(ScenarioError, match=r"nowhere\.toml cannot be read: No such file"):
        sets.select([str(tmp_path / "nowhere.toml")])


KEYS = st.text("abcdefgh", min_size=1, max_size=3)
VALUES = st.recursive(
    st.one_of(st.integers(-9, 9), st.booleans(), st.sampled_from(["x", "a = [1]", "#no", "} ]", ""])),
    lambda inner: st.one_of(st.lists(inner, max_size=3), st.dictionaries(KEYS, inner, max_size=3)),
    max_leaves=6,
)


def written(value: object) -> str:
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {written(inner)}" for key, inner in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ",\n  ".join(map(written, value)) + "]"
    return json.dumps(value)


@given(st.lists(st.dictionaries(KEYS, VALUES, min_size=1, max_size=4), min_size=1, max_size=4), st.integers(0, 3))
def test_the_line_of_every_key_is_where_it_stands(tables: list[dict[str, object]], blanks: int) -> None:
    """Documents are written key by key, so that each line is known; nested keys stand in that line or below."""
    text, expected = "# [[t]]\n" * blanks, {}
    for k, table in enumerate(tables):
        expected["t", k] = text.count("\n") + 1
        text += "[[t]]  # a = 1\n"
        for key, value in table.items():
            expected["t", k, key] = text.count("\n") + 1
            text += f"{key} = {written(value)} # b = {{\n"
    assert parse(text, "here") == {"t": tables}
    found = lines(text)
    assert {keys: found[keys] for keys in expected} == expected

    def nested(value: object, keys: tuple[str | int, ...]) -> None:
        pairs = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
        for key, inner in pairs:
            assert found[(*keys, key)] >= found[keys]
            nested(inner, (*keys, key))

    for k, table in enumerate(tables):
        for key, value in table.items():
            nested(value, ("t", k, key))
    assert line_of(found, ("t", 0, "no such key")) == expected["t", 0]


@pytest.mark.parametrize("name", sets.SHIPPED)
def test_shipped_sets_can_be_built(name: str) -> None:
    group = sets.shipped(name)
    group.check()
    assert len({s.digest for s in group.scenarios}) == len(group.scenarios) >= 3


def test_shipped_sets_hold_what_they_promise() -> None:
    groups = {name: sets.shipped(name).scenarios for name in sets.SHIPPED}
    robots = {name: {s.robot for s in some} for name, some in groups.items()}
    assert robots["lectures"] == {"planar2R", "planar3R", "planar4R", "ppr"}
    assert robots["arms"] == {"panda", "lwr", "iiwa14", "xarm7", "kinova"}
    assert robots["dual-arm-humanoid"] == {"baxter", "pr2", "talos", "g1"}
    for arm in robots["arms"]:
        mine = {s.name.removeprefix(f"{arm}-") for s in groups["arms"] if s.robot == arm}
        assert {"circle", "line", "hexagon", "cyclic", "turn"} <= mine
    assert all(s.levels == ("torque",) for s in groups["torque"])
    assert any("through" in s.name for s in groups["singular"])
    assert {"elbow-through", "shoulder-through", "wrist-through", "unreachable-pose"} <= {
        s.name for s in groups["singular"]
    }


def test_starts_at_limits_and_outside_are_there() -> None:
    above = {}
    for scenario in sets.shipped("limits").scenarios:
        stage = Stage(scenario)
        at, limits = stage.robot.coordinates(stage.start), stage.robot.limits
        above[scenario.name] = float(np.maximum(at - limits.position_upper, limits.position_lower - at).max())
    assert above["outside-above"] == pytest.approx(0.05, abs=1e-9)
    assert above["outside-below"] == pytest.approx(0.05, abs=1e-9)
    assert abs(above["at-a-limit"]) < 1e-3 and above["fast-circle"] < 0.0


@pytest.mark.parametrize("name", ["elbow-through", "shoulder-through", "wrist-through"])
def test_singularities_lie_on_the_way(name: str) -> None:
    (group,) = sets.select([name])
    stage = Stage(group.scenarios[0])
    run = cc.simulate(stage.controller(cc.DLS(damping=0.03), "velocity"), stage.start, group.scenarios[0].duration)
    sigma = run.tasks[0].singular_values[:, -1]
    assert sigma[0] > 0.05 and sigma.min() < 0.01


def test_an_object_and_its_dictionary_are_the_same() -> None:
    for name in sets.SHIPPED:
        for scenario in sets.shipped(name).scenarios:
            again = cc.Scenario.from_dict(json.loads(json.dumps(scenario.to_dict())))
            assert again == scenario and again.digest == scenario.digest


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"duration": 0.0}, "duration is 0"),
        ({"tasks": []}, "expected a list of at least one table"),
        ({"tasks": [{"kind": "frmae"}]}, "tasks[0].kind"),
        ({"start": "hom"}, "did you mean 'home'?"),
        ({"start": {"random": -1.0}}, "start.random"),
        ({"limits": {"velocity": 1.0, "velocity_share": 0.5}}, "are both given"),
        ({"objective": "jont-range"}, "did you mean 'joint-range'?"),
        ({"settle": 0.2}, "settle is 0.2 s"),
        ({"scene": [{"shape": "sphere", "name": "b", "at": [0, 0, 0]}]}, "scene[0]: radius is missing"),
        ({"plant": {"mass": 2.0}}, "did you mean 'masses'?"),
    ],
)
def test_objects_are_checked_as_files_are(changes: dict[str, object], words: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        short(**changes)
    assert words in str(caught.value)


def test_the_digest_changes_with_what_counts() -> None:
    one = short()
    assert one.digest == short(summary="words").digest
    assert len({one.digest, short(dt=0.02).digest, short(start={"random": 0.1}).digest, short("other").digest}) == 4


def test_random_starts_are_seeded_and_inside() -> None:
    scenario = short(robot="panda", start={"random": 3.0}, limits="robot", tasks=[{"axes": "position"}])
    starts = [Stage(scenario, seed, repeat).start for seed in (0, 1) for repeat in (0, 1)]
    assert np.array_equal(starts[0], Stage(scenario, 0, 0).start)
    assert len({tuple(q) for q in starts}) == 4
    limits = Stage(scenario).robot.limits
    for q in starts:
        assert (q > limits.position_lower).all() and (q < limits.position_upper).all()
    assert np.array_equal(Stage(short(start={"random": 0.0})).start, cc.load("planar3R").home)


def test_limits_are_what_the_scenario_says() -> None:
    own = cc.load("panda").limits
    shared = Stage(short(robot="panda", limits={"velocity_share": 0.5, "acceleration": 3.0}, tasks=[{}]))
    assert np.allclose(shared.limits.velocity_upper, 0.5 * own.velocity_upper)
    assert np.allclose(shared.judged.limits.acceleration_lower, -3.0)
    assert np.isinf(Stage(short(robot="panda", tasks=[{}])).judged.limits.velocity_upper).all()
    assert np.array_equal(cc.load("panda").limits.velocity_upper, own.velocity_upper)


@pytest.mark.parametrize("kind", ["circle", "line", "polygon", "via", "path", "turn", "hold", "step"])
def test_paths_begin_where_the_hand_is(kind: str) -> None:
    more = {
        "circle": {"radius": 0.1},
        "line": {"offset": [0.1, 0.0, 0.1]},
        "polygon": {"offsets": [[0.1, 0.0, 0.0], [0.1, 0.1, 0.0]]},
        "via": {"offsets": [[0.1, 0.0, 0.0], [0.1, 0.1, 0.0]]},
        "path": {"offsets": [[0.1, 0.0, 0.0], [0.1, 0.1, 0.0]]},
        "turn": {"axis": [1.0, 0.0, 0.0], "angle": 0.5},
        "step": {"offset": [0.1, 0.0, 0.2]},
    }.get(kind, {})
    stage = Stage(short(robot="panda", tasks=[{"target": {"kind": kind, **more}}]))
    state = stage.robot.state(stage.start)
    task = stage.tasks[0]
    error = task.reference(state, 0.0, task.anchor(state)).error
    assert np.linalg.norm(error) == pytest.approx(np.sqrt(0.05) if kind == "step" else 0.0, abs=1e-9)


def test_names_patterns_and_files_choose(tmp_path: Path) -> None:
    path = toml(tmp_path / "mine.toml", 2)
    names = [s.name for g in sets.select(["panda-*", "3R-line", str(path)]) for s in g.scenarios]
    assert {"panda-circle", "3R-line", "c0", "c1"} <= set(names) and "lwr-circle" not in names
    with pytest.raises(sets.ScenarioNotFound, match="did you mean 'lectures'"):
        sets.select(["lecturs"])
    other = toml(tmp_path / "other.toml", 1)
    with pytest.raises(ScenarioError, match="'c0' is there in"):
        sets.select([str(path), str(other)])
