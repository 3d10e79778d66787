"""Writing files whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from cartctl.errors import FileError, ParameterError


@contextmanager
def whole_file(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield a temporary path beside ``path`` to write to; it becomes ``path`` only if all goes well.

    Missing folders are made. Raises ParameterError if ``path`` is a folder or no path,
    FileError if it cannot be written.
    """
    if not isinstance(path, (str, os.PathLike)):
        raise ParameterError(f"path is {path!r}; expected the name of a file, such as 'out/run.html'")
    target = Path(path)
    if target.is_dir():
        raise ParameterError(f"path is the folder {str(target)!r}; expected the name of a file in it")
    if target.exists() and not target.is_file():
        yield target  # a device or pipe is written to, not replaced
        return
    target = target.resolve()  # a link stays, what it leads to is replaced
    part = target.with_name(f".{target.name}.{os.getpid()}.part")
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        yield part
        os.replace(part, target)
    except OSError as error:
        raise FileError(f"{path} cannot be written: {error.strerror or error}") from None
    finally:
        with suppress(OSError):
            part.unlink(missing_ok=True)
