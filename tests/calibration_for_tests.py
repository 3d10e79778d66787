"""Chains of published robots, and measurements of chains whose errors are known."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

import cartctl as cc
from cartctl.calibration import Chain, RobotChain

HALF = np.pi / 2
TOOL = np.array([[1, 0, 0, 0.08], [0, 1, 0, -0.05], [0, 0, 1, 0.12], [0, 0, 0, 1]])  # off every axis of a wrist


@cache
def panda() -> cc.DHChain:
    """Franka Emika Panda to its flange, the manufacturer's modified table."""
    return cc.DHChain(
        a=[0, 0, 0, 0.0825, -0.0825, 0, 0.088],
        alpha=[0, -HALF, HALF, HALF, -HALF, HALF, HALF],
        d=[0.333, 0, 0.316, 0, 0.384, 0, 0],
        convention="modified",
        tool=np.array([[1, 0, 0, 0.01], [0, 1, 0, 0.02], [0, 0, 1, 0.107], [0, 0, 0, 1]]),
        name="panda",
    )


@cache
def puma() -> cc.DHChain:
    """Puma 560, the standard table of the Robotics Toolbox (Corke 1996)."""
    return cc.DHChain(
        a=[0, 0.4318, 0.0203, 0, 0, 0],
        alpha=[HALF, 0, -HALF, HALF, -HALF, 0],
        d=[0.67183, 0, 0.15005, 0.4318, 0, 0],
        name="puma560",
    )


@cache
def hayati() -> cc.DHChain:
    """The Puma with beta in place of d between its parallel axes 2 and 3."""
    return replace(puma(), tool=TOOL).with_hayati()


@cache
def lwr() -> RobotChain:
    """KUKA LWR 4, six placement parameters a joint."""
    return RobotChain(cc.load("lwr"))


@cache
def scara() -> cc.DHChain:
    """Two parallel revolute axes, a slide along them, a turn: where d is not seen and alpha is delicate."""
    return cc.DHChain(a=[0.4, 0.3, 0.0, 0.0], alpha=[0, 0, 0, 0], d=[0.2, 0, 0, -0.1], joints="RRPR", name="scara")


def spread(chain: Chain, count: int, rng: np.random.Generator) -> np.ndarray:
    """Configurations anywhere within +-2.5 rad."""
    return rng.uniform(-2.5, 2.5, (count, chain.n))


def planted(chain: Chain, parameters, rng: np.random.Generator, m: float = 1e-3, rad: float = np.radians(0.5)):
    """Errors up to 1 mm and 0.5 deg, name -> m or rad."""
    names = chain.select(parameters)
    size = [rad if unit == "rad" else m for unit in chain.units(names)]
    return dict(zip(names, (np.array(size) * rng.uniform(-1, 1, len(names))).tolist(), strict=True))


class Measured(NamedTuple):
    q: np.ndarray
    poses: np.ndarray  # (N, 4, 4), with noise
    exact: np.ndarray  # (N, 4, 4)
    delta: np.ndarray  # (p,), the planted errors


def measure(
    chain: Chain, parameters, seed: int, count: int = 40, noise: tuple[float, float] = (1e-4, 2e-4), wild: int = 0
) -> Measured:
    """Noisy poses of the chain with planted errors; ``wild`` of them are 50 mm off."""
    rng = np.random.default_rng(seed)
    q = spread(chain, count, rng)
    errors = planted(chain, parameters, rng)
    exact = chain.changed(errors).poses(q)
    poses = exact.copy()
    poses[:, :3, 3] += noise[0] * rng.normal(size=(count, 3))
    poses[:, :3, :3] = Rotation.from_rotvec(noise[1] * rng.normal(size=(count, 3))).as_matrix() @ exact[:, :3, :3]
    poses[rng.choice(count, wild, replace=False), :3, 3] += 0.05 * rng.normal(size=(wild, 3))
    return Measured(q, poses, exact, np.array(list(errors.values())))
