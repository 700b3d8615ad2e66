"""H1 estimator: least squares over all experiments of a configuration, thesis eq. (3.10).

Unbiased where the noise sits on the output only; noise on the measured torque, and feedback around it, pull
the estimate towards smaller responses (Wernholt and Moberg 2008 rank it last on a real robot).
"""

from __future__ import annotations

from robid_core import Context, Frf, Record
from robid_core.estimation.spectra import factor_inputs
from robid_frf.averaging import Averaging, record_spectra


class H1(Averaging):
    """Response as ``Y U^H (U U^H)^-1`` with the experiments of all blocks side by side.

    One block is enough; a covariance needs an experiment more than there are axes.

        frf: {use: frf.h1, with: {discard: 0}}
    """

    def run(self, record: Record, context: Context) -> Frf:
        """Estimate the response of each configuration."""
        spectra = record_spectra(record, self.discard, self.condition_limit)
        response = spectra.y @ spectra.factors.inverse
        u, y = spectra.u_by_period.mean(axis=-1), spectra.y_by_period.mean(axis=-1)
        blocks = None
        if u.shape[-1] >= u.shape[-2]:
            blocks = y @ factor_inputs(u, self.condition_limit).inverse
        return self.finish(record, context, spectra, response, spectra.factors.gram_inverse, blocks, "H1")
