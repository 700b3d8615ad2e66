"""Local rational fits of many lines, compiled: the same numbers as `rational`, for one common set of regressors.

That is the full matrix fraction, the polynomial, and one output by itself (so an output at a time, a
denominator for each).
Per line: moments, Cholesky factor, refinement; orthogonalisation where the pivots are small. Cost is linear in lines.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from robid_core.arrays import ComplexArray, FloatArray, IntArray
from robid_core.compiled.lanes import LANES
from robid_core.estimation.response.local.fit_kernel import fit_lines
from robid_core.estimation.response.local.model import LocalModel
from robid_core.estimation.response.local.normal_equations import filled, line_products, to_planes, zeros
from robid_core.estimation.response.local.window import Windows


@dataclass(frozen=True)
class LineFits:
    """Solutions of all lines.

    `theta` (n_freq, n_unknown, n_out) holds N, coefficient by coefficient, then D, as columns of K stand; `products`
    (n_freq, n_out, n_out) ``sum e_i conj(e_k)`` of the residuals; `gram` (n_freq, n_in, n_in) the part of
    ``(K^H K)^-1`` that belongs to G. `influence` (n_freq, n_moment, n_in, n_in) are
    ``sum_r t^m a_r a_r^H`` of the errors' way to G, ``dG[i, j] = sum_r a_r[j] e_r[i]``, and `free` (n_freq, n_moment)
    ``sum_r t^m (1 - leverage)``; both None where they were not asked for. `ratio` (n_freq,) is the smallest
    pivot of the numerator's columns, a squared sine; `corrections` (n_freq,) counts refinements, -1 where rows
    were orthogonalised.
    """

    theta: ComplexArray
    products: ComplexArray
    gram: ComplexArray
    influence: ComplexArray | None
    free: FloatArray | None
    ratio: FloatArray
    corrections: IntArray


def gram_entries(
    m: int, n_sum: int, kind: IntArray, order: IntArray, sign: FloatArray
) -> tuple[IntArray, FloatArray]:
    """Where each entry of the upper triangle of ``[K Y]^H [K Y]`` comes from; see `normal_equations.assemble`.

    Column c of [K Y] is ``sign[c] t^order[c] z[kind[c]]``; of the products of z those with a <= b are there,
    `n_sum` numbers with what fills up.
    """
    pair = np.zeros((m, m), dtype=np.int64)
    pair[np.triu_indices(m)] = np.arange(m * (m + 1) // 2)
    i, j = np.triu_indices(len(kind))
    a, b = kind[i], kind[j]
    swapped = a > b
    source = (order[i] + order[j]) * n_sum + np.where(swapped, pair[b, a], pair[a, b])
    target = i * filled(len(kind)) * LANES + j
    scale = sign[i] * sign[j]
    return np.stack((target, source), axis=1), np.stack((scale, np.where(swapped, -scale, scale)), axis=1)


def solve_lines(
    u: ComplexArray,
    y: ComplexArray,
    windows: Windows,
    model: LocalModel,
    *,
    with_influence: bool = False,
    threads: int = 1,
) -> LineFits:
    """Fit a full matrix fraction (or a polynomial, or any single output) at all lines.

    Parameters
    ----------
    u, y
        Spectra (n_freq, n_in, n_exp) and (n_freq, n_out, n_exp).
    windows, model
        Which lines, and orders; without transients.
    with_influence
        Also give what covariances are made of.
    threads
        Portions of the lines that are worked on at the same time; changes no result.
    """
    n_freq, n_in, n_exp = u.shape
    n_out = y.shape[1]
    m = n_in + n_out
    plane_re, plane_im = zeros((m, n_exp, filled(n_freq) * LANES))
    for start, spectra in ((0, u), (n_in, y)):
        parts = np.ascontiguousarray(spectra, dtype=np.complex128).view(np.float64)
        to_planes(parts.reshape(*spectra.shape, 2), start, plane_re, plane_im)
    n_pair = m * (m + 1) // 2
    n_sum = -(-n_pair // (2 * LANES)) * 2 * LANES  # an even number of blocks
    product_re, product_im = zeros((n_freq, n_sum))
    by_lanes = (m, n_exp, -1, LANES)
    room = zeros((1, LANES))
    line_products(
        plane_re.reshape(by_lanes), plane_im.reshape(by_lanes), *room, n_freq, product_re, product_im
    )
    inputs, outputs = np.arange(n_in), np.arange(n_in, m)
    rn, rd = model.numerator_order, model.denominator_order
    kind = np.concatenate((np.tile(inputs, rn + 1), np.tile(outputs, rd), outputs)).astype(np.int64)
    order = np.concatenate(
        (np.repeat(np.arange(rn + 1), n_in), np.repeat(np.arange(1, rd + 1), n_out), np.zeros(n_out))
    ).astype(np.int64)
    n_numerator = (rn + 1) * n_in
    n_unknown = n_numerator + rd * n_out
    sign = np.where((np.arange(len(kind)) >= n_numerator) & (np.arange(len(kind)) < n_unknown), -1.0, 1.0)
    n_power = max(rn, rd) + 1
    n_moment = 2 * n_power - 1
    entry, entry_sign = gram_entries(m, n_sum, kind, order, sign)
    place = np.full((m, n_power), -1, dtype=np.int64)
    place[kind[:n_unknown], order[:n_unknown]] = np.arange(n_unknown)
    theta = np.empty((n_freq, n_unknown, n_out), dtype=np.complex128)
    square = np.empty((n_freq, n_out, n_out), dtype=np.complex128)
    gram = np.zeros((n_freq, n_in, n_in), dtype=np.complex128)
    kept = n_freq if with_influence else 1
    influence = np.empty((kept, n_moment, n_in, n_in), dtype=np.complex128)
    free = np.empty((kept, n_moment))
    ratio, corrections = np.zeros(n_freq), np.zeros(n_freq, dtype=np.int64)

    results = [array.view(np.float64).reshape(*array.shape, 2) for array in (theta, square, gram, influence)]

    def portion(edge: tuple[int, int]) -> None:
        fit_lines(
            *edge, windows.frequency_hz, windows.first, windows.last, windows.half_width_hz, plane_re, plane_im,
            product_re.reshape(n_freq, -1, LANES), product_im.reshape(n_freq, -1, LANES), entry, entry_sign,
            place, kind, order, sign, n_in, n_unknown, n_numerator, with_influence, int(windows.size.max()),
            *results, free, ratio, corrections,
        )  # fmt: skip

    edges = np.linspace(0, n_freq, threads + 1).astype(int)
    portions = list(zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True))
    if threads == 1:
        portion(portions[0])
    else:
        with ThreadPoolExecutor(threads) as pool:
            list(pool.map(portion, portions))
    return LineFits(
        theta,
        square,
        gram,
        influence if with_influence else None,
        free if with_influence else None,
        ratio,
        corrections,
    )
