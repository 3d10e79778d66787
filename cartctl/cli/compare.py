"""``cartctl compare``: several solvers on the same robot and path."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import typer

from cartctl.cli import options
from cartctl.cli.console import Debug, busy, facts, out, verb
from cartctl.errors import UnsupportedProblem

if TYPE_CHECKING:
    from rich.table import Table

    from cartctl.cli.contest import Contest
    from cartctl.cli.course import Course


@verb
def compare(
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
    solver: options.SolverNames = None,
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
    open_page: options.Open = False,
    debug: Debug = False,
) -> None:
    """Let several solvers follow the same path with the same robot: one table, one figure, one HTML page.

    A solver that knows no limits runs without them, and the table counts the violations; the objective goes to those
    that have a null-space term. One that refuses is named with its reason.
    """
    with busy(f"loading {robot}"):
        from cartctl.cli import files, method, standings
        from cartctl.cli.contest import Contest
        from cartctl.cli.course import Course, Pace, Place, Way

        goal = method.make_objective(objective, objective_gain)
        course = Course(
            Place(robot, package_dir, root_joint, home, frame, axes),
            Way(path, plane, size, period, laps),
            Pace(level, metric, gain, dt, duration, singularity),
        )
        contest = Contest(course, method.solver_list(solver or (), damping), goal)
        place = files.Files(out_dir, course.robot.name, path, "compare")
    console = out()
    console.print(_plan(course, contest))
    course.warn()
    done = contest.run(lambda name: place.sibling(name, ".npz"))
    if not contest.runs:
        if done:
            raise UnsupportedProblem("none of the solvers takes this problem; the reasons: " + contest.reasons())
        raise typer.Exit(130)
    comparison = contest.comparison()
    console.print()
    for table in standings.tables(comparison, console):
        console.print(table, "")
    written = place.write_comparison(comparison)
    console.print(facts([*written, (str(place.sibling("<solver>", ".npz")), "every step of each, for cc.Run.load")]))
    if not done:
        raise typer.Exit(130)
    if open_page:
        files.show(place.at(".html"))


def _plan(course: Course, contest: Contest) -> Table:
    """What is about to be done, defaults included."""
    return facts([
        *course.facts(),
        ("solvers", f"{contest.size}, {course.pace()}"),
        ("objective", contest.purpose()),
        ("limits", contest.limits()),
    ])  # fmt: skip
