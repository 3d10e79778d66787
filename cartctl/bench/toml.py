"""TOML with the line of every key: the standard reader has the values, a scan of the text the places."""

from __future__ import annotations

import re
import sys
from typing import Any

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

from cartctl.bench.fields import Keys
from cartctl.errors import ScenarioError

_TOKEN = re.compile(
    r'(?P<string>"""(?:\\.|[^\\])*?"""|\'\'\'.*?\'\'\'|"(?:\\.|[^"\\\n])*"|\'[^\'\n]*\')'
    r"|(?P<comment>\#[^\n]*)|(?P<newline>\n)|(?P<blank>[ \t\r]+)"
    r"|(?P<sign>[\[\]{}=,.])|(?P<bare>[^\s\[\]{}=,.\#\"']+)",
    re.DOTALL,
)


def parse(content: str, name: str) -> dict[str, Any]:
    """The values; raises ScenarioError naming the line of what is no TOML."""
    try:
        table: dict[str, Any] = tomllib.loads(content)
        return table
    except tomllib.TOMLDecodeError as error:
        found = re.search(r"\(at line (\d+), column (\d+)\)", str(error))
        end = content.count("\n") + 1
        line, column = (found[1], found[2]) if found else (str(end), "1")
        what = str(error).partition(" (at ")[0]
        raise ScenarioError(f"{what} at column {column}; expected TOML", (), f"{name}, line {line}") from None


def lines(content: str) -> dict[Keys, int]:
    """The line, from 1, of every table and key of valid TOML, by the keys that lead to it."""
    return _Scan(content).places


def line_of(places: dict[Keys, int], keys: Keys) -> int:
    """The line of ``keys``, or of the nearest thing around it."""
    while keys and keys not in places:
        keys = keys[:-1]
    return places.get(keys, 1)


class _Scan:
    """One walk over the tokens of valid TOML."""

    def __init__(self, content: str) -> None:
        self.places: dict[Keys, int] = {}
        self._counts: dict[Keys, int] = {}
        self._tokens: list[tuple[str, str, int]] = []
        line = 1
        for match in _TOKEN.finditer(content):
            kind, piece = str(match.lastgroup), match.group()
            if kind not in ("comment", "blank"):
                self._tokens.append((kind, piece, line))
            line += piece.count("\n")
        self._at = 0
        table: Keys = ()
        while self._at < len(self._tokens):
            if self._peek() == "\n":
                self._at += 1
            elif self._peek() == "[":
                table = self._header()
            else:
                self._entry(table)

    def _peek(self) -> str:
        return self._tokens[self._at][1] if self._at < len(self._tokens) else ""

    def _header(self) -> Keys:
        line, self._at = self._tokens[self._at][2], self._at + 1
        many = self._peek() == "["
        self._at += many
        keys = self._resolved(self._key("]"))
        self._at += many
        if many:
            index = self._counts.get(keys, -1) + 1
            self._counts[keys] = index
            keys = (*keys, index)
        self.places.setdefault(keys, line)
        return keys

    def _resolved(self, names: list[str]) -> Keys:
        """A header's names with the index of each array of tables on the way, but for the last name."""
        keys: Keys = ()
        for i, name in enumerate(names):
            keys = (*keys, name)
            if i < len(names) - 1 and keys in self._counts:
                keys = (*keys, self._counts[keys])
        return keys

    def _key(self, end: str) -> list[str]:
        """The names of a dotted key, up to ``end``, which is passed."""
        names = []
        while self._peek() != end:
            kind, piece, _ = self._tokens[self._at]
            if kind in ("bare", "string"):
                names.append(piece.strip("\"'"))
            self._at += 1
        self._at += 1
        return names

    def _entry(self, table: Keys) -> None:
        line = self._tokens[self._at][2]
        keys = (*table, *self._key("="))
        for k in range(len(table) + 1, len(keys) + 1):
            self.places.setdefault(keys[:k], line)
        self._value(keys)

    def _value(self, keys: Keys) -> None:
        """What follows =, with the entries of arrays and inline tables."""
        opening = self._peek()
        if opening not in ("[", "{"):
            while self._peek() not in ("\n", ",", "]", "}", ""):
                self._at += 1
            return
        closing, index = {"[": "]", "{": "}"}[opening], 0
        self._at += 1
        while self._peek() != closing:
            if self._peek() in (",", "\n"):
                self._at += 1
            elif opening == "{":
                self._entry(keys)
            else:
                self.places.setdefault((*keys, index), self._tokens[self._at][2])
                self._value((*keys, index))
                index += 1
        self._at += 1
