"""``cartctl info``: which robots and solvers there are, and what is known of one robot."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from cartctl.cli import choices, options
from cartctl.cli.console import Debug, busy, columns, facts, number, out, verb
from cartctl.errors import ParameterError

if TYPE_CHECKING:
    from rich.table import Table

    from cartctl.model.robot import Robot

_SHORT = 8  # frames listed without --frames
_UNITS = "In rad, rad/s, rad/s^2, N m; prismatic joints in m, m/s, m/s^2, N; -: not known."


@verb
def info(
    robot: Annotated[str | None, options.ROBOT] = None,
    frames: Annotated[bool, typer.Option("--frames", help="List all frames, however many.")] = False,
    home: options.Home = None,
    frame: options.Frame = None,
    axes: options.Axes = None,
    package_dir: options.PackageDirs = None,
    root_joint: options.RootJoint = None,
    debug: Debug = False,
) -> None:
    """Show a robot's joints, limits and frames; without ROBOT, list the names of robots and solvers.

    Singular values, ranks and ellipsoids are those of the tool, or of --frame, at home, or where --home puts it.
    """
    import cartctl as cc

    if robot is None:
        _refuse_stray({"--home": home, "--frame": frame, "--axes": axes})
        for title, names in (("Robots", cc.robots()), ("Solvers", cc.solvers())):
            out().print(title, style="underline")
            out().print(facts(list(names.items())), "")
        out().print("More about a robot: cartctl info NAME. Any .urdf file will do as well.", style="dim")
        return
    with busy(f"loading {robot}"):
        posture = choices.posture(home or ())
        machine = cc.load(robot, package_dirs=package_dir or (), root_joint=root_joint, home=posture)
        head = _head(machine, frame, axes)
    out().print(head, "", _joints(machine))
    out().print(f"{_UNITS}\n", style="dim")
    out().print(facts([("frames", _frames(machine, frames)), *_sources(machine)]))


def _refuse_stray(given: dict[str, object]) -> None:
    """Options about a robot need one."""
    for name, value in given.items():
        if value is not None and value != []:
            raise ParameterError(f"{name} is given without a robot; expected `cartctl info ROBOT {name} ...`")


def _head(robot: Robot, frame: str | None, axes: str | None) -> Table:
    from cartctl.cli.abilities import abilities

    given = robot.spec or {}
    return facts([
        ("robot", " - ".join(filter(None, (robot.name, choices.robots().get(robot.name, ""))))),
        ("size", f"{robot.nv} degrees of freedom; q has {robot.nq} numbers; base {given.get('root_joint', 'fixed')}"),
        ("tool", robot.tool),
        *abilities(robot, frame, axes),
        ("gravity", f"{'  '.join(f'{g:g}' for g in robot.gravity)} m/s^2"),
    ])  # fmt: skip


def _joints(robot: Robot) -> Table:
    table = columns("joint", "type", "home", "lower", "upper", "rate", "accel.", "torque")
    table.columns[1].justify = "left"
    limits, home = robot.limits, robot.coordinates(robot.home)
    for i, name in enumerate(robot.dof_names):
        both = [
            (getattr(limits, f"{what}_lower")[i], getattr(limits, f"{what}_upper")[i])
            for what in ("velocity", "acceleration", "torque")
        ]
        lower, upper = limits.position_lower[i], limits.position_upper[i]
        table.add_row(name, _kind(robot, i), *map(number, (home[i], lower, upper)), *(_pair(*pair) for pair in both))
    return table


def _kind(robot: Robot, i: int) -> str:
    name = robot.dof_names[i]
    if name not in robot.single_joints:
        return "base"
    if robot.continuous[i]:
        return "continuous"
    return "prismatic" if robot.is_prismatic(name) else "revolute"


def _pair(lower: float, upper: float) -> str:
    """One figure for a symmetric limit."""
    return number(upper) if lower == -upper else f"{number(lower)}/{number(upper)}"


def _frames(robot: Robot, everything: bool) -> str:
    """All frames, or the tool and the last few: where a URDF's hands and sensors are."""
    names = [f"{name} (tool)" if name == robot.tool else name for name in robot.frame_names]
    if everything or len(names) <= _SHORT:
        return "\n".join(names)
    shown = [name for name in names if name.endswith("(tool)") or name in names[-_SHORT:]]
    return "\n".join([*shown, f"... and {len(names) - len(shown)} more: --frames"])


def _sources(robot: Robot) -> list[tuple[str, str]]:
    """Where the library has its figures from; nothing for a file."""
    from cartctl.errors import RobotNotFound
    from cartctl.model.library import find

    try:
        entry = find(robot.name) if robot.name == (robot.spec or {}).get("source") else None
    except RobotNotFound:
        return []
    return [] if entry is None else [(f"{what} from", text) for what, text in entry.sources.items()]
