"""An excitation is held against the limits of the nominal robot before anything moves, and its outcome predicted.

All experiments are simulated where they are few; where they are many, all of some configurations and the highest peaks
of the others. What breaks a limit is refused with amplitudes that were simulated and fit.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from robid_core import ExperimentIndex, FloatArray, IntArray, MotionRefused, Robot
from robid_core.estimation.excitation.predicted import PredictedDeviation, SensorNoise, predicted_deviation
from robid_excitation.gear_load import load_of_motor
from robid_excitation.limits import Excess, excesses, factors_that_fit
from robid_excitation.simulated import (
    Prediction,
    friction_level,
    joined,
    motor_speed as motor_speed,
    predict,
    slow_part as slow_part,
)

QUANTILES = (0.1, 0.5, 0.9, 0.99)
MOST_EXPERIMENTS = 48  # simulated for the scatter: about 3 s of one core for six axes and periods of 8 s
MOST_BLOCKS = 16  # tried where not all are simulated
TOGETHER = 16  # experiments in memory at a time


@dataclass(frozen=True)
class Cleared:
    """Motion and torque that the nominal robot will have in each configuration, motor side, (n_config, n_axis)."""

    torque: FloatArray
    """Largest, as `speed`, `travel` and `gear_load` (joint side)."""
    speed: FloatArray
    travel: FloatArray
    gear_load: FloatArray
    torque_rms: FloatArray
    """Of the excited band."""
    friction: FloatArray
    speed_quantile: FloatArray
    """At QUANTILES, shape (n_config, n_quantile, n_axis)."""
    standstill: FloatArray
    """Share of the time below `standstill_speed`."""
    torque_limit: FloatArray
    """(n_axis,), as the next two."""
    motor_gear_load: FloatArray
    standstill_speed: FloatArray
    deviation: FloatArray | None
    """Relative, of the response's diagonal, (n_config, n_freq, n_axis); see `Excitation`."""
    noise_deviation: FloatArray | None
    n_simulated: int

    def artifact_fields(self) -> dict[str, Any]:
        """Return every predicted field of `Excitation` by its name there."""
        return {
            "predicted_torque": self.torque,
            "predicted_speed": self.speed,
            "predicted_travel": self.travel,
            "predicted_torque_rms": self.torque_rms,
            "torque_limit": self.torque_limit,
            "friction_torque": self.friction,
            "predicted_gear_load": self.gear_load,
            "motor_gear_load": self.motor_gear_load,
            "quantile": np.array(QUANTILES),
            "predicted_speed_quantile": self.speed_quantile,
            "standstill_speed": self.standstill_speed,
            "predicted_standstill": self.standstill,
            "predicted_deviation": self.deviation,
            "predicted_noise_deviation": self.noise_deviation,
            "simulated_experiments": self.n_simulated,
        }


def experiments_to_try(fast: FloatArray, most: int = MOST_BLOCKS) -> list[ExperimentIndex]:
    """Experiments that stand for all of their configuration.

    Where all of a configuration have the same root mean square on every axis, as multisines do, that is the highest
    peak of each block (of the first block, with more than `most` blocks in all). Where not, every one counts.
    """
    n_config, n_block, n_exp = fast.shape[:3]
    blocks = range(n_block) if n_config * n_block <= most else range(1)
    rms = np.sqrt(np.mean(fast**2, axis=3))
    alike = np.ptp(rms, axis=(1, 2)) <= 0.01 * rms.max(axis=(1, 2))
    crest = np.abs(fast).max(axis=3) / np.where(rms > 0, rms, 1.0)
    tried: list[ExperimentIndex] = []
    for i in range(n_config):
        if alike[i].all():
            tried += [(i, m, int(np.argmax(crest[i, m].max(axis=-1)))) for m in blocks]
        else:
            tried += [(i, m, e) for m in range(n_block) for e in range(n_exp)]
    return tried


