"""Empirical transfer function estimate for robid."""

import numpy as np
from pydantic import NonNegativeInt

from robid_core import Frf, FrfEstimator, Record


class Etfe(FrfEstimator):
    """FRF as the ratio of period-averaged spectra, mean over blocks of Y U^-1.

    frf: {use: frf.etfe, with: {discard: 1}}
    """

    discard: NonNegativeInt = 0
    """Leading periods dropped as transient."""

    def run(self, record: Record) -> Frf:
        """Divide the spectra."""
        u, y = record.spectra(discard=self.discard)  # (n_config, n_block, n_freq, n_axis, n_exp)
        return Frf.from_blocks(record, y @ np.linalg.inv(u), discard=self.discard, estimator="ETFE")
