"""Ripple of torque and resolver found in a record and taken off it, before anything is estimated.

Ripple is an input nonlinearity (thesis section 3.1.3, figure 3.2): between the measured current and the torque that
acts, between the motor's angle and what the resolver says of it. It sits at fixed orders of the motor's angle, where
order analysis finds it in the torque that is not linear in the motion (`torque_residual`, `order_analysis` and
`ripple_search` of `robid_core.estimation`). It belongs to the machine, so that all configurations together show it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, Self

import numpy as np
from pydantic import Field, NonNegativeInt, PositiveFloat, model_validator

from robid_compensation.passages import passages_by_configuration
from robid_core import (
    Channel,
    ConfigurationError,
    Context,
    IntArray,
    Preprocessing,
    Record,
    Robot,
    frozen,
)
from robid_core.estimation.distortion.angle_orders import find_orders
from robid_core.estimation.distortion.angle_passage import Passage
from robid_core.estimation.distortion.order_analysis import (
    KINDS,
    Kind,
    MotorData,
    Wave,
    compensated,
    motors_of,
)
from robid_core.estimation.distortion.ripple_search import Found, find_ripple
from robid_core.residual import leading_periods

TORQUE, POSITION = "motor_torque", "motor_position"
HELD = "zero_order_hold"
UNIT = {"cogging": "N m", "current": "of the torque", "resolver": "rad"}


@dataclass(frozen=True)
class AxisRipple:
    """Ripple of one axis in the configurations that share it."""

    axis: int
    configurations: tuple[int, ...]
    turns: float
    """Largest travel of the motor within a configuration."""
    found: Found


def analysis_bins(record: Record, band_hz: tuple[float, float] | None) -> IntArray:
    """Bins from the lowest to the highest excited line, or within a band.

    The record has excited lines.
    """
    assert record.line is not None
    period_s = record.run.sample_time_s * len(record.run.time_s)
    low, high = (
        (int(record.line.min()), int(record.line.max()))
        if band_hz is None
        else (math.ceil(band_hz[0] * period_s), math.floor(band_hz[1] * period_s))
    )
    return np.arange(max(low, 1), min(high, (len(record.run.time_s) - 1) // 2) + 1, dtype=np.int64)


def motors_by_configuration(
    record: Record, band_hz: tuple[float, float] | None = None, discard: int = 0
) -> list[list[MotorData]]:
    """Motors of each configuration, ready for order analysis."""
    bins = analysis_bins(record, band_hz)
    for channel in (TORQUE, POSITION):
        record.period_spectra(channel, discard, bins[:1])  # refuses what is missing or not a number
    run, line = record.run, np.asarray(record.line, dtype=np.int64)
    result = []
    for angle, torque in zip(run.values(POSITION), run.values(TORQUE), strict=True):
        q, u = (x[:, :, discard:].reshape(-1, *x[:, :, discard:].shape[2:]) for x in (angle, torque))
        result.append(motors_of(q, u, line, bins, run.sample_time_s, record.torque_hold == HELD))
    return result


def drift_in_turns(record: Record, discard: int = 0) -> float:
    """Largest distance that a motor drifts from the first period to the last, turns."""
    angle = record.run.values(POSITION)[:, :, :, discard:].mean(axis=4)
    return float(np.ptp(angle, axis=3).max()) / (2 * np.pi)


def without_ripple(record: Record, ripple: Sequence[AxisRipple]) -> Record:
    """Record with the ripple taken off motor torque and motor angle; the same record where there is none."""
    if not any(entry.found.ripple for entry in ripple):
        return record
    run, held = record.run, record.torque_hold == HELD
    angle, torque = run.values(POSITION).copy(), run.values(TORQUE).copy()
    words = []
    for entry in ripple:
        waves = [(one.wave, one.cosine, one.sine) for one in entry.found.ripple]
        for c in entry.configurations if waves else ():
            place = c, ..., entry.axis
            angle[place], torque[place] = compensated(angle[place], torque[place], waves, held)
        words += [f"{record.axis_names[entry.axis]} {w.kind} {w.order:.4g}" for w in entry.found.ripple]
    channels = dict(run.channels)
    for name, values in ((TORQUE, torque), (POSITION, angle)):
        old = run.channel(name)
        channels[name] = Channel(old.side, old.unit_symbol, frozen(values))
    source = f"{record.source}; ripple compensated: {', '.join(dict.fromkeys(words))}"
    return record.replace(source=source, runs=(run.replace(channels=channels),))


def table(record: Record, ripple: Sequence[AxisRipple]) -> list[str]:
    """What was found, a line each, in words for people."""
    lines = []
    for entry in ripple:
        name = record.axis_names[entry.axis]
        where = (
            ""
            if len(entry.configurations) == len(record.angle)
            else f", configuration {entry.configurations[0] + 1}"
        )
        for wave in entry.found.ripple:
            tie = f"; {' or '.join(wave.ties)} would do as well" if wave.ties else ""
            lines.append(
                f"{name}{where}: {wave.kind} ripple, order {wave.order:.6g}, amplitude {wave.amplitude:.4g} +- "
                f"{wave.standard_error:.1g} {UNIT[wave.kind]}, phase {wave.phase:.2f} rad, chi-square "
                f"{wave.chi_square:.0f}, by chance {wave.p_value:.1g}{tie}"
            )
        if not entry.found.ripple:
            lines.append(f"{name}{where}: no significant ripple over {entry.turns:.2f} turns")
    return lines


class RippleCompensation(Preprocessing):
    """Finds torque and resolver ripple by order analysis over the motor angle, and removes them from a record.

    Three kinds: "cogging" (a torque that depends on the angle alone), "current" (in proportion to the torque),
    "resolver" (of the measured angle). A wave is removed where chance alone, among all axes, kinds and orders tried,
    would give one so strong with a probability below `significance`. Where nothing is found the record is unchanged;
    the log says either. Sensible before any estimator of a response, and before compensate.friction.

    With excited lines it needs, in each configuration, at least as many experiments as axes, and no model of the robot.
    Without, on trajectories of any kind, the rigid robot of the robot file is taken off the torque, an order must stand
    out beside its neighbours, and both halves of the motion must show it alike. A motor shows an order only if it moves
    by some periods of it (the slow sine is there for that). The zero of the motor angle has to be the
    same all through the record, as it is between a robot's calibration and the next.

        clean: {use: compensate.ripple, with: {significance: 0.001}}
    """

    kinds: tuple[Kind, ...] = KINDS
    """Kinds of ripple that are looked for."""
    orders: tuple[PositiveFloat, ...] | None = None
    """Orders, periods per turn of the motor, that are looked for; null: search all multiples of `order_step`."""
    max_order: PositiveFloat = 40.0
    """Highest order of the search."""
    order_step: PositiveFloat = 1.0
    """Step of the search. What repeats every turn has whole orders; below 1 a found order is fitted, too."""
    phase: Literal["common", "per_configuration"] = "common"
    """Whether all configurations share their ripple; "per_configuration" where the zero of the angle was lost."""
    significance: float = Field(default=0.001, gt=0, lt=1)
    """Probability of any false alarm in a record without ripple, all axes, kinds and orders together.

    Exact for noise. What friction leaves has heavier tails: at small probabilities alarms are a few times as frequent,
    of waves so small that they do no harm."""
    band_hz: tuple[PositiveFloat, PositiveFloat] | None = None
    """Band of the analysis, Hz; null: from the lowest to the highest excited line. Without lines its upper edge is that
    of a low-pass; null: half the lowest resonance of the robot file, 100 Hz or a fifth of the sampling rate at most."""
    minimum_periods: float = Field(default=3.0, ge=0)
    """Periods of a wave that the motor has to pass in some configuration, or the order is not looked for.

    Less than about three cannot be distinguished from an arm whose inertia changes a little with the angle."""
    discard: NonNegativeInt | None = None
    """Leading periods in which ripple is not looked for; it is removed from them, too. null: decided from the data, as
    many as differ from those after them."""

    @model_validator(mode="after")
    def _possible(self) -> Self:
        if not self.kinds or len(set(self.kinds)) < len(self.kinds):
            raise ValueError(
                f"kinds: {', '.join(self.kinds) or 'none'}; name each of {', '.join(KINDS)} once at most"
            )
        if self.band_hz is not None and self.band_hz[0] >= self.band_hz[1]:
            raise ValueError(f"band_hz: {self.band_hz[0]:g} Hz is not below {self.band_hz[1]:g} Hz")
        if self.orders is None and self.max_order < self.order_step:
            raise ValueError(f"max_order: {self.max_order:g} is below the first order, {self.order_step:g}")
        return self

    def run(self, record: Record, robot: Robot, context: Context) -> Record:
        """Find the ripple, say what was found, and take it off."""
        discard = leading_periods((record,), self.discard, context.log)
        ripple = self.search(record, robot, context, discard)
        for line in table(record, ripple):
            context.log.info("%s", line)
        highest = max((wave.order for entry in ripple for wave in entry.found.ripple), default=0.0)
        blur = (2 * np.pi * highest * drift_in_turns(record, discard)) ** 2 / 24
        if blur > 0.01:
            context.log.warning(
                "the motors drift from period to period: order %g is found up to %.0f %% too small; let it settle "
                "longer, or close a position loop",
                highest,
                100 * blur,
            )
        return without_ripple(record, ripple)

    def search(self, record: Record, robot: Robot, context: Context, discard: int = 0) -> list[AxisRipple]:
        """Ripple of each axis, for each set of configurations that share it."""
        n_config, n_axis = len(record.angle), len(record.axis_names)
        groups = [tuple(range(n_config))] if self.phase == "common" else [(c,) for c in range(n_config)]
        refine = None if self.orders is not None or self.order_step % 1 == 0 else self.order_step
        if refine is not None and any(len(group) > 1 for group in groups):
            raise ConfigurationError(
                f"compensate.ripple: an order between whole ones has no phase in common over {n_config} configurations "
                "before it is known to a small part of a period over all turns between them; set phase: "
                "per_configuration, or give the orders"
            )
        places = [(group, axis) for group in groups for axis in range(n_axis)]
        on_lines = record.line is not None and len(record.line) > 0
        motors: Sequence[Sequence[Sequence[MotorData | Passage]]]
        if on_lines:
            by_configuration = motors_by_configuration(record, self.band_hz, discard)
            motors = [[[motor] for motor in motors] for motors in by_configuration]
        else:
            highest_hz = None if self.band_hz is None else self.band_hz[1]
            motors = passages_by_configuration(record, robot, highest_hz, discard)
        shown = [[one for c in group for one in motors[c][axis]] for group, axis in places]
        candidates = [
            self._candidates(record.axis_names[axis], max(one.turns for one in own), on_lines, context)
            for own, (_, axis) in zip(shown, places, strict=True)
        ]
        tried = sum(len(waves) for waves in candidates)
        result = []
        for number in context.track(range(len(places)), len(places), "order analysis"):
            group, axis = places[number]
            own, waves = shown[number], candidates[number]
            lines = [one for one in own if isinstance(one, MotorData)]
            if lines:
                found = find_ripple(lines, waves, self.significance, tried, refine)
            else:
                passages = [one for one in own if isinstance(one, Passage)]
                found = find_orders(passages, waves, self.significance, tried, refine)
            result.append(AxisRipple(axis, group, max(one.turns for one in own), found))
        return result

    def _candidates(self, name: str, turns: float, on_lines: bool, context: Context) -> tuple[Wave, ...]:
        """Waves that a motor passes often enough; an order that is fitted is sought as densely as turns tell."""
        step = self.order_step
        if not on_lines and step % 1 != 0:
            step /= math.ceil(2 * step * turns)
        steps = step * np.arange(1, math.floor(self.max_order / step + 1e-9) + 1)
        orders = sorted(set(self.orders)) if self.orders is not None else [float(order) for order in steps]
        seen = [order for order in orders if order * turns >= self.minimum_periods]
        if len(seen) < len(orders):
            context.log.warning(
                "%s moves by %.2f turns only: ripple below order %.3g cannot be seen; a larger slow sine shows more",
                name,
                turns,
                self.minimum_periods / max(turns, 1e-9),
            )
        return tuple((kind, order) for order in seen for kind in self.kinds)
