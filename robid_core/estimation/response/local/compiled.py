"""Fits of all lines by the kernel, in the form of `plain.PlainFit`: full matrix fractions and polynomials."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid_core.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from robid_core.estimation.response.local.common_regressors import common_factors
from robid_core.estimation.response.local.covariance import with_floor
from robid_core.estimation.response.local.joint import carry_product
from robid_core.estimation.response.local.kernel import LineFits, solve_lines
from robid_core.estimation.response.local.model import LocalModel
from robid_core.estimation.response.local.window import Windows


@dataclass(frozen=True)
class CompiledFit:
    """Solutions of all lines; `condition` (n_freq,) is one over the sine of the smallest angle between regressors."""

    windows: Windows
    numerator: ComplexArray
    denominator: ComplexArray
    condition: FloatArray
    passes: IntArray
    lines: LineFits
    power: FloatArray

    def factors(
        self, freedom: FloatArray, valid: BoolArray, left: ComplexArray | None, right: ComplexArray | None
    ) -> tuple[ComplexArray, ComplexArray]:
        """Factors of the covariance; see `common_regressors.common_factors`."""
        influence, free = np.asarray(self.lines.influence), np.asarray(self.lines.free)
        n_out = self.power.shape[1] if left is None else left.shape[1]
        gram, covariance = common_factors(
            self.numerator,
            self.denominator,
            with_floor(self.lines.products, self.power, freedom),
            influence,
            free / freedom[:, None],
            self.windows.frequency_hz / self.windows.frequency_hz[-1],
            valid,
            n_out,
        )
        if left is None or right is None:
            return gram, covariance
        gram, covariance = carry_product(gram, covariance, left, right)
        gram[~valid], covariance[~valid] = np.eye(gram.shape[1]), np.eye(n_out)
        return gram, covariance

    def own_gram(self) -> ComplexArray:
        """Variance of the rows of G for errors of variance one, the same for all: (n_freq, 1, n_in, n_in)."""
        return self.lines.gram.conj()[:, None]


def can_be_compiled(model: LocalModel, n_out: int) -> bool:
    """Whether all outputs have the same regressors, and none of them is a transient."""
    common = model.parametrization == "mimo" or model.denominator_order == 0 or n_out == 1
    return common and model.transient_order is None


def compiled_fit(
    u: ComplexArray, y: ComplexArray, windows: Windows, model: LocalModel, *, with_covariance: bool = True
) -> CompiledFit:
    """Fit all lines; arguments as of `plain.plain_fit`. Without covariance `factors` has nothing to go on."""
    n_freq, n_in, _ = u.shape
    n_out = y.shape[1]
    lines = solve_lines(u, y, windows, model, with_influence=with_covariance)
    edge = (model.numerator_order + 1) * n_in
    numerator = lines.theta[:, :edge].reshape(n_freq, -1, n_in, n_out).swapaxes(-1, -2)
    identity = np.broadcast_to(np.eye(n_out, dtype=np.complex128), (n_freq, 1, n_out, n_out))
    rest = lines.theta[:, edge:].reshape(n_freq, -1, n_out, n_out).swapaxes(-1, -2)
    ratio = lines.ratio
    return CompiledFit(
        windows=windows,
        numerator=np.ascontiguousarray(numerator),
        denominator=np.concatenate((identity, rest), axis=1),
        condition=np.where(ratio > 0, 1.0 / np.sqrt(np.where(ratio > 0, ratio, 1.0)), np.inf),
        passes=np.zeros(n_freq, dtype=np.int64),
        lines=lines,
        power=window_power(y, windows),
    )


def window_power(y: ComplexArray, windows: Windows) -> FloatArray:
    """Mean square of each output over the window of each line, (n_freq, n_out)."""
    total = np.concatenate((np.zeros((1, y.shape[1])), np.cumsum(np.mean(np.abs(y) ** 2, axis=2), axis=0)))
    power: FloatArray = (total[windows.last + 1] - total[windows.first]) / windows.size[:, None]
    result: FloatArray = np.maximum(power, 1e-16 * total[-1])
    return result
