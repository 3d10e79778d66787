"""A calibration as one self-contained HTML page: errors, estimates, what could not be told apart, and the figure."""

from __future__ import annotations

import base64
import math
import os
from collections.abc import Iterable
from html import escape
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

from cartctl.files import whole_file
from cartctl.report.calibration_figure import plot_calibration
from cartctl.report.numbers import number

if TYPE_CHECKING:
    from cartctl.calibration.result import Calibration, Errors

_POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:"
_STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; color: #1d2329; max-width: 1120px; margin: 2rem auto; padding: 0 1rem; }
h1 { font-size: 1.5rem; margin: 0; } h2 { font-size: 1.1rem; margin: 2rem 0 .4rem; } p { margin: .3rem 0; }
.soft { color: #59636e; } .warn { color: #7a1f1f; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
th, td { padding: .2rem .9rem .2rem 0; text-align: right; border-bottom: 1px solid #e4e8ec; white-space: nowrap; }
th { font-weight: 600; } th:first-child, td:first-child { text-align: left; }
.scroll { overflow-x: auto; } img { width: 100%; height: auto; } li { overflow-wrap: anywhere; }
"""
_UNITS = {"m": (1e3, "mm"), "rad": (1e3, "mrad")}


def write_calibration_html(
    result: Calibration, path: str | os.PathLike[str], validation: Iterable[Errors] = ()
) -> Path:
    """Write ``result`` to ``path`` as one HTML file and return its path; missing folders are made.

    validation: errors of a cross-validation, shown beside the others. The file appears only when it is complete. Raises
    ParameterError if ``path`` is a folder.
    """
    text = calibration_page(result, validation)
    with whole_file(path) as part:
        part.write_text(text, encoding="utf-8", newline="\n")
    return Path(path)


def calibration_page(result: Calibration, validation: Iterable[Errors] = ()) -> str:
    """Return the page as text."""
    name = escape(result.nominal.name)
    count = f"{len(result.data)} {result.kind} measurements, {len(result.names)} parameters, rank {result.rank}"
    healthy = result.outcome.name in ("CONVERGED", "AGREES")
    outcome = f'<p class="{"soft" if healthy else "warn"}">{escape(str(result.outcome))}'
    outcome += f" ({result.iterations} iterations, loss {escape(result.loss)})</p>"
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}">'
        '<meta name="viewport" content="width=device-width, initial-scale=1"><link rel="icon" href="data:,">'
        f"<title>{name}: calibration</title><style>{_STYLE}</style></head><body>\n"
        f"<h1>{name}: calibration</h1><p>{count}</p>{outcome}\n"
        f"<h2>Errors</h2>{_errors(result, list(validation))}\n"
        f'<p><img alt="Errors of every measurement, estimates, singular values" src="{_picture(result)}"></p>\n'
        f"{_unseen(result)}<h2>Estimates</h2>{_estimates(result)}\n</body></html>\n"
    )


def _errors(result: Calibration, validation: list[Errors]) -> str:
    head = ["", "RMS nominal", "RMS calibrated", *["RMS cross-validated"] * bool(validation)]
    head += ["largest nominal", "largest calibrated", "standard deviation"]
    rows = []
    for k, (old, new) in enumerate(zip(result.errors(after=False), result.errors(), strict=True)):
        factor, unit = _UNITS[new.unit]
        known = "given" if result.noise_known else "estimated"
        cells = [old.rms, new.rms, *(e.rms for e in validation[k : k + 1]), old.largest, new.largest]
        texts = [f"{number(factor * x)} {unit}" for x in cells]
        rows.append(
            [{"m": "position", "rad": "orientation"}[new.unit] if result.kind != "distance" else "distance", *texts]
            + [f"{number(factor * result.noise[new.unit])} {unit} ({known})"]
        )
        if len(result.outliers):
            old, new = (result.errors(after, outliers=False)[k] for after in (False, True))
            rows.append(_without_outliers(old, new, bool(validation), (factor, unit)))
    wild = ""
    if len(result.outliers):
        shown = ", ".join(map(str, result.outliers[:40])) + (", ..." if len(result.outliers) > 40 else "")
        wild = f'<p class="warn">{len(result.outliers)} outliers, counted from 0: {shown}</p>'
    return _table(head, rows) + wild


def _without_outliers(old: Errors, new: Errors, validated: bool, scale: tuple[float, str]) -> list[str]:
    """The row of the measurements that are no outliers."""
    factor, unit = scale
    cells = [old.rms, new.rms, *[math.nan] * validated, old.largest, new.largest]
    return ["without outliers", *(f"{number(factor * x)} {unit}" if math.isfinite(x) else "" for x in cells), ""]


def _unseen(result: Calibration) -> str:
    if not result.unidentifiable:
        return ""
    entries = "".join(f"<li>{escape(str(one))}</li>" for one in result.unidentifiable)
    words = "The measurements do not see these changes (m, rad); the estimate stays nominal along them."
    advice = f"Enough to fit as well: {', '.join(result.independent)}."
    return f'<h2>Not identifiable</h2><p class="soft">{words}</p><ul>{entries}</ul><p>{escape(advice)}</p>\n'


def _estimates(result: Calibration) -> str:
    rows = []
    for (name, unit, old, new, deviation), delta in zip(result.table(), result.delta.tolist(), strict=True):
        factor, shown = _UNITS[unit]
        spread = f"{number(factor * deviation)} {shown}" if math.isfinite(deviation) else "not determined by itself"
        rows.append([name, f"{old:.6f} {unit}", f"{new:.6f} {unit}", f"{factor * delta:+.4f} {shown}", spread])
    return _table(["parameter", "nominal", "estimate", "change", "standard deviation"], rows)


def _table(head: list[str], rows: list[list[str]]) -> str:
    top = "".join(f"<th>{escape(cell)}</th>" for cell in head)
    body = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows)
    return f'<div class="scroll"><table><thead><tr>{top}</tr></thead><tbody>{body}</tbody></table></div>'


def _picture(result: Calibration) -> str:
    buffer = BytesIO()
    plot_calibration(result).savefig(buffer, format="png", dpi=130)
    return "data:image/png;base64," + base64.b64encode(buffer.getvalue()).decode("ascii")
