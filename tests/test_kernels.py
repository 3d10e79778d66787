"""Kernels: the same numbers compiled and interpreted, a cache that can be moved, and none where none can be had."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from cartctl import kernel_cache
from tests import tolerances as tol

# Prints what the package's kernels answer, how often numba's cache was hit, and where it lies.
PROGRAM = """
import json, os, sys
import numpy as np
import cartctl as cc
from cartctl import kernels, spatial
from cartctl.solvers import dls
import numba
before = numba.config.CACHE_DIR
rng = np.random.default_rng(3)
answers = []
for m, n in [(1, 1), (2, 5), (5, 2), (4, 4), (6, 7), (0, 3)]:
    problem = cc.Problem([(rng.normal(size=(m, n)), rng.normal(size=m))])
    answers += cc.solve(problem, cc.DLS(0.1)).u.tolist()
singular = cc.Problem([([[1.0, 1.0], [1.0, 1.0]], [1.0, 2.0])])
answers += cc.solve(singular, cc.DLS(1e-9)).u.tolist()
for k in range(20):
    axis = rng.normal(size=3)
    angle = [0.0, 1e-9, 1.0, np.pi - 1e-9, np.pi][k % 5]
    answers += spatial.log3(spatial.rotation_about(axis / np.linalg.norm(axis), angle)).tolist()
stats = getattr(dls.damped_kernel.compiled, "stats", None)
print(json.dumps({
    "answers": answers,
    "jit": not numba.config.DISABLE_JIT,
    "hits": sum(stats.cache_hits.values()) if stats else 0,
    "kept": numba.config.CACHE_DIR == before,
    "own": str(kernels.__file__),
}))
"""


def run(program=PROGRAM, user=None, **environment):
    env = {**os.environ, **environment}
    env["PYTHONPATH"] = os.pathsep.join(p for p in sys.path if p)
    result = subprocess.run(
        [sys.executable, "-c", program], env=env, user=user, capture_output=True, text=True, check=False
    )
    assert result.returncode == 0, result.stderr
    assert not result.stderr, result.stderr
    return json.loads(result.stdout)


@pytest.fixture(scope="module")
def cache(tmp_path_factory):
    return tmp_path_factory.mktemp("cache")


@pytest.fixture(scope="module")
def compiled(cache):
    """The first run with an empty cache of its own."""
    return run(CARTCTL_CACHE_DIR=str(cache))


def test_interpreted_and_compiled_agree(compiled, tmp_path):
    interpreted = run(NUMBA_DISABLE_JIT="1", CARTCTL_CACHE_DIR=str(tmp_path))
    assert compiled["jit"] and not interpreted["jit"]
    assert len(compiled["answers"]) > 80
    np.testing.assert_allclose(interpreted["answers"], compiled["answers"], rtol=tol.EXACT, atol=tol.EXACT)


def test_the_cache_lies_where_it_is_told_to(compiled, cache):
    for folder in (cache / "kernels").iterdir():
        assert list(folder.rglob("*.nbi")) and list(folder.rglob("*.nbc"))
    beside = Path(compiled["own"]).parent
    assert not list(beside.rglob("*.nbi")), "compiled kernels beside the sources"


def test_the_second_process_compiles_nothing(compiled, cache):
    assert compiled["hits"] == 0
    again = run(CARTCTL_CACHE_DIR=str(cache))
    assert again["hits"] > 0
    np.testing.assert_array_equal(again["answers"], compiled["answers"])


def test_numbas_own_setting_is_put_back(compiled):
    assert compiled["kept"]


def test_a_file_where_the_cache_should_be(compiled, tmp_path):
    occupied = tmp_path / "occupied"
    occupied.write_text("not a folder")
    for place in (occupied, occupied / "below"):
        np.testing.assert_array_equal(run(CARTCTL_CACHE_DIR=str(place))["answers"], compiled["answers"])
    assert occupied.read_text() == "not a folder"


@pytest.mark.skipif(os.name != "posix", reason="POSIX permissions")
def test_a_cache_that_cannot_be_written(compiled, tmp_path):
    tmp_path.chmod(0o500)
    try:
        if os.geteuid() == 0:  # root may write anywhere, until it looks at the cache as somebody else
            program = "import os\nos.access = lambda path, mode: mode != os.W_OK\n" + PROGRAM
        else:
            program = PROGRAM
        answer = run(program, CARTCTL_CACHE_DIR=str(tmp_path))
    finally:
        tmp_path.chmod(0o700)
    np.testing.assert_array_equal(answer["answers"], compiled["answers"])
    assert not list(tmp_path.rglob("*.nbi"))


def test_old_caches_are_pruned_and_strangers_are_left_alone(compiled, tmp_path):
    """A handful is kept, the current one always; what is no cache of ours is nobody's business."""
    root = tmp_path / "kernels"
    for k in range(80):
        (root / f"{k:016x}").mkdir(parents=True)
        os.utime(root / f"{k:016x}", (1000.0 + k, 1000.0 + k))
    strangers = [root / f"my_kernels_{k}" for k in range(6)]
    for folder in strangers:
        folder.mkdir()
        (folder / "gauss.cl").write_text("a week's work")
        os.utime(folder, (10.0, 10.0))
    (root / "dangling").symlink_to(tmp_path / "nowhere")
    np.testing.assert_array_equal(run(CARTCTL_CACHE_DIR=str(tmp_path))["answers"], compiled["answers"])
    assert all((folder / "gauss.cl").is_file() for folder in strangers)
    left = {f.name for f in root.iterdir()} - {f.name for f in strangers} - {"dangling"}
    assert len(left) <= 64 and f"{0:016x}" not in left
    assert left - {f"{k:016x}" for k in range(80)}


