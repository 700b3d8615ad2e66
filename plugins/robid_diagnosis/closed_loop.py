"""The identified robot in simulated closed loop against its recording.

Torque errors of an inverse model forgive what a controller would have corrected; a simulation with the recorded
reference and the drive's own cascade does not. Simulated against measured, position and torque, for the fitted
parameters and for those of the robot file, so that the gain of the fit is a number.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from pydantic import NonNegativeFloat

from robid_core import (
    ConfigurationError,
    Context,
    DataRejected,
    DenseRun,
    Diagnosis,
    DiagnosisStage,
    Fit,
    FloatArray,
    NotTrustworthy,
    Record,
    Robot,
    TimeComparison,
)


@dataclass(frozen=True)
class Recorded:
    """One recorded run as lanes of the simulator, each (n_lane, n_sample, n_axis), motor side."""

    position: FloatArray
    torque: FloatArray
    speed_reference: FloatArray
    position_reference: FloatArray | None


def lanes(run: DenseRun) -> Recorded:
    """Return every experiment of a run as a lane, its periods joined.

    Where only a position reference was recorded, the speed reference is its derivative.

    Raises
    ------
    DataRejected
        If there is no reference, or a sample is missing.
    """
    if not run.valid.all():
        raise DataRejected(
            "diagnosis.closed_loop: samples are missing; a simulation needs the whole reference"
        )

    def joined(name: str) -> FloatArray:
        values = run.values(name)
        if not np.isfinite(values).all():
            raise DataRejected(
                f"diagnosis.closed_loop: {name} was not recorded on every axis; all are needed"
            )
        n_config, n_block, n_exp, n_period, n_sample, n_axis = values.shape
        return values.reshape(n_config * n_block * n_exp, n_period * n_sample, n_axis)

    position_reference = joined("position_reference") if "position_reference" in run.channels else None
    if "speed_reference" in run.channels:
        speed_reference = joined("speed_reference")
    elif position_reference is not None:
        speed_reference = np.gradient(position_reference, run.sample_time_s, axis=1)
    else:
        raise DataRejected(
            "diagnosis.closed_loop: the record has neither position_reference nor speed_reference; map the channel "
            "that the controller followed"
        )
    return Recorded(joined("motor_position"), joined("motor_torque"), speed_reference, position_reference)


def relative_error(measured: FloatArray, modelled: FloatArray) -> float:
    """|measured - modelled| / |measured| over all samples and axes; infinite where nothing was measured."""
    norm = float(np.linalg.norm(measured))
    return float(np.linalg.norm(measured - modelled)) / norm if norm > 0 else float("inf")


def simulate_lanes(robot: Robot, recorded: Recorded) -> tuple[FloatArray, FloatArray]:
    """Position and torque of the robot under the recorded reference, from rest at the first recorded position.

    Each (n_lane, n_sample, n_axis), without sensor noise.
    """
    result = robot.simulate(
        recorded.speed_reference,
        robot.joint_angle(recorded.position[:, 0]),
        position_reference=recorded.position_reference,
    )
    return result.position, result.torque


def identified(robot: Robot, fit: Fit) -> Robot:
    """Return the robot as it was fitted.

    Raises
    ------
    NotTrustworthy
        If the fit did not converge.
    ConfigurationError
        If it is a fit of another robot, or disagrees with what this one has from another fit.
    """
    if not fit.converged:
        raise NotTrustworthy(f"diagnosis.closed_loop: the fit must not be used: {fit.status}")
    return robot.fitted(fit)


def collected(
    record: Record, skip_s: float, source: Callable[[Recorded], tuple[FloatArray, FloatArray]]
) -> tuple[FloatArray, FloatArray]:
    """Position and torque that `source` gives for every lane of every run, one after another, (n_sample, n_axis)."""
    position: list[FloatArray] = []
    torque: list[FloatArray] = []
    for run in record.runs:
        first = round(skip_s / run.sample_time_s)
        pair = source(lanes(run))
        if first >= pair[0].shape[1]:
            raise DataRejected(f"diagnosis.closed_loop: an experiment is shorter than skip_s = {skip_s:g} s")
        for values, collection in zip(pair, (position, torque), strict=True):
            collection.append(values[:, first:].reshape(-1, values.shape[2]))
    return np.concatenate(position), np.concatenate(torque)


def instants(record: Record, skip_s: float) -> FloatArray:
    """Time of every compared sample, the experiments laid end to end, s, shape (n_sample,)."""
    times, elapsed = [], 0.0
    for run in record.runs:
        first = round(skip_s / run.sample_time_s)
        n_sample = run.n_period * len(run.time_s)
        for _ in range(run.valid[..., 0, 0].size):
            times.append(elapsed + np.arange(first, n_sample) * run.sample_time_s)
            elapsed += n_sample * run.sample_time_s
    return np.concatenate(times)


def with_prefix(value: float, unit: str) -> str:
    """Write a length or an angle that is small with the prefix that fits: `2.2 µm`."""
    if unit not in ("m", "rad") or not 0 < value < 1:
        return f"{value:.3g} {unit}"
    factor, prefix = (1e3, "m") if value >= 1e-3 else (1e6, "µ") if value >= 1e-6 else (1e9, "n")
    return f"{value * factor:.3g} {prefix}{unit}"


def sentence(comparisons: Sequence[TimeComparison], before: Sequence[float], left_out: Sequence[str]) -> str:
    """Say in words how far simulation and recording are apart, where most, and what the fit gained.

    `before` holds the relative errors with the robot file's parameters, `left_out` the fitted parameters that were
    not simulated.
    """
    parts = []
    for comparison, start in zip(comparisons, before, strict=True):
        error = comparison.measured - comparison.modelled
        n, a = np.unravel_index(int(np.abs(error).argmax()), error.shape)
        unit = comparison.unit_symbol
        noun = comparison.channel.replace("_", " ").replace("torque", "force" if unit == "N" else "torque")
        parts.append(
            f"{noun} within {100 * comparison.relative_error:.3g} % "
            f"({with_prefix(float(np.sqrt((error**2).mean())), unit)} rms; {100 * start:.3g} % with the robot file's "
            f"parameters; at most {with_prefix(float(abs(error[n, a])), unit)}, on {comparison.axis_names[a]} at "
            f"{comparison.time_s[n]:.3g} s)"
        )
    told = " and ".join(parts)
    text = f"Simulated in closed loop with the identified parameters, the robot repeats the recorded {told}."
    if left_out:
        text += (
            f" Fitted but not simulated, because the robot file has no place for them: {', '.join(left_out)}."
        )
    return text


class ClosedLoopSimulation(DiagnosisStage):
    """Simulates the identified robot under the recorded reference and compares.

    The controller is the robot file's: speed = position_gain (q_ref - q) + feedforward v_ref, torque = speed_gain
    (speed - v) + integral, limited.

        simulate:
          use: diagnosis.closed_loop
          with: {skip_s: 0.5}
    """

    skip_s: NonNegativeFloat = 0.0
    """Time at the start of each experiment that is simulated and not compared (recordings that begin in motion)."""

    def run(self, record: Record, fit: Fit, robot: Robot, context: Context) -> Diagnosis:
        """Simulate twice, with fitted and with nominal parameters, and compare."""
        for run in record.runs:
            if abs(run.sample_time_s / robot.sample_time_s - 1) > 1e-3:
                raise ConfigurationError(
                    f"diagnosis.closed_loop: the record is sampled every {run.sample_time_s:g} s and the drives "
                    f"control every {robot.sample_time_s:g} s; set sample_time_s in the robot file"
                )
        model, left_out = identified(robot, fit), fit.model.left_out if fit.model is not None else ()
        measured = collected(record, self.skip_s, lambda recorded: (recorded.position, recorded.torque))
        context.progress(0, 2, "simulating the identified robot")
        fitted = collected(record, self.skip_s, partial(simulate_lanes, model))
        context.progress(1, 2, "simulating the robot file's parameters")
        nominal = collected(record, self.skip_s, partial(simulate_lanes, robot))
        context.progress(2, 2)
        comparisons = tuple(
            TimeComparison(
                axis_names=record.axis_names,
                channel=name,
                unit_symbol=record.runs[0].channel(name).unit_symbol,
                relative_error=relative_error(measured[i], fitted[i]),
                time_s=instants(record, self.skip_s),
                measured=measured[i],
                modelled=fitted[i],
            )
            for i, name in enumerate(("motor_position", "motor_torque"))
        )
        before = [relative_error(measured[i], nominal[i]) for i in range(len(comparisons))]
        return Diagnosis(
            method="closed-loop simulation", verdict=sentence(comparisons, before, left_out), time=comparisons
        )
