"""Motor torque of a rigid robot as a linear function of its inertial and friction parameters.

    tau = r_g^T Y(q, v, a) pi + J a_m + F_v v_m + F_c sign(v_m) + offset        (joint angle = r_g q_m)

with Y the regressor of the bodies, pi their inertial parameters, J the rotor inertias, all at the motor shaft.
Names are those of the robot's parameters, so that estimates can be put back into it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

from robid_core import DataRejected, DenseRun, FloatArray, Robot
from robid_core.estimation.rigid.regression import differentiate, smooth
from robid_core.estimation.rigid.rigid_body import PARAMETERS, UNITS
from robid_core.estimation.rigid.rigid_torque import RigidDrives, motor_torque_regressor
from robid_fit.rigid_ripple import ripples

Kind = Literal["inertia", "rotor_inertia", "viscous", "coulomb", "offset", "effects"]
KINDS: tuple[Kind, ...] = ("inertia", "rotor_inertia", "viscous", "coulomb", "offset")


@dataclass(frozen=True)
class RigidMotion:
    """Motion of the motors in one experiment, each (n_sample, n_axis), rad (m) and seconds."""

    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray


@dataclass(frozen=True)
class Columns:
    """Columns of the regressor, with the names, units, groups, kinds and values of their parameters in the robot."""

    names: tuple[str, ...]
    units: tuple[str, ...]
    groups: tuple[str, ...]
    kinds: tuple[str, ...]
    value: FloatArray
    regressor: FloatArray  # (n_sample, n_axis, n_parameter), N m (N) at the motor per unit


def experiments(
    run: DenseRun, robot: Robot, discard: int, channel: str = "motor_position", stage: str = "fit.rigid"
) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Yield motor position, from a channel, and motor torque of every experiment, periods joined, (n_sample, n_axis).

    Raises
    ------
    DataRejected
        If torque or position was not recorded, of every axis and at every sample.
    """
    torque = run.values("motor_torque")
    if channel == "motor_position" and channel not in run.channels and "joint_position" in run.channels:
        position = robot.motor_angle(run.values("joint_position"))
    else:
        position = run.values(channel)
    for name, values in (("position", position), ("motor_torque", torque)):
        if not (np.isfinite(values).all() and run.valid[:, :, :, discard:].all()):
            raise DataRejected(
                f"{stage}: {name} has holes; cut the record, read it with gaps: split, or leave the axis out of the "
                "robot"
            )
    if discard >= run.n_period:
        raise DataRejected(
            f"{run.n_period} periods were measured and {discard} are to be dropped: none is left"
        )
    n_axis = torque.shape[-1]
    for index in np.ndindex(*torque.shape[:3]):
        yield position[index][discard:].reshape(-1, n_axis), torque[index][discard:].reshape(-1, n_axis)


def motion_of(position: FloatArray, sample_time: float, cutoff_hz: float, order: int) -> RigidMotion:
    """Smooth the position and differentiate it twice by central differences."""
    smoothed = smooth(position, sample_time, cutoff_hz, order)
    velocity = differentiate(smoothed, sample_time)
    return RigidMotion(smoothed, velocity, differentiate(velocity, sample_time))


def random_motion(robot: Robot, n_sample: int) -> RigidMotion:
    """States that excite everything, the same at every call: what the structure hides is no matter of the data."""
    draws = np.random.Generator(np.random.PCG64(0)).uniform(-np.pi, np.pi, (3, n_sample, robot.n_axis))
    return RigidMotion(*robot.motor_angle(draws))


def torque_columns(
    robot: Robot, motion: RigidMotion, friction_speed: FloatArray, sample_time: float = 0.0
) -> Columns:
    """Every column of the motor torque: ten for each body, rotor inertia, friction and offset of each motor, ripple.

    Parameters
    ----------
    robot
        Geometry, gears and present parameter values; without elastic coordinates.
    motion
        Motion of the motors.
    friction_speed
        v_s of tanh(v / v_s) for Coulomb friction, shape (n_axis,); 0 for plain sign(v).
    sample_time
        Over which a wave of the angle is averaged, s.
    """
    chain, d = robot.chain, robot.drives
    drives = RigidDrives(
        tree=chain,
        arm=robot.mechanism.arm,
        gear=d.gear,
        rotor_inertia=d.rotor_inertia,
        viscous=d.viscous,
        coulomb=d.coulomb,
        offset=d.friction_offset,
        friction_speed=friction_speed,
    )
    # In the order of the regressor's columns.
    per_motor = {
        "rotor_inertia": "rotor_inertia.{}",
        "viscous": "friction.{}.viscous",
        "coulomb": "friction.{}.coulomb",
        "offset": "friction.{}.offset",
    }
    motors = [pattern.format(axis) for pattern in per_motor.values() for axis in robot.axis_names]
    n_body, waves = 10 * chain.n_coordinate, ripples(robot)
    others = (*motors, *(name for wave in waves for name in wave.columns))
    regressor = motor_torque_regressor(drives, motion.position, motion.velocity, motion.acceleration)
    return Columns(
        names=(*(_name(part, body) for body in chain.names for part in PARAMETERS), *others),
        units=(
            *(UNITS * chain.n_coordinate),
            *(robot.parameter_unit(name) for name in motors),
            *(robot.parameter_unit(f"effect.{wave.label}.amplitude") for wave in waves for _ in wave.columns),
        ),
        groups=(
            *("inertia",) * n_body,
            *(robot.parameter_kind(name) for name in motors),
            *("effect",) * (2 * len(waves)),
        ),
        kinds=(
            *("inertia",) * n_body,
            *(kind for kind in per_motor for _ in robot.axis_names),
            *("effects",) * (2 * len(waves)),
        ),
        value=np.concatenate((drives.parameters, *(wave.parts for wave in waves))),
        regressor=np.concatenate(
            (regressor, *(wave.torque(motion.position, motion.velocity, sample_time) for wave in waves)),
            axis=2,
        ),
    )


def _name(part: str, body: str) -> str:
    """Name `joint_inertia.xx` of a body `joint_inertia.axis_2.xx`: about the joint, not the centre of mass."""
    noun, _, component = part.partition(".")
    return f"{noun}.{body}.{component}" if component else f"{noun}.{body}"
