"""Robots by name: what ``cc.load("panda")`` knows of each beyond its URDF."""

from __future__ import annotations

import re
from functools import cache

from cartctl.errors import RobotNotFound
from cartctl.model.catalog import arms, hands, humanoids, own, torsos
from cartctl.model.catalog.entry import LibraryEntry

__all__ = ["LibraryEntry", "entries", "find", "robots"]

_PLANAR = re.compile(r"planar0*([1-9]\d{0,4})r")


def entries() -> dict[str, LibraryEntry]:
    """Return all entries that have a name of their own; :func:`find` also knows ``planar<n>R`` for any n."""
    return dict(_entries())


def find(name: str) -> LibraryEntry:
    """Return the entry of that name; case, blanks, - and _ do not matter.

    ``planar<n>R`` is known for any n from 1 to 99999. Raises RobotNotFound with the closest names.
    """
    key = _key(str(name))
    if key in (by_key := _by_key()):
        return by_key[key]
    if planar := _PLANAR.fullmatch(key):
        return own.planar(int(planar[1]))
    raise RobotNotFound(name, _entries(), "(planar<n>R for any n, or the path of a .urdf file)")


def robots() -> dict[str, str]:
    """Return the robots known by name, with one line about each.

    >>> import cartctl as cc
    >>> "panda" in cc.robots()
    True
    """
    return {name: entry.summary for name, entry in _entries().items()}


@cache
def _entries() -> dict[str, LibraryEntry]:
    families = (own.ENTRIES, arms.ENTRIES, torsos.ENTRIES, hands.ENTRIES, humanoids.ENTRIES)
    return {entry.name: entry for family in families for entry in family}


@cache
def _by_key() -> dict[str, LibraryEntry]:
    return {_key(name): entry for name, entry in _entries().items()}


def _key(name: str) -> str:
    return re.sub(r"[-_\s]+", "", name).casefold()
