"""Finished runs on disk, one line each, written as they come: what a kill -9 leaves is whole but for its last line.

The journal is append-only JSON lines. A line that a kill cut short is dropped when the journal is opened again, and a
run that is there already is not written twice.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import IO, Any

from cartctl.bench.schema import VERSION
from cartctl.errors import BenchError, ResultFileError

NAME = "runs.jsonl"
STEPS = "steps"


class Journal:
    """The journal of one folder, held by one process at a time; a context manager.

    Raises BenchError where another process writes to the folder, ResultFileError for a journal of another version.
    """

    def __init__(self, folder: Path) -> None:
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._file: IO[bytes] = (folder / NAME).open("a+b")
        except OSError as error:
            reason = error.strerror or error
            raise BenchError(f"--out is {str(folder)!r}: {reason}; expected a folder that can be written") from None
        self.folder = folder
        _lock(self._file, folder)
        self._drop_torn_line()
        self.done = {str(row["key"]) for row in read(folder)}

    def __enter__(self) -> Journal:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    def add(self, row: dict[str, Any], steps: bytes = b"") -> bool:
        """Write a finished run, its steps first; whether it was new."""
        key = str(row["key"])
        if key in self.done:
            return False
        if steps:
            place = self.folder / STEPS / f"{key}.npz"
            place.parent.mkdir(exist_ok=True)
            part = place.with_suffix(".part")
            part.write_bytes(steps)
            os.replace(part, place)
        self._file.write(json.dumps(row, allow_nan=False).encode() + b"\n")
        self._file.flush()  # the kernel has it: a kill of this process takes nothing back
        self.done.add(key)
        return True

    def _drop_torn_line(self) -> None:
        """Cut what follows the last line end, and lines at the end that are no JSON."""
        self._file.seek(0, os.SEEK_END)
        size = end = self._file.tell()
        while end:
            start = max(0, end - 65536)
            self._file.seek(start)
            found = self._file.read(end - start).rfind(b"\n")
            if found >= 0:
                end = start + found + 1
                break
            end = start
        if end < size:
            self._file.truncate(end)
        self._file.seek(0, os.SEEK_END)


def read(folder: Path) -> Iterator[dict[str, Any]]:
    """The rows of a folder's journal one by one, each key once; a torn last line is left out.

    Raises ResultFileError.
    """
    seen: set[str] = set()
    path = folder / NAME
    if not path.is_file():
        return
    with path.open("rb") as file:
        for number, line in enumerate(file, start=1):
            if not line.endswith(b"\n"):
                return
            try:
                row = json.loads(line)
                key, version = row["key"], row["schema"]
            except (ValueError, KeyError, TypeError):
                raise ResultFileError(f"{path}, line {number} is no run of a bench; expected lines of JSON") from None
            if version != VERSION:
                raise ResultFileError(
                    f"{path}, line {number} has schema version {version}; expected {VERSION}: use another --out"
                )
            if key not in seen:
                seen.add(key)
                yield row


def current(folder: Path) -> Iterator[dict[str, Any]]:
    """The rows of a folder's journal but for those of scenarios, or methods, that were changed and run again since."""
    digests: dict[str, str] = {}
    latest: dict[tuple[Any, ...], str] = {}
    for row in read(folder):
        digests[row["scenario"]] = row["digest"]
        latest[case(row)] = row["key"]
    for row in read(folder):
        if digests[row["scenario"]] == row["digest"] and latest[case(row)] == row["key"]:
            yield row


def case(row: Mapping[str, Any]) -> tuple[Any, ...]:
    """What a run is a run of, by name: scenario, method, level, repetition, seed."""
    return tuple(row[name] for name in ("scenario", "solver", "level", "repeat", "seed"))


def _lock(file: IO[bytes], folder: Path) -> None:
    """Hold the journal until it is closed, or the process ends however it ends."""
    try:
        import fcntl
    except ImportError:  # Windows: nobody watches there
        return
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        file.close()
        raise BenchError(
            f"--out is {str(folder)!r}, to which another bench is writing; wait for it, or use another folder"
        ) from None
