"""Ten thousand short runs: does the memory of a bench grow with their number? On two workers and alone.

Writes results/bench_memory.csv: the most memory that was resident at once, of this process and of all together, when
a tenth of the runs was done, and in all.
"""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
import threading
from pathlib import Path
from time import perf_counter

import pyarrow.parquet  # noqa: F401 - so that it does not look like growth when the table is written
from harness import save_rows, setting, show

import cartctl as cc

LIMIT = 1024.0  # MiB
RUNS, SOLVERS = 10_000, ("pinv", "dls", "task-scaling", "projected-gradient")
SCENARIO = cc.Scenario(
    "two-steps", "planar3R", [{"axes": "xy", "target": {"kind": "circle", "radius": 0.2}}], duration=0.02, dt=0.01,
    limits="none", start={"random": 0.3},
)  # fmt: skip


def resident() -> dict[int, float]:
    """MiB of this process and everything below it, by process."""
    parents, sizes = {}, {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                fields = (entry / "stat").read_text().rpartition(")")[2].split()
                sizes[int(entry.name)] = int(fields[21]) * os.sysconf("SC_PAGE_SIZE") / 2**20
                parents[int(entry.name)] = int(fields[1])
            except (OSError, IndexError):
                continue  # it has ended meanwhile
    family = {os.getpid()}
    while more := {pid for pid, parent in parents.items() if parent in family} - family:
        family |= more
    return {pid: sizes[pid] for pid in family if pid in sizes}


class Watch:
    """Looks at the memory five times a second, until it is told to stop."""

    def __init__(self) -> None:
        self.own = self.all = 0.0
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._look, daemon=True)

    def __enter__(self) -> Watch:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join()

    def _look(self) -> None:
        while not self._over.wait(0.2):
            sizes = resident()
            self.own, self.all = max(self.own, sizes[os.getpid()]), max(self.all, sum(sizes.values()))


def measured(workers: int, runs: int) -> dict[str, str]:
    """One bench from nothing."""
    folder = Path(tempfile.mkdtemp())
    early: list[float] = []
    begun = perf_counter()

    def tell(k: int, n: int, _: str | None) -> None:
        if 10 * k >= n and not early:
            early.extend((watch.own, watch.all))
        if sys.stderr.isatty():
            print(f"\r{workers} workers: {k} of {n}", end="", file=sys.stderr)

    with Watch() as watch:
        done = cc.bench.run(SCENARIO, SOLVERS, out=folder, repeat=runs // len(SOLVERS), workers=workers, tell=tell)
    assert done.made == done.total == len(cc.bench.results(done.path))
    seconds, size = perf_counter() - begun, sum(f.stat().st_size for f in folder.iterdir()) / 2**20
    shutil.rmtree(folder)
    return {
        "workers": str(workers),
        "runs": str(done.made),
        "own_MiB_at_a_tenth": f"{early[0]:.0f}",
        "own_MiB": f"{watch.own:.0f}",
        "all_MiB_at_a_tenth": f"{early[1]:.0f}",
        "all_MiB": f"{watch.all:.0f}",
        "files_MiB": f"{size:.0f}",
        "seconds": f"{seconds:.0f}",
    }


if __name__ == "__main__":
    count = int(sys.argv[1]) if len(sys.argv) > 1 else RUNS
    rows: list[dict[str, str]] = []
    for workers in (1, 2):
        rows.append(measured(workers, count))
        assert float(rows[-1]["all_MiB"]) < LIMIT, rows[-1]
        show(f"{count} short runs", rows)
        if count == RUNS:
            save_rows(Path(__file__).parent / "results" / "bench_memory.csv", rows, setting())
