"""What all verbs share: where they print, how they fail, and how they show that they are at work."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import wraps
from typing import Annotated, Any, ParamSpec, Protocol

import typer
from rich import box
from rich.console import Console, RenderableType
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn
from rich.table import Table
from rich.text import Text

from cartctl.errors import CartctlError, CartctlWarning
from cartctl.report.numbers import number as number

P = ParamSpec("P")

Debug = Annotated[bool, typer.Option("--debug", help="Show the traceback of an unexpected error.")]


def out() -> Console:
    """Standard output; made anew, so that it sees redirections. Names from a URDF are never read as markup."""
    return Console(highlight=False, markup=False, emoji=False)


def err() -> Console:
    """Standard error: progress, warnings, errors."""
    return Console(stderr=True, highlight=False, markup=False, emoji=False)


def say(kind: str, message: str, style: str) -> None:
    """``kind: message`` on standard error, as one line however long."""
    line = Text(" ".join(message.split()))
    err().print(Text(f"{kind}: ", style=style) + line, soft_wrap=True)


def verb(function: Callable[P, None]) -> Callable[P, None]:
    """A verb whose errors are one line: exit code 2 for bad input, 1 for a bug, 130 for Ctrl-C."""

    @wraps(function)
    def guarded(*args: P.args, **kwargs: P.kwargs) -> None:
        try:
            with warnings.catch_warnings():
                _one_line_warnings()
                function(*args, **kwargs)
        except CartctlError as error:
            say("error", str(error), "bold red")
            raise typer.Exit(2) from None
        except KeyboardInterrupt:
            say("interrupted", "before it was done", "bold yellow")
            raise typer.Exit(130) from None
        except (typer.Exit, typer.Abort, BrokenPipeError):
            raise
        except ImportError as error:
            if kwargs.get("debug"):
                raise
            say("error", f"{error}; `cartctl doctor` tells what is missing and how to mend it", "bold red")
            raise typer.Exit(2) from None
        except MemoryError as error:
            say("error", f"not enough memory: {error}; a larger --dt or a shorter --duration needs less", "bold red")
            raise typer.Exit(1) from None
        except Exception as error:
            if kwargs.get("debug"):
                raise
            advice = "run it again with --debug for the traceback"
            say("error", f"unexpected {type(error).__name__}: {error} ({advice})", "bold red")
            raise typer.Exit(1) from None

    return guarded


def _one_line_warnings() -> None:
    """Show every CartctlWarning as ``warning: ...``; for use inside catch_warnings."""
    plain = warnings.showwarning

    def show(message: Warning | str, category: type[Warning], *where: Any, **more: Any) -> None:
        if issubclass(category, CartctlWarning):
            say("warning", str(message), "bold yellow")
        else:
            plain(message, category, *where, **more)

    warnings.showwarning = show
    warnings.simplefilter("always", CartctlWarning)


def facts(rows: Sequence[tuple[str, RenderableType]]) -> Table:
    """Names on the left, what they are on the right."""
    table = Table.grid(padding=(0, 2))
    table.add_column(style="bold", no_wrap=True)
    table.add_column(overflow="fold")
    for name, value in rows:
        table.add_row(name, value)
    return table


def columns(first: str, *rest: str) -> Table:
    """An empty table: the first column holds names, the others numbers."""
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0), header_style="bold", show_edge=False)
    table.add_column(first, overflow="fold")
    for name in rest:
        table.add_column(name, justify="right", no_wrap=True)
    return table


@contextmanager
def busy(doing: str) -> Iterator[None]:
    """A spinner while something takes its time; nothing where nobody watches."""
    console = err()
    if not console.is_terminal:
        yield
        return
    with console.status(Text(doing)):
        yield


class Tell(Protocol):
    """What a loop tells of itself now and then: steps made, steps to make, and what it is at, if that has changed."""

    def __call__(self, k: int, n: int, doing: str | None = None, /) -> None:
        """Show it."""
        ...


@contextmanager
def progress(doing: str) -> Iterator[Tell]:
    """A bar with the time left, as a function of steps made and steps to make; it leaves no trace."""
    console = err()
    parts = (TextColumn("{task.description}", markup=False), BarColumn(), TaskProgressColumn(), TimeRemainingColumn())
    with Progress(*parts, console=console, transient=True, auto_refresh=False, disable=not console.is_terminal) as bar:
        task = bar.add_task(doing, total=None)

        def tell(k: int, n: int, doing: str | None = None, /) -> None:
            bar.update(task, completed=k, total=n, description=doing, refresh=True)

        yield tell
