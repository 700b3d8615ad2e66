"""What the local parametric methods of thesis section 3.2.4 share: spectra in, a local fit per configuration, out.

All experiments of a configuration are fitted together, however many there are; the mathematics is in
`robid_core.estimation.response.local`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal

import numpy as np
from pydantic import Field, NonNegativeInt, PositiveInt

from robid_core import BoolArray, Context, Frf, FrfEstimator, Record
from robid_core.estimation.response.detection import distortion_levels
from robid_core.estimation.response.local.fit import local_rational
from robid_core.estimation.response.local.model import LocalModel
from robid_core.estimation.response.local.result import LocalFit
from robid_core.estimation.response.spectra import refuse_masked, side_by_side
from robid_frf.averaging import noise_covariance
from robid_frf.reading import LineSpectra, read_spectra

Options = Callable[[int], dict[str, Any]]
"""Configuration to further options of `local_rational`."""


class LocalMethod(FrfEstimator):
    """Settings and bookkeeping of the local methods; `run` is the subclass's."""

    needs_lines = True

    approach: Literal["direct", "jio"] = "direct"
    """`direct`: output over input; `jio`: output and input over the reference, then their ratio, without bias from
    feedback."""
    numerator_order: NonNegativeInt = 2
    """Order of the numerator's polynomials in the frequency offset."""
    transient_order: NonNegativeInt | None = None
    """Order of a polynomial for each experiment and output that takes up leakage of a transient; null: none."""
    window_lines: PositiveInt | None = None
    """Lines in a window. With window_hz null too: the fewest, an odd number, that have as many equations more than
    unknowns as there are inputs, and leave four complex degrees of freedom per output; all lines where there are
    not as many."""
    window_hz: float | None = Field(default=None, gt=0)
    """Width of a window in hertz, instead of in lines."""
    choose: Literal["none", "window", "order", "both"] = "none"
    """What the data choose for each configuration: the size of the windows, the orders (equal above and
    below), or both; by how well lines are predicted from their neighbours alone. Settings of what is chosen are
    ignored."""
    discard: NonNegativeInt | None = None
    """Leading periods dropped as transient, beyond those that were not recorded; null: those that differ from the
    last ones by more than noise does."""
    half_window: NonNegativeInt | None = None
    """Lines on either side that share a noise covariance (the total is that of the window); null: enough for four
    degrees of freedom per output."""
    condition_limit: float = Field(default=1e6, gt=1)
    """A line around which the inputs' regressors have a larger condition number (columns scaled) is masked."""

    def estimate(
        self, record: Record, context: Context, name: str, model: LocalModel, options: Options
    ) -> Frf:
        """Fit each configuration, mask, state the uncertainty and say how it came about."""
        spectra = read_spectra(record, context, self.discard, self.approach == "jio")
        u, y = side_by_side(spectra.block_u), side_by_side(spectra.block_y)
        references = None if spectra.reference is None else side_by_side(spectra.reference)
        frequency_hz = spectra.frequency_hz
        fits = [
            local_rational(
                u[i],
                y[i],
                frequency_hz,
                model,
                reference=None if references is None else references[i],
                window_lines=self.window_lines,
                window_hz=self.window_hz,
                choose=self.choose,
                condition_limit=self.condition_limit,
                n_block=spectra.block_u.shape[1],
                **options(i),
            )
            for i in context.track(range(len(u)), len(u), name)
        ]
        valid: BoolArray = np.stack([fit.valid for fit in fits])
        for configuration, lines in enumerate(valid):
            if not lines.all():
                listed = ", ".join(f"{f:.4g}" for f in frequency_hz[~lines])
                context.log.warning(
                    "configuration %d: the inputs around them do not span all axes, masked: %s Hz",
                    configuration,
                    listed,
                )
        refuse_masked(valid, frequency_hz)
        response = np.stack([fit.response for fit in fits])
        covariances = [fit.output_covariance for fit in fits if fit.output_covariance is not None]
        stated = len(covariances) == len(fits)
        noise = noise_covariance(spectra, response, valid, self.half_window)
        quiet, line = spectra.quiet, np.asarray(record.line)
        odd, even = distortion_levels(quiet.u, quiet.y, quiet.line, response, valid, line)
        speed_rms, slow_sine_speed = record.speed_levels(spectra.discard)
        return Frf(
            axis_names=record.axis_names,
            estimator=name,
            pooling=self._in_words(spectra, fits, u.shape[-1], stated, noise is not None),
            sample_time_s=record.run.sample_time_s,
            torque_hold=record.torque_hold,
            angle=record.angle,
            frequency_hz=record.frequency_hz,
            response=response,
            input_gram_inverse=np.stack([fit.gram_inverse for fit in fits]) if stated else None,
            output_covariance=np.stack(covariances) if stated else None,
            noise_covariance=None if noise is None else noise.covariance,
            degrees_of_freedom=np.stack([fit.degrees_of_freedom for fit in fits]) if stated else None,
            noise_degrees_of_freedom=None if noise is None else noise.degrees_of_freedom,
            odd_distortion=odd,
            even_distortion=even,
            valid=valid,
            speed_rms=speed_rms,
            slow_sine_speed=slow_sine_speed,
            travel_covariance=record.travel_covariance(spectra.discard),
            damping_deviation=record.damping_deviation,
        )

    def _in_words(
        self, spectra: LineSpectra, fits: list[LocalFit], n_exp: int, stated: bool, noise: bool
    ) -> str:
        sizes = np.concatenate([fit.windows.size for fit in fits])
        window = f"{sizes.min()}" if sizes.min() == sizes.max() else f"{sizes.min()} to {sizes.max()}"
        experiments = f"{n_exp} experiment{'s' if n_exp > 1 else ''}"
        if stated:
            freedom = np.concatenate([fit.degrees_of_freedom[fit.valid] for fit in fits])
            words = (
                f"total: residuals of local fits over {window} lines of {experiments}, {freedom.min():.3g} degrees of "
                "freedom or more; lines closer than a window share data"
            )
        else:
            words = f"total: none stated, windows of {window} lines of {experiments} leave too few residuals"
        noise_words = "differences between periods" if noise else "none stated, a single period was kept"
        own = sorted({word for fit in fits for word in fit.words})
        return "; ".join((words, f"noise: {noise_words}", *own, *spectra.words))
