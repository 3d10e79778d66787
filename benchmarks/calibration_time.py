"""How long a calibration takes with many measurements, and how its time is spent, against raw LAPACK in the same run.

    python benchmarks/calibration_time.py            # print the table
    python benchmarks/calibration_time.py --save     # and write benchmarks/results/calibration_time.csv

The Panda with errors of 1 mm and 0.5 deg planted in its parameters, noise of 0.1 mm and 0.2 mrad. The ratio is to one
QR factorisation of the stacked regressor of the same size: what a single least-squares step cannot do without.
"""

from __future__ import annotations

from pathlib import Path
from time import perf_counter

import numpy as np
from harness import one_table
from scipy.spatial.transform import Rotation

import cartctl as cc
from cartctl import calibration as cal

RESULTS = Path(__file__).parent / "results" / "calibration_time.csv"
ROUNDS = 3
CASES = (
    ("table", "table", "pose", "linear", 10_000),
    ("table, base, tool", "table base tool", "pose", "linear", 10_000),
    ("table, base, tool, huber, 10 % outliers", "table base tool", "pose", "huber", 10_000),
    ("table, base, tool", "table base tool", "position", "linear", 10_000),
    ("placements, base, tool of the URDF", "placements base tool", "pose", "linear", 10_000),
    ("table, base, tool", "table base tool", "pose", "linear", 40),
)


def measured(
    chain: cal.Chain, parameters: str, kind: str, count: int, wild: bool, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Configurations, and noisy poses or positions of a chain with planted errors."""
    names = chain.select(parameters)
    sizes = [1e-3 if unit == "m" else np.radians(0.5) for unit in chain.units(names)]
    errors = dict(zip(names, (np.array(sizes) * rng.uniform(-1, 1, len(names))).tolist(), strict=True))
    q = rng.uniform(-2.5, 2.5, (count, chain.n))
    T = chain.changed(errors).poses(q)
    T[:, :3, 3] += 1e-4 * rng.normal(size=(count, 3))
    T[:, :3, :3] = Rotation.from_rotvec(2e-4 * rng.normal(size=(count, 3))).as_matrix() @ T[:, :3, :3]
    if wild:
        T[: count // 10, :3, 3] += 0.05 * rng.normal(size=(count // 10, 3))
    return q, T if kind == "pose" else T[:, :3, 3]


def best(function: object, rounds: int = ROUNDS) -> float:
    """Seconds of the fastest of a few calls."""
    times = []
    for _ in range(rounds):
        start = perf_counter()
        function()  # type: ignore[operator]
        times.append(perf_counter() - start)
    return min(times)


def rows() -> list[dict[str, str]]:
    """One case after the other."""
    robot, rng, found = cc.load("panda"), np.random.default_rng(0), []
    own = cal.RobotChain(robot)
    table = cc.DHChain.of_robot(robot, convention="modified")
    for label, parameters, kind, loss, count in CASES:
        chain = own if "URDF" in label else table
        q, values = measured(chain, parameters, kind, count, "outliers" in label, rng)
        result = cc.calibrate(chain, q, values, parameters=parameters, kind=kind, loss=loss)
        H = np.asarray(rng.normal(size=(result.residuals.size, result.rank)))
        lapack = best(lambda H=H: np.linalg.qr(H, mode="r"))
        seconds = best(
            lambda chain=chain, q=q, values=values, parameters=parameters, kind=kind, loss=loss: cc.calibrate(
                chain, q, values, parameters=parameters, kind=kind, loss=loss
            )
        )
        found.append({
            "what": f"{label}: {kind}", "measurements": str(count), "parameters": str(len(result.names)),
            "rank": str(result.rank), "steps": str(result.iterations), "seconds": f"{seconds:.3f}",
            "ratio_to_one_QR": f"{seconds / lapack:.1f}",
            "rms_before_mm": f"{1e3 * result.errors(after=False)[0].rms:.3f}",
            "rms_after_mm": f"{1e3 * result.errors(outliers=False)[0].rms:.3f}", "outliers": str(len(result.outliers)),
        })  # fmt: skip
    return found


def main() -> None:
    """Measure, print and, if asked, save."""
    one_table(__doc__, RESULTS, "Calibration of the Panda", rows)


if __name__ == "__main__":
    main()
