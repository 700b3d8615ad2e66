"""Whether torques and angles of a record were taken at one instant, and the torque held as told: doubts, not refusals.

The robot's response at the experiment's pose makes accelerations of the recorded torques; their phase against the
recorded ones says by how many samples the torques lag (`estimation.response.torque_lag`). A hold that is told wrong
looks like half a sample. A lag may be the robot's own, which its file lacks: the record is then good for a diagnosis.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import scipy

from robid_core import ComplexArray, FloatArray, Record, RobidError, Robot
from robid_core.estimation.response.torque_lag import Lag, lag_beside_friction, torque_lag
from robid_core.estimation.rigid.spring_model import spring_response

CHANNELS = ("motor_position", "motor_torque")
HELD, CONTINUOUS = "zero_order_hold", "continuous"
MOST = 12  # experiments that are looked at
BINS = 80  # of each
EXCITED = 1e-3  # of the largest power of a torque
OWN = 0.5  # of a motor's acceleration that its own torque makes
HIGHEST = 0.4  # of the sampling rate
UPPER = 0.5  # of the highest excited frequency: the band begins there
SCATTER = 0.3  # rad: above, the model does not tell
ERROR = 0.15  # samples, likewise
MODEL = 0.1  # samples that the model may be wrong by at an axis
SURE = 0.12  # samples, error of the mean, with which a hold is doubted
ALONE = 0.1  # samples, likewise of a single axis with friction free: its hold is then told by 3.5 deviations
CERTAIN = 3.5  # standard errors, by which a single axis must lag
FEWEST = 10  # bins
LATE = 0.65  # samples: a lag below may be of the model
PHASE = 0.12  # rad that a lag must turn in the middle of the band: friction and damping may turn as much
HOLD = 0.15  # samples by which a lag may miss half a sample, which a wrong hold makes
SPRINGS = (0.7, 0.85, 1.0, 1.2, 1.4)  # times the robot file's
ALIKE = 0.4  # samples by which axes may differ that share a lag


def doubts_of_timing(record: Record, robot: Robot) -> list[str]:
    """Say which torques lag the angles, or lead them, and whether the hold is another one.

    Springs of a robot file are often a quarter off, and near a wrong resonance phases are as of a lag. So what is told
    is there with springs as well beside which the phases scatter least.
    """
    told = _doubts(record, robot)
    if not told:
        return []
    as_well = _doubts(record, _with_likely_springs(record, robot))
    return [sentence for what, sentence in as_well.items() if what in told]


def _with_likely_springs(record: Record, robot: Robot) -> Robot:
    """Return the robot with the springs of each gear, one after the other, as its axis' phases scatter least."""
    for name in robot.axis_names:
        spring = f"gear_stiffness.{name}"
        if spring not in robot.layout:
            continue
        tried = [robot.with_parameters({spring: factor * robot.parameter(spring)}) for factor in SPRINGS]
        robot = min(tried, key=lambda one: _scatter(record, one, name))
    return robot


def _scatter(record: Record, robot: Robot, name: str) -> float:
    """Scatter of an axis' phases about those of a lag; infinite where too few are told."""
    lag = _lags(record, robot)[0].get(name)
    return np.inf if lag is None else lag.scatter


def _lags(record: Record, robot: Robot) -> tuple[dict[str, Lag], dict[str, tuple[FloatArray, FloatArray]]]:
    """Lags of the axes that tell one, and their phases over angular frequencies."""
    try:
        phases = list(_phases(record, robot))
    except (RobidError, ArithmeticError, np.linalg.LinAlgError):
        return {}, {}
    step, known, bins = record.runs[0].sample_time_s, dict[str, Lag](), {}
    for a, name in enumerate(robot.axis_names):
        omega = np.concatenate([w for axis, w, _ in phases if axis == a] or [np.zeros(0)])
        phase = np.concatenate([p for axis, _, p in phases if axis == a] or [np.zeros(0)])
        if len(omega) < FEWEST:
            continue
        lag = torque_lag(omega, phase, step)
        if lag.scatter < SCATTER and lag.error < ERROR:
            known[name], bins[name] = lag, (omega, phase)
    return known, bins


def _doubts(record: Record, robot: Robot) -> dict[str, str]:
    """Likewise, by what is doubted, of a robot whose springs are as they are."""
    step = record.runs[0].sample_time_s
    known, bins = _lags(record, robot)
    if not known:
        return {}
    middle = {name: float(np.median(omega)) for name, (omega, _) in bins.items()}
    lags = np.array([one.samples for one in known.values()])
    weights = np.array([1 / (one.error**2 + MODEL**2) for one in known.values()])
    common = float(np.average(lags, weights=weights))
    if np.ptp(lags) < ALIKE:
        turned = abs(common) * step * float(np.median(list(middle.values())))
        sure, apart = weights.sum() > 1 / SURE**2, common
        if len(known) == 1:  # nothing but friction may have turned the phase
            alone = lag_beside_friction(*next(iter(bins.values())), step)
            sure, apart = alone.error < ALONE, alone.samples
            if abs(alone.samples) < CERTAIN * alone.error:
                return {}
        if sure and (wrong := _hold(record.torque_hold, apart)):
            return {"torque_hold": wrong}
        whose = (
            "all torques from which it can be estimated"
            if len(known) > 1
            else f"the torque of {next(iter(known))}"
        )
        whole = len(known) > 1 or robot.n_axis == 1
        advice = f"{common * step:.2g}" if whole else _of_axes({next(iter(known)): common}, robot, step)
        if abs(common) <= LATE or turned <= PHASE:
            return {}
        return dict([_sentence(whose, common, step, advice)])
    late = {
        name: lag.samples
        for name, lag in known.items()
        if abs(lag.samples) > LATE and abs(lag.samples) * step * middle[name] > PHASE
    }
    advice = _of_axes(late, robot, step)
    return dict(_sentence(f"the torque of {name}", lag, step, advice) for name, lag in late.items())


