"""The references themselves: phases of every configuration and block, drawn or searched, and the slow sine beside.

Phases are uniform (thesis eq. 4.1-4.3), the best of some draws; where asked they are then searched for the lowest
peaks of the reference, or of the torque that the nominal robot needs for it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid_core import ComplexArray, FloatArray, IntArray, Robot
from robid_core.estimation.excitation.crest import Block, minimise_crest, peak_over_rms
from robid_core.estimation.excitation.multisine import draw_phases, low_crest_multisine, multisine, sine


@dataclass(frozen=True)
class PhaseChoice:
    """How the phases of a block are found."""

    n_exp: int
    """Experiments in a block."""
    common: bool
    """No phases of the experiments' own."""
    draws: int
    """Random phases tried, the best taken."""
    search: bool
    """Whether peaks are lowered from there."""


def torque_response(robot: Robot, angle: FloatArray, frequency_hz: FloatArray) -> ComplexArray:
    """Motor torque per speed reference of the nominal closed loop, shape (n_config, n_freq, n_axis, n_axis).

    ``u = C ((k_f + k_p / s) r - (1 + k_p / s) v)``, ``C = K + K_i / s``, ``v = G u / s``, in continuous time and
    without Coulomb friction: good enough to tell where peaks are, not to clear a motion.
    """
    d, s = robot.drives, np.asarray(2j * np.pi * frequency_hz[:, None], dtype=np.complex128)
    controller = d.speed_gain + d.integral_gain / s
    forward = controller * (d.speed_feedforward + d.position_gain / s)
    back = controller * (1.0 + d.position_gain / s)
    loop = back[..., None] * robot.response(angle, frequency_hz) / s[..., None]
    unit = np.eye(robot.n_axis)
    right: ComplexArray = (forward[..., None] * unit)[None]
    result: ComplexArray = np.asarray(np.linalg.solve(unit + loop, right), dtype=np.complex128)
    return result


def torque_crest(fast: FloatArray, response: ComplexArray, line: IntArray) -> FloatArray:
    """Crest factor of each motor's torque, the largest over all experiments, shape (n_axis,).

    Parameters
    ----------
    fast
        Multisines, shape (n_config, n_block, n_exp, n_sample, n_axis).
    response
        From reference to torque at the lines (`torque_response`).
    """
    spectrum = np.fft.rfft(fast, axis=3)
    torque = np.zeros_like(spectrum)
    torque[:, :, :, line] = np.einsum("ckoa,cmeka->cmeko", response, spectrum[:, :, :, line])
    signal = np.fft.irfft(torque, n=fast.shape[3], axis=3)
    return peak_over_rms(signal.reshape(-1, *signal.shape[3:]))


def multisines_of_block(
    amplitude: FloatArray,
    line: IntArray,
    n_sample: int,
    choice: PhaseChoice,
    response: ComplexArray | None,
    generator: np.random.Generator,
) -> FloatArray:
    """One block's multisines, shape (n_exp, n_sample, n_axis).

    `response` (n_freq, n_axis, n_axis) leads to the signals whose peaks a search lowers; None: the references.
    """
    n_exp, common = choice.n_exp, choice.common
    n_freq, n_axis = amplitude.shape
    if not choice.search:
        return low_crest_multisine(amplitude, line, n_sample, choice.draws, generator, n_exp, common)
    block = Block(amplitude, line, n_sample, n_exp, response)
    draws = [draw_phases(n_freq, n_axis, n_exp, common, generator) for _ in range(choice.draws)]
    start = min(draws, key=lambda phases: float(peak_over_rms(block.signals(*phases)).max()))
    return multisine(amplitude, *minimise_crest(block, *start, common), line, n_sample)


def references(
    amplitude: FloatArray,
    sine_amplitude: FloatArray,
    line: IntArray,
    sine_bin: int,
    shape: tuple[int, int, int],
    choice: PhaseChoice,
    response: ComplexArray | None,
    generator: np.random.Generator,
) -> tuple[FloatArray, FloatArray]:
    """Multisines and slow sines of all configurations and blocks.

    The sine's phase is new for each block and axis and the same in the experiments of a block.

    Parameters
    ----------
    amplitude
        Of each line and axis, rad/s, shape (n_freq, n_axis).
    sine_amplitude
        Of each axis, rad/s, shape (n_axis,).
    line, sine_bin
        Excited bins, and the bin of the sine (0: none).
    shape
        (n_config, n_block, n_sample).
    choice
        How phases are found.
    response
        As in `multisines_of_block`, for each configuration.
    generator
        Draws the phases.

    Returns
    -------
    (multisine, sine) in rad/s, shapes (n_config, n_block, n_exp, n_sample, n_axis) and (n_config, n_block, 1,
    n_sample, n_axis).
    """
    (n_config, n_block, n_sample), n_axis = shape, len(sine_amplitude)
    fast = np.empty((n_config, n_block, choice.n_exp, n_sample, n_axis))
    slow = np.zeros((n_config, n_block, 1, n_sample, n_axis))
    for i in range(n_config):
        peaks_of = None if response is None else response[i]
        for m in range(n_block):
            fast[i, m] = multisines_of_block(amplitude, line, n_sample, choice, peaks_of, generator)
            phase = generator.uniform(0.0, 2 * np.pi, n_axis)
            if sine_bin:
                slow[i, m, 0] = sine(sine_amplitude, phase, sine_bin, n_sample)
    return fast, slow
