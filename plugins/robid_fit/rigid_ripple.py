"""Ripple of motor torques in a rigid fit: waves of known order over the motor's angle are linear in cosine and sine.

The torque that acts is ``u + a sin(order q + phase)`` with u the recorded one (`drive.torque_ripple`, `drive.cogging`),
so that ``u = tau - c cos(order q) - s sin(order q)`` with c = a sin(phase), s = a cos(phase). Samples tell the mean
over their own time: a fast turn weakens a wave.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid_core import ConfigurationError, FloatArray, Robot

LAWS = ("drive.torque_ripple", "drive.cogging")
NUMBERS = ("amplitude", "relative", "order", "phase")


@dataclass(frozen=True)
class Wave:
    """Ripple of one order on one motor, as the robot has it."""

    label: str
    axis: int
    order: float
    parts: tuple[float, float]
    """Of cosine and sine, N m."""

    @property
    def columns(self) -> tuple[str, str]:
        """Names of its columns of the torque."""
        return f"effect.{self.label}.cosine", f"effect.{self.label}.sine"

    def torque(self, position: FloatArray, velocity: FloatArray, sample_time: float) -> FloatArray:
        """Recorded torque per unit of cosine and sine, (n_sample, n_axis, 2), of motor angles and speeds."""
        angle = self.order * position[:, self.axis]
        seen = np.sinc(0.5 * self.order * velocity[:, self.axis] * sample_time / np.pi)
        result = np.zeros((*position.shape, 2))
        result[:, self.axis] = -seen[:, None] * np.stack((np.cos(angle), np.sin(angle)), axis=1)
        return result


def ripples(robot: Robot) -> tuple[Wave, ...]:
    """Return all waves of a robot's motor torques.

    Raises
    ------
    ConfigurationError
        Where one is in proportion to the torque.
    """
    found = []
    for bound in robot.effects:
        label = bound.label
        if robot.description.effects[label].use not in LAWS:
            continue
        told = {name: robot.parameters().get(f"effect.{label}.{name}", 0.0) for name in NUMBERS}
        if told["relative"] != 0.0:
            raise ConfigurationError(
                f"fit.rigid knows ripple of constant size; {label} has a part in proportion to the torque: set its "
                "relative to 0, or fit with fit.torque_residual"
            )
        parts = polar(told["amplitude"], told["phase"])
        found.append(Wave(label, bound.place.axis, told["order"], parts))
    return tuple(found)


def polar(amplitude: float, phase: float) -> tuple[float, float]:
    """Cosine and sine of a wave ``amplitude sin(order q + phase)``."""
    return amplitude * float(np.sin(phase)), amplitude * float(np.cos(phase))


def amplitude_and_phase(parts: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Amplitude and phase of cosine and sine, (2,), and their derivative by these, (2, 2)."""
    cosine, sine = parts
    size = max(float(np.hypot(cosine, sine)), 1e-12)
    values = np.array([np.hypot(cosine, sine), np.arctan2(cosine, sine)])
    slopes = np.array([[cosine / size, sine / size], [sine / size**2, -cosine / size**2]])
    return values, slopes
