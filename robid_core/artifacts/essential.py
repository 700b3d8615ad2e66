"""Essential parameters: the base parameters that a record tells, and which were left out in what order."""

from __future__ import annotations

from dataclasses import dataclass

from robid_core.arrays import FloatArray
from robid_core.artifacts.artifact import Artifact, array


@dataclass(frozen=True, eq=False)
class EssentialParameters(Artifact):
    """Least squares with as few base parameters as the data allow, without tolerances of bodies.

    `removed` went one after another, each with the largest `relative_error` (standard error over size) then;
    `increase` is by which share what is left of the torque, rms, had grown, and `probability` that chance gives so
    much. What remains has `estimate` and `standard_error` in its own unit.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    removed: tuple[str, ...]
    estimate: FloatArray = array("n_essential")
    standard_error: FloatArray = array("n_essential")
    relative_error: FloatArray = array("n_removed", finite=False)
    increase: FloatArray = array("n_removed")
    probability: FloatArray = array("n_removed")
