"""Two-stage (projection) estimator: the input as the reference makes it, then the output on that (section 3.2.2).

First ``G_ru = U R^+`` over all experiments, smoothed over neighbouring lines by a local polynomial; then
``U' = G_ru R``, free of what the reference does not cause, and least squares ``G = Y U'^+ = G_ry G_ru^-1``. Without
smoothing this is the joint input-output estimator (3.14) by another way.

The error is ``(dG_ry - G sum_l w_l dG_ru(l)) G_ru^-1``: of the lines of the window only the one in the middle has
noise in common with the output. With references whose Gram matrices differ from line to line by a factor only
(orthogonal multisines) its covariance is ``(U' U'^H)^-T (x) C``,
``C = C_yy - w_0 (C_yu G^H + G C_uy) + sum_l w_l^2 s_l G C_uu(l) G^H``, s_l the ratio of the Gram matrices' inverses.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydantic import NonNegativeInt

from robid_core import BoolArray, ComplexArray, Context, FloatArray, Frf, IntArray, Record
from robid_core.estimation.response.covariance import difference_products, residual_products
from robid_core.estimation.response.smoothing import (
    polynomial_weights,
    products_through_smoothing,
    smooth_over_lines,
)
from robid_core.estimation.response.spectra import InputFactors, factor_inputs, side_by_side
from robid_frf.averaging import Averaging, Estimate


@dataclass(frozen=True)
class Projection:
    """Response and its inverse Gram matrix, (n_config, n_freq, n, n), and the windows of each configuration."""

    references: InputFactors
    response: ComplexArray
    gram_inverse: ComplexArray
    windows: tuple[tuple[IntArray, IntArray, FloatArray], ...]

    def products(self, of_signals: ComplexArray) -> ComplexArray:
        """Products of the residual that reaches the response, from those of [y; u]; NaN where there is none."""
        result = np.full_like(self.response, np.nan)
        for i, (lines, index, weight) in enumerate(self.windows):
            gram_inverse = self.references.gram_inverse[i, lines]
            result[i, lines] = products_through_smoothing(
                of_signals[i, lines], self.response[i, lines], gram_inverse, index, weight
            )
        return result


class TwoStage(Averaging):
    """Response from the reference to the output over the smoothed response from the reference to the input.

    The record needs a channel speed_reference or position_reference. Smoothing takes noise from the input and
    pays with a bias where its response bends within a window (at every resonance of the loop): without it the
    estimate is that of frf.jio and tends to the best linear approximation, with it to a mean of its own.

        frf: {use: frf.two_stage, with: {smoothing_lines: 2}}
    """

    smoothing_lines: NonNegativeInt = 0
    """Lines on either side that smooth the response from the reference to the input; 0: none, as frf.jio."""
    smoothing_degree: NonNegativeInt = 2
    """Degree of the local polynomial over the true frequency offset, at most twice smoothing_lines."""

    def run(self, record: Record, context: Context) -> Frf:
        """Estimate the response of each configuration."""
        spectra = self.read(record, context, reference=True)
        block_r = np.asarray(spectra.reference)
        u, y, r = (side_by_side(x) for x in (spectra.block_u, spectra.block_y, block_r))
        both = self._project(record.frequency_hz, u, y, r)
        signals = np.concatenate((y, u), axis=-2)
        by_period = np.concatenate((spectra.y_by_period, spectra.u_by_period), axis=-3)
        total, noise = (
            both.products(x)
            for x in (
                residual_products(r, signals, both.references.inverse),
                difference_products(by_period).sum(axis=1),
            )
        )
        blocks = None
        if block_r.shape[-1] >= block_r.shape[-2]:
            each = zip(
                *(np.moveaxis(x, 1, 0) for x in (spectra.block_u, spectra.block_y, block_r)), strict=True
            )
            blocks = np.stack([self._project(record.frequency_hz, *one).response for one in each], axis=1)
        name = f"two-stage ({self.smoothing_lines} lines)"
        covers = Frf.OWN_MEAN if self.smoothing_lines else Frf.BEST_LINEAR_APPROXIMATION
        estimate = Estimate(name, both.response, both.gram_inverse, total, blocks, noise, covers)
        return self.finish(record, context, spectra, estimate)

    def _project(
        self, frequency_hz: FloatArray, u: ComplexArray, y: ComplexArray, r: ComplexArray
    ) -> Projection:
        """Both stages, from spectra of shape (n_config, n_freq, n_axis, n_exp)."""
        references = factor_inputs(r, self.condition_limit)
        to_input = u @ references.inverse
        usable: BoolArray = np.all(np.isfinite(to_input), axis=(-2, -1))
        smoothed, windows = np.zeros_like(to_input), []
        for i, lines in enumerate(map(np.flatnonzero, usable)):
            index, weight = polynomial_weights(
                frequency_hz[lines], self.smoothing_lines, self.smoothing_degree
            )
            smoothed[i, lines] = smooth_over_lines(to_input[i, lines], index, weight)
            windows.append((lines, index, weight))
        projected = factor_inputs(smoothed @ r, self.condition_limit)
        return Projection(references, y @ projected.inverse, projected.gram_inverse, tuple(windows))
