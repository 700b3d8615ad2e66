"""What a cause must gain before it is named, of twice the log-likelihood.

More than chance; more than what laws named before leave that are a little off; and more than what the model itself may
err. Its error is granted to each bin by itself, as noise is (`model_error`); but a part of it may be alike in all bins
(friction that turns round within a sample, a band limit), and then it looks like some law. Data with little noise show
such errors: of a light robot with 0.06 % of noise three laws were named that nobody had put in, none of which moved the
torque by more than 0.02 %. What samples do not resolve of sharp friction is such an error, too: some function of the
speed is like it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from robid_core import ComplexArray, FloatArray
from robid_core.residual import Weighting
from robid_diagnosis.candidates import Candidate
from robid_diagnosis.hypothesis import Fitted
from robid_diagnosis.search import Hit
from robid_diagnosis.values import ValueHit

LEAST = 30.0  # what gains less is not named
LEAST_OF_VALUE = (
    20.0  # likewise, of values beyond their tolerance: four and a half of its standard deviations
)
NAMED = 1e-3  # of what was named before: three percent of an effect left over is no effect
NAMED_AT_LEAST = 1e-2, 100.0  # likewise: ten percent, of what was named and up to a gain
DOMINANT = 0.5  # of what a cause has to gain: an error that large is given as the reason
ALIKE = 0.5  # of the model error: this much of it may be alike in all bins


@dataclass(frozen=True, eq=False)
class LeastGains:
    """Smallest gain that names a cause beside one fit, at each axis."""

    beside_chance: float
    """And beside what was named."""
    errors: FloatArray
    """What the model's own error could gain, (n_axis,)."""
    axis_names: tuple[str, ...]

    @classmethod
    def beside(cls, fitted: Fitted, named: Sequence[float], *, careful: bool = False) -> LeastGains:
        """Return those beside a fit and the gains of what was named before.

        `careful`: what is left counts in the noise alone, as befits what no cause is named for, and beside laws that
        may be three percent off at any size; else small ones may be ten percent off.
        """
        known, (share, at_most) = sum(named), NAMED_AT_LEAST
        left = NAMED * known if careful else max(NAMED * known, min(share * known, at_most))
        return cls(
            LEAST * (max(1.0, fitted.misfit) if careful else fitted.excess) + left,
            (ALIKE * fitted.model_error) ** 2 * _torques(fitted) + _unresolved(fitted),
            fitted.problem.free.robot.axis_names,
        )

    def at(self, axis: int | None) -> float:
        """At an axis; of what changes all of them where it is None."""
        error = self.errors.max() if axis is None else self.errors[axis]
        return self.beside_chance + float(error)

    def of_candidate(self, candidate: Candidate) -> float:
        """Of an effect at its place."""
        return self.at(None if candidate.place is None else candidate.place.axis)

    def why_not(self, hit: Hit) -> str:
        """Say why an effect that gains less is not named."""
        place, text = hit.candidate.place, f"a cause has to gain {self.of(hit):.3g} here"
        error = float(self.errors.max() if place is None else self.errors[place.axis])
        if hit.candidate.is_scale or error < DOMINANT * self.of(hit):
            return text
        return f"{text}, as friction between the samples and the model's own error could gain {error:.3g}"

    def of(self, rival: Hit | ValueHit) -> float:
        """Of an effect, or of a wrong value, a channel's scale among them: what these gain is counted in tolerances."""
        if isinstance(rival, Hit) and not rival.candidate.is_scale:
            return self.of_candidate(rival.candidate)
        return self.beside_chance + LEAST_OF_VALUE - LEAST


def _torques(fitted: Fitted) -> FloatArray:
    """Squared torque of each axis in standard deviations, the mean left out, (n_axis,)."""
    blocks = fitted.problem.blocks
    return _squares(fitted, [block.motion.torque_spectrum for block in blocks], fitted.about.weights)


def _unresolved(fitted: Fitted) -> FloatArray:
    """Likewise, of torques as large as what samples do not resolve of friction, where they count."""
    sizes = []
    for block in fitted.problem.blocks:
        size = np.sqrt(np.abs(np.diagonal(block.unresolved, axis1=1, axis2=2)) * block.share)
        sizes.append(size[..., : block.robot.n_axis].astype(np.complex128))
    return _squares(fitted, sizes, [replace(weight, moving=None) for weight in fitted.about.weights])


def _squares(fitted: Fitted, spectra: Sequence[ComplexArray], weights: Sequence[Weighting]) -> FloatArray:
    """Sum of squares of spectra, N m, (n_config, n_exp, n_bin, n_axis) of each block, likewise."""
    total = np.zeros(fitted.problem.free.robot.n_axis)
    for one, weight in zip(spectra, weights, strict=True):
        for axis in range(len(total)):
            alone = np.zeros_like(one)
            alone[:, :, 1:, axis] = one[:, :, 1:, axis]
            total[axis] += (weight.residual(alone) ** 2).sum()
    return total
