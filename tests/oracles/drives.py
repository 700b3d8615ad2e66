"""What stands around a plant, in plain numpy: sampled cascade, encoder, friction and ripple of the motors.

Written from the words of `robid_core.mechanics.Controller` and of the effects, for loops over other
simulators; the numbers come from the robot file.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from robid_core import Robot

FloatArray = npt.NDArray[np.float64]


def of_axes(robot: Robot, *path: str) -> FloatArray:
    """Collect a number under `axes` of the robot file, such as ("friction", "viscous"); shape (n_axis,)."""
    values = []
    for axis in robot.description.axes.values():
        node: Any = axis
        for key in path:
            node = getattr(node, key)
        values.append(float(node))
    return np.array(values)


def gear_of(robot: Robot) -> FloatArray:
    """Joint angle per motor angle as the robot file says it, (n_axis, n_axis)."""
    if robot.description.coupling is not None:
        return np.array(robot.description.coupling)
    return np.diag(1.0 / of_axes(robot, "gear_ratio"))


def check_plain(robot: Robot) -> None:
    """Raise ValueError for a robot with something these machines do not know: effects, flexible bodies."""
    effects = getattr(robot.description, "effects", {})
    bent = [body.joint for body in robot.description.bodies if _is_elastic(body)]
    if effects or bent:
        raise ValueError(
            f"{robot.name}: {', '.join([*effects, *bent])} has no counterpart here; leave it out"
        )


def _is_elastic(body: Any) -> bool:
    return any(getattr(body, key, None) is not None for key in ("elastic", "flexible"))


@dataclass(frozen=True)
class Ripple:
    """Sines of the motor angle, on torque (acts) and on measured position (the controller sees it).

    Every field has shape (n_axis,).
    """

    torque: FloatArray
    """Amplitude added to the motor torque, N m."""
    torque_order: FloatArray
    """Per turn of the motor."""
    position: FloatArray
    """Amplitude added to the measured angle, rad."""
    position_order: FloatArray
    """Per turn of the motor."""

    @classmethod
    def none(cls, n_axis: int) -> Ripple:
        """Return a motor without ripple."""
        return cls(*(np.zeros(n_axis) for _ in range(4)))

    @property
    def acts(self) -> bool:
        """Whether any amplitude is above zero."""
        return bool(self.torque.any())


class Motors:
    """Torque that friction and ripple put on the motors."""

    def __init__(self, robot: Robot, ripple: Ripple | None = None) -> None:
        self.coulomb, self.viscous, self.offset = (
            of_axes(robot, "friction", key) for key in ("coulomb", "viscous", "offset")
        )
        self.per_speed = 1.0 / of_axes(robot, "friction", "speed")
        self.ripple = ripple or Ripple.none(robot.n_axis)
        self.ripples = self.ripple.acts

    def torque(self, angle: FloatArray, speed: FloatArray) -> FloatArray:
        """Torque on the motors at motor angle and speed, N m, shape (n_axis,)."""
        drag = -self.coulomb * np.tanh(speed * self.per_speed) - self.viscous * speed - self.offset
        if self.ripples:
            drag += self.ripple.torque * np.sin(self.ripple.torque_order * angle)
        return np.asarray(drag)


class Cascade:
    """Sampled position and speed control with its encoder; one call a sample."""

    def __init__(
        self, robot: Robot, angle: FloatArray, holding_torque: FloatArray, ripple: Ripple | None = None
    ) -> None:
        self.sample_time = robot.sample_time_s
        self.speed_gain, self.position_gain, self.feedforward = (
            of_axes(robot, "controller", key) for key in ("speed_gain", "position_gain", "speed_feedforward")
        )
        self.integral_gain = of_axes(robot, "controller", "integral_gain") * robot.sample_time_s
        self.limit = of_axes(robot, "torque_limit")
        self.counts_per_rad = of_axes(robot, "sensors", "encoder_counts") / (2 * np.pi)
        self.rounds = bool((self.counts_per_rad > 0).any())
        self.ripple = ripple or Ripple.none(robot.n_axis)
        self.ripples = bool(self.ripple.position.any())
        self.wanted = np.array(angle, dtype=float)
        self.last = self.measure(self.wanted)
        self.integral = np.array(holding_torque, dtype=float)

    def measure(self, angle: FloatArray) -> FloatArray:
        """Measured motor angle of a true one, rad, shape (n_axis,)."""
        measured = angle.copy()
        if self.ripples:
            measured += self.ripple.position * np.sin(self.ripple.position_order * angle)
        if self.rounds:
            whole = self.counts_per_rad > 0
            measured[whole] = (
                np.rint(measured[whole] * self.counts_per_rad[whole]) / self.counts_per_rad[whole]
            )
        return measured

    def command(self, angle: FloatArray, wanted_speed: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return (torque, measured angle) of one sample; `angle` is the true one."""
        measured = self.measure(angle)
        speed = (measured - self.last) / self.sample_time
        self.last = measured
        error = self.feedforward * wanted_speed + self.position_gain * (self.wanted - measured) - speed
        self.wanted = self.wanted + self.sample_time * wanted_speed
        self.integral = self.integral + self.integral_gain * error
        torque = self.speed_gain * error + self.integral
        return np.minimum(np.maximum(torque, -self.limit), self.limit), measured
