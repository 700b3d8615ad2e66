"""Stiffnesses estimated twice, by the torque residual and from frequency responses, and whether the two agree."""

from __future__ import annotations

from dataclasses import dataclass

from robid_core.arrays import BoolArray, FloatArray
from robid_core.artifacts.artifact import Artifact, array
from robid_core.artifacts.evidence_tables import check_table
from robid_core.artifacts.tables import Table


@dataclass(frozen=True, eq=False)
class ResponseCheck(Artifact):
    """Another estimate of each stiffness from the same record, beside the one that a diagnosis stands on.

    `method` names the stages that estimated and fitted responses, `misfit` says how well the fit explains them.
    Standard errors have, beside what each fit states, the error that it grants to its model and the bias that noisy
    responses may have. `z` is the difference (responses less torques) over both errors; beyond `limit` the two
    disagree. Where there is no check `reason` says why in a clause, and all arrays are empty.
    """

    method: str
    reason: str
    misfit: float
    limit: float
    names: tuple[str, ...]
    units: tuple[str, ...]
    by_responses: FloatArray = array("n_stiffness")
    responses_error: FloatArray = array("n_stiffness")
    by_torques: FloatArray = array("n_stiffness")
    torques_error: FloatArray = array("n_stiffness")
    z: FloatArray = array("n_stiffness")

    @property
    def agree(self) -> BoolArray:
        """Which stiffnesses agree, shape (n_stiffness,)."""
        result: BoolArray = abs(self.z) <= self.limit
        return result

    def table(self) -> Table:
        """Return a row for each stiffness: both estimates with their errors, how far apart, whether they agree.

        >>> import numpy as np, robid_core as robid
        >>> one = np.ones(1)
        >>> check = robid.ResponseCheck("frf.log", "", 1.0, 3.0, ("a",), ("N m/rad",), one, one, one, one, 4 * one)
        >>> check.table()["agree"]
        [False]
        """
        return check_table(self)
