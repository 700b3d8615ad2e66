"""What a robot.yaml says: bodies (inline or from a model file), drives, gears, bearings.

Sides: everything under `axes` is at the motor shaft with the sign of the joint's axis, except `gear`
(stiffness and damping at the joint, thesis eq. 2.2) and `position_limits`. A prismatic axis has metres and
newtons wherever a revolute one has radians and newton metres.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

Vector = tuple[float, float, float]
Positive = Annotated[float, Field(gt=0)]
NonNegative = Annotated[float, Field(ge=0)]


class _Part(BaseModel):
    model_config = ConfigDict(
        extra="forbid", frozen=True, strict=True, allow_inf_nan=False, use_attribute_docstrings=True
    )


class Body(_Part):
    """A joint and the rigid body that moves with it."""

    joint: str
    """Name of the joint; coordinates carry it."""
    parent: str | None = None
    """Joint whose body carries this one; null: the base."""
    type: Literal["revolute", "prismatic"] = "revolute"
    """How the joint moves."""
    axis: Vector = (0.0, 0.0, 1.0)
    """Direction of motion in the joint's frame, unit length."""
    translation: Vector = (0.0, 0.0, 0.0)
    """Origin of the joint's frame in the parent's frame, m."""
    rotation: tuple[Vector, Vector, Vector] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    """Rows of the rotation matrix from the joint's frame to the parent's."""
    mass: NonNegative = 0.0
    """Mass in kg."""
    centre_of_mass: Vector = (0.0, 0.0, 0.0)
    """Centre of mass in the joint's frame, m."""
    inertia: tuple[Vector, Vector, Vector] = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    """Inertia about the centre of mass, axes of the joint's frame, kg m^2."""


class Spring(_Part):
    """A linear spring with a damper beside it."""

    stiffness: Positive
    """N m/rad (N/m across a prismatic axis), joint side."""
    damping: NonNegative
    """N m s/rad, joint side."""


class Friction(_Part):
    """Coulomb and viscous friction of the motor, with a constant offset (thesis eq. 2.9 and 2.10)."""

    coulomb: NonNegative = 0.0
    """Coulomb level, N m."""
    viscous: NonNegative = 0.0
    """Viscous coefficient, N m s/rad."""
    offset: float = 0.0
    """Constant torque that the motor works against, N m."""
    speed: Positive = 0.5
    """Speed scale v_s of tanh(v / v_s), rad/s: below it friction is not resolved."""


class Sensors(_Part):
    """What the drive measures, and how badly."""

    encoder_counts: NonNegative = 0.0
    """Counts per motor turn (per metre on a prismatic axis with ratio 1); 0: not quantised."""
    position_noise: NonNegative = 0.0
    """Standard deviation of the measured motor angle, rad."""
    torque_noise: NonNegative = 0.0
    """Standard deviation of the measured torque, N m."""


class Controller(_Part):
    """Cascade in the drive: e = feedforward * v_ref + position_gain * (q_ref - q) - v; PI on e."""

    speed_gain: NonNegative
    """Torque per speed error, N m s/rad."""
    integral_gain: NonNegative = 0.0
    """Torque per integrated speed error, N m/rad."""
    position_gain: NonNegative = 0.0
    """Speed asked per position error, 1/s; 0: speed control only, as in the thesis' experiments."""
    speed_feedforward: Annotated[float, Field(ge=0, le=1)] = 1.0
    """Share of the reference speed that is fed forward."""


class Axis(_Part):
    """One drive: motor, gear, sensors and controller."""

    joint: str | None = None
    """The joint it moves; by default the joint of the same name."""
    gear_ratio: float = 1.0
    """Motor turns per joint turn; negative where the gear reverses."""
    rotor_inertia: Positive
    """Inertia of rotor, brake and gear input, kg m^2."""
    torque_constant: Positive = 1.0
    """N m/A."""
    torque_limit: Positive
    """Largest torque, N m."""
    speed_limit: Positive
    """Largest speed, rad/s."""
    acceleration_limit: Positive = 1.0e6
    """Largest commanded acceleration, rad/s^2."""
    position_limits: tuple[float, float] | None = None
    """Joint-side limits, rad; by default those of the model file."""
    gear: Spring | None = None
    """Elasticity in the direction of transmission; null: rigid."""
    friction: Friction = Friction()
    """Friction at the motor."""
    sensors: Sensors = Sensors()
    """Encoder and torque measurement."""
    controller: Controller
    """Gains of the drive's cascade."""

    @model_validator(mode="after")
    def _ratio_is_a_ratio(self) -> Axis:
        if self.gear_ratio == 0:
            raise ValueError("gear_ratio must not be 0")
        return self


class Bearing(Spring):
    """An elastic coordinate across the transmission, right after a joint."""

    joint: str
    """The joint whose bearing gives way."""
    axis: Vector
    """Direction of rotation in the joint's frame, unit length."""


