"""Artifacts: Configurations -> Excitation -> Record -> Frf -> Fit -> Design / Diagnosis -> Report."""

from robid_core.artifacts.artifact import (
    Artifact,
    array,
)
from robid_core.artifacts.configurations import Configurations
from robid_core.artifacts.dense_run import Channel, DenseRun
from robid_core.artifacts.design import Design
from robid_core.artifacts.determined import is_by_tolerance, is_determined, significant_digits
from robid_core.artifacts.doubts import Doubt
from robid_core.artifacts.essential import EssentialParameters
from robid_core.artifacts.excitation import Excitation, mean_travel
from robid_core.artifacts.finding import DiagnosedData, Finding, ResidualCurve, SearchRecord, VisibleSize
from robid_core.artifacts.fit import (
    Diagnosis,
    Fit,
    ParameterTable,
    PredictionErrors,
    ResponseComparison,
    TimeComparison,
)
from robid_core.artifacts.freezing import frozen
from robid_core.artifacts.frf import Frf
from robid_core.artifacts.friction_curve import FrictionCurve
from robid_core.artifacts.misfit import MisfitTable
from robid_core.artifacts.model import Model
from robid_core.artifacts.prediction import ExcitedRange, PredictionCurve, RunErrors
from robid_core.artifacts.record import Record
from robid_core.artifacts.report import Report, Truth
from robid_core.artifacts.response_check import ResponseCheck
from robid_core.artifacts.separating_experiment import SeparatingExperiment
from robid_core.artifacts.tables import Table
from robid_core.artifacts.timing import Timing
from robid_core.artifacts.units import QUANTITIES, UNITS

__all__ = [
    "QUANTITIES",
    "UNITS",
    "Artifact",
    "Channel",
    "Configurations",
    "DenseRun",
    "Design",
    "DiagnosedData",
    "Diagnosis",
    "Doubt",
    "Excitation",
    "ExcitedRange",
    "Finding",
    "Fit",
    "EssentialParameters",
    "FrictionCurve",
    "Frf",
    "MisfitTable",
    "Model",
    "ParameterTable",
    "PredictionCurve",
    "PredictionErrors",
    "Record",
    "Report",
    "ResidualCurve",
    "ResponseComparison",
    "RunErrors",
    "SearchRecord",
    "SeparatingExperiment",
    "Table",
    "VisibleSize",
    "TimeComparison",
    "Timing",
    "Truth",
    "ResponseCheck",
    "array",
    "frozen",
    "is_by_tolerance",
    "is_determined",
    "significant_digits",
    "mean_travel",
]
