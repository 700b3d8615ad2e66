"""What the channels of a record say of one another and of the noise, without any model of the robot's motion.

Spikes and lost counts stand out from all other samples; a dead channel has no values to speak of; two channels that
are one have no noise of their own; speed and angle tell the clock twice; a torque that was filtered lacks the noise
that the robot file states. All are doubts, not refusals.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np
import scipy

from robid_core import FloatArray, Record, Robot

POSITION, TORQUE, SPEED = "motor_position", "motor_torque", "motor_speed"
# Times all but one in a hundred: of a million normal values the largest reaches 2, of exponential ones 3, and of motion
# that was recorded 4; twice that is none of these.
OUT = 8.0
SHARE = (
    0.003  # of the samples: each spoils three second differences, and a hundredth of them moves the quantile
)
SHORTEST = 100  # samples
LEVELS = 3  # values: what toggles by a count has as many
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


def empty_channels(record: Record) -> Iterator[str]:
    """Say which channels hold nothing, or what another one holds: no model can be held against these."""
    yield from _dead(record)
    yield from _doubled(record)


def doubts_of_channels(record: Record, robot: Robot) -> Iterator[str]:
    """Say which channels hold accidents, tell another clock, or have less noise than they must."""
    yield from _accidents(record)
    yield from _speeds(record)
    yield from _filtered(record, robot)


def _lanes(record: Record, name: str) -> list[FloatArray]:
    """Experiments of a channel without holes, (n_sample, n_axis) each."""
    lanes = [lane for run in record.runs if name in run.channels for lane in run.lanes(name)]
    return [lane for lane in lanes if np.isfinite(lane).all()]


def _accidents(record: Record) -> Iterator[str]:
    """Samples of an angle that no acceleration makes, and single samples of a torque beside all others."""
    for name, measure in ((POSITION, _bends), (TORQUE, _lonely)):
        lanes = [lane for lane in _lanes(record, name) if len(lane) > SHORTEST]
        for axis, of in enumerate(record.axis_names):
            found = []
            for lane in lanes:
                found += _places(measure(lane[:, axis]), lane[:, axis])
            if found:
                unit, step = record.runs[0].channel(name).unit_symbol, record.runs[0].sample_time_s
                sort = "spikes" if name == TORQUE else "spikes, or lost counts"
                yield (
                    f"{name} of {of} has {len(found)} {sort}, the first by {found[0][1]:.3g} {unit} at "
                    f"{found[0][0] * step:.4g} s of its experiment: look at the cable and the counter, and leave them "
                    "out (NaN, with gaps: mask or split)"
                )


def _bends(values: FloatArray) -> FloatArray:
    """Second difference, (n_sample - 2,)."""
    result: FloatArray = np.diff(values, 2)
    return result


def _lonely(values: FloatArray) -> FloatArray:
    """By how much a sample lies beyond both its neighbours, (n_sample - 2,): what rises over several is no spike."""
    before, after = np.diff(values)[:-1], -np.diff(values)[1:]
    result: FloatArray = np.where(before * after > 0, np.minimum(np.abs(before), np.abs(after)), 0.0)
    return result


def _places(measure: FloatArray, values: FloatArray) -> list[tuple[int, float]]:
    """Samples at which a measure stands out, one for each accident, and by how much."""
    size = np.abs(measure)
    steps = np.abs(np.diff(values))
    count = float(steps[steps > 0].min(initial=np.inf))
    usual = max(float(np.quantile(size, 0.99)), 2 * count if np.isfinite(count) else 0.0)
    out = np.flatnonzero(size > OUT * usual)
    if not len(out):
        return []
    first = out[np.concatenate(([True], np.diff(out) > 3))]
    if len(first) > SHARE * len(size):
        return []
    return [(int(k) + 1, float(size[k])) for k in first]


def _dead(record: Record) -> Iterator[str]:
    """Channels of an axis that do not change, or toggle by a count, while the other one does."""
    levels = {
        name: [
            len(np.unique(np.concatenate([lane[:, a] for lane in lanes])))
            for a in range(len(record.axis_names))
        ]
        for name in (POSITION, TORQUE)
        if (lanes := _lanes(record, name))
    }
    if len(levels) < 2:
        return
    for axis, of in enumerate(record.axis_names):
        angle, torque = levels[POSITION][axis], levels[TORQUE][axis]
        if torque <= LEVELS < angle:
            yield f"motor_torque of {of} has {torque} values only while its angle moves: the channel is dead"
        if angle <= LEVELS < torque:
            yield (
                f"motor_position of {of} has {angle} values only while its torque changes: the channel is dead, or the "
                "axis was held; nothing can be said of this axis"
            )


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
