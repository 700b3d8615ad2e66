"""Everything a plugin author may import, on one screen; loaded when it is used (PEP 562)."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

_HOME = {
    "robid_core.artifacts": (
        "Artifact", "BoolArray", "Channel", "ComplexArray", "Configurations", "DenseRun", "Design", "Diagnosis",
        "Excitation", "Fit", "FloatArray", "Frf", "IntArray", "ParameterTable", "Record", "Report",
        "ResponseComparison", "TimeComparison", "Truth", "array",
    ),
    "robid_core.stage": (
        "Acquisition", "CandidateDesign", "Context", "DiagnosisStage", "Estimator", "ExcitationDesign",
        "ExperimentDesign", "FrfEstimator", "Preprocessing", "ReportStage", "Settings", "Stage",
    ),
    "robid_core.drives": ("Drives", "Experiment", "OpenDrives", "Plant", "Session", "Trace"),
    "robid_core.robot": ("Robot",),
    "robid_core.effect": ("Effect", "ForceEffect", "Parameter", "SignalEffect", "StructureEffect"),
    "robid_core.gate": ("Clearance", "MotionLimits", "clear_motion"),
    "robid_core.errors": (
        "ConfigurationError", "DataRejected", "MotionAborted", "MotionRefused", "NotIdentifiable",
        "NotTrustworthy", "PluginError", "PoorExcitation", "RobidError", "StoreError",
    ),
}  # fmt: skip
_MODULE_OF = {name: module for module, names in _HOME.items() for name in names}

__all__ = sorted(_MODULE_OF)  # noqa: PLE0605

if TYPE_CHECKING:
    from robid_core.artifacts import *  # noqa: F403
    from robid_core.drives import Drives, Experiment, OpenDrives, Plant, Session, Trace
    from robid_core.effect import Effect, ForceEffect, Parameter, SignalEffect, StructureEffect
    from robid_core.errors import (
        ConfigurationError,
        DataRejected,
        MotionAborted,
        MotionRefused,
        NotIdentifiable,
        NotTrustworthy,
        PluginError,
        PoorExcitation,
        RobidError,
        StoreError,
    )
    from robid_core.gate import Clearance, MotionLimits, clear_motion
    from robid_core.robot import Robot
    from robid_core.stage import (
        Acquisition,
        CandidateDesign,
        Context,
        DiagnosisStage,
        Estimator,
        ExcitationDesign,
        ExperimentDesign,
        FrfEstimator,
        Preprocessing,
        ReportStage,
        Settings,
        Stage,
    )


def __getattr__(name: str) -> Any:
    if name not in _MODULE_OF:
        raise AttributeError(f"module 'robid_core' has no attribute '{name}'")
    return getattr(importlib.import_module(_MODULE_OF[name]), name)


def __dir__() -> list[str]:
    return __all__
