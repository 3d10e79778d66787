"""Reading tables of plain data, so that whatever is wrong is named by its key."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from difflib import get_close_matches
from typing import Any, TypeVar

from cartctl import checks
from cartctl.errors import CartctlError, ScenarioError

T = TypeVar("T")
Keys = tuple[str | int, ...]
_REQUIRED: Any = object()


@contextmanager
def under(*keys: str | int) -> Iterator[None]:
    """Blame ``keys`` for every error inside: a ScenarioError whose keys begin with them."""
    try:
        yield
    except ScenarioError as error:
        raise ScenarioError(error.reason, (*keys, *error.keys)) from None
    except CartctlError as error:
        raise ScenarioError(str(error), keys) from None


class Fields:
    """The entries of one table, taken out one by one; None stands for not given; :meth:`end` refuses what is left."""

    def __init__(self, table: Any) -> None:
        if not isinstance(table, Mapping):
            raise ScenarioError(f"is {table!r:.60}; expected a table of keys and values")
        self._left = {key: value for key, value in table.items() if value is not None}
        self._known: list[str] = []

    def __contains__(self, key: str) -> bool:
        return key in self._left

    def take(self, key: str, check: Callable[[str, Any], T], default: Any = _REQUIRED) -> T:
        """The value under ``key``, as ``check(key, value)`` makes it; raises ScenarioError naming the key."""
        self._known.append(key)
        if key not in self._left:
            if default is _REQUIRED:
                # A misspelt key is no key and leaves its right name missing: of the two the typing error is the news.
                typed = get_close_matches(
                    key, [str(left) for left in self._left if left not in self._known], n=1, cutoff=0.75
                )
                raise ScenarioError(f"{key} is missing; " + (f"is it {typed[0]!r}?" if typed else "expected it here"))
            return default  # type: ignore[no-any-return]
        with under(key):
            return check(key, self._left.pop(key))

    def end(self) -> None:
        """Refuse what is left; raises ScenarioError with the closest known key."""
        for key in self._left:
            close = get_close_matches(str(key), self._known, n=1)
            offer = f"did you mean {close[0]!r}?" if close else "expected one of " + ", ".join(sorted(self._known))
            raise ScenarioError(f"{key} is no key of this table; {offer}", (key,))


def text(name: str, value: Any) -> str:
    """A string that is not empty."""
    if not isinstance(value, str) or not value.strip():
        raise ScenarioError(f"{name} is {value!r}; expected text")
    return value


def words(name: str, value: Any) -> tuple[str, ...]:
    """One string, or a list of them."""
    if isinstance(value, str):
        return (text(name, value),)
    if not isinstance(value, Sequence) or not value:
        raise ScenarioError(f"{name} is {value!r}; expected a string, or a list of them")
    return tuple(text(f"{name}[{i}]", each) for i, each in enumerate(value))


def flag(name: str, value: Any) -> bool:
    """True or false."""
    if not isinstance(value, bool):
        raise ScenarioError(f"{name} is {value!r}; expected true or false")
    return value


def positive(name: str, value: Any) -> float:
    """A finite number above 0."""
    return checks.number(name, value, low=0.0, strict=True)


def not_negative(name: str, value: Any) -> float:
    """A finite number of at least 0."""
    return checks.number(name, value, low=0.0)


def bound(name: str, value: Any) -> float:
    """A number above 0, or infinity."""
    return value if value == float("inf") else positive(name, value)


def whole(name: str, value: Any) -> int:
    """A whole number of at least 1."""
    if isinstance(value, bool) or not isinstance(value, int) or value < 1:
        raise ScenarioError(f"{name} is {value!r}; expected a whole number of at least 1")
    return value


def point(name: str, value: Any) -> list[float]:
    """(3,) as plain numbers."""
    return [float(x) for x in checks.vector(name, value, 3)]


def points(name: str, value: Any) -> list[list[float]]:
    """A list of (3,)."""
    return [point(f"{name}[{i}]", each) for i, each in enumerate(checks.listed(name, value))]


def one_of(*known: str) -> Callable[[str, Any], str]:
    """One of a few words."""

    def check(name: str, value: Any) -> str:
        if value not in known:
            close = get_close_matches(str(value), known, n=1)
            offer = f"did you mean {close[0]!r}?" if close else "expected one of " + ", ".join(known)
            raise ScenarioError(f"{name} is {value!r}; {offer}")
        return str(value)

    return check
