"""Chains given by tables of Denavit-Hartenberg parameters, standard (distal) or modified (proximal)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from cartctl import checks
from cartctl.calibration.chain import Chain, six_names
from cartctl.calibration.motions import AXES, Motion, Product, Step, correctable, corrected
from cartctl.dynamics.dh import DHArm, DHLink
from cartctl.errors import ParameterError, ShapeError
from cartctl.spatial.frames import as_pose

TABLE = ("a", "alpha", "d", "theta", "beta")
X, Y, Z = AXES["x"], AXES["y"], AXES["z"]


@dataclass(frozen=True, eq=False)
class DHChain(Chain):
    """A table of Denavit-Hartenberg parameters, (n,) each: a, d in m, alpha, theta in rad.

        standard:  ^{i-1}A_i = Rz(theta_i) Tz(d_i) Tx(a_i) Rx(alpha_i) Ry(beta_i)    joint i about z of frame i-1
        modified:  ^{i-1}A_i = Tx(a_i) Rx(alpha_i) Ry(beta_i) Rz(theta_i) Tz(d_i)    joint i about z of frame i

    (Denavit & Hartenberg 1955; Craig 1986, whose a_{i-1}, alpha_{i-1} stand in row i). q_i adds to theta_i of an R, to
    d_i of a P joint. beta is 0 but where axes are nearly parallel (Hayati 1983): in the rows numbered in ``hayati``
    (1, 2, ...) it is a parameter, and d, which such axes do not show, is none. base and tool: (4, 4) or pin.SE3 poses
    before the first and behind the last row, None for none; each has six parameters of its own, ``base.x`` ...
    ``tool.rz``, about and along its own axes. joints: a letter each, all "R" by default.

    Parameters are named ``a1``, ``alpha1``, ``d1``, ``theta1``, ``beta1``, ...; the groups are ``a``, ``alpha``, ``d``,
    ``theta``, ``beta``, ``offsets`` (theta of R, d of P joints), ``lengths`` (a and d), ``table``, ``base``, ``tool``.

    Raises ShapeError, NonFiniteError, ParameterError.

    >>> import cartctl as cc
    >>> arm = cc.DHChain(a=[1.0, 0.5], alpha=[0, 0], d=[0, 0])
    >>> print(arm.poses([[0.0, 0.0]])[0, :3, 3])
    [1.5 0.  0. ]
    """

    a: Any
    alpha: Any
    d: Any
    theta: Any = None
    joints: str | None = None
    convention: str = "standard"
    beta: Any = None
    hayati: Sequence[int] = ()
    base: Any = None
    tool: Any = None
    name: str = "dh"

    def __post_init__(self) -> None:
        n = len(checks.vector("a", self.a))
        if not n:
            raise ShapeError("a is empty; expected one entry a joint")
        for column in TABLE:
            value = getattr(self, column)
            largest = checks.LARGEST if column in ("alpha", "theta", "beta") else 1e6
            value = np.zeros(n) if value is None else value
            object.__setattr__(self, column, checks.vector(column, value, n, largest=largest))
        joints = "R" * n if self.joints is None else self.joints
        if not isinstance(joints, str) or set(joints) - set("RP") or len(joints) != n:
            raise ParameterError(f"joints is {joints!r}; expected {n} letters R or P, one a row")
        object.__setattr__(self, "joints", joints)
        checks.choice("convention", self.convention, ("standard", "modified"))
        rows = checks.listed("hayati", self.hayati)
        if not all(isinstance(i, (int, np.integer)) and 1 <= i <= n for i in rows):
            raise ParameterError(f"hayati is {rows}; expected numbers of rows from 1 to {n}")
        object.__setattr__(self, "hayati", tuple(sorted({int(i) for i in rows})))
        for end in ("base", "tool"):
            pose = np.eye(4) if getattr(self, end) is None else as_pose(end, getattr(self, end))
            object.__setattr__(self, end, np.array(pose))

    @classmethod
    def of(cls, arm: DHArm, name: str = "dh") -> DHChain:
        """The table of a :class:`cartctl.dynamics.DHArm` without its masses; raises ParameterError where it has names.

        Formulas such as ``"pi/2"`` become numbers; names get theirs by ``arm.with_values(...)`` first.
        """
        if arm.names:
            raise ParameterError(f"the table holds the names {sorted(arm.names)}; give them arm.with_values(...)")
        links = arm.with_values().links
        table: dict[str, Any] = {c: [float(getattr(link, c)) for link in links] for c in TABLE[:4]}
        return cls(**table, joints="".join(link.joint for link in links), name=name)

    def arm(self) -> DHArm:
        """The table as a :class:`cartctl.dynamics.DHArm`, without masses; only the standard convention is one.

        Raises ParameterError for a modified table, a base or a tool, or a beta that is not 0.
        """
        if self.convention != "standard" or np.any(self.beta):
            raise ParameterError("a DHArm is a standard table without beta; this chain is not, use .model() instead")
        if not (np.array_equal(self.base, np.eye(4)) and np.array_equal(self.tool, np.eye(4))):
            raise ParameterError("a DHArm has neither base nor tool; this chain has, use .model() instead")
        rows = zip(self.joints or "", self.a, self.alpha, self.d, self.theta, strict=True)
        return DHArm([DHLink(j, a=float(a), alpha=float(b), d=float(d), theta=float(t)) for j, a, b, d, t in rows])

    @cached_property
    def product(self) -> Product:
        """The factors: base, rows, tool."""
        steps: list[Step] = [*correctable("base", self.base)]
        for i in range(len(self.a)):
            steps += self.row(i)
        return Product([*steps, *correctable("tool", self.tool)], len(self.a))

    def row(self, i: int) -> list[Step]:
        """The factors of row i (from 0)."""
        turning = (self.joints or "")[i] == "R"
        k = i + 1
        theta = Motion(True, Z, float(self.theta[i]), f"theta{k}", i if turning else -1)
        d = Motion(False, Z, float(self.d[i]), f"d{k}", -1 if turning else i)
        a = Motion(False, X, float(self.a[i]), f"a{k}")
        alpha = Motion(True, X, float(self.alpha[i]), f"alpha{k}")
        beta = Motion(True, Y, float(self.beta[i]), f"beta{k}")
        return [theta, d, a, alpha, beta] if self.convention == "standard" else [a, alpha, beta, theta, d]

    def value(self, name: str) -> float:
        """An entry of the table by its name; corrections of base and tool are 0."""
        column = name.rstrip("0123456789")
        return float(getattr(self, column)[int(name[len(column) :]) - 1]) if column in TABLE else 0.0

    @property
    def groups(self) -> Mapping[str, Sequence[str]]:
        """Columns of the table, ``offsets``, ``lengths``, ``table``, ``base``, ``tool``."""
        numbers = range(1, len(self.a) + 1)
        columns = {c: [f"{c}{i}" for i in numbers] for c in TABLE}
        offsets = [f"{'theta' if j == 'R' else 'd'}{i}" for i, j in zip(numbers, self.joints or "", strict=True)]
        return {
            **columns,
            "offsets": offsets,
            "lengths": [*columns["a"], *columns["d"]],
            "table": list(self.usual),
            "base": six_names("base"),
            "tool": six_names("tool"),
        }

    @property
    def usual(self) -> Sequence[str]:
        """The whole table: a, alpha, d, theta; beta in place of d in the rows of Hayati."""
        left_out = {f"d{i}" if i in self.hayati else f"beta{i}" for i in range(1, len(self.a) + 1)}
        return [f"{c}{i}" for i in range(1, len(self.a) + 1) for c in TABLE if f"{c}{i}" not in left_out]

    def with_hayati(self, within: float = 0.1) -> DHChain:
        """The same chain with Hayati's parameter in each row that joins axes within ``within`` rad of parallel.

        Of a standard table those are its rows but the last, of a modified one its rows but the first: there the row
        joins a joint to the tool or the base. A sliding joint keeps its d.
        """
        checks.number("within", within, low=0.0, high=1.0)
        rows = range(len(self.a) - 1) if self.convention == "standard" else range(1, len(self.a))
        near = [i + 1 for i in rows if abs(np.sin(self.alpha[i])) <= within and (self.joints or "")[i] == "R"]
        return replace(self, hayati=tuple({*self.hayati, *near}))

    def changed(self, delta: Mapping[str, float]) -> DHChain:
        """The chain with ``delta`` added; raises ParameterNotFound."""
        self.select(list(delta)) if delta else ()
        table: dict[str, Any] = {
            c: getattr(self, c) + [delta.get(f"{c}{i + 1}", 0.0) for i in range(len(self.a))] for c in TABLE
        }
        ends: dict[str, Any] = {
            end: corrected(getattr(self, end), [delta.get(name, 0.0) for name in six_names(end)])
            for end in ("base", "tool")
        }
        return replace(self, **table, **ends)

    def model(self) -> Any:
        """The chain as a Pinocchio model: joints ``joint1``, ..., the frame ``tool``; the base is in the first joint.

        Every frame of the table is a frame ``link1``, ... of the model.
        """
        from cartctl.calibration.conversion import pinocchio_chain

        return pinocchio_chain(self)

    @classmethod
    def of_robot(cls, robot: Any, frame: str | None = None, convention: str = "standard", hayati: bool = False) -> Any:
        """The table of the chain from a robot's base to ``frame`` (its tool if None), by :meth:`from_axes`.

        robot: a :class:`cartctl.Robot` or a pin.Model. Raises UnsupportedJoint for joints that have no row, and as
        :meth:`from_axes`.
        """
        from cartctl.calibration.conversion import dh_of_robot

        return dh_of_robot(robot, frame, convention, hayati)

    @classmethod
    def from_axes(
        cls,
        points: Any,
        directions: Any,
        joints: str | None = None,
        *,
        tool: Any = None,
        convention: str = "standard",
        hayati: bool = False,
        name: str = "dh",
    ) -> DHChain:
        """The table of joint axes at q = 0: see :func:`cartctl.calibration.frames.table_of_axes`."""
        from cartctl.calibration.frames import table_of_axes

        return table_of_axes(points, directions, joints, tool=tool, convention=convention, hayati=hayati, name=name)

    def urdf(self) -> str:
        """The chain as a URDF: links ``base``, ``link1``, ..., ``tool``, joints about their z axes.

        Its joints have ranges of +-2 pi rad, or +-10 m, and no rates or efforts: a table knows none.
        """
        from cartctl.calibration.urdf import chain_urdf

        return chain_urdf(self)
