"""One entry of the race: a process in an environment of its own, told its rounds one by one."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path
from threading import Timer

import numpy as np

HERE = Path(__file__).parent
STARTING, RUNNING = 1200.0, 60.0  # s until a peer that says nothing is ended; the first includes compiling


class Peer:
    """One entry's process, waiting for its rounds. Where it fails, ``failed`` says how, and the race goes on."""

    def __init__(self, entry: tuple, peers: Path, data: Path, folder: Path, patience: float = RUNNING) -> None:
        self.job, self.label, script, home, arguments = entry
        python = sys.executable if not home else str(peers / home / "bin" / "python")
        name = f"{Path(script).stem}{''.join(arguments)}"
        self.out, self.said, self.patience = folder / f"{name}.npz", folder / f"{name}.txt", patience
        env = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
        if home:  # our own path holds packages of another environment
            env.pop("PYTHONPATH", None)
        command = [python, str(HERE / script), str(data), str(self.out), *arguments]
        self.versions: dict[str, str] = {}
        self.times: list[float] = []
        self.failed = ""
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
        with self.said.open("w") as errors:
            self.process = subprocess.Popen(command, env=env, text=True, stderr=errors, **pipes)

    def ready(self) -> None:
        """Wait until it came up, which it says by its versions."""
        if said := self._line(r"ready (\{.*\})\n", STARTING):
            self.versions = json.loads(said)

    def round(self) -> None:
        """One more round, unless it has failed before."""
        if self.failed:
            return
        try:
            print("go", file=self.process.stdin, flush=True)
        except BrokenPipeError:  # it has ended; the next line, of which there is none, says why
            pass
        if said := self._line(r"took ([\d.e-]+)\n", self.patience):
            self.times.append(float(said))

    def answers(self) -> dict[str, np.ndarray]:
        """What it found in its last round; nothing where it failed."""
        if not self.failed:
            try:
                self.process.communicate(timeout=self.patience)
            except subprocess.TimeoutExpired:
                self.process.kill()
            if self.process.wait() or not self.out.exists():
                self._fail()
        if self.failed:
            return {}
        with np.load(self.out) as file:
            return {name: file[name] for name in file.files}

    def _line(self, pattern: str, patience: float) -> str:
        """What the next line of this pattern says; other lines are its own chatter."""
        late = Timer(patience, self.process.kill)
        late.start()
        for line in self.process.stdout:
            if said := re.fullmatch(pattern, line):
                late.cancel()
                return said[1]
        self._fail()
        late.cancel()
        return ""

    def _fail(self) -> None:
        """How it ended, and the last thing it said."""
        code = self.process.wait()
        lines = [line.strip() for line in self.said.read_text(errors="replace").splitlines() if line.strip()]
        self.failed = ": ".join([f"signal {-code}" if code < 0 else f"exit status {code}", *lines[-1:]])[:200]
