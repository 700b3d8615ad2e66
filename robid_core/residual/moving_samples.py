"""Samples at which each axis moves: the others, at rests and sticks, do not count in its row.

What friction is while an axis sticks, no function of its speed says, and a spectrum spreads it over all bins. So the
residual over time, below the highest frequency, is multiplied by a weight that is zero at rest and one in motion.
Derivatives get the same weight. The motion that is prescribed stays whole: angles are measured at rest, too, and so are
sensors behind the gears, whose rows count throughout.

A band that ends at once rings: what is at rest would be seen far from there. The upper half of the band fades instead,
and weights are zero for two periods of its end on either side of a rest: there a step has rung down to a hundredth.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy

from robid_core.arrays import BoolArray, ComplexArray, FloatArray
from robid_core.estimation.standstill import rests_of
from robid_core.estimation.sticks import sticking_axes, sticks_of
from robid_core.estimation.torque.periodic import PeriodicMotion
from robid_core.estimation.torque.spectra import MotionSpectra

PERIODS = 2.0  # of the highest frequency, on either side of a rest
REACH_S = 0.03  # likewise, at least
EDGE_S = 0.02  # from zero to one
FADES = 0.5  # of the band
FAINT = 0.01  # share of the data of a bin and row: what counts less is not made as large as if all counted
ENOUGH = 0.2  # of the samples of an axis that sticks
FINER = 3  # points a bin: products with a weight have a wider band than their factors


@dataclass(frozen=True, eq=False)
class MovingSamples:
    """Weights over time of each row, one where its axis moves."""

    weight: FloatArray
    """Shape (n_config, n_exp, n_time, n_row), on a grid of the whole motion that resolves its bins."""
    band: FloatArray
    """Weight of each bin in rows with rests, (n_bin,)."""

    @classmethod
    def of_motion(cls, motion: MotionSpectra, rests: BoolArray) -> MovingSamples:
        """Prepare rows of the motors' torques; `rests` at the samples, (n_config, n_exp, n_sample, n_axis)."""
        n_sample, n_bin = rests.shape[2], len(motion.bin)
        n_time = min(scipy.fft.next_fast_len(FINER * n_bin, real=True), n_sample)
        reach_s = max(PERIODS / motion.frequency_hz[-1], REACH_S)
        wider, edge = (max(round(span / motion.sample_time_s), 1) for span in (2 * reach_s + EDGE_S, EDGE_S))
        mode = "wrap" if isinstance(motion, PeriodicMotion) else "nearest"
        still = scipy.ndimage.maximum_filter1d(rests, wider, axis=2, mode=mode)
        moves = scipy.ndimage.uniform_filter1d((~still).astype(np.float64), edge, axis=2, mode=mode)
        at = np.minimum(np.round(np.arange(n_time) * n_sample / n_time).astype(int), n_sample - 1)
        return cls(moves[:, :, at], fading(n_bin))

    @cached_property
    def rests(self) -> BoolArray:
        """Which rows of which experiments have rests, (n_config, n_exp, n_row)."""
        rests: BoolArray = np.asarray((self.weight < 1).any(axis=2))
        return rests

    @cached_property
    def share(self) -> FloatArray:
        """Share of the data that count in each bin and row of an experiment, (n_config, n_exp, n_bin, n_row)."""
        of_time = (self.weight**2).mean(axis=2)[:, :, None]
        share: FloatArray = of_time * np.where(self.rests[:, :, None], self.band[:, None] ** 2, 1.0)
        return share

    def at_samples(self, row: int, n_sample: int) -> BoolArray:
        """Whether samples count in a row, (n_config, n_exp, n_sample)."""
        n_time = self.weight.shape[2]
        at = np.minimum(np.round(np.arange(n_sample) * n_time / n_sample).astype(int), n_time - 1)
        counts: BoolArray = self.weight[:, :, at, row] > 0.5
        return counts

    def with_sensors(self, n_sensor: int) -> MovingSamples:
        """Return them with rows of sensors behind the gears, which always count."""
        return replace(self, weight=np.pad(self.weight, [(0, 0)] * 3 + [(0, n_sensor)], constant_values=1.0))

    def first(self, n: int) -> MovingSamples:
        """Return those of the first experiments of each configuration."""
        return replace(self, weight=self.weight[:, :n])

    def at(self, config: int) -> MovingSamples:
        """Return those of one configuration; its axis stays."""
        return replace(self, weight=self.weight[config : config + 1])

    def of(self, spectra: ComplexArray) -> ComplexArray:
        """Spectra of what counts, of all bins from the mean on, (n_config, n_exp, n_bin, n_row, ...)."""
        n_time, result = self.weight.shape[2], spectra.copy()
        for config, experiment, row in np.argwhere(self.rests):
            own = result[config, experiment, :, row].reshape(spectra.shape[2], -1)
            some = own.any(axis=0)  # most candidates act at one axis
            faded = self.band[:, None] * own[:, some]
            over_time = scipy.fft.irfft(faded, n=n_time, axis=0, norm="forward")
            over_time *= self.weight[config, experiment, :, row, None]
            own[:, some] = scipy.fft.rfft(over_time, axis=0, norm="forward")[: len(own)]
            result[config, experiment, :, row] = own.reshape(result[config, experiment, :, row].shape)
        return result

    def at_full_power(self, spectra: ComplexArray) -> ComplexArray:
        """Likewise, as large as if all of each row counted: of mean squares over all experiments."""
        share = self.share.mean(axis=(0, 1))
        result: ComplexArray = self.of(spectra) / np.sqrt(np.maximum(share, FAINT))
        return result


