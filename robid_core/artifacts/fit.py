"""Parameters that were estimated, with what they explain."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robid_core.arrays import BoolArray, ComplexArray, FloatArray
from robid_core.artifacts.artifact import Artifact, array
from robid_core.artifacts.doubts import Doubt, judge
from robid_core.artifacts.essential import EssentialParameters
from robid_core.artifacts.evidence_tables import error_table
from robid_core.artifacts.finding import DiagnosedData, Finding, ResidualCurve, SearchRecord
from robid_core.artifacts.friction_curve import FrictionCurve
from robid_core.artifacts.misfit import MisfitTable
from robid_core.artifacts.model import Model
from robid_core.artifacts.prediction import ExcitedRange, PredictionCurve, RunErrors
from robid_core.artifacts.response_check import ResponseCheck
from robid_core.artifacts.tables import Table, comparison_table, finding_table, parameter_table
from robid_core.artifacts.timing import Timing

N_CURVE = 300  # over two decades a step of 1.5 %: a resonance of 1 % damping is 2 % wide
NEAR = 1e-6  # a line and a frequency between lines are one
HELD = "held"  # no group: what was not estimated
NUISANCE = "nuisance"  # group of what a fit estimates besides the robot's parameters


@dataclass(frozen=True, eq=False)
class ParameterTable(Artifact):
    """Named parameters of the robot: where the fit began, where it ended, and how sure it is.

    `standard_error` is in the parameter's own unit and NaN for a parameter that was held; `group` says what
    it is for a reader (`stiffness`, `damping`, `friction`, `inertia`, ...; `nuisance` is no parameter of the robot);
    `reported` marks the rows that a short table shows; `prior` is the standard deviation that was assumed before the
    data, in the same unit, NaN where none was; `spread` is the standard error that the spread over experiments says,
    each left out in turn, NaN where there is none.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    groups: tuple[str, ...]
    start: FloatArray = array("n_parameter")
    estimate: FloatArray = array("n_parameter")
    standard_error: FloatArray = array("n_parameter", finite=False, least=0.0)
    reported: BoolArray = array("n_parameter")
    at_bound: BoolArray = array("n_parameter")
    prior: FloatArray | None = array("n_parameter", optional=True, finite=False, least=0.0)
    spread: FloatArray | None = array("n_parameter", optional=True, finite=False, least=0.0)

    def value(self, name: str) -> float:
        """Return the estimate of one parameter.

        >>> import robid_core as robid
        >>> from robid_core.testing import example_fit
        >>> example_fit(robid.Robot.load("one_axis")).parameters.value("gear_stiffness.axis_1")
        80000.0
        """
        return float(self.estimate[self.names.index(name)])

    def as_mapping(self) -> dict[str, float]:
        """Return the estimates by name, as `Robot.with_parameters` takes them: nuisances are left out.

        >>> import robid_core as robid
        >>> from robid_core.testing import example_fit
        >>> robot = robid.Robot.load("one_axis")
        >>> example_fit(robot).parameters.as_mapping()
        {'gear_stiffness.axis_1': 80000.0, 'gear_damping.axis_1': 60.0}
        """
        rows = zip(self.names, self.groups, self.estimate.tolist(), strict=True)
        return {name: value for name, group, value in rows if group != NUISANCE}

    def table(self, everything: bool = False) -> Table:
        """Return a row for each parameter that is reported, or for `everything`: start, estimate, standard error.

        >>> import robid_core as robid
        >>> from robid_core.testing import example_fit
        >>> table = example_fit(robid.Robot.load("one_axis")).parameters
        >>> table.table()["parameter"], table.table(everything=True)["unit"]
        (['gear_stiffness.axis_1'], ['N m/rad', 'N m s/rad'])
        """
        return parameter_table(self, everything)

    def unreported(self) -> str:
        """Say what was estimated beside the reported parameters, by group, for terminal and page; empty for nothing.

        >>> import robid_core as robid
        >>> from robid_core.testing import example_fit
        >>> example_fit(robid.Robot.load("six_axis")).parameters.unreported()
        '12 more parameters of the robot (12 of damping)'
        """
        rows = zip(self.groups, self.reported.tolist(), self.standard_error.tolist(), strict=True)
        counts = Counter(group if error == error else HELD for group, shown, error in rows if not shown)
        nuisances, held = counts.pop(NUISANCE, 0), counts.pop(HELD, 0)
        groups = ", ".join(f"{count} of {group}" for group, count in counts.items())
        parts = [_more(counts.total(), "parameter", f" of the robot ({groups})")] if counts else []
        parts += [_more(nuisances, "nuisance parameter", "", bool(counts))] if nuisances else []
        return ", ".join([*parts, *([f"{held} held"] if held else [])])


def _more(count: int, noun: str, of: str, follows: bool = False) -> str:
    """Return `2 more parameters of ...`; without `more` where it follows others."""
    return f"{count} {'' if follows else 'more '}{noun}{'' if count == 1 else 's'}{of}"


