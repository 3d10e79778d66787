"""What the SVD-based methods share: an inverse policy for small singular values."""

from __future__ import annotations

from dataclasses import dataclass, field

from cartctl.algebra.inverses import InversePolicy, Truncated
from cartctl.errors import ParameterError
from cartctl.solvers.base import EquationSolver


@dataclass(frozen=True)
class PolicySolver(EquationSolver):
    """An equation method whose small singular values are the business of a policy.

    policy: an InversePolicy; its cutoffs refer to each task's own matrix. Raises ParameterError.
    """

    policy: InversePolicy = field(default_factory=Truncated)

    def __post_init__(self) -> None:
        check_policy(self.policy)

    @property
    def damps(self) -> bool:
        """Whether the policy holds back what it could deliver."""
        return self.policy.damps

    def prepare(self) -> None:
        """Prepare the policy."""
        self.policy.prepare()


def check_policy(policy: object) -> None:
    """Refuse what is no InversePolicy; raises ParameterError."""
    if not isinstance(policy, InversePolicy):
        raise ParameterError(f"policy is {policy!r}; expected an InversePolicy such as cc.Truncated() or cc.Damped()")
