"""``cartctl cite``: what to cite for a method."""

from __future__ import annotations

from typing import Annotated

import typer

from cartctl.cli.console import Debug, verb


@verb
def cite(
    solvers: Annotated[
        list[str] | None,
        typer.Argument(metavar="SOLVER", help="Names of solvers; cartctl itself if none is given."),
    ] = None,
    debug: Debug = False,
) -> None:
    """Print BibTeX of what the solvers rest on, ready for `>> paper.bib`."""
    import cartctl as cc

    typer.echo(cc.cite(*solvers or ()))