@dataclass(frozen=True, eq=False)
class ResponseComparison(Artifact):
    """Measured and modelled frequency responses on the same lines; `deviation` is one standard deviation.

    `curve` and `curve_start` are the same models at `curve_frequency_hz`, which lies close enough to draw a resonance
    that stands between two lines; without them curves are drawn through the lines.
    """

    axis_names: tuple[str, ...]
    frequency_hz: FloatArray = array("n_freq", "Hz", rising=True)
    measured: ComplexArray = array("n_config n_freq n_out n_in", "(rad/s^2)/(N m)", finite=False, known=True)
    modelled: ComplexArray = array("n_config n_freq n_out n_in", "(rad/s^2)/(N m)")
    start: ComplexArray = array("n_config n_freq n_out n_in", "(rad/s^2)/(N m)")
    deviation: FloatArray = array("n_config n_freq n_out n_in", "(rad/s^2)/(N m)", finite=False)
    curve_frequency_hz: FloatArray | None = array("n_curve", "Hz", rising=True, optional=True)
    curve: ComplexArray | None = array("n_config n_curve n_out n_in", "(rad/s^2)/(N m)", optional=True)
    curve_start: ComplexArray | None = array("n_config n_curve n_out n_in", "(rad/s^2)/(N m)", optional=True)

    @staticmethod
    def frequencies_of_curves(frequency_hz: FloatArray) -> FloatArray:
        """Return the lines and N_CURVE frequencies in equal ratios between them, each once, shape (n_curve,).

        >>> import numpy as np, robid_core as robid
        >>> curve = robid.ResponseComparison.frequencies_of_curves(np.array([5.0, 10.0, 20.0]))
        >>> len(curve), curve[[0, -1]].tolist(), 10.0 in curve
        (301, [5.0, 20.0], True)
        """
        between = np.geomspace(frequency_hz[0], frequency_hz[-1], N_CURVE)
        apart = np.abs(between[:, None] / frequency_hz - 1).min(axis=1) > NEAR
        return np.sort(np.concatenate((frequency_hz, between[apart])))


@dataclass(frozen=True, eq=False)
class TimeComparison(Artifact):
    """Measured and simulated values of one channel over time; `relative_error` is |e| / |measured|."""

    axis_names: tuple[str, ...]
    channel: str
    unit_symbol: str
    relative_error: float
    time_s: FloatArray = array("n_sample", "s")
    measured: FloatArray = array("n_sample n_axis")
    modelled: FloatArray = array("n_sample n_axis")

    def table(self) -> Table:
        """Return a row for each sample: time, and both values of each axis.

        >>> import robid_core as robid
        >>> from robid_core.testing import example_diagnosis
        >>> comparison = example_diagnosis(robid.Robot.load("one_axis")).time[0]
        >>> list(comparison.table())
        ['time_s', 'measured.axis_1', 'modelled.axis_1']
        """
        return comparison_table(self)


@dataclass(frozen=True, eq=False)
class PredictionErrors(Artifact):
    """How far a model is from a record, axis by axis; `low` and `high` hold `relative` in 95 % of such records.

    `model` and `quantity` in words ("fit", "torque in open loop"); `rms` in `unit_symbol`; `relative` is over the rms
    of what was measured, `of_limit` over the torque limit of the robot file; `still` marks
    axes that hardly moved, of which a percentage says little. `noise` is what noise alone would leave of a right model,
    as `relative`.
    """

    model: str
    quantity: str
    unit_symbol: str
    axis_names: tuple[str, ...]
    rms: FloatArray = array("n_axis")
    relative: FloatArray = array("n_axis", finite=False)
    low: FloatArray = array("n_axis", finite=False)
    high: FloatArray = array("n_axis", finite=False)
    still: BoolArray = array("n_axis")
    of_limit: FloatArray | None = array("n_axis", optional=True, finite=False)
    noise: FloatArray | None = array("n_axis", optional=True, finite=False)

    def table(self) -> Table:
        """Return a row for each axis: what is left, in units and of what was measured, and its 95 % range.

        >>> import numpy as np, robid_core as robid
        >>> one, no = np.ones(1), np.array([False])
        >>> errors = robid.PredictionErrors("fit", "torque", "N m", ("axis_1",), one, one / 50, one / 60, one / 40, no)
        >>> errors.table()["relative"]
        [0.02]
        """
        return error_table(self)


