"""The figures of a run against signals and motions whose figures are known."""

from __future__ import annotations

import json

import numpy as np
import pytest

import cartctl as cc
from cartctl.bench import figures
from cartctl.bench.building import Stage
from cartctl.bench.jobs import Job
from cartctl.bench.methods import methods
from cartctl.bench.perform import perform
from cartctl.bench.schema import COLUMNS, FIGURES
from tests.bench_scenarios import short

DT = 0.005


def wave(hertz: float, seconds: float = 8.0, amplitude: float = 0.7) -> np.ndarray:
    t = np.arange(0.0, seconds, DT)
    return amplitude * np.column_stack([np.sin(2 * np.pi * hertz * t), np.cos(2 * np.pi * hertz * t)])


def row_of(scenario: cc.Scenario, solver: str, level: str = "velocity") -> dict[str, object]:
    return perform(Job("own", scenario, methods([solver])[0], level, 0, 0)).row


@pytest.mark.parametrize(("hertz", "share"), [(1.0, 0.0), (2.5, 0.0), (3.5, 1.0), (20.0, 1.0)])
def test_power_is_counted_above_three_hertz(hertz: float, share: float) -> None:
    assert figures.chatter(wave(hertz), DT)["power_above_3hz"] == pytest.approx(share, abs=1e-3)
    mixed = figures.chatter(wave(1.0) + wave(hertz, amplitude=0.35), DT)["power_above_3hz"]
    assert mixed == pytest.approx(share * 0.25 / 1.25, abs=2e-3)  # power goes with the square


@pytest.mark.parametrize("hertz", [0.5, 2.0, 7.0])
def test_jerk_and_flips_of_a_sine_are_known(hertz: float) -> None:
    found = figures.chatter(wave(hertz), DT)
    omega, amplitude = 2 * np.pi * hertz, 0.7
    sampled = amplitude * (2 * np.sin(0.5 * omega * DT) / DT) ** 2  # of second differences, exactly
    assert found["jerk_peak"] == pytest.approx(sampled, rel=0.02)
    assert found["jerk_rms"] == pytest.approx(sampled / np.sqrt(2.0), rel=0.02)
    assert abs(found["flips"] - 2 * 2 * hertz * 8.0) <= 4  # two reversals a period, two joints; zeros may be sampled


def test_standing_still_is_no_chatter() -> None:
    found = figures.chatter(np.zeros((100, 3)), DT)
    assert found == {"jerk_rms": 0.0, "jerk_peak": 0.0, "flips": 0, "power_above_3hz": 0.0}
    noise = np.zeros((100, 1))
    noise[:50] = 1.0
    noise[60:] = 1e-6 * (-1.0) ** np.arange(40)[:, None]
    assert figures.chatter(noise, DT)["flips"] == 0


def test_the_pseudo_inverse_has_no_null_space_motion_and_a_pure_one_all_of_it() -> None:
    scenario = short(duration=0.5)
    stage = Stage(scenario)
    run = cc.simulate(stage.controller(cc.Pinv(), "velocity"), stage.start, 0.5)
    assert figures.null_motion(run, stage) < 1e-12 < np.abs(run.v).max()
    way = 0.0
    q, state = np.array(stage.start), stage.robot.state(stage.start)
    for k in range(len(run)):  # along the null space alone, at 0.3 rad/s
        state = stage.robot.state(q)
        n = np.linalg.svd(state.jacobian("tool")[:2])[2][-1]
        n = n if n[0] > 0 else -n
        run.q[k], run.v[k + 1] = q, 0.3 * n
        q = stage.robot.integrate(q, 0.3 * n * scenario.dt)
        way += 0.3 * scenario.dt
    assert figures.null_motion(run, stage) == pytest.approx(way, rel=1e-12) and way == pytest.approx(0.15)


def test_figures_agree_with_the_runs_own_metrics() -> None:
    scenario = short(robot="panda", limits="robot", duration=0.6, tasks=[{"target": {"kind": "circle", "radius": 0.1}}])
    stage = Stage(scenario)
    run = cc.simulate(stage.controller(cc.SNS(), "velocity"), stage.start, 0.6)
    run.meta["path_time"] = 0.4
    metrics = run.metrics()
    found = figures.measure(run, stage)
    assert found["rms_m"] == metrics.tasks[0].rms_m and found["max_rad"] == metrics.tasks[0].max_rad
    assert found["effort"] == metrics.effort and found["step_p99"] == metrics.step_p99
    assert found["delay"] == pytest.approx(0.2)
    assert {entry["status"]: entry["steps"] for entry in found["status"]} == metrics.status
    least = min(np.linalg.det(J @ J.T) ** 0.5 for J in (stage.robot.state(q).jacobian(stage.robot.tool) for q in run.q))
    assert found["manipulability"] == pytest.approx(least, rel=1e-9)
    assert found["margin"] == pytest.approx(min(j.position_margin for j in metrics.joints if j.position_margin))


def test_a_task_that_was_skipped_has_no_nan_in_its_row() -> None:
    scenario = short(duration=0.2)
    stage = Stage(scenario)
    run = cc.simulate(stage.controller(cc.SNS(), "velocity"), stage.start, 0.2)
    run.tasks[0].scale[5] = np.nan
    found = figures.measure(run, stage)
    assert json.dumps(found, allow_nan=False) and found["scale_min"] == 0.0
    assert found["scale_mean"] == pytest.approx(1.0 - 1.0 / len(run))


