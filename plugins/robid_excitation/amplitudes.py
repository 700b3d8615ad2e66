"""How large each line is made: the shape of the spectrum for each axis, and the level that the torque limits allow.

The nominal robot below its resonances is an inertia under a speed loop: ``v = r / (1 + i f / f_c)`` (see
`flat_torque_amplitude`). The peaks of the multisine may take a share of each motor's torque limit, less what gravity
and friction need (thesis section 4.2).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robid_core import ConfigurationError, FloatArray, Robot

CREST = 3.2  # peak over root mean square that the best of ten draws of 100 lines has


def inverse_inertia(robot: Robot, angle: FloatArray, frequency_hz: float) -> FloatArray:
    """Acceleration per torque of each motor below the resonances, median over configurations, shape (n_axis,)."""
    response = robot.response(angle, np.array([frequency_hz]))
    median: FloatArray = np.median(np.abs(np.einsum("cfaa->ca", response)), axis=0)
    return median


def crossover_hz(robot: Robot, mobility: FloatArray) -> FloatArray:
    """Bandwidth of each speed loop, shape (n_axis,); ConfigurationError where a drive has none."""
    crossover: FloatArray = robot.drives.speed_gain * mobility / (2 * np.pi)
    if not (crossover > 0).all():
        axis = robot.axis_names[int(np.argmin(crossover))]
        raise ConfigurationError(f"{axis} of {robot.name} has speed_gain 0: no speed reference can excite it")
    return crossover


def speed_of_torque(
    peak_torque: FloatArray,
    inertia: FloatArray,
    frequency_hz: FloatArray,
    speed: FloatArray | None = None,
) -> FloatArray:
    """Root mean square of the speed of multisines with a given peak of torque, shape (n_axis,).

    With a flat torque spectrum each line has the torque amplitude ``peak / (crest sqrt(n_freq / 2))`` and moves the
    motor with it over ``w J``. `speed` (n_freq, n_axis) gives another shape of the speed, in any unit: the root mean
    square of ``w J v`` is the peak over the crest factor.
    """
    omega = 2 * np.pi * frequency_hz
    if speed is None:
        amplitude = peak_torque / (CREST * np.sqrt(0.5 * len(frequency_hz)))
        rms: FloatArray = amplitude / inertia * np.sqrt(0.5 * np.sum(omega**-2.0))
        return rms
    ratio = np.sqrt(np.sum(speed**2, axis=0) / np.sum((omega[:, None] * speed) ** 2, axis=0))
    shaped: FloatArray = peak_torque / (CREST * inertia) * ratio
    return shaped


def torque_peaks(
    robot: Robot, angle: FloatArray, sine_amplitude: FloatArray, share: float, margin: float
) -> FloatArray:
    """Torque that the multisine's peaks may take beside gravity and friction, motor side, shape (n_axis,)."""
    drives = robot.drives
    static = (
        np.abs(robot.gravity_torque(angle)).max(axis=0) + drives.coulomb + drives.viscous * sine_amplitude
    )
    room = 0.85 * (margin * drives.torque_limit - static)
    # Where nothing is left a little is asked for all the same, and the simulation says what is wrong.
    peaks: FloatArray = np.clip(room, 0.02 * drives.torque_limit, share * drives.torque_limit)
    return peaks


def tabulated_weight(frequency_hz: FloatArray, table: Sequence[tuple[float, float]]) -> FloatArray:
    """Factor at each line from a table of (Hz, factor), straight between its rows on logarithmic axes.

    Beyond the ends of the table the factor stays what it is there.
    """
    nodes = np.array(sorted(table), dtype=float)
    result: FloatArray = np.exp(np.interp(np.log(frequency_hz), np.log(nodes[:, 0]), np.log(nodes[:, 1])))
    return result


def reference_shape(spectrum: str, frequency_hz: FloatArray, crossover: FloatArray) -> FloatArray:
    """Shape of the reference's amplitudes, shape (n_freq, n_axis), in any unit.

    flat_torque: ``sqrt(1 + (f / f_c)^2) / f``, the same torque of the motor at every line. flat_speed: 1, and
    flat_acceleration: ``1 / f``, both of the reference itself, which the motor follows up to f_c.
    """
    frequency = frequency_hz[:, None]
    one = np.ones((len(frequency_hz), len(crossover)))
    if spectrum == "flat_speed":
        return one
    if spectrum == "flat_acceleration":
        return one / frequency
    result: FloatArray = np.hypot(1.0, frequency / crossover) / frequency
    return result


def motor_speed_of(amplitude: FloatArray, frequency_hz: FloatArray, crossover: FloatArray) -> FloatArray:
    """Amplitudes of the motors' speed under references, both (n_freq, n_axis), without resonances."""
    result: FloatArray = amplitude / np.hypot(1.0, frequency_hz[:, None] / crossover)
    return result


def scaled_to(
    shape: FloatArray, frequency_hz: FloatArray, crossover: FloatArray, speed_rms: FloatArray
) -> FloatArray:
    """Amplitudes of the reference with that shape under which the motors have these speeds, rad/s.

    Where the shape is that of a flat torque this is `flat_torque_amplitude`.
    """
    speed = motor_speed_of(shape, frequency_hz, crossover)
    result: FloatArray = shape * (speed_rms / np.sqrt(0.5 * np.sum(speed**2, axis=0)))
    return result
