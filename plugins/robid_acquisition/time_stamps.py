"""Time stamps of a recording: whether they run forward, evenly, and where samples are missing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid_core import DataRejected, FloatArray, IntArray

SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
ALIKE = 0.02  # of a sampling time


def likely_unit(step_s: float, expected_s: float, unit: str) -> str:
    """Return the unit in which steps of a clock are those that are expected; empty where no other one makes them so.

    `step_s` was read in `unit`, one of `SECONDS`.
    """
    bare = step_s / SECONDS[unit]
    for other, seconds in SECONDS.items():
        if other != unit and abs(bare * seconds / expected_s - 1) < ALIKE:
            return other
    return ""


STEP_TOLERANCE = 0.1  # of a sample: a step that is off by more makes an uneven recording
JITTER = 0.3  # percent of a sample, rms: what microseconds do to stamps of a millisecond
GAP_TOLERANCE = 0.25  # of a sample, by which a gap may miss a whole number of samples
GAP = 3.5  # samples: a longer step is a gap, not an uneven one


@dataclass(frozen=True, eq=False)
class TimeStamps:
    """When the rows of a file were sampled.

    `time` in s, (n_row,), running forward; `sample_time_s` the mean step, gaps left out. `number` is the sample of an
    even grid that each row is, with missing samples between them; None where the rows lie on none. `unevenness` is the
    largest and the rms deviation of a step from the mean one, in samples, gaps left out.
    """

    time: FloatArray
    sample_time_s: float
    number: IntArray | None
    unevenness: tuple[float, float]

    @classmethod
    def of(cls, time: FloatArray) -> TimeStamps:
        """Judge a column of time stamps in s.

        Raises
        ------
        DataRejected
            If the clock stands, runs back or is not known (fault A10); the message has the sample.
        """
        if time.ndim != 1 or len(time) < 2:
            raise DataRejected(f"the time column has shape {time.shape}; one instant per sample is needed")
        if not np.isfinite(time).all():
            first = int(np.argmin(np.isfinite(time)))
            raise DataRejected(
                f"A10: the time is not known at sample {first}; leave such rows out of the file"
            )
        steps = np.diff(time)
        for wrong, verb in ((steps == 0, "stands"), (steps < 0, "runs back")):
            if wrong.any():
                first = int(np.argmax(wrong))
                raise DataRejected(
                    f"A10: the clock {verb}: time goes from {time[first]:g} s to {time[first + 1]:g} s at sample "
                    f"{first + 1} ({int(wrong.sum())} such steps); leave such rows out, or give sample_time_s alone "
                    "where only the time stamps are wrong"
                )
        usual = float(np.median(steps))
        near = np.abs(steps / usual - 1) <= STEP_TOLERANCE
        even = float(steps[near].mean())
        share = steps / even
        whole = np.round(share)
        tolerance = np.where(whole == 1, STEP_TOLERANCE, GAP_TOLERANCE)
        on_grid = ((whole >= 1) & (np.abs(share - whole) <= tolerance)).all()
        # Where stamps lie on a grid, a step over missing samples is no jitter.
        alone = steps[whole == 1] if on_grid else steps[steps <= GAP * usual]
        mean = float(alone.mean())
        off = alone / mean - 1
        unevenness = float(np.abs(off).max()), float(np.sqrt((off**2).mean()))
        if not on_grid:
            return cls(time, mean, None, unevenness)
        number = np.concatenate([[0], np.cumsum(whole)]).astype(np.int64)
        return cls(time, float((time[-1] - time[0]) / number[-1]), number, unevenness)

    def jitter(self) -> str:
        """Say by how much steps are off that are taken as even all the same; empty where next to nothing."""
        largest, rms = (100 * one for one in self.unevenness)
        if rms < JITTER:
            return ""
        return (
            f"steps of time differ from the mean one by up to {largest:.2g} % ({rms:.2g} % rms) and are taken as even. "
            "That is right where only the stamps jitter; if the sampling itself does, set resample: cubic"
        )

    def refusal(self) -> str:
        """Say how uneven they are, and what to set."""
        share = np.diff(self.time) / self.sample_time_s
        first = int(np.argmax(np.abs(share - 1) > STEP_TOLERANCE))
        largest, rms = (100 * one for one in self.unevenness)
        return (
            f"A10: the steps of time differ from the mean {self.sample_time_s:.6g} s by up to {largest:.3g} % of a "
            f"sample ({rms:.3g} % rms), first at sample {first + 1}; set resample: linear, cubic or band_limited, "
            f"which brings all channels to an even {1 / self.sample_time_s:.6g} Hz (to another rate with "
            "sample_time_s), or give sample_time_s without time_column where only the time stamps are wrong"
        )
