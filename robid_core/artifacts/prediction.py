"""What a prediction is judged by beside its errors: errors of each run, what is left over variables, excited ranges."""

from __future__ import annotations

from dataclasses import dataclass

from robid_core.arrays import BoolArray, FloatArray, IntArray
from robid_core.artifacts.artifact import Artifact, array


@dataclass(frozen=True, eq=False)
class ExcitedRange(Artifact):
    """How far the axes went in a record, motor side, each (n_axis,): speeds and so on are largest sizes.

    `torque` is NaN where none was recorded. `marks` are fingerprints of some samples, by which the data are known
    again: a prediction of them is none.
    """

    axis_names: tuple[str, ...]
    lowest_position: FloatArray = array("n_axis")
    highest_position: FloatArray = array("n_axis")
    speed: FloatArray = array("n_axis")
    acceleration: FloatArray = array("n_axis")
    torque: FloatArray = array("n_axis", finite=False)
    marks: IntArray | None = array("n_mark", optional=True)


@dataclass(frozen=True, eq=False)
class RunErrors(Artifact):
    """How far one model is from each run (experiment), axis by axis; `tested` marks those that no fit saw.

    `relative` is over the rms of what was measured, NaN where nothing was.
    """

    model: str
    quantity: str
    unit_symbol: str
    axis_names: tuple[str, ...]
    runs: tuple[str, ...]
    tested: BoolArray = array("n_run")
    rms: FloatArray = array("n_run n_axis")
    relative: FloatArray = array("n_run n_axis", finite=False)


@dataclass(frozen=True, eq=False)
class PredictionCurve(Artifact):
    """What a prediction leaves at one axis over a variable, of trained and of tested runs apart.

    Means over parts of the variable, over time and order sizes; NaN where runs of a kind have too few samples.
    """

    axis: str
    variable: str
    unit_symbol: str
    abscissa: FloatArray = array("n_point")
    trained: FloatArray = array("n_point", finite=False)
    tested: FloatArray = array("n_point", finite=False)
