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
import json
import os
import platform
import re
import statistics
import subprocess
import sys
import tempfile
from datetime import date
from pathlib import Path
from time import process_time

import numpy as np
import pinocchio as pin

import cartctl as cc
from cartctl.compiled.tree import tree_of

HERE = Path(__file__).parent
RESULTS = HERE.parent / "results" / "race.csv"
NEAR, ALIGNED = 1e-4, 1e-3
# job, label, script, the peer's environment ("" is this one), further arguments
ENTRIES = [
    ("ik", "cartctl inverse_kinematics", "ik_cartctl.py", "", ()),
    ("ik", "roboticstoolbox ik_LM", "ik_roboticstoolbox.py", "roboticstoolbox", ()),
    ("track", "cartctl simulate_batch", "track_cartctl.py", "", ("batch",)),
    ("track", "cartctl simulate_batch, approach", "track_cartctl.py", "", ("approach",)),
    ("track", "cartctl Controller.step", "track_cartctl.py", "", ("step",)),
    ("track", "placo", "track_placo.py", "placo", ()),
    ("track", "pink", "track_pink.py", "pink", ()),
]


def ik_job(count: int) -> dict[str, np.ndarray]:
    """Poses of random configurations inside the limits, and the chain to them."""
    robot, rng = cc.load("panda"), np.random.default_rng(2)
    low, high = robot.limits.position_lower, robot.limits.position_upper
    targets = [robot.state(q).placement(robot.tool).homogeneous for q in rng.uniform(low, high, (count, robot.nv))]
    tree = tree_of(robot)
    places = [matrix(row[3:]) for row in tree.joints]
    return {
        "targets": np.array(targets),
        "limits": np.array([low, high]),
        "places": np.array(places),
        "tool": matrix(tree.frame(robot.tool)[1:]),
        "tolerance": np.array(0.5 * NEAR**2),
    }


def matrix(packed: np.ndarray) -> np.ndarray:
    """(4, 4) of a rotation row by row and an origin."""
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = packed[:9].reshape(3, 3), packed[9:]
    return T


def track_job(copies: int) -> dict[str, np.ndarray]:
    """The path's samples, the URDF without its meshes, and what everybody's tasks are told."""
    robot, dt = cc.load("panda"), 1e-3
    start = robot.state(robot.home).placement(robot.tool)
    circle = cc.Circle.starting_at(start, 0.1, period=4.0)
    samples = [circle(k * dt) for k in range(4001)]
    return {
        "urdf": np.array(bare_urdf(robot)),
        "frame": np.array(robot.tool),
        "joints": np.array(robot.joint_names),
        "home": np.array(robot.home),
        "rotation": np.array(start.rotation),
        "positions": np.array([s.position for s in samples]),
        "twists": np.array([s.twist for s in samples]),
        "dt": np.array(dt),
        "gain": np.array(20.0),
        "posture_gain": np.array(1.0),
        "copies": np.array(copies),
    }


def bare_urdf(robot: cc.Robot) -> str:
    """The robot's kinematics and limits as URDF text, joints about z and no meshes: the same for every peer."""
    tree, links, joints = tree_of(robot), ['<link name="base"/>'], []
    limits = robot.limits
    for i, row in enumerate(tree.joints):
        parent = "base" if row[0] < 0 else f"l{int(row[0])}"
        links.append(link(f"l{i}"))
        low, high, speed = limits.position_lower[i], limits.position_upper[i], limits.velocity_upper[i]
        joints.append(
            f'<joint name="{robot.joint_names[i]}" type="revolute"><parent link="{parent}"/><child link="l{i}"/>'
            f'{origin(row[3:])}<axis xyz="0 0 1"/>'
            f'<limit lower="{low}" upper="{high}" velocity="{speed}" effort="87"/></joint>'
        )
    tool = tree.frame(robot.tool)
    links.append(link(robot.tool))
    joints.append(
        f'<joint name="to tool" type="fixed"><parent link="l{int(tool[0])}"/><child link="{robot.tool}"/>'
        f"{origin(tool[1:])}</joint>"
    )
    return f'<?xml version="1.0"?><robot name="panda">{"".join(links + joints)}</robot>'


def link(name: str) -> str:
    """A link with a mass, which some readers insist on."""
    inertia = '<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/>'
    return f'<link name="{name}"><inertial><mass value="1"/>{inertia}</inertial></link>'


def origin(packed: np.ndarray) -> str:
    """Position and roll, pitch, yaw."""
    rpy = pin.rpy.matrixToRpy(packed[:9].reshape(3, 3))
    return f'<origin xyz="{" ".join(map(repr, packed[9:].tolist()))}" rpy="{" ".join(map(repr, rpy.tolist()))}"/>'


class Peer:
    """One entry's process, waiting for its rounds."""

    def __init__(self, entry: tuple, peers: Path, data: Path, folder: Path) -> None:
        self.job, self.label, script, home, arguments = entry
        python = sys.executable if not home else str(peers / home / "bin" / "python")
        self.out = folder / f"{script}{len(arguments)}{''.join(arguments)}.npz"
        env = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
        if home:  # our own path holds packages of another environment
            env.pop("PYTHONPATH", None)
        command = [python, str(HERE / script), str(data), str(self.out), *arguments]
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL}
        self.process = subprocess.Popen(command, env=env, text=True, **pipes)
        self.versions: dict[str, str] = {}
        self.times: list[float] = []
        self.count = 0  # steps or poses a round

    def ready(self) -> bool:
        """Whether it came up; other lines than its versions are its own chatter."""
        for line in self.process.stdout:
            if line.startswith("{"):
                self.versions = json.loads(line)
                return True
        return False

    def round(self) -> None:
        """One more round."""
        print("go", file=self.process.stdin, flush=True)
        for line in self.process.stdout:
            if re.fullmatch(r"[\d.e-]+\n", line):
                self.times.append(float(line))
                return
        raise RuntimeError(f"{self.label} ended in the middle of its rounds")

    def answers(self) -> dict[str, np.ndarray]:
        """What it found in its last round."""
        self.process.communicate()
        with np.load(self.out) as file:
            return {name: file[name] for name in file.files}