def fading(n_bin: int) -> FloatArray:
    """Weight of each bin beside weights over time, (n_bin,): from one in the middle of a band to zero at its end."""
    upper = np.clip((np.arange(n_bin) / n_bin - 1 + FADES) / FADES, 0.0, 1.0)
    weight: FloatArray = 0.5 * (1 + np.cos(np.pi * upper))
    return weight


def moving_samples(
    motions: Sequence[MotionSpectra], sticking: BoolArray | None = None
) -> list[MovingSamples | None]:
    """Return the weights of each of several motions; None where no axis rests.

    In motions that repeat only sticks, turns and slow samples of axes that stick are rests: of others that stand still
    throughout a period friction is a constant, a function of the speed. `sticking`: which axes stick, (n_axis,); None:
    as the angles show.
    """
    sticking = sticking_in(motions) if sticking is None else sticking
    lanes = [_lanes(motion) for motion in motions]
    cuts = [i for i, motion in enumerate(motions) if not isinstance(motion, PeriodicMotion)]
    times = [motions[i].sample_time_s for i in cuts for _ in lanes[i]]
    of_cuts = iter(rests_of([lane for i in cuts for lane in lanes[i]], times, sticking))
    found = list[MovingSamples | None]()
    for i, motion in enumerate(motions):
        still = [next(of_cuts) for _ in lanes[i]] if i in cuts else sticks_of(lanes[i], sticking, repeat=True)
        rests = np.stack(still).reshape(motion.angle.shape)
        found.append(MovingSamples.of_motion(motion, rests) if rests.any() else None)
    return found


def sticking_in(motions: Sequence[MotionSpectra]) -> BoolArray:
    """Return which axes stick in some motions, (n_axis,), as `sticking_axes` says, of those that turn back seldom."""
    sticking = sticking_axes([lane for motion in motions for lane in _lanes(motion)])
    return sticking & turning_seldom(motions) if sticking.any() else sticking


def turning_seldom(motions: Sequence[MotionSpectra]) -> BoolArray:
    """Return of which axes enough samples count without those at which they turn back, (n_axis,).

    Of an axis that turns back all the time hardly any would: what its friction is then has to pass for a function of
    the speed, as it nearly is where it turns gradually but within a low speed.
    """
    n_axis = motions[0].angle.shape[-1]
    counted, n_sample = np.zeros(n_axis), 0
    for motion, own in zip(motions, moving_samples(motions, np.ones(n_axis, dtype=np.bool_)), strict=True):
        share = np.ones(1) if own is None else own.weight.mean(axis=(0, 1, 2))
        counted += motion.angle[..., 0].size * share
        n_sample += motion.angle[..., 0].size
    seldom: BoolArray = counted > ENOUGH * n_sample
    return seldom


def _lanes(motion: MotionSpectra) -> list[FloatArray]:
    """Angles of each experiment, (n_sample, n_axis)."""
    return list(motion.angle.reshape(-1, *motion.angle.shape[2:]))
