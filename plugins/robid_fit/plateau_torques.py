"""What each motor's torque is over its plateaus beyond what the rigid robot needs there, and under which conditions.

Means over a plateau: of the measured torque, and of inverse dynamics without friction along the measured motion, other
axes included. The motion is smooth, so that some hundred of its samples tell the mean of the rigid torque, and fewer
by how much the weight changes as springs give way.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from robid_core import Channel, DenseRun, FloatArray, IntArray, Record, Robot
from robid_core.estimation.excitation.velocity_sweep import Plateau
from robid_core.estimation.rigid.rigid_torque import RigidDrives, motor_torque
from robid_core.residual import rigid_drives
from robid_fit.plateaus import Evenness, plateaus_in
from robid_fit.rigid_model import RigidMotion, experiments, motion_of

MOST_SAMPLES = 200  # of a plateau at which the rigid torque is computed
SAG_SAMPLES = 16  # likewise, at which the arm's rest is
TEMPERATURE = "temperature"
HELD = "zero_order_hold"  # then a torque meets the arm half a sample later than its angle was taken


@dataclass(frozen=True, eq=False)
class AxisPlateaus:
    """Means over the plateaus of one motor, each of shape (n_plateau,)."""

    speed: FloatArray
    """rad/s."""
    direction: FloatArray
    """``tanh(v / v_s)`` with the robot's own v_s: what the Coulomb level is multiplied by."""
    torque: FloatArray
    """Measured less rigid, N m at the motor: friction, and what the robot file says wrong."""
    load: FloatArray
    """Size of what the rigid robot asks of the gear, at the motor, N m."""
    cosine: FloatArray
    """Of the joint's own angle."""
    sine: FloatArray
    temperature: FloatArray
    """degC; NaN where it was not measured."""
    duration_s: FloatArray
    configuration: IntArray
    spread: FloatArray
    """Relative standard deviation that the scatter is taken to have; ones: alike in all plateaus."""

    @property
    def n_plateau(self) -> int:
        """Number of plateaus."""
        return len(self.speed)


@dataclass(frozen=True)
class Reading:
    """How a record is read for friction: settings of the stage."""

    evenness: Evenness
    cutoff_hz: float
    others_at_rest: bool
    discard: int
    stage: str


def without_friction(robot: Robot) -> RigidDrives:
    """The rigid robot whose motors have no friction."""
    nothing = np.zeros(robot.n_axis)
    return replace(rigid_drives(robot), viscous=nothing, coulomb=nothing, offset=nothing)


def temperatures(run: DenseRun, discard: int) -> Iterator[FloatArray]:
    """Temperature of every experiment in the order of `experiments`, (n_sample, n_axis); NaN where none was measured.

    A channel of that name, or a constant that holds for all axes.
    """
    channel: Channel | None = run.channels.get(TEMPERATURE)
    known = run.constant(TEMPERATURE) if TEMPERATURE in run.constant_names else None
    shape = run.values("motor_torque").shape
    for index in np.ndindex(*shape[:3]):
        if channel is not None:
            yield channel.values[index][discard:].reshape(-1, shape[-1])
        else:
            value = np.nan if known is None else float(known[index])
            yield np.full(((shape[3] - discard) * shape[4], shape[-1]), value)


def plateaus_of_record(
    record: Record, robot: Robot, slowest: FloatArray, reading: Reading
) -> tuple[AxisPlateaus, ...]:
    """Plateaus of every axis, all experiments together.

    Parameters
    ----------
    record
        With motor torque and an angle.
    robot
        Geometry, bodies, gears; its friction is not used.
    slowest
        Least speed of each motor, rad/s, shape (n_axis,).
    """
    drives, rows = without_friction(robot), list[list[dict[str, float]]]([[] for _ in robot.axis_names])
    for run in record.runs:
        places = np.ndindex(*run.valid.shape[:3])
        pairs = experiments(run, robot, reading.discard, stage=reading.stage)
        warmth = temperatures(run, reading.discard)
        for place, (position, torque), warm in zip(places, pairs, warmth, strict=True):
            motion = motion_of(position, run.sample_time_s, reading.cutoff_hz, order=2)
            if record.torque_hold == HELD:
                motion = replace(motion, position=motion.position + 0.5 * run.sample_time_s * motion.velocity)
            found = plateaus_in(motion.velocity, run.sample_time_s, slowest, reading.evenness)
            for one in found:
                if reading.others_at_rest and _others_move(motion, one, slowest):
                    continue
                means = _means(one, motion, torque, warm, drives, robot)
                means |= {"duration_s": (one.last - one.first) * run.sample_time_s, "configuration": place[0]}
                means["spread"] = 1.0
                rows[one.axis].append(means)
    return tuple(_table(own) for own in rows)


def _others_move(motion: RigidMotion, plateau: Plateau, slowest: FloatArray) -> bool:
    fastest = np.abs(motion.velocity[plateau.samples]).max(axis=0)
    return bool((np.delete(fastest, plateau.axis) >= np.delete(slowest, plateau.axis)).any())


def _means(
    plateau: Plateau,
    motion: RigidMotion,
    torque: FloatArray,
    temperature: FloatArray,
    drives: RigidDrives,
    robot: Robot,
) -> dict[str, float]:
    axis, n_sample = plateau.axis, plateau.last - plateau.first
    n_part = min(n_sample, MOST_SAMPLES)
    at = plateau.first + ((np.arange(n_part) + 0.5) * n_sample / n_part).astype(np.int64)
    position, velocity, acceleration = motion.position[at], motion.velocity[at], motion.acceleration[at]
    rigid = motor_torque(drives, position, velocity, acceleration)[:, axis]
    load = rigid - drives.rotor_inertia[axis] * acceleration[:, axis]
    own, scale = velocity[:, axis], float(robot.drives.friction_speed[axis])
    direction = np.tanh(own / scale) if scale > 0 else np.sign(own)
    joint = robot.joint_angle(position)
    few = np.unique(np.linspace(0, len(at) - 1, SAG_SAMPLES).round()).astype(np.int64)
    still = np.zeros((len(few), robot.n_axis))
    sag = robot.gravity_torque(joint[few]) - motor_torque(drives, position[few], still, still)
    angle = joint[:, axis]
    return {
        "speed": float(own.mean()),
        "direction": float(direction.mean()),
        "torque": float(torque[plateau.samples, axis].mean() - rigid.mean() - sag[:, axis].mean()),
        "load": float(np.abs(load).mean()),
        "cosine": float(np.cos(angle).mean()),
        "sine": float(np.sin(angle).mean()),
        "temperature": float(temperature[plateau.samples, axis].mean()),
    }


def _table(rows: Sequence[dict[str, float]]) -> AxisPlateaus:
    columns = {
        name: np.array([row[name] for row in rows], dtype=np.float64)
        for name in AxisPlateaus.__dataclass_fields__
        if name != "configuration"
    }
    return AxisPlateaus(
        configuration=np.array([row["configuration"] for row in rows], dtype=np.int64), **columns
    )