def gauge() -> float:
    """S of a loop that does nothing worth while."""
    begun, x = process_time(), 0.0
    for k in range(200_000):
        x += k * 1e-9
    return process_time() - begun


def checked_ik(data: dict[str, np.ndarray], found: dict[str, np.ndarray]) -> dict[str, str]:
    """Answers that hold, by Pinocchio; and those claimed that do not."""
    robot, holds = cc.load("panda"), []
    low, high = data["limits"]
    for q, T in zip(found["q"], data["targets"], strict=True):
        pose = robot.state(q).placement(robot.tool)
        apart = np.linalg.norm(pose.translation - T[:3, 3])
        turned = np.linalg.norm(pin.log3(T[:3, :3] @ pose.rotation.T))
        holds.append(apart <= NEAR and turned <= ALIGNED and bool(((q >= low - 1e-9) & (q <= high + 1e-9)).all()))
    share = np.mean(holds)
    claimed = int((found["claimed"] & ~np.array(holds)).sum())
    return {"success": f"{100.0 * share:.2f} %", "error": f"{claimed} claimed and not so"}


def checked_track(data: dict[str, np.ndarray], found: dict[str, np.ndarray]) -> dict[str, str]:
    """The largest distance of the hand from the path, and the largest excess of a limit."""
    robot, limits = cc.load("panda"), cc.load("panda").limits
    gaps = [np.linalg.norm(robot.state(q).position(robot.tool) - p) for q, p in zip(found["q"], data["positions"])]  # noqa: B905
    speed = np.abs(np.diff(found["q"], axis=0)).max(axis=0) / float(data["dt"])
    excess = max(
        float((limits.position_lower - found["q"]).max()),
        float((found["q"] - limits.position_upper).max()),
        float((speed - limits.velocity_upper).max()),
    )
    return {"success": f"limits kept by {-excess:.2g}", "error": f"{1e6 * max(gaps):.3g} um off the path"}


def main() -> None:
    """Start the peers, run the rounds, check, print and save."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--peers", type=Path, default=HERE.parent.parent / ".race")
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--poses", type=int, default=10_000)
    parser.add_argument("--save", action="store_true", help=f"write {RESULTS.name}")
    asked = parser.parse_args()
    rows = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        jobs = {"ik": ik_job(asked.poses), "track": track_job(5)}
        for job, data in jobs.items():
            np.savez(folder / f"{job}.npz", **data)
            peers = [
                Peer(e, asked.peers, folder / f"{job}.npz", folder)
                for e in ENTRIES
                if e[0] == job and there(e, asked.peers)
            ]
            racing = []
            for peer in peers:
                if peer.ready():
                    racing.append(peer)
                else:
                    print(f"{peer.label} did not start", file=sys.stderr)
            noise = []
            for _ in range(asked.rounds):
                noise.append(gauge())
                for peer in racing:
                    peer.round()
            rows += [line(job, peer, racing[0], data, noise) for peer in racing]
    for row in rows:
        print("  ".join(f"{v:>22}" for v in list(row.values())[:8]))
    if asked.save:
        RESULTS.parent.mkdir(exist_ok=True)
        with RESULTS.open("w", newline="") as file:
            writer = csv.DictWriter(file, rows[0])
            writer.writeheader()
            writer.writerows(rows)


def there(entry: tuple, peers: Path) -> bool:
    """Whether a peer's environment is there; says so where it is not."""
    found = not entry[3] or (peers / entry[3] / "bin" / "python").exists()
    if not found:
        print(f"{entry[1]} is left out: no environment {peers / entry[3]}", file=sys.stderr)
    return found


def line(job: str, peer: Peer, first: Peer, data: dict[str, np.ndarray], noise: list[float]) -> dict[str, str]:
    """One row of the results."""
    found = peer.answers()
    count = int(found["steps"]) if job == "track" else len(data["targets"])
    per = [1e6 * t / count for t in peer.times]
    peer.count = count
    base = [1e6 * t / first.count for t in first.times]
    check = checked_ik(data, found) if job == "ik" else checked_track(data, found)
    return {
        "job": job,
        "who": peer.label,
        "median_us": f"{statistics.median(per):.2f}",
        "ratio": f"{statistics.median(p / b for p, b in zip(per, base, strict=True)):.2f}",
        "spread": f"{(max(per) - min(per)) / statistics.median(per):.2f}",
        **check,
        "gauge_spread": f"{(max(noise) - min(noise)) / statistics.median(noise):.2f}",
        "rounds": str(len(per)),
        "versions": " ".join(f"{k} {v}" for k, v in peer.versions.items()),
        "date": date.today().isoformat(),
        "machine": f"{platform.machine()}, {os.cpu_count()} cores",
    }


if __name__ == "__main__":
    main()
