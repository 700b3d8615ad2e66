"""Spectral analysis: responses from cross spectra of segments, direct, joint input-output and by instruments.

Thesis sections 3.2.2 and 3.2.3, Welch (1967) for the segments. On periodic recordings segments are whole periods,
without a window and without leakage; with `segment_s` any recording is cut into shorter, overlapping, windowed
segments, a chirp, noise or any other motion included, and one experiment can be enough.
"""

from __future__ import annotations

from typing import Literal, Self

import numpy as np
from pydantic import Field, NonNegativeInt, PositiveFloat, PositiveInt, model_validator

from robid_core import (
    BoolArray,
    ConfigurationError,
    Context,
    FloatArray,
    Frf,
    FrfEstimator,
    IntArray,
    Record,
)
from robid_core.estimation.response.detection import distortion_levels
from robid_core.estimation.response.spectra import refuse_masked
from robid_core.estimation.response.welch import bands, equivalent_segments, speed_rms
from robid_core.residual import leading_periods
from robid_frf.averaging import tell_masked
from robid_frf.cross_spectra import Estimated, Instruments, Stated, estimate_lines, state
from robid_frf.reading import LineSpectra, left_out, read_spectra
from robid_frf.segments import (
    POSITION,
    Columns,
    Cut,
    cut_record,
    refuse_missing_reference,
    segment_columns,
    whole_periods,
)

# exp(-5) is 0.7 %: below that the bias of the ratio of two responses is no matter.
TRUSTED_REFERENCE_RATIO = 5.0


