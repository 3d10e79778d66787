"""What may stand behind an option: closed lists with their nearest match, and what a shell completes."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from cartctl.errors import LookupFailure, ParameterError

PATHS = ("circle", "line", "ellipse", "lissajous", "polygon")
PLANES = ("xy", "xz", "yz", "yx", "zx", "zy")
METRICS = ("identity", "inertia", "joint-limits", "inverse-inertia", "inverse-inertia-squared")
SINGULARITIES = ("truncate", "damp", "slow-down", "avoid", "halt")
OBJECTIVES = (
    "joint-range",
    "posture",
    "manipulability",
    "smallest-singular-value",
    "inverse-condition",
    "kinetic-energy",
    "gravity-torque",
    "none",
)
PLAN_OBJECTIVES = (
    "kinetic-energy",
    "joint-speed",
    "joint-range",
    "inverse-manipulability",
    "self-clearance",
    "torque",
)


class UnknownChoice(LookupFailure):
    """An option has none of the values it may have; the closest are offered."""

    def __init__(self, kind: str, value: str, known: Sequence[str]) -> None:
        self.kind = kind
        super().__init__(value, known)


def choice(kind: str, value: str, known: Sequence[str]) -> str:
    """``value`` if it is known; raises UnknownChoice."""
    if value not in known:
        raise UnknownChoice(kind, value, known)
    return value


def robots() -> dict[str, str]:
    """Names of the library with one line each."""
    from cartctl.model import library

    return library.robots()


def solver_names() -> dict[str, str]:
    """Names of the solvers with one line each."""
    from cartctl.solvers import solvers

    return solvers()


def completion(known: Callable[[], dict[str, str]]) -> Callable[[str], list[tuple[str, str]]]:
    """What a shell offers after Tab: the names that begin so, each with its line."""
    return lambda incomplete: [pair for pair in known().items() if pair[0].startswith(incomplete)]


def words(names: Sequence[str]) -> Callable[[str], list[tuple[str, str]]]:
    """The same for a few words."""
    return completion(lambda: dict.fromkeys(names, ""))


def posture(pairs: Sequence[str]) -> dict[str, float]:
    """``["elbow=1.2"]`` as joint name -> rad or m; raises ParameterError."""
    values = {}
    for pair in pairs:
        joint, equals, value = pair.rpartition("=")
        try:
            values[joint.strip()] = float(value)
        except ValueError:
            equals = ""
        if not equals:
            raise ParameterError(f"--home is {pair!r}; expected JOINT=VALUE in rad or m, such as elbow=1.57")
    return values
