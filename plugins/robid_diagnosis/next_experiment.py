"""The experiments that separate the ties of a diagnosis, as configurations and an excitation that drives can run.

Each finding whose ties an experiment tells apart has one configuration; blocks repeat its motion as often as the
expected logarithm of the likelihood ratio asks for. The safety gate clears it like any other motion.
"""

from __future__ import annotations

import numpy as np
from pydantic import PositiveFloat, PositiveInt

from robid_core import (
    CandidateDesign,
    Configurations,
    DataRejected,
    Diagnosis,
    Excitation,
    ExcitationDesign,
    Robot,
    SeparatingExperiment,
)


def telling_experiments(diagnosis: Diagnosis) -> tuple[SeparatingExperiment, ...]:
    """Experiments that tell a finding from one of its ties at least, of those that are as long as the first."""
    found = [
        one.separation
        for one in diagnosis.findings
        if one.separation is not None and one.separation.tells.any()
    ]
    return tuple(
        one
        for one in found
        if one.reference.shape == found[0].reference.shape and np.array_equal(_lines(one), _lines(found[0]))
    )


def _lines(one: SeparatingExperiment) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    return np.empty(0, dtype=np.int64) if one.line is None else np.asarray(one.line, dtype=np.int64)


def _wanted(diagnosis: Diagnosis) -> tuple[SeparatingExperiment, ...]:
    found = telling_experiments(diagnosis)
    if not found:
        raise DataRejected(
            "the diagnosis has no ties that an experiment would separate: nothing is to be measured"
        )
    return found


class SeparatingConfigurations(CandidateDesign):
    """Configurations for the experiment that separates the tied causes of a diagnosis.

    where_next: {use: design.separating, inputs: {diagnosis: explain}}
    """

    def run(self, diagnosis: Diagnosis, robot: Robot) -> Configurations:
        """One configuration for each finding that can be told from its ties."""
        return Configurations(robot.axis_names, np.stack([one.configuration for one in _wanted(diagnosis)]))


class SeparatingExcitation(ExcitationDesign):
    """Motions of the experiment that separates the tied causes of a diagnosis, repeated in blocks.

    excite_next: {use: excitation.separating, inputs: {diagnosis: explain}}
    """

    enough: PositiveFloat = 5.0
    """Logarithm of the likelihood ratio that all blocks together are expected to reach."""
    most: PositiveInt = 8
    """Blocks at most."""

    def run(self, diagnosis: Diagnosis, robot: Robot) -> Excitation:
        """One realisation for each finding, its blocks alike."""
        found = _wanted(diagnosis)
        n_block = min(self.most, max(int(np.ceil(self.enough / one.expected)) for one in found))
        reference = np.stack([one.reference for one in found])[:, None, None]
        return Excitation(
            robot.axis_names,
            robot.sample_time_s,
            0,
            _lines(found[0]),
            np.repeat(reference, n_block, axis=1),
            np.zeros(robot.n_axis),
        )
