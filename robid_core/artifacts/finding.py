"""Findings of a diagnosis: what data demand beside the nominal model, one cause each."""

from __future__ import annotations

from dataclasses import dataclass

from robid_core.arrays import FloatArray
from robid_core.artifacts.artifact import Artifact, array
from robid_core.artifacts.separating_experiment import SeparatingExperiment
from robid_core.artifacts.tables import Table, finding_table


@dataclass(frozen=True, eq=False)
class Finding(Artifact):
    """One thing that the simulation gets wrong.

    `kind` is `cause` (an effect that explains what free functions at its place do), `partial` (it explains less,
    or more than noise is left where it acts, or free functions of one axis explain as much as a change of the robot),
    `unknown` (only free functions of what `effect` says explain what is left, or responses and torques disagree), or
    `value` (numbers of the robot file that are wrong). `effect` is the effect's plugin, or body, rotor or spring for
    values; `on` and `side` say where. `gain` is of twice the log-likelihood, `p_value` counts the search. `share` is
    the gain over that of the best free functions at the place, NaN where there are none. `by_configuration` is the gain
    in each configuration, `held_out` with sizes from the other configurations, `by_own_size` what a size of its own
    gains there beside such sizes in all others: of that which acts in one configuration only, nothing elsewhere. The
    picture shows mean residual torques over a variable, and what the effect does there.

    >>> import numpy as np, robid_core as robid
    >>> one, seen = np.ones(1), np.array([60.0])
    >>> finding = robid.Finding("cause", "friction.stribeck", "axis_1", "motor", 50.0, 1e-6, 0.9, ("excess",), ("N m",),
    ...     np.full(1, np.nan), one, 0.1 * one, seen, seen, seen)
    >>> finding.where, finding.n_seen
    ('axis_1 (motor)', 1)
    """

    kind: str
    effect: str
    on: str
    side: str
    gain: float
    p_value: float
    share: float
    names: tuple[str, ...]
    units: tuple[str, ...]
    nominal: FloatArray = array("n_parameter", finite=False)
    value: FloatArray = array("n_parameter")
    standard_error: FloatArray = array("n_parameter", finite=False)
    by_configuration: FloatArray = array("n_config", finite=False)
    held_out: FloatArray = array("n_config", finite=False)
    by_own_size: FloatArray = array("n_config", finite=False)
    ties: tuple[str, ...] = ()
    variable: str = ""
    abscissa: FloatArray | None = array("n_point", optional=True)
    residual: FloatArray | None = array("n_point", "N m", optional=True)
    explained: FloatArray | None = array("n_point", "N m", optional=True)
    separation: SeparatingExperiment | None = None

    @property
    def where(self) -> str:
        """Where it acts, in words."""
        return f"{self.on} ({self.side})" if self.side else self.on

    @property
    def n_seen(self) -> int:
        """Configurations in which it is seen."""
        return int((self.by_own_size > SEEN).sum())

    def table(self) -> Table:
        """Return a row for each of its numbers: what the file states, what was found, how much that gains.

        >>> import numpy as np, robid_core as robid
        >>> told, found, error, seen = np.array([[0.1], [0.2], [0.01], [50.0]])
        >>> finding = robid.Finding("value", "spring", "axis_1", "", 50.0, 0.0, 1.0, ("k",), ("N m/rad",), told, found,
        ...     error, seen, seen, seen)
        >>> finding.table()["nominal"], finding.table()["value"]
        ([0.1], [0.2])
        """
        return finding_table([self])


SEEN = 9.0  # of twice the log-likelihood: three standard errors


@dataclass(frozen=True, eq=False)
class VisibleSize(Artifact):
    """The smallest size of an effect at a place that a search would have found in nine of ten such records.

    `size` of `parameter` in `unit_symbol`; of a spring that gives way where the model is stiff, the largest stiffness.
    """

    effect: str
    on: str
    side: str
    parameter: str
    unit_symbol: str
    size: float


@dataclass(frozen=True, eq=False)
class ResidualCurve(Artifact):
    """Torque that models leave at one motor over a variable: mean over parts that hold equally many samples.

    `refitted` is left by the nominal robot with its values fitted, `extended` by the found robot. Over time and
    frequency they are root mean squares, beside that of the measured torque. `share` is the part of the squared
    residual of the refitted robot that a function of the variable does beyond chance, `odd` and `even` what functions
    of such symmetry do; NaN where that has no meaning.
    """

    axis: str
    variable: str
    unit_symbol: str
    abscissa: FloatArray = array("n_point")
    refitted: FloatArray = array("n_point")
    extended: FloatArray = array("n_point")
    measured: FloatArray | None = array("n_point", optional=True)
    share: float = float("nan")
    odd: float = float("nan")
    even: float = float("nan")


@dataclass(frozen=True, eq=False)
class DiagnosedData(Artifact):
    """What a diagnosis stands on: experiments that it looked at, of which each was held out once, and against what.

    `n_test` experiments of the role `test` were kept from it. `noise` says in words what weighs the bins up to
    `highest_hz`; `variants` names the loads or tools that the robot carried, empty where it carried none. `n_left_out`
    experiments were not used in the end, since the model that was found rattles in them. `seconds` of motion were
    recorded in them, from `sources`; 0 and none where an earlier version did not say.
    """

    n_config: int
    n_experiment: int
    n_test: int
    highest_hz: float
    noise: tuple[str, ...]
    variants: tuple[str, ...] = ()
    n_left_out: int = 0
    seconds: float = 0.0
    sources: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class SearchRecord(Artifact):
    """What a diagnosis tried: `trials` independent ones by their p-values; `failed` with the reason of each.

    `visible` is what it would have found.
    """

    n_tried: int
    trials: float
    effects: tuple[str, ...]
    excluded: tuple[str, ...]
    failed: tuple[str, ...]
    visible: tuple[VisibleSize, ...] = ()
