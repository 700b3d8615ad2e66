"""Friction's distortion taken off the measured torque, so that responses need fewer experiments.

On a robot that moves well most of what scatters a response from experiment to experiment is no noise: friction answers
each realisation of the multisine differently. That part follows from the measured speed (`friction_distortion`)
and is removed here; the equivalent damping, part of the response that is looked for, stays.
"""

from __future__ import annotations

import functools

import numpy as np
from pydantic import Field, PositiveInt

from robid_compensation.periods import less, reference_at_lines, spectra, with_channels
from robid_core import AxisKey, Context, FloatArray, Preprocessing, Record, Robot
from robid_core.estimation.distortion.friction import friction_distortion
from robid_core.estimation.distortion.linear_motion import LinearMotion, linear_motion, loop_response
from robid_core.estimation.response.controller import controller_response, feedback_from_acceleration


class FrictionCompensation(Preprocessing):
    """Removes the nonlinear distortion of friction from the torque of a periodic record.

    Per motor a sum of few functions of its speed is fitted, in each configuration, to what of the torque is not
    linear in the motion, mostly at lines that were not excited. Its part that is linear in the speed is put back: the
    best linear approximation, with friction's equivalent damping, stays what it was. Where a law is not
    significant the torque is left alone. Friction of the arm's side, and its memory below the breakaway
    displacement, are not followed and stay in the scatter.

    In a configuration with fewer experiments than axes no response can be measured; there the response of the nominal
    robot is used. A wrong nominal model makes the compensation weaker, not biased.

        smooth: {use: compensate.friction}
    """

    significance: float = Field(default=1e-3, gt=0, lt=1)
    """A law is not used where the p-value of its improvement of the fit is larger than this."""
    realizations: PositiveInt = 80
    """Simulated motions that estimate the law's equivalent damping, as a multiple of the number of axes."""

    def needs_of_axes(self) -> tuple[AxisKey, ...]:
        """The controller: the linear motion is that of the closed loop."""
        return ("controller",)

    def run(self, record: Record, robot: Robot, context: Context) -> Record:
        """Compensate each configuration."""
        record.spectra()  # refuses samples that are missing or no numbers
        reference, run, line = reference_at_lines(record), record.run, np.asarray(record.line, dtype=np.int64)
        torque, position = run.values("motor_torque").copy(), run.values("motor_position")
        n_sample, n_axis = torque.shape[4:]
        deviation = np.zeros((len(torque), len(line), n_axis))
        few = torque.shape[1] * torque.shape[2] < n_axis
        bins_hz = np.arange(line[0], line[-1] + 1) / (n_sample * run.sample_time_s)
        for c in context.track(range(len(torque)), len(torque), "friction"):
            inverse = np.linalg.inv(robot.response(record.angle[c : c + 1], bins_hz)[0]) if few else None
            found = friction_distortion(
                spectra(torque[c]),
                spectra(position[c]),
                reference[c],
                line,
                run.sample_time_s,
                n_sample,
                inverse,
                self.significance,
                record.torque_hold == "zero_order_hold",
                functools.partial(self.linear_motion, record, robot, context, c),
            )
            torque[c] = less(torque[c], found.spectrum, int(line[0]))
            deviation[c] = found.damping_deviation
            for name, law in zip(record.axis_names, found.laws, strict=True):
                context.log.info(
                    "configuration %d: %s: friction explains %.0f %% of what is not linear in the motion; %s",
                    c,
                    name,
                    100 * law.explained,
                    "removed" if law.significance < self.significance else "not significant, left alone",
                )
        if record.damping_deviation is not None:
            deviation = np.hypot(deviation, record.damping_deviation)
        smooth = with_channels(record, "friction's distortion removed", motor_torque=torque)
        return smooth.replace(damping_deviation=deviation)

    def linear_motion(
        self, record: Record, robot: Robot, context: Context, configuration: int, damping: FloatArray
    ) -> LinearMotion:
        """How the nominal robot would move with a damping in place of friction, under these references and others."""
        run, line = record.run, np.asarray(record.line, dtype=np.int64)
        by_speed = "speed_reference" in run.channels
        name = "speed_reference" if by_speed else "position_reference"
        reference = spectra(run.values(name)[configuration])[:, : int(line[-1]) + 1]
        frequency_hz = np.arange(1, reference.shape[1]) / (run.sample_time_s * len(run.time_s))
        angle = record.angle[configuration : configuration + 1]
        response = robot.response(angle, frequency_hz, (robot.drives.viscous + damping)[None])[0]
        controller = controller_response(robot.drives, robot.sample_time_s, frequency_hz)
        drive = controller.from_speed_alone if by_speed else controller.from_position
        feedback = feedback_from_acceleration(controller, frequency_hz)
        loop = loop_response(response, drive, feedback, frequency_hz)
        count = self.realizations * record.angle.shape[1]
        return linear_motion(loop, reference, line, count, context.generator)
