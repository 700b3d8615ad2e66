"""Records as spectra of all experiments of a configuration, and spectra as samples that a record can lose."""

from __future__ import annotations

import numpy as np

from robid_core import Channel, ComplexArray, FloatArray, Record, frozen


def all_experiments(values: FloatArray) -> FloatArray:
    """Period averages of one configuration side by side, from (n_block, n_exp, n_period, n_sample, n_axis)."""
    mean: FloatArray = values.mean(axis=2)
    return mean.reshape(-1, *mean.shape[2:])


def spectra(values: FloatArray) -> ComplexArray:
    """Spectra of these, scaled by 1/n_sample, shape (n_exp, n_sample // 2 + 1, n_axis)."""
    result: ComplexArray = np.fft.rfft(all_experiments(values), axis=1) / values.shape[3]
    return result


def reference_at_lines(record: Record) -> ComplexArray:
    """Spectra of the references at the lines, experiments side by side, shape (n_config, n_exp, n_freq, n_axis)."""
    at_lines = record.reference_spectra().transpose(0, 1, 4, 2, 3)
    return at_lines.reshape(at_lines.shape[0], -1, *at_lines.shape[3:])


def in_time(spectrum: ComplexArray, first: int, n_sample: int) -> FloatArray:
    """Samples (n_exp, n_sample, n_axis) of a spectrum that begins at bin `first`, scaled by 1/n_sample."""
    whole = np.zeros((len(spectrum), n_sample // 2 + 1, spectrum.shape[-1]), dtype=np.complex128)
    whole[:, first : first + spectrum.shape[1]] = spectrum
    result: FloatArray = np.fft.irfft(whole * n_sample, n=n_sample, axis=1)
    return result


def less(values: FloatArray, spectrum: ComplexArray, first: int) -> FloatArray:
    """One configuration's samples less a spectrum of all its experiments, in every period alike.

    Takes samples (n_block, n_exp, n_period, n_sample, n_axis) and a spectrum as `in_time`.
    """
    n_block, n_exp, _, n_sample, n_axis = values.shape
    result: FloatArray = values - in_time(spectrum, first, n_sample).reshape(
        n_block, n_exp, 1, n_sample, n_axis
    )
    return result


def with_channels(record: Record, source: str, **values: FloatArray) -> Record:
    """The record with other values in some channels, which become read-only, and words about it in its source."""
    run = record.run
    changed = {
        name: Channel(run.channel(name).side, run.channel(name).unit_symbol, frozen(new))
        for name, new in values.items()
    }
    channels = {**run.channels, **changed}
    return record.replace(source=f"{record.source}; {source}", runs=(run.replace(channels=channels),))