class RobotDescription(_Part):
    """A whole robot file."""

    robid_robot: Literal[1]
    """Version of this file format."""
    name: str
    """Name of the robot."""
    gravity: Vector = (0.0, 0.0, -9.81)
    """Gravity in the base frame, m/s^2."""
    sample_time_s: Positive = 0.001
    """Control, torque hold and trace share this time."""
    step_s: Positive = 0.00025
    """Integration step inside a sample."""
    bodies: Annotated[tuple[Body, ...], Field(min_length=1)]
    """The chain or tree, parents before children."""
    axes: Annotated[dict[str, Axis], Field(min_length=1)]
    """Drives in the order of motors."""
    coupling: tuple[tuple[float, ...], ...] | None = None
    """Joint angle per motor angle as a full matrix (coupled wrists); by default diag(1/gear_ratio)."""
    bearings: dict[str, Bearing] = {}
    """Elastic coordinates across the transmission."""

    @model_validator(mode="after")
    def _names_exist(self) -> RobotDescription:
        joints = [body.joint for body in self.bodies]
        for name, axis in self.axes.items():
            if (axis.joint or name) not in joints:
                raise ValueError(f"axes.{name}: there is no joint '{axis.joint or name}'; there are {joints}")
        for name, bearing in self.bearings.items():
            if bearing.joint not in joints:
                raise ValueError(f"bearings.{name}: there is no joint '{bearing.joint}'; there are {joints}")
        for index, body in enumerate(self.bodies):
            if body.parent is not None and body.parent not in joints[:index]:
                raise ValueError(f"bodies: '{body.joint}' must stand after its parent '{body.parent}'")
        moved = [axis.joint or name for name, axis in self.axes.items()]
        idle = [joint for joint in joints if joint not in moved]
        if idle or len(set(moved)) < len(moved):
            raise ValueError(f"every joint needs exactly one drive under axes; without one: {idle}")
        n = len(self.axes)
        if self.coupling is not None and (
            len(self.coupling) != n or any(len(row) != n for row in self.coupling)
        ):
            raise ValueError(f"coupling must be a {n} x {n} matrix")
        return self


# (group, unit, path) of every named parameter; {} is the name of the axis or bearing.
_AXIS_PARAMETERS: tuple[tuple[str, str, str, tuple[str, ...]], ...] = (
    ("gear_stiffness.{}", "stiffness", "N m/rad", ("gear", "stiffness")),
    ("gear_damping.{}", "damping", "N m s/rad", ("gear", "damping")),
    ("rotor_inertia.{}", "inertia", "kg m^2", ("rotor_inertia",)),
    ("torque_constant.{}", "drive", "N m/A", ("torque_constant",)),
    ("friction.{}.coulomb", "friction", "N m", ("friction", "coulomb")),
    ("friction.{}.viscous", "friction", "N m s/rad", ("friction", "viscous")),
    ("friction.{}.offset", "friction", "N m", ("friction", "offset")),
)
_BEARING_PARAMETERS: tuple[tuple[str, str, str, tuple[str, ...]], ...] = (
    ("bearing_stiffness.{}", "stiffness", "N m/rad", ("stiffness",)),
    ("bearing_damping.{}", "damping", "N m s/rad", ("damping",)),
)
_LINEAR_UNITS = {
    "N m/rad": "N/m",
    "N m s/rad": "N s/m",
    "kg m^2": "kg",
    "N m/A": "N/A",
    "N m": "N",
}


class NamedParameter(_Part):
    """Where a parameter of the robot stands in its description."""

    name: str
    group: str
    unit: str
    path: tuple[str | int, ...]


def named_parameters(description: RobotDescription) -> dict[str, NamedParameter]:
    """Return every parameter that can be estimated or set by name, in the order of the file."""
    found: dict[str, NamedParameter] = {}
    prismatic = {body.joint for body in description.bodies if body.type == "prismatic"}
    for pattern, group, unit, path in _AXIS_PARAMETERS:
        for name, axis in description.axes.items():
            if path[0] == "gear" and axis.gear is None:
                continue
            linear = (axis.joint or name) in prismatic
            parameter = NamedParameter(
                name=pattern.format(name),
                group=group,
                unit=_LINEAR_UNITS[unit] if linear else unit,
                path=("axes", name, *path),
            )
            found[parameter.name] = parameter
    for pattern, group, unit, path in _BEARING_PARAMETERS:
        for name in description.bearings:
            parameter = NamedParameter(
                name=pattern.format(name), group=group, unit=unit, path=("bearings", name, *path)
            )
            found[parameter.name] = parameter
    for index, body in enumerate(description.bodies):
        if body.mass > 0:
            name = f"mass.{body.joint}"
            found[name] = NamedParameter(
                name=name, group="inertia", unit="kg", path=("bodies", index, "mass")
            )
    return found


def with_values(description: RobotDescription, values: dict[str, float]) -> RobotDescription:
    """Return the description with some named parameters changed; raises KeyError for an unknown name."""
    parameters = named_parameters(description)
    data: dict[str, Any] = description.model_dump()
    for name, value in values.items():
        *path, last = parameters[name].path
        node: Any = data
        for key in path:
            node = node[key]
        node[last] = float(value)
    return RobotDescription.model_validate(data)
