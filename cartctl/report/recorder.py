"""A meshcat window that keeps what it is sent: no server, no socket, no subprocess.

Meshcat's ``Visualizer`` only ever calls ``window.send(command)``; a live window packs the lowered command and ships
it to a browser, this one packs it and keeps it for a page that is written later.
"""

from __future__ import annotations

import re
from typing import Any, Protocol

import meshcat
import meshcat.path
import umsgpack

_UUID = re.compile(r"[0-9a-f]{8}(-[0-9a-f]{4}){3}-[0-9a-f]{12}")


class Command(Protocol):
    """What meshcat sends: anything that lowers itself to a dictionary of plain values."""

    def lower(self) -> dict[str, Any]:
        """Return the command as its viewer reads it."""
        ...


class Recorder:
    """Collects packed commands in the order in which they were sent.

    Numbers are packed in single precision: half the bytes, and finer than any screen (0.1 um at 1 m). Identifiers are
    replaced by running numbers: meshcat's hold the time and the machine's hardware address, which are nobody's
    business, and without them the same run gives the same page.
    """

    def __init__(self) -> None:
        self.commands: list[bytes] = []
        self._ids: dict[str, str] = {}

    def send(self, command: Command) -> None:
        """Pack one command (MessagePack, as the viewer expects it) and keep it."""
        self.commands.append(umsgpack.packb(self._numbered(command.lower()), force_float_precision="single"))

    def visualizer(self) -> Any:
        """Return a meshcat ``Visualizer`` that draws into this recorder, at meshcat's usual root path."""
        return meshcat.Visualizer.view_into(self, meshcat.path.Path(("meshcat",)))

    def _numbered(self, value: Any) -> Any:
        """Return ``value`` with every UUID in it replaced by its number."""
        if isinstance(value, dict):
            return {key: self._numbered(item) for key, item in value.items()}
        if isinstance(value, (list, tuple)):
            return [self._numbered(item) for item in value]
        if isinstance(value, str) and _UUID.fullmatch(value):
            return self._ids.setdefault(value, f"id{len(self._ids)}")
        return value
