"""Columns of the cross spectra of a record: whole periods at its lines, or windowed segments of any recording."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid_core import BoolArray, ComplexArray, ConfigurationError, DataRejected, FloatArray, IntArray, Record
from robid_core.estimation.response.welch import (
    Segmentation,
    difference_correction,
    second_difference,
    segment_spectra,
    segmentation,
)
from robid_frf.reading import REFERENCES, LineSpectra

TORQUE, POSITION = "motor_torque", "motor_position"


@dataclass(frozen=True)
class Columns:
    """Spectra of one configuration at consecutive bins, each (n_bin, n_axis, n_exp, n_segment, n_period).

    Experiments of all blocks are counted through; `y` is acceleration; `r` the reference, None where the record
    has none. `kept` (n_exp, n_segment) marks the segments without missing samples, the others are zero.
    """

    u: ComplexArray
    y: ComplexArray
    r: ComplexArray | None
    kept: BoolArray


def reference_channel(record: Record) -> str | None:
    """Name of the reference: the speed's where there is one, else the position's."""
    return next((name for name in REFERENCES if name in record.run.channels), None)


def refuse_missing_reference(record: Record) -> None:
    """Raise DataRejected where no reference was recorded."""
    if reference_channel(record) is None:
        raise DataRejected(
            f"A06: the record has no reference channel ({' or '.join(REFERENCES)}), which the joint input-output "
            f"approach needs; it has {', '.join(sorted(record.run.channels))}"
        )


def whole_periods(spectra: LineSpectra) -> list[Columns]:
    """Spectra of whole periods at the excited lines, without a window, one entry per configuration."""
    u, y, r = spectra.u_by_period, spectra.y_by_period, spectra.reference
    again = None if r is None else np.broadcast_to(r[..., None], u.shape)

    def columns(one: ComplexArray) -> ComplexArray:
        """(n_block, n_freq, n_axis, n_exp, n_period) -> (n_freq, n_axis, n_block * n_exp, 1, n_period)."""
        moved = np.moveaxis(one, 0, 2)
        return moved.reshape(*moved.shape[:2], -1, 1, moved.shape[-1])

    kept = np.full((u.shape[1] * u.shape[4], 1), True)
    return [
        Columns(columns(u[c]), columns(y[c]), None if again is None else columns(again[c]), kept)
        for c in range(len(u))
    ]


@dataclass(frozen=True)
class Cut:
    """How a record is cut: segments, and the bins of a segment inside the band."""

    segments: Segmentation
    bins: IntArray
    resolution_hz: float
    repeats: bool


def repeats(record: Record) -> bool:
    """Tell whether the periods of a record are repetitions of one steady state."""
    return record.line is not None or record.run.n_period > 1


def cut_record(
    record: Record, segment_s: float, overlap: float, window: str, band_hz: tuple[float, float] | None
) -> Cut:
    """Fit segments to a record.

    A record that repeats is cut in its period, going round; one that does not, inside its first and last sample,
    which the second difference of the position needs.

    Raises
    ------
    ConfigurationError
        If the segments do not fit, or no band is given and the record has no lines to take it from.
    """
    step, again = record.run.sample_time_s, repeats(record)
    length = round(segment_s / step)
    n_sample = len(record.run.time_s)
    segments = segmentation(n_sample if again else n_sample - 2, length, overlap, window, again)
    if band_hz is None:
        if record.line is None:
            raise ConfigurationError(
                "band_hz: the record has no excited lines, so say from where to where in Hz"
            )
        band_hz = float(record.frequency_hz.min()), float(record.frequency_hz.max())
    resolution = 1.0 / (length * step)
    # The mean and, through Hann's window, bin 1 belong to what is removed as mean and trend.
    first = max(int(np.ceil(band_hz[0] / resolution - 1e-9)), 1 if window == "rectangular" else 2)
    last = min(int(np.floor(band_hz[1] / resolution + 1e-9)), (length - 1) // 2)
    if last < first:
        raise ConfigurationError(
            f"band_hz: no bin of a segment of {segment_s:g} s, {resolution:.4g} Hz apart, lies usably between "
            f"{band_hz[0]:g} and {band_hz[1]:g} Hz; take longer segments"
        )
    return Cut(segments, np.arange(first, last + 1, dtype=np.int64), resolution, again)


def segment_columns(record: Record, cut: Cut, discard: int, degree: int | None) -> list[Columns]:
    """Spectra of all segments, one entry per configuration.

    Segments with a missing sample are left out; where the record repeats a missing sample is an error.
    """
    run, step = record.run, record.run.sample_time_s
    name = reference_channel(record)
    channels = [TORQUE, POSITION] + ([] if name is None else [name])
    valid = _kept_periods(record, discard, channels, cut.repeats)
    frequency_hz: FloatArray = cut.bins * np.float64(cut.resolution_hz)
    correction = difference_correction(frequency_hz, step)[:, None, None]
    result = []
    for c in range(len(record.angle)):
        spectra = []
        for channel in channels:
            signals = np.where(valid[c][..., None], run.values(channel)[c, :, :, discard:], 0.0)
            differentiate = channel in (POSITION, REFERENCES[1])
            one = _spectra(signals, cut, degree, step, differentiate)
            spectra.append(one * correction[..., None, None] if differentiate else one)
        kept = _kept_segments(valid[c], cut)
        for one in spectra:
            one *= kept[:, :, None]
        result.append(Columns(spectra[0], spectra[1], spectra[2] if name else None, kept))
    return result


def _kept_periods(record: Record, discard: int, channels: list[str], again: bool) -> BoolArray:
    """Marks of measured samples; DataRejected where something that is needed is missing or NaN."""
    run = record.run
    if discard >= run.n_period:
        raise DataRejected(
            f"{run.n_period} periods were measured and {discard} are to be dropped: none is left"
        )
    valid = run.valid[:, :, :, discard:]
    if again and not valid.all():
        c, m, e, p, n = (int(i) for i in np.argwhere(~valid)[0])
        raise DataRejected(
            f"a sample is missing in {run.sample_place(c, m, e, p + discard, n)}; cut the recording there, or read it "
            "with gaps: split"
        )
    for name in channels:
        bad = np.argwhere(~np.isfinite(run.values(name)[:, :, :, discard:]) & valid[..., None])
        if len(bad):
            c, m, e, p, n, a = (int(i) for i in bad[0])
            raise DataRejected(
                f"A05: {name} of {record.axis_names[a]} is NaN or infinite in {len(bad)} samples, first in "
                f"{run.sample_place(c, m, e, p + discard, n)}; mark such samples as missing"
            )
    return valid


def _spectra(
    signals: FloatArray, cut: Cut, degree: int | None, step: float, differentiate: bool
) -> ComplexArray:
    """From (n_block, n_exp, n_period, n_sample, n_axis) to (n_bin, n_axis, n_block * n_exp, n_segment, n_period)."""
    signals = signals.reshape(-1, *signals.shape[2:])
    if differentiate:
        # No mean and no trend are left; to fit them would bring the noise of the ends down into the band.
        signals, degree = _differences(signals, cut.repeats, step), None
    elif not cut.repeats:
        signals = signals[:, :, 1:-1]
    by_signal = [[segment_spectra(one, cut.segments, cut.bins, degree) for one in all_] for all_ in signals]
    return np.ascontiguousarray(np.moveaxis(np.array(by_signal), (0, 1), (2, 4)))


def _differences(position: FloatArray, again: bool, step: float) -> FloatArray:
    """Second differences of (n_exp, n_period, n_sample, n_axis), round each period where these repeat.

    Round a period, because white noise of the sensor stays what it is then; across to the next period the noise of
    its first sample would stand beside another one, and a kick of that size over T^2 reaches down to all
    frequencies. A motor that gains the same angle in every period is a ramp, which is taken off first.
    """
    if not again:
        return second_difference(position, step, closed=False)
    n_period, n_sample = position.shape[1:3]
    if n_period > 1:
        middle = position.mean(axis=2, keepdims=True)
        gain = (middle[:, -1:] - middle[:, :1]) / (n_period - 1)
        position = position - gain * (np.arange(n_sample) / n_sample)[:, None]
    return second_difference(position, step, closed=True)


def _kept_segments(valid: BoolArray, cut: Cut) -> BoolArray:
    """Segments without a missing sample, (n_block * n_exp, n_segment); valid (n_block, n_exp, n_period, n_sample)."""
    flat: BoolArray = np.all(valid.reshape(-1, *valid.shape[2:]), axis=1)
    if cut.repeats:
        return np.full((len(flat), len(cut.segments.start)), True)
    inner = flat[:, :-2] & flat[:, 1:-1] & flat[:, 2:]
    index = cut.segments.start[:, None] + np.arange(len(cut.segments.window))
    kept: BoolArray = np.all(inner[:, index], axis=-1)
    return kept
