"""``cc.calibrate``: from measurements to a better model."""

from __future__ import annotations

from typing import Any

from cartctl import checks
from cartctl.calibration import noise as noise_model
from cartctl.calibration.chain import Chain
from cartctl.calibration.gauss_newton import Problem, solve
from cartctl.calibration.identifiability import identify
from cartctl.calibration.measurements import read
from cartctl.calibration.result import Calibration
from cartctl.calibration.robot_chain import RobotChain
from cartctl.calibration.robust import LOSSES
from cartctl.calibration.selection import Parameters
from cartctl.errors import ParameterError


def calibrate(
    chain_or_robot: Any,
    q: Any,
    measurements: Any,
    *,
    parameters: Parameters = None,
    kind: str | None = None,
    frame: str | None = None,
    base: Any = None,
    tool: Any = None,
    anchor: Any = None,
    noise: Any = None,
    loss: str = "linear",
    iterations: int = 50,
    agreement: float = 1e-9,
    rank_tolerance: float = 1e-6,
) -> Calibration:
    """Estimate kinematic parameters: ``min sum_i w_i |Sigma^-1 (r_i - f(q_i, x))|^2`` by iterated, damped Gauss-Newton.

    chain_or_robot: a DHChain, a RobotChain, or a Robot (or pin.Model), of which the chain to ``frame`` (its tool) is
    taken. q: (N, n) rad or m, of a robot its configurations (N, nq). measurements, by ``kind``, which None takes from
    their shape: "pose" (N, 4, 4), pin.SE3 or (N, 7) x y z and a quaternion x y z w; "position" (N, 3) m; "distance"
    (N,) m from ``anchor``, (3,) or (N, 3), by default the origin in which measurements are given. base, tool: for a
    robot, where it stands in the measuring frame and what its frame carries, (4, 4) or pin.SE3; both can be parameters.

    parameters: names, groups or patterns (``"a d"``, ``["theta*", "tool"]``), or masks ``{"a": [True, False, ...]}``;
    None for the whole table, or all placements. noise: standard deviation in m, for poses (m, rad), None to
    estimate it. loss: "linear", "huber", "cauchy" or "tukey", the last three for data with outliers. agreement: m and
    rad; where no residual is larger, nothing is changed. rank_tolerance: singular values of the column-scaled regressor
    below this share of the largest count as zero at the nominal parameters; such directions stay nominal and are
    reported. Where the estimate makes more of them visible (parallel axes that tilt), ``result.rank_after`` is larger
    than ``rank``: calibrating ``result.chain`` again estimates them, too, as weakly as they are seen.

    Raises ShapeError, NonFiniteError, ParameterError, ParameterNotFound, UnsupportedJoint, FrameNotFound. Source: De
    Luca, Robotics 2 (calibration); Khalil & Dombre 2002, ch. 11; Hollerbach, Khalil & Gautier 2008.
    """
    chain = as_chain(chain_or_robot, frame, base, tool)
    angles = chain.coordinates(q)
    data = read(kind, measurements, len(angles), anchor)
    checks.choice("loss", loss, LOSSES)
    steps = checks.whole("iterations", iterations, 0)
    agreement = checks.number("agreement", agreement, low=0.0)
    tolerance = checks.number("rank_tolerance", rank_tolerance, low=1e-13, high=0.1)
    names = chain.select(parameters)
    chosen = chain.indices(parameters)
    poses, Phi = chain.product.regressor(angles, chosen)
    before = data.residuals(poses)
    H = data.derivative(poses, Phi, before)
    seen = identify(H.reshape(-1, len(names)), names, tolerance)
    problem = Problem(chain.product, angles, data, chosen, seen, noise_model.given(noise, data), loss)
    fit = solve(problem, steps, agreement)
    delta = seen.basis @ fit.z
    poses, Phi = chain.product.regressor(angles, chosen, problem.spread(fit.z))
    after = data.derivative(poses, Phi, fit.residuals)
    return Calibration(
        chain=chain.changed(dict(zip(names, delta.tolist(), strict=True))),
        nominal=chain,
        names=names,
        units=chain.units(names),
        kind=data.kind,
        loss=loss,
        delta=delta,
        data=data,
        q=angles,
        before=before,
        fit=fit,
        seen=seen,
        noise_known=noise is not None,
        rank_after=identify(after.reshape(-1, len(names)), names, tolerance).rank,
    )


def as_chain(value: Any, frame: str | None = None, base: Any = None, tool: Any = None) -> Chain:
    """A chain, of a chain, a Robot or a pin.Model; raises ParameterError, FrameNotFound, UnsupportedJoint."""
    if not isinstance(value, Chain):
        return RobotChain(value, frame, base=base, tool=tool)
    for name, given in (("frame", frame), ("base", base), ("tool", tool)):
        if given is not None:
            raise ParameterError(f"{name} is given with a chain, which has its own; expected it with a robot only")
    return value
