"""``cartctl play``: a robot in the browser, its target dragged about."""

from __future__ import annotations

import webbrowser
from typing import TYPE_CHECKING

import typer

from cartctl.cli import options
from cartctl.cli.console import Debug, busy, facts, out, say, verb

if TYPE_CHECKING:
    from cartctl.cli.course import Place
    from cartctl.cli.method import Purpose
    from cartctl.motion.controller import Controller
    from cartctl.solvers import Solver

_SOFT_START = 0.5  # s in which the objective rises, at every change of the method


@verb
def play(
    robot: options.RobotName,
    home: options.Home = None,
    frame: options.Frame = None,
    axes: options.Axes = None,
    package_dir: options.PackageDirs = None,
    root_joint: options.RootJoint = None,
    solver: options.SolverName = "sns",
    level: options.LevelName = "velocity",
    metric: options.MetricName = None,
    gain: options.Gain = 10.0,
    damping: options.Damping = None,
    objective: options.ObjectiveName = None,
    objective_gain: options.ObjectiveGain = None,
    singularity: options.Singularity = None,
    dt: options.Step = 4e-3,
    port: options.Port = None,
    no_open: options.NoOpen = False,
    stay: options.Stay = False,
    debug: Debug = False,
) -> None:
    """Drag a robot's hand about in the browser, and change the method while it moves. Needs the extra `play`."""
    from cartctl.viewer.extra import viser

    viser()  # before anything that takes its time
    with busy(f"loading {robot}"):
        from cartctl import viewer
        from cartctl.cli.course import Place
        from cartctl.cli.method import make_purpose, make_solver

        how = make_solver(solver, damping)
        purpose = make_purpose(how, objective, objective_gain)
        place = Place(robot, package_dir, root_joint, home, frame, axes)
        controller = _controller(place, how, purpose, level, metric, gain, dt, singularity)
    try:
        viewer.play(
            controller, port=port, open_page=False, stay=stay, ready=lambda url: _tell(controller, url, no_open, stay)
        )
    except KeyboardInterrupt:
        say("stopped", "by Ctrl-C", "bold yellow")
        raise typer.Exit(130) from None
    say("stopped", "the page was closed", "bold yellow")


def _controller(
    place: Place,
    solver: Solver,
    purpose: Purpose,
    level: str,
    metric: str | None,
    gain: float,
    dt: float,
    singularity: str | None,
) -> Controller:
    import cartctl as cc
    from cartctl.cli.choices import SINGULARITIES, choice
    from cartctl.cli.method import limit_options, metric_of
    from cartctl.objectives.named import aimed

    if singularity is not None:
        choice("singularity", singularity, SINGULARITIES)
    hand = place.hand()
    axes = hand.axes if place.axes is None else place.axes
    task = cc.FrameTask(hand.frame, axes=axes, gain=gain)
    return cc.Controller(
        hand.robot, task, solver, level, objective=aimed(purpose.objective, hand.frame, axes),
        metric=metric_of(solver, level, metric), dt=dt, soft_start=_SOFT_START, singularity=singularity,
        **limit_options(solver, level),
    )  # fmt: skip


def _tell(controller: Controller, url: str, no_open: bool, stay: bool) -> None:
    """Where the page is, and how it ends."""
    robot, task = controller.robot, controller.tasks[0]
    console = out()
    end = "Ctrl-C ends it" if stay else "Ctrl-C, or closing the page, ends it"
    console.print(
        facts([
            ("robot", f"{robot.name}, {robot.nv} degrees of freedom"),
            ("hand", f"{task.frame}, steps of {1e3 * controller.dt:g} ms in real time"),
            ("page", f"{url}  ({end})"),
        ])
    )  # fmt: skip
    if not no_open and not webbrowser.open(url):
        say("warning", f"no browser found; open {url} yourself", "bold yellow")
