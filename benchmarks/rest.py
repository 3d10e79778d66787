"""How many robots come to rest before a target out of reach: random directions from home, by tasks, solver and level.

    python benchmarks/rest.py               # print the table
    python benchmarks/rest.py --save        # and write results/rest.csv

The runs are those of ``tests/test_coming_to_rest.py`` with more directions and longer: 16 s at 10 ms towards a target
1.8 to 4.5 m away, gain 20/s: a position, a whole pose, an orientation ranked below a position, a pose above the posture
of home; and in place: a position in reach, and below it a random orientation, which may be out of reach there. At rest:
below 1e-3 of every speed limit from the deadline on, no reversal above 1e-6 of it; the deadline is 3 s after the
earliest time at which the limits let the joints arrive. Later: at rest within the 16 s, but after the deadline, for a
long way round or a swing about the edge. Nearing: not at rest in the last half second, for some task has come nearer in
the last two seconds, and none above it has lost anything. Moving: neither.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from harness import one_table

sys.path.insert(0, str(Path(__file__).parent.parent))
from tests import test_coming_to_rest as rest

RESULTS = Path(__file__).parent / "results" / "rest.csv"
DIRECTIONS = {"position": 20, "pose": 10, "ranked": 10, "pose+posture": 10, "in place": 20}
ROBOTS = ("panda", "lwr", "kinova")
VERDICTS = ("at_rest", "later", "nearing", "moving")
WORTH = 1e-4  # m or rad: a miss that changed by less in two seconds did not
rest.DURATION = 16.0  # s


def verdict(found: rest.Rolled) -> str:
    """``at_rest``, ``later``, ``nearing`` or ``moving``; AssertionError where a limit is broken."""
    assert found.excess <= 1e-9
    try:
        rest.assert_rests(found)
        return "at_rest"
    except AssertionError:
        pass
    if np.abs(found.shares[-50:]).max() <= rest.STANDS:
        return "later"
    for gained in found.misses[-200] - found.misses[-1]:  # highest priority first
        if abs(gained) > WORTH:
            return "nearing" if gained > 0.0 else "moving"
    return "moving"


def row(kind: str, name: str, solver: str, level: str, accelerations: bool) -> dict[str, str]:
    """One line of the table."""
    robot, counts = rest.arm(name), dict.fromkeys(VERDICTS, 0)
    for seed in range(DIRECTIONS[kind]):
        inside = kind == "in place"
        target = rest.in_place(robot, seed) if inside else rest.far_away(robot, seed)
        tasks = rest.stack(robot, "ranked" if inside else kind, target)
        counts[verdict(rest.rolled(robot, tasks, solver, level, accelerations))] += 1
    limits = "velocity, acceleration" if accelerations else "velocity"
    what = {"tasks": kind, "robot": name, "solver": solver, "level": level, "limits": limits}
    return what | {"directions": str(DIRECTIONS[kind])} | {key: str(count) for key, count in counts.items()}


def measured() -> list[dict[str, str]]:
    """The table, and its sums by tasks and levels."""
    forms = [(name, solver, *form) for name in ROBOTS for solver in ("sns", "hqp") for form in rest.FORMS]
    rows = [row(kind, *form) for kind in DIRECTIONS for form in forms]
    counted, sums = ("directions", *VERDICTS), []
    for kind in DIRECTIONS:
        for level, limits in dict.fromkeys((r["level"], r["limits"]) for r in rows):
            of = [r for r in rows if (r["tasks"], r["level"], r["limits"]) == (kind, level, limits)]
            what = {"tasks": kind, "robot": "all", "solver": "all", "level": level, "limits": limits}
            sums.append(what | {key: str(sum(int(r[key]) for r in of)) for key in counted})
    return rows + sums


if __name__ == "__main__":
    one_table(__doc__, RESULTS, "At rest before a target out of reach", measured)
