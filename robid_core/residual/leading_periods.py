"""How many leading periods of records are dropped: as told, or decided from the data."""

from __future__ import annotations

import logging
from collections.abc import Sequence

import numpy as np

from robid_core.arrays import ComplexArray, FloatArray
from robid_core.artifacts import DenseRun, Record
from robid_core.estimation.response.steady_state import transient_periods

CHANNELS = ("motor_position", "motor_torque")
MOST_BINS = 500  # of a record without lines: enough to tell, and a transient is slow
FEWEST = 3  # periods: two tell a transient from noise as little as one


def leading_periods(records: Sequence[Record], discard: int | None, log: logging.Logger | None = None) -> int:
    """Return how many leading periods of every experiment are dropped.

    Parameters
    ----------
    records
        That are read together.
    discard
        As told; None: as many as differ from those after them by more than these scatter, the most of any record
        (`estimation.response.steady_state`). Of one period or two nothing can be dropped.
    log
        Told what was decided.
    """
    if discard is not None:
        return discard
    runs = [(record, run) for record in records for run in record.runs if run.n_period >= FEWEST]
    found = max((_transient(record, run) for record, run in runs), default=0)
    if found and log is not None:
        log.info(
            "discard: %d leading period%s not in steady state: dropped",
            found,
            " is" if found == 1 else "s are",
        )
    return found


def _transient(record: Record, run: DenseRun) -> int:
    """Leading periods of one run that are not in steady state; none where a sample is missing."""
    if not run.valid.all():
        return 0
    n_sample = len(run.time_s)
    line = np.arange(1, min(n_sample // 2, MOST_BINS)) if record.line is None else record.line
    channels = (run.values(name) for name in CHANNELS if name in run.channels)
    signals = [_spectra(values, line) for values in channels if np.isfinite(values).all()]
    return (transient_periods(signals) or 0) if signals else 0


def _spectra(values: FloatArray, line: np.ndarray) -> ComplexArray:
    """Shape (n_config, n_block, n_freq, n_axis, n_exp, n_period), as `transient_periods` takes them."""
    spectra = np.fft.rfft(values, axis=4)[..., line, :] / values.shape[4]
    # (config, block, exp, period, freq, axis) -> (config, block, freq, axis, exp, period)
    result: ComplexArray = np.moveaxis(spectra, (2, 3), (-2, -1))
    return result
