"""Writing files whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from cartctl.errors import ParameterError


@contextmanager
def whole_file(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield a temporary path beside ``path`` to write to; it becomes ``path`` only if all goes well.

    Missing folders are made. Raises ParameterError if ``path`` is a folder.
    """
    target = Path(path)
    if target.is_dir():
        raise ParameterError(f"path is the folder {str(target)!r}; expected the name of a file in it")
    target.parent.mkdir(parents=True, exist_ok=True)
    part = target.with_name(f".{target.name}.{os.getpid()}.part")
    try:
        yield part
        os.replace(part, target)
    finally:
        part.unlink(missing_ok=True)
