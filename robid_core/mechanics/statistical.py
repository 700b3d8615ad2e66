"""The spring and damper that a small signal sees in a law, under the motion that is already there.

Statistical linearisation: the equivalent gains are E[d force / d position] and E[d force / d velocity] over a
Gaussian motion (multisine and noise) plus a slow sine (J. B. Roberts, P. D. Spanos, Random Vibration and
Statistical Linearization, 1990; S. H. Crandall, Is stochastic equivalent linearization a subtly flawed
procedure?, 2004). A law without memory is integrated by Stein's identity, E[df/dv] = E[f v_gaussian] / rms^2,
so that a jump counts as it should. A law with memory is run along a realisation of the motion, and its force
regressed on the Gaussian part: the best linear approximation.
"""

from __future__ import annotations

import math
from functools import cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from robid_core.arrays import FloatArray
from robid_core.compiled.kernel import kernel
from robid_core.compiled.lanes import LANES
from robid_core.compiled.laws import N_INPUT, N_OUTPUT, Law, entries_of
from robid_core.compiled.views import address_of, call_law, view_of
from robid_core.errors import ConfigurationError, NotTrustworthy
from robid_core.mechanics.law_along import run_law

_REACH = 8.5  # spreads to either side: a Gaussian has 2e-17 outside
_NODES, _NODES_SINE = 8, 5  # Gauss-Legendre on panels of one spread; a sine has more panels and smooths kinks
_SMALLEST_PANEL = 1e-6  # of a spread: panels shrink towards zero speed, where friction changes, down to this
_NARROWEST = 0.0625  # spread over sine amplitude; a narrower Gaussian is extrapolated in its variance

_N_SAMPLE = 2**15  # of a realisation; LANES of them differ in the phase of the sine
_N_SETTLE = 2**13  # samples before that, for the transient
_PER_PERIOD = 24  # samples in a period of the highest line
_BAND = (0.6, 1.4)  # of the frequency in the middle
_SHARE = 0.15  # of the Gaussian power that is around omega, at least
_PROBE = 0.01  # rms speed over sine speed, where there is no Gaussian part
_PROBE_AT_REST = 1e-7  # rad, where nothing moves


class _Motion(NamedTuple):
    velocity_rms: float
    sine_speed: float
    position_bias: float
    position_rms: float
    sine_omega: float
    load: float
    omega: float


