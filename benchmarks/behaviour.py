"""Rest, recovery and limits: seven scenarios a user would complain about, rolled out on a Panda.

    python benchmarks/behaviour.py                                    # print the tables
    python benchmarks/behaviour.py --save                             # and write them, docs/behaviour.png
    python benchmarks/behaviour.py --solvers sns hqp --scenarios jump

8 s at dt = 10 ms each. Speeds and accelerations are per limit of the joint that is nearest to its own (data sheet);
flips are joint sign reversals in the last 2 s, of 1393 possible (on the circle, which never rests, they mean nothing),
reversals those of all 8 s: where a scale is the largest possible at every instant, joints jump from one corner of their
bounds to another on the way, unless accelerations are limited. Gain 20 1/s; 60 on the circle, where the target's
acceleration a leaves about a dt/(2 k) between hand and path: 2.0 mm at 20, 0.8 mm at 60. ``sing_over`` runs without
path clock: a path that leaves the workspace would wait at the edge for ever.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

from behaviour_figures import Figures
from behaviour_plot import draw
from behaviour_runs import SCENARIOS, figures_of, run
from harness import save_rows, setting
from rich.console import Console
from rich.table import Table

RESULTS = Path(__file__).parent / "results" / "behaviour.csv"
PICTURE = Path(__file__).parent.parent / "docs" / "behaviour.png"
SOLVERS = ("sns", "hqp", "qp", "sns-greedy", "task-scaling", "dls")
_BOUNDED = ("velocity", "acceleration")
_ALONE = ("task-scaling", "dls")  # the posture would be stacked beside the hand, not below it


def plan(solvers: list[str]) -> Iterator[tuple[str, str, bool]]:
    """Solver, limits, posture of every row."""
    for solver in solvers:
        for limits in ("none", "clipped") if solver == "dls" else _BOUNDED:
            for posture in (False,) if solver in _ALONE else (False, True):
                yield solver, limits, posture


def row(scenario: str, solver: str, limits: str, posture: bool) -> dict[str, str]:
    """One rollout."""
    found: Figures = figures_of(run(scenario, solver, limits, posture))
    values = {k: v if isinstance(v, str) else f"{v:.3g}" for k, v in found.row().items()}
    return {"scenario": scenario, "solver": solver, "limits": limits, "posture": "yes" if posture else "", **values}


def show(console: Console, rows: list[dict[str, str]]) -> None:
    """One table a scenario."""
    keys = [key for key in rows[0] if key != "scenario"]
    table = Table(*(key.replace("_", " ") for key in keys), title=f"{rows[0]['scenario']}: {what(rows[0]['scenario'])}")
    for each in rows:
        table.add_row(*(each[key] for key in keys))
    console.print(table)


def what(scenario: str) -> str:
    """In words."""
    return str(SCENARIOS[scenario]["what"])


def main() -> None:
    """Run, print and, if asked, save."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--save", action="store_true", help=f"write {RESULTS.name} and {PICTURE.name}")
    parser.add_argument("--solvers", nargs="+", default=list(SOLVERS), choices=SOLVERS, metavar="NAME")
    parser.add_argument("--scenarios", nargs="+", default=list(SCENARIOS), choices=list(SCENARIOS), metavar="NAME")
    options = parser.parse_args()
    console, rows = Console(), []
    for scenario in options.scenarios:
        rows.append([row(scenario, *each) for each in plan(options.solvers)])
        show(console, rows[-1])
    where = setting()
    console.print(", ".join(f"{k} {v}" for k, v in where.items()), style="dim")
    if options.save:
        flat = [each for group in rows for each in group]
        keys = list(dict.fromkeys(key for each in flat for key in each))
        save_rows(RESULTS, [{key: each.get(key, "") for key in keys} for each in flat], where)
        draw(PICTURE)


if __name__ == "__main__":
    main()
