"""How sure a relative error is: blocks of a record, drawn again with replacement.

Errors of neighbouring samples are alike, those of blocks some tenths of a second apart hardly: blocks of consecutive
samples are what is drawn (Kuensch 1989). Numbers of several models are drawn together, so that their quotient, the gain
of one over the other, has an interval of its own.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid_core import FloatArray

DRAWS = 2000
FEWEST = 12  # blocks; of fewer, an interval would be too narrow
LEVEL = (2.5, 97.5)  # percent


@dataclass(frozen=True, eq=False)
class Intervals:
    """95 % intervals; NaN where there are too few blocks."""

    relative: FloatArray
    """Low and high end of each model's relative error at each axis, shape (2, n_model, n_axis)."""
    gain: FloatArray
    """Of the first model's error over the last one's, all axes together, each in its own share, shape (2,)."""


def sums_of_blocks(values: FloatArray, length: int) -> FloatArray:
    """Sums of squares over blocks of `length` samples, shape (n_block, n_axis).

    `values` has shape (n_lane, n_sample, n_axis); what is left at the end of a lane counts to its last block.
    """
    n_lane, n_sample, n_axis = values.shape
    n_block = max(1, n_sample // length)
    starts = length * np.arange(n_block)
    sums: FloatArray = np.add.reduceat(values**2, starts, axis=1)
    return sums.reshape(n_lane * n_block, n_axis)


def relative_errors(error: FloatArray, power: FloatArray) -> FloatArray:
    """Roots of summed squares of errors over those of what was measured; NaN where nothing was."""
    error, power = np.broadcast_arrays(error, power)
    share: FloatArray = np.divide(error, power, out=np.full(error.shape, np.nan), where=power > 0)
    return np.sqrt(share)


def over_axes(relative: FloatArray) -> FloatArray:
    """Root mean square over the last axis; axes of which nothing was measured do not count."""
    known = np.isfinite(relative)
    total = np.where(known, relative, 0.0)
    mean: FloatArray = (total**2).sum(axis=-1) / np.maximum(known.sum(axis=-1), 1)
    return np.sqrt(mean)


def intervals(error: FloatArray, power: FloatArray, generator: np.random.Generator) -> Intervals:
    """Draw blocks with replacement.

    Parameters
    ----------
    error
        Sums of squared errors of each model over each block, shape (n_model, n_block, n_axis).
    power
        Of what was measured, shape (n_block, n_axis).
    generator
        Draws the blocks.
    """
    n_model, n_block, n_axis = error.shape
    if n_block < FEWEST:
        return Intervals(np.full((2, n_model, n_axis), np.nan), np.full(2, np.nan))
    times = generator.multinomial(n_block, np.full(n_block, 1 / n_block), size=DRAWS).astype(np.float64)
    errors = np.einsum("db,mba->mda", times, error)
    powers = times @ power
    relative = relative_errors(errors, powers)
    gains = relative_errors(over_axes(relative[0]) ** 2, over_axes(relative[-1]) ** 2)
    return Intervals(np.percentile(relative, LEVEL, axis=1), np.percentile(gains, LEVEL))
