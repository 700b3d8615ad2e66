"""How far each method is from the best linear approximation, and of what that consists: bias and scatter.

Over poses and seeds; intervals are bootstrapped over the poses, as errors within a pose go together.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from studies.frf_methods.estimates import Estimated, Variant

from reference import metrics  # isort: skip
from robid_core import BoolArray, ComplexArray, FloatArray

BANDS_HZ = ((4.0, 8.0), (8.0, 25.0), (25.0, 81.0))
JUDGE: Variant = ("log", 24)


@dataclass(frozen=True)
class PoseErrors:
    """Mean squares over lines, seen entries and seeds in one pose: error, bias, scatter; error and bias by band."""

    error: float
    bias: float
    scatter: float
    band_error: tuple[float, ...]
    band_bias: tuple[float, ...]


class Known(Protocol):
    """Truth of a pose: response (n_freq, n_out, n_in), which entries count, and the lines' frequencies."""

    @property
    def response(self) -> ComplexArray: ...
    @property
    def seen(self) -> BoolArray: ...
    @property
    def frequency_hz(self) -> FloatArray: ...


def pose_errors(known: Known, seeds: Sequence[Estimated]) -> PoseErrors:
    """Errors of one method over the seeds of one pose (two or more)."""
    response = np.stack([one.response for one in seeds])
    truth, seen, frequency = known.response, known.seen, known.frequency_hz
    bias, scatter = metrics.bias_and_scatter(response, truth, seen)
    inside = [(frequency >= low) & (frequency < high) for low, high in BANDS_HZ]
    bands = [(response[:, lines], truth[lines], seen[lines]) for lines in inside]
    return PoseErrors(
        metrics.rms_log_error(response, truth, seen) ** 2,
        bias**2,
        scatter**2,
        tuple(metrics.rms_log_error(*band) ** 2 for band in bands),
        tuple(metrics.bias_and_scatter(*band)[0] ** 2 for band in bands),
    )


Row = dict[str, str | float]


def table(
    errors: Mapping[Variant, Sequence[PoseErrors]],
    titles: Mapping[str, str],
    generator: np.random.Generator,
    judge: Sequence[PoseErrors] | None = None,
) -> list[Row]:
    """A row for each method and number of experiments; root mean squares over poses, and the ratio to LOG with 24.

    `errors` holds the poses in one order for all variants; so does `judge`, where others than these say what LOG with
    24 does.
    """
    held_against = np.array([pose.error for pose in (judge or errors[JUDGE])])
    rows: list[Row] = []
    for (key, count), poses in errors.items():
        squares = np.array([[pose.error, pose.bias, pose.scatter] for pose in poses])
        error, bias, scatter = np.sqrt(squares.mean(axis=0))
        low, high = metrics.bootstrap_interval(squares[:, 0], root_mean, generator)
        pairs = np.stack([squares[:, 0], held_against], axis=1)
        ratio_low, ratio_high = metrics.bootstrap_interval(pairs, ratio, generator)
        row: Row = {
            "method": titles[key],
            "experiments": count,
            "error": error,
            "low": low,
            "high": high,
            "bias": bias,
            "scatter": scatter,
            "ratio_to_log_24": ratio(pairs),
            "ratio_low": ratio_low,
            "ratio_high": ratio_high,
        }
        for i, (first, last) in enumerate(BANDS_HZ):
            name = f"{first:g}_{min(last, 80):g}_hz"
            row[f"error_{name}"] = root_mean(np.array([pose.band_error[i] for pose in poses]))
            row[f"bias_{name}"] = root_mean(np.array([pose.band_bias[i] for pose in poses]))
        rows.append(row)
    return rows


def root_mean(squares: FloatArray) -> float:
    """Root of a mean of squares."""
    return float(np.sqrt(squares.mean()))


def ratio(pairs: FloatArray) -> float:
    """Ratio of the root mean squares of two columns."""
    first, second = np.sqrt(pairs.mean(axis=0))
    return float(first / second)
