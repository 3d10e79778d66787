"""Where the files of the library lie: example-robot-data's, and the URDFs of our own."""

from __future__ import annotations

from functools import cache
from importlib import metadata
from pathlib import Path

from cartctl.errors import MissingDependencyError, UrdfError

DISTRIBUTION = "example-robot-data"
_INSIDE = "share/example-robot-data/robots/"
_INSTALL = f"pip install '{DISTRIBUTION}>=6.0'"
_MARK = "kuka_lwr4.urdf"  # a folder named urdf may be anybody's; one that holds this file is ours


@cache
def shared_robots() -> Path:
    """Return the folder ``robots`` of the installed example-robot-data, found through its list of files.

    The wheel has no module and puts its files below a prefix that only that list knows. Raises
    MissingDependencyError.
    """
    try:
        distribution = metadata.distribution(DISTRIBUTION)
    except metadata.PackageNotFoundError:
        raise MissingDependencyError(f"{DISTRIBUTION} is not installed; {_INSTALL}") from None
    for file in distribution.files or ():
        before, inside, _ = file.as_posix().partition(_INSIDE)
        if inside:
            return Path(str(distribution.locate_file(before + inside))).resolve()
    version = distribution.version
    raise MissingDependencyError(f"{DISTRIBUTION} {version} lists no file below {_INSIDE}; {_INSTALL}")


@cache
def own_urdfs() -> Path:
    """Return the folder of our URDFs: ``cartctl/urdf`` in a wheel, ``urdf`` beside ``cartctl`` in a checkout.

    Raises UrdfError where neither is there.
    """
    package = Path(__file__).resolve().parents[2]
    candidates = (package / "urdf", package.parent / "urdf")
    for folder in candidates:
        if (folder / _MARK).is_file():
            return folder
    tried = " and ".join(map(str, candidates))
    raise UrdfError(f"cartctl's own URDF files are missing, looked in {tried}; install cartctl again")


def shared_file(relative: str) -> Path:
    """Return a file of example-robot-data by its path below ``robots``; raises MissingDependencyError."""
    path = shared_robots() / relative
    if not path.is_file():
        version = metadata.version(DISTRIBUTION)
        raise MissingDependencyError(
            f"{DISTRIBUTION} {version} lacks robots/{relative}; expected version 6.0 or later; {_INSTALL}"
        )
    return path
