"""What the averaging estimators of thesis section 3.2.3 share: spectra in, covariance and masks out.

Total covariance from the least-squares residuals of all experiments of a configuration, noise from the
differences between periods; both pooled over neighbouring lines (`robid_core.estimation.covariance`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydantic import Field, NonNegativeInt

from robid_core import BoolArray, ComplexArray, Context, FloatArray, Frf, FrfEstimator, Record
from robid_core.estimation.covariance import Pooled, period_products, pool_lines, residual_products
from robid_core.estimation.spectra import InputFactors, factor_inputs, refuse_masked, side_by_side
from robid_core.estimation.speed import drift_leakage


@dataclass(frozen=True)
class Spectra:
    """Spectra of a record by period, and of all experiments of a configuration side by side.

    `u_by_period` and `y_by_period` have shape (n_config, n_block, n_freq, n_axis, n_exp, n_period), `u` and
    `y` (n_config, n_freq, n_axis, n_block * n_exp); `factors` belong to `u`, `residual` holds the products of
    the least-squares residuals, of `weight` degrees of freedom a line.
    """

    frequency_hz: FloatArray
    u_by_period: ComplexArray
    y_by_period: ComplexArray
    u: ComplexArray
    y: ComplexArray
    factors: InputFactors
    residual: ComplexArray
    weight: int


def record_spectra(record: Record, discard: int, condition_limit: float) -> Spectra:
    """Spectra of a record with what the least-squares response of all experiments leaves over."""
    u_by_period, y_by_period = record.spectra_by_period(discard)
    u, y = side_by_side(u_by_period.mean(axis=-1)), side_by_side(y_by_period.mean(axis=-1))
    factors = factor_inputs(u, condition_limit)
    residual = residual_products(u, y, factors.inverse)
    weight = u.shape[-1] - u.shape[-2]
    return Spectra(record.frequency_hz, u_by_period, y_by_period, u, y, factors, residual, weight)


def total_covariance(spectra: Spectra, valid: BoolArray, half_window: int | None) -> Pooled | None:
    """Covariance of the residual of one experiment; None where no experiment is to spare."""
    if spectra.weight < 1:
        return None
    response = spectra.y @ spectra.factors.inverse
    products, power = spectra.residual, _power(spectra)
    return pool_lines(products, spectra.weight, valid, power, response, spectra.frequency_hz, half_window)


def noise_covariance(
    spectra: Spectra, response: ComplexArray, valid: BoolArray, half_window: int | None
) -> Pooled | None:
    """Covariance that the differences between periods show; None with a single period."""
    n_block, n_exp, n_period = (spectra.u_by_period.shape[i] for i in (1, 4, 5))
    if n_period < 2:
        return None
    products = period_products(spectra.u_by_period, spectra.y_by_period, response[:, None]).sum(axis=1)
    weight = (n_period - 1) * n_block * n_exp
    return pool_lines(products, weight, valid, _power(spectra), response, spectra.frequency_hz, half_window)


def _power(spectra: Spectra) -> FloatArray:
    power: FloatArray = np.mean(np.abs(spectra.y) ** 2, axis=-1)
    return power


class Averaging(FrfEstimator):
    """Settings and bookkeeping of the averaging estimators; `run` is the subclass's."""

    discard: NonNegativeInt = 0
    """Leading periods dropped as transient, beyond those that were not recorded."""
    half_window: NonNegativeInt | None = None
    """Lines on either side that share a covariance; null: enough for four degrees of freedom per output."""
    condition_limit: float = Field(default=1e6, gt=1)
    """A line whose input matrix has a larger condition number (axes scaled to equal size) is masked."""

    def finish(
        self,
        record: Record,
        context: Context,
        spectra: Spectra,
        response: ComplexArray,
        gram_inverse: ComplexArray,
        block_response: ComplexArray | None,
        estimator: str,
    ) -> Frf:
        """Mask, state the uncertainty and say what was left out."""
        valid: BoolArray = np.all(np.isfinite(response), axis=(2, 3))
        tell_masked(record, context, valid)
        tell_drift(record, context, self.discard)
        refuse_masked(valid, record.frequency_hz)
        total = total_covariance(spectra, valid, self.half_window)
        noise = noise_covariance(spectra, response, valid, self.half_window)
        speed_rms, slow_sine_speed = record.speed_levels(self.discard)
        return Frf(
            axis_names=record.axis_names,
            estimator=estimator,
            pooling=pooling_in_words(spectra, total, noise),
            sample_time_s=record.run.sample_time_s,
            torque_hold=record.torque_hold,
            angle=record.angle,
            frequency_hz=record.frequency_hz,
            response=response,
            block_response=block_response,
            input_gram_inverse=np.where(valid[..., None, None], gram_inverse, np.nan),
            output_covariance=None if total is None else total.covariance,
            noise_covariance=None if noise is None else noise.covariance,
            degrees_of_freedom=None if total is None else total.degrees_of_freedom,
            valid=valid,
            speed_rms=speed_rms,
            slow_sine_speed=slow_sine_speed,
        )


def pooling_in_words(spectra: Spectra, total: Pooled | None, noise: Pooled | None) -> str:
    """Say how the covariances were collected."""
    n_block, n_in, n_exp = (spectra.u_by_period.shape[i] for i in (1, 3, 4))
    measured = f"{n_block} block{'s' if n_block > 1 else ''} of {n_exp} experiments for {n_in} inputs"
    if total is None:
        words = f"total: none stated, {measured} leave too few residuals"
    else:
        lines = 2 * total.half_window + 1
        words = f"total: residuals of {measured}, {spectra.weight} to spare, pooled over {lines} lines"
    if noise is None:
        return f"{words}; noise: none stated, a single period was kept"
    return f"{words}; noise: differences between periods, pooled over {2 * noise.half_window + 1} lines"


def tell_masked(record: Record, context: Context, valid: BoolArray) -> None:
    """List the masked lines in the log."""
    for configuration, lines in enumerate(valid):
        if not lines.all():
            listed = ", ".join(f"{f:.4g}" for f in record.frequency_hz[~lines])
            context.log.warning(
                "configuration %d: the inputs do not span all axes, masked: %s Hz", configuration, listed
            )


def tell_drift(record: Record, context: Context, discard: int) -> None:
    """Warn where the motor angles do not close over a period and disturb the lines by more than a percent."""
    if record.line is None:
        return
    for configuration, position in enumerate(record.run.values("motor_position")[:, :, :, discard:]):
        for name, leakage in zip(record.axis_names, drift_leakage(position, record.line), strict=True):
            if leakage > 0.01:
                context.log.warning(
                    "configuration %d: %s drifts from period to period, by up to %.1f %% of its motion at a "
                    "line; let it settle longer, or close a position loop",
                    configuration,
                    name,
                    100 * leakage,
                )
