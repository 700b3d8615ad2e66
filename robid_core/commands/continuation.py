"""`robid diagnose --continue`: the stages that measure what separates ties, on simulated drives, and judge again."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

from robid_core.errors import ConfigurationError, MotionRefused

if TYPE_CHECKING:
    from robid_core.artifacts import Diagnosis, SeparatingExperiment
    from robid_core.pipeline import Pipeline

AGAIN = "explain_again"


def drives_of(path: Path) -> dict[str, Any]:
    """Drives of a pipeline file as another one can name them, files as they lie from here.

    Raises
    ------
    MotionRefused
        Where they move hardware.
    """
    from robid_core.pipeline import Pipeline

    choice = Pipeline.load(path).drives
    if choice is None:
        raise ConfigurationError(f"{path}: it has no drives; name a pipeline whose `drives:` are simulated")
    if getattr(choice.settings, "moves_hardware", True):
        raise MotionRefused(
            f"{path}: its drives move hardware, and robid diagnose --continue measures on simulated drives only"
        )
    settings = choice.settings.model_dump(mode="json", exclude_defaults=True)
    settings |= {
        file.setting: os.path.relpath(file.path) for file in choice.files if file.setting in settings
    }
    return {"use": choice.plugin.name, "with": settings}


def diagnosis_of(pipeline: Pipeline, stage: str) -> Diagnosis:
    """Return what a stage of a run found."""
    from robid_core.artifacts import Diagnosis
    from robid_core.run import Manifest, RunFolder
    from robid_core.run.results import refuse_damaged

    folder = RunFolder.of(pipeline)
    manifest = Manifest.read(folder)
    if manifest is None or stage not in manifest.stages:
        raise ConfigurationError(f"{folder.path}: the run has no diagnosis '{stage}'")
    record = manifest.stages[stage]
    refuse_damaged(folder.path / record.file, record.sha256)
    return Diagnosis.read(folder.path / record.file)


def experiment_of(diagnosis: Diagnosis) -> SeparatingExperiment | None:
    """Return the first experiment that tells a finding from a tie; None where there is none."""
    found = (one.separation for one in diagnosis.findings)
    return next((one for one in found if one is not None and one.tells.any()), None)


def stages_of(records: list[str], experiment: SeparatingExperiment, asked: dict[str, Any]) -> dict[str, Any]:
    """Return the stages that measure, and judge again with all records, by name."""
    from_explain = {"diagnosis": "explain"}
    settle = experiment.n_settling
    return {
        "where_next": {"use": "design.separating", "inputs": from_explain},
        "excite_next": {"use": "excitation.separating", "inputs": from_explain},
        "measure_next": {
            "use": "acquisition.drives",
            "inputs": {"configurations": "where_next", "excitation": "excite_next"},
            "with": {"periods": experiment.n_period, "settle_periods": settle},
        },
        AGAIN: {
            "use": "diagnosis.effects",
            "inputs": {"record": [*records, "measure_next"]},
            "with": asked,
        },
    }
