"""The jobs of the race: what everybody is told, as arrays."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

import cartctl as cc
from cartctl.compiled.tree import tree_of

NEAR, ALIGNED = 1e-4, 1e-3  # m, rad: how close a pose has to be found


def ik_job(count: int) -> dict[str, np.ndarray]:
    """Poses of random configurations inside the limits, and the chain to them."""
    robot, rng = cc.load("panda"), np.random.default_rng(2)
    low, high = robot.limits.position_lower, robot.limits.position_upper
    targets = [robot.state(q).placement(robot.tool).homogeneous for q in rng.uniform(low, high, (count, robot.nv))]
    tree = tree_of(robot)
    places = [matrix(row[3:]) for row in tree.joints]
    return {
        "targets": np.array(targets),
        "limits": np.array([low, high]),
        "places": np.array(places),
        "tool": matrix(tree.frame(robot.tool)[1:]),
        "tolerance": np.array(0.5 * NEAR**2),
    }


def matrix(packed: np.ndarray) -> np.ndarray:
    """(4, 4) of a rotation row by row and an origin."""
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = packed[:9].reshape(3, 3), packed[9:]
    return T


def track_job(copies: int) -> dict[str, np.ndarray]:
    """The path's samples, the URDF without its meshes, and what everybody's tasks are told."""
    robot, dt = cc.load("panda"), 1e-3
    start = robot.state(robot.home).placement(robot.tool)
    circle = cc.Circle.starting_at(start, 0.1, period=4.0)
    samples = [circle(k * dt) for k in range(4001)]
    return {
        "urdf": np.array(bare_urdf(robot)),
        "frame": np.array(robot.tool),
        "joints": np.array(robot.joint_names),
        "speeds": np.array(robot.limits.velocity_upper),
        "home": np.array(robot.home),
        "rotation": np.array(start.rotation),
        "positions": np.array([s.position for s in samples]),
        "twists": np.array([s.twist for s in samples]),
        "accelerations": np.array([s.acceleration for s in samples]),
        "dt": np.array(dt),
        "gain": np.array(20.0),
        "posture_gain": np.array(1.0),
        "copies": np.array(copies),
    }


def bare_urdf(robot: cc.Robot) -> str:
    """The robot's kinematics and limits as URDF text, joints about z and no meshes: the same for every peer."""
    tree, links, joints = tree_of(robot), ['<link name="base"/>'], []
    limits = robot.limits
    for i, row in enumerate(tree.joints):
        parent = "base" if row[0] < 0 else f"l{int(row[0])}"
        links.append(link(f"l{i}"))
        low, high, speed = limits.position_lower[i], limits.position_upper[i], limits.velocity_upper[i]
        joints.append(
            f'<joint name="{robot.joint_names[i]}" type="revolute"><parent link="{parent}"/><child link="l{i}"/>'
            f'{origin(row[3:])}<axis xyz="0 0 1"/>'
            f'<limit lower="{low}" upper="{high}" velocity="{speed}" effort="87"/></joint>'
        )
    tool = tree.frame(robot.tool)
    links.append(link(robot.tool))
    joints.append(
        f'<joint name="to tool" type="fixed"><parent link="l{int(tool[0])}"/><child link="{robot.tool}"/>'
        f"{origin(tool[1:])}</joint>"
    )
    return f'<?xml version="1.0"?><robot name="panda">{"".join(links + joints)}</robot>'


def link(name: str) -> str:
    """A link with a mass, which some readers insist on."""
    inertia = '<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/>'
    return f'<link name="{name}"><inertial><mass value="1"/>{inertia}</inertial></link>'


def origin(packed: np.ndarray) -> str:
    """Position and roll, pitch, yaw."""
    rpy = pin.rpy.matrixToRpy(packed[:9].reshape(3, 3))
    return f'<origin xyz="{" ".join(map(repr, packed[9:].tolist()))}" rpy="{" ".join(map(repr, rpy.tolist()))}"/>'
