"""One experiment more than axes: what does not depend on the phases of the multisine, removed exactly.

With references ``diag(R_c) T``, T from columns 1..n of the (n + 1)-point Fourier matrix and phases common to all
experiments of a block (`estimation.excitation.multisine`), everything linear in the references sums to zero over the
experiments of a block, and what is the same in all of them (ripple under the slow sine, its harmonics) has nothing
but this sum. Turning the n + 1 experiments by T makes n experiments without it: every estimator works on them as
on any others, and each block has lost one degree of freedom, the one that measured the disturbance.
"""

from __future__ import annotations

import numpy as np

from robid_core.arrays import ComplexArray
from robid_core.estimation.excitation.multisine import experiment_factors

TOLERANCE = 1e-5  # references come as commands: single precision at worst


def column_is_free(reference: ComplexArray) -> bool:
    """Tell whether the references of every block and line sum to zero over more experiments than axes.

    Takes shape (..., n_axis, n_exp). A reference that is zero at a line leaves the column free there.
    """
    n_axis, n_exp = reference.shape[-2:]
    if n_exp <= n_axis:
        return False
    size = np.sqrt(np.mean(np.abs(reference) ** 2, axis=-1))
    return bool(size.any() and (np.abs(reference.mean(axis=-1)) <= TOLERANCE * size).all())


def other_columns(spectra: ComplexArray) -> ComplexArray:
    """Experiments turned so that what is common to all of them is gone, one fewer than before.

    The columns are orthonormal: independent noise stays independent and of the same size in each.

    Takes shape (..., n_axis, n_exp), returns (..., n_axis, n_exp - 1).
    """
    n_exp = spectra.shape[-1]
    result: ComplexArray = spectra @ (experiment_factors(n_exp, n_exp - 1).conj() / np.sqrt(n_exp))
    return result