def experiments_to_simulate(
    fast: FloatArray, most: int = MOST_EXPERIMENTS
) -> tuple[list[ExperimentIndex], list[int]]:
    """Every experiment of as many configurations as `most` allows, spread evenly, and those that stand for the others.

    Returns (experiments, configurations of which every experiment is among them).
    """
    n_config, n_block, n_exp = fast.shape[:3]
    count = min(n_config, max(1, most // (n_block * n_exp)))
    # One configuration alone is the first; two and more include the first and the last.
    whole = sorted({round(i) for i in np.linspace(0, n_config - 1, count).tolist()})
    chosen = [(i, m, e) for i in whole for m in range(n_block) for e in range(n_exp)]
    if len(whole) < n_config:
        chosen += [t for t in experiments_to_try(fast) if t[0] not in whole]
    return chosen, whole


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
    progress: Callable[[float, float, str], None] | None = None,
) -> Cleared:
    """Simulate the nominal robot, hold the result against its limits and predict the measurement.

    Parameters
    ----------
    fast, slow
        Multisines and slow sines, shapes (n_config, n_block, n_exp, n_sample, n_axis) and (n_config, n_block, 1,
        n_sample, n_axis). Any other motion is `fast` with a slow part of zeros.
    angle
        The configurations, joint side, shape (n_config, n_axis).
    robot, line
        The nominal robot and the excited bins; without any, nothing is said of a response.
    margin
        Share of the limits that may be used.
    level
        The settings, for the advice.
    progress
        Told how many experiments are simulated: `Context.progress`.

    Raises
    ------
    MotionRefused
        Where a limit would be broken: axis, value, limit, and amplitudes that were simulated and fit.
    """
    chosen, whole = experiments_to_simulate(fast)
    motor_angle = robot.motor_angle(angle)
    tell = progress or (lambda done, total, note: None)

    def simulate(some: Sequence[ExperimentIndex], mirrored: bool = False) -> Prediction:
        parts = []
        for first in range(0, len(some), TOGETHER):
            tell(first, len(some), "experiments simulated")
            now = some[first : first + TOGETHER]
            asked = _reference(fast, slow, now)
            asked = asked[:, ::-1] if mirrored else asked
            parts.append(predict(robot, asked, motor_angle[[t[0] for t in now]], line))
        tell(len(some), len(some), "experiments simulated")
        return joined(parts)

    prediction = simulate(chosen)
    broken = excesses(prediction, robot, margin)
    if broken:
        factors = _factors(broken, chosen, fast, slow, motor_angle, robot, line, margin)
        fits = "no amplitude fits: move the configuration away from the limit"
        raise MotionRefused(
            f"{_listed(broken, chosen)}; nothing has moved; {level.advice(factors) if factors else fits}"
        )
    deviations: list[PredictedDeviation | None] = [None] * len(angle)
    n_planned = fast.shape[1] * fast.shape[2]
    if len(line) and n_planned >= robot.n_axis:
        own = np.array([t[0] for t in chosen])
        for i in whole:
            some = [t for t in chosen if t[0] == i]
            u, y = prediction.u[own == i], prediction.y[own == i]
            if n_planned < 2 * robot.n_axis:
                # Too few to spare for a scatter. Backwards in time a multisine has the opposite phases: another
                # realisation of the same spectrum.
                other = simulate(some, mirrored=True)
                u, y = np.concatenate([u, other.u]), np.concatenate([y, other.y])
            deviations[i] = predicted_deviation(
                np.moveaxis(u, 0, -1),
                np.moveaxis(y, 0, -1),
                n_planned,
                line / (fast.shape[3] * robot.sample_time_s),
                sensor_noise(robot),
                fast.shape[3],
            )
    return summary(robot, prediction, [t[0] for t in chosen], deviations, len(line))


def factors_within_limits(
    fast: FloatArray, slow: FloatArray, angle: FloatArray, robot: Robot, line: IntArray, margin: float
) -> tuple[float, float, str]:
    """Factors on multisines and slow sines with which the nominal robot breaks no limit, and what it would break.

    Arguments as of `clear`. Both factors are 1, and nothing is told, where no limit is broken, and where no factor
    helps: `clear` then refuses with the reason.
    """
    chosen, _ = experiments_to_simulate(fast)
    motor_angle = robot.motor_angle(angle)
    parts = []
    for first in range(0, len(chosen), TOGETHER):
        now = chosen[first : first + TOGETHER]
        there = motor_angle[[t[0] for t in now]]
        parts.append(predict(robot, _reference(fast, slow, now), there, line))
    broken = excesses(joined(parts), robot, margin)
    factors = _factors(broken, chosen, fast, slow, motor_angle, robot, line, margin) if broken else None
    return (*factors, _listed(broken, chosen)) if factors else (1.0, 1.0, "")


def _reference(
    fast: FloatArray,
    slow: FloatArray,
    some: Sequence[ExperimentIndex],
    multisine: float = 1.0,
    sine: float = 1.0,
) -> FloatArray:
    """Speed references of some experiments, shape (n_some, n_sample, n_axis)."""
    return np.stack([multisine * fast[t] + sine * slow[t[0], t[1], 0] for t in some])


def _listed(broken: Sequence[Excess], chosen: Sequence[ExperimentIndex]) -> str:
    return "; ".join(f"in configuration {chosen[e.lane][0] + 1} {e.words}" for e in broken)


def _factors(
    broken: Sequence[Excess],
    chosen: Sequence[ExperimentIndex],
    fast: FloatArray,
    slow: FloatArray,
    motor_angle: FloatArray,
    robot: Robot,
    line: IntArray,
    margin: float,
) -> tuple[float, float] | None:
    """Factors with which the experiments that break a limit break none; None where none is found."""
    worst = [chosen[lane] for lane in sorted({excess.lane for excess in broken})]
    there = motor_angle[[t[0] for t in worst]]

    def scaled(multisine: float, sine: float) -> Prediction:
        return predict(robot, _reference(fast, slow, worst, multisine, sine), there, line)

    return factors_that_fit(scaled, robot, margin, broken)


def sensor_noise(robot: Robot) -> SensorNoise:
    """Variances of the nominal robot's sensors."""
    d = robot.drives
    step = np.where(d.encoder_counts > 0, 2 * np.pi / np.maximum(d.encoder_counts, 1), 0.0)
    return SensorNoise(d.position_noise**2, d.torque_noise**2, step**2 / 12)


def summary(
    robot: Robot,
    prediction: Prediction,
    configuration: Sequence[int],
    deviations: Sequence[PredictedDeviation | None],
    n_freq: int,
) -> Cleared:
    """What the experiments of each configuration say together.

    Parameters
    ----------
    robot
        What was simulated.
    prediction
        Of all simulated experiments.
    configuration
        To which configuration each of them belongs, length n_lane; every configuration has one or more.
    deviations
        For each configuration, None where there is none.
    n_freq
        Number of lines.
    """
    own = np.array(configuration)
    groups = [own == i for i in range(len(deviations))]

    def largest(values: FloatArray) -> FloatArray:
        return np.stack([values[group].max(axis=0) for group in groups])

    def mean(values: FloatArray) -> FloatArray:
        return np.stack([values[group].mean(axis=0) for group in groups])

    drives, over_time = robot.drives, prediction.speed_over_time
    speed_rms = np.sqrt(mean(np.mean(over_time.astype(np.float64) ** 2, axis=1)))
    slow_speed = largest(prediction.slow_speed)
    sliding = np.where(slow_speed > drives.friction_speed, slow_speed, speed_rms)
    total = noise = None
    if any(deviation is not None for deviation in deviations):
        none = np.full((n_freq, robot.n_axis), np.nan)
        total = np.stack([none if d is None else d.total for d in deviations])
        noise = np.stack([none if d is None else d.noise for d in deviations])
    return Cleared(
        torque=largest(prediction.torque),
        speed=largest(prediction.speed),
        travel=largest(prediction.travel),
        gear_load=largest(prediction.gear_load),
        torque_rms=np.sqrt(mean(prediction.torque_rms**2)),
        friction=friction_level(robot, sliding),
        speed_quantile=np.stack(
            [np.quantile(over_time[g].reshape(-1, robot.n_axis), QUANTILES, axis=0) for g in groups]
        ).astype(np.float64),
        standstill=mean(np.mean(over_time < drives.friction_speed, axis=1)),
        torque_limit=drives.torque_limit,
        motor_gear_load=load_of_motor(robot),
        standstill_speed=drives.friction_speed,
        deviation=total,
        noise_deviation=noise,
        n_simulated=len(own),
    )
