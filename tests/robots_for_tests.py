"""The robots whose derivatives are checked: planar, an arm, an arm with continuous joints, a floating humanoid."""

from __future__ import annotations

from functools import cache

import numpy as np

import cartctl as cc


@cache
def planar() -> cc.Robot:
    return cc.planar([1.0, 0.7, 0.4], gravity=(0.0, -9.81, 0.0))


@cache
def panda() -> cc.Robot:
    return cc.load("panda")


@cache
def kinova() -> cc.Robot:
    return cc.load("kinova")


@cache
def talos() -> cc.Robot:
    return cc.load("talos", root_joint="free_flyer")


@cache
def pendulum() -> cc.Robot:
    return cc.planar([0.8], gravity=(0.0, -9.81, 0.0))


ROBOTS = {"pendulum": pendulum, "planar": planar, "panda": panda, "kinova": kinova, "talos": talos}


def random_state(robot: cc.Robot, rng: np.random.Generator) -> cc.State:
    """A configuration anywhere, velocities of the order of 1."""
    return robot.state(robot.random_configuration(rng), rng.normal(size=robot.nv))


def along(robot: cc.Robot, state: cc.State, displacement: np.ndarray) -> cc.State:
    """The same velocity, a little further."""
    return robot.state(robot.integrate(state.q, displacement), state.v)
