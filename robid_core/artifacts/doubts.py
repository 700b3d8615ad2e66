"""Why numbers should be doubted, and what is remarkable about them: one list for screen, page, manifest, exit code.

Judged from the `Fit` alone, so that the fit of a stranger and one of an earlier version are judged by the same rules;
what only an estimator can know (that experiments disagree, say) it states itself in `Fit.stated_doubts`. Of what the
stated errors count already the list holds remarks: they are told, and keep nobody from relying on the numbers.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from robid_core.arrays import BoolArray
from robid_core.artifacts.artifact import Artifact

if TYPE_CHECKING:
    from robid_core.artifacts.fit import Fit

NOT_CONVERGED = "convergence"  # the one kind after which the numbers are not even an estimate
COAXIAL_SPRINGS, WEAK_SPRING, NOT_SEEN = "coaxial springs", "weak spring", "not seen"
MORE_CONFIGURATIONS = (COAXIAL_SPRINGS, WEAK_SPRING, NOT_SEEN)  # what more configurations help against

# Corrected for few periods a right model stays below 1.03 from 12 experiments up; 1.08 leaves room for six.
LARGEST_MISFIT = 1.08
# Of the response; standard errors rest on the model error being small and without pattern. A good robot has 1.4 %.
LARGEST_MODEL_ERROR = 0.02
# A start that does not end at the best fit found another basin: then most of them should agree on this one.
AGREEING_SHARE = 0.5
# Beside friction as the robot file states it: what a machine differs from its data sheet by, warm or cold.
FRICTION_FACTORS = (0.7, 1.4)
FRICTION_FACTOR = "friction_factor."
# Standard error over prior (or over the value, where no prior is stated): above it the data halved nothing.
WEAKLY_SEEN = 0.5
# Between the estimates of two springs: only what they yield together is known. The worked example has 0.90.
COAXIAL = 0.99
# One damper at its bound is common, for they are seen badly, and harms no spring; of all else one is enough.
HARMLESS_DAMPERS = 2
MOST_NAMES = 6


@dataclass(frozen=True)
class Doubt(Artifact):
    """One reason not to rely on a result: its kind (one word or two), a sentence that says what was found, what to do.

    Its degree is `doubt` where it touches the numbers or their errors, `remark` where these count it already.
    """

    kind: str
    sentence: str
    remedy: str
    degree: Literal["doubt", "remark"] = "doubt"

    @property
    def is_remark(self) -> bool:
        """Whether the numbers may be relied on all the same."""
        return self.degree == "remark"

    def __str__(self) -> str:
        return f"{self.sentence}; {self.remedy}"


def judge(fit: Fit) -> tuple[Doubt, ...]:
    """Return every doubt and remark about a fit: what its numbers show, then what its estimator states."""
    return (*(doubt for find in _JUDGES for doubt in find(fit)), *fit.stated_doubts)


def _convergence(fit: Fit) -> Iterator[Doubt]:
    if not fit.converged:
        yield Doubt(
            NOT_CONVERGED,
            f"the fit did not converge: {fit.status}",
            "its numbers must not be used; give better start values, allow more steps (`passes` or `iterations` of the "
            "stage), or let robid diagnose look for what the model lacks",
        )


def _misfit(fit: Fit) -> Iterator[Doubt]:
    if not fit.misfit_against or fit.misfit <= LARGEST_MISFIT:
        return
    places = fit.misfit_table.worst(LARGEST_MISFIT) if fit.misfit_table is not None else ()
    where = f": {', '.join(places)}" if places else ""
    noise = (
        "; or its sensors are noisier than it states (position_noise, torque_noise)"
        if "robot file states" in fit.misfit_against
        else ""
    )
    yield Doubt(
        "misfit",
        f"misfit {fit.misfit:.4g} against {fit.misfit_against}, more than {LARGEST_MISFIT}{where}",
        f"the data show what the model lacks; robid diagnose looks for it, or add or free what acts there{noise}",
    )


def _model_error(fit: Fit) -> Iterator[Doubt]:
    if fit.model_error is not None and not fit.model_error <= LARGEST_MODEL_ERROR:
        yield Doubt(
            "model error",
            f"model error {100 * fit.model_error:.3g} %, more than {100 * LARGEST_MODEL_ERROR:g} %",
            "the model leaves that much of the data unexplained, and standard errors do not cover what it is; look "
            "where measured and modelled responses differ",
        )


def _bound(fit: Fit) -> Iterator[Doubt]:
    table = fit.parameters
    sharp = np.array([_is_zero_speed_width(name) for name in table.names], dtype=np.bool_)
    sharp &= table.at_bound & (table.estimate < table.start)
    if sharp.any():
        names = _listed([table.names[i] for i in np.flatnonzero(sharp)])
        yield Doubt(
            "sharp friction",
            f"friction turns round at a lower speed than the data resolve: {names}",
            "its levels do not depend on that; `friction_speed: 0` (fit.rigid) fits a plain sign",
            "remark",
        )
    serious = _serious(fit, table.at_bound & ~sharp)
    if serious:
        yield Doubt(
            "bound",
            f"at the bound of the search, hence not identified: {_listed(serious)}",
            "correct the start value in the robot file, or hold what the data do not show",
        )


def _unseen(fit: Fit) -> Iterator[Doubt]:
    table = fit.parameters
    free = np.isin(table.names, fit.free_names)
    names = _serious(fit, free & ~np.isfinite(table.standard_error) & ~table.at_bound)
    if names:
        yield Doubt(
            NOT_SEEN, f"without a standard error: {_listed(names)}", "add configurations that show them"
        )


def _weak_springs(fit: Fit) -> Iterator[Doubt]:
    table = fit.parameters
    prior = np.abs(table.estimate)
    if table.prior is not None:
        prior = np.where(np.isfinite(table.prior), table.prior, prior)
    weak = _springs(fit) & ~table.at_bound & (table.standard_error > WEAKLY_SEEN * prior)
    names = [
        f"{table.names[i]} ({100 * table.standard_error[i] / prior[i]:.0f} % of what was known before)"
        for i in np.flatnonzero(weak)
    ]
    if names:
        yield Doubt(
            WEAK_SPRING,
            f"hardly seen by the data: {_listed(names)}",
            "add configurations that load these springs, or hold them",
        )


def _coaxial_springs(fit: Fit) -> Iterator[Doubt]:
    """Two springs whose axes are parallel wherever it was measured yield as one: their estimates then correlate."""
    if len(fit.free_names) != len(fit.covariance):  # whose covariance it is, nobody said
        return
    springs = {fit.parameters.names[i] for i in np.flatnonzero(_springs(fit))}
    names = [name for name in fit.free_names if name in springs]
    correlation = fit.correlation(names) if names else np.empty((0, 0))
    pairs = [
        f"{names[i]} and {names[j]} (correlation {correlation[i, j]:.3f})"
        for i, j in np.argwhere(np.triu(np.abs(correlation) > COAXIAL, 1))
    ]
    if pairs:
        yield Doubt(
            COAXIAL_SPRINGS,
            f"not separated by the data: {_listed(pairs)}",
            "measure in more configurations, which load them differently, or hold one of them",
        )


def _friction(fit: Fit) -> Iterator[Doubt]:
    low, high = FRICTION_FACTORS
    factors = {
        name.removeprefix(FRICTION_FACTOR): value
        for name, value in zip(fit.parameters.names, fit.parameters.estimate.tolist(), strict=True)
        if name.startswith(FRICTION_FACTOR)
    }
    far = [f"{axis} {value:.3g}" for axis, value in factors.items() if not low <= value <= high]
    if far:
        yield Doubt(
            "friction",
            f"friction, as a ratio to the robot file's, is outside {low} to {high}: {_listed(far)}",
            "put the measured friction into the robot file; an error in it biases springs and dampers",
        )


def _starts(fit: Fit) -> Iterator[Doubt]:
    if fit.n_starts > 1 and fit.n_agree < max(2, AGREEING_SHARE * fit.n_starts):
        yield Doubt(
            "starts",
            f"only {fit.n_agree} of {fit.n_starts} starts reached the best fit",
            "a better one may be elsewhere; give better start values, or more starts",
        )


_JUDGES: tuple[Callable[[Fit], Iterator[Doubt]], ...] = (
    _convergence,
    _misfit,
    _model_error,
    _bound,
    _unseen,
    _weak_springs,
    _coaxial_springs,
    _friction,
    _starts,
)


def _springs(fit: Fit) -> BoolArray:
    return np.array([group == "stiffness" for group in fit.parameters.groups], dtype=np.bool_)


def _is_zero_speed_width(name: str) -> bool:
    """Whether a parameter is the speed within which the friction of a motor turns round."""
    return name.startswith("friction.") and name.endswith(".speed")


def _serious(fit: Fit, marked: BoolArray) -> list[str]:
    """Names of the marked parameters, dampers only where there are more than a harmless few."""
    dampers = np.array([group == "damping" for group in fit.parameters.groups], dtype=np.bool_)
    if (marked & dampers).sum() <= HARMLESS_DAMPERS:
        marked = marked & ~dampers
    return [fit.parameters.names[i] for i in np.flatnonzero(marked)]


def _listed(texts: Sequence[str]) -> str:
    more = len(texts) - MOST_NAMES
    return ", ".join(texts[:MOST_NAMES]) + (f" and {more} more" if more > 0 else "")
