"""Artifacts: Configurations -> Excitation -> Record -> Frf -> Fit -> Design / Diagnosis -> Report."""

from robid_core.artifacts.artifact import (
    Artifact,
    BoolArray,
    ComplexArray,
    FloatArray,
    IntArray,
    array,
)
from robid_core.artifacts.configurations import Configurations
from robid_core.artifacts.design import Design
from robid_core.artifacts.excitation import Excitation
from robid_core.artifacts.fit import Diagnosis, Fit, ParameterTable, ResponseComparison, TimeComparison
from robid_core.artifacts.frf import Frf
from robid_core.artifacts.model import Model
from robid_core.artifacts.record import Channel, DenseRun, Record
from robid_core.artifacts.report import Report, Truth

__all__ = [
    "Artifact",
    "BoolArray",
    "Channel",
    "ComplexArray",
    "Configurations",
    "DenseRun",
    "Design",
    "Diagnosis",
    "Excitation",
    "Fit",
    "FloatArray",
    "Frf",
    "IntArray",
    "Model",
    "ParameterTable",
    "Record",
    "Report",
    "ResponseComparison",
    "TimeComparison",
    "Truth",
    "array",
]
