"""The options of the verbs, with their help. Nothing here imports a robot."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cartctl.cli.choices import (
    METRICS,
    OBJECTIVES,
    PATHS,
    PLAN_OBJECTIVES,
    PLANES,
    SINGULARITIES,
    completion,
    robots,
    solver_names,
    words,
)

_HAND, _PATH, _METHOD, _RESULT = "The robot", "The path", "The method", "The result"

ROBOT = typer.Argument(
    metavar="ROBOT", help="A name from `cartctl info`, or a .urdf file.", autocompletion=completion(robots)
)
RobotName = Annotated[str, ROBOT]
PackageDirs = Annotated[
    list[Path] | None,
    typer.Option(
        "--package-dir",
        metavar="DIR",
        exists=True,
        file_okay=False,
        rich_help_panel=_HAND,
        help="Where package:// names and meshes lie; repeatable.",
    ),
]
RootJoint = Annotated[
    str | None,
    typer.Option(
        "--root-joint", metavar="KIND", rich_help_panel=_HAND, help="fixed, planar or free_flyer.",
        autocompletion=words(("fixed", "planar", "free_flyer")),
    ),
]  # fmt: skip
Home = Annotated[
    list[str] | None,
    typer.Option(
        "--home", metavar="JOINT=VALUE", rich_help_panel=_HAND, help="Where a joint starts, in rad or m; repeatable."
    ),
]
Frame = Annotated[
    str | None,
    typer.Option("--frame", metavar="NAME", rich_help_panel=_HAND, help="The frame that moves; by default the tool."),
]
Axes = Annotated[
    str | None,
    typer.Option(
        "--axes", metavar="AXES", rich_help_panel=_HAND,
        help="pose, position, orientation or letters such as xy or 'z rx ry'; by default all that the robot can move.",
    ),
]  # fmt: skip
PathKind = Annotated[
    str,
    typer.Option(
        "--path", metavar="KIND", rich_help_panel=_PATH, autocompletion=words(PATHS),
        help="circle, line (there and back), ellipse, lissajous (an eight) or polygon (a square).",
    ),
]  # fmt: skip
Size = Annotated[
    float | None,
    typer.Option(
        "--radius", "--size", metavar="M", rich_help_panel=_PATH, help="Half its width in m; by default one that fits."
    ),
]
Plane = Annotated[
    str | None,
    typer.Option(
        "--plane", metavar="PLANE", rich_help_panel=_PATH, autocompletion=words(PLANES),
        help="xy, xz or yz of the world (yx and so on: the other way round); by default one that fits.",
    ),
]  # fmt: skip
Period = Annotated[float, typer.Option("--period", metavar="S", rich_help_panel=_PATH, help="Time of a lap in s.")]
Laps = Annotated[int, typer.Option("--laps", metavar="N", rich_help_panel=_PATH, help="How many times round.")]
SolverName = Annotated[
    str,
    typer.Option(
        "--solver",
        metavar="NAME",
        rich_help_panel=_METHOD,
        help="A name from `cartctl info`.",
        autocompletion=completion(solver_names),
    ),
]
SolverNames = Annotated[
    list[str] | None,
    typer.Option(
        "--solvers", "--solver", metavar="A,B,C", rich_help_panel=_METHOD, autocompletion=completion(solver_names),
        help="Names from `cartctl info`, with commas or repeated, the first drawn solid; by default all.",
    ),
]  # fmt: skip
LevelName = Annotated[
    str,
    typer.Option(
        "--level", metavar="NAME", rich_help_panel=_METHOD, help="What is commanded: velocity, acceleration or torque.",
        autocompletion=words(("velocity", "acceleration", "torque")),
    ),
]  # fmt: skip
MetricName = Annotated[
    str | None,
    typer.Option(
        "--metric", metavar="NAME", rich_help_panel=_METHOD, autocompletion=words(METRICS),
        help="Of what the redundancy leaves open: identity, inertia, joint-limits; of torques, identity, "
        "inverse-inertia (the default there) or inverse-inertia-squared.",
    ),
]  # fmt: skip
Gain = Annotated[float, typer.Option("--gain", metavar="1/S", rich_help_panel=_METHOD, help="How fast errors decay.")]
Damping = Annotated[
    float | None,
    typer.Option("--damping", metavar="LAMBDA", rich_help_panel=_METHOD, help="Of a damped solver such as dls."),
]
ObjectiveName = Annotated[
    str | None,
    typer.Option(
        "--objective", metavar="NAME", rich_help_panel=_METHOD, autocompletion=words(OBJECTIVES),
        help=f"What the redundancy is for: {', '.join(OBJECTIVES)}; by default joint-range where the solver can.",
    ),
]  # fmt: skip
ObjectiveGain = Annotated[
    float | None,
    typer.Option(
        "--objective-gain",
        metavar="K",
        rich_help_panel=_METHOD,
        help="How strongly; by default 100 for joint-range, 10 for manipulability, the header says it.",
    ),
]  # fmt: skip
Singularity = Annotated[
    str | None,
    typer.Option(
        "--singularity", metavar="NAME", rich_help_panel=_METHOD, autocompletion=words(SINGULARITIES),
        help=f"What becomes of the task near a singularity: {', '.join(SINGULARITIES)}; by default the solver's own "
        "business. Example: --solver pinv --singularity damp",
    ),
]  # fmt: skip
Step = Annotated[float, typer.Option("--dt", metavar="S", rich_help_panel=_METHOD, help="Time step in s.")]
Duration = Annotated[
    float | None,
    typer.Option(
        "--duration", metavar="S", rich_help_panel=_METHOD, help="By default the path's own and 0.5 s to settle."
    ),
]
OutDir = Annotated[Path, typer.Option("--out", metavar="DIR", rich_help_panel=_RESULT, help="Folder for the files.")]
Csv = Annotated[bool, typer.Option("--csv", rich_help_panel=_RESULT, help="Write a .csv, too.")]
Parquet = Annotated[bool, typer.Option("--parquet", rich_help_panel=_RESULT, help="Write a .parquet, too.")]
Open = Annotated[bool, typer.Option("--open", rich_help_panel=_RESULT, help="Open the HTML page in a browser.")]
Cost = Annotated[
    str,
    typer.Option(
        "--objective", metavar="NAME", rich_help_panel=_METHOD, autocompletion=words(PLAN_OBJECTIVES),
        help=f"What is least over the whole path: {', '.join(PLAN_OBJECTIVES)}.",
    ),
]  # fmt: skip
Samples = Annotated[
    int, typer.Option("--samples", metavar="N", rich_help_panel=_METHOD, help="Configurations, both ends included.")
]
Closed = Annotated[bool, typer.Option("--closed", rich_help_panel=_METHOD, help="The joints end where they began.")]
FreeStart = Annotated[
    bool, typer.Option("--free-start", rich_help_panel=_METHOD, help="Start in the best posture instead of home.")
]
Port = Annotated[
    int | None,
    typer.Option(
        "--port", metavar="N", min=0, max=65535, rich_help_panel=_RESULT,
        help="Of the page, on this machine only; by default 8080 or the next one that is free.",
    ),
]  # fmt: skip
NoOpen = Annotated[bool, typer.Option("--no-open", rich_help_panel=_RESULT, help="Do not open a browser.")]
Stay = Annotated[bool, typer.Option("--stay", rich_help_panel=_RESULT, help="Go on when the last browser has closed.")]
Unlimited = Annotated[
    bool, typer.Option("--no-limits", rich_help_panel=_METHOD, help="Leave the joints' limits out of account.")
]