def _hold(told: str, lag: float) -> str:
    """Say that another hold fits better; empty where it does not."""
    other, sign = (CONTINUOUS, 1) if told == HELD else (HELD, -1)
    if abs(sign * lag - 0.5) > HOLD:
        return ""
    return (
        f"torque_hold: {told} is stated, but torques and angles are {abs(lag):.2g} samples apart, as with {other}; "
        "half a sample costs percents of a stiffness"
    )


def _of_axes(late: dict[str, float], robot: Robot, step: float) -> str:
    """Delays of the torques of all axes as a channel map takes them: one number would move the others, too."""
    return f"[{', '.join(f'{late.get(name, 0.0) * step:.2g}' for name in robot.axis_names)}]"


def _sentence(whose: str, lag: float, step: float, advice: str) -> tuple[str, str]:
    """What is doubted, and the sentence.

    What is moved is the torque, earlier or (a negative delay) later, and never an angle: where axes are coupled, an
    angle that is moved against those beside it spoils their torques.
    """
    late = "lag" if lag > 0 else "lead"
    verb = late if whose.startswith("all") else f"{late}s"
    what = f"{whose} {verb} the angles"
    return what, (
        f"{what} by {abs(lag):.2g} samples ({1e3 * abs(lag) * step:.3g} ms): motor_torque: delay_s: {advice}, more "
        "than the channel map has, or a lag that the robot file lacks (drive.current_loop, sensing.delay)"
    )


def _phases(record: Record, robot: Robot) -> Iterator[tuple[int, FloatArray, FloatArray]]:
    """Axis, angular frequencies, and phase of recorded over predicted acceleration, of each experiment."""
    run = record.runs[0]
    if any(name not in run.channels for name in CHANNELS):
        return
    position, torque = (run.lanes(name) for name in CHANNELS)
    finite = np.isfinite(position).all(axis=(1, 2)) & np.isfinite(torque).all(axis=(1, 2))
    whole = np.flatnonzero(finite)
    chosen = whole[np.linspace(0, len(whole) - 1, min(MOST, len(whole))).astype(int)] if len(whole) else whole
    step, n_sample = run.sample_time_s, position.shape[1]
    frequency = np.fft.rfftfreq(n_sample, step)
    window = np.hanning(n_sample)[:, None]
    for q, u in zip(position[chosen], torque[chosen], strict=True):
        moved = np.fft.rfft(window * scipy.signal.detrend(q, axis=0), axis=0)
        driven = np.fft.rfft(window * scipy.signal.detrend(u, axis=0), axis=0)
        power = np.abs(driven) ** 2
        excited = power > EXCITED * np.maximum(power.max(axis=0), 1e-300)
        excited &= (frequency[:, None] < HIGHEST / step) & (frequency[:, None] > 0)
        if not excited.any():
            continue
        top = np.where(excited, frequency[:, None], 0.0).max(axis=0)
        band = excited & (frequency[:, None] >= UPPER * top)
        bins = np.flatnonzero(band.any(axis=1))
        bins = bins[np.unique(np.linspace(0, len(bins) - 1, min(BINS, len(bins))).astype(int))]
        damping = robot.equivalent_motor_damping(*_speed_levels(np.diff(q, axis=0) / step), frequency[bins])
        angle = robot.joint_angle(q.mean(axis=0))[None]
        response = _response(robot, angle, frequency[bins], damping, record.torque_hold)
        each = response * driven[bins][:, None, :]
        predicted = each.sum(axis=2)
        omega = 2 * np.pi * frequency[bins]
        phase = np.angle(-moved[bins] * predicted.conj())
        for a in range(robot.n_axis):
            kept = band[bins, a] & (np.abs(each[:, a, a]) > OWN * np.abs(predicted[:, a]))
            if kept.any():
                yield a, omega[kept], phase[kept, a]


def _response(
    robot: Robot, angle: FloatArray, frequency: FloatArray, damping: FloatArray, hold: str
) -> ComplexArray:
    """Response in one pose, (n_freq, n_axis, n_axis); nothing is compiled for a robot without effects."""
    if not robot.effects and not any(body.flexible for body in robot.description.bodies):
        step = robot.sample_time_s if hold == HELD else None
        springs, dampers = robot.spring_arrays()
        omega = 2 * np.pi * frequency
        return spring_response(robot.mechanism, springs, dampers, angle[0], damping[0], omega, step)
    response: ComplexArray = robot.response(angle, frequency, damping, hold)[0]
    return response


def _speed_levels(speed: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Rms of the speeds (n_sample, n_axis) without their strongest line, and its amplitude, (1, n_axis) each."""
    window = np.hanning(len(speed))[:, None]
    power = np.abs(np.fft.rfft(window * (speed - speed.mean(axis=0)), axis=0)) ** 2
    strongest = power.argmax(axis=0)
    lobe = np.clip(strongest + np.arange(-2, 3)[:, None], 0, len(power) - 1)
    share = np.take_along_axis(power, lobe, axis=0).sum(axis=0) / np.maximum(power.sum(axis=0), 1e-300)
    share = np.minimum(share, 1.0)
    variance = speed.var(axis=0)
    return np.sqrt(variance * (1 - share))[None], np.sqrt(2 * variance * share)[None]