@dataclass(frozen=True, eq=False)
class Fit(Artifact):
    """Estimated parameters and the evidence for them.

    `status` is a sentence; a fit that did not converge is still a result, with `converged` false. `misfit` is
    the weighted residual per degree of freedom (1 where model and stated uncertainty are right). `misfit_against` says
    what it is measured against; it is empty where the weights were chosen such that the misfit is one, which then
    checks nothing. `model_error` is the relative error that the weights grant to the model. `stated_doubts` are what
    only the estimator can know; `doubts` are all. `covariance` is that of the unknowns as the method has them
    (logarithms, natural scales); `model` is the robot that was found, its covariance in the parameters' own units:
    `Robot.model` makes it, and stages take it by `inputs: {robot: fit}`. `base` are the combinations of inertial
    parameters that motion can show at all, where the estimator knows them, `essential` those of them that the data
    tell; `friction` is drawn: torque over speed. `excited` is how far the axes went in the data.
    """

    method: str
    status: str
    converged: bool
    misfit: float
    n_starts: int
    n_agree: int
    parameters: ParameterTable
    covariance: FloatArray = array("n_free n_free", finite=False, covariance=True)
    free_names: tuple[str, ...] = ()
    response: ResponseComparison | None = None
    time: tuple[TimeComparison, ...] = ()
    misfit_against: str = "the stated uncertainty"
    misfit_table: MisfitTable | None = None
    model_error: float | None = None
    stated_doubts: tuple[Doubt, ...] = ()
    model: Model | None = None
    base: ParameterTable | None = None
    friction: tuple[FrictionCurve, ...] = ()
    excited: ExcitedRange | None = None
    essential: EssentialParameters | None = None

    @property
    def doubts(self) -> tuple[Doubt, ...]:
        """Every doubt and remark about these numbers, as screen, page and manifest tell them.

        >>> import robid_core as robid
        >>> from robid_core.testing import example_fit
        >>> fit = example_fit(robid.Robot.load("one_axis"))
        >>> [doubt.kind for doubt in fit.replace(converged=False).doubts]
        ['convergence']
        """
        return judge(self)

    @property
    def is_doubted(self) -> bool:
        """Whether there is any reason not to rely on these numbers."""
        return any(not doubt.is_remark for doubt in self.doubts)

    def correlation(self, names: Sequence[str] = ()) -> FloatArray:
        """Return the correlations of estimates, (n_free, n_free), or of some of them, zero where a variance is unknown.

        >>> import robid_core as robid
        >>> from robid_core.testing import example_fit, example_robot
        >>> fit = example_fit(example_robot(2))
        >>> fit.correlation(["gear_stiffness.axis_1", "gear_stiffness.axis_2"]).tolist()
        [[1.0, 0.0], [0.0, 1.0]]
        """
        index = [self.free_names.index(name) for name in names or self.free_names]
        covariance = self.covariance[np.ix_(index, index)]
        deviation = np.sqrt(np.maximum(np.diag(covariance), 0.0))
        with np.errstate(invalid="ignore", divide="ignore"):
            found: FloatArray = covariance / np.outer(deviation, deviation)
        return np.where(np.isfinite(found), found, 0.0)

    def table(self, everything: bool = False) -> Table:
        """Return the parameters that are reported, or `everything`, with start, estimate and standard error.

        Examples
        --------
        >>> import robid_core as robid
        >>> from robid_core.testing import example_fit
        >>> fit = example_fit(robid.Robot.load("one_axis"))
        >>> for row in fit.table().rows():
        ...     print(row["parameter"], row["unit"], f"{row['estimate']:.4g} +- {row['standard_error']:.2g}")
        gear_stiffness.axis_1 N m/rad 8e+04 +- 2.4e+03
        """
        return self.parameters.table(everything)


@dataclass(frozen=True, eq=False)
class Diagnosis(Artifact):
    """What the simulation gets wrong: simulated against measured, with numbers and a verdict in words.

    `model` is the robot that was found, where the diagnosis changes the one that it was given. `findings` are causes,
    first the one that gains most; `values` all that was estimated beside them; `timing` the lag of each torque;
    `search` what was tried; `left` where the robot that was found still misfits, as `Fit.misfit_table`;
    `data` what was looked at; `residuals` what is left over speed, angle, load, acceleration, time and frequency;
    `response_check` what frequency responses say of its stiffnesses, None where not asked for; `runs` are errors of
    single runs and `curves` what a prediction leaves; `doubts` are reasons not to rely on its numbers.
    """

    method: str
    verdict: str
    time: tuple[TimeComparison, ...] = ()
    response: ResponseComparison | None = None
    model: Model | None = None
    errors: tuple[PredictionErrors, ...] = ()
    findings: tuple[Finding, ...] = ()
    values: ParameterTable | None = None
    search: SearchRecord | None = None
    timing: Timing | None = None
    left: MisfitTable | None = None
    data: DiagnosedData | None = None
    residuals: tuple[ResidualCurve, ...] = ()
    response_check: ResponseCheck | None = None
    runs: tuple[RunErrors, ...] = ()
    curves: tuple[PredictionCurve, ...] = ()
    doubts: tuple[Doubt, ...] = ()

    def __str__(self) -> str:
        """Return the verdict."""
        return self.verdict

    def table(self) -> Table:
        """Return a row for each number of each finding: what the file states, what was found, how much that gains.

        >>> import robid_core as robid
        >>> from robid_core.testing import example_diagnosis
        >>> list(example_diagnosis(robid.Robot.load("one_axis")).table())[:6]
        ['kind', 'effect', 'where', 'parameter', 'unit', 'nominal']
        """
        return finding_table(self.findings)
