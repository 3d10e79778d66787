"""Arms as tables of standard Denavit-Hartenberg parameters with masses: numbers, or formulas such as ``"dc1 - l1"``.

Frame i sits at the far end of link i: ``^{i-1}A_i = Rz(theta) Tz(d) Tx(a) Rx(alpha)``. Joint i turns about (R) or
slides along (P) the axis z of frame i-1, and its coordinate q_i adds to theta (R) or to d (P).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from cartctl import checks
from cartctl.dynamics.expressions import entry, names, number
from cartctl.errors import ParameterError, ShapeError

Entry = float | str
_SCALARS = ("a", "alpha", "d", "theta", "mass", "rotor")


@dataclass(frozen=True)
class DHLink:
    """One row of the table and the link it carries; every entry is a number or a formula.

    joint: "R" or "P". a, d: m; alpha, theta: rad; theta of an R and d of a P joint are offsets, added to q. mass: kg.
    com: (3,) centre of mass in frame i, m. inertia: about the centre of mass along the axes of frame i, kg m^2: (3,)
    diagonal or (3, 3) symmetric. rotor: inertia of the motor seen at the joint (gear ratio squared times the rotor's,
    kg m^2 or kg), which adds 1/2 rotor dq^2 to the kinetic energy.

    Raises ShapeError, NonFiniteError, ParameterError.
    """

    joint: str
    a: Entry = 0.0
    alpha: Entry = 0.0
    d: Entry = 0.0
    theta: Entry = 0.0
    mass: Entry = 0.0
    com: Sequence[Entry] = (0.0, 0.0, 0.0)
    inertia: Any = (0.0, 0.0, 0.0)
    rotor: Entry = 0.0
    _matrix: tuple[tuple[Entry, ...], ...] = field(init=False, repr=False, compare=False, default=())

    def __post_init__(self) -> None:
        checks.choice("joint", self.joint, ("R", "P"))
        for name in _SCALARS:
            object.__setattr__(self, name, entry(name, getattr(self, name)))
        for name in ("mass", "rotor"):
            if not isinstance(getattr(self, name), str):
                checks.number(name, getattr(self, name), low=0.0)
        object.__setattr__(self, "com", _triple("com", self.com))
        object.__setattr__(self, "_matrix", _symmetric(self.inertia))

    @property
    def inertia_matrix(self) -> tuple[tuple[Entry, ...], ...]:
        """(3, 3) rows of the inertia about the centre of mass."""
        return self._matrix

    def entries(self) -> list[Entry]:
        """Every entry, in the order of the fields."""
        scalars: list[Entry] = [getattr(self, name) for name in _SCALARS]
        return [*scalars, *self.com, *(x for row in self._matrix for x in row)]


@dataclass(frozen=True)
class DHArm:
    """links: DHLink, from the base up. gravity: (3,) acceleration of gravity in frame 0, m/s^2, numbers or formulas.

    Raises ShapeError, NonFiniteError, ParameterError.
    """

    links: Sequence[DHLink]
    gravity: Sequence[Entry] = (0.0, 0.0, -9.81)

    def __post_init__(self) -> None:
        links = tuple(checks.listed("links", self.links))
        if not links or not all(isinstance(link, DHLink) for link in links):
            raise ParameterError(f"links is {self.links!r}; expected one DHLink a joint, and at least one")
        object.__setattr__(self, "links", links)
        object.__setattr__(self, "gravity", _triple("gravity", self.gravity))
        taken = self.names & {f"{d}q{i + 1}" for i in range(self.n) for d in ("", "d", "dd")}
        if taken:
            raise ParameterError(
                f"{min(taken)!r} stands in the table; expected another name, as q1, dq1, ... are taken"
            )

    @staticmethod
    def check(arm: Any) -> None:
        """Refuse what is no DHArm; raises ParameterError."""
        if not isinstance(arm, DHArm):
            raise ParameterError(f"arm is a {type(arm).__name__}; expected a cc.dynamics.DHArm")

    @property
    def n(self) -> int:
        """How many joints."""
        return len(self.links)

    @property
    def names(self) -> set[str]:
        """The names in the formulas of the table."""
        return set().union(*(names(x) for link in self.links for x in link.entries()), *map(names, self.gravity))

    def with_values(self, **values: float) -> DHArm:
        """The arm with every formula as its value, for a number for each name.

        Raises ParameterError for a name without value, or a value without name; NonFiniteError.
        """
        given = {name: checks.number(name, value) for name, value in values.items()}
        if given.keys() != self.names:
            odd = sorted(given.keys() ^ self.names)
            raise ParameterError(
                f"values for {sorted(given)}; expected exactly {sorted(self.names)} ({odd} missing or too many)"
            )
        links = []
        for i, link in enumerate(self.links, start=1):
            fields: dict[str, Any] = {
                name: number(f"{name} of link {i}", getattr(link, name), given) for name in _SCALARS
            }
            fields["com"] = [number(f"com of link {i}", x, given) for x in link.com]
            fields["inertia"] = [[number(f"inertia of link {i}", x, given) for x in row] for row in link.inertia_matrix]
            links.append(replace(link, **fields))
        return DHArm(links, [number("gravity", x, given) for x in self.gravity])


def _triple(name: str, values: Iterable[Any]) -> tuple[Entry, ...]:
    if isinstance(values, str) or not isinstance(values, Iterable):
        raise ShapeError(f"{name} is {values!r}; expected three numbers or formulas")
    triple = tuple(entry(f"{name}[{i}]", x) for i, x in enumerate(values))
    if len(triple) != 3:
        raise ShapeError(f"{name} has {len(triple)} entries; expected three")
    return triple


def _symmetric(inertia: Any) -> tuple[tuple[Entry, ...], ...]:
    rows = list(inertia) if isinstance(inertia, Iterable) and not isinstance(inertia, str) else [inertia]
    if len(rows) == 3 and not any(isinstance(r, Iterable) and not isinstance(r, str) for r in rows):
        x, y, z = _triple("inertia", rows)
        return (x, 0.0, 0.0), (0.0, y, 0.0), (0.0, 0.0, z)
    if len(rows) != 3:
        raise ShapeError(f"inertia has {len(rows)} rows; expected a diagonal (3,) or a matrix (3, 3)")
    matrix = tuple(_triple(f"inertia[{i}]", row) for i, row in enumerate(rows))
    for i, j in ((0, 1), (0, 2), (1, 2)):
        p, q = matrix[i][j], matrix[j][i]
        alike = p == q if isinstance(p, str) or isinstance(q, str) else bool(np.isclose(p, q, rtol=1e-9, atol=0.0))
        if not alike:
            raise ParameterError(f"inertia[{i}][{j}] is {p!r}, inertia[{j}][{i}] {q!r}; expected a symmetric matrix")
    return matrix
