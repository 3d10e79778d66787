"""The public names: all importable, documented, typed, and imported only when used."""

from __future__ import annotations

import inspect
import re
import subprocess
import sys
from pathlib import Path

import pytest

import cartctl as cc

ROOT = Path(__file__).parent.parent


@pytest.mark.parametrize("name", [n for n in cc.__all__ if n != "__version__"])
def test_every_public_name_is_there_and_documented(name: str) -> None:
    thing = getattr(cc, name)
    doc = inspect.getdoc(thing)
    assert doc and len(doc) > 20
    if inspect.isclass(thing):
        for method, function in inspect.getmembers(thing, inspect.isfunction):
            if not method.startswith("_") and function.__module__.startswith("cartctl"):
                assert inspect.getdoc(function), f"{name}.{method}"


def test_the_api_page_lists_exactly_the_public_names() -> None:
    listed = re.findall(r"^- `(\w+)`", (ROOT / "docs" / "api.md").read_text(), re.MULTILINE)
    assert sorted(listed) == sorted(n for n in cc.__all__ if n != "__version__")


def test_editors_see_what_python_finds() -> None:
    source = (ROOT / "cartctl" / "__init__.py").read_text()
    for_editors = set(re.findall(r"import (\w+) as \1", source))
    assert for_editors == set(cc.__all__) - {"__version__"}


def test_unknown_names_are_attribute_errors() -> None:
    with pytest.raises(AttributeError, match="no attribute 'pinvv'"):
        cc.pinvv  # noqa: B018


@pytest.mark.parametrize(
    ("code", "absent"),
    [
        ("import cartctl", "numpy pinocchio numba matplotlib meshcat scipy pyarrow typer"),
        ("import cartctl; cartctl.Controller, cartctl.load", "numba matplotlib meshcat pyarrow typer"),
        ("import cartctl.solvers; cartctl.solvers.solvers()", "pinocchio numba matplotlib meshcat"),
    ],
)
def test_imports_bring_no_more_than_needed(code: str, absent: str) -> None:
    check = f"{code}\nimport sys\nprint([m for m in {absent.split()} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", check], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_the_version_is_the_distributions() -> None:
    from importlib.metadata import version

    assert cc.__version__ == version("cartctl")


def test_every_error_is_a_cartctl_error_with_a_docstring() -> None:
    from cartctl import errors

    for name, thing in inspect.getmembers(errors, inspect.isclass):
        if thing.__module__ == "cartctl.errors" and name not in ("CartctlWarning", "RunInterrupted"):
            assert issubclass(thing, cc.CartctlError) and inspect.getdoc(thing), name


@pytest.mark.parametrize("first", ["", "import cartctl.solvers;", "from cartctl.solvers.dls import DLS;", "cc.solve;"])
def test_the_package_of_solvers_and_their_list_share_a_name(first: str) -> None:
    code = f"import cartctl as cc; {first} print(sorted(cc.solvers()))\nimport cartctl.solvers\n"
    code += "cc.solvers.solve, cc.solvers()"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "'dls'" in done.stdout


def test_a_missing_package_is_named_with_the_command_that_installs_it() -> None:
    code = (
        "import sys; sys.modules['pinocchio'] = None\n"
        "import cartctl as cc\n"
        "cc.solve, cc.Problem\n"
        "try: cc.load\n"
        "except cc.CartctlError as error: print(type(error).__name__, error)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "MissingDependencyError" in done.stdout and "pip install pin" in done.stdout
