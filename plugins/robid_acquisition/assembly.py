"""Dense arrays put together from experiments that are read one after another, so that no two files are in memory.

The first experiment says how long all are; one that is a little shorter cuts them all, one that is much shorter or
sampled at another rate is refused.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np

from robid_core import BoolArray, DataRejected, FloatArray, RobidError

LENGTH_TOLERANCE = 0.1  # share of the longest by which an experiment may be shorter
RATE_TOLERANCE = 1e-3  # by which sampling times may differ: the clocks of two recordings, not two rates

KNOWN = ""  # under this name the marks of measured samples lie beside the channels

Index = tuple[int, int, int]  # configuration, block, experiment


class Assembly:
    """Channels of all experiments under construction.

    Parameters
    ----------
    shape
        Numbers of configurations, blocks and experiments.
    periodic
        Whether samples are those of a period, which cannot be cut.
    """

    def __init__(self, shape: Index, periodic: bool) -> None:
        self._shape, self._periodic = shape, periodic
        self._values: dict[str, FloatArray] = {}
        self._names: list[str] = []
        self._lengths: list[tuple[int, int]] = []  # periods, samples
        self._sample_times: list[float] = []

    def put(
        self,
        place: Index,
        name: str,
        values: Mapping[str, FloatArray],
        sample_time_s: float,
        known: BoolArray | None = None,
    ) -> None:
        """Enter an experiment.

        Parameters
        ----------
        place
            Where it belongs.
        name
            Its name for people.
        values
            Channels, each of shape (n_period, n_sample, n_axis).
        sample_time_s
            Time from sample to sample.
        known
            Samples that were measured, (n_period, n_sample); None: all.

        Raises
        ------
        DataRejected
            If it is sampled at another rate than the first one, or of quite another length.
        """
        first = next(iter(values.values()))
        n_period, n_sample = first.shape[:2]
        self._names.append(name)
        self._lengths.append((n_period, n_sample))
        self._sample_times.append(sample_time_s)
        self._refuse_unlike()
        marks = np.ones((n_period, n_sample, 1)) if known is None else known[..., None].astype(np.float64)
        for channel, samples in {**values, KNOWN: marks}.items():
            if channel not in self._values:
                self._values[channel] = np.empty((*self._shape, *samples.shape))
            target = self._values[channel][place]
            periods, length = min(n_period, target.shape[0]), min(n_sample, target.shape[1])
            target[:periods, :length] = samples[:periods, :length]

    def _refuse_unlike(self) -> None:
        """Compare the last experiment with the first."""
        names = f"{self._names[0]} and {self._names[-1]}"
        one, other = self._sample_times[0], self._sample_times[-1]
        if abs(other / one - 1) > RATE_TOLERANCE:
            raise DataRejected(
                f"{names} are sampled every {one:g} s and {other:g} s; resample one, or import them by two stages"
            )
        first, last = self._lengths[0], self._lengths[-1]
        if self._periodic and first[1] != last[1]:
            raise DataRejected(
                f"A09: a period has {first[1]} and {last[1]} samples in {names}; resample one, or give sample_time_s "
                "where only the time stamps are wrong"
            )
        short, long = sorted((first[0] * first[1], last[0] * last[1]))
        if short < (1 - LENGTH_TOLERANCE) * long:
            raise DataRejected(
                f"A11: {names} hold {first[0]} x {first[1]} and {last[0]} x {last[1]} samples (periods x samples); set "
                "stop_s so that all are alike, or read them by a stage each: fits and diagnoses take several records, "
                "inputs: {record: [one, other]}"
            )

    @property
    def sample_time_s(self) -> float:
        """Sampling time, the middle one where clocks differ."""
        return float(np.median(self._sample_times))

    @property
    def channels(self) -> dict[str, FloatArray]:
        """Values by channel, as long as the shortest experiment: (config, block, exp, period, sample, axis)."""
        periods, samples = np.min(self._lengths, axis=0)
        return {
            name: values[:, :, :, :periods, :samples]
            for name, values in self._values.items()
            if name != KNOWN
        }

    @property
    def known(self) -> BoolArray:
        """Which samples were measured, (config, block, exp, period, sample)."""
        periods, samples = np.min(self._lengths, axis=0)
        known: BoolArray = self._values[KNOWN][:, :, :, :periods, :samples, 0] > 0
        return known

    def cut(self) -> str:
        """Say which experiments were cut to what length, empty where all were alike."""
        lengths = [periods * samples for periods, samples in self._lengths]
        if min(lengths) == max(lengths):
            return ""
        short, long = self._names[int(np.argmin(lengths))], self._names[int(np.argmax(lengths))]
        return f"{long} has {max(lengths)} samples and {short} {min(lengths)}; all are cut to the shortest"


def name_file(name: str, error: RobidError) -> None:
    """Let an error name the file that it is about, behind the id of its fault."""
    text = str(error)
    if name not in text:
        fault = re.match(r"[A-Z][0-9]{2}: ", text)
        head = fault[0] if fault else ""
        error.args = (f"{head}{name}: {text.removeprefix(head)}",)
