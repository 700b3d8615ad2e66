"""Indirect estimator: the closed loop first, then the known controller taken out (thesis section 3.2.2).

With ``u = d - F y`` (`estimation.response.controller`; d is the torque that the references ask for, F the
feedback) the closed loop is ``y = T d``, ``T = G (I + F G)^-1``, an open-loop problem, and ``G = T (I - F T)^-1``.
With ``T = Y D^H (D D^H)^-1`` this is the joint input-output estimator with ``D - F Y`` in the place of the measured
torque, and its uncertainty follows likewise. Noise of the torque measurement has no part in it; in return gains
that are wrong by a factor make the response wrong by the same factor, however long one measures, and a torque limit
that was met makes it wrong too. The stated regions are about the estimator's own mean for that reason.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from robid_core import AxisKey, ComplexArray, Context, DataRejected, Frf, Record, Robot
from robid_core.estimation.response.controller import (
    controller_response,
    drive_signal,
    feedback_from_acceleration,
)
from robid_core.estimation.response.spectra import factor_inputs, side_by_side
from robid_frf.averaging import Averaging
from robid_frf.joint import joint_estimate
from robid_frf.reading import channel_spectra

DISAGREEMENT = 0.05  # of the measured torque: above it somebody should look at the gains


def tell_torque(
    record: Record, context: Context, reference: ComplexArray, measured: ComplexArray, asked: ComplexArray
) -> None:
    """Warn where the controller asks for another torque than was measured, as far as the reference causes both.

    All of shape (n_config, n_block, n_freq, n_axis, n_exp).
    """
    r, u, v = (side_by_side(x) for x in (reference, measured, asked - measured))
    project = factor_inputs(r).inverse @ r
    wrong, size = (np.sqrt(np.nanmean(np.abs(x @ project) ** 2, axis=(0, 1, 3))) for x in (v, u))
    for name, share in zip(record.axis_names, wrong / np.where(size > 0, size, 1.0), strict=True):
        if share > DISAGREEMENT:
            context.log.warning(
                "%s: the torque that the nominal controller asks for differs from the measured one by %.0f %%; "
                "compare speed_gain, integral_gain and position_gain with the drive's, and look for a torque limit",
                name,
                100 * share,
            )


class Indirect(Averaging):
    """Response from the reference and the motion alone, with the controller of the nominal robot.

    The record needs a channel speed_reference; position_reference is used where there is one. The log warns where
    the torque that the controller must have asked for is not the measured one.

        frf: {use: frf.indirect}
    """

    def needs_of_axes(self) -> tuple[AxisKey, ...]:
        """The controller that is taken out."""
        return ("controller",)

    def run(self, record: Record, robot: Robot, context: Context) -> Frf:
        """Estimate the response of each configuration."""
        if record.axis_names != robot.axis_names:
            raise DataRejected(
                f"the record is of the axes {', '.join(record.axis_names)}, the robot whose controller is to be taken "
                f"out has {', '.join(robot.axis_names)}"
            )
        spectra = self.read(record, context)
        controller = controller_response(robot.drives, record.run.sample_time_s, record.frequency_hz)
        feedback = feedback_from_acceleration(controller, record.frequency_hz)
        position = None
        if "position_reference" in record.run.channels and (robot.drives.position_gain > 0).any():
            position = channel_spectra(record, "position_reference", spectra)
        speed = channel_spectra(record, "speed_reference", spectra)
        drive = drive_signal(controller, speed, position)
        asked = drive[..., None] - feedback[:, :, None, None] * spectra.y_by_period
        tell_torque(record, context, drive, spectra.block_u, asked.mean(axis=-1))
        known = replace(spectra, u_by_period=asked, reference=drive)
        estimate = joint_estimate("indirect", known, self.condition_limit)
        return self.finish(record, context, known, replace(estimate, covers=Frf.OWN_MEAN))
