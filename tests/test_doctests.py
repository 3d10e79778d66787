"""The examples in the docstrings run, and the main names have one."""

from __future__ import annotations

import doctest
import inspect
import pkgutil
from importlib import import_module

import pytest

import cartctl as cc

SHOWN = (
    "Controller", "Damped", "Equation", "FrameTask", "Inequality", "JointRange", "Limits", "PostureTask", "Problem",
    "ProjectedGradient", "SNS", "Scene", "Solution", "State", "TaskPriority", "Truncated", "Circle", "DHChain", "cite",
    "inverse_kinematics", "load", "planar", "robots", "simulate", "solve",
)  # fmt: skip


def _with_examples() -> list[str]:
    """Every module of the package that has an example, found by its text so that no other is imported."""
    names = [found.name for found in pkgutil.walk_packages(cc.__path__, "cartctl.") if "__main__" not in found.name]
    found = []
    for name in names:
        spec = import_module(name.rpartition(".")[0]).__spec__
        assert spec is not None and spec.submodule_search_locations
        stem = f"{spec.submodule_search_locations[0]}/{name.rpartition('.')[2]}"
        for path in (f"{stem}.py", f"{stem}/__init__.py"):
            try:
                with open(path, encoding="utf-8") as file:
                    text = file.read()
            except FileNotFoundError:
                continue
            if ">>> " in text:
                found.append(name)
    return found


MODULES = _with_examples()


@pytest.mark.parametrize("module", MODULES)
def test_examples_run(module: str) -> None:
    failed, tried = doctest.testmod(import_module(module), optionflags=doctest.NORMALIZE_WHITESPACE)
    assert tried and not failed


@pytest.mark.parametrize("name", SHOWN)
def test_the_main_names_have_an_example(name: str) -> None:
    assert ">>> " in (inspect.getdoc(getattr(cc, name)) or "")
