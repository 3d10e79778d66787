"""What obstacles cost, and what keeping clear of them does to a motion.

    python benchmarks/obstacles.py time  [--save]   # one step on the Panda with 10 obstacles, as ratios
    python benchmarks/obstacles.py line  [--save]   # 60 s on a line between two posts, distances by other shapes
    python benchmarks/obstacles.py talos [--save]   # 100 random reaches of both hands, links kept from each other

Distances of the line are checked by coal on the robot's collision meshes themselves, at ten times finer time, which
shares neither shapes nor rows with the controller.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin
from harness import SHORT, interleaved, ratios, save_rows, setting, show

import cartctl as cc
from cartctl.constraints import Box

RESULTS = Path(__file__).parent / "results"
REFERENCE = "pin.computeFrameJacobian"


def ten_obstacles() -> cc.Scene:
    """Balls, boxes, capsules and cylinders around the Panda's home, some of them near."""
    rng, scene = np.random.default_rng(3), cc.Scene()
    spots = [[0.45, 0.35, 0.6], [0.6, -0.3, 0.4], [-0.3, 0.0, 0.7], [0.3, 0.5, 0.2], [0.7, 0.2, 0.8]]
    for k, spot in enumerate(spots):
        scene.sphere(f"ball {k}", rng.uniform(0.04, 0.1), at=spot)
    scene.box("shelf", [0.4, 0.6, 0.02], at=[0.6, 0.0, 0.3]).box("wall", [0.05, 2.0, 2.0], at=[-0.5, 0.0, 1.0])
    scene.capsule("bar", 0.03, 0.8, at=[0.0, 0.4, 0.6]).cylinder("post", 0.05, 1.0, at=[0.35, -0.45, 0.5])
    return scene.plane("floor", [0.0, 0.0, 1.0], -0.02)


def candidates() -> dict[str, Callable[[], object]]:
    """The reference, the three ways to avoid on their own, and whole steps with and without."""
    robot, scene, dt = cc.load("panda"), ten_obstacles(), 1e-3
    rng = np.random.default_rng(0)
    q, v = np.array(robot.home + 0.01), 0.3 * rng.normal(size=7)
    data, frame = robot.model.createData(), robot.frame_id(robot.tool)
    world = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    state = robot.state(q, v)
    box = Box(v - 0.01, v + 0.01)
    avoid, itself, objective = cc.Avoid(scene), cc.AvoidSelf(), cc.Clearance(scene)
    target = robot.state(robot.home).placement(robot.tool)

    def fresh(function: Callable[[], object]) -> Callable[[], object]:
        def call() -> object:
            state.set(q, v)
            return function()

        return call

    def controller(**options: object) -> Callable[[], object]:
        made = cc.Controller(robot, cc.FrameTask(robot.tool, target=target), solver="sns", dt=dt, **options)
        return lambda: made.step(q, v, 0.0)

    return {
        REFERENCE: lambda: pin.computeFrameJacobian(robot.model, data, q, frame, world),
        "Avoid: rows, 10 obstacles": fresh(lambda: avoid.velocity_rows(state, dt, box)),
        "AvoidSelf: rows": fresh(lambda: itself.velocity_rows(state, dt, box)),
        "Clearance: gradient, 10 obstacles": fresh(lambda: objective.gradient(state)),
        "Controller.step, sns": controller(),
        "Controller.step, sns, Avoid": controller(constraints=[avoid]),
        "Controller.step, sns, Avoid and AvoidSelf": controller(constraints=[avoid, itself]),
        "Controller.step, sns, Clearance": controller(objective=objective),
    }


def timed(save: bool) -> None:
    """The table of times."""
    rows = ratios(interleaved(candidates(), **SHORT), REFERENCE)
    show(f"Obstacles on the Panda; ratio to {REFERENCE}", rows)
    if save:
        save_rows(RESULTS / "obstacles_time.csv", rows, setting())


