"""From a description to arrays: chain, mechanism and drives."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from robid_core.arrays import FloatArray
from robid_core.errors import ConfigurationError
from robid_core.robot.file.description import Axis, ControllerEntry, RobotDescription
from robid_core.robot.file.flexible_links import mode_names, with_flexible_links
from robid_core.robot.file.left_out import AxisKey, left_out

if TYPE_CHECKING:
    from robid_core.mechanics import Chain, Mechanism


@dataclass(frozen=True)
class DriveArrays:
    """Drives as arrays over the axes, (n_axis,) each, motor side; `gear` (n_axis, n_axis) is r_g.

    A servo that sets a voltage, ``k / R (duty V - k v)``, is the cascade of ``speed_gain = k^2 / R`` and
    ``position_gain = V duty_gain / k`` whose speed acts at every instant and not through samples: `back_emf` is
    k^2 / R, zero for a torque drive; `torque_limit` is then the smaller of the file's and k V / R. Limits and gains
    that the robot file left out raise ConfigurationError where they are asked for.
    """

    description: RobotDescription
    """Of whose axes these are the numbers."""

    gear: FloatArray
    rotor_inertia: FloatArray
    torque_constant: FloatArray
    acceleration_limit: FloatArray
    lower: FloatArray
    upper: FloatArray
    coulomb: FloatArray
    viscous: FloatArray
    friction_offset: FloatArray
    friction_speed: FloatArray
    back_emf: FloatArray
    encoder_counts: FloatArray
    position_noise: FloatArray
    torque_noise: FloatArray
    joint_position_noise: FloatArray
    joint_torque_noise: FloatArray

    @property
    def torque_limit(self) -> FloatArray:
        """Largest torque, N m."""
        return self._told("torque_limit", _torque_limit)

    @property
    def speed_limit(self) -> FloatArray:
        """Largest speed, rad/s."""
        return self._told("speed_limit", lambda axis: axis.speed_limit)

    @property
    def speed_gain(self) -> FloatArray:
        """Torque per speed error, N m s/rad."""
        return self._told("controller", lambda axis: _gains(axis).speed_gain)

    @property
    def integral_gain(self) -> FloatArray:
        """Torque per integrated speed error, N m/rad."""
        return self._told("controller", lambda axis: _gains(axis).integral_gain)

    @property
    def position_gain(self) -> FloatArray:
        """Speed asked per position error, 1/s."""
        return self._told("controller", lambda axis: _gains(axis).position_gain)

    @property
    def speed_feedforward(self) -> FloatArray:
        """Share of the reference speed that is fed forward."""
        return self._told("controller", lambda axis: _gains(axis).speed_feedforward)

    def torque_limit_or(self, other: FloatArray) -> FloatArray:
        """Return the largest torque, of an axis whose file tells none that of another array, N m, shape (n_axis,)."""
        told = [_torque_limit(axis) for axis in self.description.axes.values()]
        return np.array([o if t is None else t for t, o in zip(told, other.tolist(), strict=True)])

    def _told(self, key: AxisKey, number: Callable[[Axis], float | None]) -> FloatArray:
        missing = left_out(self.description, (key,))
        if missing:
            raise ConfigurationError(missing)
        return np.array([number(axis) for axis in self.description.axes.values()], dtype=float)


def drive_arrays(description: RobotDescription) -> DriveArrays:
    """Collect the drives' numbers."""
    axes = list(description.axes.values())
    unlimited = (-np.inf, np.inf)
    limits = np.array([axis.position_limits or unlimited for axis in axes], dtype=float)
    return DriveArrays(
        description=description,
        gear=gear_matrix(description),
        rotor_inertia=np.array([axis.rotor_inertia for axis in axes]),
        torque_constant=np.array([axis.torque_constant for axis in axes]),
        acceleration_limit=np.array([axis.acceleration_limit for axis in axes]),
        lower=limits[:, 0],
        upper=limits[:, 1],
        coulomb=np.array([axis.friction.coulomb for axis in axes]),
        viscous=np.array([axis.friction.viscous for axis in axes]),
        friction_offset=np.array([axis.friction.offset for axis in axes]),
        friction_speed=np.array([axis.friction.speed for axis in axes]),
        back_emf=np.array([axis.stall_gain * axis.torque_constant for axis in axes]),
        encoder_counts=np.array([axis.sensors.encoder_counts for axis in axes]),
        position_noise=np.array([axis.sensors.position_noise for axis in axes]),
        torque_noise=np.array([axis.sensors.torque_noise for axis in axes]),
        joint_position_noise=np.array([axis.sensors.joint_position_noise for axis in axes]),
        joint_torque_noise=np.array([axis.sensors.joint_torque_noise for axis in axes]),
    )


