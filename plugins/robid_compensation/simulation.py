"""What the robot's own nonlinear mechanics scatters, computed with the model and taken off the record.

While the slow sine carries the arm to and fro its inertia changes, and with it the resonances: each line leaks into
the lines at a distance of the sine's frequency, differently in each experiment. This is deterministic: a simulation of
the model under the recorded references shows it, the model's own response to the reference is taken away, and what
is left is subtracted from the record (a control variate: its mean over random phases is zero). So a wrong model leaves
more scatter, and no bias towards the model.
"""

from __future__ import annotations

import numpy as np
from pydantic import PositiveInt

from robid_compensation.periods import all_experiments, less, reference_at_lines, spectra, with_channels
from robid_core import (
    AxisKey,
    ComplexArray,
    Context,
    Fit,
    FloatArray,
    IntArray,
    Preprocessing,
    Record,
    Robot,
    mean_travel,
    simulate_over,
)
from robid_core.estimation.distortion.linear_motion import random_phases
from robid_core.estimation.response.spectra import response_from_spectra


def other_realisations(
    reference: FloatArray, line: IntArray, count: int, generator: np.random.Generator
) -> FloatArray:
    """References with the amplitudes of measured ones and random phases at every bin up to the highest line.

    Takes and returns (n_exp, n_sample, n_axis); `count` experiments, each drawn after one of the given ones.
    """
    n_sample, n_bin = reference.shape[1], int(line[-1]) + 1
    drawn = random_phases(np.fft.rfft(reference, axis=1)[:, :n_bin], count, generator)
    result: FloatArray = np.fft.irfft(drawn, n=n_sample, axis=1)
    return result


def simulated_period(
    robot: Robot, reference: FloatArray, middle: FloatArray, context: Context
) -> tuple[ComplexArray, ComplexArray]:
    """Spectra of torque and position in the second of two periods, without noise, scaled by 1/n_sample.

    Takes references (n_exp, n_sample, n_axis) and the motor angles that the motion goes about, (n_exp, n_axis).
    """
    start = robot.joint_angle(middle - mean_travel(reference, robot.sample_time_s))
    result = simulate_over(context.map, robot, reference, start, n_period=2, n_kept=1)
    torque, position = (
        np.fft.rfft(signal.reshape(reference.shape), axis=1) / reference.shape[1]
        for signal in (result.torque, result.position)
    )
    return torque, position


def at_lines(signal: FloatArray, line: IntArray) -> ComplexArray:
    """Spectra at the lines, experiments last, (n_freq, n_axis, n_exp), of samples (n_exp, n_sample, n_axis)."""
    spectrum: ComplexArray = np.fft.rfft(signal, axis=1)[:, line] / signal.shape[1]
    return spectrum.transpose(1, 2, 0)


def not_linear(
    signal: ComplexArray, own: ComplexArray, drawn: ComplexArray, others: ComplexArray, line: IntArray
) -> ComplexArray:
    """Part of simulated signals that is not linear in the reference, at all bins from the lowest to the highest line.

    Parameters
    ----------
    signal
        Spectra under the measurement's references, all bins, shape (n_exp, n_bin, n_axis).
    own
        These references at the lines, shape (n_exp, n_freq, n_axis).
    drawn, others
        Signals under other references, all bins, (n_drawn, n_bin, n_axis), and those, (n_freq, n_axis, n_drawn): they
        tell the response to the reference.
    """
    response = response_from_spectra(others, drawn[:, line].transpose(1, 2, 0))
    rest = signal[:, int(line[0]) : int(line[-1]) + 1].copy()
    rest[:, line - line[0]] -= (response @ own[..., None])[..., 0]
    return rest


def agreement(
    measured: ComplexArray, simulated: ComplexArray, reference: ComplexArray, line: IntArray
) -> float:
    """Share of the simulated distortion that the measurement shows, 0 to 1.

    The coefficient of a control variate that leaves least: ``Re sum S* M / sum |S|^2`` over bins, M the measured and S
    the simulated distortion. M is what was measured at lines that were not excited and, with more experiments than
    axes, what no response to the reference explains at those that were. (One share for the band: near the lower end
    all odd bins are excited, and the even ones between show another, smaller part of the distortion.)

    Parameters
    ----------
    measured, simulated
        Spectra from the lowest to the highest line, each signal in a unit in which all count alike, shape (n_exp,
        n_bin, n_signal).
    reference
        At the lines, shape (n_exp, n_freq, n_axis).
    line
        Excited bins, shape (n_freq,).
    """
    at = line - line[0]
    m, s = measured.copy(), simulated.copy()
    r = reference.transpose(1, 0, 2)  # (n_freq, n_exp, n_axis)
    for signal in (m, s):
        own = signal[:, at].transpose(1, 0, 2)
        signal[:, at] = (own - r @ (np.linalg.pinv(r) @ own)).transpose(1, 0, 2)
    if reference.shape[0] <= reference.shape[2]:
        m[:, at] = s[:, at] = 0.0  # a response explains anything
    power = float(np.sum(np.abs(s) ** 2))
    return float(np.clip(np.sum((m * s.conj()).real) / power, 0.0, 1.0)) if power > 0 else 0.0


