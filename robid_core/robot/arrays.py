"""From a description to arrays: chain, mechanism and drives."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from robid_core.arrays import FloatArray
from robid_core.errors import ConfigurationError
from robid_core.robot.file.description import Axis, ControllerEntry, RobotDescription
from robid_core.robot.file.flexible_links import mode_names, with_flexible_links

if TYPE_CHECKING:
    from robid_core.mechanics import Chain, Mechanism


@dataclass(frozen=True)
class DriveArrays:
    """Drives as arrays over the axes, (n_axis,) each, motor side; `gear` (n_axis, n_axis) is r_g.

    A servo that sets a voltage, ``k / R (duty V - k v)``, is the cascade of ``speed_gain = k^2 / R`` and
    ``position_gain = V duty_gain / k`` whose speed acts at every instant and not through samples: `back_emf` is
    k^2 / R, zero for a torque drive; `torque_limit` is then the smaller of the file's and k V / R.
    """

    gear: FloatArray
    rotor_inertia: FloatArray
    torque_constant: FloatArray
    torque_limit: FloatArray
    speed_limit: FloatArray
    acceleration_limit: FloatArray
    lower: FloatArray
    upper: FloatArray
    coulomb: FloatArray
    viscous: FloatArray
    friction_offset: FloatArray
    friction_speed: FloatArray
    speed_gain: FloatArray
    integral_gain: FloatArray
    position_gain: FloatArray
    speed_feedforward: FloatArray
    back_emf: FloatArray
    encoder_counts: FloatArray
    position_noise: FloatArray
    torque_noise: FloatArray


def drive_arrays(description: RobotDescription) -> DriveArrays:
    """Collect the drives' numbers."""
    axes = list(description.axes.values())
    unlimited = (-np.inf, np.inf)
    gains = [_gains(axis) for axis in axes]
    limits = np.array([axis.position_limits or unlimited for axis in axes], dtype=float)
    return DriveArrays(
        gear=gear_matrix(description),
        rotor_inertia=np.array([axis.rotor_inertia for axis in axes]),
        torque_constant=np.array([axis.torque_constant for axis in axes]),
        torque_limit=np.array([_torque_limit(axis) for axis in axes]),
        speed_limit=np.array([axis.speed_limit for axis in axes]),
        acceleration_limit=np.array([axis.acceleration_limit for axis in axes]),
        lower=limits[:, 0],
        upper=limits[:, 1],
        coulomb=np.array([axis.friction.coulomb for axis in axes]),
        viscous=np.array([axis.friction.viscous for axis in axes]),
        friction_offset=np.array([axis.friction.offset for axis in axes]),
        friction_speed=np.array([axis.friction.speed for axis in axes]),
        speed_gain=np.array([one.speed_gain for one in gains]),
        integral_gain=np.array([one.integral_gain for one in gains]),
        position_gain=np.array([one.position_gain for one in gains]),
        speed_feedforward=np.array([one.speed_feedforward for one in gains]),
        back_emf=np.array([axis.stall_gain * axis.torque_constant for axis in axes]),
        encoder_counts=np.array([axis.sensors.encoder_counts for axis in axes]),
        position_noise=np.array([axis.sensors.position_noise for axis in axes]),
        torque_noise=np.array([axis.sensors.torque_noise for axis in axes]),
    )


def _gains(axis: Axis) -> ControllerEntry:
    """Gains of a drive; those of a servo are of the cascade that it is while its voltage is not at the limit."""
    servo = axis.servo
    if servo is None:
        assert axis.controller is not None  # `contradictions` has refused it
        return axis.controller
    return ControllerEntry(
        speed_gain=axis.stall_gain * axis.torque_constant,
        position_gain=servo.supply_voltage * servo.duty_gain / axis.torque_constant,
        speed_feedforward=0.0,
    )


def _torque_limit(axis: Axis) -> float:
    """Largest torque that the drive asks for: a servo's at its full voltage."""
    if axis.servo is None:
        return axis.torque_limit
    return min(axis.torque_limit, axis.stall_gain * axis.servo.supply_voltage)


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
