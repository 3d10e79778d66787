"""One robot of the library: where its URDF is, and what a URDF cannot say."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from cartctl.model.catalog.files import DISTRIBUTION, own_urdfs, shared_file, shared_robots
from cartctl.model.planar import planar_urdf

NOT_PUBLISHED = "not published"


@dataclass(frozen=True)
class LibraryEntry:
    """A robot by name.

    name, summary: what it is called, and one line about it.
    urdf: ``"example-robot-data:<path below robots>"``, ``"urdf:<file of ours>"``, or ``"planar:<n>"`` for a
    generated nR. tool: the frame most tasks move.
    home: joint name -> rad or m, a posture away from singularities; joints not named rest at 0, or at
    mid-range where 0 is outside their limits. locked: fnmatch patterns of joints that stay there unless asked
    for (fingers, wheels).
    acceleration, jerk: pattern -> rad/s^2, rad/s^3 (m for slides), only what is published.
    sources: where "model", "tool", "home", "acceleration" and "jerk" come from.
    root_joint: as in ``cc.load``. collada_y_up: its Collada meshes lie on their backs unless Y_UP is heeded.
    """

    name: str
    summary: str
    urdf: str
    tool: str
    home: Mapping[str, float]
    sources: Mapping[str, str]
    locked: tuple[str, ...] = ()
    acceleration: Mapping[str, float] = field(default_factory=dict)
    jerk: Mapping[str, float] = field(default_factory=dict)
    root_joint: str = "fixed"
    collada_y_up: bool = False

    def urdf_path(self) -> Path | None:
        """Return the URDF's file, None if it is generated; raises MissingDependencyError or UrdfError."""
        scheme, _, place = self.urdf.partition(":")
        if scheme == "planar":
            return None
        return shared_file(place) if scheme == DISTRIBUTION else own_urdfs() / place

    def urdf_text(self) -> str:
        """Return the URDF as text; raises MissingDependencyError or UrdfError."""
        path = self.urdf_path()
        if path is None:
            return planar_urdf([1.0] * int(self.urdf.partition(":")[2]))
        return path.read_text(encoding="utf-8")

    def package_dirs(self) -> tuple[Path, ...]:
        """Return the folders in which ``package://`` names of the URDF are found; none for shapes alone."""
        if self.urdf.partition(":")[0] != DISTRIBUTION:
            return ()
        return (shared_robots().parents[1],)  # meshes are called package://example-robot-data/robots/...


def joints(template: str, *values: float) -> dict[str, float]:
    """Return joint names 1, 2, ... with their values: ``joints("arm_{}_joint", 0.2, -0.5)``."""
    return {template.format(i): value for i, value in enumerate(values, start=1)}


def shared(package: str, licence: str, upstream: str) -> str:
    """Return the words for a model from example-robot-data."""
    return f"{DISTRIBUTION} 6.0, {package}; upstream {upstream}, {licence}"


def sources(
    model: str, tool: str, home: str, acceleration: str = NOT_PUBLISHED, jerk: str = NOT_PUBLISHED
) -> dict[str, str]:
    """Return the five sources every entry names."""
    return {"model": model, "tool": tool, "home": home, "acceleration": acceleration, "jerk": jerk}
