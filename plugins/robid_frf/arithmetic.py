"""Arithmetic mean of one response per block, thesis eq. (3.11), after Guillaume (1998).

Each block trusts its own inputs, so that feedback around the noise does not pull the mean down as it does in H1:
with circular Gaussian noise of signal-to-noise ratio S (power) on one input the mean is too small by the share
exp(-S), and noise of the output leaves it where it is. That share does not shrink with more blocks; the stated
regions are therefore about the estimator's own mean.
"""

from __future__ import annotations

import numpy as np

from robid_core import Context, Frf, Record
from robid_core.estimation.response.covariance import gram_inverse_of_mean
from robid_core.estimation.response.spectra import divide_spectra
from robid_frf.averaging import Averaging, Estimate, join


class ArithmeticMean(Averaging):
    """Response as the mean of ``Y U^-1`` over the blocks.

    Each block needs an experiment for every axis; with more, ``U^-1`` is the pseudo-inverse. One block states no
    covariance unless it has experiments to spare.

        frf: {use: frf.ari}
    """

    def run(self, record: Record, context: Context) -> Frf:
        """Estimate the response of each configuration."""
        spectra = self.read(record, context)
        each = divide_spectra(spectra.block_u, spectra.block_y, self.condition_limit)
        gram_inverse = gram_inverse_of_mean(np.moveaxis(each.gram_inverse, 1, 0))
        products = join(spectra, self.condition_limit).products
        estimate = Estimate("ARI", each.value.mean(axis=1), gram_inverse, products, each.value)
        return self.finish(record, context, spectra, estimate)
