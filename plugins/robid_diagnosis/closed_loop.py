"""The identified robot in simulated closed loop against its recording.

Torque errors of an inverse model forgive what a controller would have corrected; a simulation with the recorded
reference and the drive's own cascade does not. Simulated against measured, position and torque, for the fitted
parameters and for those of the robot file, so that the gain of the fit is a number.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
from pydantic import NonNegativeFloat

from robid_core import (
    Context,
    DataRejected,
    Diagnosis,
    DiagnosisStage,
    Fit,
    FloatArray,
    NotTrustworthy,
    Record,
    Robot,
    TimeComparison,
    simulate_record,
)

METHOD = "closed-loop simulation"


def relative_error(measured: FloatArray, modelled: FloatArray) -> float:
    """|measured - modelled| / |measured| over all samples and axes; infinite where nothing was measured."""
    norm = float(np.linalg.norm(measured))
    return float(np.linalg.norm(measured - modelled)) / norm if norm > 0 else float("inf")


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


def compared(record: Record, channel: str, skip_s: float) -> FloatArray:
    """A channel of every experiment from `skip_s` on, one after another, shape (n_sample, n_axis)."""
    parts: list[FloatArray] = []
    for run in record.runs:
        first, lanes = round(skip_s / run.sample_time_s), run.lanes(channel)
        if first >= lanes.shape[1]:
            raise DataRejected(f"diagnosis.closed_loop: an experiment is shorter than skip_s = {skip_s:g} s")
        parts.append(lanes[:, first:].reshape(-1, lanes.shape[-1]))
    return np.concatenate(parts)


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
    """Simulates the identified robot under the recorded reference and compares it with the record.

    The controller is the robot file's: speed = position_gain (q_ref - q) + feedforward v_ref, torque = speed_gain
    (speed - v) + integral, limited.

        simulate:
          use: diagnosis.closed_loop
          with: {skip_s: 0.5}
    """

    start: Literal["rest", "motion"] = "rest"
    """How each experiment begins: at rest, or under way (a periodic record: in steady motion)."""
    skip_s: NonNegativeFloat = 0.0
    """Time at the start of each experiment that is simulated and not compared: what is behind the motors of a recording
    that begins under way is not known, and has to ring out."""

    def run(
        self,
        record: Record,
        fit: Fit,
        robot: Robot,
        context: Context,
        explained: tuple[Diagnosis, ...] = (),
    ) -> Diagnosis:
        """Simulate twice, the fitted robot and the robot file, and compare.

        Of diagnoses before it the last that extended the robot gives the one that is simulated in the fit's place.
        Nothing is simulated, and the verdict says so, where the robot file tells no controller or torque limit.
        """
        missing = robot.left_out(("torque_limit", "controller"))
        if missing:
            return Diagnosis(method=METHOD, verdict=f"The closed loop was not simulated: {missing}.")
        model, left_out = identified(robot, fit), fit.model.left_out if fit.model is not None else ()
        for found in (one.model for one in explained if one.model is not None):
            model, left_out = Robot.of_model(found), ()
        measured = {name: compared(record, name, self.skip_s) for name in ("motor_position", "motor_torque")}
        context.progress(0, 2, "simulating the identified robot")
        fitted = simulate_record(model, record, self.start)
        context.progress(1, 2, "simulating the robot file's parameters")
        nominal = simulate_record(robot, record, self.start)
        context.progress(2, 2)
        comparisons, before = [], []
        for name, values in measured.items():
            modelled, start = (compared(r, name, self.skip_s) for r in (fitted, nominal))
            comparisons.append(
                TimeComparison(
                    axis_names=record.axis_names,
                    channel=name,
                    unit_symbol=record.runs[0].channel(name).unit_symbol,
                    relative_error=relative_error(values, modelled),
                    time_s=instants(record, self.skip_s),
                    measured=values,
                    modelled=modelled,
                )
            )
            before.append(relative_error(values, start))
        verdict = sentence(comparisons, before, left_out)
        return Diagnosis(method=METHOD, verdict=verdict, time=tuple(comparisons))