def linearize_law(
    law: Law,
    arguments: FloatArray,
    n_state: int,
    *,
    step: float,
    velocity_rms: npt.ArrayLike,
    sine_speed: npt.ArrayLike,
    position_bias: npt.ArrayLike = 0.0,
    position_rms: npt.ArrayLike = 0.0,
    sine_omega: npt.ArrayLike = 0.0,
    load: npt.ArrayLike = 0.0,
    omega: npt.ArrayLike = 0.0,
) -> tuple[FloatArray, FloatArray]:
    """Equivalent stiffness and damping of a law under a Gaussian motion plus a slow sine.

    Velocity and Gaussian position are independent at one instant; the sine moves position and velocity in
    quadrature. Deterministic. Accuracy, relative to the gain: without memory 1e-4 where the law is smooth except at
    zero speed, 1e-3 with kinks elsewhere (worse, 3 % of its slope, for one that lies just at the amplitude of a sine
    beside which the Gaussian part vanishes). With memory it is the scatter of one realisation: 1 %, and 3 % where the
    sine is 30 times as fast as the Gaussian part, or `omega` far from velocity_rms / position_rms (where all Gaussian
    power sits that is not around `omega`); the realisation lasts about 1000 periods of the higher frequency, and
    holds two periods of the sine at least. Limits: without a Gaussian part the gain is that of a vanishing one, and
    where nothing moves at all that of the law's own slopes.

    Parameters
    ----------
    law
        Compiled force law, see `robid_core.effect.ForceEffect`.
    arguments
        What it receives as parameters, shape (n,).
    n_state
        Length of its state; 0 for a law without memory.
    step
        Integration step handed to a law without memory, s; with memory the realisation has its own.
    velocity_rms, position_rms
        Of the Gaussian part, rad/s and rad. For a law with memory one that is 0 follows from the other at `omega`.
    sine_speed, sine_omega
        Amplitude of the slow sine's velocity, rad/s, and its angular frequency, rad/s. At sine_omega = 0 a law
        without memory sees no position of the sine; for one with memory it is taken 20 times slower than `omega`.
    position_bias, load
        Mean position, rad, and mean load, N m.
    omega
        Where the gain of a law with memory is wanted, rad/s; 0 means velocity_rms / position_rms.

    Returns
    -------
    Stiffness in N m/rad and damping in N m s/rad; shape of the broadcast of the fields of the motion.

    Raises
    ------
    ConfigurationError
        If a rms, amplitude or frequency is negative or not finite, or a law with memory is given no frequency.
    NotTrustworthy
        If the law returns not-a-number somewhere within the motion.
    """
    given = (velocity_rms, sine_speed, position_bias, position_rms, sine_omega, load, omega)
    fields = np.broadcast_arrays(*(np.asarray(field, dtype=np.float64) for field in given))
    rows, back = np.unique(np.stack([f.ravel() for f in fields], axis=-1), axis=0, return_inverse=True)
    parameters = np.append(np.asarray(arguments, dtype=np.float64), 0.0)  # never empty
    name = getattr(law, "__name__", "law")
    entry = entries_of(law, "force", n_state, name).lanes
    gains = np.empty((len(rows), 2))
    for gain, row in zip(gains, rows, strict=True):
        motion = _Motion(*map(float, row))
        _refuse_impossible(motion, n_state)
        if n_state:
            gain[:] = _gain_with_memory(entry, parameters, n_state, motion)
        else:
            gain[:] = _gain_without_memory(entry, parameters, step, motion)
    if np.any(np.isnan(gains)):
        raise NotTrustworthy(
            f"linearisation: the law '{name}' returns not-a-number within the motion; guard its divisions and roots"
        )
    stiffness, damping = gains[back.ravel()].T.reshape(2, *fields[0].shape)
    return stiffness, damping


def _refuse_impossible(motion: _Motion, n_state: int) -> None:
    for name, value in motion._asdict().items():
        signed = name in ("position_bias", "load")
        if not math.isfinite(value) or (value < 0 and not signed):
            raise ConfigurationError(
                f"linearisation: {name} is {value:g}; give a finite number"
                + ("" if signed else " that is not negative")
            )
    if n_state and not motion.omega and not (motion.velocity_rms and motion.position_rms):
        raise ConfigurationError(
            "linearisation: the gain of a law with memory depends on frequency and none is given; set omega (of "
            "`equivalent_motor_damping`: frequency_hz), or both velocity_rms and position_rms"
        )


# Without memory: quadrature ------------------------------------------------------------------------------------


def _gain_without_memory(entry: int, arguments: FloatArray, step: float, motion: _Motion) -> FloatArray:
    """Stiffness and damping, extrapolated to the true spreads where the sine is much wider than the Gaussian."""
    sine = np.array([motion.sine_speed / motion.sine_omega if motion.sine_omega else 0.0, motion.sine_speed])
    variance = np.array([motion.position_rms, motion.velocity_rms]) ** 2
    missing = np.maximum((_NARROWEST * sine) ** 2 - variance, 0.0)
    gain = _mean_slopes(entry, arguments, step, motion, sine, np.sqrt(variance + missing))
    if np.any(missing):
        # Arcsine and Gaussian have the density (1 + s^2 / 2 + 9 s^4 / 8) / pi at zero: s^4 costs 3e-5 at s = 1 / 16.
        gain = 2 * gain - _mean_slopes(entry, arguments, step, motion, sine, np.sqrt(variance + 2 * missing))
    return gain


