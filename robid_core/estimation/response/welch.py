"""Segments of a recording and their windowed spectra: Welch's method, periodic recordings and others.

After P. D. Welch, "The use of fast Fourier transform for the estimation of power spectra" (1967), and Bendat and
Piersol (2010), chapter 11. Spectra keep their segments, because cross spectra with instruments, residuals and
coherence are all products of the same columns (`estimation.response.instrumental`). Phases count from the start
of each segment; all channels of a segment share them, and no product of channels sees them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid_core.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from robid_core.errors import ConfigurationError, PoorExcitation


@dataclass(frozen=True)
class Segmentation:
    """Where segments start, shape (n_segment,), and their window, shape (length,).

    `circular` says that the recording is one period of a steady state: segments go on from its end to its start.
    """

    start: IntArray
    window: FloatArray
    n_sample: int
    circular: bool

    @property
    def hop(self) -> float:
        """Samples from one start to the next."""
        if self.circular:
            return self.n_sample / len(self.start)
        return float(self.start[1] - self.start[0]) if len(self.start) > 1 else float(len(self.window))


def window_samples(name: str, length: int) -> FloatArray:
    """Window of a segment: "hann" (periodic, ``(1 - cos(2 pi n / length)) / 2``) or "rectangular"."""
    if name == "rectangular":
        return np.ones(length)
    if name == "hann":
        hann: FloatArray = 0.5 * (1.0 - np.cos(2 * np.pi * np.arange(length) / length))
        return hann
    raise ConfigurationError(f"window: {name} is neither hann nor rectangular")


def segmentation(n_sample: int, length: int, overlap: float, window: str, circular: bool) -> Segmentation:
    """Cut `n_sample` samples into segments of `length` that overlap by a share.

    Circular segments are spread evenly over the period, at starts rounded to samples.

    Raises
    ------
    ConfigurationError
        If a segment is longer than the recording, or than half a period where segments go round.
    """
    room = n_sample // 2 if circular else n_sample
    if not 2 <= length <= room:
        what = "half a period" if circular else "a recording"
        raise ConfigurationError(
            f"segment_s: a segment of {length} samples does not fit into {what} of {room} samples; take a shorter "
            "one" + (", or leave segment_s out to use whole periods" if circular else "")
        )
    hop = max(1, round(length * (1.0 - overlap)))
    if circular:
        count = max(1, int(np.ceil(n_sample / hop - 1e-9)))
        start = np.round(np.arange(count) * (n_sample / count)).astype(np.int64)
    else:
        start = np.arange(0, n_sample - length + 1, hop, dtype=np.int64)
    return Segmentation(start, window_samples(window, length), n_sample, circular)


def second_difference(position: FloatArray, sample_time_s: float, closed: bool) -> FloatArray:
    """``(q[n + 1] - 2 q[n] + q[n - 1]) / T^2`` along the last axis but one.

    `closed` goes from the end on to the start (one period of a steady state) and keeps all samples; otherwise
    the first and the last one are lost. To become an acceleration its spectrum is multiplied by
    `difference_correction`. ``(i w)^2`` times the spectrum of a windowed *position* would not do: the window
    spreads the strong low frequencies of the position over the band before they are weighted by the wrong w.
    """
    if closed:
        result = np.roll(position, -1, axis=-2) - 2 * position + np.roll(position, 1, axis=-2)
    else:
        result = position[..., 2:, :] - 2 * position[..., 1:-1, :] + position[..., :-2, :]
    differences: FloatArray = result / sample_time_s**2
    return differences


def difference_correction(frequency_hz: FloatArray, sample_time_s: float) -> FloatArray:
    """``(x / sin x)^2``, ``x = w T / 2``: from the second difference of a sine to its second derivative."""
    result: FloatArray = 1.0 / np.sinc(frequency_hz * sample_time_s) ** 2
    return result


def without_trend(segments: FloatArray, degree: int | None) -> FloatArray:
    """Subtract the mean (degree 0) or the least-squares straight line (1) from segments (..., length, n_axis)."""
    if degree is None:
        return segments
    length = segments.shape[-2]
    result: FloatArray = segments - segments.mean(axis=-2, keepdims=True)
    if degree == 1:
        ramp = np.arange(length) - 0.5 * (length - 1)
        ramp /= np.linalg.norm(ramp)
        result = result - ramp[:, None] * np.einsum("n,...na->...a", ramp, result)[..., None, :]
    return result


def segment_spectra(
    signal: FloatArray, cut: Segmentation, bins: IntArray, degree: int | None = None
) -> ComplexArray:
    """Windowed DFT of each segment, divided by the sum of the window: a cosine of amplitude A on a bin gives A / 2.

    Parameters
    ----------
    signal
        One recording, shape (n_sample, n_axis).
    cut, bins
        The segments, and the bins of a segment that are wanted, shape (n_bin,).
    degree
        Of the polynomial that is removed from each segment first; None: nothing.

    Returns
    -------
    Shape (n_bin, n_axis, n_segment).
    """
    length = len(cut.window)
    index = (cut.start[:, None] + np.arange(length)) % cut.n_sample
    segments = without_trend(signal[index], degree) * cut.window[:, None]
    spectrum: ComplexArray = np.fft.rfft(segments, axis=1)[:, bins] / cut.window.sum()
    return np.ascontiguousarray(spectrum.transpose(1, 2, 0))


def overlap_correlation(window: FloatArray, shift: int, bin_difference: IntArray) -> ComplexArray:
    """``sum_n w[n] w[n + shift] exp(-2 pi i d n / length) / sum_n w[n]^2`` for each bin difference d.

    Correlation of the DFTs of white noise in two windows `shift` samples apart, d bins apart: 1/6 for Hann
    windows that overlap by half, -2/3 for neighbouring bins of one Hann window.
    """
    length = len(window)
    n = np.arange(max(0, -shift), min(length, length - shift))
    product = window[n] * window[n + shift]
    turn = np.multiply.outer(bin_difference, n) % length
    kernel: ComplexArray = np.exp(-2j * np.pi * turn / length)
    return kernel @ (product / np.sum(window**2))


@dataclass(frozen=True)
class Correlation:
    """Correlation of disturbances between the columns (segment, bin of a band) of an experiment.

    The disturbance is taken as white over the width of a band. `bins` holds the bins of each line's band,
    consecutive, shape (n_line, n_bin); `kept` marks the segments of each experiment that are used, shape (n_exp,
    n_segment). Without `cut` columns are whole periods and uncorrelated.
    """

    cut: Segmentation | None
    bins: IntArray
    kept: BoolArray

    def _shifts(self, cut: Segmentation) -> list[tuple[int, ComplexArray]]:
        """Offsets m between segments that share samples, and ``C[q - p]`` there, bins p and q of a band."""
        n_bin = self.bins.shape[1]
        position = np.arange(n_bin)
        difference = position[None, :] - position[:, None]
        most = int(np.ceil(len(cut.window) / cut.hop)) - 1
        return [
            (m, overlap_correlation(cut.window, round(m * cut.hop), difference))
            for m in range(-most, most + 1)
        ]

    @staticmethod
    def _partners(cut: Segmentation, m: int) -> tuple[IntArray, FloatArray]:
        """Number of segment l + m for each l, counted round, and the samples from the start of l to its start."""
        other = np.arange(len(cut.start)) + m
        turns, wrapped = np.divmod(other, len(cut.start))
        distance = cut.start[wrapped] + turns * cut.n_sample - cut.start
        return wrapped, distance.astype(np.float64)

    def _exists(self, cut: Segmentation, m: int) -> BoolArray:
        """Tell which segments l have a neighbour l + m, both used, shape (n_exp, n_segment)."""
        n_segment = len(cut.start)
        other = np.arange(n_segment) + m
        inside = np.full(n_segment, True) if cut.circular else (other >= 0) & (other < n_segment)
        result: BoolArray = inside & self.kept & self.kept[:, other % n_segment]
        return result

    def correlate(self, columns: ComplexArray) -> ComplexArray:
        """``x -> x conj(Gamma)``; columns (n_line, n_row, n_exp * n_segment * n_bin), the last fastest.

        ``Gamma[(k, p), (l, q)] = exp(i w_q s) C(s, p - q)`` with s samples from segment l to segment k.
        """
        if self.cut is None:
            return columns
        n_line, n_row = columns.shape[:2]
        n_exp, n_segment = self.kept.shape
        x = columns.reshape(n_line, n_row, n_exp, n_segment, -1)
        result = np.zeros_like(x)
        for m, table in self._shifts(self.cut):
            partner, distance = self._partners(self.cut, m)
            turn = np.einsum("fq,l->flq", self.bins / len(self.cut.window), distance)
            phase = np.exp(-2j * np.pi * turn)[:, None, None]
            # table[p, q] = C(s, q - p), the conjugate of C(s, p - q) for a real window.
            result += self._exists(self.cut, m)[:, :, None] * phase * (x[:, :, :, partner] @ table)
        return result.reshape(columns.shape)

    def traces(self) -> tuple[float, float]:
        """Traces of Gamma and of its square."""
        trace = float(self.kept.sum() * self.bins.shape[1])
        if self.cut is None:
            return trace, trace
        cut = self.cut
        square = sum(
            float(np.sum(np.abs(c) ** 2)) * int(self._exists(cut, m).sum()) for m, c in self._shifts(cut)
        )
        return trace, square


def equivalent_segments(cut: Segmentation) -> float:
    """Independent segments that a recording is worth: ``n^2 / sum_kl |c_kl|^2`` (Welch 1967)."""
    correlation = Correlation(cut, np.zeros((1, 1), dtype=np.int64), np.full((1, len(cut.start)), True))
    trace, square = correlation.traces()
    return trace**2 / square


def equivalent_bins(window: FloatArray, bins: IntArray) -> float:
    """Independent bins that a set of bins of one window is worth: ``n^2 / sum_pq |c_pq|^2``.

    With a rectangular window as many as there are, with Hann's about half.
    """
    different, count = np.unique(np.subtract.outer(bins, bins), return_counts=True)
    correlation = np.abs(overlap_correlation(window, 0, different)) ** 2
    return float(len(bins) ** 2 / np.sum(count * correlation))


def bands(
    bins: IntArray, resolution_hz: float, targets_hz: FloatArray | None
) -> tuple[list[IntArray], FloatArray]:
    """Bins that are averaged for each line, and the lines' frequencies in Hz.

    Without targets every bin is a line. Otherwise each bin belongs to the target nearest to it (in the logarithm of
    the frequency), bins beyond the outer ones no farther than on their inner side, and a line stands at the mean
    of its bins; targets to which no bin is nearest are left out.

    Parameters
    ----------
    bins, resolution_hz
        Consecutive bins, shape (n_bin,), and their distance.
    targets_hz
        In increasing order, shape (n_target,); a single one takes all bins.

    Raises
    ------
    ConfigurationError
        If the targets are not positive and increasing, or no bin is near any of them.
    """
    frequency_hz: FloatArray = bins * np.float64(resolution_hz)
    if targets_hz is None:
        return [bins[i : i + 1] for i in range(len(bins))], frequency_hz
    if not ((targets_hz > 0).all() and (np.diff(targets_hz) > 0).all()):
        raise ConfigurationError("the lines' frequencies must be positive and increase from one to the next")
    edges = np.sqrt(targets_hz[1:] * targets_hz[:-1])
    outer = np.array([0.0, np.inf])
    if len(edges):
        outer = np.array([targets_hz[0] ** 2 / edges[0], targets_hz[-1] ** 2 / edges[-1]]) * [
            1 - 1e-9,
            1 + 1e-9,
        ]
    owner = np.searchsorted(edges, frequency_hz)
    owner[(frequency_hz < outer[0]) | (frequency_hz > outer[1])] = -1
    groups = [bins[owner == target] for target in range(len(targets_hz)) if (owner == target).any()]
    if not groups:
        raise ConfigurationError("no bin of the band is near the lines that are asked for")
    return groups, np.array([group.mean() for group in groups]) * np.float64(resolution_hz)


def refuse_few_segments(columns: float, n_axis: int, what: str) -> None:
    """Raise PoorExcitation where fewer independent columns than axes are left for a line."""
    if columns < n_axis:
        raise PoorExcitation(
            f"{what}: {columns:.3g} independent segments and experiments a line cannot separate {n_axis} axes; take "
            f"shorter segments, average over bands (lines), or measure at least {n_axis} experiments"
        )


def pooled_freedom(
    freedom: FloatArray, valid: BoolArray, half_window: int, groups: list[IntArray], window: FloatArray | None
) -> FloatArray:
    """Degrees of freedom of a covariance that neighbouring valid lines share, shape (n_config, n_freq).

    Lines of a windowed spectrum are correlated with their neighbours; so the lines' own degrees of freedom are
    multiplied by what all bins together are worth over what the line's own are.

    Parameters
    ----------
    freedom, valid
        Of each line alone, shape (n_config, n_freq); the lines that are used.
    half_window
        Valid lines on either side, leaning inward at the ends of the band.
    groups, window
        Bins of each line and the window they were seen through; None: lines are independent.
    """
    result = np.zeros(valid.shape)
    for c, lines in enumerate(map(np.flatnonzero, valid)):
        length = min(2 * half_window + 1, len(lines))
        for i, line in enumerate(lines):
            first = min(max(i - half_window, 0), len(lines) - length)
            shared = lines[first : first + length]
            worth = 1.0
            if window is not None:
                own = equivalent_bins(window, groups[line])
                union = equivalent_bins(window, np.concatenate([groups[k] for k in shared]))
                worth = union / (own * length)
            result[c, line] = worth * freedom[c, shared].sum()
    return result


def speed_rms(position: FloatArray, valid: BoolArray, sample_time_s: float, highest_hz: float) -> FloatArray:
    """Root mean square of the speed below a frequency, over all leading axes, shape (n_axis,).

    For motions without lines; above the frequency there is little but noise of the sensor. Takes positions
    (..., n_sample, n_axis) and the samples that were measured (..., n_sample).
    """
    both = (valid[..., 1:] & valid[..., :-1])[..., None]
    speed = np.where(both, np.diff(np.where(valid[..., None], position, 0.0), axis=-2), 0.0) / sample_time_s
    n_sample = speed.shape[-2]
    last = min(int(highest_hz * n_sample * sample_time_s), (n_sample - 1) // 2)
    spectrum = np.fft.rfft(speed, axis=-2)[..., : last + 1, :]
    power = np.abs(spectrum) ** 2
    power[..., 1:, :] *= 2.0
    total = power.sum(axis=-2).reshape(-1, power.shape[-1]).sum(axis=0)
    rms: FloatArray = np.sqrt(total / (n_sample * max(int(both.sum()), 1)))
    return rms
