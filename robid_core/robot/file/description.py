"""What a robot.yaml says, complete: bodies, drives, bearings and effects, nothing left to look up.

A file may say it shorter (a model file in place of bodies, data sheets, a base): `reading` writes it out. Every
contradiction is reported at once, each at its own place (`contradictions`).
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import (
    Field,
    ValidationError,
    ValidatorFunctionWrapHandler,
    model_serializer,
    model_validator,
)
from pydantic_core import InitErrorDetails

from robid_core.robot.file.axis import Axis, ControllerEntry, Friction, Sensors, Spring, VoltageServo
from robid_core.robot.file.body import Body, Direction, FlexibleLink
from robid_core.robot.file.clock import LONGEST_STEP_S, default_step
from robid_core.robot.file.contradictions import contradictions
from robid_core.robot.file.part import (
    Identifier,
    Number,
    Part,
    Positive,
    Vector,
    line_errors,
    refusal,
    with_tuples,
)

__all__ = [
    "Axis",
    "Bearing",
    "Body",
    "ControllerEntry",
    "EffectEntry",
    "FlexibleLink",
    "Friction",
    "RobotDescription",
    "Sensors",
    "Spring",
    "VoltageServo",
]

MOST_JOINTS = 100  # a humanoid with its hands has sixty


class Bearing(Spring):
    """An elastic coordinate across the transmission, right after a joint."""

    joint: str
    """The joint whose bearing gives way."""
    axis: Direction
    """Direction of rotation in the joint's frame, unit length."""


class EffectEntry(Part):
    """A phenomenon that acts in this robot, and where: {use: friction.stribeck, on: axis_2, with: {...}}."""

    use: str
    """Name of the effect's plugin."""
    on: str | None = None
    """Axis, bearing or body on which it acts, or base; null: where the effect has only one place."""
    side: Identifier | None = None
    """Side or channel (motor, gear, arm, bearing; torque, position, torque_measurement); null: the effect's own."""
    with_: Annotated[dict[Identifier, float], Field(alias="with")] = {}
    """Values of its parameters; what is not named has the effect's default."""

    @model_serializer
    def _as_written(self) -> dict[str, Any]:
        written = {"use": self.use, "on": self.on, "side": self.side, "with": dict(self.with_)}
        return {key: value for key, value in written.items() if value not in (None, {})}


class RobotDescription(Part):
    """A whole robot file."""

    robid_robot: Literal[1]
    """Version of this file format."""
    name: str
    """Name of the robot."""
    gravity: Vector = (0.0, 0.0, -9.81)
    """Gravity in the base frame, m/s^2."""
    sample_time_s: Positive = 0.001
    """Control, torque hold and trace share this time."""
    step_s: Positive = LONGEST_STEP_S
    """Integration step inside a sample; by default the longest up to 0.25 ms of which a sample has a whole number,
    halved until a motor follows its friction in 2.5 steps or more."""
    bodies: Annotated[tuple[Body, ...], Field(min_length=1, max_length=MOST_JOINTS)]
    """The chain or tree, parents before children."""
    axes: Annotated[dict[str, Axis], Field(min_length=1, max_length=MOST_JOINTS)]
    """Drives in the order of motors."""
    coupling: tuple[tuple[Number, ...], ...] | None = None
    """Joint angle per motor angle as a full matrix (coupled wrists); by default diag(1/gear_ratio)."""
    bearings: dict[str, Bearing] = {}
    """Elastic coordinates across the transmission."""
    effects: dict[Identifier, EffectEntry] = {}
    """What acts besides: label, then plugin, place and parameters."""

    @model_validator(mode="wrap")
    @classmethod
    def _without_contradictions(cls, data: Any, handler: ValidatorFunctionWrapHandler) -> RobotDescription:
        data = with_tuples(data)
        if isinstance(data, dict) and "step_s" not in data:
            data = {**data, "step_s": default_step(data.get("sample_time_s", 0.001), data.get("axes"))}
        errors: list[InitErrorDetails] = []
        try:
            description: RobotDescription = handler(data)
        except ValidationError as error:
            errors = line_errors(error)
        spoiled = [tuple(item["loc"]) for item in errors]
        for path, reason in contradictions(data if isinstance(data, dict) else {}):
            if not any(path[: len(other)] == other for other in spoiled):  # it would be an echo
                errors.append(InitErrorDetails(type=refusal(reason), loc=path, input=None))
        if errors:
            raise ValidationError.from_exception_data(cls.__name__, errors)
        return description
