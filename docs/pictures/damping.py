"""The damping methods: what they deliver along a singular direction, and a passage by a singularity."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

import cartctl as cc
from pictures.scenarios import Passage, past_the_fold
from pictures.style import OTHER, OURS, SECOND, curve, panels

SIGMA = np.logspace(-3.5, 0.5, 200)
NEAR = (1.6, 2.6)  # s, around the singularity
WORDS = "A 2R arm's tip passes its base at 5 mm, all but folded"


def _delivered(solver, others: float = 1.0) -> np.ndarray:
    """The share of a small command that arrives along a direction of singular value sigma beside another."""
    return (
        np.array([s * cc.solve(cc.Problem([([[s, 0.0], [0.0, others]], [1e-3, 0.0])]), solver).u[0] for s in SIGMA])
        / 1e-3
    )


def _passage(axes, name: str) -> tuple[float, float, float]:
    plain, ours = past_the_fold("pinv"), past_the_fold(name)
    speed, error = axes
    near = (plain.time > NEAR[0]) & (plain.time < NEAR[1])
    plain, ours = (Passage(*(x[near] for x in passage)) for passage in (plain, ours))
    curve(speed, plain.time, plain.speed, color=OTHER, label="pinv")
    curve(speed, ours.time, ours.speed, color=OURS, label=name)
    speed.set(xlabel="time, s", ylabel="rad/s", yscale="log", xlim=NEAR, ylim=(0.3, 1e3))
    speed.legend(loc="upper left")
    curve(error, plain.time, 1e3 * plain.error, color=OTHER)
    curve(error, ours.time, 1e3 * ours.error, color=OURS)
    error.set(xlabel="time, s", ylabel="mm", xlim=NEAR)
    return plain.speed.max(), ours.speed.max(), 1e3 * ours.error.max()


def _figure(name: str, also: str | None = None) -> tuple[Figure, str]:
    figure, (share, *rest) = panels("Share of a command delivered", "Joint speed", "Tip off its path")
    share.plot(SIGMA, _delivered("pinv"), color=OTHER, label="pinv")
    if also:
        share.plot(SIGMA, _delivered(also), color=SECOND, ls="--", lw=1.2, label=also)
    share.plot(SIGMA, _delivered(name), color=OURS, label=name)
    share.set(xscale="log", xlabel="singular value of its direction", ylim=(-0.03, 1.08))
    share.legend(loc="lower right")
    plain, speed, error = _passage(rest, name)
    said = f"{WORDS}: the pseudo-inverse turns the joints at {plain:.0f} rad/s, `{name}` at {speed:.1f}, "
    return figure, said + f"and its tip leaves the line by {error:.0f} mm."


def dls() -> tuple[Figure, str]:
    """Damping everywhere."""
    return _figure("dls")


def dls_manipulability() -> tuple[Figure, str]:
    """Damping below a manipulability."""
    return _figure("dls-manipulability", also="dls")


def dls_sigma() -> tuple[Figure, str]:
    """Damping below a singular value."""
    return _figure("dls-sigma", also="dls")


def numerical_filtering() -> tuple[Figure, str]:
    """Damping of one direction: the left panel shows what its neighbour loses."""
    name = "numerical-filtering"
    figure, (share, *rest) = panels("What the neighbour, of 0.1, still delivers", "Joint speed", "Tip off its path")
    for solver, color in (("dls-sigma", SECOND), (name, OURS)):
        delivered = [
            0.1 * cc.solve(cc.Problem([([[s, 0.0], [0.0, 0.1]], [0.0, 1e-3])]), solver).u[1] / 1e-3 for s in SIGMA
        ]
        share.plot(SIGMA, delivered, color=color, ls="-" if solver == name else "--", label=solver)
        if solver != name:
            lost = 100.0 * (1.0 - min(delivered))
    share.set(xscale="log", xlabel="singular value of the bad direction", ylim=(0.84, 1.01))
    share.legend(loc="lower right")
    plain, speed, error = _passage(rest, name)
    return figure, (
        f"Left: where one direction is bad, `dls-sigma` takes up to {lost:.0f} % from a neighbour of singular value "
        f"0.1; `{name}` next to nothing. {WORDS}: {speed:.1f} rad/s instead of {plain:.0f}, {error:.0f} mm off the "
        "line."
    )


def sdls() -> tuple[Figure, str]:
    """Clamped by how far the joints would go, so that the size of the command counts."""
    figure, (share, *rest) = panels("Largest joint rate", "Joint speed", "Tip off its path")
    A, sizes = [[0.01, 0.0], [0.0, 1.0]], np.logspace(-4, 1, 120)
    for solver, color in (("pinv", OTHER), ("dls", SECOND), ("sdls", OURS)):
        rates = [np.abs(cc.solve(cc.Problem([(A, [b, 0.0])]), solver).u).max() for b in sizes]
        share.plot(sizes, rates, color=color, ls="--" if solver == "dls" else "-", label=solver)
    share.set(xscale="log", yscale="log", xlabel="command along a value of 0.01", ylabel="rad/s")
    share.legend(loc="upper left")
    plain, speed, error = _passage(rest, "sdls")
    return figure, (
        "Left: a small command is obeyed like the pseudo-inverse's, a large one stops growing at its limit, while "
        f"`dls` halves all alike. {WORDS}: {speed:.1f} rad/s instead of {plain:.0f}, {error:.0f} mm off the line."
    )
