"""The micro-benchmarks run, each once and untimed; `make micro` measures them."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests import joint_rollouts as jr

ROOT = Path(__file__).parent.parent


@pytest.mark.skipif(not jr.COMPILED, reason="what they measure is compiled")
def test_every_micro_benchmark_runs() -> None:
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", "no:xdist", "--benchmark-disable"]
    env = {key: value for key, value in os.environ.items() if not key.startswith("PYTEST_")}
    done = subprocess.run(
        [*command, "benchmarks/test_micro.py"], cwd=ROOT, env=env, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout
    ran = re.search(r"(\d+) passed", done.stdout)
    assert ran is not None and int(ran[1]) > 30 and "skipped" not in done.stdout, done.stdout
