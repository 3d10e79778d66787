"""Runs for the report's tests: rolled out here in a few lines, so that these tests need no controller."""

from __future__ import annotations

from importlib import metadata
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pinocchio as pin

from cartctl.model.robot import Robot
from cartctl.motion.run import Run, TaskRecord

# A planar 2R arm of primitives, standing up; {x} goes where a hostile URDF could put anything.
PLANAR = """<robot name="{x}">
  <link name="base"><visual><geometry><cylinder radius="0.06" length="0.1"/></geometry></visual></link>
  <link name="upper"><visual><origin xyz="0.25 0 0"/><geometry><box size="0.5 0.05 0.05"/></geometry>
    <material name="m"><color rgba="0.2 0.4 0.7 1"/></material></visual></link>
  <link name="lower"><visual><origin xyz="0.2 0 0"/><geometry><box size="0.4 0.04 0.04"/></geometry>
    <material name="n"><color rgba="0.8 0.3 0.2 1"/></material></visual></link>
  <link name="tip"/>
  <joint name="{x}shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 -1 0"/>
    <limit lower="-3" upper="3" velocity="2" effort="10"/></joint>
  <joint name="{x}elbow" type="continuous"><parent link="upper"/><child link="lower"/>
    <origin xyz="0.5 0 0"/><axis xyz="0 -1 0"/></joint>
  <joint name="wrist" type="fixed"><parent link="lower"/><child link="tip"/><origin xyz="0.4 0 0"/></joint>
</robot>"""


def robot_of(model: Any, visual: Any, tool: str, name: str | None = None) -> Robot:
    """Wrap a Pinocchio model and its visuals."""
    return Robot(model, name=name, tool=tool, geometry=SimpleNamespace(visual=lambda _: visual))


def circle_run(robot: Robot, q: np.ndarray, radius: float, axes: tuple[int, int], duration: float = 2.0) -> Run:
    """Let the tool follow one round of a circle by differential inverse kinematics, damped and slightly late."""
    model, data, dt = robot.model, pin.Data(robot.model), 0.005
    frame, n = model.getFrameId(robot.tool), round(duration / 0.005)
    pin.framesForwardKinematics(model, data, q)
    start = pin.SE3(data.oMf[frame])
    rows: dict[str, list[Any]] = {"q": [], "v": [], "error": [], "pose": [], "target": [], "sigma": []}
    v = np.zeros(model.nv)
    for k in range(n + 1):
        s = 2 * np.pi * (k / n - np.sin(2 * np.pi * k / n) / (2 * np.pi))  # at rest at both ends
        goal = pin.SE3(start)
        goal.translation[axes[0]] += radius * (np.cos(s) - 1)
        goal.translation[axes[1]] += radius * np.sin(s)
        J = pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL_WORLD_ALIGNED)
        pin.framesForwardKinematics(model, data, q)
        here = data.oMf[frame]
        e = np.concatenate([goal.translation - here.translation, pin.log3(goal.rotation @ here.rotation.T)])
        m = 6 if model.nv >= 6 else 3
        rows["sigma"].append(np.linalg.svd(J[:m], compute_uv=False))
        poses = {"pose": pin.SE3ToXYZQUAT(here), "target": pin.SE3ToXYZQUAT(goal)}
        for key, value in ({"q": q, "v": v, "error": e[:m]} | poses).items():
            rows[key].append(np.array(value))
        v = J[:m].T @ np.linalg.solve(J[:m] @ J[:m].T + 1e-6 * np.eye(m), 40.0 * e[:m])
        q = pin.integrate(model, q, v * dt)
    arrays = {key: np.array(value) for key, value in rows.items()}
    return run_of(robot, dt, arrays, ["m"] * 3 + ["rad"] * (m - 3))


def run_of(robot: Robot, dt: float, arrays: dict[str, np.ndarray], units: list[str]) -> Run:
    """Make a run of samples: q, v, error, sigma, pose, target, (N+1, ...) each."""
    n = len(arrays["q"]) - 1
    record = TaskRecord(robot.tool, "frame", robot.tool, units, arrays["error"], np.ones(n), arrays["sigma"],
                        arrays["pose"], arrays["target"])  # fmt: skip
    spent = 2e-5 * (1 + np.random.default_rng(3).exponential(0.2, n))
    meta = {"solver": "dls", "level": "velocity", "dt": dt, "robot_name": robot.name}
    return Run(meta=meta, time=dt * np.arange(n + 1), q=arrays["q"], v=arrays["v"], command=arrays["v"][:-1],
               status=["OPTIMAL"] * n, solve_time=spent, tasks=[record], robot=robot)  # fmt: skip


def planar_run(name: str = "planar", visuals: bool = True) -> Run:
    """Return a run of the planar 2R arm, its joints' names beginning with ``name``."""
    text = PLANAR.format(x=name.replace("&", "&amp;").replace("<", "&lt;").replace('"', "&quot;"))
    model = pin.buildModelFromXML(text)
    visual = pin.buildGeomFromUrdfString(model, text, pin.GeometryType.VISUAL) if visuals else pin.GeometryModel()
    q = pin.integrate(model, pin.neutral(model), np.array([0.4, 0.9]))
    return circle_run(robot_of(model, visual, "tip", name), q, 0.12, (0, 2), 1.0)


def panda_run() -> Run:
    """Return a run of the Panda, fingers locked, from the installed example-robot-data."""
    urdf = next(f for f in metadata.files("example-robot-data") or [] if f.match("panda_description/urdf/panda.urdf"))
    path = Path(str(urdf.locate())).resolve()
    share = path.parents[4]  # the folder that package://example-robot-data lies in
    full = pin.buildModelFromUrdf(str(path))
    visual = pin.buildGeomFromUrdf(full, str(path), pin.GeometryType.VISUAL, package_dirs=[str(share)])
    q = np.array([0.0, -0.4, 0.0, -2.1, 0.0, 1.75, 0.785, 0.02, 0.02])
    fingers = [full.getJointId(n) for n in full.names if "finger" in n]
    model, visual = pin.buildReducedModel(full, visual, fingers, q)
    return circle_run(robot_of(model, visual, "panda_hand_tcp", "panda"), q[:7], 0.1, (1, 2), 4.0)
