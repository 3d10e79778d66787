"""The command line: one thin file a verb; everything it does is a call of the library."""

from __future__ import annotations

import sys

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
    app(prog_name="cartctl")
