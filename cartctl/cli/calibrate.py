"""``cartctl calibrate``: from a CSV of measurements to a better URDF."""

from __future__ import annotations

import re
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cartctl.cli import options
from cartctl.cli.choices import completion, robots, words
from cartctl.cli.console import Debug, busy, columns, facts, number, out, say, verb
from cartctl.errors import ParameterError

if TYPE_CHECKING:
    from rich.table import Table

    from cartctl.calibration import Calibration, CrossValidation, MeasurementTable, RobotChain

_UNITS = {"m": (1e3, "mm"), "rad": (1e3, "mrad")}
FOLDS = 5
_SHOWN = 12  # parameters and unseen directions printed; the report has all

_ROBOT = typer.Option(
    "--robot",
    "-r",
    metavar="ROBOT",
    help="A name from `cartctl info`, or a .urdf file.",
    autocompletion=completion(robots),
)
_PARAMETERS = typer.Option(
    "--parameters", "-p", metavar="NAMES", help="What to estimate: placements, offsets, base, tool, names of joints, "
    "single ones such as 'joint2.x', patterns such as 'joint*.rz'; several in one go, with blanks.",
)  # fmt: skip
_NOISE = typer.Option(
    "--noise", metavar="M[,RAD]", help="Standard deviation of the measurements; by default estimated."
)
_LOSS = typer.Option(
    "--loss", metavar="NAME", help="linear, or against outliers huber, cauchy or tukey.",
    autocompletion=words(("linear", "huber", "cauchy", "tukey")),
)  # fmt: skip


@verb
def calibrate(
    measurements: Annotated[Path, typer.Argument(metavar="MEASUREMENTS.csv", help="One row a measurement; see below.")],
    robot: Annotated[str, _ROBOT],
    parameters: Annotated[str, _PARAMETERS] = "placements",
    frame: options.Frame = None,
    package_dir: options.PackageDirs = None,
    align: Annotated[
        bool, typer.Option("--align", help="The device's frame may be anywhere: find the base first, and estimate it.")
    ] = False,
    noise: Annotated[str | None, _NOISE] = None,
    loss: Annotated[str, _LOSS] = "linear",
    folds: Annotated[int, typer.Option("--folds", metavar="K", help="Cross-validate in K parts; 0 for not.")] = FOLDS,
    out_dir: options.OutDir = Path("out"),
    open_page: options.Open = False,
    debug: Debug = False,
) -> None:
    """Estimate a robot's kinematic parameters from measured poses, positions or distances of its hand.

    The header of the CSV names each joint and what was measured, with units in brackets if they are not rad and m:
    x y z (positions), with qx qy qz qw (poses), or distance, with ax ay az for its anchor. Writes a URDF, a JSON and an
    HTML report: all of them or none. Ends with 1 where the estimate did not converge.
    """
    import cartctl as cc
    from cartctl import calibration
    from cartctl.cli import files

    sigma = _numbers(noise)
    with busy(f"loading {robot}"):
        machine = cc.load(robot, package_dirs=package_dir or ())
        chain = calibration.RobotChain(machine, frame)
        table = calibration.read_table(measurements, machine, frame)
    if align:
        chain = calibration.aligned(chain, table.q, table.values, kind=table.kind)  # type: ignore[assignment]
        parameters += " base"
    console = out()
    console.print(_plan(chain, table, measurements, parameters))
    place = files.Files(
        out_dir, chain.name, "calibrated"
    )  # before the work: a folder that cannot be had is no surprise
    given = {"kind": table.kind, "anchor": table.anchor, "parameters": parameters, "noise": sigma, "loss": loss}
    with busy("calibrating"):
        result = cc.calibrate(chain, table.q, table.values, **given)  # type: ignore[arg-type]
        check = None
        if folds and (folds != FOLDS or len(table) >= FOLDS):  # by default only where there are enough
            check = calibration.cross_validate(chain, table.q, table.values, folds=folds, **given)  # type: ignore[arg-type]
    console.print("", _errors(result, check), "")
    _remarks(result)
    console.print(_estimates(result), "")
    console.print(facts(_written(result, check, place)))
    console.print(facts([("load it by", _load(result.chain, place.at(".urdf")))]))
    if open_page:
        files.show(place.at(".html"))
    if not _healthy(result):
        raise typer.Exit(1)


def _numbers(text: str | None) -> list[float] | None:
    if text is None:
        return None
    try:
        return [float(part) for part in re.split(r"[\s,]+", text.strip())]
    except ValueError:
        raise ParameterError(f"--noise is {text!r}; expected M or M,RAD, such as 1e-4,5e-4") from None


