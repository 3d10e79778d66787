"""Forces at rest: joint torques and the wrenches they balance, load cells, arms that hold one object.

``cc.statics``; arrays in, arrays out, no Pinocchio. All follows from virtual work, ``tau^T v = w^T xi`` for every
motion ``xi = J v``. Wrenches are ordered force first, and belong to the frame of the Jacobian: about its origin, in its
axes. Planar and other partial Jacobians are fine: w has one entry a row of J. The ellipsoid of the forces that unit
torques balance is :func:`cartctl.analysis.force_ellipsoid`.
"""

from cartctl.statics.capacity import Capacity, WrenchRange, wrench_capacity, wrench_range
from cartctl.statics.closed_chain import ClosedChain, Contacts
from cartctl.statics.duality import Balance, balanced_wrench, exerting_torques, holding_torques
from cartctl.statics.load_cell import LoadCell, fit_load_cell

__all__ = [
    "Balance",
    "Capacity",
    "ClosedChain",
    "Contacts",
    "LoadCell",
    "WrenchRange",
    "balanced_wrench",
    "exerting_torques",
    "fit_load_cell",
    "holding_torques",
    "wrench_capacity",
    "wrench_range",
]
