"""Joint input-output estimator, thesis eq. (3.14), after Wellstead (1981): from the reference to both signals.

``G = Y R^H (U R^H)^-1`` over all experiments: what the reference does not cause (noise, in the loop or not) drops
out of the mean of both factors, so that the estimate is consistent in closed loop, and for a nonlinear plant it
tends to the best linear approximation ``E[Y R^-1] E[U R^-1]^-1``. The error is ``V A`` with the residual
``V = Y - G U`` and ``A = R^H (U R^H)^-1``: to first order in the noise its covariance is the Kronecker product
``(A^H A)^T (x) C_V``. V is seen where the references are not: ``(Y - G U) (I - R^+ R)``.
"""

from __future__ import annotations

import numpy as np

from robid_core import Context, Frf, Record
from robid_core.estimation.response.covariance import residual_products
from robid_core.estimation.response.spectra import divide_by_reference, factor_inputs, side_by_side
from robid_frf.averaging import Averaging, Estimate
from robid_frf.reading import LineSpectra


def joint_estimate(name: str, spectra: LineSpectra, condition_limit: float) -> Estimate:
    """Joint input-output response of the spectra and their references."""
    u, y, r = spectra.block_u, spectra.block_y, np.asarray(spectra.reference)
    joint = divide_by_reference(u, y, r, condition_limit)
    residual = side_by_side(y - joint.value[:, None] @ u)
    references = side_by_side(r)
    products = residual_products(references, residual, factor_inputs(references, condition_limit).inverse)
    blocks = None
    if r.shape[-1] >= r.shape[-2]:
        blocks = divide_by_reference(u[:, :, None], y[:, :, None], r[:, :, None], condition_limit).value
    return Estimate(
        name, joint.value, joint.gram_inverse, products, blocks, covers=Frf.BEST_LINEAR_APPROXIMATION
    )


class JointInputOutput(Averaging):
    """Response as ``Y R^H (U R^H)^-1`` with the experiments of all blocks side by side.

    The record needs a channel speed_reference or position_reference. One block is enough; a covariance needs an
    experiment more than there are axes.

        frf: {use: frf.jio}
    """

    def run(self, record: Record, context: Context) -> Frf:
        """Estimate the response of each configuration."""
        spectra = self.read(record, context, reference=True)
        estimate = joint_estimate("JIO", spectra, self.condition_limit)
        return self.finish(record, context, spectra, estimate)
