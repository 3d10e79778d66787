"""Inverse policies, one file each."""

from cartctl.algebra.inverses.base import InversePolicy
from cartctl.algebra.inverses.damped import Damped
from cartctl.algebra.inverses.filtering import NumericalFiltering
from cartctl.algebra.inverses.manipulability import ManipulabilityDamped
from cartctl.algebra.inverses.selective import SelectivelyDamped
from cartctl.algebra.inverses.sigma import SigmaDamped
from cartctl.algebra.inverses.truncated import Truncated

__all__ = [
    "Damped",
    "InversePolicy",
    "ManipulabilityDamped",
    "NumericalFiltering",
    "SelectivelyDamped",
    "SigmaDamped",
    "Truncated",
]
