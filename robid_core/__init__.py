"""Everything that plugins and notebooks may import, on one screen; loaded when it is used (PEP 562)."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

_HOME = {
    "robid_core.arrays": ("BoolArray", "ComplexArray", "FloatArray", "IntArray"),
    "robid_core.artifacts": (
        "Artifact", "Channel", "Configurations", "DenseRun", "Design", "DiagnosedData", "Diagnosis",
        "Doubt", "EssentialParameters", "Excitation", "ExcitedRange", "Finding", "Fit", "FrictionCurve", "Frf",
        "MisfitTable", "Model", "ParameterTable", "PredictionCurve", "PredictionErrors", "Record", "Report",
        "ResidualCurve", "ResponseComparison", "RunErrors", "SearchRecord", "SeparatingExperiment", "Table",
        "TimeComparison", "Timing", "Truth", "VisibleSize", "ResponseCheck", "array", "frozen", "is_by_tolerance",
        "is_determined",
        "mean_travel", "significant_digits", "QUANTITIES", "UNITS",
    ),
    "robid_core.stage": (
        "Acquisition", "CandidateDesign", "Context", "DiagnosisStage", "Estimator", "ExcitationDesign",
        "ExperimentDesign", "FrfEstimator", "MILESTONE", "Preprocessing", "ReportStage", "Settings", "Stage",
    ),
    "robid_core.settings_types": ("DataPath", "ProjectPath", "RobotName", "StageRef"),
    "robid_core.drives": (
        "Drives", "Experiment", "ExperimentIndex", "OpenDrives", "Plant", "RawLog", "RecordPlan", "Session", "Trace",
        "assemble_record",
    ),
    "robid_core.notebook": ("Run", "StageFunction", "use"),
    "robid_core.pipeline": ("Pipeline",),
    "robid_core.parameters": ("FreeParameters", "chosen_names", "pattern_problems"),
    "robid_core.parameters.tangents": ("mechanism_change",),
    "robid_core.foreign": ("BAG_READER", "files_of", "guarded_reader", "is_bag", "is_recording"),
    "robid_core.registered": ("load_plugin",),
    "robid_core.registry": ("Plugin", "record_readers"),
    "robid_core.robot": ("Robot",),
    "robid_core.robot.file.left_out": ("AxisKey",),
    "robid_core.robot.sampling": ("other_sampling",),
    "robid_core.robot.file.model_file": ("JointLimits", "MeshShape", "RobotModel"),
    "robid_core.robot.link_meshes": ("LinkMesh", "link_meshes"),
    "robid_core.robot.effect_columns": ("EffectColumn", "effect_columns"),
    "robid_core.robot.forces_along": ("ForceAlong", "ForcesAlong", "RobotMotion", "forces_along"),
    "robid_core.robot.recorded": ("simulate_record", "simulate_records"),
    "robid_core.robot.structure_effect": ("StructureEffect",),
    "robid_core.robot.batch": ("BatchPortion", "ExperimentBatch", "simulate_over", "simulate_portions"),
    "robid_core.robot.side_by_side": ("prescribe_many",),
    "robid_core.effect": (
        "Effect", "Equivalent", "ForceEffect", "Motion", "Parameter", "Place", "SignalEffect",
        "TestValue",
    ),
    "robid_core.gate": ("Clearance", "MotionLimits", "clear_motion"),
    "robid_core.interruption": ("at_safe_points", "heed"),
    "robid_core.errors": (
        "ConfigurationError", "DataRejected", "ExtraMissing", "MotionAborted", "MotionRefused",
        "NotIdentifiable", "NotTrustworthy", "PluginError", "PoorExcitation", "RobidError",
        "StopNotConfirmed", "StoreError",
    ),
}  # fmt: skip
PLOT = "plot"  # the one module among the names: `robid.plot.response(frf, fit)`
_MODULE_OF = {name: module for module, names in _HOME.items() for name in names}

__all__ = sorted(_MODULE_OF)

if TYPE_CHECKING:  # the same names for type checkers; tests compare the two lists
    from robid_core import plot as plot
    from robid_core.arrays import (
        BoolArray as BoolArray,
        ComplexArray as ComplexArray,
        FloatArray as FloatArray,
        IntArray as IntArray,
    )
    from robid_core.artifacts import (
        QUANTITIES as QUANTITIES,
        UNITS as UNITS,
        Artifact as Artifact,
        Channel as Channel,
        Configurations as Configurations,
        DenseRun as DenseRun,
        Design as Design,
        DiagnosedData as DiagnosedData,
        Diagnosis as Diagnosis,
        Doubt as Doubt,
        EssentialParameters as EssentialParameters,
        Excitation as Excitation,
        ExcitedRange as ExcitedRange,
        Finding as Finding,
        Fit as Fit,
        Frf as Frf,
        FrictionCurve as FrictionCurve,
        MisfitTable as MisfitTable,
        Model as Model,
        ParameterTable as ParameterTable,
        PredictionCurve as PredictionCurve,
        PredictionErrors as PredictionErrors,
        Record as Record,
        Report as Report,
        ResidualCurve as ResidualCurve,
        ResponseCheck as ResponseCheck,
        ResponseComparison as ResponseComparison,
        RunErrors as RunErrors,
        SearchRecord as SearchRecord,
        SeparatingExperiment as SeparatingExperiment,
        Table as Table,
        TimeComparison as TimeComparison,
        Timing as Timing,
        Truth as Truth,
        VisibleSize as VisibleSize,
        array as array,
        frozen as frozen,
        is_by_tolerance as is_by_tolerance,
        is_determined as is_determined,
        mean_travel as mean_travel,
        significant_digits as significant_digits,
    )
    from robid_core.drives import (
        Drives as Drives,
        Experiment as Experiment,
        ExperimentIndex as ExperimentIndex,
        OpenDrives as OpenDrives,
        Plant as Plant,
        RawLog as RawLog,
        RecordPlan as RecordPlan,
        Session as Session,
        Trace as Trace,
        assemble_record as assemble_record,
    )
    from robid_core.effect import (
        Effect as Effect,
        Equivalent as Equivalent,
        ForceEffect as ForceEffect,
        Motion as Motion,
        Parameter as Parameter,
        Place as Place,
        SignalEffect as SignalEffect,
        TestValue as TestValue,
    )
    from robid_core.errors import (
        ConfigurationError as ConfigurationError,
        DataRejected as DataRejected,
        ExtraMissing as ExtraMissing,
        MotionAborted as MotionAborted,
        MotionRefused as MotionRefused,
        NotIdentifiable as NotIdentifiable,
        NotTrustworthy as NotTrustworthy,
        PluginError as PluginError,
        PoorExcitation as PoorExcitation,
        RobidError as RobidError,
        StopNotConfirmed as StopNotConfirmed,
        StoreError as StoreError,
    )
    from robid_core.foreign import (
        BAG_READER as BAG_READER,
        files_of as files_of,
        guarded_reader as guarded_reader,
        is_bag as is_bag,
        is_recording as is_recording,
    )
    from robid_core.gate import (
        Clearance as Clearance,
        MotionLimits as MotionLimits,
        clear_motion as clear_motion,
    )
    from robid_core.interruption import (
        at_safe_points as at_safe_points,
        heed as heed,
    )
    from robid_core.notebook import (
        Run as Run,
        StageFunction as StageFunction,
        use as use,
    )
    from robid_core.parameters import (
        FreeParameters as FreeParameters,
        chosen_names as chosen_names,
        pattern_problems as pattern_problems,
    )
    from robid_core.parameters.tangents import (
        mechanism_change as mechanism_change,
    )
    from robid_core.pipeline import (
        Pipeline as Pipeline,
    )
    from robid_core.registry import (
        Plugin as Plugin,
        record_readers as record_readers,
    )
    from robid_core.robot import (
        Robot as Robot,
    )
    from robid_core.robot.batch import (
        BatchPortion as BatchPortion,
        ExperimentBatch as ExperimentBatch,
        simulate_over as simulate_over,
        simulate_portions as simulate_portions,
    )
    from robid_core.robot.effect_columns import (
        EffectColumn as EffectColumn,
        effect_columns as effect_columns,
    )
    from robid_core.robot.file.left_out import (
        AxisKey as AxisKey,
    )
    from robid_core.robot.file.model_file import (
        JointLimits as JointLimits,
        MeshShape as MeshShape,
        RobotModel as RobotModel,
    )
    from robid_core.robot.forces_along import (
        ForceAlong as ForceAlong,
        ForcesAlong as ForcesAlong,
        RobotMotion as RobotMotion,
        forces_along as forces_along,
    )
    from robid_core.robot.link_meshes import (
        LinkMesh as LinkMesh,
        link_meshes as link_meshes,
    )
    from robid_core.robot.recorded import (
        simulate_record as simulate_record,
        simulate_records as simulate_records,
    )
    from robid_core.robot.sampling import other_sampling as other_sampling
    from robid_core.robot.side_by_side import (
        prescribe_many as prescribe_many,
    )
    from robid_core.robot.structure_effect import (
        StructureEffect as StructureEffect,
    )
    from robid_core.settings_types import (
        DataPath as DataPath,
        ProjectPath as ProjectPath,
        RobotName as RobotName,
        StageRef as StageRef,
    )
    from robid_core.stage import (
        MILESTONE as MILESTONE,
        Acquisition as Acquisition,
        CandidateDesign as CandidateDesign,
        Context as Context,
        DiagnosisStage as DiagnosisStage,
        Estimator as Estimator,
        ExcitationDesign as ExcitationDesign,
        ExperimentDesign as ExperimentDesign,
        FrfEstimator as FrfEstimator,
        Preprocessing as Preprocessing,
        ReportStage as ReportStage,
        Settings as Settings,
        Stage as Stage,
    )


def __getattr__(name: str) -> Any:
    if name == PLOT:
        return importlib.import_module(f"robid_core.{PLOT}")
    if name not in _MODULE_OF:
        raise AttributeError(f"module 'robid_core' has no attribute '{name}'")
    return getattr(importlib.import_module(_MODULE_OF[name]), name)


def __dir__() -> list[str]:
    return [*__all__, PLOT]
