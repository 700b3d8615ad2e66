"""Which rational function is fitted in a window, and how many lines and experiments that takes.

``D(t) y = N(t) u + T_e(t)``, with t the frequency offset from the line over the window's half width, ``D(0) = I``
(thesis eq. 3.23-3.31; parametrisations after R. Voorhoeve, A. van der Maas and T. Oomen, 2018). So ``G =
N(0)``. With a denominator of order zero this is the local polynomial method (3.15-3.20).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

Parametrization = Literal["scalar", "miso", "mimo"]

FREEDOM_PER_OUTPUT = 4
"""Complex degrees of freedom per output that a window chosen here leaves: the inverse of a covariance from as many
is too large by a third on average (as `covariance.default_half_window`)."""


@dataclass(frozen=True)
class LocalModel:
    """Orders of a local rational function.

    `parametrization` is the denominator's: `scalar` one polynomial for the whole matrix, `miso` one for each output
    (3.24), `mimo` a full matrix of polynomials (3.29-3.31). `transient_order` adds to every experiment and output a
    polynomial that no input explains: leakage of a transient; None leaves it out.
    """

    parametrization: Parametrization = "mimo"
    numerator_order: int = 2
    denominator_order: int = 2
    transient_order: int | None = None

    @property
    def transient_terms(self) -> int:
        """Coefficients of the transient polynomial of an experiment."""
        return 0 if self.transient_order is None else self.transient_order + 1

    def unknowns(self, n_in: int, n_out: int) -> float:
        """Complex unknowns per output without those of transients: 30 for 6 x 6, full matrix, second order.

        A denominator that is common to all outputs counts for each of them in part.
        """
        shared = {"scalar": 1 / n_out, "miso": 1.0, "mimo": float(n_out)}[self.parametrization]
        return (self.numerator_order + 1) * n_in + self.denominator_order * shared

    def freedom(self, n_line: int, n_in: int, n_out: int, n_exp: int) -> float:
        """Complex degrees of freedom per output that a window of `n_line` lines leaves: equations less unknowns."""
        return (n_line - self.transient_terms) * n_exp - self.unknowns(n_in, n_out)

    def smallest_window(self, n_in: int, n_out: int, n_exp: int, spare: float = 0, freedom: float = 0) -> int:
        """Fewest lines from which all unknowns follow.

        Without noise, output and input of more experiments than inputs are linear combinations of as many experiments
        as inputs: a line gives at most ``min(n_exp, n_in)`` equations to the unknowns of an output, however often
        it is measured.

        Parameters
        ----------
        spare
            Equations of that kind beyond the unknowns.
        freedom
            Equations of any kind, noise included, beyond the unknowns.
        """
        unknowns = self.unknowns(n_in, n_out)
        lines = max((unknowns + spare) / min(n_exp, n_in), (unknowns + freedom) / n_exp)
        return int(np.ceil(lines - 1e-9)) + self.transient_terms

    def comfortable_window(self, n_in: int, n_out: int, n_exp: int, n_stated: int | None = None) -> int:
        """Return the window taken where none is given.

        The smallest odd number of lines that has an equation per input more than unknowns, and leaves
        FREEDOM_PER_OUTPUT degrees of freedom for each of the `n_stated` outputs whose covariance is stated.
        """
        stated = n_out if n_stated is None else n_stated
        return self.smallest_window(n_in, n_out, n_exp, n_in, FREEDOM_PER_OUTPUT * stated) // 2 * 2 + 1

    def experiments_for(self, n_line: int, n_in: int, n_out: int) -> int | None:
        """Fewest experiments with which `n_line` lines suffice; None where no number would do."""
        for n_exp in range(1, n_in + 1):
            if self.smallest_window(n_in, n_out, n_exp) <= n_line:
                return n_exp
        return None
