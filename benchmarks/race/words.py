"""README's paragraph about the race, made from race.csv.

python benchmarks/race/words.py            # write it again
python benchmarks/race/words.py --check    # or say what it should be
"""

from __future__ import annotations

import csv
import re
import sys
import textwrap
from pathlib import Path

ROOT = Path(__file__).parent.parent.parent
README, RESULTS = ROOT / "README.md", ROOT / "benchmarks" / "results" / "race.csv"
BLOCK = re.compile(r"(?<=<!-- race -->\n).*?(?=<!-- /race -->)", re.DOTALL)
OURS = {"cartctl simulate_batch": "`cc.simulate_batch`", "cartctl Controller.step": "`Controller.step`"}
POSES = ("cartctl inverse_kinematics", "roboticstoolbox ik_LM")


def rows() -> list[dict[str, str]]:
    """What the file holds."""
    with RESULTS.open() as file:
        return list(csv.DictReader(file))


def us(row: dict[str, str]) -> str:
    """Its time, in two digits or more."""
    time = float(row["median_us"])
    return f"{time:.1f}" if time < 10.0 else f"{time:.0f}"


def um(distance: float) -> str:
    """A distance, in two digits or more."""
    return f"{distance:.2g}" if distance < 10.0 else f"{distance:.0f}"


def paragraph(found: list[dict[str, str]]) -> str:
    """The paragraph, every figure a row's."""
    tracks = [r for r in found if r["job"] == "track" and r["who"] != "cartctl simulate_batch, approach"]
    ended = sorted((r for r in tracks if r["success"].startswith("limits")), key=lambda r: float(r["median_us"]))
    lost = [r["who"] for r in tracks if r not in ended]
    times = ", ".join(f"{OURS.get(r['who'], r['who'])} {us(r)}" for r in ended)
    off = {r["who"]: float(r["error"].split()[0]) for r in ended}
    mine = max(off.pop(who) for who in OURS)
    near, far = min(off, key=off.__getitem__), max(off, key=off.__getitem__)
    ik = {r["who"]: r for r in found if r["job"] == "ik"}
    own, other = (f"{us(ik[who])} us and {ik[who]['success']}" for who in POSES)
    text = (
        "Beside other tools, the Panda on one path under position and velocity limits, us a step of the "
        "whole loop, its Python included (`make race`, "
        f"[results](benchmarks/results/race.csv)): {times}{''.join(f'; {who} did not finish' for who in lost)}. "
        f"cartctl strays up to {um(mine)} um from the path, the others {um(off[near])} ({near}) to {um(off[far])} "
        f"({far}), being told where it will be after the step, tsid its acceleration. "
        f"Inverse kinematics of random poses: {own} found, the Robotics Toolbox's `ik_LM` {other}. "
        "What each of them does better: [docs/comparison.md](docs/comparison.md). "
        "More times: [docs/measurements.md](docs/measurements.md)."
    )
    return "\n".join(textwrap.wrap(text, 120, break_long_words=False, break_on_hyphens=False)) + "\n"


def write(found: list[dict[str, str]]) -> None:
    """Put it into the README, unless those it is about are missing."""
    missing = {*OURS, *POSES} - {r["who"] for r in found if r["median_us"] and not r["success"].startswith("not")}
    if missing:
        raise SystemExit(f"README.md is left as it is: no figures of {', '.join(sorted(missing))}")
    text = README.read_text()
    README.write_text(BLOCK.sub(lambda _: paragraph(found), text))


if __name__ == "__main__":
    if sys.argv[1:] != ["--check"]:
        write(rows())
    elif paragraph(rows()) not in README.read_text():
        sys.exit(f"README.md should say, and python benchmarks/race/words.py would write:\n{paragraph(rows())}")