def test_an_edit_of_what_a_kernel_imports_is_noticed_however_far(tmp_path):
    """A copy of the package, a far import and a stranger to the kernel edited in turn."""
    package = Path(kernel_cache.__file__).parent
    shutil.copytree(package, tmp_path / package.name, ignore=shutil.ignore_patterns("__pycache__", "*.toml", "*.js"))

    def key() -> str:
        code = (
            "from pathlib import Path\nfrom cartctl import kernel_cache as k\nimport json\n"
            "print(json.dumps(k._hash_of((Path(k.__file__).parent / 'solvers/exact/lexicographic.py',))))"
        )
        env = {**os.environ, "PYTHONPATH": str(tmp_path)}
        return subprocess.run(
            [sys.executable, "-c", code], env=env, cwd=tmp_path, capture_output=True, text=True
        ).stdout

    before = key()
    assert before
    for stranger in ("cli/track.py", "motion/controller.py", "paths/line.py"):
        (tmp_path / "cartctl" / stranger).open("a").write("\n# edited\n")
    assert key() == before
    for near in ("solvers/exact/rows.py", "solvers/exact/kinds.py", "checks.py"):
        (tmp_path / "cartctl" / near).open("a").write("\n# edited\n")
        assert key() != before
        before = key()


def test_importing_kernels_does_not_import_numba():
    code = "import sys; import cartctl.solvers.dls, cartctl.spatial; print(int('numba' in sys.modules))"
    assert run(code) == 0


@pytest.mark.skipif(os.name != "posix", reason="POSIX terminals")
@pytest.mark.parametrize("terminal", [True, False])
def test_a_long_compilation_is_announced_once_to_a_terminal(terminal, tmp_path):
    """What takes longer than the patience allowed says so, once a process, and not where nobody waits."""
    import pty

    code = """
import numpy as np
from cartctl import kernels, spatial
from cartctl.solvers.dls import damped_solve
kernels._SLOW = PATIENCE
damped_solve(np.ones((1, 2)), np.ones(1), 1.0)
spatial.log3(np.eye(3))
"""
    ours, theirs = pty.openpty()
    env = {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p), "CARTCTL_CACHE_DIR": str(tmp_path)}
    told = []
    for patience in ("0.1", "60.0"):  # the second time nobody has waited for long
        process = subprocess.Popen(
            [sys.executable, "-c", code.replace("PATIENCE", patience)],
            env=env,
            stderr=theirs if terminal else subprocess.PIPE,
            text=True,
        )
        piped = process.communicate()[1] or ""
        assert process.returncode == 0, piped
        os.set_blocking(ours, False)
        try:
            told.append(os.read(ours, 4096).decode() if terminal else piped)
        except BlockingIOError:
            told.append("")
    os.close(ours)
    os.close(theirs)
    assert told[0].count("cartctl is compiling (once, then kept on disk)") == int(terminal)
    assert told[1] == ""
