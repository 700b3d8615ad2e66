"""A record made again: what a robot would have given under the recorded references, in its own closed loop.

The controllers are the robot file's, the references those of the record, the start what the record begins with: rest,
or a motion. Of a motion that is under way, motors and controllers are known from the first samples; everything behind
the motors moves along, springs bent by gravity alone, and rings out: in a periodic record, while its first period is
run before. With a horizon the simulation starts anew from the measured state every so often (`restarts`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np

from robid_core.arrays import FloatArray
from robid_core.artifacts import Channel, DenseRun, Record, frozen
from robid_core.errors import ConfigurationError, DataRejected
from robid_core.estimation.local_motion import local_motion
from robid_core.mechanics import SimulationDiverged
from robid_core.robot.plant import check_once, continue_simulation, controller_of, standing
from robid_core.robot.recorded_lanes import DRIVE_ENABLED, RecordedLanes, recorded_lanes, side_by_side
from robid_core.robot.restarts import cut_into_windows, join_windows, window_starts
from robid_core.robot.sampling import check_sampling
from robid_core.yaml_file.problems import suggestion

if TYPE_CHECKING:
    from robid_core.mechanics import SimulationState
    from robid_core.robot.robot import Robot

Start = Literal["rest", "motion"]
Outputs = tuple[FloatArray, FloatArray]  # positions and torques, (n_lane, n_sample, n_axis) each

LONGER = 1.1  # than the shortest of the runs beside it: so much of its simulation is thrown away
SAMPLES = 50  # of the beginning, that tell what the integrators hold
SETTLING_S = 1.0  # run before a periodic record, in whole periods: arms ring for some tenths of a second


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
        Samples on either side from which that state is estimated (`estimation.local_motion`).
    seed
        Draws the sensors' noise; None: none.

    Returns
    -------
    The same runs; motor position, motor torque and motor speed (the derivative of the simulated position) are
    simulated as far as they were recorded, references stay.

    Raises
    ------
    ConfigurationError
        If record and drives are not sampled alike, or there is no such `start`.
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
    (found,) = simulate_records(
        robot, [record], start, horizon_s=horizon_s, half_window=half_window, seed=seed
    )
    return found


def simulate_records(
    robot: Robot,
    records: Sequence[Record],
    start: Start = "rest",
    *,
    horizon_s: float | None = None,
    half_window: int = 5,
    seed: int | None = None,
) -> list[Record]:
    """Return what `simulate_record` gives for each of several records, whose experiments run side by side.

    Eight experiments fill a register, of whichever record, and many cost hardly more than one; each comes out as it
    would alone, bit by bit.

    Examples
    --------
    >>> import numpy as np, robid_core as robid
    >>> robot = robid.Robot.load("one_axis")
    >>> records = [
    ...     robid.Record.from_arrays(
    ...         speed_reference=np.zeros((300, 1)), motor_position=robot.motor_angle([[angle]]) + np.zeros((300, 1)),
    ...         sample_time_s=robot.sample_time_s, robot=robot)
    ...     for angle in (0.2, 0.4)
    ... ]
    >>> [one.source for one in robid.simulate_records(robot, records)]
    ['arrays, simulated with one_axis', 'arrays, simulated with one_axis']
    """
    if start not in get_args(Start):
        raise ConfigurationError(f"start '{start}': {suggestion(str(start), get_args(Start), 'give one of')}")
    runs = [(run, record.line is not None) for record in records for run in record.runs]
    courses = [_course(robot, *run, start, horizon_s, half_window) for run in runs]
    outputs: dict[int, Outputs] = {}
    for group in _groups(courses, alone=seed is not None):
        found = _simulate(robot, [courses[number] for number in group], start, seed)
        outputs.update(zip(group, found, strict=True))
    simulated = (outputs[number] for number in range(len(courses)))
    return [
        record.replace(
            source=f"{record.source}, simulated with {robot.name}",
            runs=tuple(_with_channels(run, *next(simulated)) for run in record.runs),
        )
        for record in records
    ]


@dataclass(frozen=True, eq=False)
class _Course:
    """A run made ready for the simulator."""

    lanes: RecordedLanes
    period: tuple[int, float]
    """Samples, and time between them, of a period that is run before until all has rung out; 0 samples: none is."""
    n_sample: int
    """Of the run."""
    windows: list[int] | None = None
    """Where the simulation starts anew; None: nowhere."""
    motion: tuple[FloatArray, ...] | None = None
    """At the first sample of each lane, as of `state_in_motion`."""

    def whole(self, values: FloatArray) -> FloatArray:
        """Return what was simulated of the lanes as experiments of the run."""
        return values if self.windows is None else join_windows(values, self.windows, self.n_sample)


def _groups(courses: Sequence[_Course], alone: bool) -> list[list[int]]:
    """Numbers of the runs that are simulated side by side: of the same channels, hardly longer than the shortest."""
    if alone:  # noise is drawn for each run as if there were no other
        return [[number] for number in range(len(courses))]
    lengths = [course.lanes.position.shape[1] for course in courses]
    kinds = [(course.lanes.kind, course.period, course.motion is None) for course in courses]
    found: dict[Any, list[list[int]]] = {}
    for number in sorted(range(len(courses)), key=lengths.__getitem__):
        groups = found.setdefault(kinds[number], [])
        longest = lengths[groups[-1][0]] * (1.0 if courses[number].period[0] else LONGER) if groups else 0
        if lengths[number] > longest:
            groups.append([])
        groups[-1].append(number)
    return [group for groups in found.values() for group in groups]


def _course(
    robot: Robot, run: DenseRun, periodic: bool, start: Start, horizon_s: float | None, half_window: int
) -> _Course:
    check_sampling(run.sample_time_s, robot)
    lanes = recorded_lanes(run)
    n_sample = lanes.position.shape[1]
    if horizon_s is None:
        settling = len(run.time_s) if periodic and start == "motion" else 0
        return _Course(lanes, (settling, run.sample_time_s), n_sample)
    n_horizon = round(horizon_s / run.sample_time_s)
    starts = window_starts(n_sample, n_horizon)
    motion = local_motion(lanes.position, starts, half_window, run.sample_time_s)
    at_starts = tuple(one.reshape(-1, robot.n_axis) for one in motion)
    cut = cut_into_windows(lanes, starts, n_horizon)
    return _Course(cut, (0, run.sample_time_s), n_sample, starts, at_starts)


def _simulate(robot: Robot, courses: Sequence[_Course], start: Start, seed: int | None) -> list[Outputs]:
    """Position and torque of runs that are simulated side by side, (n_lane, n_sample, n_axis) each."""
    lanes, n_before = side_by_side([course.lanes for course in courses]), 0
    motions = [course.motion for course in courses if course.motion is not None]
    if motions:
        state = state_in_motion(robot, lanes, tuple(map(np.concatenate, zip(*motions, strict=True))))
    elif start == "rest":
        state = standing(robot, lanes.position[:, 0])
    else:
        state = state_in_motion(robot, lanes)
    if courses[0].period[0]:
        lanes, n_before = _with_settling(lanes, *courses[0].period)
    check_once(robot, robot.joint_angle(state.position[0, : robot.n_axis]))
    own, first = [], 0
    for course in courses:
        n_lane, n_sample = course.lanes.position.shape[:2]
        own.append((slice(first, first + n_lane), slice(n_before, n_before + n_sample)))
        first += n_lane
    try:
        done = continue_simulation(
            robot, state, lanes.speed_reference, seed, lanes.position_reference, enabled=lanes.enabled
        )
    except SimulationDiverged as error:
        done = error.partial
        if not all(np.isfinite(done.position[part]).all() for part in own):
            raise  # else it was behind the end of a shorter run
    return [
        (course.whole(done.position[part]), course.whole(done.torque[part]))
        for course, part in zip(courses, own, strict=True)
    ]


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
                "motor_torque was not recorded, and is needed for the initial state of the drives' integrators; "
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