class TrueDistance:
    """The smallest distance of the collision meshes, as loaded, to shapes given to coal directly."""

    def __init__(self, robot: cc.Robot, things: list[tuple[object, pin.SE3]]) -> None:
        self.model, self.robot = robot.collision_model, robot
        self.data, self.shapes = robot.model.createData(), pin.GeometryData(self.model)
        self.things = [(shape, coal.Transform3s(at.rotation, at.translation)) for shape, at in things]
        self.request = coal.DistanceRequest()

    def __call__(self, q: np.ndarray) -> float:
        """At a configuration, m."""
        pin.updateGeometryPlacements(self.robot.model, self.data, self.model, self.shapes, q)
        best = np.inf
        for k, geometry in enumerate(self.model.geometryObjects):
            if geometry.parentJoint == 0:
                continue
            at = coal.Transform3s(self.shapes.oMg[k].rotation, self.shapes.oMg[k].translation)
            for shape, place in self.things:
                found = coal.distance(geometry.geometry, at, shape, place, self.request, coal.DistanceResult())
                best = min(best, found)
        return best


def line_between_posts(seconds: float, solver: str, level: str, dt: float) -> dict[str, str]:
    """The hand goes to and fro on a line that leads between two posts, 21 cm apart: the hand, 22 cm wide, must turn."""
    robot = cc.load("panda")
    posts = [np.array([0.5, y, 0.5]) for y in (-0.135, 0.135)]
    scene = cc.Scene()
    for k, at in enumerate(posts):
        scene.capsule(f"post {k}", 0.03, 0.5, at=at)
    start = robot.state(robot.home).position(robot.tool)
    middle, half, rate = np.array([0.45, 0.0, start[2]]), 0.14, 2.0 * np.pi / 6.0

    def along(t: float) -> cc.PathSample:
        s, c = np.sin(rate * t), np.cos(rate * t)
        e = np.array([half, 0.0, 0.0])
        return cc.PathSample(middle + s * e, None, np.r_[rate * c * e, 0, 0, 0], np.r_[-(rate**2) * s * e, 0, 0, 0])

    hand = cc.FrameTask(robot.tool, "position", gain=10.0, target=along)
    avoid = cc.Avoid(scene, 0.01)
    what = cc.AccelerationLevel(damping=3.0) if level == "acceleration" else level
    controller = cc.Controller(
        robot,
        [hand, cc.PostureTask(gain=1.0, weight=1e-3)],
        solver,
        level=what,
        dt=dt,
        constraints=[avoid, cc.AvoidSelf(0.005)],
    )
    began = time.perf_counter()
    run = cc.simulate(controller, robot.home, duration=seconds)
    took = (time.perf_counter() - began) / (len(run.time) - 1)
    true = TrueDistance(robot, [(coal.Capsule(0.03, 0.5), pin.SE3(np.eye(3), at)) for at in posts])
    fine, ours = [], []
    for q0, q1 in zip(run.q[:-1], run.q[1:], strict=True):
        step = robot.difference(q0, q1)
        near = true(q0)
        ours.append(-avoid.excess(robot.state(q0)) + avoid.margin)
        if near < 0.05:  # elsewhere no point of the arm comes 5 cm further within a step
            fine += [true(robot.integrate(q0, x * step)) for x in np.arange(10) / 10.0]
        else:
            fine.append(near)
    error = np.linalg.norm(run.tasks[0].error, axis=1) if hasattr(run.tasks[0], "error") else np.zeros(1)
    settled = error[int(3.0 / dt) :]
    flips = np.sum(np.sign(run.v[1:-1]) * np.sign(run.v[2:]) < 0, axis=0)
    return {
        "solver": solver,
        "level": level,
        "seconds": f"{seconds:g}",
        "penetrations": str(int(np.sum(np.array(fine) < 0.0))),
        "nearest_mm": f"{1e3 * min(fine):.2f}",
        "nearest_own_shapes_mm": f"{1e3 * min(ours):.3f}",
        "checks": str(len(fine)),
        "largest_error_mm": f"{1e3 * settled.max():.3f}",
        "median_error_mm": f"{1e3 * np.median(settled):.4f}",
        "steps_at_margin": str(int(np.sum(np.array(ours) < avoid.margin + 1e-3))),
        "sign_changes_per_joint_and_s": f"{flips.max() / seconds:.2f}",
        "us_a_step": f"{1e6 * took:.0f}",
    }


