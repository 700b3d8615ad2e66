"""H1 estimator: least squares over all experiments of a configuration, thesis eq. (3.10).

Unbiased where the noise sits on the output only; noise on the measured torque, and feedback around it, pull
the estimate towards smaller responses (Wernholt and Moberg 2008 rank it last on a real robot).
"""

from __future__ import annotations

from robid_core import Context, Frf, Record
from robid_core.estimation.response.spectra import divide_spectra
from robid_frf.averaging import Averaging, Estimate, join


class H1(Averaging):
    """Response as ``Y U^H (U U^H)^-1`` with the experiments of all blocks side by side.

    One block is enough; a covariance needs an experiment more than there are axes.

        frf: {use: frf.h1}
    """

    def run(self, record: Record, context: Context) -> Frf:
        """Estimate the response of each configuration."""
        spectra = self.read(record, context)
        all_blocks = join(spectra, self.condition_limit)
        u, y, blocks = spectra.block_u, spectra.block_y, None
        if u.shape[-1] >= u.shape[-2]:
            blocks = divide_spectra(u, y, self.condition_limit).value
        estimate = Estimate("H1", all_blocks.response, all_blocks.gram_inverse, all_blocks.products, blocks)
        return self.finish(record, context, spectra, estimate)
