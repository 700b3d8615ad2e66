"""What the averaging estimators of thesis section 3.2.3 share: spectra in, covariance and masks out.

Total covariance from the residuals of all experiments of a configuration, noise from the differences between
periods; both pooled over neighbouring lines (`estimation.response.covariance`). Distortion from the bins that
were not excited (`estimation.response.detection`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydantic import Field, NonNegativeInt

from robid_core import BoolArray, ComplexArray, Context, Frf, FrfEstimator, Record
from robid_core.estimation.response.covariance import Pooled, period_products, pool_lines
from robid_core.estimation.response.detection import distortion_levels
from robid_core.estimation.response.spectra import divide_spectra, refuse_masked, side_by_side
from robid_frf.reading import LineSpectra, read_spectra


@dataclass(frozen=True)
class Estimate:
    """A response with all that its covariance is computed from.

    `gram_inverse` (n_config, n_freq, n_axis, n_axis) is ``A^H A`` of the error ``V A`` that residuals V of the
    experiments leave in the response; `products` holds the products of these residuals, of `LineSpectra.spare`
    degrees of freedom a line, `noise_products` of their noise, where they are not those of ``Y - G U``.
    """

    name: str
    response: ComplexArray
    gram_inverse: ComplexArray
    products: ComplexArray
    block_response: ComplexArray | None
    noise_products: ComplexArray | None = None
    covers: str = Frf.OWN_MEAN


@dataclass(frozen=True)
class Joined:
    """Least-squares response of the experiments of all blocks, with the products of its residuals."""

    response: ComplexArray
    gram_inverse: ComplexArray
    products: ComplexArray


def join(spectra: LineSpectra, condition_limit: float) -> Joined:
    """Least squares over all experiments of a configuration."""
    u, y = spectra.block_u, spectra.block_y
    all_blocks = divide_spectra(u, y, condition_limit, joined=True)
    residual = side_by_side(y - all_blocks.value[:, None] @ u)
    products = residual @ residual.conj().swapaxes(-1, -2)
    return Joined(all_blocks.value, all_blocks.gram_inverse, products)


def total_covariance(
    spectra: LineSpectra,
    products: ComplexArray,
    response: ComplexArray,
    valid: BoolArray,
    half_window: int | None,
) -> Pooled | None:
    """Covariance of the residual of one experiment; None where no experiment is to spare."""
    if spectra.spare < 1:
        return None
    power = np.mean(np.abs(spectra.block_y) ** 2, axis=(1, 4))
    return pool_lines(products, spectra.spare, valid, power, response, spectra.frequency_hz, half_window)


def noise_covariance(
    spectra: LineSpectra,
    response: ComplexArray,
    valid: BoolArray,
    half_window: int | None,
    products: ComplexArray | None = None,
) -> Pooled | None:
    """Covariance that the differences between periods show; None with a single period."""
    n_block, n_exp, n_period = (spectra.u_by_period.shape[i] for i in (1, 4, 5))
    if n_period < 2:
        return None
    if products is None:
        products = period_products(spectra.u_by_period, spectra.y_by_period, response[:, None]).sum(axis=1)
    weight = (n_period - 1) * n_block * n_exp
    power = np.mean(np.abs(spectra.block_y) ** 2, axis=(1, 4))
    return pool_lines(products, weight, valid, power, response, spectra.frequency_hz, half_window)


class Averaging(FrfEstimator):
    """Settings and bookkeeping of the averaging estimators; `run` is the subclass's."""

    needs_lines = True

    discard: NonNegativeInt | None = None
    """Leading periods dropped as transient, beyond those that were not recorded; null: those that differ from the
    last ones by more than noise does (a record in steady state loses one in a thousand times at most)."""
    half_window: NonNegativeInt | None = None
    """Lines on either side that share a covariance; null: enough for four degrees of freedom per output."""
    condition_limit: float = Field(default=1e6, gt=1)
    """A line whose input matrix has a larger condition number (axes scaled to equal size) is masked."""

    def read(self, record: Record, context: Context, reference: bool = False) -> LineSpectra:
        """Spectra of the periods that count."""
        return read_spectra(record, context, self.discard, reference)

    def finish(self, record: Record, context: Context, spectra: LineSpectra, estimate: Estimate) -> Frf:
        """Mask, state the uncertainty and say what was left out."""
        response = estimate.response
        valid: BoolArray = np.all(np.isfinite(response), axis=(2, 3))
        valid &= np.all(np.isfinite(estimate.gram_inverse), axis=(2, 3))
        tell_masked(record, context, valid)
        refuse_masked(valid, record.frequency_hz)
        total = total_covariance(spectra, estimate.products, response, valid, self.half_window)
        noise = noise_covariance(spectra, response, valid, self.half_window, estimate.noise_products)
        quiet, line = spectra.quiet, np.asarray(record.line)
        odd, even = distortion_levels(quiet.u, quiet.y, quiet.line, response, valid, line)
        speed_rms, slow_sine_speed = record.speed_levels(spectra.discard)
        used = valid[..., None, None]
        return Frf(
            axis_names=record.axis_names,
            estimator=estimate.name,
            pooling=pooling_in_words(spectra, total, noise),
            sample_time_s=record.run.sample_time_s,
            torque_hold=record.torque_hold,
            angle=record.angle,
            frequency_hz=record.frequency_hz,
            response=np.where(used, response, np.nan),
            block_response=estimate.block_response,
            input_gram_inverse=np.where(used, estimate.gram_inverse, np.nan),
            output_covariance=None if total is None else total.covariance,
            noise_covariance=None if noise is None else noise.covariance,
            degrees_of_freedom=None if total is None else total.degrees_of_freedom,
            noise_degrees_of_freedom=None if noise is None else noise.degrees_of_freedom,
            odd_distortion=odd,
            even_distortion=even,
            valid=valid,
            speed_rms=speed_rms,
            slow_sine_speed=slow_sine_speed,
            travel_covariance=record.travel_covariance(spectra.discard),
            damping_deviation=record.damping_deviation,
            covers=Frf.OWN_MEAN if record.model_based else estimate.covers,
        )


def pooling_in_words(spectra: LineSpectra, total: Pooled | None, noise: Pooled | None) -> str:
    """Say how the covariances were collected."""
    n_block, n_in, n_exp = (spectra.u_by_period.shape[i] for i in (1, 3, 4))
    measured = (
        f"{_counted(n_block, 'block')} of {_counted(n_exp, 'experiment')} for {_counted(n_in, 'input')}"
    )
    if total is None:
        words = f"total: none stated, {measured} leave too few residuals"
    else:
        lines = 2 * total.half_window + 1
        freedom = "degree of freedom" if spectra.spare == 1 else "degrees of freedom"
        words = (
            f"total: residuals of {measured}, {spectra.spare} {freedom} at a line, pooled over {lines} lines"
        )
    if noise is None:
        words = f"{words}; noise: none stated, a single period was kept"
    else:
        words = f"{words}; noise: differences between periods, pooled over {2 * noise.half_window + 1} lines"
    return "; ".join((words, *spectra.words))


def _counted(number: int, thing: str) -> str:
    return f"{number} {thing}{'' if number == 1 else 's'}"


def tell_masked(record: Record, context: Context, valid: BoolArray) -> None:
    """List the masked lines in the log."""
    for configuration, lines in enumerate(valid):
        if not lines.all():
            listed = ", ".join(f"{f:.4g}" for f in record.frequency_hz[~lines])
            context.log.warning(
                "configuration %d: the inputs do not span all axes, masked: %s Hz", configuration, listed
            )
