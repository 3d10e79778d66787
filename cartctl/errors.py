"""Every way cartctl refuses bad input, each under its own name.

Misuse raises a child of :class:`CartctlError` whose message names the offending thing, its value, what was
expected and what to do. Numerical trouble (a singularity, a conflict) is a status of a Solution instead.
"""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches


class CartctlError(Exception):
    """Root of all errors raised on purpose by cartctl; the message is one readable line."""


class CartctlWarning(UserWarning):
    """Something was left out that the caller may have counted on (meshes, limits)."""


class ShapeError(CartctlError, ValueError):
    """An array has the wrong shape."""


class NonFiniteError(CartctlError, ValueError):
    """An array or number holds NaN or infinity."""


class MetricError(CartctlError, ValueError):
    """A metric is not symmetric positive definite."""


class ProblemError(CartctlError, ValueError):
    """A Problem contradicts itself: crossed bounds, an unknown fit, a negative weight, an empty task list."""


class NoTasksError(ProblemError):
    """A controller was given no task."""


class UnsupportedProblem(CartctlError, ValueError):  # noqa: N818 - the public name
    """The chosen solver cannot honour something in the problem, and says so instead of ignoring it."""


class UnsupportedJoint(CartctlError, ValueError):  # noqa: N818 - like its sibling above
    """A formula does not hold for a kind of joint the robot has."""


class UnderactuatedRobot(CartctlError, ValueError):  # noqa: N818 - names what the robot is
    """Torques are asked of a robot that moves in ways no motor drives, or whose inertia matrix is singular."""


class SolverOutputError(CartctlError, ValueError):
    """A solver of the user's returned something else than (n,) finite numbers."""


class FileError(CartctlError, OSError):
    """A file cannot be written."""


class ParameterError(CartctlError, ValueError):
    """A parameter lies outside its domain: a negative gain, dt <= 0, an unknown option."""


class TimeStepError(ParameterError):
    """A time step or duration is not positive."""


class TargetError(CartctlError, ValueError):
    """A task's target is missing or of the wrong kind."""


class PathError(CartctlError, ValueError):
    """A path is ill-defined: zero length, a non-positive duration, too few waypoints."""


class ConfigurationError(CartctlError, ValueError):
    """A configuration q is not one of the robot's: a quaternion or a (cos, sin) pair without unit norm."""


class UrdfError(CartctlError, ValueError):
    """A URDF cannot be read, holds no joints, or reaches outside the folders it was given."""


class MissingUrdfError(UrdfError):
    """There is no such URDF file."""


class MalformedUrdfError(UrdfError):
    """The file is not well-formed XML, or not a URDF's."""


class NoJointsError(UrdfError):
    """The URDF holds no joint that moves."""


class UnsafeUrdfError(UrdfError):
    """The URDF declares XML entities, or names a mesh outside the folders it was given."""


class RunFileError(CartctlError, ValueError):
    """A saved run cannot be read."""


class MeasurementError(CartctlError, ValueError):
    """A table of measurements has a wrong header, or a cell that is no number."""


class ScenarioError(CartctlError, ValueError):
    """A scenario of the bench is ill-defined; ``keys`` leads to the entry, ``place`` says file and line if it has one.

    reason: what is wrong, without the place.
    """

    def __init__(self, reason: str, keys: tuple[str | int, ...] = (), place: str = "") -> None:
        self.reason, self.keys, self.place = reason, keys, place
        path = "".join(f"[{key}]" if isinstance(key, int) else f".{key}" for key in keys).lstrip(".")
        super().__init__(": ".join(part for part in (place, path, reason) if part))


class ResultFileError(CartctlError, ValueError):
    """A file of bench results cannot be read, or was written by another version of its schema."""


class BenchError(CartctlError, RuntimeError):
    """A bench cannot go on: its folder is in use, holds another bench, or its workers keep dying."""


class MissingDependencyError(CartctlError, ImportError):
    """A package is missing; the message holds the command that installs it."""


class LookupFailure(CartctlError, KeyError):  # noqa: N818 - an intermediate base, its children carry the names
    """A name is unknown; the closest known names are offered."""

    kind = "name"
    shown = 12  # how many of the known names are listed where none is close

    def __init__(self, name: object, known: Iterable[str], advice: str = "") -> None:
        known = list(known)
        close = get_close_matches(str(name), known, n=3, cutoff=0.5) or _containing(str(name), known)
        if close:
            offer = "did you mean " + " or ".join(repr(c) for c in close) + "?"
        else:
            offer = "known: " + ", ".join(known[: self.shown]) + (", ..." if len(known) > self.shown else "")
        super().__init__(f"unknown {self.kind} {name!r}; {offer}" + (f" {advice}" if advice else ""))
        self.name, self.close = name, close

    def __str__(self) -> str:  # KeyError would print the repr
        return str(self.args[0])


class RobotNotFound(LookupFailure):
    """No robot of that name, and no such file."""

    kind = "robot"


class FrameNotFound(LookupFailure):
    """The robot has no frame of that name."""

    kind = "frame"


class JointNotFound(LookupFailure):
    """The robot has no (active) joint of that name."""

    kind = "joint"


class SolverNotFound(LookupFailure):
    """No solver is registered under that name."""

    kind = "solver"
    shown = 40  # all of them: who asks cannot know where else to look


class LevelNotFound(LookupFailure):
    """No level of that name."""

    kind = "level"


class ParameterNotFound(LookupFailure):
    """A kinematic chain has no parameter, or group of parameters, of that name."""

    kind = "parameter"


class RunInterrupted(KeyboardInterrupt):  # noqa: N818 - it is an interrupt, not an error
    """Ctrl-C during a rollout; ``.run`` holds every step made so far."""

    def __init__(self, run: object) -> None:
        super().__init__("interrupted")
        self.run = run


def _containing(name: str, known: list[str]) -> list[str]:
    return [k for k in known if name and name.lower() in k.lower()][:3]
