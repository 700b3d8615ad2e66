"""One period of a record beside the model's steady state under the torques that were measured.

At the excited lines the acceleration of a linear model is ``Y(k) = G(k) U(k)``; over one period that is a signal. What
is not at these lines (the slow sine, distortion between them) is in neither of the two.
"""

from __future__ import annotations

import numpy as np

from robid_core import (
    BoolArray,
    ComplexArray,
    DataRejected,
    FloatArray,
    Record,
    ResponseComparison,
    TimeComparison,
)


def spectra_of(record: Record | None, frequency_hz: FloatArray) -> tuple[ComplexArray, ComplexArray] | None:
    """Torque and acceleration at the lines, (n_config, n_block, n_freq, n_axis, n_exp), if the record has them."""
    if record is None or record.line is None or len(record.runs) != 1:
        return None
    own = record.frequency_hz
    if len(own) != len(frequency_hz) or not np.allclose(own, frequency_hz, rtol=1e-9):
        return None
    try:
        return record.spectra()
    except DataRejected:
        return None


def steady_state(
    record: Record, spectra: tuple[ComplexArray, ComplexArray], comparison: ResponseComparison
) -> tuple[int, TimeComparison] | None:
    """Return the configuration that the model tells worst, and motor speeds of its first experiment over one period.

    None where the record is of other configurations than the response.
    """
    u, y = (one[:, 0, :, :, 0] for one in spectra)
    if len(u) != len(comparison.modelled):
        return None
    known: BoolArray = np.asarray(np.isfinite(y).all(axis=2) & np.isfinite(u).all(axis=2))
    rate = 2j * np.pi * comparison.frequency_hz[:, None]
    measured = np.where(known[..., None], y / rate, 0.0)
    modelled = np.where(known[..., None], np.einsum("cfoi,cfi->cfo", comparison.modelled, u) / rate, 0.0)
    size = np.linalg.norm(measured, axis=(1, 2))
    if not (size > 0).all():
        return None
    errors = np.linalg.norm(measured - modelled, axis=(1, 2)) / size
    worst = int(errors.argmax())
    n_sample, step = record.run.valid.shape[-1], record.run.sample_time_s
    signals = [_over_a_period(one[worst], record, n_sample) for one in (measured, modelled)]
    time = np.arange(n_sample, dtype=np.float64) * step
    return worst, TimeComparison(
        comparison.axis_names, "motor_speed", "rad/s", float(errors[worst]), time, signals[0], signals[1]
    )


def _over_a_period(coefficients: ComplexArray, record: Record, n_sample: int) -> FloatArray:
    """Signal of coefficients at the lines (a cosine of amplitude A has A/2), (n_sample, n_axis)."""
    spectrum = np.zeros((n_sample // 2 + 1, coefficients.shape[1]), dtype=np.complex128)
    spectrum[record.line] = n_sample * coefficients
    signal: FloatArray = np.fft.irfft(spectrum, n_sample, axis=0)
    return signal
