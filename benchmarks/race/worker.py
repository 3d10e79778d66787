"""What every peer's script shares: it is told rounds on stdin, one a line, and says what each one took, in s of CPU.

A peer is started with the job's .npz and a file for its answers. It prints a line with its versions when it is ready,
then for every line on stdin one with a number; the answers of its last round lie in the file when it ends. All jobs run
on one thread, so that CPU time is what a free machine's clock would show, and other work on the machine counts little.
"""

from __future__ import annotations

import json
import platform
import sys
from collections.abc import Callable
from importlib.metadata import version
from time import process_time

import numpy as np


def serve(packages: tuple[str, ...], work: Callable[[], dict[str, np.ndarray]]) -> None:
    """Warm up once, then run ``work`` once a line of stdin."""
    answers = work()
    told = {name: version(name) for name in packages}
    print("ready", json.dumps({**told, "python": platform.python_version()}), flush=True)
    for _ in sys.stdin:
        begun = process_time()
        answers = work()
        print("took", process_time() - begun, flush=True)
    np.savez(sys.argv[2], **answers)


def job() -> dict[str, np.ndarray]:
    """The job's arrays."""
    with np.load(sys.argv[1]) as file:
        return {name: file[name] for name in file.files}
