"""``cartctl doctor``: what is installed, what is missing, and the command that mends it."""

from __future__ import annotations

import typer
from rich.text import Text

from cartctl.cli.console import Debug, busy, out, verb

_STYLES = {"ok": "green", "note": "yellow", "missing": "bold red", "broken": "bold red"}


@verb
def doctor(debug: Debug = False) -> None:
    """Check this installation; exit code 1 if something it needs is missing."""
    from rich.table import Table

    from cartctl.cli.probes import findings

    with busy("checking"):
        found = findings()
    table = Table.grid(padding=(0, 2))
    for _ in range(3):
        table.add_column(overflow="fold")
    for finding in found:
        table.add_row(Text(finding.verdict, style=_STYLES[finding.verdict]), finding.subject, finding.detail)
        if finding.remedy:
            table.add_row("", "", Text(finding.remedy, style="bold"))
    out().print(table)
    needed = [finding.subject for finding in found if finding.verdict in ("missing", "broken")]
    out().print()
    if needed:
        out().print(f"To be mended: {', '.join(needed)}.", style="bold red")
        raise typer.Exit(1)
    out().print("All that cartctl needs is there.", style="green")
