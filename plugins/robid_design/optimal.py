"""Configurations for the next robot of the type, chosen by optimal design (thesis section 4.3).

Random candidates, their information matrices (4.4) with the covariance (4.8), convex weights (4.5), whole
numbers of experiments, and the certificate that no other weights are better.
"""

from __future__ import annotations

from typing import Annotated

import numpy as np
import numpy.typing as npt
from pydantic import Field, PositiveInt

from robid_core import (
    AxisKey,
    ComplexArray,
    Context,
    Design,
    Excitation,
    ExperimentDesign,
    Fit,
    FloatArray,
    Frf,
    NotIdentifiable,
    Robot,
)
from robid_core.estimation.information import covariance_of_parameters
from robid_design.candidates import random_configurations
from robid_design.information import information_matrices, reference_power
from robid_design.room import Room, below_base
from robid_design.weights import (
    Criterion,
    certificate_gap,
    criterion_value,
    optimal_weights,
    whole_experiments,
)


class OptimalDesign(ExperimentDesign):
    """Chooses the configurations that are most informative about the stiffnesses (thesis 4.4, 4.5, 4.8).

    Example::

        choose: {use: design.optimal, with: {criterion: D, candidates: 500, experiments: 8}}
    """

    criterion: Criterion = "D"
    """D: smallest confidence ellipsoid; A: smallest sum of relative variances."""
    candidates: Annotated[int, Field(ge=2, le=100_000)] = 500
    """Random configurations to choose from."""
    experiments: PositiveInt = 8
    """Blocks of experiments to spend."""
    lines: PositiveInt = 40
    """Lines of the excitation that enter the information (evenly thinned)."""
    room: Room | None = None
    """Floor and links that the candidates keep clear of, as in design.candidates; null: none is looked at."""

    def needs_of_axes(self) -> tuple[AxisKey, ...]:
        """Torque limits for the candidates, the controller whose loop the references act on."""
        return ("torque_limit", "controller")

    def run(
        self,
        excitation: Excitation,
        robot: Robot,
        context: Context,
        fit: Fit | None = None,
        frf: Frf | None = None,
    ) -> Design:
        """Weigh the candidates at the fitted parameters, or at the nominal ones without a fit."""
        model = robot if fit is None else robot.fitted(fit)
        angle = random_configurations(robot, self.candidates, context.generator, room=self.room)
        chosen = np.unique(np.linspace(0, len(excitation.line) - 1, self.lines).round().astype(int))
        thinning = len(excitation.line) / len(chosen)
        power = reference_power(excitation)[chosen] * thinning
        frequency = excitation.frequency_hz[chosen]
        noise = _output_covariance(model, frf, excitation, chosen)
        damping = _motor_damping(model, excitation, frf)

        def information_at(poses: FloatArray) -> FloatArray:
            return information_matrices(model, poses, frequency, power, noise, damping)

        parts = []
        for start in context.track(range(0, self.candidates, 50), -(-self.candidates // 50), "information"):
            parts.append(information_at(angle[start : start + 50]))
        information = np.concatenate(parts)
        weight = optimal_weights(information, self.criterion)
        count = whole_experiments(weight, self.experiments)
        total = np.einsum("i,ijk->jk", count.astype(float), information)
        order = np.flatnonzero(count)[np.argsort(-count[count > 0], kind="stable")]
        if (self.room is None or self.room.floor_m is None) and (low := below_base(robot, angle[order])):
            context.log.warning("%s", low)
        share = count / self.experiments
        reached = criterion_value(information, share, self.criterion)
        formal = np.sqrt(np.diag(covariance_of_parameters(total, model.stiffness_names)))
        scale = 1.0
        if fit is not None and frf is not None:
            made = information_at(frf.angle).sum(axis=0) * excitation.reference.shape[1]
            scale = _stated_over_formal(fit, model.stiffness_names, made)
        return Design(
            axis_names=robot.axis_names,
            angle=angle[order],
            criterion=self.criterion,
            parameter_names=model.stiffness_names,
            gap=certificate_gap(information, weight, self.criterion),
            efficiency=reached / criterion_value(information, weight, self.criterion),
            weight=weight[order],
            experiments=count[order],
            candidate_index=order.astype(np.int64),
            information=total,
            predicted_standard_error=formal * scale,
        )


def _stated_over_formal(fit: Fit, names: tuple[str, ...], information: FloatArray) -> float:
    """How much larger the fit's standard errors are than noise alone makes them, geometric mean.

    The formula knows noise only; what the linear model leaves out is in the fit's errors, and will be in the
    next fit's too. The ratio carries it over; of a fit that did not estimate these there is none.
    """
    table = fit.parameters
    if not set(names) <= set(table.names):
        return 1.0
    try:
        formal = np.sqrt(np.diag(covariance_of_parameters(information, names)))
    except NotIdentifiable:
        return 1.0
    rows = [table.names.index(name) for name in names]
    ratio = table.standard_error[rows] / table.estimate[rows] / formal
    ratio = ratio[np.isfinite(ratio)]
    return float(np.exp(np.log(ratio).mean())) if len(ratio) else 1.0


def _output_covariance(
    robot: Robot, frf: Frf | None, excitation: Excitation, chosen: npt.NDArray[np.int64]
) -> ComplexArray:
    """Covariance of acceleration spectra: as measured, or from the encoder's noise, Phi_v = C_v w^2 of (4.8)."""
    frequency = excitation.frequency_hz[chosen]
    if (
        frf is not None
        and frf.output_covariance is not None
        and len(frf.frequency_hz) == len(excitation.line)
    ):
        measured: ComplexArray = frf.output_covariance[:, chosen].mean(axis=0)
        return measured
    d = robot.drives
    quantisation = np.where(
        d.encoder_counts > 0, 2 * np.pi / np.maximum(d.encoder_counts, 1) / np.sqrt(12), 0
    )
    variance = (d.position_noise**2 + quantisation**2 + 1e-16) / excitation.n_sample
    acceleration = (2 * np.pi * frequency[:, None]) ** 4 * variance
    diagonal: ComplexArray = acceleration[:, :, None] * np.eye(robot.n_axis, dtype=complex)
    return diagonal


def _motor_damping(robot: Robot, excitation: Excitation, frf: Frf | None) -> FloatArray:
    """Equivalent damping of friction under the motion that was measured, or only the slow sine's."""
    if frf is not None and frf.speed_rms is not None and frf.slow_sine_speed is not None:
        return robot.equivalent_motor_damping(
            frf.speed_rms.mean(axis=0), frf.slow_sine_speed.mean(axis=0), frf.frequency_hz
        )
    return robot.equivalent_motor_damping(
        np.zeros(robot.n_axis), excitation.slow_sine_speed, excitation.frequency_hz
    )
