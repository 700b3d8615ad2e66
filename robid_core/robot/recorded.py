"""A record made again: what a robot would have given under the recorded references, in its own closed loop.

The controllers are the robot file's, the references those of the record, the start what the record begins with: rest,
or a motion. Of a motion that is under way, motors and controllers are known from the first samples; everything behind
the motors moves along, springs bent by gravity alone, and rings out: in a periodic record, while its first period is
run before.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from robid_core.arrays import FloatArray
from robid_core.artifacts import Channel, DenseRun, Record, frozen
from robid_core.errors import ConfigurationError, DataRejected
from robid_core.robot.plant import check_once, continue_simulation, controller_of, standing

if TYPE_CHECKING:
    from robid_core.mechanics import SimulationState
    from robid_core.robot.robot import Robot

Start = Literal["rest", "motion"]

SAMPLES = 50  # of the beginning, that tell what the integrators hold
SETTLING_S = 1.0  # run before a periodic record, in whole periods: arms ring for some tenths of a second


@dataclass(frozen=True, eq=False)
class RecordedLanes:
    """Experiments of one run as lanes of the simulator, periods joined, motor side, each (n_lane, n_sample, n_axis)."""

    position: FloatArray
    torque: FloatArray
    speed_reference: FloatArray
    position_reference: FloatArray | None


def recorded_lanes(run: DenseRun) -> RecordedLanes:
    """Return every experiment of a run as a lane.

    Where only a position reference was recorded, the speed reference is its derivative.

    Raises
    ------
    DataRejected
        If there is no reference, or a sample is missing.
    """
    if not run.valid.all():
        raise DataRejected("samples are missing in the record; a simulation needs the whole reference")

    def joined(name: str) -> FloatArray:
        values = run.lanes(name)
        if not np.isfinite(values).all():
            raise DataRejected(f"{name} was not recorded on every axis; a simulation needs all")
        return values

    position_reference = joined("position_reference") if "position_reference" in run.channels else None
    if "speed_reference" in run.channels:
        speed_reference = joined("speed_reference")
    elif position_reference is not None:
        speed_reference = np.gradient(position_reference, run.sample_time_s, axis=1)
    else:
        raise DataRejected(
            "the record has neither position_reference nor speed_reference; map the channel that the controller "
            "followed"
        )
    return RecordedLanes(
        joined("motor_position"), joined("motor_torque"), speed_reference, position_reference
    )


def simulate_record(robot: Robot, record: Record, start: Start = "rest") -> Record:
    """Return the record that a robot gives under the recorded references, without sensor noise.

    Parameters
    ----------
    robot
        With the controllers that the record was made with.
    record
        Motor position, motor torque and a reference, of speed or position, of every axis.
    start
        "rest": each experiment stands still at its first recorded angle. "motion": it is under way.

    Returns
    -------
    The same runs; motor position and motor torque are simulated, references stay.

    Raises
    ------
    ConfigurationError
        If record and drives are not sampled alike.
    DataRejected
        If there is no reference, or a sample is missing.
    SimulationDiverged
        Where an experiment leaves all bounds.
    """
    runs = tuple(_simulated(robot, run, record.line is not None, start) for run in record.runs)
    return record.replace(source=f"{record.source}, simulated with {robot.name}", runs=runs)


def _simulated(robot: Robot, run: DenseRun, periodic: bool, start: Start) -> DenseRun:
    if abs(run.sample_time_s / robot.sample_time_s - 1) > 1e-3:
        raise ConfigurationError(
            f"the record is sampled every {run.sample_time_s:g} s and the drives control every "
            f"{robot.sample_time_s:g} s; set sample_time_s in the robot file"
        )
    lanes, n_before = recorded_lanes(run), 0
    if start == "rest":
        state = standing(robot, lanes.position[:, 0])
    else:
        state = state_in_motion(robot, lanes)
        if periodic:
            lanes, n_before = _with_settling(lanes, len(run.time_s), run.sample_time_s)
    check_once(robot, robot.joint_angle(state.position[0, : robot.n_axis]))
    done = continue_simulation(robot, state, lanes.speed_reference, None, lanes.position_reference)
    channels = {name: run.channels[name] for name in run.channels if name.endswith("_reference")}
    for name, values in (("motor_position", done.position), ("motor_torque", done.torque)):
        before = run.channel(name)
        kept = values[:, n_before:].reshape(before.values.shape)
        channels[name] = Channel("motor", before.unit_symbol, frozen(kept))
    return run.replace(channels=channels)


def _with_settling(lanes: RecordedLanes, n_sample: int, sample_time_s: float) -> tuple[RecordedLanes, int]:
    """Put repetitions of the first period in front, enough to ring out; return how many samples."""
    repeats = int(np.ceil(SETTLING_S / (n_sample * sample_time_s)))

    def longer(values: FloatArray) -> FloatArray:
        return np.concatenate((*[values[:, :n_sample]] * repeats, values), axis=1)

    position_reference = lanes.position_reference
    return RecordedLanes(
        longer(lanes.position),
        longer(lanes.torque),
        longer(lanes.speed_reference),
        None if position_reference is None else longer(position_reference),
    ), repeats * n_sample


def state_in_motion(robot: Robot, lanes: RecordedLanes) -> SimulationState:
    """State at the first of recorded samples; DataRejected where there are less than three.

    Speed and the angle measured before are those of a parabola through the first three angles. The integrators hold
    what the recorded torques are more than the control law gives without, median over the first SAMPLES: noise and
    limits of single samples do not count. Without a position reference the position loops begin without error.
    """
    if lanes.position.shape[1] < 3:
        raise DataRejected("an experiment has less than three samples: they do not tell a motion")
    time, control = robot.sample_time_s, controller_of(robot)
    first, second, third = lanes.position[:, :3].swapaxes(0, 1)
    before = 3 * first - 3 * second + third
    state = standing(robot, first).moving(robot.mechanism, (4 * second - 3 * first - third) / (2 * time))
    angle, wanted, torque = (
        values[:, :SAMPLES] for values in (lanes.position, lanes.speed_reference, lanes.torque)
    )
    if lanes.position_reference is None:
        aim = first[:, None] + time * (np.cumsum(wanted, axis=1) - wanted)
    else:
        aim = lanes.position_reference[:, :SAMPLES]
    speed = np.diff(angle, axis=1, prepend=before[:, None]) / time
    error = control.speed_feedforward * wanted + control.position_gain * (aim - angle) - speed
    law = control.speed_gain * error + control.integral_gain * time * np.cumsum(error, axis=1)
    integral = np.median(torque - law, axis=1) - state.holding_torque
    return replace(state, measured=before, integral=integral)
