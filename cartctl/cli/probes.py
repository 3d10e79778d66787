"""The checks of ``cartctl doctor``: each by itself, so that one missing package spoils one check."""

from __future__ import annotations

import os
import platform
import re
import shutil
from collections.abc import Callable, Iterator
from importlib import metadata
from pathlib import Path
from typing import NamedTuple

from cartctl import __version__
from cartctl.cli.imports import try_imports

# Distribution -> the module it brings (none for data) and the oldest version that will do.
PACKAGES = {
    "pin": ("pinocchio", "4"),
    "coal": ("coal", "3"),
    "numpy": ("numpy", "1.26"),
    "scipy": ("scipy", "1.11"),
    "numba": ("numba", "0.60"),
    "qpsolvers": ("qpsolvers", "4.8"),
    "daqp": ("daqp", "0.7"),
    "osqp": ("osqp", "1.0"),
    "meshcat": ("meshcat", "0.3.2"),
    "joblib": ("joblib", "1.4"),
    "matplotlib": ("matplotlib", "3.7"),
    "u-msgpack-python": ("umsgpack", "2.8"),
    "pyarrow": ("pyarrow", "14"),
    "typer": ("typer", "0.12"),
    "rich": ("rich", "13"),
    "defusedxml": ("defusedxml", "0.7"),
    "platformdirs": ("platformdirs", "4"),
    "example-robot-data": ("", "6.0"),
}
VISER = "1.1.1"  # the oldest version that will do; only the extra ``play`` brings it
_THREADS = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS")
_BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")


class Finding(NamedTuple):
    """What a check found. verdict: "ok", "note" (works without), "missing" or "broken"; remedy: a command or ""."""

    verdict: str
    subject: str
    detail: str
    remedy: str = ""


def findings() -> list[Finding]:
    """Everything there is to say about this installation."""
    checks: tuple[Callable[[], Finding], ...] = (_robots, _shared_robots, _kernels, _cache, _blas, _browser, _viser)
    return [_python(), _own(), *_packages(), *(_guarded(check) for check in checks)]


def _guarded(check: Callable[[], Finding]) -> Finding:
    """A check that itself breaks is a finding, too."""
    try:
        return check()
    except Exception as error:
        needed = getattr(error, "name", None)
        reason = f"needs {needed}" if needed else f"{type(error).__name__}: {' '.join(str(error).split())}"
        return Finding("broken", check.__name__.strip("_").replace("_", " "), reason)


def _python() -> Finding:
    text = f"{platform.python_version()} on {platform.system()} {platform.machine()}"
    return Finding("ok", "python", text)


def _own() -> Finding:
    return Finding("ok", "cartctl", __version__)


def _packages() -> Iterator[Finding]:
    trials = try_imports(module for module, _ in PACKAGES.values() if module)
    for name, (module, oldest) in PACKAGES.items():
        wanted = f"'{name}>={oldest}'"
        try:
            version = metadata.version(name)
        except metadata.PackageNotFoundError:
            yield Finding("missing", name, "not installed", f"pip install {wanted}")
            continue
        if _numbers(version) < _numbers(oldest):
            remedy = f"pip install --upgrade {wanted}"
            yield Finding("broken", name, f"{version}; expected {oldest} or later", remedy)
            continue
        reason, needs = trials.get(module, ("", ""))
        if needs not in ("", module) and any(needs == other for other, _ in PACKAGES.values()):
            yield Finding("broken", name, f"{version}, but it needs {needs}")  # which has a line of its own
        elif reason:
            # PyPI's "pinocchio" is something else, and hides the module of "pin"
            first = "pip uninstall -y pinocchio && " if reason.startswith("is another") else ""
            trouble = f"{version}, but import {module}: {reason}"
            yield Finding("broken", name, trouble, f"{first}pip install --force-reinstall {wanted}")
        else:
            yield Finding("ok", name, version)


def _numbers(version: str) -> tuple[int, ...]:
    return tuple(int(n) for n in re.findall(r"\d+", version)[:3])


def _robots() -> Finding:
    from cartctl.model.catalog.files import own_urdfs
    from cartctl.model.library import robots

    return Finding("ok", "robots", f"{len(robots())} by name, our own in {own_urdfs()}")


def _shared_robots() -> Finding:
    from cartctl.model.catalog.files import shared_robots

    return Finding("ok", "robot files", f"example-robot-data in {shared_robots()}")


def _kernels() -> Finding:
    import numpy as np

    from cartctl.solvers.dls import damped_solve

    u = damped_solve(np.asfortranarray([[3.0, 4.0]]), np.array([10.0]), 1e-12)
    if not np.allclose(u, [1.2, 1.6]):
        wrong = f"a compiled kernel answers {u} instead of [1.2 1.6]"
        return Finding("broken", "kernels", wrong, "pip install --upgrade --force-reinstall numba")
    if os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0"):
        return Finding("note", "kernels", "run as plain Python: NUMBA_DISABLE_JIT is set", "unset NUMBA_DISABLE_JIT")
    return Finding("ok", "kernels", "compile and run")


def _cache() -> Finding:
    from cartctl.kernel_cache import cache_folder
    from cartctl.solvers import dls

    folder = cache_folder(Path(dls.__file__))  # of the kernel that has just been tried
    if folder:
        return Finding("ok", "kernel cache", str(folder.parent))
    trouble = "not writable, so every process compiles anew"
    return Finding("note", "kernel cache", trouble, "export CARTCTL_CACHE_DIR=<folder>")


def _blas() -> Finding:
    import numpy as np

    blas = np.show_config(mode="dicts")["Build Dependencies"]["blas"]
    given = [f"{name}={os.environ[name]}" for name in _THREADS if name in os.environ]
    threads = ", ".join(given) or f"threads not limited, {os.cpu_count()} cores"
    return Finding("ok", "BLAS", f"{blas.get('name')} {blas.get('version')}, {threads}")


def _viser() -> Finding:
    remedy = "pip install 'cartctl[play]'"
    try:
        version = metadata.version("viser")
    except metadata.PackageNotFoundError:
        return Finding("note", "viser", "not installed; only `cartctl play` wants it", remedy)
    reason = try_imports(["viser"])["viser"].reason
    if reason or _numbers(version) < _numbers(VISER):
        return Finding(
            "note", "viser", f"{version}, {reason or f'expected {VISER} or later'}; `cartctl play` wants it", remedy
        )
    return Finding("ok", "viser", version)


def _browser() -> Finding:
    path = next(filter(None, map(shutil.which, _BROWSERS)), None)
    if path:
        return Finding("ok", "chromium", path)
    return Finding("note", "chromium", "not found; only tests of the HTML page want it", "sudo apt install chromium")
