"""The next experiment: what would tell a finding of a diagnosis from what explains the data as well."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from robid_core.arrays import BoolArray, FloatArray, IntArray
from robid_core.artifacts.artifact import Artifact, array
from robid_core.artifacts.evidence_tables import rival_table
from robid_core.artifacts.tables import Table

MINUTE = 60.0


@dataclass(frozen=True, eq=False)
class SeparatingExperiment(Artifact):
    """The experiment, of those that were tried, that best distinguishes a finding from what explains the data as well.

    A recorded motion about `configuration`, joint side, its speeds `amplitude` times the recorded ones: `reference` at
    the motors, one period of it where `line` has excited bins, else all of it. `n_period` of them after
    `n_settling` to settle; `duration_s` counts all.
    `ratio` is the expected logarithm of the likelihood ratio of the finding to each of `rivals` (for whichever of the
    two is right, the smaller), `repeat` the best of what was recorded already, once more. `difference` says in words
    how gravity loads the axis otherwise than in the record, empty where it does not.
    """

    TELLING: ClassVar[float] = 1.0  # of an expected ratio: an experiment that promises less separates nothing

    rivals: tuple[str, ...]
    amplitude: float
    duration_s: float
    n_period: int
    n_settling: int
    difference: str
    configuration: FloatArray = array("n_axis", "rad")
    reference: FloatArray = array("n_sample n_axis", "rad/s")
    ratio: FloatArray = array("n_rival")
    repeat: FloatArray = array("n_rival", finite=False)
    line: IntArray | None = array("n_freq", optional=True)

    @property
    def tells(self) -> BoolArray:
        """Which rivals it separates from the finding, (n_rival,)."""
        result: BoolArray = self.ratio >= self.TELLING
        return result

    @property
    def expected(self) -> float:
        """Smallest ratio of the rivals that it separates from the finding; if none, the largest of all."""
        return float(self.ratio[self.tells].min() if self.tells.any() else self.ratio.max())

    @property
    def sentence(self) -> str:
        """How to separate the finding from its rivals, or that no experiment that was tried does."""
        told, untold = (
            ", ".join(name for name, tells in zip(self.rivals, self.tells, strict=True) if tells == wanted)
            for wanted in (True, False)
        )
        if not told:
            return (
                "no experiment of this kind (a recorded motion, slower or faster, here or in another configuration) "
                f"separates it from {untold}: expected log-likelihood ratio {self.expected:.2g} an experiment at most"
            )
        where = ", ".join(f"{angle:.3g}" for angle in self.configuration)
        text = f"separate it from {told} with: configuration [{where}]"
        text += f" ({self.difference})" if self.difference else ""
        text += (
            f", recorded speeds times {self.amplitude:g}; expected log-likelihood ratio {self.expected:.3g} an "
            f"experiment ({_duration(self.duration_s)})"
        )
        repeat = self.repeat[self.tells]
        if np.isfinite(repeat).all():
            text += f", {repeat.min():.2g} where a recorded one is repeated"
        return text + (f"; none of this kind separates it from {untold}" if untold else "")

    def table(self) -> Table:
        """Return a row for each rival: expected log-likelihood ratio, that of a repetition, whether it is separated.

        >>> import numpy as np, robid_core as robid
        >>> angle, ratio = np.zeros(1), np.array([4.0])
        >>> tried = robid.SeparatingExperiment(("dahl",), 0.5, 9.0, 3, 1, "", angle, np.zeros((5, 1)), ratio, ratio)
        >>> tried.table()
        {'rival': ['dahl'], 'expected': [4.0], 'repeat': [4.0], 'separated': [True]}
        """
        return rival_table(self)


def _duration(seconds: float) -> str:
    return f"{seconds / MINUTE:.2g} min" if seconds >= MINUTE else f"{seconds:.2g} s"
