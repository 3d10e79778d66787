"""``cartctl track``: from a URDF to a tracked path you can watch."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, cast

import typer

from cartctl.cli import options
from cartctl.cli.console import Debug, busy, facts, out, progress, say, verb

if TYPE_CHECKING:
    from rich.table import Table

    from cartctl.cli.course import Course
    from cartctl.motion.controller import Controller
    from cartctl.motion.run import Run


@verb
def track(
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
    solver: options.SolverName = "projected-gradient",
    level: options.LevelName = "velocity",
    metric: options.MetricName = None,
    gain: options.Gain = 20.0,
    damping: options.Damping = None,
    objective: options.ObjectiveName = None,
    objective_gain: options.ObjectiveGain = None,
    singularity: options.Singularity = None,
    dt: options.Step = 1e-3,
    duration: options.Duration = None,
    out_dir: options.OutDir = Path("out"),
    csv: options.Csv = False,
    parquet: options.Parquet = False,
    open_page: options.Open = False,
    debug: Debug = False,
) -> None:
    """Let a robot's hand follow a path: a table says how well it went, an HTML page shows it."""
    with busy(f"loading {robot}"):
        from cartctl.cli import files, method, scores
        from cartctl.cli.course import Course, Pace, Place, Way
        from cartctl.objectives.named import aimed

        how = method.make_solver(solver, damping)
        purpose = method.make_purpose(how, objective, objective_gain)
        course = Course(
            Place(robot, package_dir, root_joint, home, frame, axes),
            Way(path, plane, size, period, laps),
            Pace(level, metric, gain, dt, duration, singularity),
        )
        controller = course.controller(how, aimed(purpose.objective, course.hand.frame, course.axes))
        place = files.Files(out_dir, course.robot.name, path, how.name)
    console = out()
    idle = purpose.objective is not None and not course.spare
    words = f"{purpose.words}; no joint to spare, so it has no effect" if idle else purpose.words
    console.print(_plan(course, controller, words))
    course.warn()
    run = _rollout(controller, course.end)
    if not len(run.time):
        raise typer.Exit(130)
    console.print()
    if len(run):
        measured = run.metrics()
        for table in scores.tables(measured, ascii_only=console.options.ascii_only):
            console.print(table, "")
        if remark := scores.strayed(measured, course.shape.size):
            say("warning", remark, "bold yellow")
    console.print(facts(place.write(run, csv=csv, parquet=parquet)))
    if run.interrupted:
        raise typer.Exit(130)
    if open_page:
        files.show(place.at(".html"))


def _plan(course: Course, controller: Controller, purpose: str) -> Table:
    """What is about to be done, defaults included."""
    solver = controller.solver.name
    limits = "enforced" if controller.limits else f"not enforced: {solver} knows none; violations are counted"
    return facts([
        *course.facts(),
        ("solver", f"{solver}, {course.pace()}"),
        ("objective", purpose),
        ("limits", limits),
    ])  # fmt: skip


def _rollout(controller: Controller, duration: float) -> Run:
    """The run, whole or as far as Ctrl-C let it come."""
    from cartctl import RunInterrupted, simulate

    try:
        with progress("tracking") as tell:
            return simulate(controller, duration=duration, progress=tell)
    except RunInterrupted as stop:
        run = cast("Run", stop.run)
        at = (
            f"at {run.time[-1]:g} s of {duration:g} s; what there is follows"
            if len(run.time)
            else "before the first step"
        )
        say("interrupted", at, "bold yellow")
        return run