def line(save: bool, seconds: float) -> None:
    """60 s with every solver that takes rows."""
    cases = [("sns", "velocity"), ("qp", "velocity"), ("hqp", "velocity"), ("sns", "acceleration")]
    rows = []
    for solver, level in cases:
        rows.append(line_between_posts(seconds, solver, level, 5e-3))
        print(rows[-1], flush=True)
    show("A line between two posts, Panda", rows)
    if save:
        save_rows(RESULTS / "obstacles_line.csv", rows, setting())


MARGIN, BRAKING = 0.015, 0.25  # m, and m/s^2, which all pairs of both arms can keep to at a time


def reach(
    robot: cc.Robot, rng: np.random.Generator, rows: bool, speed: float, dt: float = 5e-3, seconds: float = 2.5
) -> tuple[float, float, int]:
    """Both hands to where a random posture of the upper body has them; smallest distance, final error, infeasible."""
    watch = cc.AvoidSelf(MARGIN, deceleration=BRAKING)
    hands = ("wrist_left_ft_tool_link", "wrist_right_ft_tool_link")
    goal = robot.state(robot.random_configuration(rng))
    tasks: list[cc.Task] = [cc.FrameTask(f, "position", gain=3.0, target=goal.position(f)) for f in hands]
    tasks.append(cc.PostureTask(gain=1.0))
    limits = robot.limits.replace(  # accelerations are not published; assumed
        acceleration_lower=-20.0,
        acceleration_upper=20.0,
        velocity_lower=np.maximum(robot.limits.velocity_lower, -speed),
        velocity_upper=np.minimum(robot.limits.velocity_upper, speed),
    )
    controller = cc.Controller(robot, tasks, "sns", limits=limits, dt=dt, constraints=[watch] if rows else [])
    q, v, least, infeasible = robot.home, np.zeros(robot.nv), np.inf, 0
    for k in range(round(seconds / dt)):
        command = controller.step(q, v, k * dt)
        infeasible += command.solution.status.name == "INFEASIBLE"
        assert command.velocity is not None
        v = command.velocity
        for x in (0.5, 1.0):
            least = min(least, -watch.excess(robot.state(robot.integrate(q, x * dt * v))) + watch.margin)
        q = robot.integrate(q, dt * v)
    error = max(float(np.linalg.norm(robot.state(q).position(t.frame) - t.target)) for t in tasks[:2])
    return least, error, infeasible


UPPER = [f"arm_{side}_{k}_joint" for side in ("left", "right") for k in range(1, 8)]
UPPER += ["torso_1_joint", "torso_2_joint", "head_1_joint", "head_2_joint"]


def talos(save: bool, reaches: int) -> None:
    """Random reaches without and with the rows, at the robot's own speeds and below 1 rad/s."""
    robot = cc.load("talos", active_joints=UPPER)
    rows = []
    for guard, speed in ((False, np.inf), (True, np.inf), (False, 1.0), (True, 1.0)):
        rng = np.random.default_rng(0)
        found = [reach(robot, rng, guard, speed) for _ in range(reaches)]
        least = np.array([f[0] for f in found])
        rows.append(
            {
                "rows": f"AvoidSelf({MARGIN:g}, deceleration={BRAKING:g})" if guard else "none",
                "joint_speeds": f"{speed:g} rad/s" if np.isfinite(speed) else "the robot's",
                "reaches": str(reaches),
                "with_a_collision": str(int(np.sum(least < 0.0))),
                "inside_the_margin": str(int(np.sum(least < MARGIN - 1e-5))),
                "nearest_mm": f"{1e3 * least.min():.2f}",
                "reached_within_1_cm": str(int(sum(f[1] < 0.01 for f in found))),
                "infeasible_steps": str(sum(f[2] for f in found)),
            }
        )
        print(rows[-1], flush=True)
    show("Random reaches of both hands, Talos' upper body", rows)
    if save:
        save_rows(RESULTS / "obstacles_talos.csv", rows, setting())


def main() -> None:
    """Run one of the three."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=("time", "line", "talos"))
    parser.add_argument("--save", action="store_true", help="write benchmarks/results/obstacles_<what>.csv")
    parser.add_argument("--seconds", type=float, default=60.0, help="of the line")
    parser.add_argument("--reaches", type=int, default=100)
    given = parser.parse_args()
    if given.what == "time":
        timed(given.save)
    elif given.what == "line":
        line(given.save, given.seconds)
    else:
        talos(given.save, given.reaches)


if __name__ == "__main__":
    main()
