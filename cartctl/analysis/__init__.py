"""What a Jacobian, an inverse or a projector is worth: ranks, ellipsoids, singularities, and where they lie.

``from cartctl import analysis``; everything takes arrays, and the searches take a robot with tasks or functions of your
own. Numbers below ``tolerance`` times the Frobenius norm of the matrix they belong to count as zero; by default that is
round-off. A Jacobian made by finite differences is good to 1e-9 or so: give it ``tolerance=1e-8``.
"""

from cartctl.analysis.algorithmic import AlgorithmicSingularity, algorithmic_singularity
from cartctl.analysis.box import Box
from cartctl.analysis.ellipsoids import Ellipsoid, force_ellipsoid, velocity_ellipsoid
from cartctl.analysis.extent import Extent, where_singular
from cartctl.analysis.generic import GenericRank, generic_rank
from cartctl.analysis.kinematic import KinematicSingularity, kinematic_singularity
from cartctl.analysis.penrose import Penrose, penrose
from cartctl.analysis.projectors import ProjectorCheck, check_projector
from cartctl.analysis.search import (
    Search,
    SingularConfiguration,
    find_algorithmic_singularities,
    find_kinematic_singularities,
)
from cartctl.analysis.spectrum import (
    Spectrum,
    condition,
    determinant,
    manipulability,
    nullity,
    rank,
    redundancy,
    singular_values,
    spectrum,
)
from cartctl.analysis.summary import Block, Summary, summary

__all__ = [
    "AlgorithmicSingularity",
    "Block",
    "Box",
    "Ellipsoid",
    "Extent",
    "GenericRank",
    "KinematicSingularity",
    "Penrose",
    "ProjectorCheck",
    "Search",
    "SingularConfiguration",
    "Spectrum",
    "Summary",
    "algorithmic_singularity",
    "check_projector",
    "condition",
    "determinant",
    "find_algorithmic_singularities",
    "find_kinematic_singularities",
    "force_ellipsoid",
    "generic_rank",
    "kinematic_singularity",
    "manipulability",
    "nullity",
    "penrose",
    "rank",
    "redundancy",
    "singular_values",
    "spectrum",
    "summary",
    "velocity_ellipsoid",
    "where_singular",
]