def _plan(chain: RobotChain, table: MeasurementTable, path: Path, parameters: str) -> Table:
    names = chain.select(parameters)
    return facts([
        ("robot", f"{chain.name}, {chain.n} joints to {chain.frame}"),
        ("measured", f"{len(table)} {table.kind}{'s' * (len(table) > 1)} in {path}"),
        ("parameters", f"{len(names)}: {' '.join(parameters.split())}"),
    ])  # fmt: skip


def _errors(result: Calibration, check: CrossValidation | None) -> Table:
    """Before and after, and as predicted without having been seen."""
    table = columns("error", "before", "after", *["cross-validated"] * (check is not None))
    for k, (old, new) in enumerate(zip(result.errors(after=False), result.errors(), strict=True)):
        factor, unit = _UNITS[new.unit]
        name = {"m": "position", "rad": "orientation"}[new.unit] if result.kind != "distance" else "distance"
        for what, field in (("RMS", "rms"), ("median", "median"), ("largest", "largest")):
            cells = [getattr(e, field) for e in (old, new, *([check.after[k]] if check else []))]
            table.add_row(f"{name} {what} ({unit})", *(number(factor * x) for x in cells))
        if len(result.outliers):
            cells = [result.errors(after, outliers=False)[k].rms for after in (False, True)]
            table.add_row("  without outliers, RMS", *(number(factor * x) for x in cells))
    return table


def _remarks(result: Calibration) -> None:
    """What a reader must not miss, on standard error."""
    from cartctl.calibration.written import suspicions

    if not _healthy(result):
        say("warning", f"{result.outcome}; the files hold what was reached", "bold yellow")
    if result.spare <= 0:
        say("warning", suspicions(result)[0], "bold yellow")
    if len(result.outliers):
        shown = ", ".join(str(k) for k in result.outliers[:_SHOWN]) + ", ..." * (len(result.outliers) > _SHOWN)
        advice = "" if result.loss != "linear" else "; --loss huber keeps them from pulling the estimate"
        say("warning", f"{len(result.outliers)} outliers, measurements {shown} (from 0){advice}", "bold yellow")
    for one in result.unidentifiable[:_SHOWN]:
        say("note", str(one), "bold")
    if (more := len(result.unidentifiable) - _SHOWN) > 0:
        say("note", f"{more} more combinations cannot be told apart; the report lists them", "bold")


def _healthy(result: Calibration) -> bool:
    return result.outcome.name in ("CONVERGED", "AGREES")


def _estimates(result: Calibration) -> Table:
    """The parameters that changed most, in standard deviations; all are in the files."""
    table = columns("parameter", "change", "+-95 %", "unit")
    half = 0.5 * (result.interval()[:, 1] - result.interval()[:, 0])
    order = sorted(range(len(result.names)), key=lambda k: -abs(float(result.delta[k])) / max(float(half[k]), 1e-15))
    for k in order[:_SHOWN]:
        factor, unit = _UNITS[result.units[k]]
        spread = number(factor * float(half[k])) if result.determined[k] else "not determined"
        table.add_row(result.names[k], number(factor * float(result.delta[k])), spread, unit)
    if len(order) > _SHOWN:
        table.add_row(f"... {len(order) - _SHOWN} more in the report", "", "", "")
    return table


def _written(result: Calibration, check: CrossValidation | None, place: object) -> list[tuple[str, str]]:
    """Write all files or none: each is complete before the first takes its name."""
    from cartctl.cli.files import Files
    from cartctl.files import whole_file
    from cartctl.report.calibration_page import calibration_page

    assert isinstance(place, Files)
    with busy("writing"):
        texts = {
            ".urdf": (result.urdf(), "the calibrated robot"),
            ".json": (result.to_json(), "estimates, covariance, errors"),
            ".html": (calibration_page(result, check.after if check else ()), "the report, for your browser"),
        }
        with ExitStack() as stack:
            for suffix, (text, _) in texts.items():
                part = stack.enter_context(whole_file(place.at(suffix)))
                part.write_text(text, encoding="utf-8", newline="\n")
    return [(str(place.at(suffix)), what) for suffix, (_, what) in texts.items()]


def _load(chain: object, path: Path) -> str:
    """The call that loads the result with its meshes and its frame."""
    from cartctl.calibration import RobotChain
    from cartctl.calibration.urdf import mesh_folders, tool_link

    assert isinstance(chain, RobotChain)
    folders = [str(folder) for folder in mesh_folders(chain)]
    return f"cc.load({str(path)!r}, tool={tool_link(chain)!r}" + (f", package_dirs={folders!r})" if folders else ")")
