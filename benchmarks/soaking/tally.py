"""What a soak adds up to, and its line in the CSV."""

from __future__ import annotations

import csv
from collections import Counter
from pathlib import Path

import numpy as np

from soaking.batch import Batch, Failure
from soaking.judge import AT, COARSE, CONTRADICTIONS, GREY, TOLD
from soaking.loops import Loops

_CLAIMS = ("met", "scaled", "skipped", "fitted", "interval")


class Tally:
    """Counts, worst figures of what passed, and the failures."""

    def __init__(self) -> None:
        self.problems = self.steps = self.rolled = self.certificates = self.failed = 0
        self.seconds = {"problems": 0.0, "loops": 0.0, "rollouts": 0.0}  # of all processes together
        self.counts, self.worst = np.zeros(AT, dtype=np.int64), np.zeros(3)
        self.loop_worst = self.excess = 0.0
        self.statuses: Counter[str] = Counter()
        self.failures: list[Failure] = []

    def add_batch(self, batch: Batch, seconds: float) -> None:
        """One more batch of problems."""
        self.problems += batch.problems
        self.counts += batch.counts
        self.worst = np.maximum(self.worst, batch.worst)
        self._fail(batch.failed, batch.failures)
        self.seconds["problems"] += seconds

    def add_loops(self, loops: Loops, seconds: float, kind: str = "loops") -> None:
        """One more run of closed loops, or of compiled rollouts."""
        if kind == "loops":
            self.steps += loops.steps
        else:
            self.rolled += loops.steps
        self.certificates += loops.certificates
        self.loop_worst, self.excess = max(self.loop_worst, loops.worst), max(self.excess, loops.excess)
        self.statuses += loops.statuses
        self._fail(len(loops.failures), loops.failures)
        self.seconds[kind] += seconds

    def add_failure(self, failure: Failure) -> None:
        """One that stopped the soak."""
        self._fail(1, [failure])

    def _fail(self, failed: int, failures: list[Failure]) -> None:
        self.failed += failed
        self.failures += failures

    def row(self, minutes: float, seed: int, jobs: int) -> dict[str, str]:
        """One line."""
        claims = " ".join(f"{name} {count}" for name, count in zip(_CLAIMS, self.counts, strict=False))
        primal, dual, gap = (f"{value:.1e}" for value in self.worst)
        return {
            "minutes": f"{minutes:.1f}",
            "jobs": str(jobs),
            "seed": str(seed),
            "problems": str(self.problems),
            "problems_per_s": self._rate(self.problems, "problems", jobs),
            "levels": claims,
            "contradictory_rows": str(self.counts[CONTRADICTIONS]),
            "worst_primal": primal,
            "worst_dual": dual,
            "worst_gap": gap,
            "above_1e-8": str(self.counts[COARSE]),
            "grey_unproven": str(self.counts[GREY]),
            "told_unproven": str(self.counts[TOLD]),
            "steps": str(self.steps),
            "steps_per_s": self._rate(self.steps, "loops", jobs),
            "compiled_steps": str(self.rolled),
            "compiled_steps_per_s": self._rate(self.rolled, "rollouts", jobs),
            "statuses": " ".join(f"{name} {count}" for name, count in sorted(self.statuses.items())),
            "certificates": str(self.certificates),
            "worst_certificate": f"{self.loop_worst:.1e}",
            "worst_excess": f"{self.excess:.1e}",
            "failures": str(self.failed),
            "failure_kinds": "; ".join(f"{count} {kind}" for kind, count in self.kinds().most_common()),
            "first_failures": "; ".join(self.first()),
        }

    def kinds(self) -> Counter[str]:
        """How many failures of each kind."""
        return Counter(failure.kind for failure in self.failures)

    def first(self) -> list[str]:
        """The first failure of each kind."""
        return list({f.kind: f"{f.kind} {f.command}" for f in reversed(self.failures)}.values())

    def _rate(self, count: int, part: str, jobs: int) -> str:
        seconds = self.seconds[part]
        return f"{count / seconds * jobs:.0f}" if seconds > 0.0 else ""


def append(path: Path, row: dict[str, str]) -> None:
    """Add a line; a file whose columns are others is begun anew beside it."""
    new = not path.exists()
    if not new:
        with path.open() as file:
            new = next(csv.reader(file), []) != list(row)
        if new:
            path.rename(path.with_suffix(".old.csv"))
    with path.open("a", newline="") as file:
        writer = csv.DictWriter(file, list(row), lineterminator="\n")
        if new:
            writer.writeheader()
        writer.writerow(row)