def _mean_slopes(
    entry: int, arguments: FloatArray, step: float, motion: _Motion, sine: FloatArray, spread: FloatArray
) -> FloatArray:
    """E[slope in position], E[slope in velocity]; `sine` and `spread` of position and velocity."""
    # The density at a phase has harmonics up to 4 sine / spread or so; the mean over n phases is exact below n.
    n_phase = 32 + math.ceil(8 * np.max(np.divide(sine, spread, out=np.zeros(2), where=sine > 0)))
    phase = 2 * np.pi / n_phase * np.arange(n_phase)
    position, in_position, stein_position = _weights(spread[0], sine[0] * np.sin(phase), towards_zero=False)
    velocity, in_velocity, stein_velocity = _weights(spread[1], sine[1] * np.cos(phase), towards_zero=True)
    force, slope_position, slope_velocity = _on_grid(
        entry, arguments, step, motion.position_bias + position, velocity, motion.load
    )
    stiffness = np.sum((stein_position.T @ in_velocity) * (force if spread[0] else slope_position))
    damping = np.sum((in_position.T @ stein_velocity) * (force if spread[1] else slope_velocity))
    return np.array([stiffness, damping]) / len(phase)


def _weights(
    spread: float, centre: FloatArray, *, towards_zero: bool
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Nodes (n,), and weights (n_phase, n) for the mean and for the mean slope of a function about each centre."""
    if spread == 0:
        one = np.ones((len(centre), 1))
        return np.zeros(1), one, one
    end = float(np.abs(centre).max()) + _REACH * spread
    n = math.ceil(end / spread)
    edge = np.arange(-n, n + 1) * (end / n)
    if towards_zero:
        small = end / n / 3.0 ** np.arange(1, math.log(1 / _SMALLEST_PANEL, 3))
        edge = np.sort(np.concatenate((edge, small, -small)))
    point, weight = np.polynomial.legendre.leggauss(_NODES_SINE if np.any(centre) else _NODES)
    width = np.diff(edge)[:, None]
    node = (edge[:-1, None] + width * (1 + point) / 2).ravel()
    deviation = (node - centre[:, None]) / spread
    mean = np.exp(-0.5 * deviation**2) * (width * weight / 2).ravel() / (spread * math.sqrt(2 * math.pi))
    return node, mean, mean * deviation / spread


def _on_grid(
    entry: int, arguments: FloatArray, step: float, position: FloatArray, velocity: FloatArray, load: float
) -> FloatArray:
    """Force and its slopes, shape (3, n_position, n_velocity)."""
    shape = (len(position) * len(velocity), 1)
    inputs, outputs = np.empty((N_INPUT, *shape)), np.empty((N_OUTPUT, *shape))
    inputs[0, :, 0] = np.repeat(position, len(velocity))
    inputs[1, :, 0] = np.tile(velocity, len(position))
    inputs[2] = load
    run_law(entry, inputs, outputs, np.empty((len(outputs[0]), 0)), arguments, step)
    return outputs.reshape(N_OUTPUT, len(position), len(velocity))


# With memory: a realisation of the motion --------------------------------------------------------------------------


def _gain_with_memory(
    entry: int, arguments: FloatArray, n_state: int, motion: _Motion
) -> tuple[float, float]:
    """Gain at omega by regression of the force on the Gaussian part, in periodic steady state."""
    omega, position_rms, velocity_rms = _complete(motion)
    small = _SHARE * min(velocity_rms, omega * position_rms) ** 2  # speed variance around omega
    rest = np.array([position_rms**2 - small / omega**2, velocity_rms**2 - small])
    body = math.sqrt(rest[1] / rest[0])
    spacing = _BAND[1] * max(omega, body, motion.sine_omega) / (_N_SAMPLE // _PER_PERIOD)
    frequency: FloatArray = spacing * np.arange(_N_SAMPLE // 2 + 1, dtype=np.float64)
    power = _band(frequency, omega) * small / omega**2 + _band(frequency, body) * rest[0]
    spectrum = np.sqrt(power / 2) * _N_SAMPLE * _phasors()
    gaussian = np.fft.irfft(np.stack((spectrum, 1j * frequency * spectrum)))
    # The sine is on an even line: its harmonics, and what they make with one another, miss the odd lines. The lanes
    # spread its phase over half a turn: what it makes of one odd line at another, cancels in their mean up to its
    # 2 LANES-th harmonic (with a symmetric law).
    line = max(2, 2 * round((motion.sine_omega or omega / 20) / spacing / 2))
    turn = np.exp(2j * np.pi * line / _N_SAMPLE * np.arange(_N_SAMPLE))
    shift = np.exp(1j * np.pi / LANES * np.arange(LANES))
    size = np.array(
        [motion.sine_speed / (line * spacing), motion.sine_speed, motion.position_bias, motion.load]
    )
    force = np.empty(_N_SAMPLE)
    state = np.zeros((2, n_state, LANES))
    _follow(entry, gaussian, turn, shift, size, state, arguments, 2 * np.pi / (spacing * _N_SAMPLE), force)
    return _regress(np.fft.rfft(force), spectrum, frequency, omega)


@kernel
def _follow(entry, gaussian, turn, shift, size, state, arguments, step, force):  # type: ignore[no-untyped-def]
    """Mean force over the lanes (n_sample,) along a Gaussian motion (2, n_sample) and a sine, once settled."""
    n_sample = force.shape[0]
    place = np.empty((6, LANES))
    rows, constants, before, after = view_of(place), view_of(arguments), view_of(state[0]), view_of(state[1])
    for sample in range(-_N_SETTLE, n_sample):
        now = sample % n_sample
        for lane in range(LANES):
            sine = turn[now] * shift[lane]
            place[0, lane] = size[2] + gaussian[0, now] + size[0] * sine.imag
            place[1, lane] = gaussian[1, now] + size[1] * sine.real
            place[2, lane] = size[3]
        inputs = address_of(rows, 0)
        call_law(entry, inputs, address_of(before, 0), address_of(after, 0), address_of(constants, 0), step)
        state[0] = state[1]
        force[now] = 0.0
        for lane in range(LANES):
            force[now] += place[3, lane] / LANES


def _complete(motion: _Motion) -> tuple[float, float, float]:
    """Frequency, position and velocity rms, with what the motion leaves open."""
    position, velocity = motion.position_rms, motion.velocity_rms
    omega = motion.omega or velocity / position
    if not position and not velocity:
        velocity = _PROBE * motion.sine_speed or _PROBE_AT_REST * omega
    return omega, position or velocity / omega, velocity or position * omega


def _band(frequency: FloatArray, middle: float) -> FloatArray:
    """Share of each odd line in a flat position spectrum whose speed over position rms is `middle`."""
    low, high = _BAND
    centre = middle / math.sqrt((high**3 - low**3) / (3 * (high - low)))
    inside = (frequency >= low * centre) & (frequency <= high * centre)
    inside[0::2] = False
    return inside.astype(np.float64) / max(1, int(np.count_nonzero(inside)))


@cache
def _phasors() -> npt.NDArray[np.complex128]:
    """Random phases of the lines, the same for every call."""
    phasors: npt.NDArray[np.complex128] = np.exp(
        2j * np.pi * np.random.default_rng(0).random(_N_SAMPLE // 2 + 1)
    )
    return phasors


def _regress(
    force: npt.NDArray[np.complex128],
    spectrum: npt.NDArray[np.complex128],
    frequency: FloatArray,
    omega: float,
) -> tuple[float, float]:
    """Gain at omega of force = (a + b (frequency - omega)) spectrum, by least squares over the lines around omega."""
    near = (np.abs(spectrum) > 0) & (np.abs(frequency - omega) < (_BAND[1] - 1) * omega)
    model = spectrum[near, None] * (frequency[near, None] / omega - 1) ** np.arange(2)
    adjoint = model.conj().T
    gain = np.linalg.solve(adjoint @ model, adjoint @ force[near])[0]
    return float(gain.real), float(gain.imag) / omega
