"""The app itself: its verbs and ``--version``. Whatever is slow to import waits inside the verbs."""

from __future__ import annotations

from typing import Annotated

import typer

from cartctl import __version__
from cartctl.cli.bench import app as bench
from cartctl.cli.calibrate import calibrate
from cartctl.cli.cite import cite
from cartctl.cli.compare import compare
from cartctl.cli.doctor import doctor
from cartctl.cli.info import info
from cartctl.cli.plan import plan
from cartctl.cli.play import play
from cartctl.cli.track import track

_EXAMPLE = "Example:  cartctl track panda --open"


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"cartctl {__version__}")
        raise typer.Exit


app = typer.Typer(
    name="cartctl",
    no_args_is_help=True,
    pretty_exceptions_show_locals=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    epilog=_EXAMPLE,
)


@app.callback(epilog=_EXAMPLE)
def cartctl(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version and end.")
    ] = False,
) -> None:
    """Redundancy resolution for robots: from a URDF to a tracked path you can watch."""


app.command(
    epilog="Example:  cartctl track panda --path circle --radius 0.1 --open\n\n"
    "Example:  cartctl track my_robot.urdf --frame gripper --axes position --solver dls\n\n"
    "Example:  cartctl track ur5 --solver pinv --singularity damp"
)(track)
app.command(
    epilog="Example:  cartctl compare panda\n\n"
    "Example:  cartctl compare panda --solvers pinv,projected-gradient,extended-jacobian --laps 5 --open"
)(compare)
app.command(
    epilog="Example:  cartctl calibrate measured.csv --robot panda --parameters 'placements tool' --align --open\n\n"
    "Header, for example:  panda_joint1 (deg),...,panda_joint7 (deg),x (mm),y (mm),z (mm)"
)(calibrate)
app.add_typer(bench, name="bench", epilog="Example:  cartctl bench run --scenarios arms --workers 2")
app.command(
    epilog="Example:  cartctl plan panda --closed --free-start --open\n\n"
    "Example:  cartctl plan lwr --objective joint-speed --path polygon --samples 300"
)(plan)
app.command(epilog="Example:  cartctl play panda\n\nExample:  cartctl play my_robot.urdf --solver hqp --level torque")(
    play
)
app.command(epilog="Example:  cartctl info panda")(info)
app.command(epilog="Example:  cartctl cite sns >> paper.bib")(cite)
app.command(epilog="Example:  cartctl doctor")(doctor)
