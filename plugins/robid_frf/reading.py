"""From a record to what the estimators work on: one transform of each channel, lines and detection bins kept.

Periods before the steady state are dropped here, experiments of n + 1 turned so that what does not depend on
the phases is removed, and what was done is put into words for the log and for `Frf.pooling`.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np

from robid_core import ComplexArray, Context, DataRejected, FloatArray, IntArray, Record
from robid_core.estimation.response.columns import column_is_free, other_columns
from robid_core.estimation.response.steady_state import (
    drift_share,
    refuse_other_reference,
    refuse_unlike_periods,
    transient_periods,
)

REFERENCES = ("speed_reference", "position_reference")


@dataclass(frozen=True)
class Quiet:
    """Detection bins: inside the band and not excited; spectra averaged over periods.

    `line` (n_bin,); `u` and `y` have shape (n_config, n_block, n_exp, n_bin, n_axis).
    """

    line: IntArray
    u: ComplexArray
    y: ComplexArray


@dataclass(frozen=True)
class LineSpectra:
    """Spectra of a record at its lines.

    `u_by_period` and `y_by_period` have shape (n_config, n_block, n_freq, n_axis, n_exp, n_period), in N m and
    rad/s^2; `reference` (n_config, n_block, n_freq, n_axis, n_exp), None where it was not asked for. `turned`
    tells whether experiments of n + 1 became n; `words` says what was left out.
    """

    frequency_hz: FloatArray
    u_by_period: ComplexArray
    y_by_period: ComplexArray
    reference: ComplexArray | None
    quiet: Quiet
    discard: int
    turned: bool
    words: tuple[str, ...]

    @functools.cached_property
    def block_u(self) -> ComplexArray:
        """Inputs averaged over periods, (n_config, n_block, n_freq, n_axis, n_exp)."""
        return np.ascontiguousarray(self.u_by_period.mean(axis=-1))

    @functools.cached_property
    def block_y(self) -> ComplexArray:
        """Outputs averaged over periods, shape of `block_u`."""
        return np.ascontiguousarray(self.y_by_period.mean(axis=-1))

    @property
    def spare(self) -> int:
        """Experiments of a configuration beyond the inputs: the residual's degrees of freedom at a line."""
        n_block, n_axis, n_exp = (self.u_by_period.shape[i] for i in (1, 3, 4))
        return int(n_block * n_exp - n_axis)


def read_spectra(
    record: Record, context: Context, discard: int | None, reference: bool = False
) -> LineSpectra:
    """Transform torque and position once, and the reference where it is needed.

    Parameters
    ----------
    discard
        Leading periods to drop; None drops those that are not in steady state.
    reference
        Whether the reference's spectra are wanted.

    Raises
    ------
    DataRejected
        If the record has no lines or does not repeat, lacks a channel, or a sample of a kept period is missing or NaN.
    """
    line, first = lines_of(record), discard or 0
    band = np.arange(line.min(), line.max() + 1)
    at_line, quiet = line - line.min(), np.setdiff1d(band, line) - line.min()
    omega = 2 * np.pi * band / (record.run.sample_time_s * len(record.run.time_s))
    in_band = (
        record.period_spectra("motor_torque", first, band),
        record.period_spectra("motor_position", first, band),
    )
    # (config, block, exp, period, freq, axis) -> (config, block, freq, axis, exp, period)
    u, q = (np.moveaxis(x[..., at_line, :], (2, 3), (-2, -1)) for x in in_band)
    if "speed_reference" in record.run.channels:
        refuse_other_reference(record.run.values("speed_reference")[:, :, :, first:], record.axis_names)
    else:
        refuse_unlike_periods(u)
    cut, words = cut_transient(context, [u, q], discard)
    discard = first + cut
    words.extend(drift_in_words(record, context, q[..., cut:], discard))
    u, y = u[..., cut:], -(omega[at_line, None, None, None] ** 2) * q[..., cut:]
    quiet_u, quiet_q = (x[:, :, :, cut:, quiet].mean(axis=3) for x in in_band)
    kept = Quiet(band[quiet], quiet_u, -(omega[quiet, None] ** 2) * quiet_q)
    r, more = None, u.shape[-2] > u.shape[-3]
    if reference or (more and any(name in record.run.channels for name in REFERENCES)):
        r = record.reference_spectra(discard)
    turned = more and column_is_free(u.mean(axis=-1) if r is None else r)
    if turned:
        words.append(tell_common_part(record, context, y.mean(axis=-1)))
        u, y = (np.moveaxis(other_columns(np.moveaxis(x, -1, -3)), -3, -1) for x in (u, y))
        r = None if r is None else other_columns(r)
    r = r if reference else None
    return LineSpectra(record.frequency_hz, u, y, r, kept, discard, turned, tuple(words))


