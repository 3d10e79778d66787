"""Where compiled kernels are kept: a folder for each state of the sources that a kernel is made of.

numba's own key is the file of the kernel alone and misses changes in a callee of another file. Ours is a hash of that
file and of everything of this package that it imports, near or far: an edit elsewhere recompiles nothing.
"""

from __future__ import annotations

import hashlib
import logging
import os
import re
import shutil
from contextlib import suppress
from functools import lru_cache
from pathlib import Path

from platformdirs import user_cache_path

_KEPT = 64  # folders; the kernels of one version are in about twenty
_OURS = re.compile(r"[0-9a-f]{16}")
_PACKAGE = Path(__file__).parent
_IMPORT = re.compile(
    rf"^[ \t]*(?:from[ \t]+({_PACKAGE.name}(?:\.\w+)*)[ \t]+import[ \t]+(\([^)]*\)|[^\n]*)"
    rf"|import[ \t]+({_PACKAGE.name}(?:\.\w+)*))",
    re.MULTILINE,
)
_log = logging.getLogger("cartctl")


def cache_root() -> Path:
    """The folder of all caches: ``$CARTCTL_CACHE_DIR/kernels``, or below the user's own cache."""
    return Path(os.environ.get("CARTCTL_CACHE_DIR") or user_cache_path("cartctl")) / "kernels"


@lru_cache(maxsize=64)
def cache_folder(*sources: Path) -> Path | None:
    """Where kernels written in ``sources`` are kept, or None where nothing can be written."""
    folder = cache_root() / _hash_of(sources)
    try:
        known = folder.is_dir()
        folder.mkdir(parents=True, exist_ok=True)
        os.utime(folder)
        if not os.access(folder, os.W_OK):
            raise PermissionError(folder)
    except OSError as error:
        _log.info("kernels are compiled anew in every process: %s", error)
        return None
    if not known:
        _prune(folder.parent)
    return folder


def _hash_of(sources: tuple[Path, ...]) -> str:
    digest, seen, left = hashlib.sha256(), set(sources), list(sources)
    while left:
        new = _imported_by(left.pop()) - seen
        seen |= new
        left += new
    for source in sorted(seen):
        digest.update(source.name.encode())
        digest.update(source.read_bytes())
    return digest.hexdigest()[:16]


@lru_cache(maxsize=512)
def _imported_by(source: Path) -> frozenset[Path]:
    """The files of this package that one file names in its imports."""
    found: set[Path] = set()
    for whence, names, whole in _IMPORT.findall(source.read_text(encoding="utf-8")):
        base = _PACKAGE.joinpath(*(whence or whole).split(".")[1:])
        files = [base / f"{name}.py" for name in re.findall(r"\w+", names)]
        if base != _PACKAGE:
            files += [base.with_suffix(".py"), base / "__init__.py"]
        found.update(file for file in files if file.is_file())
    return frozenset(found)


def _prune(root: Path) -> None:
    """Remove all but the caches used last; what is not a cache of ours stays."""
    caches = []
    for folder in root.iterdir():
        with suppress(OSError):
            if _OURS.fullmatch(folder.name) and folder.is_dir() and not folder.is_symlink():
                caches.append((folder.stat().st_mtime, folder))
    for _, folder in sorted(caches, reverse=True)[_KEPT:]:
        shutil.rmtree(folder, ignore_errors=True)
