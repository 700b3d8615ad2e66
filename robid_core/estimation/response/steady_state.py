"""Is a periodic measurement in steady state, from which period on, and does it repeat at all?

A transient makes the first periods differ from those after them. Each period is compared with the mean of the later
ones at the excited lines; how large a difference noise makes is known from the differences among those. Under noise
the ratio follows an F distribution at each line, whatever the noise's spectrum; Fisher's sum of the logarithms of
the p-values brings the lines together (independent, as the DFT of stationary noise is), Bonferroni's bound the
axes, channels and configurations (which need not be). A record in steady state loses a period with a probability of
at most `FALSE_ALARM`.
"""

from __future__ import annotations

import numpy as np
import scipy

from robid_core.arrays import ComplexArray, FloatArray
from robid_core.errors import DataRejected

FALSE_ALARM = 1e-3
DIFFERENT = 0.5  # of the reference: a logged command may be a sample late, half a period differs by all of it
HARMLESS = 1e-6
"""Share of an axis' motion at the lines below which a difference is no transient worth a period: noise-free data
settle for ever."""


def transient_periods(signals: list[ComplexArray], false_alarm: float = FALSE_ALARM) -> int | None:
    """Leading periods that are not in steady state.

    From the third last period backwards, each is compared with all after it; all up to the last one that differs
    are transient. Two periods are always left. A transient that is still there in them is not seen, but makes the
    period before differ.

    Parameters
    ----------
    signals
        Spectra by period of each channel, shape (n_config, n_block, n_freq, n_axis, n_exp, n_period).
    false_alarm
        Probability with which any period is dropped from a record in steady state; at most.

    Returns
    -------
    None with fewer than three periods: two tell a transient from noise as little as one.
    """
    n_period = signals[0].shape[-1]
    if n_period < 3:
        return None
    level = false_alarm / (n_period - 2)
    for period in range(n_period - 3, -1, -1):
        if period_probability(signals, period) < level:
            return period + 1
    return 0


def period_probability(signals: list[ComplexArray], period: int) -> float:
    """Probability that noise makes a period differ as much from those after it as it does, or more.

    Smallest over channels, configurations and axes, multiplied by their number (Bonferroni). See
    `transient_periods` for the signals; two periods at least come after `period`.
    """
    smallest, count = 1.0, 0
    for signal in signals:
        n_config, n_block, n_freq, n_axis, n_exp, n_period = signal.shape
        later = signal[..., period + 1 :]
        n_later, n_each = n_period - period - 1, n_block * n_exp
        mean = later.mean(axis=-1)
        # Difference of independent means: variance times 1 + 1 / n_later.
        between = _power(signal[..., period] - mean, axes=(1, 4)) / ((1 + 1 / n_later) * n_each)
        within = _power(later - mean[..., None], axes=(1, 4, 5)) / ((n_later - 1) * n_each)
        size = _power(mean, axes=(1, 2, 4)) / (n_each * n_freq)
        ratio = between / np.maximum(within + HARMLESS**2 * size[:, None], np.finfo(float).tiny)
        # Complex numbers have two degrees of freedom each.
        tail = scipy.special.fdtrc(2 * n_each, 2 * n_each * (n_later - 1), ratio)
        fisher = -2 * np.log(np.maximum(tail, np.finfo(float).tiny)).sum(axis=1)
        smallest = min(smallest, float(scipy.special.chdtrc(2 * n_freq, fisher).min()))
        count += n_config * n_axis
    return min(1.0, smallest * count)


def refuse_other_reference(reference: FloatArray, axis_names: tuple[str, ...]) -> None:
    """Raise DataRejected where the speed reference of a period is not that of the last one.

    What was cut at another length than the excitation's, or a half period late, shows here: the reference is a
    command and has no noise. `reference` are samples, shape (n_config, n_block, n_exp, n_period, n_sample, n_axis).
    """
    last = reference[:, :, :, -1:]
    size = np.sqrt(np.mean(last**2, axis=4))
    share = np.sqrt(np.mean((reference - last) ** 2, axis=4)) / np.where(size > 0, size, 1.0)
    different = share > DIFFERENT  # what is not a number is told where it is used
    if different.any():
        c, m, e, p, a = (int(i) for i in np.argwhere(different)[0])
        raise DataRejected(
            f"the speed reference of {axis_names[a]} in period {p + 1} of those kept differs from the last one by "
            f"{100 * share[c, m, e, p, a]:.3g} % (configuration {c + 1}, block {m + 1}, experiment {e + 1}): what was "
            "recorded as a period is not one; cut the recording at whole periods of the excitation"
        )


def refuse_unlike_periods(u: ComplexArray) -> None:
    """Raise DataRejected where the torque of the last two periods has less in common than not.

    For records without a reference. Two halves of a period with odd lines have opposite signs.

    Takes spectra by period, shape (n_config, n_block, n_freq, n_axis, n_exp, n_period).
    """
    if u.shape[-1] < 2:
        return
    apart = _power(u[..., -1] - u[..., -2], axes=(1, 2, 3, 4))
    common = _power(u[..., -1] + u[..., -2], axes=(1, 2, 3, 4))
    if not (apart <= common).all():
        c = int(np.argmax(apart - common))
        raise DataRejected(
            f"configuration {c + 1}: the torque at the lines differs more from the period before than it resembles it; "
            "what was recorded as a period is not one, a half perhaps, or the motors hardly moved; cut the recording "
            "at whole periods of the excitation"
        )


def drift_share(position: FloatArray, spectra: ComplexArray, line: FloatArray) -> FloatArray:
    """How much a drift of the position disturbs the lines: largest ratio of its leakage to what is there.

    An angle that gains D in each period is a periodic one plus a ramp, whose spectrum ``D / (2 pi k)`` at bin k is
    the same in every period. Lines where it stays below the noise count zero.

    Parameters
    ----------
    position
        Mean of the motor angle in each period, shape (n_config, n_block, n_exp, n_period, n_axis).
    spectra
        Of the position by period, shape (n_config, n_block, n_freq, n_axis, n_exp, n_period), scaled by 1/n_sample.
    line
        Excited bins, shape (n_freq,).

    Returns
    -------
    Shape (n_config, n_axis); zeros with a single period.
    """
    n_period = spectra.shape[-1]
    if n_period < 2:
        return np.zeros((spectra.shape[0], spectra.shape[3]))
    gain = (position[:, :, :, -1] - position[:, :, :, 0]) / (n_period - 1)
    leakage = np.sqrt(np.mean(gain**2, axis=(1, 2)))[:, None] / (2 * np.pi * line[:, None])
    n_each = spectra.shape[1] * spectra.shape[4]
    mean = spectra.mean(axis=-1)
    size = np.sqrt(_power(mean, axes=(1, 4)) / n_each)
    within = _power(spectra - mean[..., None], axes=(1, 4, 5)) / (n_each * (n_period - 1))
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(leakage > np.sqrt(within / n_period), leakage / size, 0.0)
    result: FloatArray = share.max(axis=1)
    return result


def _power(spectra: ComplexArray, axes: tuple[int, ...]) -> FloatArray:
    result: FloatArray = np.sum(spectra.real**2 + spectra.imag**2, axis=axes)
    return result
