"""``cartctl plan``: the best joint path for a whole path of the hand, beside what local methods make of it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import typer

from cartctl.cli import options
from cartctl.cli.choices import PLAN_OBJECTIVES, choice
from cartctl.cli.console import Debug, busy, columns, facts, number, out, progress, say, verb

if TYPE_CHECKING:
    from rich.table import Table

    from cartctl.wholepath import LocalMethod, Plan, PlanReport


@verb
def plan(
    robot: options.RobotName,
    home: options.Home = None,
    frame: options.Frame = None,
    axes: options.Axes = None,
    package_dir: options.PackageDirs = None,
    root_joint: options.RootJoint = None,
    path: options.PathKind = "circle",
    size: options.Size = None,
    plane: options.Plane = None,
    period: options.Period = 4.0,
    laps: options.Laps = 1,
    objective: options.Cost = "kinetic-energy",
    samples: options.Samples = 200,
    closed: options.Closed = False,
    free_start: options.FreeStart = False,
    no_limits: options.Unlimited = False,
    out_dir: options.OutDir = Path("out"),
    csv: options.Csv = False,
    parquet: options.Parquet = False,
    open_page: options.Open = False,
    debug: Debug = False,
) -> None:
    """Plan the whole joint path of least cost, with the task met and the limits kept at every sample."""
    choice("objective", objective, PLAN_OBJECTIVES)
    with busy(f"loading {robot}"):
        from cartctl.cli import files, scores
        from cartctl.cli.course import Course, Pace, Place, Way

        course = Course(
            Place(robot, package_dir, root_joint, home, frame, axes),
            Way(path, plane, size, period, laps),
            Pace("velocity", None, 20.0, 1e-3, None),
        )
        place = files.Files(out_dir, course.robot.name, path, f"plan-{objective}")
    console = out()
    ends = ("free" if free_start else "at home") + (", closed" if closed else "")
    limits = "not asked for" if no_limits else "position, velocity, acceleration"
    console.print(
        facts([
            *course.facts()[:2],
            ("path", str(course.shape)),
            ("objective", objective),
            ("joint path", f"{samples} samples, start {ends}"),
            ("limits", limits),
        ])
    )  # fmt: skip
    course.warn()
    done = _planned(course, objective, samples, closed, free_start, no_limits)
    console.print()
    console.print(_costs(done.report), "")
    for table in scores.tables(done.metrics(), ascii_only=console.options.ascii_only):
        console.print(table, "")
    report = done.report
    console.print(facts([("plan", report.message), *_figures(report)]), "")
    written = place.write(done, csv=csv, parquet=parquet)
    picture = place.at("-report.png")
    with busy(f"writing {picture}"):
        report.plot(picture)
    console.print(facts([*written, (str(picture), "how the search converged, costs and drifts")]))
    if not report.feasible:
        say("no plan", report.message, "bold red")
        raise typer.Exit(1)
    if open_page:
        files.show(place.at(".html"))


def _planned(course: object, objective: str, samples: int, closed: bool, free: bool, unlimited: bool) -> Plan:
    """The plan, a bar showing what is being done; what cannot be done is said once, at the end."""
    import warnings

    import cartctl as cc
    from cartctl.cli.course import Course

    assert isinstance(course, Course)
    count = 0
    with progress("planning") as tell, warnings.catch_warnings():
        warnings.simplefilter("ignore", cc.CartctlWarning)

        def told(words: str) -> None:
            nonlocal count
            count += 1
            tell(count, max(count + 1, 20), words)

        return cc.plan(
            course.robot,
            course.task,
            duration=course.task.target.duration,
            samples=samples,
            objective=objective,
            limits=None if unlimited else course.robot.limits,
            closed=closed,
            q0=None if free else course.robot.home,
            progress=told,
        )


def _costs(report: PlanReport) -> Table:
    """The plan's cost and that of each local method."""
    table = columns("joint path", "cost", "of plan's", "drift a lap", "")
    table.add_row(
        "plan", number(report.cost), "100 %", _or_dash(report.drift), "" if report.feasible else "not feasible"
    )
    for method in report.local:
        share = f"{100.0 * method.cost / report.cost:.4g} %" if report.cost > 0.0 else "-"
        table.add_row(method.name, number(method.cost), share, _or_dash(method.drift), _trouble(method))
    return table


def _trouble(method: LocalMethod) -> str:
    if not method.on_task:
        return f"off task by {number(method.residual)}"
    return "" if method.keeps else "beyond limits"


def _or_dash(value: float | None) -> str:
    return "-" if value is None else number(value)


def _figures(report: PlanReport) -> list[tuple[str, str]]:
    gap, best = report.gap, report.best
    rows = []
    if gap is not None and best is not None:
        word = "below" if gap >= 0.0 else "above"
        rows.append(
            ("gap", f"{number(abs(100.0 * gap))} % {word} {best.name}, the best local method within the limits")
        )
    for unit, size, wide in zip(("m", "rad"), report.residual, report.between, strict=True):
        if size is not None and wide is not None:
            rows.append((f"task error, {unit}", f"{number(size)} at samples, at most {number(wide)} between them"))
    rows.append(("search", f"{report.iterations} iterations, {report.qps} programmes by OSQP, {report.seconds:.2f} s"))
    return rows
