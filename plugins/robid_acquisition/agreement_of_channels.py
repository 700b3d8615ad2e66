"""What the channels of a record say of one another and of the noise, without any model of the robot's motion.

A dead channel has no values to speak of; two channels that are one have no noise of their own; speed and angle tell the
clock twice; a torque that was filtered lacks the noise that the robot file states. All but dead torques are doubts, not
refusals.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping

import numpy as np
import scipy

from robid_acquisition.accidents import POSITION, TORQUE, accidents_in
from robid_acquisition.odd_experiments import Place
from robid_core import FloatArray, Record, Robot

SPEED = "motor_speed"
LEVELS = 3  # values: what toggles by a count has as many
MOVES = 0.1  # of the largest travel of an axis in any experiment
SAME = 1e-9  # of the variance that two channels may differ by
CLOCK = (
    0.003  # by which speed may miss the angle's, units being told to three digits; and what differences miss
)
DIFFERENCES = 1 / 6  # of (w T)^2, which a central difference misses of a speed
SIGMAS = 5.0
UNITS = {60 / (2 * np.pi): "rpm", 180 / np.pi: "deg/s", 1 / (2 * np.pi): "turns per second"}
NEAR = 0.02  # of a unit's factor
TOP = (0.4, 0.49)  # of the sampling rate, where nothing but noise is
# Of the stated noise, left there: a first-order low-pass of d samples leaves 1 / (2 pi 0.45 d), of three samples
# so much. A drive's own noise differs from band to band by a factor of four without any filter.
FILTERED = 0.12
MIDDLE = (0.2, 0.3)  # of the sampling rate
FLAT = 0.75  # of the noise in the middle, above: such a low-pass leaves 0.56, a quieter machine at rest all of it
BINS = 50


def dead_torques(record: Record) -> Iterator[str]:
    """Say which torques do not change, or toggle by a count, while their axis moves."""
    for of, angle, torque in _levels(record):
        if torque <= LEVELS < angle:
            yield f"motor_torque of {of} {_has(torque)} while its angle moves: the channel is dead"


def dead_in_some(record: Record, names: Mapping[Place, str]) -> Iterator[str]:
    """Say in which named experiments a torque does not change, though its axis moves there as in the others."""
    run = record.run if names else None
    if run is None or any(name not in run.channels for name in (POSITION, TORQUE)):
        return
    position, torque = (run.values(name) for name in (POSITION, TORQUE))
    travel = np.ptp(position, axis=(3, 4))
    usual = np.nanmax(travel, axis=(0, 1, 2), initial=0.0)
    for place, file in names.items():
        for axis, of in enumerate(record.axis_names):
            levels = len(np.unique(torque[place][..., axis]))
            if levels <= LEVELS and travel[place][axis] > MOVES * usual[axis] > 0:
                yield f"{file}: motor_torque of {of} {_has(levels)} while its angle moves: the channel is dead"


def empty_channels(record: Record) -> Iterator[str]:
    """Say which angles do not change, and which channels are one column: no model can be held against these."""
    for of, angle, torque in _levels(record):
        if angle <= LEVELS < torque:
            yield (
                f"motor_position of {of} {_has(angle)} while its torque changes: the channel is dead, or the axis was "
                "held; nothing can be said of this axis"
            )
    yield from _still_in_each(record)
    yield from _doubled(record)


def doubts_of_channels(record: Record, robot: Robot, low_pass_hz: float | None) -> Iterator[str]:
    """Say which channels hold accidents, tell another clock, or have less noise than they must.

    Above `low_pass_hz`, where all channels were filtered alike when they were read, there is no noise to ask for.
    """
    yield from accidents_in({name: _lanes(record, name) for name in (POSITION, TORQUE)}, record)
    yield from _speeds(record)
    if low_pass_hz is None or low_pass_hz > TOP[1] / record.runs[0].sample_time_s:
        yield from _filtered(record, robot)


def _lanes(record: Record, name: str) -> list[FloatArray]:
    """Experiments of a channel without holes, (n_sample, n_axis) each."""
    lanes = [lane for run in record.runs if name in run.channels for lane in run.lanes(name)]
    return [lane for lane in lanes if np.isfinite(lane).all()]


def _levels(record: Record) -> Iterator[tuple[str, int, int]]:
    """Each axis, with how many values its angle has, and its torque."""
    lanes = [_lanes(record, name) for name in (POSITION, TORQUE)]
    for axis, of in enumerate(record.axis_names if all(lanes) else ()):
        angle, torque = (len(np.unique(np.concatenate([lane[:, axis] for lane in own]))) for own in lanes)
        yield of, angle, torque


def _still_in_each(record: Record) -> Iterator[str]:
    """Angles that stand in each experiment, elsewhere in another one, where other axes move and torques change."""
    angles = [[len(np.unique(one)) for one in lane.T] for lane in _lanes(record, POSITION)]
    most = np.max(angles, axis=0) if angles else np.empty(0)
    if not (most > LEVELS).any():  # nothing moves: poses
        return
    for axis, (of, angle, torque) in enumerate(_levels(record)):
        if most[axis] <= LEVELS < min(angle, torque):
            yield (
                f"motor_position of {of} {_has(int(most[axis]))} in each experiment while its torque changes: the "
                "channel is dead, or the axis was held; look at its column"
            )


def _has(levels: int) -> str:
    return "has one value only" if levels == 1 else f"has {levels} values only"


def _doubled(record: Record) -> Iterator[str]:
    """Channels of two axes that are one."""
    for name in (POSITION, TORQUE):
        lanes = _lanes(record, name)
        if not lanes:
            continue
        centred = np.concatenate([lane - lane.mean(axis=0) for lane in lanes])
        norm = np.maximum(np.linalg.norm(centred, axis=0), 1e-300)
        for a, b in itertools.combinations(range(centred.shape[1]), 2):
            if np.ptp(centred[:, a]) and 1 - abs(centred[:, a] @ centred[:, b]) / norm[a] / norm[b] < SAME:
                yield (
                    f"{name} of {record.axis_names[a]} and of {record.axis_names[b]} are the same column: two sensors "
                    "differ by their noise; look at the channel map"
                )


def _speeds(record: Record) -> Iterator[str]:
    """Speeds that are not those of the angles: another unit, or another clock."""
    step = record.runs[0].sample_time_s
    positions, speeds = _lanes(record, POSITION), _lanes(record, SPEED)
    if not speeds or len(speeds) != len(positions):
        return
    factors = []
    for axis in range(len(record.axis_names)):
        pairs = []
        for position, speed in zip(positions, speeds, strict=True):
            turned = scipy.integrate.cumulative_trapezoid(speed[:, axis], dx=step, initial=0)
            pairs.append([scipy.signal.detrend(one) for one in (position[:, axis], turned)])
        angle, turned = (np.concatenate(one) for one in zip(*pairs, strict=True))
        power = float(angle @ angle)
        if power <= 0 or np.ptp(angle) == 0:
            factors.append((1.0, 0.0))
            continue
        factor = float(angle @ turned) / power
        speed = np.concatenate([one[:, axis] - one[:, axis].mean() for one in speeds])
        missed = DIFFERENCES * step**2 * float(speed @ speed) / float(turned @ turned)
        noise = float(np.std(turned - factor * angle) / np.sqrt(power))
        factors.append((factor, CLOCK + missed + SIGMAS * noise))
    off = [k for k, (factor, most) in enumerate(factors) if abs(factor - 1) > most]
    found = np.array([factors[k][0] for k in off])
    if len(off) == len(factors) and np.ptp(found) < CLOCK and abs(found.mean() - 1) < NEAR:
        yield (
            f"all speeds are {found.mean():.4g} times what the angles make with steps of {1e3 * step:.6g} ms: the "
            f"clock is wrong (sample_time_s: {step / found.mean():.6g}), or the unit of the speeds"
        )
        return
    for k in off:
        factor = factors[k][0]
        unit = next((name for known, name in UNITS.items() if abs(factor / known - 1) < NEAR), "")
        looks = f"it looks like {unit}" if unit else "look at its unit, scale and side of the gear"
        yield f"motor_speed of {record.axis_names[k]} is {factor:.4g} times what its angle makes: {looks}"


def _filtered(record: Record, robot: Robot) -> Iterator[str]:
    """Torques without the noise that the robot file states."""
    stated = robot.drives.torque_noise
    lanes = _lanes(record, TORQUE)
    if not lanes:
        return
    for axis, of in enumerate(record.axis_names):
        powers, middle = [], []
        for lane in lanes:
            window = np.hanning(len(lane))
            spectrum = np.abs(np.fft.rfft(window * scipy.signal.detrend(lane[:, axis]))) ** 2
            frequency = np.fft.rfftfreq(len(lane))
            spectrum /= (window**2).sum()
            powers.append(spectrum[(frequency > TOP[0]) & (frequency < TOP[1])])
            middle.append(spectrum[(frequency > MIDDLE[0]) & (frequency < MIDDLE[1])])
        power = np.concatenate(powers)
        if len(power) < BINS or stated[axis] <= 0:
            continue
        noise = float(np.sqrt(np.median(power) / np.log(2)))
        falls = np.median(power) < FLAT**2 * np.median(np.concatenate(middle))
        if 0 < noise < FILTERED * stated[axis] and falls:
            yield (
                f"motor_torque of {of} has {100 * noise / stated[axis]:.2g} % of the noise that the robot file states, "
                f"above {TOP[0] / record.runs[0].sample_time_s:.4g} Hz: it was low-passed, which delays it and takes "
                "from it; record it unfiltered, or filter the angle alike"
            )
