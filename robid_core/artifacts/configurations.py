"""Where the robot stands when it is excited: one row per configuration."""

from __future__ import annotations

from dataclasses import dataclass

from robid_core.arrays import FloatArray
from robid_core.artifacts.artifact import Artifact, array
from robid_core.artifacts.tables import Table, configuration_table


@dataclass(frozen=True, eq=False)
class Configurations(Artifact):
    """Operating points of the robot.

    The *measured motor angle* defines a configuration, not the arm angle, which sags under gravity: `angle`
    is the motor angle seen through the gear (r_g q_m, joint side). A prismatic axis has metres.
    """

    axis_names: tuple[str, ...]
    angle: FloatArray = array("n_config n_axis", "rad")

    @property
    def n_config(self) -> int:
        """Number of configurations."""
        return int(self.angle.shape[0])

    @property
    def n_axis(self) -> int:
        """Number of motor axes."""
        return int(self.angle.shape[1])

    def table(self) -> Table:
        """Return a row for each configuration, a column for each axis, rad.

        Examples
        --------
        >>> import numpy as np, robid_core as robid
        >>> robid.Configurations(("axis_1",), np.array([[0.5], [1.0]])).table()
        {'configuration': [0, 1], 'axis_1': [0.5, 1.0]}
        """
        return configuration_table(self)