class Spectral(FrfEstimator):
    """Response from averaged cross spectra: direct ``S_yu S_uu^-1``, or with instruments ``S_yz S_uz^-1``.

    A periodic record is cut into its periods, at its excited lines, unless `segment_s` is given. Everything of a
    configuration is pooled, all blocks, experiments and segments; together they must be at least as many as axes.
    The direct approach is biased by noise on the torque and by feedback; `jio` takes the reference as instrument
    and is not, and `instrument` can take the inputs of the other periods, where no reference was recorded.
    Windowed segments smooth the response: Hann's give ``G + G'' / (6 segment_s^2)``, peaks come out too low, and
    the regions, which do not hold this bias, are about the estimator's own mean.

        frf: {use: frf.spectral, with: {approach: jio, segment_s: 2.0, band_hz: [4, 80], lines: 60}}
    """

    approach: Literal["direct", "jio", "instrument"] = "direct"
    """Instruments of the cross spectra: the inputs themselves, the reference, or those under `instruments`."""
    instruments: Instruments = ("other_period",)
    """For the approach `instrument`: `reference`, `other_period` or both (two-stage least squares)."""
    segment_s: PositiveFloat | None = None
    """Length of a segment, s; by default whole periods. Records that are not periodic need it."""
    overlap: float = Field(default=0.5, ge=0, le=0.9)
    """Share of a segment that the next one takes again."""
    window: Literal["hann", "rectangular"] = "hann"
    """Window of segments; whole periods have none. A rectangular one leaks, noise of the position above all."""
    detrend: Literal["none", "mean", "trend"] = "trend"
    """What is removed from torque and reference in each segment: nothing, the mean, or a straight line."""
    band_hz: tuple[PositiveFloat, PositiveFloat] | None = None
    """Lowest and highest frequency of segments; by default that of the excited lines."""
    lines: PositiveInt | None = None
    """Lines on a logarithmic grid, each an average over the bins next to it; by default every bin is a line."""
    frequency_hz: tuple[PositiveFloat, ...] | None = None
    """Lines to average to, in place of `lines`."""
    discard: NonNegativeInt | None = None
    """Leading periods dropped as transient, beyond those that were not recorded; null: those that differ from the last
    ones by more than noise does."""
    half_window: NonNegativeInt | None = None
    """Lines on either side that share a covariance; by default none where a line has enough of its own."""
    condition_limit: float = Field(default=1e6, gt=1)
    """A line whose inputs or instruments have a larger condition number (scaled to equal size) is masked."""

    @model_validator(mode="after")
    def _possible(self) -> Self:
        if self.segment_s is None:
            idle = [key for key in ("band_hz", "lines", "frequency_hz") if getattr(self, key) is not None]
            if idle:
                raise ValueError(
                    f"{idle[0]}: whole periods are estimated at the excited lines; set segment_s too"
                )
        if self.lines is not None and self.frequency_hz is not None:
            raise ValueError("lines, frequency_hz: give one of them")
        if self.band_hz is not None and self.band_hz[0] >= self.band_hz[1]:
            raise ValueError(f"band_hz: {self.band_hz[0]:g} Hz is not below {self.band_hz[1]:g} Hz")
        if not self.instruments or len(set(self.instruments)) < len(self.instruments):
            raise ValueError("instruments: at least one, and none twice")
        return self

    def run(self, record: Record, context: Context) -> Frf:
        """Estimate the response of each configuration."""
        names = self._instrument_names(record)
        spectra: LineSpectra | None = None
        cut: Cut | None = None
        if self.segment_s is None:
            spectra = self._periods(record, context, names)
            columns, discard = whole_periods(spectra), spectra.discard
        else:
            cut = cut_record(record, self.segment_s, self.overlap, self.window, self.band_hz)
            discard = leading_periods((record,), self.discard, context.log)
            columns = self._segments(record, context, cut, discard)
        groups, frequency = self._lines(record, cut)
        estimated = [
            estimate_lines(one, groups, cut, names, self.condition_limit, f"configuration {c + 1}")
            for c, one in enumerate(columns)
        ]
        response = np.stack([one.response for one in estimated])
        valid: BoolArray = np.all(np.isfinite(response), axis=(2, 3))
        if cut is None:
            tell_masked(record, context, valid)
        elif not valid.all():
            context.log.warning("%d lines masked: the inputs do not span all axes there", int((~valid).sum()))
        refuse_masked(valid, frequency)
        total = self._state(estimated, "total", valid, frequency, groups, cut)
        noise = self._state(estimated, "noise", valid, frequency, groups, cut)
        gram = np.stack([one.gram_inverse for one in estimated])
        odd = even = None
        if spectra is not None:
            quiet, line = spectra.quiet, np.asarray(record.line)
            odd, even = distortion_levels(quiet.u, quiet.y, quiet.line, response, valid, line)
        speed, slow_sine = _speed(record, discard, frequency)
        return Frf(
            axis_names=record.axis_names,
            estimator=f"spectral, {self.approach}",
            pooling="; ".join(
                (
                    _in_words(columns[0], cut, total, noise),
                    *(spectra.words if spectra else left_out(record, discard)),
                )
            ),
            sample_time_s=record.run.sample_time_s,
            torque_hold=record.torque_hold,
            angle=record.angle,
            frequency_hz=frequency,
            response=response,
            input_gram_inverse=np.where(valid[..., None, None], gram, np.nan),
            output_covariance=None if total is None else total.covariance,
            noise_covariance=None if noise is None else noise.covariance,
            degrees_of_freedom=None if total is None else total.degrees_of_freedom,
            noise_degrees_of_freedom=None if noise is None else noise.degrees_of_freedom,
            odd_distortion=odd,
            even_distortion=even,
            valid=valid,
            speed_rms=speed,
            slow_sine_speed=slow_sine,
            travel_covariance=None if record.line is None else record.travel_covariance(discard),
            damping_deviation=record.damping_deviation_at(frequency),
            covers=Frf.OWN_MEAN if record.model_based else _covers(estimated, names, cut, valid),
        )

    def _instrument_names(self, record: Record) -> Instruments:
        """Instruments of the approach; DataRejected where the record cannot give them."""
        names: Instruments = ()
        if self.approach != "direct":
            names = ("reference",) if self.approach == "jio" else self.instruments
        if "reference" in names:
            refuse_missing_reference(record)
        return names

    def _periods(self, record: Record, context: Context, names: Instruments) -> LineSpectra:
        """Spectra of whole periods; ConfigurationError where the record has no lines."""
        if record.line is None:
            length = len(record.run.time_s) * record.run.sample_time_s
            raise ConfigurationError(
                f"segment_s: the record of {length:g} s has no excited lines, so say how long segments shall be; "
                "their inverse is the resolution in Hz, and a long record has many of them"
            )
        return read_spectra(record, context, self.discard, "reference" in names)

    def _segments(self, record: Record, context: Context, cut: Cut, discard: int) -> list[Columns]:
        """Spectra of all segments after some periods."""
        degree = {"none": None, "mean": 0, "trend": 1}[self.detrend]
        columns = segment_columns(record, cut, discard, degree)
        dropped = sum(int((~one.kept).sum()) for one in columns)
        if dropped:
            context.log.warning("%d segments have missing samples and are left out", dropped)
        return columns

    def _lines(self, record: Record, cut: Cut | None) -> tuple[list[IntArray], FloatArray]:
        """Bins of each line, and the lines' frequencies; for whole periods the lines are counted through."""
        if cut is None:
            return [np.array([k]) for k in range(len(record.frequency_hz))], record.frequency_hz
        targets = None
        if self.frequency_hz is not None:
            targets = np.array(self.frequency_hz)
        elif self.lines is not None:
            targets = np.geomspace(cut.bins[0], cut.bins[-1], self.lines) * cut.resolution_hz
        return bands(cut.bins, cut.resolution_hz, targets)

    def _state(
        self,
        estimated: list[Estimated],
        part: str,
        valid: BoolArray,
        frequency: FloatArray,
        groups: list[IntArray],
        cut: Cut | None,
    ) -> Stated | None:
        """Covariance of a part, "total" or "noise"."""
        prefix = "noise_" if part == "noise" else ""
        names = [prefix + name for name in ("products", "weight", "freedom")]
        products, weight, freedom = (np.stack([getattr(one, name) for one in estimated]) for name in names)
        return state(products, weight, freedom, valid, estimated, frequency, groups, cut, self.half_window)


