"""The command line: one thin file a verb; everything it does is a call of the library."""

from __future__ import annotations

import sys
from typing import Any

_NEEDED = ("typer", "rich", "click")


def main() -> None:
    """Run ``cartctl`` on sys.argv; ends the process with 0, 1 (trouble), 2 (bad input) or 130 (Ctrl-C)."""
    try:
        from cartctl.cli.app import app
    except ModuleNotFoundError as error:  # without these not even `cartctl doctor` can speak
        missing = (error.name or "").partition(".")[0]
        if missing not in _NEEDED:
            raise
        print(f"error: {missing} is not installed; pip install 'typer>=0.12' 'rich>=13'", file=sys.stderr)
        sys.exit(1)
    except KeyboardInterrupt:
        sys.exit(130)
    sys.exit(_run(app))


def _run(app: Any) -> int:
    """The exit code of ``app``; wrong usage is one line, as every other bad input."""
    import typer

    # typer brings its own click, whose names are not public
    usage_error: type[Any] = typer.BadParameter.__mro__[1]
    try:
        return int(app(prog_name="cartctl", standalone_mode=False) or 0)
    except (typer.Abort, KeyboardInterrupt):
        return 130
    except usage_error as error:
        context = getattr(error, "ctx", None)
        said = " ".join(str(error.format_message()).split()).rstrip(".")
        if context is not None and type(error).__name__ == "NoArgsIsHelpError":
            print(context.get_help())
            return 2
        where = "cartctl" if context is None else context.command_path
        print(f"error: {said}; {where} --help shows what there is", file=sys.stderr)
        return 2
