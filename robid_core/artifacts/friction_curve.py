"""Friction of one motor over its speed: what was measured at constant speeds, and the law that was fitted to it."""

from __future__ import annotations

from dataclasses import dataclass

from robid_core.arrays import FloatArray
from robid_core.artifacts.artifact import Artifact, array
from robid_core.artifacts.evidence_tables import friction_table
from robid_core.artifacts.tables import Table


@dataclass(frozen=True, eq=False)
class FrictionCurve(Artifact):
    """Friction of one motor over its speed, by increasing speed.

    Where an axis moved at constant speeds there is one point for each stretch: `measured` is the mean torque beyond
    what the rigid robot needs, less what the law ascribes to anything but the speed (load, temperature, an error of
    gravity). Of other motions `measured` is what free functions of the speed found. `fitted` is what the law ascribes
    to the speed; `law` says in words which terms it has.
    """

    axis: str
    law: str
    speed_unit: str
    unit_symbol: str
    speed: FloatArray = array("n_point")
    measured: FloatArray = array("n_point")
    fitted: FloatArray = array("n_point")

    def table(self) -> Table:
        """Return a row for each point: speed, measured friction and that of the law.

        >>> import numpy as np, robid_core as robid
        >>> speed = np.array([1.0, 2.0])
        >>> robid.FrictionCurve("axis_1", "viscous", "rad/s", "N m", speed, 0.1 * speed, 0.1 * speed).table()["fitted"]
        [0.1, 0.2]
        """
        return friction_table(self)
