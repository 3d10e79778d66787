"""Whole steps one by one: median and 99th percentile of Controller.step along a motion, unsaturated and saturated.

The job: the Panda's hand along a circle of 0.1 m in 4 s (6D pose, ``sns``), a posture below, limits on position,
velocity and acceleration, dt = 1 ms; saturated: speeds of at most 0.1 rad/s, so that the path waits. And Talos, 32 dof:
both hands' poses, the head's direction, a posture, all limits. The states of a rollout are kept and replayed, five
times; ``quiet`` figures are of each step's quickest replay, which other work on the machine disturbs least. Ratios are
to ``numpy.linalg.pinv`` of a 6 x 7 matrix, called between the steps.
"""

from __future__ import annotations

from time import perf_counter_ns
from typing import Any

import numpy as np

import cartctl as cc

STEPS, REPLAYS = 2000, 5


class General(cc.Controller):
    """One that goes the general way, as controllers with constraints, objectives or other tasks do."""

    _fuses = False


def panda(kind: type[cc.Controller] = cc.Controller, **given: Any) -> cc.Controller:
    """The job's."""
    robot = cc.load("panda")
    start = robot.state(robot.home).placement(robot.tool)
    hand = cc.FrameTask(robot.tool, gain=20.0, target=cc.Circle.starting_at(start, 0.1, period=4.0))
    return kind(robot, [hand, cc.PostureTask()], solver="sns", **given)


def talos(**given: Any) -> cc.Controller:
    """Four tasks on 32 joints."""
    robot = cc.load("talos")
    state, tasks = robot.state(robot.home), []
    for frame in ("gripper_right_base_link", "gripper_left_base_link"):
        upright = {"normal": (1.0, 0.0, 0.0), "towards": (0.0, 0.0, 1.0)}
        path = cc.Circle.starting_at(state.placement(frame), 0.05, period=4.0, **upright)
        tasks.append(cc.FrameTask(frame, gain=20.0, target=path))
    tasks.append(cc.FrameTask("head_2_link", "rx ry rz", gain=10.0, target=state.rotation("head_2_link")))
    return cc.Controller(robot, [*tasks, cc.PostureTask()], solver="sns", **given)


def slow(make: Any, speed: float, **given: Any) -> cc.Controller:
    """The same below a speed that it would exceed."""
    limits = make().robot.limits.replace(velocity_lower=-speed, velocity_upper=speed)
    return make(limits=limits, **given)


def controllers() -> dict[str, cc.Controller]:
    """What is measured."""
    return {
        "Panda, unsaturated": panda(),
        "Panda, saturated": slow(panda, 0.1),
        "Panda, unsaturated, approach=False": panda(approach=False),
        "Panda, saturated, approach=False": slow(panda, 0.1, approach=False),
        "Panda, unsaturated, the general way": panda(General),
        "Panda, unsaturated, the general way, approach=False": panda(General, approach=False),
        "Talos, 4 tasks, unsaturated": talos(),
        "Talos, 4 tasks, saturated": slow(talos, 0.02),
    }


def motion(controller: cc.Controller) -> tuple[list[tuple[Any, Any, float]], float]:
    """The states of a rollout, after its first steps, and the share of them in which a joint was at a bound."""
    states, saturated = [], 0
    q, v = np.array(controller.robot.home), np.zeros(controller.robot.nv)
    skipped = STEPS // 4
    for k in range(STEPS + skipped):
        t = k * controller.dt
        states.append((q, v, t))
        command = controller.step(q, v, t)
        if k >= skipped:
            saturated += bool(command.solution.saturated.any())
        q, v = controller.robot.integrate(q, command.velocity * controller.dt), command.velocity
    return states, saturated / STEPS


def replayed(controller: cc.Controller, states: list[tuple[Any, Any, float]], J: Any) -> tuple[Any, Any]:
    """Us of every step, (REPLAYS, STEPS), and of calls of pinv between them."""
    times, pinv = np.zeros((REPLAYS, len(states))), []
    for row in times:
        controller.reset()
        for k, (q, v, t) in enumerate(states):
            begun = perf_counter_ns()
            controller.step(q, v, t)
            row[k] = perf_counter_ns() - begun
            if k % 20 == 0:
                begun = perf_counter_ns()
                np.linalg.pinv(J)
                pinv.append(perf_counter_ns() - begun)
    return times[:, -STEPS:] / 1e3, np.array(pinv) / 1e3


def measured() -> list[dict[str, str]]:
    """One row a job."""
    J, rows = np.random.default_rng(0).normal(size=(6, 7)), []
    for name, controller in controllers().items():
        states, share = motion(controller)
        times, pinv = replayed(controller, states, J)
        quiet = times.min(axis=0)
        median, late = np.percentile(times, [50, 99])
        rows.append(
            {
                "what": name,
                "at_a_bound": f"{100.0 * share:.0f} %",
                "median_us": f"{median:.2f}",
                "p99_us": f"{late:.2f}",
                "quiet_median_us": f"{np.median(quiet):.2f}",
                "quiet_p99_us": f"{np.percentile(quiet, 99):.2f}",
                "ratio_to_pinv": f"{median / np.median(pinv):.2f}",
            }
        )
    return rows
