"""Whether packages can be imported, tried in a process of their own: a broken binary may take its process along."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterable
from typing import NamedTuple

_SCRIPT = """
import importlib, json, sys
sys.path[:] = json.loads(sys.argv[1])
for name in sys.argv[2:]:
    needs = reason = ""
    try:
        module = importlib.import_module(name)
        if name == "pinocchio" and not hasattr(module, "buildModelFromXML"):
            reason = "is another package of that name"
    except ModuleNotFoundError as error:
        needs, reason = (error.name or "").partition(".")[0], str(error)
    except BaseException as error:
        reason = f"{type(error).__name__}: {error}"
    print(json.dumps([name, needs, " ".join(reason.split())]), flush=True)
"""


class Trial(NamedTuple):
    """What came of an import: why it failed ("" if it did not), and the module that it missed, if that was it."""

    reason: str
    needs: str


def try_imports(modules: Iterable[str]) -> dict[str, Trial]:
    """Import ``modules`` in turn elsewhere; one that kills its process is blamed, and the rest tried again."""
    waiting, trials = list(modules), {}
    while waiting:
        command = [sys.executable, "-c", _SCRIPT, json.dumps(sys.path), *waiting]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        for line in done.stdout.splitlines():
            if line.startswith("["):  # anything else was printed by a package
                name, needs, reason = json.loads(line)
                trials[name] = Trial(reason, needs)
        left = [name for name in waiting if name not in trials]
        if left:
            trials[left[0]] = Trial(f"ends its process with {done.returncode}", "")
        waiting = left[1:]
    return trials
