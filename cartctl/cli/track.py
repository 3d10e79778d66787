"""``cartctl track``: from a URDF to a tracked path you can watch."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, cast

import typer

from cartctl.cli import choices, options
from cartctl.cli.console import Debug, busy, facts, out, progress, say, verb

if TYPE_CHECKING:
    from rich.table import Table

    from cartctl.motion.controller import Controller
    from cartctl.motion.run import Run

_SETTLE = 0.5  # s after the path's end
_SOFT_START = 0.5  # s in which the objective rises, so that the rates do not jump


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
    gain: options.Gain = 20.0,
    damping: options.Damping = None,
    objective: options.ObjectiveName = None,
    objective_gain: options.ObjectiveGain = None,
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
        import cartctl as cc
        from cartctl import checks
        from cartctl.cli import files, method, scores, shapes
        from cartctl.cli.hand import Hand

        how = method.make_solver(solver, damping)
        purpose = method.make_purpose(how, objective, objective_gain)
        machine = cc.load(
            robot, package_dirs=package_dir or (), root_joint=root_joint, home=choices.posture(home or ())
        )
        hand = Hand(machine, machine.tool if frame is None else frame)
        rows = hand.axes if axes is None else axes
        shape = shapes.Shape.fitting(hand, rows, path, plane, size, period, laps)
        target = shape.path(hand)
        task = cc.FrameTask(hand.frame, axes=rows, gain=gain, target=target)
        bounds = method.limit_options(how)
        controller = cc.Controller(
            machine, task, how, level, objective=purpose.objective, dt=dt, soft_start=_SOFT_START, **bounds
        )
        end = target.duration + _SETTLE if duration is None else checks.number("--duration", duration, low=dt)
        place = files.Files(out_dir, machine.name, path, how.name)
    found = "" if axes is not None or rows == "pose" else " (where this robot can move)"
    console = out()
    console.print(_plan(controller, f"{rows}{found}", f"{shape}, {end:g} s in all", purpose.words))
    if hand.is_singular(rows):
        advice = "start elsewhere with --home JOINT=VALUE, or damp with --solver dls"
        say("warning", f"home is singular for axes {rows}; {advice}", "bold yellow")
    run = _rollout(controller, end)
    if not len(run.time):
        raise typer.Exit(130)
    console.print()
    if len(run):
        measured = run.metrics()
        for table in scores.tables(measured, ascii_only=console.options.ascii_only):
            console.print(table, "")
        if remark := scores.strayed(measured, shape.size):
            say("warning", remark, "bold yellow")
    console.print(facts(place.write(run, csv=csv, parquet=parquet)))
    if run.interrupted:
        raise typer.Exit(130)
    if open_page:
        files.show(place.at(".html"))


def _plan(controller: Controller, axes: str, path: str, purpose: str) -> Table:
    """What is about to be done, defaults included."""
    robot, solver, task = controller.robot, controller.solver.name, controller.tasks[0]
    limits = "enforced" if controller.limits else f"not enforced: {solver} knows none; violations are counted"
    spare = max(robot.nv - len(task.units(robot)), 0)
    return facts([
        ("robot", f"{robot.name}, {robot.nv} degrees of freedom, {spare} redundant"),
        ("hand", f"{task.frame}, axes {axes}"),
        ("path", path),
        ("solver", f"{solver}, {controller.level.name} level, gain {task.gain:g} 1/s, step {1e3 * controller.dt:g} ms"),
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
