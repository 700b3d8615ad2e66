"""Harmonic mean of one response per block: the inverse of the mean of ``U Y^-1``.

The mirror image of the arithmetic mean: it trusts the outputs. Noise on the input leaves the mean of the inverses
where it is; noise on the output with signal-to-noise ratio S (power) makes the response too large by the share
exp(-S). On a real robot it is as good as the logarithmic mean (Wernholt and Moberg 2008), because friction and
torque ripple disturb the input.
"""

from __future__ import annotations

import numpy as np

from robid_core import Context, Frf, Record
from robid_core.estimation.response.covariance import gram_inverse_of_mean
from robid_core.estimation.response.means import harmonic_mean
from robid_core.estimation.response.spectra import divide_spectra
from robid_frf.averaging import Averaging, Estimate, join


class HarmonicMean(Averaging):
    """Response as the inverse of the mean of ``U Y^-1`` over the blocks.

    Each block needs an experiment for every axis; with more, ``Y^-1`` is the pseudo-inverse. Lines where the
    outputs do not span all axes are masked too. The covariance is that of the mean to first order in the noise,
    where all means are alike.

        frf: {use: frf.harmonic}
    """

    def run(self, record: Record, context: Context) -> Frf:
        """Estimate the response of each configuration."""
        spectra = self.read(record, context)
        u, y = spectra.block_u, spectra.block_y
        each = divide_spectra(u, y, self.condition_limit)
        backward = divide_spectra(y, u, self.condition_limit).value
        response = harmonic_mean(np.moveaxis(backward, 1, 0), self.condition_limit)
        gram_inverse = gram_inverse_of_mean(np.moveaxis(each.gram_inverse, 1, 0))
        products = join(spectra, self.condition_limit).products
        estimate = Estimate("harmonic mean", response, gram_inverse, products, each.value)
        return self.finish(record, context, spectra, estimate)
