"""One drive of a robot file: motor, gear, sensors and controller, an entry of `axes`.

Everything is at the motor shaft with the sign of the joint's axis, except `gear` (stiffness and damping at the joint,
thesis eq. 2.2) and `position_limits`. A prismatic axis has metres and newtons there, and its `gear_ratio` is in radians
of the motor per metre (a screw). With a ratio of 1 the motor slides, too (a linear motor), and has metres and newtons
wherever a motor that turns has radians and newton metres.

Recordings are read and fitted without limits and controllers, so a file may leave these out; `left_out` tells a stage
that needs one. Limits that are left out beside a `model:` are those of that file, through the gear (`model_file`).
"""

from __future__ import annotations

from typing import Annotated

from pydantic import AfterValidator, Field, model_validator

from robid_core.robot.file.clock import COULOMB_SPEED
from robid_core.robot.file.part import LARGEST, NonNegative, Number, Part, Positive, Vector, refusal
from robid_core.robot.file.rotation import IDENTITY, Rotation

_LARGEST_RATIO = 1e9  # a screw of 1 um on a prismatic axis turns 6e6 rad/m


def _a_ratio(ratio: float) -> float:
    if not 1 / _LARGEST_RATIO <= abs(ratio) <= _LARGEST_RATIO:
        said = "must not be 0" if ratio == 0 else f"{ratio:g} is beyond all gears"
        raise refusal(f"gear_ratio {said}; give motor turns per joint turn, negative where the gear reverses")
    return ratio


def _in_order(limits: tuple[float, float]) -> tuple[float, float]:
    lower, upper = limits
    if lower >= upper:
        raise refusal(f"the lower limit {lower:g} is not below the upper one {upper:g}; write [lower, upper]")
    return limits


class Spring(Part):
    """A linear spring with a damper beside it."""

    stiffness: Positive
    """N m/rad (N/m along a prismatic axis), joint side."""
    damping: NonNegative
    """N m s/rad, joint side."""


class Friction(Part):
    """Coulomb and viscous friction of the motor, with a constant offset (thesis eq. 2.9 and 2.10)."""

    coulomb: NonNegative = 0.0
    """Coulomb level, N m."""
    viscous: NonNegative = 0.0
    """Viscous coefficient, N m s/rad."""
    offset: Number = 0.0
    """Constant torque that the motor works against, N m."""
    speed: Positive = COULOMB_SPEED
    """Speed scale v_s of tanh(v / v_s), rad/s: below it friction is not resolved."""


class InertialSensorEntry(Part):
    """An accelerometer and a gyroscope on the link that an axis moves."""

    translation: Vector = (0.0, 0.0, 0.0)
    """Where it sits, in the joint's frame, m."""
    rotation: Rotation = IDENTITY
    """Rows of the rotation matrix from the sensor's frame to the joint's."""
    acceleration_noise: NonNegative = 0.0
    """Standard deviation of each acceleration, m/s^2."""
    turn_rate_noise: NonNegative = 0.0
    """Standard deviation of each rate of turn, rad/s."""


class Sensors(Part):
    """Sensors of a drive and their noise."""

    encoder_counts: NonNegative = 0.0
    """Counts per motor turn (per metre on a prismatic axis with ratio 1); 0: not quantised."""
    position_noise: NonNegative = 0.0
    """Standard deviation of the measured motor angle, rad."""
    torque_noise: NonNegative = 0.0
    """Standard deviation of the measured torque, N m."""
    joint_position_noise: NonNegative = 0.0
    """Of an encoder behind the gear, rad at the joint."""
    joint_torque_noise: NonNegative = 0.0
    """Of a torque sensor behind the gear, N m at the joint."""
    inertial: InertialSensorEntry | None = None
    """An inertial measurement unit on the link that this axis moves; null: none."""


class ControllerEntry(Part):
    """Cascade in the drive: e = feedforward * v_ref + position_gain * (q_ref - q) - v; PI on e."""

    speed_gain: NonNegative
    """Torque per speed error, N m s/rad."""
    integral_gain: NonNegative = 0.0
    """Torque per integrated speed error, N m/rad."""
    position_gain: NonNegative = 0.0
    """Speed asked per position error, 1/s; 0: speed control only, as in the thesis' experiments."""
    speed_feedforward: Annotated[float, Field(ge=0, le=1)] = 1.0
    """Share of the reference speed that is fed forward."""


class VoltageServo(Part):
    """A servo that sets a voltage by its position error and no torque: duty = gain * (q_ref - q) within -1 and 1.

    Its direct-current motor gives ``k / R (duty V - k v)`` with the axis' torque constant k: what it induces at speed v
    brakes it. Switched off (channel `drive_enabled`) its winding is open, and the motor coasts.
    """

    duty_gain: Positive
    """Duty cycle per position error, 1/rad."""
    supply_voltage: Positive
    """V at a duty cycle of one."""
    resistance: Positive
    """Of the winding and its leads, ohm."""

    @model_validator(mode="after")
    def _within_numbers(self) -> VoltageServo:
        if self.duty_gain * self.supply_voltage > LARGEST or self.supply_voltage / self.resistance > LARGEST:
            raise refusal(
                f"duty_gain {self.duty_gain:g} 1/rad at {self.supply_voltage:g} V and {self.resistance:g} ohm is "
                "beyond all servos; give duty cycle per rad, volts and ohms"
            )
        return self


class Axis(Part):
    """One drive: motor, gear, sensors, and the controller of a torque drive or a servo that sets a voltage."""

    joint: str | None = None
    """The joint it moves; by default the joint of the same name."""
    gear_ratio: Annotated[float, AfterValidator(_a_ratio)] = 1.0
    """Motor turns per joint turn, rad per metre of a prismatic joint; negative where the gear reverses."""
    rotor_inertia: Positive
    """Inertia of rotor, brake and gear input, kg m^2."""
    torque_constant: Positive = 1.0
    """N m/A."""
    torque_limit: Positive | None = None
    """Largest torque, N m; null: not known, and asked for by whatever moves or simulates the robot."""
    speed_limit: Positive | None = None
    """Largest speed, rad/s; null: not known, and asked for by whatever moves the robot."""
    acceleration_limit: Positive = 1.0e6
    """Largest commanded acceleration, rad/s^2."""
    position_limits: Annotated[tuple[Number, Number], AfterValidator(_in_order)] | None = None
    """Joint-side limits [lower, upper], rad; null: none. Left out: those of the model file."""
    gear: Spring | None = None
    """Elasticity in the direction of transmission; null: rigid. A file may give a data_sheet instead."""
    friction: Friction = Friction()
    """Friction at the motor."""
    sensors: Sensors = Sensors()
    """Encoder and torque measurement."""
    controller: ControllerEntry | None = None
    """Gains of the drive's cascade; null: not known, and asked for by whatever simulates it, or a servo."""
    servo: VoltageServo | None = None
    """A position servo that sets a voltage, in place of a controller."""

    @property
    def stall_gain(self) -> float:
        """Torque of the stalled motor per volt, k / R, N m/V; zero for a torque drive."""
        return self.torque_constant / self.servo.resistance if self.servo is not None else 0.0
