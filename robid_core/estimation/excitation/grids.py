"""Which bins of a period a multisine excites, and which odd ones it leaves out to see the distortion there.

Odd bins after Schoukens et al. (2005); random detection lines after Schoukens, Pintelon and Vanbeylen: of every
group of consecutive odd lines one, drawn at random, is left out, and what the nonlinear robot puts there is odd
distortion alone; all even bins show the even one. Every grid here is a choice out of sorted odd bins, so that no
line comes twice and the count is exact.
"""

from __future__ import annotations

import numpy as np

from robid_core.arrays import FloatArray, IntArray
from robid_core.errors import ConfigurationError

MOST_BINS = 10_000_000  # a day of 80 Hz has seven million; nobody measures as long


def odd_bins(band_hz: tuple[float, float], period_s: float) -> IntArray:
    """All odd DFT bins of a period whose frequency lies in the band, both ends included."""
    low, high = band_hz
    # 4 Hz * 8 s must count as bin 32 although the product may come out an ulp away.
    first = int(np.ceil(low * period_s - 1e-9))
    last = int(np.floor(high * period_s + 1e-9))
    if last - first > MOST_BINS:
        raise ConfigurationError(
            f"period_s: {period_s:g} s have {last - first:.3g} bins from {low:g} to {high:g} Hz, more than "
            f"{MOST_BINS:.0e}; take a shorter period"
        )
    return np.arange(first | 1, last + 1, 2, dtype=np.int64)


def without_multiples(bins: IntArray, sine_bin: int) -> IntArray:
    """Bins that are no multiple of an odd `sine_bin`.

    Friction turns a sine at bin p into odd harmonics at 3p, 5p ...; left out of the lines they are detection lines
    of their own: a parity diagnosis.
    """
    result: IntArray = bins[bins % sine_bin != 0]
    return result


def logarithmic_choice(bins: IntArray, count: int) -> IntArray:
    """Exactly `count` of the bins, at a constant ratio wherever they are dense enough.

    Rounding a plain logarithmic grid to odd bins hits some bins twice at its low end, where the ratio step is
    less than the distance d = 2 of odd neighbours; dropping the doubles leaves fewer lines than were asked for.
    Here consecutive bins are taken from the low end up to the first bin `b` from which the remaining lines, at a
    constant ratio r up to the top, are at least one bin apart, ``b (r - 1) >= d``. From there on the distance
    only grows, so that rounding cannot make two lines meet. Where bins are missing (`without_multiples`), d is
    their mean distance and places are counted in it: the ratio is constant to within such a gap.

    Parameters
    ----------
    bins
        Increasing, at nearly equal distances, at least `count`.
    count
        Number of lines.

    Returns
    -------
    Bins in increasing order, shape (count,), the lowest and the highest among them (for count = 1, the bin next
    to the geometric mean).
    """
    if len(bins) == count:
        return bins
    first, last = int(bins[0]), int(bins[-1])
    if count == 1:
        middle = int(np.argmin(np.abs(np.log(bins / np.sqrt(first * last)))))
        return bins[middle : middle + 1]
    distance = (last - first) / (len(bins) - 1)
    for consecutive in range(1, count):
        start, steps = first + distance * (consecutive - 1), count - consecutive
        ratio = (last / start) ** (1.0 / steps)
        if start * (ratio - 1.0) >= distance:
            break
    grid = start * ratio ** np.arange(steps + 1)
    # Halves always upward: rounding them to even would let two targets meet.
    upper = np.floor((grid - first) / distance + 0.5).astype(np.int64)
    result: IntArray = bins[np.concatenate([np.arange(consecutive - 1), upper])]
    return result


def linear_choice(bins: IntArray, count: int) -> IntArray:
    """Exactly `count` of the bins, at a constant distance up to the rounding; parameters as `logarithmic_choice`.

    The places between which is rounded are at least one bin apart, so that no two meet.
    """
    if count == 1:
        return bins[(len(bins) - 1) // 2 :][:1]
    place = np.floor(np.arange(count) * ((len(bins) - 1) / (count - 1)) + 0.5).astype(np.int64)
    result: IntArray = bins[place]
    return result


def refuse_too_few(
    bins: IntArray, count: int, band_hz: tuple[float, float], period_s: float, group: int | None = None
) -> None:
    """Raise ConfigurationError where the bins do not suffice for so many lines, with the period that would do.

    `group`: one of so many lines is left out for detection and comes on top of `count`.
    """
    most = len(bins) if group is None else len(bins) - len(bins) // group
    if count <= most:
        return
    wanted = 2.0 * count / (band_hz[1] - band_hz[0])
    needed = period_s * count / most if most else wanted
    raise ConfigurationError(
        f"{count} lines do not fit: a period of {period_s:g} s leaves {len(bins)} odd bins from "
        f"{band_hz[0]:g} to {band_hz[1]:g} Hz; ask for at most {most} lines, or for a period of "
        f"about {needed:.3g} s"
    )


def logarithmic_odd_lines(band_hz: tuple[float, float], count: int, period_s: float) -> IntArray:
    """Exactly `count` distinct odd bins of the band on a logarithmic grid (see `logarithmic_choice`).

    Parameters
    ----------
    band_hz
        Lowest and highest frequency.
    count
        Number of lines.
    period_s
        Length of one period; bin k is k / period_s.

    Raises
    ------
    ConfigurationError
        If the band has fewer than `count` odd bins; the message gives the period that would have enough.
    """
    bins = odd_bins(band_hz, period_s)
    refuse_too_few(bins, count, band_hz, period_s)
    return logarithmic_choice(bins, count)


def with_detection(count: int, group: int) -> int:
    """Lines that a grid needs so that `count` are left when one of every `group` is taken out."""
    return count + count // (group - 1)


def leave_one_out(line: IntArray, group: int, generator: np.random.Generator) -> tuple[IntArray, IntArray]:
    """Lines that stay excited, and the detection lines: one of each group of consecutive lines, at random.

    Drawn at random, because a regular pattern would let products of the excited lines (sums of three of them
    with any signs) fall on the left-out ones more or less often than on the others. What is left over at the
    upper end, fewer than `group` lines, stays whole.

    Returns
    -------
    (excited, detection), both increasing.
    """
    n_group = len(line) // group
    out = np.arange(n_group) * group + generator.integers(group, size=n_group)
    return np.delete(line, out), line[out]


def spacing_hz(line: IntArray, period_s: float) -> FloatArray:
    """Distance from each line to its farther neighbour in Hz, shape (n_freq,).

    A resonance of frequency f and relative damping zeta has the half-power width ``2 zeta f``; where the
    spacing is wider, its peak can fall between two lines.
    """
    gap = np.diff(line).astype(np.float64) / period_s
    if len(gap) == 0:
        return np.full(len(line), np.inf)
    result: FloatArray = np.maximum(np.append(gap, 0.0), np.insert(gap, 0, 0.0))
    return result
