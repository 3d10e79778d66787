"""The runs of a bench: every scenario by every method at every level, each with a key that outlives the process."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from cartctl.bench.methods import Method
from cartctl.bench.scenario import Scenario
from cartctl.bench.schema import VERSION


@dataclass(frozen=True)
class Job:
    """One run. keep: whether every step is wanted, too."""

    group: str
    scenario: Scenario
    method: Method
    level: str
    repeat: int
    seed: int
    keep: bool = False

    @property
    def key(self) -> str:
        """Sixteen letters: the same job in another process, on another day, has the same."""
        parts = (
            str(VERSION), self.scenario.digest, self.method.name, self.method.parameters, self.level,
            str(self.repeat), str(self.seed),
        )  # fmt: skip
        return hashlib.sha256("\n".join(parts).encode()).hexdigest()[:16]


class Grid(NamedTuple):
    """All jobs of a bench, made one by one so that a million of them need no memory.

    scenarios: (set, scenario). levels: instead of the scenarios' own, None for those. repeat: runs of each.
    """

    scenarios: Sequence[tuple[str, Scenario]]
    methods: Sequence[Method]
    levels: Sequence[str] | None = None
    repeat: int = 1
    seed: int = 0
    keep: bool = False

    def __len__(self) -> int:
        columns = len(self.methods) * self.repeat
        return sum(len(self.levels or scenario.levels) for _, scenario in self.scenarios) * columns

    def jobs(self) -> Iterator[Job]:
        """Every job, repetitions outermost, so that a bench that is stopped has seen everything at least once."""
        for repeat in range(self.repeat):
            for group, scenario in self.scenarios:
                for level in self.levels or scenario.levels:
                    for method in self.methods:
                        yield Job(group, scenario, method, level, repeat, self.seed, self.keep)
