"""Waves of the motor's angle in the torque residual: ripple of torque and resolver by order, after thesis 3.1.3.

A motor with ripple accelerates under the torque ``u + d``, u the measured one, and has the angle ``q - e``, q measured:

    d = sum_n a_n cos(n q) + b_n sin(n q)                       "cogging": slots, offsets of the current measurement
      + u sum_n a_n cos(n q) + b_n sin(n q)                     "current": harmonics of flux and current
    e = sum_n a_n cos(n q) + b_n sin(n q)                       "resolver": offsets, unequal windings

With H torque over acceleration (`torque_residual`): ``U + D = H (Y - (i w)^2 E) + friction``. The order n is fixed to
the angle; in time the same wave is everywhere and aliases. A position error weighs with ``w^2 H`` and a torque does
not, which tells the two apart at one order, unless the wave is slow beside the lines: then a resolver's ripple is a
torque ripple of n times its size, in proportion to the current. Friction is many times larger and a function of the
speed: a family of odd and even shapes over the measured speed is a nuisance, fitted beside the waves.

Here are the waves, the rows of the least-squares problem of one motor and configuration, and the correction;
`ripple_search` chooses the orders.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from robid_core.arrays import ComplexArray, FloatArray, IntArray
from robid_core.estimation.distortion.torque_residual import MotionBasis, motion_basis, torque_residual

Kind = Literal["cogging", "current", "resolver"]
KINDS: tuple[Kind, ...] = ("cogging", "current", "resolver")
Wave = tuple[Kind, float]
"""A kind of ripple and its order, periods per turn of the motor."""

# Shapes of friction over speed, as shares of the root mean square speed: from a jump to almost a straight line.
FRICTION_SCALES = (0.01, 0.03, 0.1, 0.3, 1.0)
FINER = 4  # parts of a step over which a torque that depends on the speed is averaged
HALF_WINDOW = 8  # bins of a class on either side that share a deviation


@dataclass(frozen=True, eq=False)
class MotorData:
    """One motor in one configuration: experiments of all blocks side by side, periods averaged.

    A motor that drifts by D from the first period to the last blurs a wave of order n by (n D)^2 / 24 of its size.
    """

    angle: FloatArray
    """rad at the motor, measured, shape (n_exp, n_sample)."""
    torque: FloatArray
    """N m at the motor, measured, same shape."""
    bins: IntArray
    """Bins of the analysis, shape (n_bin,)."""
    sample_time_s: float
    """Time between samples."""
    held: bool
    """Whether the torque is held from a sample to the next: then it meets the mean of a wave over that time."""
    basis: MotionBasis
    """Accelerations of all motors."""
    inertia: ComplexArray
    """Torque of this motor over its own acceleration at each bin, the others at rest (H_jj), shape (n_bin,)."""

    @property
    def omega(self) -> FloatArray:
        """rad/s of the bins, shape (n_bin,)."""
        result: FloatArray = self.bins * (2 * np.pi / (self.angle.shape[-1] * self.sample_time_s))
        return result

    @property
    def turns(self) -> float:
        """How far the motor moves, in turns."""
        return float(np.ptp(self.angle)) / (2 * np.pi)

    def spectrum(self, period: FloatArray) -> ComplexArray:
        """DFT at the bins, scaled by 1/n_sample: (n_exp, n_sample) to (n_exp, n_bin)."""
        result: ComplexArray = np.fft.rfft(period, axis=-1)[:, self.bins] / period.shape[-1]
        return result


def motors_of(
    angle: FloatArray, torque: FloatArray, line: IntArray, bins: IntArray, sample_time_s: float, held: bool
) -> list[MotorData]:
    """All motors of one configuration.

    Parameters
    ----------
    angle, torque
        rad and N m at the motors, shape (n_exp, n_period, n_sample, n_axis), periods in steady state.
    line
        Excited bins, shape (n_freq,).
    bins
        Bins of the analysis, ascending, shape (n_bin,).
    held
        Whether torque is held from a sample to the next.

    Raises
    ------
    PoorExcitation
        As `motion_basis`.
    """
    q, u = (x.mean(axis=1) for x in (angle, torque))
    n_sample = q.shape[1]
    omega = 2 * np.pi * bins / (n_sample * sample_time_s)
    angles, torques = (np.fft.rfft(x, axis=1)[:, bins] / n_sample for x in (q, u))
    basis = motion_basis(-angles * omega[:, None] ** 2, line, bins)
    relation = basis.relation(torques)
    return [
        MotorData(
            np.ascontiguousarray(q[..., axis]),
            np.ascontiguousarray(u[..., axis]),
            bins,
            sample_time_s,
            held,
            basis,
            relation[:, axis, axis],
        )
        for axis in range(q.shape[-1])
    ]


def wave_at_samples(angle: FloatArray, order: float) -> tuple[FloatArray, FloatArray]:
    """Cosine and sine of ``order angle``: what a sensor that is read at an instant meets."""
    return np.cos(order * angle), np.sin(order * angle)


def wave_over_steps(angle: FloatArray, order: float) -> tuple[FloatArray, FloatArray]:
    """Mean of cosine and sine of ``order angle`` from each sample to the next: what a torque held that long meets.

    The angle runs straight between samples; after the last it goes on as at the beginning of the period, which is
    right where the motion closes. Samples are the last axis.
    """
    following = np.roll(angle, -1, axis=-1)
    mean = np.sinc((0.5 * order / np.pi) * (following - angle))
    middle = 0.5 * order * (following + angle)
    return mean * np.cos(middle), mean * np.sin(middle)


def torque_wave(angle: FloatArray, order: float, held: bool) -> tuple[FloatArray, FloatArray]:
    """Cosine and sine as a torque meets them, held between samples or not."""
    return wave_over_steps(angle, order) if held else wave_at_samples(angle, order)


def ripple_columns(data: MotorData, order: float, kinds: tuple[Kind, ...]) -> list[ComplexArray]:
    """Change of the measured torque by cosine and sine of unit size at one order, (n_exp, n_bin, 2) for each kind."""
    columns: list[ComplexArray] = []
    torque_pair = None
    for kind in kinds:
        if kind == "resolver":
            pair = wave_at_samples(data.angle, order)
            weight = data.inertia * data.omega**2  # -H (i w)^2
        else:
            torque_pair = pair = torque_pair or torque_wave(data.angle, order, data.held)
            weight = np.full(len(data.bins), -1.0 + 0.0j)
            if kind == "current":
                pair = pair[0] * data.torque, pair[1] * data.torque
        columns.append(np.stack([data.spectrum(one) for one in pair], axis=-1) * weight[:, None])
    return columns


def friction_columns(data: MotorData) -> ComplexArray:
    """Shapes of friction over the measured speed, shape (n_exp, n_bin, n_shape).

    Odd ones, tanh of the speed over scales from a jump to a bend, and even ones for asymmetry.
    """
    speed = speed_in_steps(data)
    scale = max(float(np.sqrt(np.mean(speed**2))), 1e-300)
    shapes = [np.tanh(speed / (share * scale)) for share in FRICTION_SCALES]
    shapes += [
        np.abs(speed) / scale,
        (speed / scale) ** 2,
        np.tanh(speed / (FRICTION_SCALES[0] * scale)) ** 2,
    ]
    return np.stack([data.spectrum(shape.mean(axis=-1)) for shape in shapes], axis=-1)


def speed_in_steps(data: MotorData) -> FloatArray:
    """Speed at `FINER` instants within each step, rad/s, shape (n_exp, n_sample, FINER); at the samples if not held.

    From the angle by differentiation in frequency, up to twice the highest bin: beyond is the
    noise of the sensor. A torque that is held meets the mean of the friction until the next sample; friction taken at
    the sample comes half a step early, which at 20 Hz and 1 kHz is a sixteenth of it.
    """
    n_sample = data.angle.shape[-1]
    last = min(2 * int(data.bins[-1]), (n_sample - 1) // 2)
    omega = np.arange(last + 1) * (2 * np.pi / (n_sample * data.sample_time_s))
    finer = FINER if data.held else 1
    later = 0.5 * data.sample_time_s / finer if data.held else 0.0  # the middle of each part
    spectrum = np.fft.rfft(data.angle, axis=-1)[:, : last + 1] * (1j * omega * np.exp(1j * omega * later))
    speed: FloatArray = finer * np.fft.irfft(spectrum, finer * n_sample, axis=-1)
    return speed.reshape(len(data.angle), n_sample, finer)


def residuals(data: MotorData, waves: tuple[Wave, ...]) -> ComplexArray:
    """Residuals of the waves' columns, shape (n_exp, n_bin, 2 n_wave)."""
    if not waves:
        return np.zeros((*data.basis.motion.shape[:2], 0), dtype=np.complex128)
    columns: dict[Wave, ComplexArray] = {}
    for order in dict.fromkeys(order for _, order in waves):
        kinds = tuple(kind for kind in KINDS if (kind, order) in waves)
        for kind, column in zip(kinds, ripple_columns(data, order, kinds), strict=True):
            columns[kind, order] = torque_residual(column, data.basis)
    return np.concatenate([columns[wave] for wave in waves], axis=-1)


