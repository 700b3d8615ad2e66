"""What the slow sine and ripples of the motor angle put on the lines, in words for the plan and for the log.

The plan knows the settings only: harmonics of the sine, and the band n A / (2 pi) of each ripple order. The run knows
the nominal robot too: orders of its effects, and how the multisine's motion spreads a ripple (estimation `reach`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robid_core import FloatArray, IntArray, Robot, SignalEffect
from robid_core.estimation.excitation.reach import (
    harmonics_on_lines,
    lines_reached,
    ripple_band_hz,
    ripple_level,
)


@dataclass(frozen=True)
class Reach:
    """Frequency range that torque ripple of one order of one axis covers."""

    axis: str
    order: float
    band_hz: float
    """Up to here under the slow sine alone."""
    line: IntArray
    """Lines at which it is above the level that was asked about."""
    strongest: float
    """Largest amplitude at a line, relative to the ripple's own."""

    def words(self, level: float, period_s: float) -> str:
        """Return one sentence."""
        start = f"{self.axis}: ripple of order {self.order:g} fills 0 to {self.band_hz:.3g} Hz"
        if not len(self.line):
            return f"{start}, no line above {level:g} of its amplitude"
        low, high = self.line[[0, -1]] / period_s
        return (
            f"{start}; more than {level:g} of its amplitude on {len(self.line)} of the lines from {low:.4g} to "
            f"{high:.4g} Hz, {self.strongest:.2g} on the strongest"
        )


def ripple_orders(robot: Robot, suspects: Sequence[float]) -> list[tuple[int, float]]:
    """(axis, order) of the nominal robot's ripples, and of the suspects on every axis; in order, none twice.

    A ripple is any effect on a signal that has a parameter `order` per turn of the motor, a stranger's too.
    """
    found = {(axis, float(order)) for axis in range(robot.n_axis) for order in suspects}
    for bound in robot.effects:
        if not issubclass(bound.effect, SignalEffect):
            continue
        for row, value in zip(bound.effect.parameters, bound.parameters, strict=True):
            if row.name == "order" and row.unit == "1/turn":
                found.add((bound.place.axis, float(value)))
    return sorted(found)


def reaches(
    robot: Robot,
    suspects: Sequence[float],
    line: IntArray,
    angle: FloatArray,
    sine_bin: int,
    sine_speed: FloatArray,
    n_sample: int,
    level: float,
) -> list[Reach]:
    """Return the reach of every ripple order on every axis.

    Parameters
    ----------
    robot, suspects
        As in `ripple_orders`.
    line, angle
        Excited bins, and amplitudes of the motors' angles there, rad, shapes (n_freq,) and (n_freq, n_axis).
    sine_bin, sine_speed
        Of the slow sine (0: none), rad/s, shape (n_axis,).
    n_sample
        Samples in the period.
    level
        Amplitude relative to the ripple's own above which a line counts as reached.
    """
    period_s = n_sample * robot.sample_time_s
    sine_angle = sine_speed * period_s / (2 * np.pi * sine_bin) if sine_bin else np.zeros(robot.n_axis)
    found = []
    for axis, order in ripple_orders(robot, suspects):
        amplitude = ripple_level(order, sine_bin, float(sine_angle[axis]), line, angle[:, axis], n_sample)
        band = ripple_band_hz(order, float(sine_speed[axis])) if sine_bin else 0.0
        reached = lines_reached(line, amplitude, level)
        found.append(Reach(robot.axis_names[axis], order, band, reached, float(amplitude[line].max())))
    return found


def planned_reach(
    line: IntArray, period_s: float, sine_bin: int, sine_speed: float, orders: Sequence[float]
) -> list[str]:
    """Say which lines the slow sine's harmonics and each ripple order can reach, from the settings alone."""
    if not sine_bin:
        return []
    on_lines = harmonics_on_lines(line, sine_bin)
    words = "fall on even bins, where no line stands"
    if sine_bin % 2:
        words = "fall on even bins and on odd ones that are left out of the lines"
    if len(on_lines):
        words = f"fall on {len(on_lines)} lines from {on_lines[0] / period_s:.4g} Hz"
    told = [f"harmonics of the slow sine {words}"]
    parts = []
    for order in orders:
        band = ripple_band_hz(order, sine_speed)
        n_line = int(np.count_nonzero(line <= band * period_s))
        parts.append(f"order {order:g} to {band:.3g} Hz ({n_line or 'no'} line{'s' if n_line != 1 else ''})")
    if parts:
        told.append(f"ripple spread by the multisine can reach: {', '.join(parts)}")
    return told
