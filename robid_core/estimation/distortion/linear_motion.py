"""Speed of a linear robot in its loop, under the references of a measurement and under others like them.

Friction's law is evaluated on it beside the measured speed; see `equivalent_gain`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid_core.arrays import ComplexArray, FloatArray, IntArray


@dataclass(frozen=True)
class LinearMotion:
    """Spectra of motor speeds, rad/s, scaled by 1/n_sample, from bin zero to the highest line.

    `own` (n_exp, n_bin, n_axis) under the measurement's references; `drawn` (n_drawn, n_bin, n_axis) under references
    of the same amplitudes and random phases, of which `drawn_reference` (n_drawn, n_freq, n_axis) are the lines.
    """

    own: ComplexArray
    drawn: ComplexArray
    drawn_reference: ComplexArray


def loop_response(
    response: ComplexArray, drive: ComplexArray, feedback: ComplexArray, frequency_hz: FloatArray
) -> ComplexArray:
    """Motor speed over reference of a robot under feedback, ``(I + G F)^-1 G D / (i w)``.

    Parameters
    ----------
    response
        G, torque to acceleration, shape (n_freq, n_axis, n_axis).
    drive, feedback
        D, torque that the reference of an axis asks for, and F, ``u = d - F y`` of its acceleration y, both
        (n_freq, n_axis); `estimation.response.controller` gives them.
    frequency_hz
        Positive, shape (n_freq,).
    """
    identity = np.eye(response.shape[-1])
    closed = np.linalg.solve(identity + response * feedback[:, None, :], response * drive[:, None, :])
    result: ComplexArray = closed / (2j * np.pi * frequency_hz)[:, None, None]
    return result


def random_phases(spectrum: ComplexArray, count: int, generator: np.random.Generator) -> ComplexArray:
    """Spectra (count, n_bin, n_axis) with the amplitudes of given ones (n_exp, n_bin, n_axis), which take turns.

    Every bin and axis has a phase of its own; bin zero is zero.
    """
    n_exp, n_bin, n_axis = spectrum.shape
    size = np.abs(spectrum)
    size[:, 0] = 0.0
    phase = generator.uniform(0.0, 2 * np.pi, (count, n_bin, n_axis))
    result: ComplexArray = size[np.arange(count) % n_exp] * np.exp(1j * phase)
    return result


def linear_motion(
    loop: ComplexArray, reference: ComplexArray, line: IntArray, count: int, generator: np.random.Generator
) -> LinearMotion:
    """Motion of a loop at rest about a configuration.

    Parameters
    ----------
    loop
        Reference to speed at bins 1, 2, ... up to the highest line, shape (n_bin - 1, n_axis, n_axis).
    reference
        Spectra of the references from bin zero to the highest line, (n_exp, n_bin, n_axis).
    line
        Excited bins, shape (n_freq,).
    count
        References drawn.
    """

    def moved(references: ComplexArray) -> ComplexArray:
        speed = np.zeros_like(references)
        speed[:, 1:] = (loop @ references[:, 1:, :, None])[..., 0]
        return speed

    others = random_phases(reference, count, generator)
    return LinearMotion(moved(reference), moved(others), others[:, line])