def cut_transient(
    context: Context, signals: list[ComplexArray], discard: int | None
) -> tuple[int, list[str]]:
    """Periods to drop beyond those that were asked for, and words on it; only where `discard` is None."""
    n_period = signals[0].shape[-1]
    transient = transient_periods(signals)
    if transient is None:
        return 0, [] if discard is not None else ["steady state not checked, which takes three periods"]
    if discard is None:
        if transient:
            context.log.info("%d of %d periods are not in steady state: dropped", transient, n_period)
        return transient, [f"{transient} of {n_period} periods cut as transient"]
    if transient:
        context.log.warning(
            "%d of %d periods kept are not in steady state; set discard: %d, or discard: null to have it decided",
            transient,
            n_period,
            discard + transient,
        )
        return 0, [f"{transient} of {n_period} periods kept are not in steady state"]
    return 0, []


def left_out(record: Record, discard: int) -> tuple[str, ...]:
    """Say how many leading periods are not used; nothing where all are."""
    return (f"{discard} of {record.run.n_period} periods left out",) if discard else ()


def drift_in_words(record: Record, context: Context, q: ComplexArray, discard: int) -> list[str]:
    """Warn where motor angles do not close over a period and disturb a line by more than a percent; say the most."""
    position = record.run.values("motor_position")[:, :, :, discard:].mean(axis=4)
    share = drift_share(position, q, np.asarray(record.line, dtype=float))
    for configuration, axis in np.argwhere(share > 0.01):
        context.log.warning(
            "configuration %d: %s drifts from period to period, by up to %.1f %% of its motion at a line; let it "
            "settle longer, or close a position loop",
            configuration + 1,
            record.axis_names[axis],
            100 * share[configuration, axis],
        )
    if not share.any():
        return []
    worst = record.axis_names[int(share.max(axis=0).argmax())]
    return [f"drift between periods up to {100 * share.max():.2g} % of the motion at a line ({worst})"]


def channel_spectra(record: Record, channel: str, spectra: LineSpectra) -> ComplexArray:
    """Spectra of another channel as those of `spectra`, averaged over periods.

    Returns shape (n_config, n_block, n_freq, n_axis, n_exp).
    """
    values = np.moveaxis(record.period_spectra(channel, spectra.discard).mean(axis=3), 2, -1)
    return other_columns(values) if spectra.turned else values


def lines_of(record: Record) -> IntArray:
    """Excited bins of a record; DataRejected where there are none."""
    if record.line is None or len(record.line) == 0:
        raise DataRejected(
            "the record has no excited lines, so it carries no frequency response; measure with a periodic "
            "excitation such as excitation.multisine"
        )
    return record.line


def tell_common_part(record: Record, context: Context, y: ComplexArray) -> str:
    """Say how large what does not depend on the phases is, by axis, relative to the motion at the lines."""
    common = np.sqrt(np.mean(np.abs(y.mean(axis=-1)) ** 2, axis=(0, 1, 2)))
    size = np.sqrt(np.mean(np.abs(y) ** 2, axis=(0, 1, 2, 4)))
    share = 100 * common / np.where(size > 0, size, 1.0)
    listed = ", ".join(f"{n} {s:.2g} %" for n, s in zip(record.axis_names, share, strict=True))
    context.log.info(
        "signal parts that do not depend on the phases are removed; their share of the motion at the lines: %s",
        listed,
    )
    return (
        "what does not depend on the phases was estimated from the surplus experiment and subtracted; experiments "
        "of a block share their phases, so that distortion differs from input to input and regions hold on "
        "average over entries"
    )
