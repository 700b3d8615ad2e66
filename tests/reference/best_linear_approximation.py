"""Best linear approximation by brute force: noise-free closed loop, averaged over realisations of the phases.

``G_BLA = E[Y R^-1] E[U R^-1]^-1`` with U, Y, R the spectra of motor torque, motor acceleration and speed reference of
a block of as many orthogonal experiments as axes (Pintelon and Schoukens 2012, section 3.4; Dobrowiecki and Schoukens
2007). What is left of a block, ``V = Y - G_BLA U``, is the stochastic distortion; its scatter over realisations gives
the standard error of the average, and the distortion that any measurement with this excitation has.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
import numpy.typing as npt
from reference.excitation_class import ExcitationClass

from robid_core import Robot, mean_travel

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class Moments:
    """Sums over the realisations of one batch or of several; add them up, in order, for the same bytes."""

    n_realization: int
    n_batch: int
    """Each batch's residuals are about its own average and lose a degree of freedom."""
    y: ComplexArray
    """Sum of Y R^-1, shape (n_freq, n_axis, n_axis)."""
    u: ComplexArray
    """Sum of U R^-1."""
    gram: ComplexArray
    """Sum of U U^H."""
    scatter: FloatArray
    """Sum of |V R^-1 E[U R^-1]^-1|^2, entry by entry."""
    residual: ComplexArray
    """Sum of V V^H."""

    def __add__(self, other: Moments) -> Moments:
        """Put two sets of realisations together."""
        return Moments(*(getattr(self, f.name) + getattr(other, f.name) for f in fields(self)))

    @property
    def freedom(self) -> int:
        """Complex degrees of freedom of `scatter` (blocks)."""
        return self.n_realization - self.n_batch

    @property
    def response(self) -> ComplexArray:
        """G_BLA, (rad/s^2)/(N m), shape (n_freq, n_axis, n_axis)."""
        return response_of(self.y, self.u)

    @property
    def block_variance(self) -> FloatArray:
        """Variance of each entry (real and imaginary part together) that distortion gives one block's response."""
        return self.scatter / self.freedom

    @property
    def variance(self) -> FloatArray:
        """Variance of each entry of G_BLA."""
        return self.block_variance / self.n_realization

    @property
    def distortion(self) -> ComplexArray:
        """Covariance of V of one experiment, (rad/s^2)^2, DFT scaled by 1/n_sample, shape (n_freq, n_axis, n_axis)."""
        n_exp = self.u.shape[-1]
        result: ComplexArray = self.residual / (n_exp * self.freedom)
        return result

    @property
    def input_gram(self) -> ComplexArray:
        """E[U U^H] of one block, (N m)^2, shape (n_freq, n_axis, n_axis)."""
        result: ComplexArray = self.gram / self.n_realization
        return result


def response_of(y: ComplexArray, u: ComplexArray) -> ComplexArray:
    """``Y U^-1`` at each line."""
    return np.linalg.solve(u.swapaxes(-1, -2), y.swapaxes(-1, -2)).swapaxes(-1, -2).astype(np.complex128)


def moments_of(u: ComplexArray, y: ComplexArray, r: ComplexArray) -> Moments:
    """Moments of one batch.

    Parameters
    ----------
    u, y, r
        Spectra, shape (n_realization, n_freq, n_axis, n_exp), n_exp = n_axis, two realisations or more.
    """
    inverse = np.linalg.inv(r)
    y_r, u_r = y @ inverse, u @ inverse
    mean_u = u_r.mean(axis=0)
    residual = y - response_of(y_r.mean(axis=0), mean_u) @ u
    entries = residual @ inverse @ np.linalg.inv(mean_u)
    return Moments(
        len(u),
        1,
        y_r.sum(axis=0),
        u_r.sum(axis=0),
        (u @ u.conj().swapaxes(-1, -2)).sum(axis=0),
        np.sum(np.abs(entries) ** 2, axis=0),
        (residual @ residual.conj().swapaxes(-1, -2)).sum(axis=0),
    )


@dataclass(frozen=True, eq=False)
class Batch:
    """Spectra of some realisations, and the motion they were taken under."""

    u: ComplexArray
    """N m, DFT scaled by 1/n_sample, shape (n_realization, n_freq, n_axis, n_exp)."""
    y: ComplexArray
    """rad/s^2."""
    r: ComplexArray
    """rad/s."""
    speed_rms: FloatArray
    """Of the motors without the slow sine, rad/s, shape (n_axis,)."""
    sine_speed: FloatArray
    """Amplitude of the slow sine, rad/s, shape (n_axis,)."""
    saturated: float
    """Largest share of samples of a motor and experiment at the torque limit."""
    off_pose: float
    """Largest distance of an experiment's mean motor angle from the pose, joint side, rad."""


