"""A calibration as people and programs read it: a few lines of text, and a dictionary for JSON."""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from cartctl.calibration.motions import Motion
from cartctl.files import whole_file

if TYPE_CHECKING:
    from cartctl.calibration.result import Calibration

WIDE = 4.0 * math.pi  # rad: no joint turns farther, but degrees look like this
FAR = 50.0  # m: no arm reaches farther, but millimetres look like this


def summary(result: Calibration) -> str:
    """The result in a few lines."""
    lines = [f"{len(result.data)} {result.kind} measurements, {len(result.names)} parameters, rank {result.rank}"]
    lines.append(f"{result.outcome} ({result.iterations} iterations)")
    for old, new in zip(result.errors(after=False), result.errors(), strict=True):
        lines.append(f"RMS {old.rms:.4g} -> {new.rms:.4g} {old.unit}, largest {old.largest:.4g} -> {new.largest:.4g}")
    if len(result.outliers):
        rest = ", ..." if len(result.outliers) > 12 else ""
        numbers = ", ".join(map(str, result.outliers[:12])) + rest
        lines.append(f"outliers: {len(result.outliers)} of {len(result.data)}, measurements {numbers} (from 0)")
    lines += [str(one) for one in result.unidentifiable]
    if result.rank_after > result.rank:
        more = result.rank_after - result.rank
        lines.append(f"at the estimate {more} more would be seen, weakly: calibrate its chain again to use them")
    return "\n".join([*lines, *suspicions(result)])


def suspicions(result: Calibration) -> list[str]:
    """What looks like degrees, millimetres or too few measurements, a line each."""
    found = []
    if result.spare <= 0:
        count = f"{result.residuals.size} numbers were measured for {result.rank} unknowns"
        found.append(f"{count}: they fit whatever they are, and nothing checks them; measure more")
    turning = [m.joint for m in result.nominal.product.steps if isinstance(m, Motion) and m.joint >= 0 and m.turns]
    widest = float(np.abs(result.q[:, turning]).max(initial=0.0))
    if widest > WIDE:
        found.append(f"q reaches {widest:.4g} rad; if these are degrees, convert them by np.radians")
    entry = max(
        (abs(result.nominal.value(n)) for n in result.nominal.names if n[:5] in ("alpha", "theta")), default=0.0
    )
    if entry > WIDE:
        found.append(f"the table has an angle of {entry:.4g} rad; if these are degrees, convert them by np.radians")
    far = max(float(np.abs(result.data.position).max()), float(result.data.length.max()))
    if far > FAR:
        found.append(f"the measurements reach {far:.4g} m; if these are millimetres, divide them by 1000")
    return found


def facts(result: Calibration) -> dict[str, Any]:
    """Everything in numbers; what is infinite is None."""
    interval = result.interval()
    parameters = [
        {
            "name": name,
            "unit": unit,
            "nominal": old,
            "estimate": new,
            "delta": float(result.delta[k]),
            "deviation": _finite(s),
            "interval95": [_finite(x) for x in interval[k]],
            "determined": bool(result.determined[k]),
        }
        for k, (name, unit, old, new, s) in enumerate(result.table())
    ]
    covariance = result.covariance
    return {
        "chain": result.nominal.name,
        "kind": result.kind,
        "measurements": len(result.data),
        "loss": result.loss,
        "outcome": result.outcome.name,
        "iterations": result.iterations,
        "rank": result.rank,
        "rank_after": result.rank_after,
        "condition": result.condition,
        "noise": result.noise,
        "noise_given": result.noise_known,
        "before": [dict(e._asdict()) for e in result.errors(after=False)],
        "after": [dict(e._asdict()) for e in result.errors()],
        "outliers": result.outliers.tolist(),
        "parameters": parameters,
        "covariance": covariance.tolist() if np.isfinite(covariance).all() else None,
        "independent": list(result.independent),
        "unidentifiable": [dict(zip(one.parameters, one.direction, strict=True)) for one in result.unidentifiable],
        **{end: getattr(result.chain, end).tolist() for end in ("base", "tool")},
    }


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def save(path: str | os.PathLike[str], text: str) -> Path:
    """Write ``text`` to a file, whole or not at all; raises ParameterError, FileError."""
    with whole_file(path) as part:
        part.write_text(text, encoding="utf-8", newline="\n")
    return Path(path)
