"""Kinematic calibration: from measurements to a better robot model. ``from cartctl import calibration``.

``cc.DHChain`` (a Denavit-Hartenberg table) and ``RobotChain`` (any URDF) say what can be estimated, ``cc.calibrate``
estimates it, the ``cc.Calibration`` says how sure it is. ``aligned`` finds where
the robot stands in a device's frame, ``link_lengths`` is the linear case, ``choose_configurations``
says where to measure, ``cross_validate`` whether the result predicts, ``read_table`` reads measurements from CSV,
``symbolic_regressor`` prints the formulas of small tables (SymPy, the extra ``symbolic``).
"""

from cartctl.calibration.alignment import aligned
from cartctl.calibration.calibrate import calibrate
from cartctl.calibration.chain import Chain
from cartctl.calibration.design import Choice, choose_configurations
from cartctl.calibration.dh_chain import DHChain
from cartctl.calibration.gauss_newton import Outcome
from cartctl.calibration.identifiability import Indistinct
from cartctl.calibration.lengths import LinkLengths, link_lengths
from cartctl.calibration.result import Calibration, Errors
from cartctl.calibration.robot_chain import RobotChain
from cartctl.calibration.symbolic import SymbolicRegressor, symbolic_regressor
from cartctl.calibration.table import MeasurementTable, read_table
from cartctl.calibration.validation import CrossValidation, cross_validate

__all__ = [
    "Calibration",
    "Chain",
    "Choice",
    "CrossValidation",
    "DHChain",
    "Errors",
    "Indistinct",
    "LinkLengths",
    "MeasurementTable",
    "Outcome",
    "RobotChain",
    "SymbolicRegressor",
    "aligned",
    "calibrate",
    "choose_configurations",
    "cross_validate",
    "link_lengths",
    "read_table",
    "symbolic_regressor",
]