def torque_and_friction(data: MotorData) -> ComplexArray:
    """Residuals of the measured torque, first, and of the shapes of friction: (n_exp, n_bin, 1 + n_shape)."""
    torque = data.spectrum(data.torque)[..., None]
    return torque_residual(np.concatenate([torque, friction_columns(data)], axis=-1), data.basis)


def unexplained(rows: ComplexArray, data: MotorData) -> tuple[ComplexArray, FloatArray]:
    """First column without what the others explain of it, and the deviation of that at each bin.

    Weighted least squares, twice: by rows of equal weight, then by the deviation that this leaves. Shapes (n_exp,
    n_bin) and (n_bin,), N m.
    """
    deviation: FloatArray = np.where(data.basis.usable, 1.0, np.inf)
    left = rows[..., 0]
    for _ in range(2):
        real = stacked(rows, deviation)
        coefficients = np.linalg.lstsq(real[:, 1:], real[:, 0])[0]
        left = rows[..., 0] - rows[..., 1:] @ coefficients
        deviation = deviation_of(left, data)
    return left, deviation


def deviation_of(residual: ComplexArray, data: MotorData) -> FloatArray:
    """Standard deviation of a residual (n_exp, n_bin) at each bin, N m, shape (n_bin,); infinite: not to be used.

    Friction, and a pose that sways, put different amounts on excited, odd and even bins, so that each class has its
    own: the mean square over experiments and `HALF_WINDOW` bins of the class on either side.
    """
    power = np.sum(np.abs(residual) ** 2, axis=0)
    freedom = data.basis.freedom
    variance = np.full(len(power), np.inf)
    window = np.ones(2 * HALF_WINDOW + 1)
    for members in (data.basis.excited, ~data.basis.excited & (data.bins % 2 == 0), data.bins % 2 == 1):
        own = np.flatnonzero(members & (freedom > 0) & np.isinf(variance))
        if len(own):
            sums = [np.convolve(x[own], window)[HALF_WINDOW:-HALF_WINDOW] for x in (power, freedom)]
            variance[own] = sums[0] / sums[1]
    # A record without noise leaves rounding errors: they shall not weigh without bound.
    floor = 1e-20 * float(np.mean(np.abs(data.spectrum(data.torque)) ** 2))
    deviation: FloatArray = np.sqrt(np.maximum(variance, max(floor, 1e-300)))
    return deviation


def stacked(columns: ComplexArray, deviation: FloatArray) -> FloatArray:
    """Real and imaginary parts over their deviation, all rows below one another: (2 n_exp n_bin, n_column)."""
    scaled = (columns * (np.sqrt(2.0) / deviation)[:, None]).reshape(-1, columns.shape[-1])
    return np.concatenate([scaled.real, scaled.imag])


def compensated(
    angle: FloatArray, torque: FloatArray, found: list[tuple[Wave, float, float]], held: bool
) -> tuple[FloatArray, FloatArray]:
    """Angle and torque without ripple, ``q - e`` and ``u + d``.

    Parameters
    ----------
    angle, torque
        rad and N m of one motor, measured, samples of a period last.
    found
        Waves with the size of their cosine and sine.
    held
        Whether the torque is held from a sample to the next.
    """
    true_angle, acting = angle.copy(), torque.copy()
    for (kind, order), cosine, sine in found:
        if kind == "resolver":
            c, s = wave_at_samples(angle, order)
            true_angle -= cosine * c + sine * s
        else:
            c, s = torque_wave(angle, order, held)
            wave = cosine * c + sine * s
            acting += wave * torque if kind == "current" else wave
    return true_angle, acting
