"""The books of energy of a simulation with dynamics."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from cartctl.checks import FloatArray


@dataclass(eq=False)
class EnergyBooks:
    """Energies of a run of N steps, (N+1,) each, J.

    kinetic, potential: T and U of the plant. motors, friction, wrenches: work since the beginning, what the motors put
    in, what friction took, what wrenches put in.
    """

    kinetic: FloatArray
    potential: FloatArray
    motors: FloatArray
    friction: FloatArray
    wrenches: FloatArray

    @property
    def residual(self) -> FloatArray:
        """``(T + U) - (T + U)(0) - motors + friction - wrenches`` (N+1,), J: the error of the integrator."""
        total = self.kinetic + self.potential
        return total - total[0] - self.motors + self.friction - self.wrenches  # type: ignore[no-any-return]

    @classmethod
    def empty(cls, samples: int) -> EnergyBooks:
        """Books with nothing in them yet."""
        return cls(*(np.zeros(samples) for _ in fields(cls)))

    def first(self, samples: int) -> EnergyBooks:
        """The first samples of them, as copies."""
        return EnergyBooks(*(getattr(self, field.name)[:samples].copy() for field in fields(self)))