def _speed(record: Record, discard: int, frequency: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Root mean square of the motors' speed, and the slow sine's amplitude where there are lines to tell it by."""
    if record.line is not None:
        return record.speed_levels(discard)
    run = record.run
    position, valid = run.values(POSITION)[:, :, :, discard:], run.valid[:, :, :, discard:]
    highest = 2 * float(frequency[-1])
    rms = np.stack(
        [speed_rms(q, v, run.sample_time_s, highest) for q, v in zip(position, valid, strict=True)]
    )
    return rms, np.zeros_like(rms)


def _covers(estimated: list[Estimated], names: Instruments, cut: Cut | None, valid: BoolArray) -> str:
    """What the regions are about: no leakage and a reference that is heard well make the mean the best linear one."""
    if cut is None and names == ("reference",):
        ratio = np.stack([one.reference_ratio for one in estimated])[valid]
        if (ratio > TRUSTED_REFERENCE_RATIO).all():
            return Frf.BEST_LINEAR_APPROXIMATION
    return Frf.OWN_MEAN


def _in_words(columns: Columns, cut: Cut | None, total: Stated | None, noise: Stated | None) -> str:
    """Say how the covariances were collected."""
    n_exp, n_segment, n_period = columns.u.shape[2:]
    experiments = "1 experiment" if n_exp == 1 else f"{n_exp} experiments"
    if cut is None:
        what = f"whole periods of {experiments}"
    else:
        share = 1 - cut.segments.hop / len(cut.segments.window)
        worth = equivalent_segments(cut.segments)
        each = experiments if n_exp == 1 else f"each of {experiments}"
        what = f"{n_segment} segments (worth {worth:.3g}) in {each}, {share:.0%} overlap"
    words = f"total: none stated, {what} leave too few residuals"
    if total is not None:
        words = f"total: residuals of {what}, pooled over {total.lines} lines"
    if noise is None:
        return f"{words}; noise: none stated, a single period was kept"
    return f"{words}; noise: differences between {n_period} periods, pooled over {noise.lines} lines"
