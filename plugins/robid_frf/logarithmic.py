"""Logarithmic mean of one response per block, thesis eq. (3.12) and (3.13).

Averages amplitudes in decibels and phases in degrees, and is robust against noise on input and output alike
(best of the averaging estimators on a real robot, Wernholt and Moberg 2008). In (3.12) log and exp are
*matrix* functions; entry by entry relative to the first block comes out equally well and is offered too.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from robid_core import BoolArray, ComplexArray, Context, Frf, Record
from robid_core.estimation.response.covariance import gram_inverse_of_mean
from robid_core.estimation.response.means import logarithmic_mean_entries, logarithmic_mean_matrix
from robid_core.estimation.response.spectra import divide_spectra
from robid_frf.averaging import Averaging, Estimate, join, total_covariance


def _usable(by_block: ComplexArray) -> BoolArray:
    usable: BoolArray = np.all(np.isfinite(by_block), axis=(0, -2, -1))
    return usable


class LogarithmicMean(Averaging):
    """Response as the logarithmic mean of the blocks' responses.

    Each block needs an experiment for every axis; with a single block this is its response, without a
    covariance unless it has experiments to spare. Entries that drown in noise (zero by symmetry, say) have
    no logarithm worth averaging: in the form `element` they take the arithmetic mean, and in both the stated
    covariance shows that they do not differ from zero.

        frf: {use: frf.log, with: {form: matrix}}
    """

    form: Literal["matrix", "element"] = "matrix"
    """`matrix`: logarithm of the matrix (3.12); `element`: of each entry, relative to the first block."""

    def run(self, record: Record, context: Context) -> Frf:
        """Estimate the response of each configuration."""
        spectra = self.read(record, context)
        each = divide_spectra(spectra.block_u, spectra.block_y, self.condition_limit)
        by_block, gram_inverse = np.moveaxis(each.value, 1, 0), np.moveaxis(each.gram_inverse, 1, 0)
        all_blocks = join(spectra, self.condition_limit)
        if self.form == "matrix":
            response = logarithmic_mean_matrix(by_block)
        else:
            valid = _usable(by_block)
            total = total_covariance(
                spectra, all_blocks.products, all_blocks.response, valid, self.half_window
            )
            deviation = None
            if total is not None:
                output = np.einsum("cfii->cfi", total.covariance).real
                inputs = np.einsum("mcfjj->cfj", gram_inverse).real / len(gram_inverse)
                deviation = np.sqrt(output[..., :, None] * inputs[..., None, :])
            response = logarithmic_mean_entries(by_block, deviation)
        gram_inverse = gram_inverse_of_mean(gram_inverse)
        name = f"LOG ({self.form})"
        estimate = Estimate(name, response, gram_inverse, all_blocks.products, each.value)
        return self.finish(record, context, spectra, estimate)
