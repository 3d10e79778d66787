"""A run in one figure: how well it tracked, what the joints did, how close it came to trouble."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from cartctl.errors import ParameterError
from cartctl.report import panels
from cartctl.report.axes import LEGEND
from cartctl.report.palette import GREY, NAMED, Pen, pens, plain

if TYPE_CHECKING:
    from cartctl.motion.run import Run


def plot_run(run: Run) -> Figure:
    """Return a figure of ``run``: errors, joint positions, rates, torques if it has any, singular values, step times.

    It belongs to no window and leaves matplotlib's global state alone. Raises ParameterError for a run without a
    sample.
    """
    if not len(run.time):
        raise ParameterError("the run holds no sample; expected one that was simulated for at least a step")
    units = [unit for unit in panels.MARKED if any(unit in record.units for record in run.tasks)]
    rows = _rows(len(units), run.torque is not None)
    figure = Figure(figsize=(11.0, 1.6 + 2.4 * len(rows)), layout="constrained")
    figure.suptitle(_title(run), fontsize=12, fontweight="bold", x=0.01, ha="left")
    joints = pens(run.robot.dof_names, panels.urgency(run))
    places: dict[str, Any] = figure.subplot_mosaic(rows, sharex=True)
    for k, unit in enumerate(units):
        panels.error(places[f"error {k}"], run, unit)
    panels.positions(places["positions"], run, joints)
    panels.rates(places["rates"], run, joints)
    if run.torque is not None:
        panels.torques(places["torques"], run, joints)
        places["torques"].tick_params(labelbottom=True)  # as wide as two: its ticks are not those of the row below
    panels.singular_values(places["singular values"], run)
    panels.step_time(places["step time"], run)
    for name in rows[-1]:
        places[name].set_xlabel("s")
    figure.align_ylabels()
    _legend(figure, run, joints)
    return figure


def _rows(errors: int, driven: bool) -> list[list[str]]:
    """Return the names of the panels, two a row; a panel without a neighbour has the row to itself."""
    names = [f"error {k}" for k in range(errors)]
    pairs = [names[k : k + 2] for k in range(0, errors, 2)]
    middle = [["positions", "rates"], *([["torques", "torques"]] if driven else [])]
    below = [*middle, ["singular values", "step time"]]
    return [pair * 2 if len(pair) == 1 else pair for pair in pairs] + below


def _title(run: Run) -> str:
    level = run.meta.get("level")
    parts = [run.robot.name, str(run.meta.get("solver", "")), f"{level} level" if level else ""]
    parts.append("interrupted" if run.interrupted else "")
    return "  ·  ".join(plain(p) for p in parts if p)


def _legend(figure: Figure, run: Run, joints: list[Pen]) -> None:
    """Put one legend of all joints below the panels that share it."""
    shown = [Line2D([], [], **pen.options()) for pen in joints if pen.label]
    if len(joints) > NAMED:
        rest = f"{len(joints) - len(shown)} others, farther from their limits"
        shown.append(Line2D([], [], color=GREY, linewidth=0.8, label=rest))
    longest = max((len(str(line.get_label())) for line in shown), default=0)
    room = max(150 // (longest + 8), 1)  # columns that fit side by side
    lines = -(-len(shown) // min(room, 7))
    figure.legend(handles=shown, loc="outside lower center", ncols=-(-len(shown) // max(lines, 1)), **LEGEND)
