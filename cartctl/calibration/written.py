"""A calibration as people and programs read it: a few lines of text, and a dictionary for JSON."""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from cartctl.files import whole_file

if TYPE_CHECKING:
    from cartctl.calibration.result import Calibration


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
    return "\n".join(lines)


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
