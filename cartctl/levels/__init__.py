"""Levels: the only bridge between a robot's state and an algebraic problem."""

from __future__ import annotations

from cartctl.errors import LevelNotFound, ParameterError
from cartctl.levels.acceleration import AccelerationLevel
from cartctl.levels.base import Command, Level, Secondary
from cartctl.levels.singularity_policies import AvoidSingularity, Halt, SlowDown
from cartctl.levels.torque import TorqueLevel
from cartctl.levels.velocity import VelocityLevel

_REGISTRY: dict[str, type[Level]] = {
    "velocity": VelocityLevel,
    "acceleration": AccelerationLevel,
    "torque": TorqueLevel,
}

__all__ = [
    "AccelerationLevel",
    "AvoidSingularity",
    "Command",
    "Halt",
    "Level",
    "Secondary",
    "SlowDown",
    "TorqueLevel",
    "VelocityLevel",
    "get_level",
    "levels",
]


def levels() -> list[str]:
    """The names of all levels."""
    return list(_REGISTRY)


def get_level(level: str | Level) -> Level:
    """A level by name or as given; raises LevelNotFound, ParameterError."""
    if isinstance(level, Level):
        return level
    if not isinstance(level, str):
        raise ParameterError(f"level is {level!r}; expected one of {', '.join(_REGISTRY)}")
    if level not in _REGISTRY:
        raise LevelNotFound(level, _REGISTRY)
    return _REGISTRY[level]()
