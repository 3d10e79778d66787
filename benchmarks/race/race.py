"""The race: cartctl and its peers on the same jobs, each in an environment of its own, round by round in turns.

    make race                                     # sets the environments up, runs, writes benchmarks/results/race.csv
    python benchmarks/race/race.py --peers DIR    # DIR/<peer>/bin/python; peers that are missing are left out

Two jobs on the Panda. ik: random reachable poses, one thread; an answer counts if Pinocchio finds it within 0.1 mm and
1 mrad, inside the limits. track: the hand along a circle of 0.1 m in 4 s, a posture below, position and velocity
limits, dt = 1 ms; its error is where Pinocchio sees the hand, against the path. Every figure is the median of the
rounds, us of CPU a pose or a step on one thread; a ratio is the median of the rounds' ratios to the first line of its
job; the gauge, a loop of plain Python beside each round, says how steady the machine was.
"""

from __future__ import annotations

import argparse
import csv
import os
import platform
import statistics
import sys
import tempfile
from datetime import date
from pathlib import Path
from time import process_time

import numpy as np
from checks import checked_ik, checked_track
from jobs import ik_job, track_job
from peer import Peer
from words import write

HERE = Path(__file__).parent
RESULTS = HERE.parent / "results" / "race.csv"
TRACKERS = ("placo", "roboplan", "tsid", "embodik", "drake", "pink", "mink")
# job, label, script, the peer's environment ("" is this one), further arguments
ENTRIES = [
    ("ik", "cartctl inverse_kinematics", "ik_cartctl.py", "", ()),
    ("ik", "roboticstoolbox ik_LM", "ik_roboticstoolbox.py", "roboticstoolbox", ()),
    ("track", "cartctl simulate_batch", "track_cartctl.py", "", ("batch",)),
    ("track", "cartctl simulate_batch, approach", "track_cartctl.py", "", ("approach",)),
    ("track", "cartctl Controller.step", "track_cartctl.py", "", ("step",)),
    *(("track", peer, f"track_{peer}.py", peer, ()) for peer in TRACKERS),
]


def gauge() -> float:
    """S of a loop that does nothing worth while."""
    begun, x = process_time(), 0.0
    for k in range(200_000):
        x += k * 1e-9
    return process_time() - begun


def main() -> None:
    """Start the peers, run the rounds, check, print and save."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--peers", type=Path, default=HERE.parent.parent / ".race", help="their environments: make race"
    )
    parser.add_argument("--rounds", type=int, default=7, help="of each, in turns")
    parser.add_argument("--poses", type=int, default=10_000, help="of the inverse kinematics")
    parser.add_argument("--save", action="store_true", help=f"write {RESULTS.name} and the README's paragraph")
    asked = parser.parse_args()
    rows = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        jobs = {"ik": ik_job(asked.poses), "track": track_job(5)}
        for job, data in jobs.items():
            np.savez(folder / f"{job}.npz", **data)
            racing = []
            for entry in ENTRIES:
                if entry[0] == job and there(entry, asked.peers):
                    racing.append(Peer(entry, asked.peers, folder / f"{job}.npz", folder))
                    racing[-1].ready()  # one after the other: what one has compiled, the next finds
            noise = []
            for _ in range(asked.rounds):
                noise.append(gauge())
                for peer in racing:
                    peer.round()
            rows += lines(racing, data, noise)
    for row in rows:
        print("  ".join(f"{v:>22}" for v in list(row.values())[:8]))
    if asked.save:
        RESULTS.parent.mkdir(exist_ok=True)
        with RESULTS.open("w", newline="") as file:
            writer = csv.DictWriter(file, rows[0])
            writer.writeheader()
            writer.writerows(rows)
        write(rows)


def there(entry: tuple, peers: Path) -> bool:
    """Whether a peer's environment is there; says so where it is not."""
    found = not entry[3] or (peers / entry[3] / "bin" / "python").exists()
    if not found:
        print(f"{entry[1]} is left out: no environment {peers / entry[3]}", file=sys.stderr)
    return found


def lines(racing: list[Peer], data: dict[str, np.ndarray], noise: list[float]) -> list[dict[str, str]]:
    """The rows of one job; the first entry is what ratios are to."""
    rows, base = [], []
    for peer in racing:
        found = peer.answers()
        row = {"job": peer.job, "who": peer.label, "median_us": "", "ratio": "", "spread": ""}
        if peer.failed:
            row |= {"success": "did not finish", "error": peer.failed}
            print(f"{peer.label} did not finish: {peer.failed}", file=sys.stderr)
        else:
            count = int(found["steps"]) if peer.job == "track" else len(data["targets"])
            per = [1e6 * t / count for t in peer.times]
            base = base or per
            median = statistics.median(per)
            row |= {
                "median_us": f"{median:.2f}",
                "ratio": f"{statistics.median(p / b for p, b in zip(per, base, strict=True)):.2f}",
                "spread": f"{(max(per) - min(per)) / median:.2f}",
                **(checked_ik if peer.job == "ik" else checked_track)(data, found),
            }
        rows.append(
            {
                **row,
                "gauge_spread": f"{(max(noise) - min(noise)) / statistics.median(noise):.2f}",
                "rounds": str(len(peer.times)),
                "versions": " ".join(f"{k} {v}" for k, v in peer.versions.items()),
                "date": date.today().isoformat(),
                "machine": f"{platform.machine()}, {os.cpu_count()} cores",
            }
        )
    return rows


if __name__ == "__main__":
    main()
