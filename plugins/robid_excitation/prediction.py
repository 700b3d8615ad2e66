"""What an excitation would do to the nominal robot, and how much smaller it has to be where that is too much.

The closed loop is simulated from rest over a start-up and one period; torque, speed, acceleration and position
of the motors are compared with the limits. Whatever is slower than the excited band (gravity, the slow sine
and friction under it) is told apart by Fourier transform: reducing the multisine does not reduce it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from robid_core import BoolArray, FloatArray, IntArray, MotionRefused, Robot

START_UP_S = 1.0  # the drives' loops settle in a few tenths of a second; the start itself is simulated too


@dataclass(frozen=True)
class Prediction:
    """Largest values over the simulated time, motor side, each of shape (n_lane, n_axis).

    `slow_*` is what is left of a peak without the excited band; `upper` and `lower` are motor angles in rad,
    `travel` the largest distance from the configuration.
    """

    torque: FloatArray
    slow_torque: FloatArray
    speed: FloatArray
    slow_speed: FloatArray
    acceleration: FloatArray
    upper: FloatArray
    lower: FloatArray
    travel: FloatArray
    saturated: FloatArray


def slow_part(signal: FloatArray, line: IntArray) -> FloatArray:
    """Part of one period below the lowest excited bin, shape (..., n_sample, n_axis)."""
    spectrum = np.fft.rfft(signal, axis=-2)
    spectrum[..., int(line.min()) :, :] = 0
    result: FloatArray = np.fft.irfft(spectrum, n=signal.shape[-2], axis=-2)
    return result


def motor_speed(position: FloatArray, line: IntArray, sample_time_s: float) -> FloatArray:
    """Speed of one period of motor angles, by differentiation in frequency up to twice the highest line."""
    n_sample = position.shape[-2]
    spectrum = np.fft.rfft(position, axis=-2)
    omega = 2 * np.pi * np.fft.rfftfreq(n_sample, sample_time_s)
    omega[2 * int(line.max()) + 1 :] = 0
    result: FloatArray = np.fft.irfft(1j * omega[:, None] * spectrum, n=n_sample, axis=-2)
    return result


def predict(robot: Robot, reference: FloatArray, motor_angle: FloatArray, line: IntArray) -> Prediction:
    """Simulate experiments in closed loop, without sensor noise.

    Parameters
    ----------
    robot
        The nominal robot.
    reference
        One period of motor speed, rad/s, shape (n_lane, n_sample, n_axis).
    motor_angle
        The configurations, motor side, rad, shape (n_lane, n_axis). The motion starts where its middle is the
        configuration (`Excitation.start_offset`).
    line
        Excited bins.
    """
    step, n_sample = robot.sample_time_s, reference.shape[1]
    travel = np.cumsum(reference, axis=1) * step
    start = motor_angle - travel.mean(axis=1)
    n_start = min(n_sample, round(START_UP_S / step))
    whole = np.concatenate([reference, reference[:, :n_start]], axis=1)
    simulation = robot.simulate(whole, robot.joint_angle(start))
    torque, position = simulation.torque, simulation.position
    period_torque, period_position = torque[:, n_start:], position[:, n_start:]
    speed = motor_speed(period_position, line, step)
    path = np.concatenate([position, start[:, None, :] + travel], axis=1)
    change = np.diff(reference, axis=1, append=reference[:, :1])
    return Prediction(
        torque=np.abs(torque).max(axis=1),
        slow_torque=np.abs(slow_part(period_torque, line)).max(axis=1),
        speed=np.maximum(np.abs(speed).max(axis=1), np.abs(reference).max(axis=1)),
        slow_speed=np.abs(slow_part(reference, line)).max(axis=1),
        acceleration=np.abs(change).max(axis=1) / step,
        upper=path.max(axis=1),
        lower=path.min(axis=1),
        travel=np.abs(path - motor_angle[:, None, :]).max(axis=1),
        saturated=simulation.saturated,
    )


@dataclass(frozen=True)
class Excess:
    """A limit that would be broken, in words, and the factors on both amplitudes that are tried next."""

    lane: int
    words: str
    multisine_factor: float
    sine_factor: float


def excesses(prediction: Prediction, robot: Robot, margin: float) -> list[Excess]:
    """All limits that a prediction breaks, in the worst lane of each axis and quantity.

    `margin` is the share of torque, speed and acceleration limits that may be used; positions may go up to
    their limits.
    """
    limits, p = robot.limits, prediction
    torque_limit = margin * robot.drives.torque_limit
    none = np.zeros_like(p.acceleration)
    return [
        *_peaks("torque", "N m", p.torque, p.slow_torque, torque_limit, robot, p.saturated > 0),
        *_peaks("speed", "rad/s", p.speed, p.slow_speed, margin * limits.speed, robot, none > 0),
        *_peaks(
            "acceleration", "rad/s^2", p.acceleration, none, margin * limits.acceleration, robot, none > 0
        ),
        *_positions("upper", p.upper, limits.upper, p.upper - limits.upper, p.travel, robot),
        *_positions("lower", p.lower, limits.lower, limits.lower - p.lower, p.travel, robot),
    ]


def _peaks(
    name: str,
    unit: str,
    peak: FloatArray,
    slow: FloatArray,
    allowed: FloatArray,
    robot: Robot,
    clipped: BoolArray,
) -> list[Excess]:
    found = []
    for axis in np.flatnonzero((peak > allowed).any(axis=0)):
        lane = int(np.argmax(peak[:, axis]))
        words = (
            f"{robot.axis_names[axis]} would reach a motor {name} of {peak[lane, axis]:.4g} {unit}, "
            f"{allowed[axis]:.4g} {unit} are allowed"
        )
        static = min(slow[lane, axis], peak[lane, axis])
        room = allowed[axis] - static
        # A torque at its limit does not tell how far it wanted to go: halve and look again.
        factor = 0.5 if clipped[lane, axis] else room / max(peak[lane, axis] - static, 1e-300)
        if room < 0.05 * allowed[axis]:  # the slow part alone takes it all
            found.append(Excess(lane, words, 0.7, 0.7))
        else:
            found.append(Excess(lane, words, float(np.clip(0.98 * factor, 0.1, 0.95)), 1.0))
    return found


def _positions(
    name: str, reached: FloatArray, limit: FloatArray, beyond: FloatArray, travel: FloatArray, robot: Robot
) -> list[Excess]:
    found = []
    for axis in np.flatnonzero((beyond > 0).any(axis=0)):
        lane = int(np.argmax(beyond[:, axis]))
        words = (
            f"{robot.axis_names[axis]} would reach a motor angle of {reached[lane, axis]:.4g} rad, beyond its "
            f"{name} limit of {limit[axis]:.4g} rad"
        )
        factor = float(np.clip(0.98 * (1 - beyond[lane, axis] / travel[lane, axis]), 0.1, 0.95))
        found.append(Excess(lane, words, factor, factor))
    return found


def factors_that_fit(
    predict_scaled: Callable[[float, float], Prediction], robot: Robot, margin: float, first: Sequence[Excess]
) -> tuple[float, float] | None:
    """Factors on multisine and slow sine with which a prediction breaks no limit; None where none is found.

    Not extrapolated: the factors that are returned have been simulated.
    """
    multisine = sine = 1.0
    broken: Sequence[Excess] = first
    for _ in range(12):
        multisine *= min(excess.multisine_factor for excess in broken)
        sine *= min(excess.sine_factor for excess in broken)
        broken = excesses(predict_scaled(multisine, sine), robot, margin)
        if not broken:
            return multisine, sine
    return None


@dataclass(frozen=True)
class Cleared:
    """Largest predicted values in each configuration, motor side, (n_config, n_axis)."""

    torque: FloatArray
    speed: FloatArray
    travel: FloatArray


def experiments_to_try(fast: FloatArray, most: int = 16) -> list[tuple[int, int, int]]:
    """Experiments (configuration, block, experiment) that stand for all: the highest peak in each block.

    All experiments of a block have the same spectrum. With more than `most` blocks in all, one block of each
    configuration has to do.
    """
    n_config, n_block = fast.shape[:2]
    blocks = range(n_block) if n_config * n_block <= most else range(1)
    crest = np.abs(fast).max(axis=3) / np.sqrt(np.mean(fast**2, axis=3))
    return [(i, m, int(np.argmax(crest[i, m].max(axis=-1)))) for i in range(n_config) for m in blocks]


@dataclass(frozen=True)
class Level:
    """The settings that give the amplitudes: the multisine's by name, and the slow sine's."""

    name: str
    multisine: float
    slow_sine: float

    def advice(self, factors: tuple[float, float]) -> str:
        """Amplitudes that fit, rounded down."""
        words = f"{self.name}: {_rounded_down(self.multisine * factors[0])}"
        if factors[1] < 1.0 and self.slow_sine > 0:
            words += f" with slow_sine_rad_s: {_rounded_down(self.slow_sine * factors[1])}"
        return f"{words} would fit"


def _rounded_down(value: float) -> str:
    unit = 10.0 ** (math.floor(math.log10(value)) - 2)
    return f"{math.floor(value / unit) * unit:.6g}"


def clear(
    fast: FloatArray,
    slow: FloatArray,
    angle: FloatArray,
    robot: Robot,
    line: IntArray,
    margin: float,
    level: Level,
) -> Cleared:
    """Simulate the nominal robot with the highest peaks of each block and hold the result against its limits.

    Parameters
    ----------
    fast, slow
        Multisines and slow sines, shapes (n_config, n_block, n_exp, n_sample, n_axis) and (n_config, n_block, 1,
        n_sample, n_axis).
    angle
        The configurations, joint side, shape (n_config, n_axis).
    robot, line
        The nominal robot and the excited bins.
    margin
        Share of the limits that may be used.
    level
        The settings, for the advice.

    Raises
    ------
    MotionRefused
        Where a limit would be broken: axis, value, limit, and amplitudes that were simulated and fit.
    """
    tried = experiments_to_try(fast)
    index = np.array(tried)
    fast_lanes = np.stack([fast[t] for t in tried])
    slow_lanes = np.stack([slow[i, m, 0] for i, m, _ in tried])
    motor_angle = robot.motor_angle(angle)[index[:, 0]]
    prediction = predict(robot, fast_lanes + slow_lanes, motor_angle, line)
    broken = excesses(prediction, robot, margin)
    if broken:
        lanes = sorted({excess.lane for excess in broken})

        def predict_scaled(multisine: float, sine: float) -> Prediction:
            reference = multisine * fast_lanes[lanes] + sine * slow_lanes[lanes]
            return predict(robot, reference, motor_angle[lanes], line)

        factors = factors_that_fit(predict_scaled, robot, margin, broken)
        listed = "; ".join(f"in configuration {tried[e.lane][0]} {e.words}" for e in broken)
        fits = "no amplitude fits: move the configuration away from the limit"
        raise MotionRefused(f"{listed}; nothing has moved; {level.advice(factors) if factors else fits}")
    largest = [
        np.stack([values[index[:, 0] == i].max(axis=0) for i in range(len(angle))])
        for values in (prediction.torque, prediction.speed, prediction.travel)
    ]
    return Cleared(*largest)
