"""Who may import whom: read from the sources, and tried with the robot side missing."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from pathlib import Path

import pytest

import cartctl

PACKAGE = Path(cartctl.__file__).parent
FILES = sorted(PACKAGE.rglob("*.py"))

# Each unit may import those named here and itself: two towers on common ground, joined by the levels.
GROUND = {"errors", "checks", "kernels", "kernel_cache"}
ALGEBRA = GROUND | {"algebra"}
ROBOT = GROUND | {"spatial", "paths", "model"}
JOINED = (
    ALGEBRA | ROBOT | {"braking", "solvers", "tasks", "constraints", "objectives", "analysis", "dynamics", "levels"}
)
MAY_IMPORT = {
    "errors": set(),
    "checks": {"errors"},
    "kernel_cache": set(),
    "kernels": {"errors", "checks", "kernel_cache"},
    "braking": GROUND,
    "algebra": GROUND,
    "solvers": ALGEBRA,
    "spatial": GROUND,
    "paths": GROUND | {"spatial"},
    "model": ROBOT - {"model"},
    "tasks": ROBOT | {"algebra"},
    "constraints": ROBOT | {"algebra", "braking"},
    "objectives": ROBOT | {"algebra"},
    "analysis": ROBOT | {"algebra", "tasks"},
    "statics": GROUND | {"spatial", "algebra"},
    "dynamics": ROBOT | {"algebra"},
    "levels": JOINED - {"levels"},
    "files": {"errors"},
    "compiled": JOINED,
    "motion": JOINED | {"files", "compiled"},
    "calibration": JOINED | {"files"},
    "wholepath": JOINED | {"files", "motion"},
    "report": JOINED | {"files", "motion", "calibration", "wholepath"},
    "viewer": JOINED | {"motion", "report"},
    "bench": JOINED | {"files", "motion", "report"},
    "cli": JOINED | {"viewer", "analysis", "bench", "calibration", "files", "motion", "wholepath", "report"},
    "__main__": {"cli"},
}
# The named exceptions: Run.plot and Run.html, PlanReport.plot.
EXCEPTIONS = {("motion/run.py", "report"), ("wholepath/report.py", "report")}


def unit(path):
    """``algebra`` for cartctl/algebra/svd.py, ``errors`` for cartctl/errors.py."""
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def imports(path):
    """``(module, inside_function)`` of every import of the file, absolute, wherever it stands."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    here = ["cartctl", *path.relative_to(PACKAGE).with_suffix("").parts]
    found = []

    def visit(node, inside):
        if isinstance(node, ast.Import):
            found.extend((alias.name, inside) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = ".".join(here[: -node.level]) if node.level else ""
            module = ".".join(part for part in (base, node.module) if part)
            if module == "cartctl":  # from cartctl import checks
                found.extend((f"cartctl.{alias.name}", inside) for alias in node.names)
            else:
                found.append((module, inside))
        elif isinstance(node, ast.Call) and getattr(node.func, "id", getattr(node.func, "attr", "")) in (
            "import_module",
            "__import__",
        ):
            first = node.args[0] if node.args else None
            text = first.value if isinstance(first, ast.Constant) else None
            if isinstance(first, ast.JoinedStr) and isinstance(first.values[0], ast.Constant):
                text = first.values[0].value
            if isinstance(text, str):
                found.append((text.rstrip("."), True))
        inside = inside or isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef, ast.Lambda))
        for child in ast.iter_child_nodes(node):
            visit(child, inside)

    visit(tree, False)
    return found


def own(path):
    """The units of cartctl a file imports, with whether inside a function."""
    names = {(module.split(".")[1], inside) for module, inside in imports(path) if module.startswith("cartctl.")}
    return {(home(name), inside) for name, inside in names if name != "__version__"}


def home(name):
    """The unit itself, or the one a public name such as ``cartctl.simulate`` comes from."""
    if (PACKAGE / name).is_dir() or (PACKAGE / f"{name}.py").is_file() or name not in cartctl.__all__:
        return name
    return getattr(cartctl, name).__module__.split(".")[1]