def _gains(axis: Axis) -> ControllerEntry:
    """Gains of a drive; those of a servo are of the cascade that it is while its voltage is not at the limit."""
    servo = axis.servo
    if servo is None:
        assert axis.controller is not None  # `left_out` has refused it
        return axis.controller
    return ControllerEntry(
        speed_gain=axis.stall_gain * axis.torque_constant,
        position_gain=servo.supply_voltage * servo.duty_gain / axis.torque_constant,
        speed_feedforward=0.0,
    )


def _torque_limit(axis: Axis) -> float | None:
    """Largest torque that the drive asks for: a servo's at its full voltage; None: not told."""
    if axis.servo is None:
        return axis.torque_limit
    most = axis.stall_gain * axis.servo.supply_voltage
    return most if axis.torque_limit is None else min(axis.torque_limit, most)


def gear_matrix(description: RobotDescription) -> FloatArray:
    """Joint angle per motor angle, r_g, shape (n_axis, n_axis)."""
    if description.coupling is not None:
        return np.array(description.coupling)
    return np.diag([1.0 / axis.gear_ratio for axis in description.axes.values()])


def chain_of(description: RobotDescription) -> Chain:
    """Make the chain, with an elastic coordinate for each bearing and the modes of flexible links."""
    from robid_core.mechanics import Chain

    bodies = description.bodies
    joints = [body.joint for body in bodies]
    chain = Chain(
        parent=np.array(
            [joints.index(body.parent) if body.parent else -1 for body in bodies], dtype=np.int64
        ),
        joint_type=np.array([("revolute", "prismatic").index(body.type) for body in bodies], dtype=np.int64),
        axis=np.array([body.axis for body in bodies], dtype=float),
        rotation=np.array([body.rotation for body in bodies], dtype=float),
        translation=np.array([body.translation for body in bodies], dtype=float),
        mass=np.array([body.mass for body in bodies], dtype=float),
        centre_of_mass=np.array([body.centre_of_mass for body in bodies], dtype=float),
        inertia=np.array([body.inertia for body in bodies], dtype=float),
        names=tuple(joints),
        gravity=np.array(description.gravity, dtype=float),
    )
    last = {joint: joint for joint in joints}
    for name, bearing in description.bearings.items():
        chain = chain.with_elastic(last[bearing.joint], name, np.array(bearing.axis, dtype=float))
        last[bearing.joint] = name
    return with_flexible_links(chain, bodies, last)


def mechanism_of(description: RobotDescription, chain: Chain) -> Mechanism:
    """Add motors and gears to the chain."""
    from robid_core.mechanics import Mechanism

    gear = gear_matrix(description)
    springs = [
        *description.bearings,
        *(body.joint for body in description.bodies if body.elastic is not None),
        *mode_names(description.bodies),
    ]
    if np.linalg.matrix_rank(gear) < len(gear):
        raise ConfigurationError(
            f"{description.name}: coupling is singular: two motors move the joints alike"
        )
    return Mechanism(
        chain=chain,
        gear=gear,
        rotor_inertia=np.array([axis.rotor_inertia for axis in description.axes.values()]),
        arm=np.array([chain.index(axis.joint or n) for n, axis in description.axes.items()], dtype=np.int64),
        elastic=np.array([chain.index(name) for name in springs], dtype=np.int64),
        elastic_gear=np.array([axis.gear is not None for axis in description.axes.values()]),
    )
