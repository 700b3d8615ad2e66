"""What the author of a plugin tests with: the contracts of stages and effects, and example artifacts that fit together.

`check_stage(MyStage, some_setting=3)` or `check_effect(MyEffect)` is all that most tests need; the example factories
serve the others.
"""

from robid_core.testing.broken import ContractBroken
from robid_core.testing.contract import check_settings, check_stage
from robid_core.testing.effects import check_effect
from robid_core.testing.estimators import (
    check_covers_truth,
    check_hands_on_what_no_residual_shows,
    check_recovers_plant,
)
from robid_core.testing.inputs import (
    example_artifacts,
    example_configurations,
    example_design,
    example_diagnosis,
    example_excitation,
    example_fit,
    example_frf,
    example_record,
    example_truth,
)
from robid_core.testing.lending import example_context, example_drives
from robid_core.testing.places import example_place
from robid_core.testing.plants import MassSpringPlant, plant_record
from robid_core.testing.robots import example_robot

__all__ = [
    "ContractBroken",
    "MassSpringPlant",
    "check_covers_truth",
    "check_effect",
    "check_hands_on_what_no_residual_shows",
    "check_recovers_plant",
    "check_settings",
    "check_stage",
    "example_artifacts",
    "example_configurations",
    "example_context",
    "example_design",
    "example_diagnosis",
    "example_drives",
    "example_excitation",
    "example_fit",
    "example_frf",
    "example_place",
    "example_record",
    "example_robot",
    "example_truth",
    "plant_record",
]
