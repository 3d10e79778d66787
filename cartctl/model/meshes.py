"""Finding the mesh files a URDF names, and refusing names that reach outside the folders it was given.

A URDF from elsewhere is data: it may point into its own folder, the ROS package around it, or a folder the caller
handed over as ``package_dirs``, and nowhere else.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import unquote

from cartctl.errors import UnsafeUrdfError


@dataclass(frozen=True)
class MeshFolders:
    """Where meshes may lie. urdf_dir: the URDF's own folder, None for a text. package_dirs: given by the caller."""

    urdf_dir: Path | None
    package_dirs: tuple[Path, ...]

    @classmethod
    def of(cls, urdf: Path | None, package_dirs: Sequence[Path]) -> MeshFolders:
        """The folders of a URDF file, all resolved."""
        home = None if urdf is None else urdf.resolve().parent
        return cls(home, tuple(Path(d).resolve() for d in package_dirs))

    def find(self, filename: str) -> Path | None:
        """The file behind ``filename``, or None if it is missing; raises UnsafeUrdfError if it climbs out."""
        candidates = list(self._candidates(filename))
        if not candidates:
            return None
        inside = [path for path, root in candidates if path.is_relative_to(root)]
        if not inside:
            allowed = ", ".join(sorted({str(root) for _, root in candidates})) or "none"
            raise UnsafeUrdfError(
                f"mesh {filename!r} reaches outside the folders given to it ({allowed}); "
                "pass the folder that holds it in package_dirs=[...]"
            )
        return next((path for path in inside if path.is_file()), None)

    def _candidates(self, filename: str) -> list[tuple[Path, Path]]:
        """Pairs (resolved path, the root it must stay in)."""
        scheme, _, rest = filename.partition("://") if "://" in filename else ("", "", filename)
        rest = unquote(rest) if scheme else rest
        if "\0" in rest:
            raise UnsafeUrdfError(f"mesh {filename!r} holds a NUL character; expected a file name")
        if scheme in ("package", "model"):
            return self._in_package(rest.lstrip("/"))
        if scheme not in ("", "file"):
            raise UnsafeUrdfError(
                f"mesh {filename!r} has the scheme {scheme!r}; expected package://, file:// or a path"
            )
        roots = self._roots()
        if Path(rest).is_absolute():
            return [(_resolved(Path(rest)), root) for root in roots]
        bases = ([] if self.urdf_dir is None else [self.urdf_dir]) + list(self.package_dirs)
        return [(_resolved(base / rest), root) for base in bases for root in roots]

    def _in_package(self, rest: str) -> list[tuple[Path, Path]]:
        package, _, inner = rest.partition("/")
        found = [(_resolved(folder / rest), folder) for folder in self.package_dirs]
        named = [folder for folder in (*self.package_dirs, *self._ancestors()) if folder.name == package]
        return found + [(_resolved(folder / inner), folder) for folder in named]

    def _ancestors(self) -> tuple[Path, ...]:
        return () if self.urdf_dir is None else (self.urdf_dir, *self.urdf_dir.parents)

    def _roots(self) -> list[Path]:
        """The URDF's folder or the ROS package around it, then the caller's."""
        own = next((folder for folder in self._ancestors() if (folder / "package.xml").is_file()), self.urdf_dir)
        return ([] if own is None else [own]) + list(self.package_dirs)


def _resolved(path: Path) -> Path:
    """``path`` without links; a link that leads in a circle leads outside."""
    try:
        return path.resolve()
    except (OSError, RuntimeError):
        return Path(path.anchor or "/")
