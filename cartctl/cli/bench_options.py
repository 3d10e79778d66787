"""The options of ``cartctl bench``, with their help. Nothing here imports a robot."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from cartctl.cli.choices import completion, solver_names, words
from cartctl.errors import ParameterError


def _known_scenarios() -> dict[str, str]:
    from cartctl.bench.sets import SHIPPED, select

    return dict.fromkeys(["all", *SHIPPED], "set") | {s.name: s.summary for g in select(["all"]) for s in g.scenarios}


def _known_methods() -> dict[str, str]:
    from cartctl.bench.peers import peers

    return solver_names() | dict.fromkeys(peers(), "peer") | {"all": "all solvers", "peers": "all peers"}


Scenarios = Annotated[
    list[str] | None,
    typer.Option(
        "--scenarios", metavar="NAMES", autocompletion=completion(_known_scenarios),
        help="Sets, scenarios, patterns such as '*-circle', .toml files, or all; with commas or repeated. "
        "By default the set lectures.",
    ),
]  # fmt: skip
Solvers = Annotated[
    list[str] | None,
    typer.Option(
        "--solvers", metavar="NAMES", autocompletion=completion(_known_methods),
        help="Solvers and peers, with commas or repeated; all: every solver (the default), peers: every peer.",
    ),
]  # fmt: skip
Levels = Annotated[
    list[str] | None,
    typer.Option(
        "--levels", metavar="NAMES", autocompletion=words(("velocity", "acceleration", "torque")),
        help="velocity, acceleration, torque; by default those that each scenario names.",
    ),
]  # fmt: skip
Repeat = Annotated[int, typer.Option("--repeat", metavar="N", min=1, help="Runs of each; random starts differ.")]
Seed = Annotated[int, typer.Option("--seed", metavar="N", min=0, help="Of random starts.")]
Workers = Annotated[
    int,
    typer.Option("--workers", metavar="N", min=1, help="Processes on this machine; step times are truest with 1."),
]
Dask = Annotated[
    str | None,
    typer.Option("--dask", metavar="ADDRESS", help="Run on this Dask scheduler, such as tcp://host:8786."),
]
KeepSteps = Annotated[
    bool, typer.Option("--keep-steps", help="Keep every step of every run, as steps/<key>.npz for cc.Run.load.")
]
OutDir = Annotated[Path, typer.Option("--out", metavar="DIR", help="Where results are, and where they go on.")]
Place = Annotated[Path, typer.Argument(metavar="RESULTS", help="The folder of a bench, or a .parquet file of results.")]
Replays = Annotated[
    int, typer.Option("--replays", metavar="N", min=0, help="Pages with the moving robot, worst first.")
]
ReportDir = Annotated[
    Path | None, typer.Option("--out", metavar="DIR", help="Where the report goes; by default beside the results.")
]
Figures = Annotated[
    list[str] | None,
    typer.Option("--figures", metavar="NAMES", help="Columns of the results, with commas, such as rms_m,effort."),
]
PlotFile = Annotated[
    Path | None, typer.Option("--out", metavar="FILE", help=".png, .svg or .pdf; by default profiles.png beside them.")
]
Tolerance = Annotated[
    float, typer.Option("--tolerance", metavar="SHARE", min=0.0, help="How much worse a figure may be; 0.05 is 5 %.")
]
Times = Annotated[bool, typer.Option("--times", help="Watch the times of a step, too: only on one quiet machine.")]
AllowMissing = Annotated[bool, typer.Option("--allow-missing", help="Runs that are no longer there are no regression.")]
New = Annotated[Path, typer.Argument(metavar="NEW", help="The results that may have become worse: folder or .parquet.")]
Old = Annotated[Path, typer.Argument(metavar="OLD", help="The results they are held against: folder or .parquet.")]
Open = Annotated[bool, typer.Option("--open", help="Open the page in your browser.")]


def listed(option: str, given: Sequence[str] | None, default: Sequence[str]) -> list[str]:
    """Names, given with commas or apart; raises ParameterError where nothing is left."""
    if given is None:
        return list(default)
    names = [name.strip() for text in given for name in text.split(",") if name.strip()]
    if not names:
        raise ParameterError(f"{option} is {','.join(given)!r}; expected names with commas between them")
    return names
