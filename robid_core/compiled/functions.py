"""Sine, cosine, exponential, logarithm and smooth sign without branches, on a number or on all lanes at once.

The laws of effects and the loops of the simulator take them from here: the library's functions work on one number at
a time and cost ten times as much. Each is exact to a few units in the last place in the range that it states.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.extending import overload

from robid_core.compiled.kernel import kernel
from robid_core.compiled.lanes import LANES, lanes, power_of_two, where
from robid_core.compiled.views import address_of, lanes_at

_SHIFT = 6755399441055744.0  # 1.5 * 2^52: adding it rounds to a whole number that stands in the low bits
_LARGEST_EXPONENT = 700.0  # e^700 = 1e304


@kernel
def exponential(x):  # type: ignore[no-untyped-def]
    """e^x, with x held within +-700; relative error below 5e-16.

    Reduction by multiples of ln 2 in two parts (Cody and Waite 1980), then the Taylor polynomial of degree 13 on
    +-0.35.
    """
    x = where(x < _LARGEST_EXPONENT, x, _LARGEST_EXPONENT)
    x = where(x > -_LARGEST_EXPONENT, x, -_LARGEST_EXPONENT)
    shifted = x * 1.44269504088896340736 + _SHIFT
    k = shifted - _SHIFT
    r = (x - k * 6.93147180369123816490e-01) - k * 1.90821492927058770002e-10
    p = 1.0 / 39916800.0 + r * (1.0 / 479001600.0 + r * (1.0 / 6227020800.0))
    p = 1.0 / 40320.0 + r * (1.0 / 362880.0 + r * (1.0 / 3628800.0 + r * p))
    p = 1.0 / 120.0 + r * (1.0 / 720.0 + r * (1.0 / 5040.0 + r * p))
    p = 1.0 + r * (1.0 + r * (0.5 + r * (1.0 / 6.0 + r * (1.0 / 24.0 + r * p))))
    return p * power_of_two(shifted)


@kernel
def natural_logarithm(x):  # type: ignore[no-untyped-def]
    """ln x, absolute error below 3e-14, with x held within 1e-18 and 1e18.

    128 times the logarithm of the 128th root y, which is 2 artanh((y - 1) / (y + 1)).
    """
    y = np.sqrt(np.sqrt(np.sqrt(np.sqrt(np.sqrt(np.sqrt(np.sqrt(min(max(x, 1e-18), 1e18))))))))
    u = (y - 1.0) / (y + 1.0)
    z = u * u
    series = 1.0 / 7.0 + z * (1.0 / 9.0 + z * (1.0 / 11.0 + z * (1.0 / 13.0 + z * (1.0 / 15.0 + z / 17.0))))
    return 256.0 * u * (1.0 + z * (1.0 / 3.0 + z * (1.0 / 5.0 + z * series)))


@kernel
def smooth_sign(x):  # type: ignore[no-untyped-def]
    """tanh(x); absolute error below 3e-16."""
    return 1.0 - 2.0 / (exponential(2.0 * x) + 1.0)


@kernel
def sine_and_cosine(x):  # type: ignore[no-untyped-def]
    """(sin x, cos x); error below 2 units in the last place for |x| < 1e5 rad.

    Reduction by quarter turns, pi / 2 in three parts of 33 bits (Cody and Waite; fdlibm, e_rem_pio2.c), then the
    polynomials of the Cephes library (S. Moshier).
    """
    quarter = np.floor(x * 0.63661977236758134308 + 0.5)
    r = (
        (x - quarter * 1.5707963267341256) - quarter * 6.0771005065061922e-11
    ) - quarter * 2.0222662487959506e-21
    z = r * r
    s = -2.50507477628578072866e-8 + z * 1.58962301576546568060e-10
    s = -1.98412698295895385996e-4 + z * (2.75573136213857245213e-6 + z * s)
    s = r + r * z * (-1.66666666666666307295e-1 + z * (8.33333333332211858878e-3 + z * s))
    c = 2.08757008419747316778e-9 - z * 1.13585365213876817300e-11
    c = 2.48015872888517045348e-5 + z * (-2.75573141792967388112e-7 + z * c)
    c = 1.0 - 0.5 * z + z * z * (4.16666666666665929218e-2 + z * (-1.38888888888730564116e-3 + z * c))
    half = 0.5 * quarter
    odd = half - np.floor(half) > 0.25
    turned = quarter - 4.0 * np.floor(0.25 * quarter)  # 0, 1, 2, 3
    sign_s = where(turned > 1.5, -1.0, 1.0)
    sign_c = where(abs(turned - 1.5) < 1.0, -1.0, 1.0)
    return sign_s * where(odd, c, s), sign_c * where(odd, s, c)


@kernel
def sine(x):  # type: ignore[no-untyped-def]
    """sin x; see `sine_and_cosine`."""
    return sine_and_cosine(x)[0]


@kernel
def cosine(x):  # type: ignore[no-untyped-def]
    """cos x; see `sine_and_cosine`."""
    return sine_and_cosine(x)[1]


def sines_and_cosines(angle: Any, sine: Any, cosine: Any) -> None:
    """Fill views with the sines and cosines of a view of angles, as many as `sine` has items.

    Where items are numbers, LANES of them go through a register at once: all three views must then reach to the end of
    their last block of LANES, as `memory.aligned_arrays` makes them. The results are the same to the last bit.
    """
    raise NotImplementedError("inside compiled code only")


@overload(sines_and_cosines)
def _sines_and_cosines(angle, sine, cosine):  # type: ignore[no-untyped-def]
    def one_by_one(angle, sine, cosine):  # type: ignore[no-untyped-def]
        for i in range(sine.shape[0]):
            sine[i], cosine[i] = sine_and_cosine(angle[i])

    def in_blocks(angle, sine, cosine):  # type: ignore[no-untyped-def]
        angles = lanes_at(address_of(angle, 0))
        sines, cosines = lanes_at(address_of(sine, 0)), lanes_at(address_of(cosine, 0))
        for block in range((sine.shape[0] + LANES - 1) // LANES):
            sines[block], cosines[block] = sine_and_cosine(angles[block])

    return one_by_one if angle.item == lanes else in_blocks
