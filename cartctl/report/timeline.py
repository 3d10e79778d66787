"""Which samples of a run are shown, and the animation tracks made of them.

A run has a sample per control step (often 1000 a second); a screen wants about 30. Times are kept, so that one
second of the run is one second on the screen.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import meshcat.animation as ma
import numpy as np
from numpy.typing import NDArray

from cartctl.report.mesh import Array, IntArray

FPS = 30
FRAMES = 1800  # at most: a minute at full rate, longer runs are shown with fewer frames a second


def frames(time: Array) -> IntArray:
    """Return the indices of the samples to show: ends included, at most ``FPS`` a second and ``FRAMES`` in all."""
    span = float(time[-1] - time[0])
    count = min(int(np.ceil(span * FPS)) + 1, FRAMES, len(time))
    if span <= 0 or count < 2:
        return np.zeros(1, dtype=np.int64)
    wanted = np.linspace(time[0], time[-1], count)
    return np.unique(np.clip(np.searchsorted(time, wanted - 1e-9 * span), 0, len(time) - 1)).astype(np.int64)


def samples_at(time: Array, moments: Array) -> IntArray:
    """Return the indices (k,) of the samples at ``moments`` (k,) s past the start; the last one from the end on."""
    span = float(time[-1] - time[0])
    found = np.searchsorted(time - time[0], moments - 1e-9 * span)
    return np.clip(found, 0, len(time) - 1).astype(np.int64)


class Timeline:
    """Tracks for meshcat's animation; ``time`` (k,) in s from the run's start."""

    def __init__(self, time: Array) -> None:
        self.animation = ma.Animation(default_framerate=FPS)
        self.keys: list[float] = ((time - time[0]) * FPS).tolist()  # meshcat counts in frames

    def move(self, visualizer: Any, positions: Array, quaternions: Array | None = None) -> None:
        """Animate an object's pose: ``positions`` (k, 3), ``quaternions`` (k, 4) as x y z w."""
        self._track(visualizer, "position", "vector3", positions.tolist())
        if quaternions is not None:
            self._track(visualizer, "quaternion", "quaternion", quaternions.tolist())

    def stretch(self, visualizer: Any, scales: Array) -> None:
        """Animate an object's size along its own axes, ``scales`` (k, 3)."""
        self._track(visualizer, "scale", "vector3", scales.tolist())

    def grow(self, visualizer: Any, counts: NDArray[Any]) -> None:
        """Animate how many of an object's indices are drawn, ``counts`` (k,): a path that grows."""
        self._track(visualizer["<object>"], "geometry[drawRange].count", "number", counts.tolist())

    def send(self, visualizer: Any) -> None:
        """Hand the animation to the viewer, to be played round and round."""
        if len(self.keys) > 1:
            visualizer.set_animation(self.animation, play=True, repetitions=float("inf"))

    def _track(self, visualizer: Any, name: str, kind: str, values: Sequence[Any]) -> None:
        clip = self.animation.clips.setdefault(visualizer.path, ma.AnimationClip(fps=FPS))
        clip.tracks[name] = ma.AnimationTrack(name, kind, list(self.keys), list(values))