def simulated_batch(
    robot: Robot,
    pose: FloatArray,
    excitation: ExcitationClass,
    seed: np.random.SeedSequence,
    realization: range,
    *,
    settle_s: float,
    n_thread: int = 1,
    noise_seed: int | None = None,
) -> Batch:
    """Simulate realisations of an excitation class in one pose.

    The motors start at rest where the motion has the pose in its middle (`Excitation.start_offset`), and the period
    that is kept begins `settle_s` after that.

    Parameters
    ----------
    seed, realization
        Realisation m has the child of `seed` with key m, whatever batch it comes in.
    noise_seed
        Draws the robot's sensor noise; None: none.
    """
    period, n_axis, step = excitation.n_sample, robot.n_axis, robot.sample_time_s
    chances = [
        np.random.default_rng(np.random.SeedSequence(seed.entropy, spawn_key=(*seed.spawn_key, m)))
        for m in realization
    ]
    drawn = [excitation.block(chance) for chance in chances]
    fast = np.stack([block for block, _ in drawn])
    reference = (fast + np.stack([slow for _, slow in drawn])[:, None]).reshape(-1, period, n_axis)
    # From the period's beginning, as a measurement does: where it starts decides the torque that the integrators hold,
    # and so the mean angle. Any period after `n_settle` samples will do.
    start = robot.motor_angle(pose) - mean_travel(reference, step)
    n_settle = round(settle_s / step)
    whole = np.concatenate([reference] * -(-(n_settle + period) // period), axis=1)[:, : n_settle + period]
    result = robot.simulate(whole, robot.joint_angle(start), noise_seed, n_thread=n_thread)
    position, torque = (np.roll(s[:, n_settle:], n_settle, axis=1) for s in (result.position, result.torque))
    omega = 2 * np.pi * excitation.frequency_hz

    def at_lines(spectrum: ComplexArray) -> ComplexArray:
        by_block = spectrum[:, excitation.line].reshape(len(realization), -1, len(omega), n_axis)
        return np.ascontiguousarray(by_block.transpose(0, 2, 3, 1))

    u, q, r = (
        np.fft.rfft(signal, axis=1) / period for signal in (torque, position, fast.reshape(reference.shape))
    )
    return Batch(
        at_lines(u),
        at_lines(q) * -(omega[:, None, None] ** 2),
        at_lines(r),
        *motor_speeds(q, excitation),
        float(result.saturated.max()),
        float(np.abs(robot.joint_angle(q[:, 0].real) - pose).max()),
    )


def motor_speeds(q: ComplexArray, excitation: ExcitationClass) -> tuple[FloatArray, FloatArray]:
    """Root mean square of the motors' speed without the slow sine, and amplitude of that, rad/s, each (n_axis,).

    From spectra of the angle, DFT scaled by 1 / n_sample, shape (n_lane, n_bin, n_axis); up to twice the highest line.
    """
    last = min(2 * int(excitation.line.max()), excitation.n_sample // 2)
    omega = 2 * np.pi * np.arange(last + 1) / (excitation.n_sample * excitation.sample_time_s)
    power = 2 * np.mean(np.abs(q[:, : last + 1] * omega[:, None]) ** 2, axis=0)
    amplitude: FloatArray = np.sqrt(2 * power[excitation.sine_bin])  # bin 0 has no speed
    power[excitation.sine_bin] = 0.0
    return np.sqrt(power.sum(axis=0)), amplitude


def transient_left(
    robot: Robot,
    pose: FloatArray,
    excitation: ExcitationClass,
    seed: np.random.SeedSequence,
    batch: Batch,
    moments: Moments,
    *,
    settle_s: float,
) -> float:
    """What the start still moves in the period that is kept, as a share of the distortion.

    Three realisations of the first `batch` (with its `moments`) are simulated on for another period; root mean square
    of ``V - V'`` over their experiments, over that of V as `moments` have it; over lines and axes.
    """
    n = min(3, len(batch.u))
    later = simulated_batch(
        robot,
        pose,
        excitation,
        seed,
        range(n),
        settle_s=settle_s + excitation.n_sample * excitation.sample_time_s,
    )
    change = (batch.y[:n] - later.y) - moments.response @ (batch.u[:n] - later.u)
    distortion = np.einsum("fii->fi", moments.distortion).real
    with np.errstate(divide="ignore", invalid="ignore"):  # a linear plant has none
        return float(np.sqrt(np.mean(np.mean(np.abs(change) ** 2, axis=(0, -1)) / distortion)))
