"""The JSON schema (draft 7) of robot files: every key that a person may write, with what it means and its unit.

A file has one of `bodies`, `dh`, `model` and `base`. What contradicts another entry only the reader sees.
"""

from __future__ import annotations

import json
from typing import Annotated, Any

from pydantic import Field, create_model

from robid_core.robot.file.axis import Axis, Spring
from robid_core.robot.file.data_sheet import BearingSheet, GearSheet
from robid_core.robot.file.denavit_hartenberg import DenavitHartenbergTable
from robid_core.robot.file.description import RobotDescription
from robid_core.robot.file.part import Number, Part
from robid_core.robot.file.reading import DerivedRobot


class WrittenGear(Part):
    """A gear as its data sheet gives it."""

    data_sheet: GearSheet
    """Stiffness in three ranges of torque, lost motion, damping."""


class WrittenAxis(Axis):
    """One drive of a robot file; limits that are left out beside a model are those of the model file."""

    gear: Spring | WrittenGear | None = None  # type: ignore[assignment]
    """Elasticity in the direction of transmission, at the joint: numbers, or a data sheet; left out: rigid."""
    bearing: BearingSheet | None = None
    """Moment rigidity of the bearing behind the joint: two elastic coordinates across the axis."""


class WrittenRobot(RobotDescription):
    """A robot file that stands on no other one."""

    axes: Annotated[dict[str, WrittenAxis], Field(min_length=1)]  # type: ignore[assignment]
    """Drives in the order of motors, by name; each moves the joint of its name, or `joint`."""
    model: str | None = None
    """Path of a model file (URDF) relative to this one: bodies, joints, limits of the joints; in place of `bodies`."""
    lock: dict[str, Number] = {}
    """Joints of the model file that do not move, and the coordinate each stays at, rad or m; mimicking ones too."""
    dh: DenavitHartenbergTable | None = None
    """A Denavit-Hartenberg table in place of `bodies`."""


def robot_schema() -> dict[str, Any]:
    """Return the schema of a robot file as JSON values."""
    forms = create_model("RobotFile", whole=(WrittenRobot, ...), derived=(DerivedRobot, ...))
    text = json.dumps(forms.model_json_schema(by_alias=True)).replace("#/$defs/", "#/definitions/")
    definitions = json.loads(text)["$defs"]
    whole = definitions["WrittenRobot"]
    whole["required"] = [key for key in whole["required"] if key != "bodies"]
    whole["oneOf"] = [{"required": [key]} for key in ("bodies", "model", "dh")]
    return {
        "$schema": "http://json-schema.org/draft-07/schema#",
        "title": "robid robot",
        "definitions": definitions,
        "if": {"required": ["base"]},
        "then": {"$ref": "#/definitions/DerivedRobot"},
        "else": {"$ref": "#/definitions/WrittenRobot"},
    }
