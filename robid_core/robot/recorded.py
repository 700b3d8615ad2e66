"""A record made again: what a robot would have given under the recorded references, in its own closed loop.

The controllers are the robot file's, the references those of the record, the start what the record begins with: rest,
or a motion. Of a motion that is under way, motors and controllers are known from the first samples; everything behind
the motors moves along, springs bent by gravity alone, and rings out: in a periodic record, while its first period is
run before. With a horizon the simulation starts anew from the measured state every so often (`restarts`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from robid_core.arrays import FloatArray
from robid_core.artifacts import Channel, DenseRun, Record, frozen
from robid_core.errors import ConfigurationError, DataRejected
from robid_core.estimation.local_motion import local_motion
from robid_core.robot.plant import check_once, continue_simulation, controller_of, standing
from robid_core.robot.restarts import cut_into_windows, join_windows, window_starts

if TYPE_CHECKING:
    from robid_core.mechanics import SimulationState
    from robid_core.robot.robot import Robot

Start = Literal["rest", "motion"]

DRIVE_ENABLED = "drive_enabled"  # channel: 1 where a drive is on, 0 where its motor coasts
SAMPLES = 50  # of the beginning, that tell what the integrators hold
SETTLING_S = 1.0  # run before a periodic record, in whole periods: arms ring for some tenths of a second


@dataclass(frozen=True, eq=False)
class RecordedLanes:
    """Experiments of one run as lanes of the simulator, periods joined, motor side, each (n_lane, n_sample, n_axis)."""

    position: FloatArray
    torque: FloatArray | None
    """None where it was not recorded."""
    speed_reference: FloatArray
    position_reference: FloatArray | None
    enabled: FloatArray | None = None
    """1 where a drive is on, 0 where it is off; None: all are on."""

    def through(self, function: Callable[[FloatArray], FloatArray]) -> RecordedLanes:
        """Return what a function makes of every channel that there is."""
        torque, aim, enabled = self.torque, self.position_reference, self.enabled
        return RecordedLanes(
            function(self.position),
            None if torque is None else function(torque),
            function(self.speed_reference),
            None if aim is None else function(aim),
            None if enabled is None else function(enabled),
        )


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
    torque = joined("motor_torque") if "motor_torque" in run.channels else None
    enabled = joined(DRIVE_ENABLED) if DRIVE_ENABLED in run.channels else None
    if enabled is not None and not np.isin(enabled, (0.0, 1.0)).all():
        raise DataRejected(
            f"{DRIVE_ENABLED} tells where drives are on and must be 0 or 1; it has values from {enabled.min():g} to "
            f"{enabled.max():g}"
        )
    return RecordedLanes(joined("motor_position"), torque, speed_reference, position_reference, enabled)


def simulate_record(
    robot: Robot,
    record: Record,
    start: Start = "rest",
    *,
    horizon_s: float | None = None,
    half_window: int = 5,
    seed: int | None = None,
) -> Record:
    """Return the record that a robot gives under the recorded references.

    Parameters
    ----------
    robot
        With the controllers that the record was made with.
    record
        Motor position and a reference, of speed or position, of every axis; motor torque, too, where an experiment
        is under way and a controller integrates.
    start
        "rest": each experiment stands still at its first recorded angle. "motion": it is under way.
    horizon_s
        Every so often the simulation is started again from the measured state; by default it never is.
    half_window
        Samples on either side from which that state is told (`estimation.local_motion`).
    seed
        Draws the sensors' noise; None: none.

    Returns
    -------
    The same runs; motor position, motor torque and motor speed (the derivative of the simulated position) are
    simulated as far as they were recorded, references stay.

    Raises
    ------
    ConfigurationError
        If record and drives are not sampled alike.
    DataRejected
        If there is no reference, or a sample is missing.
    SimulationDiverged
        Where an experiment leaves all bounds.

    Examples
    --------
    >>> import numpy as np, robid_core as robid
    >>> robot = robid.Robot.load("one_axis")
    >>> reference = 0.3 * robot.motor_angle([[1.0]]) * np.cos(0.02 * np.arange(300))[:, None]
    >>> record = robid.Record.from_arrays(
    ...     motor_position=reference, motor_torque=0 * reference, position_reference=reference,
    ...     sample_time_s=robot.sample_time_s, robot=robot)
    >>> robid.simulate_record(robot, record).source
    'arrays, simulated with one_axis'
    """
    runs = []
    for run in record.runs:
        _check_sampling(robot, run)
        if horizon_s is None:
            position, torque = _at_once(robot, run, record.line is not None, start, seed)
        else:
            position, torque = _in_windows(
                robot, run, round(horizon_s / run.sample_time_s), half_window, seed
            )
        runs.append(_with_channels(run, position, torque))
    return record.replace(source=f"{record.source}, simulated with {robot.name}", runs=tuple(runs))


def _check_sampling(robot: Robot, run: DenseRun) -> None:
    if abs(run.sample_time_s / robot.sample_time_s - 1) > 1e-3:
        raise ConfigurationError(
            f"the record is sampled every {run.sample_time_s:g} s and the drives control every "
            f"{robot.sample_time_s:g} s; set sample_time_s in the robot file"
        )


def _at_once(
    robot: Robot, run: DenseRun, periodic: bool, start: Start, seed: int | None
) -> tuple[FloatArray, FloatArray]:
    """Position and torque of experiments that are simulated from their beginning, (n_lane, n_sample, n_axis)."""
    lanes, n_before = recorded_lanes(run), 0
    if start == "rest":
        state = standing(robot, lanes.position[:, 0])
    else:
        state = state_in_motion(robot, lanes)
        if periodic:
            lanes, n_before = _with_settling(lanes, len(run.time_s), run.sample_time_s)
    check_once(robot, robot.joint_angle(state.position[0, : robot.n_axis]))
    done = continue_simulation(
        robot, state, lanes.speed_reference, seed, lanes.position_reference, enabled=lanes.enabled
    )
    return done.position[:, n_before:], done.torque[:, n_before:]


def _in_windows(
    robot: Robot, run: DenseRun, n_horizon: int, half_window: int, seed: int | None
) -> tuple[FloatArray, FloatArray]:
    """Position and torque, started anew from the measured state every `n_horizon` samples; shapes as `_at_once`."""
    whole = recorded_lanes(run)
    n_sample = whole.position.shape[1]
    starts = window_starts(n_sample, n_horizon)
    lanes = cut_into_windows(whole, starts, n_horizon)
    motion = local_motion(whole.position, starts, half_window, run.sample_time_s)
    state = state_in_motion(robot, lanes, tuple(one.reshape(-1, robot.n_axis) for one in motion))
    check_once(robot, robot.joint_angle(state.position[0, : robot.n_axis]))
    done = continue_simulation(
        robot, state, lanes.speed_reference, seed, lanes.position_reference, enabled=lanes.enabled
    )
    return join_windows(done.position, starts, n_sample), join_windows(done.torque, starts, n_sample)


def _with_channels(run: DenseRun, position: FloatArray, torque: FloatArray) -> DenseRun:
    """Return a run with simulated channels in place of those that were recorded, (n_lane, n_sample, n_axis)."""
    simulated = {"motor_position": position, "motor_torque": torque}
    if "motor_speed" in run.channels:
        simulated["motor_speed"] = np.gradient(position, run.sample_time_s, axis=1)
    kept = [name for name in run.channels if name.endswith("_reference") or name == DRIVE_ENABLED]
    channels = {name: run.channels[name] for name in kept}
    for name, values in simulated.items():
        if name in run.channels:
            before = run.channel(name)
            channels[name] = Channel("motor", before.unit_symbol, frozen(values.reshape(before.values.shape)))
    return run.replace(channels=channels)


def _with_settling(lanes: RecordedLanes, n_sample: int, sample_time_s: float) -> tuple[RecordedLanes, int]:
    """Put repetitions of the first period in front, enough to ring out; return how many samples."""
    repeats = int(np.ceil(SETTLING_S / (n_sample * sample_time_s)))

    def longer(values: FloatArray) -> FloatArray:
        return np.concatenate((*[values[:, :n_sample]] * repeats, values), axis=1)

    return lanes.through(longer), repeats * n_sample


def state_in_motion(
    robot: Robot, lanes: RecordedLanes, motion: tuple[FloatArray, ...] | None = None
) -> SimulationState:
    """State at the first of recorded samples; DataRejected where there are less than three.

    `motion` holds angle, speed and acceleration there, (n_lane, n_axis) each; by default those of a parabola through
    the first three angles. It also tells the angle measured before. The integrators hold
    what the recorded torques are more than the control law gives without, median over the first SAMPLES: noise and
    limits of single samples do not count. Without a position reference the position loops begin without error; without
    a recorded torque drives that do not integrate give what their control law says, and others are refused.
    """
    if lanes.position.shape[1] < 3:
        raise DataRejected("an experiment has less than three samples: too few to determine a motion")
    time, control = robot.sample_time_s, controller_of(robot)
    if motion is None:
        motion = tuple(one[:, 0] for one in local_motion(lanes.position, [0], 2, time))
    first, rate, change = motion
    before = first - time * rate + time**2 / 2 * change
    state = standing(robot, first).moving(robot.mechanism, rate)
    if lanes.torque is None or (robot.drives.back_emf > 0).all():
        if (control.integral_gain > 0).any():
            raise DataRejected(
                "motor_torque was not recorded, and alone tells what the integrators of the drives held at the start; "
                "record it, or start where the robot stands still (start: rest)"
            )
        return replace(state, measured=before, holding_torque=np.zeros_like(state.holding_torque))
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