def test_every_unit_has_its_place():
    units = {unit(f) for f in FILES} - {"__init__"}
    assert units <= set(MAY_IMPORT), f"add {units - set(MAY_IMPORT)} to the layers"


def test_the_layers_have_no_cycle():
    """The table itself: what a unit may import may not, in turn, import it."""
    for name, allowed in MAY_IMPORT.items():
        for other in allowed:
            assert name not in MAY_IMPORT[other], f"{name} and {other} may import each other"
    assert "solvers" not in MAY_IMPORT["model"] and "model" not in MAY_IMPORT["solvers"]


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_no_upward_import(path):
    name = unit(path)
    if name == "__init__":
        pytest.skip("the public names come from everywhere, when they are first used")
    for other, inside in own(path):
        if other == name or other in MAY_IMPORT[name]:
            continue
        if (path.relative_to(PACKAGE).as_posix(), other) in EXCEPTIONS and inside:
            continue
        pytest.fail(f"{path.relative_to(PACKAGE)} imports {other}, which lies above or beside {name}")


@pytest.mark.parametrize("folder", ["algebra", "solvers", "errors", "checks", "kernels"])
def test_the_algebra_knows_no_robots(folder):
    files = [f for f in FILES if unit(f) == folder]
    assert files
    for path in files:
        assert not [m for m, _ in imports(path) if m.split(".")[0] in ("pinocchio", "meshcat", "matplotlib", "coal")]


def test_the_reader_sees_every_kind_of_import(tmp_path, monkeypatch):
    source = "from cartctl import report\nfrom . import a\nfrom ..motion import b\ndef f():\n    import cartctl.cli.x\n"
    source += "    from cartctl import simulate\n"
    source += "    return import_module('cartctl.bench.y'), import_module(f'cartctl.model.{f}')\n"
    (tmp_path / "tasks").mkdir()
    path = tmp_path / "tasks" / "frame.py"
    path.write_text(source)
    monkeypatch.setattr(sys.modules[__name__], "PACKAGE", tmp_path)
    expected = {("report", False), ("tasks", False), ("motion", False), ("motion", True)}
    assert own(path) == expected | {("cli", True), ("bench", True), ("model", True)}


def python(code, **environment):
    env = {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p), **environment}
    result = subprocess.run([sys.executable, "-c", code], env=env, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    return result.stdout


def test_solvers_work_without_pinocchio():
    python(
        "import sys\n"
        "for name in ('pinocchio', 'meshcat', 'matplotlib', 'coal', 'hppfcl', 'example_robot_data'):\n"
        "    sys.modules[name] = None\n"
        "import cartctl.solvers\n"
        "import cartctl as cc\n"
        "for name in cc.solvers():\n"
        "    p = cc.Problem([([[1.0, 2.0], [3.0, -1.0]], [1.0, 2.0])])\n"
        "    s = cc.solve(p, name)\n"
        "    assert s.residuals[0] < 3.0 and s.status\n"
        "import cartctl.spatial, cartctl.statics\n"
    )


def test_importing_the_package_imports_nothing_heavy():
    heavy = ("pinocchio", "numba", "matplotlib", "meshcat", "scipy", "numpy", "pyarrow", "typer", "rich", "coal")
    code = f"import sys, cartctl\ncartctl.__version__, dir(cartctl)\nprint([m for m in {heavy} if m in sys.modules])"
    assert python(code).strip() == "[]"


def test_every_public_name_resolves_and_unknown_ones_do_not():
    for name in cartctl.__all__:
        value = getattr(cartctl, name)
        assert name == "__version__" or callable(value), f"cc.{name} is {value!r}"
        assert name in dir(cartctl)
    for name in cartctl._MODULES:
        assert getattr(cartctl, name).__name__ == f"cartctl.{name}"
        assert all(hasattr(getattr(cartctl, name), inner) for inner in getattr(cartctl, name).__all__)
    with pytest.raises(AttributeError, match="no_such_name"):
        cartctl.no_such_name  # noqa: B018
