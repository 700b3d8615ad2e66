"""What is fitted to what, from which experiments: a local fit before model and windows are decided."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from robid_core.arrays import BoolArray, ComplexArray, FloatArray
from robid_core.estimation.response.local.compiled import CompiledFit, can_be_compiled, compiled_fit
from robid_core.estimation.response.local.joint import condition_of, ratio
from robid_core.estimation.response.local.model import LocalModel
from robid_core.estimation.response.local.plain import PlainFit, plain_fit
from robid_core.estimation.response.local.prior import denominators
from robid_core.estimation.response.local.window import Windows, choose_windows


@dataclass(frozen=True)
class Ratio:
    """Response (n_freq, n_out, n_in), which lines are `valid`, and the factors of its first-order error (`joint`)."""

    response: ComplexArray
    valid: BoolArray
    left: ComplexArray | None
    right: ComplexArray | None


@dataclass(frozen=True)
class Task:
    """Spectra of regressors r (n_freq, n_in, n_exp) and of what is fitted over them, z (n_freq, n_fitted, n_exp).

    z are the outputs, and with `joint` the inputs below them; the first `n_out` are outputs. `poles_hz` as
    in `fit.local_rational`.
    """

    r: ComplexArray
    z: ComplexArray
    frequency_hz: FloatArray
    n_out: int
    joint: bool
    poles_hz: ComplexArray | None
    compiled: bool

    def of_experiments(self, kept: BoolArray) -> Task:
        """The same from some of the experiments, (n_exp,)."""
        return replace(self, r=self.r[..., kept], z=self.z[..., kept])

    def windows(self, model: LocalModel, lines: int | None, hertz: float | None) -> Windows:
        """Windows of given size, or of the default one; raises as `choose_windows`."""
        return choose_windows(
            self.frequency_hz,
            model,
            self.r.shape[1],
            *self.z.shape[1:],
            window_lines=lines,
            window_hz=hertz,
            n_stated=self.n_out,
        )

    def freedom(self, model: LocalModel, windows: Windows) -> FloatArray:
        """Complex degrees of freedom per output that each window leaves, (n_freq,)."""
        n_in, n_fitted, n_exp = self.r.shape[1], *self.z.shape[1:]
        return np.array([model.freedom(int(size), n_in, n_fitted, n_exp) for size in windows.size])

    def fit(
        self, model: LocalModel, windows: Windows, iterations: int = 0, *, judged: bool = False
    ) -> PlainFit | CompiledFit:
        """Fit all lines; where it is only `judged` how well it predicts, without what covariances are made of."""
        in_loop = self.joint and model.parametrization == "mimo" and model.denominator_order > 0
        simple = iterations == 0 and self.poles_hz is None and can_be_compiled(model, self.z.shape[1])
        if self.compiled and simple and (judged or not in_loop):
            return compiled_fit(self.r, self.z, windows, model, with_covariance=not judged)
        known = None if self.poles_hz is None else denominators(self.poles_hz, windows, model.numerator_order)
        return plain_fit(
            self.r,
            self.z,
            windows,
            model,
            iterations=iterations,
            denominators=known,
            loop_freedom=self.freedom(model, windows) if in_loop and not judged else None,
        )

    def ratio(self, fit: PlainFit | CompiledFit, condition_limit: float) -> Ratio:
        """Response of a fit, and where it can be trusted; of no use where it cannot."""
        valid: BoolArray = fit.condition <= condition_limit
        response = fit.numerator[:, 0].copy()
        if not self.joint:
            return Ratio(response, valid, None, None)
        valid &= condition_of(response[:, self.n_out :]) <= condition_limit
        n_fitted, n_in = response.shape[1:]
        response[~valid] = np.eye(n_fitted, n_in) + np.eye(n_fitted, n_in, k=-self.n_out)
        response, left, right = ratio(response, self.n_out)
        return Ratio(response, valid, left, right)