class SimulationCompensation(Preprocessing):
    """Removes from a record the nonlinear response to the reference that a simulation of the model predicts.

    The model is the nominal robot, or with a fit the fitted one; its friction is replaced by the equivalent damping
    under the measured motion, as `compensate.friction` removes what friction distorts better than a model can:
    run that first. Each configuration is simulated with its own references and with others of the same amplitudes and
    random phases, from which the model's response to the reference is estimated. As much is taken off as the lines
    that were not excited confirm: a model that is far off does no harm. Stated regions do not contain the remaining
    bias towards the model.

        smooth: {use: compensate.friction}
        still:  {use: compensate.simulation, inputs: {record: smooth}}
        frf:    {use: frf.h1, inputs: {record: still}}
    """

    realizations: PositiveInt = 24
    """Number of drawn references from which the model's response is estimated, as a multiple of the axes. Its own
    error is in no residual; with six times as many as were measured it adds a sixth of what is removed."""

    def needs_of_axes(self) -> tuple[AxisKey, ...]:
        """All that a simulated closed loop takes."""
        return ("torque_limit", "controller")

    def run(self, record: Record, robot: Robot, context: Context, fit: Fit | None = None) -> Record:
        """Compensate each configuration."""
        record.spectra()  # refuses samples that are missing or no numbers
        own, run, line = reference_at_lines(record), record.run, np.asarray(record.line, dtype=np.int64)
        model = robot if fit is None else robot.fitted(fit)
        torque, position = run.values("motor_torque").copy(), run.values("motor_position").copy()
        references = run.values("speed_reference")
        damping = model.equivalent_motor_damping(*record.speed_levels(), record.frequency_hz)
        for c in context.track(range(len(torque)), len(torque), "simulated mechanics"):
            plant = model.without_friction(damping[c])
            asked, middle = all_experiments(references[c]), all_experiments(position[c]).mean(axis=1)
            number = self.realizations * robot.n_axis
            drawn = other_realisations(asked, line, number, context.generator)
            own_signals = simulated_period(plant, asked, middle, context)
            about = np.tile(robot.motor_angle(record.angle[c]), (number, 1))
            drawn_signals = simulated_period(plant, drawn, about, context)
            rest = [
                not_linear(signal, own[c], other, at_lines(drawn, line), line)
                for signal, other in zip(own_signals, drawn_signals, strict=True)
            ]
            share = confirmed([spectra(torque[c]), spectra(position[c])], rest, own[c], line)
            context.log.info(
                "configuration %d: %.0f %% of the simulated distortion are confirmed, and taken off",
                c,
                100 * share,
            )
            torque[c] = less(torque[c], share * rest[0], int(line[0]))
            position[c] = less(position[c], share * rest[1], int(line[0]))
        words = "simulated distortion of the mechanics removed"
        still = with_channels(record, words, motor_torque=torque, motor_position=position)
        return still.replace(model_based=True)


def confirmed(
    measured: list[ComplexArray], simulated: list[ComplexArray], reference: ComplexArray, line: IntArray
) -> float:
    """`agreement` of torques and positions together, each scaled to the power that is simulated of it."""
    inside = slice(int(line[0]), int(line[-1]) + 1)
    omega = np.arange(line[0], line[-1] + 1)[:, None].astype(np.float64)
    weight = [np.ones_like(omega), omega**2]  # torque and acceleration are about white, the position is not
    scaled_m, scaled_s = [], []
    for m, s, w in zip(measured, simulated, weight, strict=True):
        size = np.sqrt(np.mean(np.abs(s * w) ** 2, axis=(0, 1)))
        scale = w / np.where(size > 0, size, 1.0)
        scaled_m.append(m[:, inside] * scale)
        scaled_s.append(s * scale)
    return agreement(np.concatenate(scaled_m, axis=-1), np.concatenate(scaled_s, axis=-1), reference, line)
