"""From a scenario's data to a robot, a start, tasks and a controller for one method at one level."""

from __future__ import annotations

import copy
import zlib
from dataclasses import fields
from functools import lru_cache
from typing import Any

import numpy as np
import pinocchio as pin

from cartctl.bench.fields import under
from cartctl.bench.scenario import Scenario
from cartctl.bench.targets import make_target
from cartctl.checks import FloatArray
from cartctl.constraints import Avoid, Constraint, FrameBox, FrameSpeed, HalfSpace
from cartctl.levels import get_level
from cartctl.model.axes import pose_rows
from cartctl.model.limits import Limits
from cartctl.model.loading import load
from cartctl.model.payload import Payload
from cartctl.model.robot import Robot
from cartctl.model.scene import Scene
from cartctl.motion.controller import Controller
from cartctl.motion.plant import Plant
from cartctl.objectives.base import Objective
from cartctl.objectives.named import KNOWN, aimed
from cartctl.paths import Line
from cartctl.solvers import Solver
from cartctl.tasks import ComTask, FrameTask, JointTask, PostureTask, RelativeFrameTask, Task

_INSIDE = 0.02  # of a joint's range: random starts keep that far from its ends
_SOFT_START = 0.5  # s in which the objective rises, so that the rates do not jump


class Stage:
    """A scenario made real, for one seed and one repetition: robot, start, tasks, limits, scene.

    Raises ScenarioError, which names the key, for what the robot or the paths refuse.
    """

    def __init__(self, scenario: Scenario, seed: int = 0, repeat: int = 0) -> None:
        self.scenario = scenario
        self.robot = _robot(scenario)
        self.start = self._start(seed, repeat)
        self.tasks = self._tasks()
        self.limits = self._limits()
        self.scene = self._scene()
        self.avoid = Avoid(self.scene, margin=scenario.margin) if scenario.scene else None
        self.constraints = self._constraints()

    @property
    def judged(self) -> Robot:
        """The robot with the scenario's limits, or without any, by which runs are measured."""
        robot, own = copy.copy(self.robot), self.robot.limits
        ends = {"lower": -np.inf, "upper": np.inf}
        none = {field.name: ends[field.name.rpartition("_")[2]] for field in fields(own)}
        robot.limits = own.replace(**none) if self.limits is None else self.limits
        return robot

    @property
    def hand(self) -> Task:
        """The task that counts: the one of highest priority."""
        return self.tasks[0]

    def controller(self, solver: Solver, level: str) -> Controller:
        """The loop of one method: limits, rows and objective go to those that take them; raises as Controller."""
        scenario, honours = self.scenario, solver.honours
        bounded = "bounds" in honours and get_level(level).bounds is not None
        objective = self.objective() if "reference" in honours or solver.extends else None
        metric = None if scenario.metric == "none" else scenario.metric
        if metric is None and level == "torque" and solver.takes_metric:
            metric = "inverse-inertia"  # the dynamically consistent one
        return Controller(
            self.robot, self.tasks, solver, level, limits=self.limits if bounded else None, objective=objective,
            metric=metric, dt=scenario.dt, soft_start=_SOFT_START,
            constraints=self.constraints if "constraints" in honours else (),
        )  # fmt: skip

    def objective(self) -> Objective | None:
        """The scenario's, of the frame and axes of its first task."""
        scenario = self.scenario
        if scenario.objective == "none":
            return None
        known = KNOWN[scenario.objective]
        goal = known.make(scenario.objective_gain or known.gain)
        axes = str(scenario.tasks[0].get("axes", "pose"))
        with under("objective"):
            made = aimed(goal, self.hand.frame or self.robot.tool, axes)
            if made is not None:
                made.check(self.robot)
            return made

    def plant(self) -> Plant | None:
        """What differs from the model, None for nothing."""
        spec = dict(self.scenario.plant)
        if not spec:
            return None
        with under("plant"):
            payload = (Payload(spec["payload"]),) if spec.get("payload") else ()
            return Plant(masses=spec.get("masses", 1.0), noise=spec.get("noise", 0.0), payload=payload)

    def _start(self, seed: int, repeat: int) -> FloatArray:
        robot, start = self.robot, self.scenario.start
        if isinstance(start, str):
            return robot.home
        with under("start", "posture"):
            q = robot.configuration(start["posture"], robot.home)
        if not start["random"]:
            return q
        rng = np.random.default_rng([seed, repeat, zlib.crc32(self.scenario.name.encode())])
        offset = rng.uniform(-start["random"], start["random"], robot.nv)
        at, low, high = robot.coordinates(q), robot.limits.position_lower, robot.limits.position_upper
        room = np.where(np.isfinite(high - low), _INSIDE * (high - low), 0.0)
        joints = np.isfinite(high - low) & (at >= low) & (at <= high)
        wanted = np.where(joints, np.minimum(np.maximum(at + offset, low + room), high - room), at + offset)
        return robot.integrate(q, wanted - at)

    def _tasks(self) -> list[Task]:
        made = []
        for i, spec in enumerate(self.scenario.tasks):
            with under("tasks", i):
                task = self._task(dict(spec))
                task.check(self.robot)
                made.append(task)
        return made

    def _task(self, spec: dict[str, Any]) -> Task:
        kind = spec["kind"]
        shared = {"gain": spec["gain"], "weight": spec["weight"], "fit": spec["fit"]}
        if spec["name"]:
            shared["name"] = spec["name"]
        if kind in ("posture", "joint"):
            return self._joint_task(kind, spec["posture"], shared)
        with under("axes"):
            rows = pose_rows(spec["axes"], 3) if kind == "com" else pose_rows(spec["axes"])
        state = self.robot.state(self.start)
        if kind == "com":
            com = pin.SE3(np.eye(3), np.array(state.com))
            with under("target"):
                target = make_target(spec["target"], com, turns=False)
            return ComTask(spec["axes"], target=target, **shared)
        frame = spec["frame"] or self.robot.tool
        with under("frame"):
            placement = state.placement(frame)
        if kind == "relative":
            with under("reference_frame"):
                self.robot.frame_id(spec["reference_frame"])
            return RelativeFrameTask(frame, spec["reference_frame"], spec["axes"], length=spec["length"], **shared)
        with under("target"):
            target = make_target(spec["target"], placement, turns=any(row >= 3 for row in rows))
        return FrameTask(frame, spec["axes"], target=target, length=spec["length"], **shared)

    def _joint_task(self, kind: str, posture: dict[str, float] | None, shared: dict[str, Any]) -> Task:
        make = PostureTask if kind == "posture" else JointTask
        with under("posture"):
            for joint in posture or ():
                self.robot.dof(joint)
        if posture is None:
            return make(**shared)
        return make(joints=list(posture), target=list(posture.values()), **shared)

    def _limits(self) -> Limits | None:
        given, own = self.scenario.limits, self.robot.limits
        if isinstance(given, str):
            return own if given == "robot" else None
        changes: dict[str, Any] = {}
        for quantity in ("velocity", "acceleration", "jerk", "torque"):
            low, high = (getattr(own, f"{quantity}_{end}") for end in ("lower", "upper"))
            value, share = given[quantity], given[f"{quantity}_share"]
            if share is not None:
                changes |= {f"{quantity}_lower": share * low, f"{quantity}_upper": share * high}
            elif value is not None:
                changes |= {f"{quantity}_lower": -value, f"{quantity}_upper": value}
        return own.replace(**changes)

    def _scene(self) -> Scene:
        scene = Scene()
        for i, spec in enumerate(self.scenario.scene):
            with under("scene", i):
                _add(scene, dict(spec), self.robot)
        return scene

    def _constraints(self) -> list[Constraint]:
        made: list[Constraint] = [] if self.avoid is None else [self.avoid]
        for i, spec in enumerate(self.scenario.constraints):
            with under("constraints", i):
                frame = spec["frame"] or self.robot.tool
                self.robot.frame_id(frame)
                if spec["kind"] == "half-space":
                    made.append(HalfSpace(frame, spec["normal"], spec["offset"]))
                elif spec["kind"] == "box":
                    made.append(FrameBox(frame, spec["lower"], spec["upper"]))
                else:
                    made.append(FrameSpeed(frame, linear=spec["linear"], angular=spec["angular"]))
        return made


def _add(scene: Scene, spec: dict[str, Any], robot: Robot) -> None:
    """One obstacle."""
    shape, name, ignore = spec["shape"], spec["name"], spec["ignore"]
    if shape == "plane":
        scene.plane(name, spec["normal"], spec["offset"], ignore=ignore)
        return
    at: Any = np.array(spec["at"])
    if spec["to"] is not None:
        at = Line(at, np.array(spec["to"]), spec["period"])
    if spec["frame"] is not None:
        with under("frame"):
            robot.frame_id(spec["frame"])
    sizes = {"box": ("size",), "sphere": ("radius",)}.get(shape, ("radius", "length"))
    getattr(scene, shape)(name, *(spec[size] for size in sizes), at=at, frame=spec["frame"], ignore=ignore)


def _robot(scenario: Scenario) -> Robot:
    with under("robot"):
        return _loaded(scenario.robot, scenario.root_joint, tuple(scenario.package_dirs))


@lru_cache(maxsize=8)
def _loaded(name: str, root_joint: str, package_dirs: tuple[str, ...]) -> Robot:
    """A robot; the last few are kept, for a bench asks for the same ones again and again."""
    return load(name, root_joint=None if root_joint == "fixed" else root_joint, package_dirs=package_dirs)
