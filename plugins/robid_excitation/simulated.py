"""What the nominal robot does in closed loop under an excitation: peaks, gear loads, speeds, spectra at the lines.

From rest over a start-up and one period, without sensor noise. What is slower than the excited band (gravity, the
slow sine and friction under it) is told apart by Fourier transform: reducing the multisine does not reduce it.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from robid_core import ComplexArray, FloatArray, IntArray, Robot, mean_travel
from robid_core.mechanics.static_laws import law_values
from robid_excitation.gear_load import gear_load

START_UP_S = 1.0  # the drives' loops settle in a few tenths of a second; the start itself is simulated too


@dataclass(frozen=True)
class Prediction:
    """What each simulated experiment does, motor side, each of shape (n_lane, n_axis) if not said otherwise.

    Largest values over the simulated time; `slow_*` is what is left of a peak without the excited band; `upper`
    and `lower` are motor angles in rad, `travel` the largest distance from the configuration.
    """

    torque: FloatArray
    slow_torque: FloatArray
    torque_rms: FloatArray
    """Of the excited band over one period; without lines, about the mean."""
    speed: FloatArray
    slow_speed: FloatArray
    speed_over_time: FloatArray
    """Size of the speed between samples, over one period, single precision, shape (n_lane, n_sample - 1, n_axis)."""
    acceleration: FloatArray
    upper: FloatArray
    lower: FloatArray
    travel: FloatArray
    saturated: FloatArray
    gear_load: FloatArray
    """Joint side."""
    u: ComplexArray
    """Spectra of the torque at the lines, DFT scaled by 1 / n_sample, shape (n_lane, n_freq, n_axis)."""
    y: ComplexArray
    """The same of the motors' acceleration."""


def slow_part(signal: FloatArray, line: IntArray) -> FloatArray:
    """Part of one period below the lowest excited bin, shape (..., n_sample, n_axis); all of it where none is."""
    if not len(line):
        return signal
    spectrum = np.fft.rfft(signal, axis=-2)
    spectrum[..., int(line.min()) :, :] = 0
    result: FloatArray = np.fft.irfft(spectrum, n=signal.shape[-2], axis=-2)
    return result


def motor_speed(position: FloatArray, line: IntArray, sample_time_s: float) -> FloatArray:
    """Speed of motor angles, shape (..., n_sample, n_axis).

    A period is differentiated in frequency, up to twice its highest line; a motion without lines need not close and
    is differentiated in time.
    """
    if not len(line):
        slope: FloatArray = np.gradient(position, sample_time_s, axis=-2)
        return slope
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
        Excited bins; may be empty.
    """
    step, n_sample = robot.sample_time_s, reference.shape[1]
    travel = np.cumsum(reference, axis=1) * step
    start = motor_angle - mean_travel(reference, step)
    n_start = min(n_sample, round(START_UP_S / step))
    whole = np.concatenate([reference, reference[:, :n_start]], axis=1)
    simulation = robot.simulate(whole, robot.joint_angle(start), keep_coordinates=True)
    torque, position = simulation.torque, simulation.position
    coordinates = simulation.coordinates
    assert coordinates is not None
    period_torque = torque[:, n_start:]
    motor = coordinates[:, n_start:, : robot.n_axis]
    speed = np.abs(motor_speed(motor, line, step))
    # A motor that sticks does so for a few samples; a limited band would smooth that away.
    speed_over_time = np.abs(np.diff(motor, axis=1)) / step
    path = np.concatenate([position, start[:, None, :] + travel], axis=1)
    change = np.diff(reference, axis=1, append=reference[:, :1])
    slow_torque = slow_part(period_torque, line)
    fast_torque = period_torque - (slow_torque if len(line) else period_torque.mean(axis=1, keepdims=True))
    second = -((2 * np.pi * line / (n_sample * step)) ** 2)[:, None]
    return Prediction(
        torque=np.abs(torque).max(axis=1),
        slow_torque=np.abs(slow_torque).max(axis=1),
        torque_rms=np.sqrt(np.mean(fast_torque**2, axis=1)),
        speed=np.maximum(speed.max(axis=1), np.abs(reference).max(axis=1)),
        slow_speed=np.abs(slow_part(reference, line)).max(axis=1),
        speed_over_time=speed_over_time.astype(np.float32),
        acceleration=np.abs(change).max(axis=1) / step,
        upper=path.max(axis=1),
        lower=path.min(axis=1),
        travel=np.abs(path - motor_angle[:, None, :]).max(axis=1),
        saturated=simulation.saturated,
        gear_load=np.abs(gear_load(robot, coordinates, torque)).max(axis=1),
        u=np.fft.rfft(period_torque, axis=1)[:, line] / n_sample,
        y=np.fft.rfft(position[:, n_start:], axis=1)[:, line] / n_sample * second,
    )


def joined(parts: list[Prediction]) -> Prediction:
    """Predictions of several groups of experiments as one."""
    names = [field.name for field in fields(Prediction)]
    return Prediction(**{name: np.concatenate([getattr(p, name) for p in parts]) for name in names})


def friction_level(robot: Robot, speed: FloatArray) -> FloatArray:
    """Friction of the motors at given speeds, half the difference between both directions, shape of `speed`.

    Every law at a motor counts, under no load and at its first state: what depends on the place alone cancels.

    Parameters
    ----------
    robot
        The robot.
    speed
        rad/s, shape (..., n_axis).
    """
    level = np.zeros_like(speed)
    unit = np.eye(robot.mechanism.n_coordinate)
    for term in robot.forces:
        for axis in range(robot.n_axis):
            if np.array_equal(term.direction, unit[axis]) and np.array_equal(term.coordinate, unit[axis]):
                for index in np.ndindex(speed.shape[:-1]):
                    v = float(speed[(*index, axis)])
                    both = [law_values(term, np.zeros(1), sign * v)[0][0] for sign in (1.0, -1.0)]
                    level[(*index, axis)] += 0.5 * (both[0] - both[1])
    return level