def test_needed_torques_are_those_of_the_equations_of_motion() -> None:
    scenario = short(robot="panda", limits="robot", duration=0.3, tasks=[{"target": {"kind": "circle", "radius": 0.1}}])
    stage = Stage(scenario)
    run = cc.simulate(stage.controller(cc.Pinv(), "velocity"), stage.start, 0.3)
    found = figures.measure(run, stage)
    peak, energy = 0.0, 0.0
    for k in range(len(run)):
        middle, a = 0.5 * (run.v[k] + run.v[k + 1]), (run.v[k + 1] - run.v[k]) / scenario.dt
        state = stage.robot.state(run.q[k], middle)
        tau = state.mass_matrix @ a + state.nonlinear_effects
        peak, energy = max(peak, np.abs(tau).max()), energy + float(np.abs(tau * middle).sum()) * scenario.dt
    assert found["torque_source"] == "inverse dynamics"
    assert found["peak_torque"] == pytest.approx(peak, rel=1e-9) and found["energy"] == pytest.approx(energy, rel=1e-9)


def test_driven_runs_have_their_own_torques() -> None:
    row = row_of(short(dt=1e-3, duration=0.05, levels=["torque"]), "pinv", "torque")
    assert row["outcome"] == "done" and row["torque_source"] == "driven" and row["peak_torque"] > 0.0


def test_violations_count_from_the_scenarios_own_limits_and_after_settling() -> None:
    fast = {"kind": "circle", "radius": 0.3, "period": 0.6}
    tasks = [{"axes": "xy", "target": fast}]
    assert row_of(short(duration=0.8, tasks=tasks), "pinv")["violations"] == 0  # no limits, none to violate
    bounded = short(duration=0.8, tasks=tasks, limits={"velocity": 0.5})
    row = row_of(bounded, "pinv")
    assert row["violations"] > 10 and not row["valid"] and row["velocity_share"] > 1.0
    kept = row_of(bounded, "sns")
    assert kept["violations"] == 0 and kept["valid"] and kept["delay"] > 0.1
    outside = {"posture": {"panda_joint6": 3.8025}}
    given = {"robot": "panda", "limits": "robot", "start": outside, "duration": 1.0, "tasks": [{"axes": "position"}]}
    before, after = (row_of(short(**given, settle=s), "sns") for s in (0.0, 0.8))
    assert before["violations"] > 0 and not before["valid"]
    assert after["violations"] == 0 and after["valid"] and after["margin"] >= 0.0 > before["margin"]


def test_a_run_inside_an_obstacle_is_not_valid() -> None:
    scene = [{"shape": "sphere", "name": "ball", "radius": 0.05, "at": [0.3069, 0.25, 0.4869]}]
    line = {"kind": "line", "offset": [0.0, 0.2, 0.0], "period": 1.0}
    given = {"robot": "panda", "limits": "robot", "duration": 0.6, "tasks": [{"axes": "position", "target": line}]}
    through, around = (row_of(short(**given, scene=scene), name) for name in ("pinv", "sns"))
    assert through["clearance"] < -0.01 and not through["valid"]
    assert around["clearance"] > 0.009 and around["valid"]
    assert row_of(short(**given), "pinv")["clearance"] is None


def test_drift_is_there_for_closed_paths_alone() -> None:
    laps = [{"axes": "xy", "target": {"kind": "circle", "radius": 0.3, "period": 0.5, "laps": 2}}]
    assert row_of(short(duration=1.1, tasks=laps), "pinv")["drift"] > 1e-3
    assert row_of(short(), "pinv")["drift"] is None  # it ends before the lap does
    step = [{"axes": "xy", "target": {"kind": "step", "offset": [-0.1, 0.0, 0.0]}}]
    assert row_of(short(tasks=step), "pinv")["drift"] is None


def test_every_column_is_filled_by_some_run_and_none_is_invented() -> None:
    rows = [row_of(short(), "sns"), row_of(short(duration=0.05, dt=1e-3), "sns", "torque")]
    scene = [{"shape": "sphere", "name": "b", "radius": 0.05, "at": [1.0, 1.0, 1.0]}]
    circle = {"kind": "circle", "radius": 0.1, "period": 0.1}
    panda = {"robot": "panda", "limits": "robot", "scene": scene, "tasks": [{"target": circle}]}
    rows += [row_of(short(**panda), "sns"), row_of(short(**(panda | {"dt": 1e-3})), "sns", "torque")]
    rows.append(row_of(short(), "extended-jacobian"))
    names = {column.name for column in COLUMNS}
    assert all(set(row) == names for row in rows)
    empty = {name for name in names if all(row[name] is None for row in rows)}
    assert not empty, empty
    assert set(FIGURES) <= names


def test_what_a_method_refuses_or_breaks_is_a_row() -> None:
    refused = row_of(short(), "extended-jacobian")
    assert refused["outcome"] == "refused" and "no objective" in str(refused["reason"]) and not refused["valid"]
    assert row_of(short(robot="talos", root_joint="free_flyer", tasks=[{}]), "sns", "torque")["outcome"] == "refused"
