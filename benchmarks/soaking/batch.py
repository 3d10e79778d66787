"""A batch of problems in one call of compiled code."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from cartctl import kernel_cache, kernels
from cartctl.kernels import kernel
from soaking.judge import AT, FINE, GREY, WHAT, judged
from soaking.problems import make

MOST = 64  # failures of a batch that are kept
_SOURCES = (
    "draws",
    "matrices",
    "bounds",
    "problems",
    "judge",
    "batch",
)  # of the kernel


class Failure(NamedTuple):
    """What failed, and how to see it again."""

    what: str
    size: float
    command: str

    @property
    def kind(self) -> str:
        """What failed, without what is special to this one."""
        return self.what.partition(" at step")[0].partition(":")[0]


class Batch(NamedTuple):
    """Problems made, counts by claim, the worst primal, dual and gap of those that passed, failures."""

    problems: int
    counts: np.ndarray
    worst: np.ndarray
    failed: int
    failures: list[Failure]


@kernel("int(int, int, int, int, out_vector, out_ints, out_matrix)", fast=True)
def _run(seed, first, last, spoilt, worst, counts, failures):
    """Problems first..last of a seed; how many failed. The answer to ``spoilt`` is spoilt before it is judged."""
    failed = 0
    for index in range(first, last):
        counts[AT] = index
        made, n, grey = make(seed, index)
        failure, size = judged(made, n, index == spoilt, worst, counts)
        if failure != FINE and grey:
            counts[GREY] += 1
        elif failure != FINE:
            if failed < failures.shape[0]:
                failures[failed, 0], failures[failed, 1], failures[failed, 2] = index, failure, size
            failed += 1
    return failed


def prepare() -> None:
    """Compile, or fetch from the cache, which is one for these files and this engine."""
    folder = kernel_cache.cache_folder(*(Path(__file__).with_name(f"{name}.py") for name in _SOURCES))
    usual = kernels.cache_folder
    kernels.cache_folder = lambda *_: folder
    try:
        _ = _run.compiled
    finally:
        kernels.cache_folder = usual


def run(seed: int, first: int, count: int, spoilt: int = -1) -> Batch:
    """Problems first.. of a seed; one that raises is a failure like any other."""
    prepare()
    worst, counts, failures = np.zeros(3), np.zeros(AT + 1, dtype=np.int64), []
    failed, begin, last = 0, first, first + count
    while begin < last:
        found = np.zeros((MOST, 3))
        try:
            new, raised = _run(seed, begin, last, spoilt, worst, counts, found), None
        except (ValueError, ArithmeticError) as error:
            raised, new = error, int(np.count_nonzero(found[:, 1]))
        failed += new
        failures += [_failure(seed, int(i), WHAT[int(w)], size) for i, w, size in found[: min(new, MOST)]]
        if raised is None:
            break
        begin = int(counts[AT]) + 1
        failed += 1
        failures.append(_failure(seed, begin - 1, f"{type(raised).__name__}: {raised}", np.nan))
    return Batch(count, counts[:AT].copy(), worst, failed, failures)


def _failure(seed: int, index: int, what: str, size: float) -> Failure:
    return Failure(what, float(size), f"--problem {seed} {index}")
