"""The lectures' arms and five robots by ten methods, in the README's table: `make bench`, minutes on two cores.

Writes results/every_method.csv, the README's table between its two marks, and a report in out/every-method. With
--resume it goes on where it was stopped, otherwise it begins from nothing. Other sets by name (`every_method.py all`)
are shown, and leave the files alone.
"""

from __future__ import annotations

import re
import shutil
import sys
from collections.abc import Sequence
from pathlib import Path
from time import perf_counter

from harness import save_rows, setting, show

import cartctl as cc
from cartctl.bench.runner import grid
from cartctl.bench.statistics import ranking, scores, tallies

ROOT = Path(__file__).parent.parent
SETS = ("lectures", "arms")
METHODS = (
    "pinv", "dls", "projected-gradient", "task-priority", "singularity-robust-priority", "task-scaling", "sns-greedy",
    "sns", "hqp", "qp",
)  # fmt: skip
FIGURES = {"rms_m": "position error", "effort": "effort", "jerk_rms": "jerk", "step_p50": "step time"}


def run(sets: Sequence[str], out: Path) -> list[dict[str, str]]:
    """The bench, its report, and the table's rows, best first."""
    begun = perf_counter()

    def tell(k: int, n: int, doing: str | None) -> None:
        if sys.stderr.isatty():
            print(f"\r{k} of {n} {doing or '':50.50}", end="", file=sys.stderr)

    done = cc.bench.run(sets, METHODS, out=out, workers=2, tell=tell)
    wanted = {job.key for job in grid(sets, METHODS).jobs()}
    results = [row for row in cc.bench.results(done.path) if row["key"] in wanted]
    cc.bench.report(results, out)
    means = {figure: scores(results, figure).means() for figure in FIGURES}
    counts = tallies(results)
    order = ranking(results, "rms_m")
    print(f"\n{done.made} runs in {perf_counter() - begun:.0f} s; the report: {out / 'report.html'}")
    return [
        {
            "method": name,
            "runs": str(counts[name].runs),
            "valid": str(counts[name].valid),
            "solved": str(counts[name].solved),
            **{head: f"{means[figure][name]:.2f}" for figure, head in FIGURES.items()},
        }
        for name in order
    ]


def write_table(rows: list[dict[str, str]], extra: dict[str, str]) -> None:
    """The README's table."""
    readme = ROOT / "README.md"
    lines = [f"| {' | '.join(rows[0])} |", "|" + "---|" * len(rows[0])]
    lines += [f"| {' | '.join(row.values())} |" for row in rows]
    facts = ", ".join(f"{key} {value}" for key, value in extra.items())
    made = "<!-- table: every_method -->\n" + "\n".join(lines) + f"\n\n{facts}.\n<!-- /table -->"
    text = readme.read_text()
    new, found = re.subn(
        r"<!-- table: every_method -->\n.*?<!-- /table -->", lambda _: made, text, count=1, flags=re.DOTALL
    )
    assert found, "the README has lost its mark"
    readme.write_text(new)


if __name__ == "__main__":
    folder = ROOT / "out" / "every-method"
    if "--resume" not in sys.argv:
        shutil.rmtree(folder, ignore_errors=True)
    chosen = [name for name in sys.argv[1:] if not name.startswith("-")]
    table = run(chosen or SETS, folder)
    show(f"{', '.join(chosen or SETS)} by ten methods", table)
    if not chosen:
        save_rows(ROOT / "benchmarks" / "results" / "every_method.csv", table, setting())
        write_table(table, setting())
