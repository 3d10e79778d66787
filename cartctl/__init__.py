"""cartctl: redundancy resolution for robots, on Pinocchio.

Robots come from URDF; tasks and limits at a state become one algebraic problem; any of the field's methods answers it;
the answer becomes a command. ``import cartctl.solvers`` works without Pinocchio: the names below are imported when
they are first used.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

_HOMES = {
    "cartctl.errors": ("CartctlError", "CartctlWarning", "RunInterrupted"),
    "cartctl.algebra.certificate": ("Certificate", "LevelCertificate"),
    "cartctl.algebra.problem": ("Equation", "Inequality", "Problem"),
    "cartctl.algebra.solution": ("Solution", "Status"),
    "cartctl.algebra.inverses": (
        "Damped",
        "InversePolicy",
        "ManipulabilityDamped",
        "NumericalFiltering",
        "SelectivelyDamped",
        "SigmaDamped",
        "Truncated",
    ),
    "cartctl.solvers": ("EquationSolver", "Solver", "solve", "solvers"),
    "cartctl.solvers.citing": ("cite",),
    "cartctl.levels.metrics": ("JointLimitMetric",),
    "cartctl.solvers.dls_manipulability": ("DLSManipulability",),
    "cartctl.solvers.dls_sigma": ("DLSSigma",),
    "cartctl.solvers.extended_jacobian": ("ExtendedJacobian",),
    "cartctl.solvers.main_variables": ("MainVariables",),
    "cartctl.solvers.numerical_filtering": ("NumericalFilteringSolver",),
    "cartctl.solvers.pinv": ("Pinv",),
    "cartctl.solvers.reduced_gradient": ("ReducedGradient",),
    "cartctl.solvers.reverse_priority": ("ReversePriority",),
    "cartctl.solvers.sdls": ("SDLS",),
    "cartctl.solvers.singularity_robust_priority": ("SingularityRobustPriority",),
    "cartctl.solvers.hqp": ("HQP",),
    "cartctl.solvers.qp": ("QP",),
    "cartctl.solvers.sns": ("SNS",),
    "cartctl.solvers.prepared": ("Prepared",),
    "cartctl.solvers.sns_greedy": ("SNSGreedy",),
    "cartctl.solvers.task_scaling": ("TaskScaling",),
    "cartctl.solvers.transpose": ("Transpose",),
    "cartctl.solvers.dls": ("DLS",),
    "cartctl.solvers.projected_gradient": ("ProjectedGradient",),
    "cartctl.solvers.task_priority": ("TaskPriority",),
    "cartctl.compiled.reach": ("InverseKinematics", "Reached", "inverse_kinematics"),
    "cartctl.model.library": ("robots",),
    "cartctl.model.limits": ("Limits",),
    "cartctl.model.loading": ("load", "planar"),
    "cartctl.model.robot": ("Robot",),
    "cartctl.model.scene": ("Scene",),
    "cartctl.model.state": ("State",),
    "cartctl.tasks": (
        "ClearanceTask",
        "ComTask",
        "FrameTask",
        "FunctionTask",
        "JointTask",
        "PostureTask",
        "Reference",
        "RelativeFrameTask",
        "Task",
    ),
    "cartctl.calibration.calibrate": ("calibrate",),
    "cartctl.calibration.dh_chain": ("DHChain",),
    "cartctl.calibration.result": ("Calibration",),
    "cartctl.constraints": ("Avoid", "AvoidSelf", "Constraint", "FrameBox", "FrameSpeed", "HalfSpace"),
    "cartctl.objectives": (
        "Clearance",
        "FunctionObjective",
        "GravityTorque",
        "InverseCondition",
        "InverseManipulability",
        "JointRange",
        "KineticEnergy",
        "Manipulability",
        "Objective",
        "Posture",
        "SelfClearance",
        "SmallestSingularValue",
        "TorqueDistribution",
        "TorquePerForce",
        "VelocityRatio",
        "WeightedSum",
    ),
    "cartctl.levels": ("AccelerationLevel", "AvoidSingularity", "Command", "Halt", "SlowDown", "TorqueLevel"),
    "cartctl.dynamics.friction": ("Friction",),
    "cartctl.model.payload": ("Payload",),
    "cartctl.model.wrench": ("Wrench",),
    "cartctl.motion.energy": ("EnergyBooks",),
    "cartctl.motion.free": ("FreeMotion", "free_motion"),
    "cartctl.motion.plant": ("Plant",),
    "cartctl.motion.controller": ("Controller",),
    "cartctl.motion.batch": ("simulate_batch",),
    "cartctl.motion.batch_run": ("Batch",),
    "cartctl.motion.simulate": ("simulate",),
    "cartctl.motion.run": ("Run", "TaskRecord"),
    "cartctl.motion.metrics": ("JointMetrics", "Metrics", "TaskMetrics"),
    "cartctl.bench.scenario": ("Scenario",),
    "cartctl.wholepath": (
        "JointSpeed",
        "LocalMethod",
        "PathCost",
        "Plan",
        "PlanReport",
        "PlanStatus",
        "SquaredTorque",
        "Start",
        "plan",
    ),
    "cartctl.viewer": ("play",),
    "cartctl.paths": (
        "Circle",
        "Ellipse",
        "Line",
        "Lissajous",
        "Path",
        "PathSample",
        "Polygon",
        "Quintic",
        "SmoothTrapezoid",
        "TimingLaw",
        "Waypoints",
    ),
}
_MODULES = ("analysis", "bench", "calibration", "dynamics", "spatial", "statics")  # as cc.NAME; their names stay inside
_HOME_OF = {name: module for module, names in _HOMES.items() for name in names}

__all__ = ["__version__", *sorted(_HOME_OF)]  # noqa: PLE0604 - names, from the table above

if TYPE_CHECKING:  # editors and mypy see what __getattr__ finds
    from cartctl.algebra.certificate import Certificate as Certificate
    from cartctl.algebra.certificate import LevelCertificate as LevelCertificate
    from cartctl.algebra.inverses import Damped as Damped
    from cartctl.algebra.inverses import InversePolicy as InversePolicy
    from cartctl.algebra.inverses import ManipulabilityDamped as ManipulabilityDamped
    from cartctl.algebra.inverses import NumericalFiltering as NumericalFiltering
    from cartctl.algebra.inverses import SelectivelyDamped as SelectivelyDamped
    from cartctl.algebra.inverses import SigmaDamped as SigmaDamped
    from cartctl.algebra.inverses import Truncated as Truncated
    from cartctl.algebra.problem import Equation as Equation
    from cartctl.algebra.problem import Inequality as Inequality
    from cartctl.algebra.problem import Problem as Problem
    from cartctl.algebra.solution import Solution as Solution
    from cartctl.algebra.solution import Status as Status
    from cartctl.bench.scenario import Scenario as Scenario
    from cartctl.calibration.calibrate import calibrate as calibrate
    from cartctl.calibration.dh_chain import DHChain as DHChain
    from cartctl.calibration.result import Calibration as Calibration
    from cartctl.compiled.reach import InverseKinematics as InverseKinematics
    from cartctl.compiled.reach import Reached as Reached
    from cartctl.compiled.reach import inverse_kinematics as inverse_kinematics
    from cartctl.constraints import Avoid as Avoid
    from cartctl.constraints import AvoidSelf as AvoidSelf
    from cartctl.constraints import Constraint as Constraint
    from cartctl.constraints import FrameBox as FrameBox
    from cartctl.constraints import FrameSpeed as FrameSpeed
    from cartctl.constraints import HalfSpace as HalfSpace
    from cartctl.dynamics.friction import Friction as Friction
    from cartctl.errors import CartctlError as CartctlError
    from cartctl.errors import CartctlWarning as CartctlWarning
    from cartctl.errors import RunInterrupted as RunInterrupted
    from cartctl.levels import AccelerationLevel as AccelerationLevel
    from cartctl.levels import AvoidSingularity as AvoidSingularity
    from cartctl.levels import Command as Command
    from cartctl.levels import Halt as Halt
    from cartctl.levels import SlowDown as SlowDown
    from cartctl.levels import TorqueLevel as TorqueLevel
    from cartctl.levels.metrics import JointLimitMetric as JointLimitMetric
    from cartctl.model.library import robots as robots
    from cartctl.model.limits import Limits as Limits
    from cartctl.model.loading import load as load
    from cartctl.model.loading import planar as planar
    from cartctl.model.payload import Payload as Payload
    from cartctl.model.robot import Robot as Robot
    from cartctl.model.scene import Scene as Scene
    from cartctl.model.state import State as State
    from cartctl.model.wrench import Wrench as Wrench
    from cartctl.motion.batch import simulate_batch as simulate_batch
    from cartctl.motion.batch_run import Batch as Batch
    from cartctl.motion.controller import Controller as Controller
    from cartctl.motion.energy import EnergyBooks as EnergyBooks
    from cartctl.motion.free import FreeMotion as FreeMotion
    from cartctl.motion.free import free_motion as free_motion
    from cartctl.motion.metrics import JointMetrics as JointMetrics
    from cartctl.motion.metrics import Metrics as Metrics
    from cartctl.motion.metrics import TaskMetrics as TaskMetrics
    from cartctl.motion.plant import Plant as Plant
    from cartctl.motion.run import Run as Run
    from cartctl.motion.run import TaskRecord as TaskRecord
    from cartctl.motion.simulate import simulate as simulate
    from cartctl.objectives import Clearance as Clearance
    from cartctl.objectives import FunctionObjective as FunctionObjective
    from cartctl.objectives import GravityTorque as GravityTorque
    from cartctl.objectives import InverseCondition as InverseCondition
    from cartctl.objectives import InverseManipulability as InverseManipulability
    from cartctl.objectives import JointRange as JointRange
    from cartctl.objectives import KineticEnergy as KineticEnergy
    from cartctl.objectives import Manipulability as Manipulability
    from cartctl.objectives import Objective as Objective
    from cartctl.objectives import Posture as Posture
    from cartctl.objectives import SelfClearance as SelfClearance
    from cartctl.objectives import SmallestSingularValue as SmallestSingularValue
    from cartctl.objectives import TorqueDistribution as TorqueDistribution
    from cartctl.objectives import TorquePerForce as TorquePerForce
    from cartctl.objectives import VelocityRatio as VelocityRatio
    from cartctl.objectives import WeightedSum as WeightedSum
    from cartctl.paths import Circle as Circle
    from cartctl.paths import Ellipse as Ellipse
    from cartctl.paths import Line as Line
    from cartctl.paths import Lissajous as Lissajous
    from cartctl.paths import Path as Path
    from cartctl.paths import PathSample as PathSample
    from cartctl.paths import Polygon as Polygon
    from cartctl.paths import Quintic as Quintic
    from cartctl.paths import SmoothTrapezoid as SmoothTrapezoid
    from cartctl.paths import TimingLaw as TimingLaw
    from cartctl.paths import Waypoints as Waypoints
    from cartctl.solvers import EquationSolver as EquationSolver
    from cartctl.solvers import Solver as Solver
    from cartctl.solvers import solve as solve
    from cartctl.solvers import solvers as solvers
    from cartctl.solvers.citing import cite as cite
    from cartctl.solvers.dls import DLS as DLS
    from cartctl.solvers.dls_manipulability import DLSManipulability as DLSManipulability
    from cartctl.solvers.dls_sigma import DLSSigma as DLSSigma
    from cartctl.solvers.extended_jacobian import ExtendedJacobian as ExtendedJacobian
    from cartctl.solvers.hqp import HQP as HQP
    from cartctl.solvers.main_variables import MainVariables as MainVariables
    from cartctl.solvers.numerical_filtering import NumericalFilteringSolver as NumericalFilteringSolver
    from cartctl.solvers.pinv import Pinv as Pinv
    from cartctl.solvers.prepared import Prepared as Prepared
    from cartctl.solvers.projected_gradient import ProjectedGradient as ProjectedGradient
    from cartctl.solvers.qp import QP as QP
    from cartctl.solvers.reduced_gradient import ReducedGradient as ReducedGradient
    from cartctl.solvers.reverse_priority import ReversePriority as ReversePriority
    from cartctl.solvers.sdls import SDLS as SDLS
    from cartctl.solvers.singularity_robust_priority import SingularityRobustPriority as SingularityRobustPriority
    from cartctl.solvers.sns import SNS as SNS
    from cartctl.solvers.sns_greedy import SNSGreedy as SNSGreedy
    from cartctl.solvers.task_priority import TaskPriority as TaskPriority
    from cartctl.solvers.task_scaling import TaskScaling as TaskScaling
    from cartctl.solvers.transpose import Transpose as Transpose
    from cartctl.tasks import ClearanceTask as ClearanceTask
    from cartctl.tasks import ComTask as ComTask
    from cartctl.tasks import FrameTask as FrameTask
    from cartctl.tasks import FunctionTask as FunctionTask
    from cartctl.tasks import JointTask as JointTask
    from cartctl.tasks import PostureTask as PostureTask
    from cartctl.tasks import Reference as Reference
    from cartctl.tasks import RelativeFrameTask as RelativeFrameTask
    from cartctl.tasks import Task as Task
    from cartctl.viewer import play as play
    from cartctl.wholepath import JointSpeed as JointSpeed
    from cartctl.wholepath import LocalMethod as LocalMethod
    from cartctl.wholepath import PathCost as PathCost
    from cartctl.wholepath import Plan as Plan
    from cartctl.wholepath import PlanReport as PlanReport
    from cartctl.wholepath import PlanStatus as PlanStatus
    from cartctl.wholepath import SquaredTorque as SquaredTorque
    from cartctl.wholepath import Start as Start
    from cartctl.wholepath import plan as plan


def __getattr__(name: str) -> Any:
    if name in _MODULES:
        return import_module(f"cartctl.{name}")
    if name not in _HOME_OF:
        raise AttributeError(f"module 'cartctl' has no attribute {name!r}")
    try:
        module = import_module(_HOME_OF[name])
    except ModuleNotFoundError as error:
        if error.name is None or error.name.startswith("cartctl"):
            raise
        from cartctl.errors import MissingDependencyError

        package = {"pinocchio": "pin", "umsgpack": "u-msgpack-python"}.get(error.name, error.name)
        raise MissingDependencyError(
            f"cc.{name} needs {error.name}, which is missing: pip install {package} (`cartctl doctor` checks the rest)"
        ) from None
    value = module if name == "solvers" else getattr(module, name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(set(globals()) | set(__all__))
