"""How often the truth lies in the joint 95 % ellipsoid of a calibration: 200 seeded trials a row.

    python benchmarks/calibration_coverage.py            # print the table
    python benchmarks/calibration_coverage.py --save     # and write benchmarks/results/calibration_coverage.csv

The Panda's modified table, errors of up to 1 mm and 0.5 deg planted in every parameter, 40 poses with noise of 0.1 mm
and 0.2 mrad. "own gauge": the planted errors expressed in the directions of the estimate, as noise-free data lead to
them; "as planted": projected onto these directions, which is the same to first order only.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from harness import one_table
from scipy.spatial.transform import Rotation

import cartctl as cc

RESULTS = Path(__file__).parent / "results" / "calibration_coverage.csv"
TRIALS, COUNT, NOISE = 200, 40, (1e-4, 2e-4)
CASES = (
    ("table", None, "linear", 0),
    ("table", NOISE, "linear", 0),
    ("table base tool", None, "linear", 0),
    ("table base tool", NOISE, "linear", 0),
    ("table", None, "huber", 0),
    ("table", None, "huber", 4),
    ("table", None, "cauchy", 4),
    ("table", None, "tukey", 4),
    ("table", None, "linear", 4),
)


def trial(
    chain: cc.DHChain, seed: int, case: tuple[str, tuple[float, float] | None, str, int]
) -> tuple[bool, bool, float, int]:
    """In the ellipsoid in its own gauge, as planted; largest error of position left, m; rank."""
    parameters, noise, loss, wild = case
    rng = np.random.default_rng(seed)
    names = chain.select(parameters)
    sizes = np.array([1e-3 if unit == "m" else np.radians(0.5) for unit in chain.units(names)])
    delta = sizes * rng.uniform(-1, 1, len(names))
    q = rng.uniform(-2.5, 2.5, (COUNT, chain.n))
    exact = chain.changed(dict(zip(names, delta.tolist(), strict=True))).poses(q)
    poses = exact.copy()
    poses[:, :3, 3] += NOISE[0] * rng.normal(size=(COUNT, 3))
    turns = Rotation.from_rotvec(NOISE[1] * rng.normal(size=(COUNT, 3))).as_matrix()
    poses[:, :3, :3] = turns @ exact[:, :3, :3]
    poses[rng.choice(COUNT, wild, replace=False), :3, 3] += 0.05 * rng.normal(size=(wild, 3))
    found = cc.calibrate(chain, q, poses, parameters=parameters, noise=noise, loss=loss)
    truth = cc.calibrate(chain, q, exact, parameters=parameters).delta
    left = float(np.linalg.norm(found.chain.positions(q) - exact[:, :3, 3], axis=1).max())
    return found.contains(truth), found.contains(delta), left, found.rank


def rows() -> list[dict[str, str]]:
    """One case after the other."""
    half = np.pi / 2
    chain = cc.DHChain(
        a=[0, 0, 0, 0.0825, -0.0825, 0, 0.088],
        alpha=[0, -half, half, half, -half, half, half],
        d=[0.333, 0, 0.316, 0, 0.384, 0, 0],
        convention="modified",
        tool=np.array([[1, 0, 0, 0.01], [0, 1, 0, 0.02], [0, 0, 1, 0.107], [0, 0, 0, 1]]),
    )
    found = []
    for case in CASES:
        parameters, noise, loss, wild = case
        own, planted, left, ranks = zip(*(trial(chain, seed, case) for seed in range(TRIALS)), strict=True)
        found.append({
            "parameters": parameters, "rank": str(ranks[0]), "noise": "estimated" if noise is None else "given",
            "loss": loss, "outliers_of_40": str(wild), "trials": str(TRIALS),
            "own_gauge_percent": f"{100 * np.mean(own):.1f}", "as_planted_percent": f"{100 * np.mean(planted):.1f}",
            "worst_position_left_mm": f"{1e3 * np.median(left):.3f}",
        })  # fmt: skip
    return found


def main() -> None:
    """Measure, print and, if asked, save."""
    one_table(__doc__, RESULTS, "Truth in the 95 % ellipsoid", rows)


if __name__ == "__main__":
    main()
