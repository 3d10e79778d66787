"""The one package that the viewer needs beside cartctl's own."""

from __future__ import annotations

from typing import Any

from cartctl.errors import MissingDependencyError


def viser() -> Any:
    """The module; raises MissingDependencyError where it is not installed."""
    try:
        import viser
    except ImportError as error:
        raise MissingDependencyError(
            f"the live viewer needs viser, which cannot be imported ({error}): pip install 'cartctl[play]'"
        ) from None
    return viser
