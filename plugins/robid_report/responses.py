"""Frequency responses as compact numbers for the page's plots: magnitude in dB, phase in degrees."""

from __future__ import annotations

from typing import Any

import numpy as np

from robid_core import ComplexArray, FloatArray, Frf, ResponseComparison
from robid_report.numbers import compact, rounded_to

FLOOR = 1e-12  # (rad/s^2)/(N m); an entry that is zero by symmetry would be at minus infinity dB
BAND = 2.0  # standard deviations on either side


def comparison_of(frf: Frf, model: ComplexArray) -> ResponseComparison:
    """A measured response beside the response of the robot file, where nothing was fitted."""
    deviation = np.sqrt(frf.variance()) if frf.has_covariance else np.full(frf.response.shape, np.nan)
    measured = np.where(frf.valid_lines[:, :, None, None], frf.response, np.nan)
    return ResponseComparison(
        axis_names=frf.axis_names,
        frequency_hz=frf.frequency_hz,
        measured=measured,
        modelled=model,
        start=model,
        deviation=deviation,
    )


def plot_data(comparison: ResponseComparison, fitted: bool) -> dict[str, Any]:
    """Numbers of the response section, entry by entry: `[configuration][output][input][line]`.

    Parameters
    ----------
    comparison
        Measured and modelled responses.
    fitted
        Whether `modelled` is a fit; otherwise only `start` is drawn.
    """
    measured = comparison.measured
    spread = BAND * comparison.deviation
    size = np.abs(measured)
    low = np.maximum(
        size - spread, 0.03 * size
    )  # a band below the measurement's own 3 % would only fall off the plot
    return {
        "axes": list(comparison.axis_names),
        "frequency": rounded_to(comparison.frequency_hz, 6),
        "n_config": len(measured),
        "measured": {"db": _entries(_decibel(size)), "deg": _entries(np.degrees(np.angle(measured)))},
        "band": {"low": _entries(_decibel(low)), "high": _entries(_decibel(size + spread))},
        "model": _curve(comparison.modelled) if fitted else None,
        "start": _curve(comparison.start),
    }


def _curve(response: ComplexArray) -> dict[str, Any]:
    return {"db": _entries(_decibel(np.abs(response))), "deg": _entries(np.degrees(np.angle(response)))}


def _decibel(size: FloatArray) -> FloatArray:
    result: FloatArray = 20 * np.log10(np.maximum(size, FLOOR))
    return result


def _entries(values: FloatArray) -> Any:
    """Put the lines last and write hundredths: what a plot of a few hundred pixels shows."""
    return compact(np.moveaxis(values, 1, 3), 2)
