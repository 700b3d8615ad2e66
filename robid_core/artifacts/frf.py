"""A measured frequency response matrix with its uncertainty."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal, Self

import numpy as np
import numpy.typing as npt

from robid_core.arrays import BoolArray, ComplexArray, FloatArray
from robid_core.artifacts import from_arrays as arrays
from robid_core.artifacts.artifact import Artifact, array
from robid_core.artifacts.record import Record
from robid_core.artifacts.tables import Table, response_table
from robid_core.errors import PluginError


@dataclass(frozen=True, eq=False)
class Frf(Artifact):
    """Response from motor torque to motor acceleration in each configuration.

    The covariance of vec(G) (column after column: entry (i, j) stands at j * n_out + i) at a line is
    stored factored, ``conj(input_gram_inverse) (x) output_covariance`` (science: (U U^H)^-T (x) C_V), and a damping of
    motor a that is uncertain by `damping_deviation` adds the error ``G e_a e_a^T G / (i w)``; ask `covariance()` for
    both together. `degrees_of_freedom` counts the complex residuals behind `output_covariance`,
    `pooling` says how they were collected. Lines where `valid` is false hold no number worth using.
    `speed_rms` and `slow_sine_speed` say under which motion of the motors the response was measured: a
    nonlinear robot has another response under another motion. `travel_covariance` is that of the motors' angles about
    their mean in an experiment: the response is a mean over the poses that the motion visits.

    `covers` says what the stated regions are about: OWN_MEAN, what the estimator would give on average over many
    repetitions, or BEST_LINEAR_APPROXIMATION, where the estimator's bias is part of the region or known to be
    negligible and the record was measured, not made with a model. `noise_covariance` is the part of
    `output_covariance` that differs from period to period, with `noise_degrees_of_freedom`. `odd_distortion` and
    `even_distortion` are levels of the residual Y - G U of one experiment at detection lines (bins that were not
    excited), root mean square of the DFT coefficient scaled by 1/n_sample, carried over to the lines; noise is in them.
    """

    OWN_MEAN: ClassVar[str] = "own mean"
    BEST_LINEAR_APPROXIMATION: ClassVar[str] = "best linear approximation"

    axis_names: tuple[str, ...]
    estimator: str
    pooling: str
    sample_time_s: float
    torque_hold: str
    angle: FloatArray = array("n_config n_axis", "rad")
    frequency_hz: FloatArray = array("n_freq", "Hz", rising=True, least=0.0)
    response: ComplexArray = array("n_config n_freq n_out n_in", "(rad/s^2)/(N m)", finite=False, known=True)
    block_response: ComplexArray | None = array(
        "n_config n_block n_freq n_out n_in", "(rad/s^2)/(N m)", finite=False, optional=True
    )
    input_gram_inverse: ComplexArray | None = array(
        "n_config n_freq n_in n_in", "1/(N m)^2", finite=False, optional=True, known=True, covariance=True
    )
    output_covariance: ComplexArray | None = array(
        "n_config n_freq n_out n_out",
        "(rad/s^2)^2",
        finite=False,
        optional=True,
        known=True,
        covariance=True,
    )
    noise_covariance: ComplexArray | None = array(
        "n_config n_freq n_out n_out",
        "(rad/s^2)^2",
        finite=False,
        optional=True,
        known=True,
        covariance=True,
    )
    degrees_of_freedom: FloatArray | None = array("n_config n_freq", optional=True, least=0.0)
    noise_degrees_of_freedom: FloatArray | None = array("n_config n_freq", optional=True, least=0.0)
    odd_distortion: FloatArray | None = array("n_config n_freq n_out", "rad/s^2", finite=False, optional=True)
    even_distortion: FloatArray | None = array(
        "n_config n_freq n_out", "rad/s^2", finite=False, optional=True
    )
    valid: BoolArray | None = array("n_config n_freq", optional=True)
    speed_rms: FloatArray | None = array("n_config n_axis", "rad/s", optional=True)
    slow_sine_speed: FloatArray | None = array("n_config n_axis", "rad/s", optional=True)
    travel_covariance: FloatArray | None = array(
        "n_config n_axis n_axis", "rad^2", optional=True, covariance=True
    )
    damping_deviation: FloatArray | None = array("n_config n_freq n_axis", "N m s/rad", optional=True)
    covers: str = OWN_MEAN

    @property
    def has_covariance(self) -> bool:
        """Tell whether the estimator could state an uncertainty."""
        return self.input_gram_inverse is not None and self.output_covariance is not None

    @property
    def valid_lines(self) -> BoolArray:
        """Usable lines, shape (n_config, n_freq)."""
        everything: BoolArray = np.full(self.response.shape[:2], True)
        return everything if self.valid is None else self.valid

    def covariance(self, configuration: int) -> ComplexArray:
        """Dense covariance of vec(G) in one configuration, shape (n_freq, n_out*n_in, n_out*n_in).

        >>> from robid_core.testing import example_frf, example_robot
        >>> example_frf(example_robot(2)).covariance(0).shape
        (19, 4, 4)
        """
        if self.input_gram_inverse is None or self.output_covariance is None:
            raise ValueError(f"{self.estimator} states no covariance")
        gram = self.input_gram_inverse[configuration].conj()
        noise = self.output_covariance[configuration]
        n_freq, n_in, n_out = len(gram), gram.shape[1], noise.shape[1]
        dense = np.einsum("fjl,fik->fjilk", gram, noise)
        result: ComplexArray = dense.reshape(n_freq, n_in * n_out, n_in * n_out)
        errors = self._damping_errors()
        if errors is not None:
            by_column = errors[configuration].swapaxes(-1, -2).reshape(n_freq, -1, n_in * n_out)
            result = result + by_column.swapaxes(-1, -2) @ by_column.conj()
        return result

    def _damping_errors(self) -> ComplexArray | None:
        """Error of the response that one deviation of each damping makes, (n_config, n_freq, n_axis, n_out, n_in)."""
        if self.damping_deviation is None:
            return None
        size = self.damping_deviation / (2j * np.pi * self.frequency_hz[:, None])
        g = self.response
        result: ComplexArray = size[..., None, None] * g.swapaxes(-1, -2)[..., :, None] * g[..., :, None, :]
        return result

    def variance(self) -> FloatArray:
        """Variance of each entry (complex: of real plus imaginary part), shape of `response`.

        >>> import robid_core as robid
        >>> frf = robid.Frf.from_arrays(
        ...     [2.0, 2j], [5.0, 10.0], deviation=0.1, angle=[[0.0]], sample_time_s=1e-3, torque_hold="continuous")
        >>> frf.variance().round(6).ravel().tolist()
        [0.01, 0.01]
        """
        if self.input_gram_inverse is None or self.output_covariance is None:
            raise ValueError(f"{self.estimator} states no covariance")
        gram = np.einsum("cfjj->cfj", self.input_gram_inverse).real
        noise = np.einsum("cfii->cfi", self.output_covariance).real
        result: FloatArray = noise[..., :, None] * gram[..., None, :]
        errors = self._damping_errors()
        return result if errors is None else result + np.sum(np.abs(errors) ** 2, axis=2)

    @classmethod
    def from_arrays(
        cls,
        response: npt.ArrayLike,
        frequency_hz: npt.ArrayLike,
        *,
        angle: npt.ArrayLike,
        sample_time_s: float,
        torque_hold: Literal["zero_order_hold", "continuous"],
        axes: str = "",
        unit: str = arrays.ACCELERATION,
        deviation: npt.ArrayLike | None = None,
        degrees_of_freedom: float | None = None,
        axis_names: Sequence[str] = (),
        robot: arrays.Axes | None = None,
        estimator: str = "arrays",
    ) -> Self:
        """Make a frequency response of arrays.

        Parameters
        ----------
        response
            From motor torque to motor acceleration, (n_config, n_freq, n_out, n_in); one configuration may lack the
            first axis, one motor the last two, or in the order that `axes` says. NaN where a line has none.
        frequency_hz
            Shape (n_freq,).
        angle
            Motor angles seen through the gear, rad, (n_config, n_axis).
        sample_time_s
            Of the controller.
        torque_hold
            "zero_order_hold" where the response is that to a torque held between samples, "continuous" to one that is
            not: half a sample of phase lies between the two.
        axes
            Names of the axes of `response`, and of a `deviation` that is an array, in their order, out of
            `n_config n_freq n_out n_in`; one that is not named has length one.
        unit
            "(rad/s^2)/(N m)", or "(rad/s)/(N m)" or "rad/(N m)", which are multiplied by i w or its square.
        deviation
            Standard deviation of each entry (complex: of real plus imaginary part) in the same unit, a number or an
            array like `response`; entries are taken as uncorrelated.
        degrees_of_freedom
            Behind the deviation; by default it counts as known.
        axis_names, robot
            Names of the axes, or whose they are; by default axis_1, axis_2, ...
        estimator
            What made the response, in words.

        Raises
        ------
        DataRejected
            Where shapes or units do not belong together, or the deviations have no factors for outputs and inputs.

        Examples
        --------
        A rigid motor of 1e-3 kg m^2, measured as a mobility:

        >>> import numpy as np, robid_core as robid
        >>> frequency = np.array([5.0, 10.0, 20.0])
        >>> mobility = 1 / (2j * np.pi * frequency * 1e-3)
        >>> frf = robid.Frf.from_arrays(
        ...     mobility, frequency, unit="(rad/s)/(N m)", deviation=0.1, angle=[[0.0]], sample_time_s=1e-3,
        ...     torque_hold="continuous")
        >>> frf.response[0, :, 0, 0].real.round(6).tolist()
        [1000.0, 1000.0, 1000.0]

        With frequencies last, as other programs keep them:

        >>> frf = robid.Frf.from_arrays(
        ...     np.ones((2, 2, 3)), frequency, axes="n_out n_in n_freq", angle=[[0.0, 0.0]], sample_time_s=1e-3,
        ...     torque_hold="continuous")
        >>> frf.response.shape
        (1, 3, 2, 2)
        """
        frequency: FloatArray = np.asarray(frequency_hz, dtype=np.float64)
        full = arrays.response(response, frequency, unit, axes)
        n_config, n_axis = len(full), full.shape[-1]
        inputs = outputs = None
        if deviation is not None:
            inputs, outputs = arrays.factored_variance(deviation, frequency, unit, full.shape, axes)
        known = degrees_of_freedom is not None
        valid: BoolArray = np.all(np.isfinite(full), axis=(2, 3))
        return cls(
            axis_names=arrays.names_of_axes(robot, axis_names, n_axis),
            estimator=estimator,
            pooling="stated with the arrays" if deviation is not None else "none stated",
            sample_time_s=sample_time_s,
            torque_hold=arrays.hold(torque_hold),
            angle=arrays.angles(angle, robot, None, n_config, n_axis),
            frequency_hz=frequency,
            response=full,
            input_gram_inverse=inputs,
            output_covariance=outputs,
            degrees_of_freedom=np.full(full.shape[:2], degrees_of_freedom) if known else None,
            valid=valid,
        )

    def table(self) -> Table:
        """Return a row for each entry at each line: configuration, frequency, output, input, size, phase, deviation.

        Examples
        --------
        >>> import robid_core as robid
        >>> frf = robid.Frf.from_arrays(
        ...     [2.0, 2j], [5.0, 10.0], angle=[[0.0]], sample_time_s=1e-3, torque_hold="continuous")
        >>> table = frf.table()
        >>> table["frequency_hz"], table["size"], table["phase_deg"]
        ([5.0, 10.0], [2.0, 2.0], [0.0, 90.0])
        """
        return response_table(self)

    @classmethod
    def from_blocks(
        cls,
        record: Record,
        blocks: ComplexArray,
        *,
        discard: int = 0,
        half_window: int | None = None,
        estimator: str = "mean of blocks",
    ) -> Self:
        """Mean of one response per block, with the covariance that their scatter gives.

        For any estimator that makes a response of each block by itself. Lines where a block response or its
        input matrix is of no use are masked.

        Parameters
        ----------
        record
            The measurement: frequencies, angles, motion and the inputs' Gram matrices are taken from it.
        blocks
            Responses, shape (n_config, n_block, n_freq, n_out, n_in); NaN where a line has none. With one
            block only, or with fewer experiments in a block than inputs, no covariance is stated.
        discard
            Leading periods that the block responses did not use.
        half_window
            Lines on either side that share a covariance; None chooses (see `default_half_window`).
        estimator
            Name for people.

        Raises
        ------
        PluginError
            If `blocks` does not have the shape of the record, or no numbers at more than a tenth of a
            configuration's lines at which the inputs span all axes.
        PoorExcitation
            If more than a tenth of a configuration's lines is masked.

        Examples
        --------
        An estimator of one's own:

        >>> import numpy as np, robid_core as robid
        >>> from robid_core.testing import example_record
        >>> record = example_record(robid.Robot.load("one_axis"))
        >>> u, y = record.spectra()
        >>> robid.Frf.from_blocks(record, y @ np.linalg.inv(u), estimator="own")
        <Frf by own: 2 configurations, 19 lines from 10 to 82 Hz of axis_1; uncertainty: scatter of 2 blocks, ...>
        """
        from robid_core.estimation.response.covariance import block_products, gram_inverse_of_mean, pool_lines
        from robid_core.estimation.response.spectra import (
            CONDITION_LIMIT,
            factor_inputs,
            refuse_masked,
            refuse_without_numbers,
        )

        u, y = record.spectra(discard)
        n_config, n_block, n_freq, n_axis, n_exp = u.shape
        if blocks.shape != (n_config, n_block, n_freq, n_axis, n_axis):
            raise PluginError(
                f"{estimator}: block responses of shape {blocks.shape} do not belong to a record of "
                f"{n_config} configurations, {n_block} blocks, {n_freq} lines and {n_axis} axes"
            )
        valid: BoolArray = np.all(np.isfinite(blocks), axis=(1, 3, 4))
        gram_inverse = pooled = None
        pooling = "none stated: the scatter of blocks needs two blocks, each with an experiment per input"
        if n_exp >= n_axis:
            factors = factor_inputs(u)
            spanned: BoolArray = np.all(factors.condition <= CONDITION_LIMIT, axis=1)
            refuse_without_numbers(valid, spanned, record.frequency_hz, estimator)
            valid &= spanned
            block_valid = valid[:, None, :, None, None]
            by_block = np.where(block_valid, factors.gram_inverse, np.eye(n_axis)).swapaxes(0, 1)
            gram_inverse = np.where(valid[..., None, None], gram_inverse_of_mean(by_block), np.nan)
            if n_block >= 2:
                used = np.where(block_valid, blocks, 0).swapaxes(0, 1)
                weight = (n_block - 1) * n_axis
                power = np.mean(np.abs(y) ** 2, axis=(1, 4))
                products = block_products(used, by_block)
                mean = used.mean(axis=0)
                pooled = pool_lines(products, weight, valid, power, mean, record.frequency_hz, half_window)
        if pooled is not None:
            pooling = f"scatter of {n_block} blocks, pooled over {2 * pooled.half_window + 1} lines"
        if discard:
            pooling = f"{pooling}; {discard} of {record.run.n_period} periods left out"
        refuse_masked(valid, record.frequency_hz)
        speed_rms, slow_sine_speed = record.speed_levels(discard)
        return cls(
            axis_names=record.axis_names,
            estimator=estimator,
            pooling=pooling,
            sample_time_s=record.run.sample_time_s,
            torque_hold=record.torque_hold,
            angle=record.angle,
            frequency_hz=record.frequency_hz,
            response=np.where(valid[..., None, None], blocks.mean(axis=1), np.nan),
            block_response=np.where(valid[:, None, :, None, None], blocks, np.nan),
            input_gram_inverse=gram_inverse,
            output_covariance=None if pooled is None else pooled.covariance,
            degrees_of_freedom=None if pooled is None else pooled.degrees_of_freedom,
            valid=valid,
            speed_rms=speed_rms,
            slow_sine_speed=slow_sine_speed,
            travel_covariance=record.travel_covariance(discard),
            damping_deviation=record.damping_deviation,
        )
