"""Local rational method, thesis eq. (3.23)-(3.33): a rational function through the lines around each line.

One experiment per configuration is enough, because neighbouring lines take the place of further experiments (McKelvey
and Guerin 2012; parametrisations of Voorhoeve, van der Maas and Oomen 2018). The denominator follows
resonances that a polynomial over the same window misses. A full matrix fraction is exact for any plant whose
order does not exceed what fits into it, such as coupled masses: ``D = K + i w C - w^2 M``.
"""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from pydantic import NonNegativeInt

from robid_core import ComplexArray, ConfigurationError, Context, Frf, Record, Robot
from robid_core.estimation.response.local.model import LocalModel
from robid_core.estimation.response.local.prior import pole_frequencies
from robid_core.residual import leading_periods
from robid_frf.local import LocalMethod


def nominal_poles(record: Record, robot: Robot, discard: int) -> list[ComplexArray]:
    """Complex frequencies in Hz of the nominal robot's poles in each configuration, friction as the motion had it."""
    if record.axis_names != robot.axis_names:
        raise ConfigurationError(
            f"prior_poles: the record speaks of {', '.join(record.axis_names)} and the robot of "
            f"{', '.join(robot.axis_names)}; give the robot that was measured"
        )
    damping = robot.equivalent_motor_damping(*record.speed_levels(discard), record.frequency_hz)
    return [
        pole_frequencies(np.linalg.eigvals(robot.linearize(angle, motor_damping=own).a).astype(np.complex128))
        for angle, own in zip(record.angle, damping, strict=True)
    ]


class LocalRational(LocalMethod):
    """Response read from a rational function fitted to the lines around each line; one experiment is enough.

    The full matrix fraction (`mimo`) has most unknowns and the least model error: with 6 axes and second order 30 per
    output, 42 in the joint approach, so that one experiment needs a window of as many lines. The covariance is that
    of the estimator about its own mean; the bias of the linearised equations and of
    the local model is not in it.

        frf: {use: frf.lrm, with: {parametrization: mimo, approach: direct, window_lines: 41}}
    """

    parametrization: Literal["scalar", "miso", "mimo"] = "mimo"
    """Denominator: `scalar` one for the whole matrix, `miso` one for each output, `mimo` a full matrix."""
    denominator_order: NonNegativeInt = 2
    """Order of the denominator's polynomials."""
    iterations: NonNegativeInt = 0
    """Passes at most that weigh the linearised equations by the denominator before (Sanathanan and Koerner); a line
    keeps the one of least output error."""
    prior_poles: bool = False
    """Make the denominators of the nominal robot's poles and fit the numerators alone; direct approach only."""

    def run(self, record: Record, robot: Robot, context: Context) -> Frf:
        """Estimate the response of each configuration."""
        model = LocalModel(
            self.parametrization, self.numerator_order, self.denominator_order, self.transient_order
        )
        poles = (
            nominal_poles(record, robot, leading_periods((record,), self.discard))
            if self.prior_poles
            else None
        )

        def options(configuration: int) -> dict[str, Any]:
            return {
                "iterations": self.iterations,
                "poles_hz": None if poles is None else poles[configuration],
            }

        how = "prior poles" if self.prior_poles else self.parametrization
        return self.estimate(record, context, f"LRM ({how}, {self.approach})", model, options)
