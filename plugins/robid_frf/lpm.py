"""Local polynomial method, thesis eq. (3.15)-(3.22): a polynomial through the lines around each line.

After Pintelon, Schoukens, Vandersteen and Barbe (2010). Linear in all unknowns, hence without the bias and the
scatter that a denominator brings; near a resonance the window must be narrower than the resonance.
"""

from __future__ import annotations

from robid_core import Context, Frf, Record
from robid_core.estimation.response.local.model import LocalModel
from robid_frf.local import LocalMethod


class LocalPolynomial(LocalMethod):
    """Response read from a polynomial fitted to the lines around each line; one experiment is enough.

    With 6 axes and second order there are 18 unknowns per output: one experiment needs a window of as many lines. The
    covariance is that of the estimator about its own mean; what the polynomial misses is in the residuals, not in
    the mean.

        frf: {use: frf.lpm, with: {numerator_order: 2, window_hz: 4.0}}
    """

    def run(self, record: Record, context: Context) -> Frf:
        """Estimate the response of each configuration."""
        model = LocalModel("miso", self.numerator_order, 0, self.transient_order)
        return self.estimate(record, context, f"LPM ({self.approach})", model, lambda configuration: {})
