"""Columns of candidates: what each would add to the torque of all blocks, in standard deviations."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from robid_core import ComplexArray, Effect, FloatArray, Place, Robot, SignalEffect, StructureEffect
from robid_core.estimation.torque.spectra import MotionSpectra
from robid_core.residual import EffectTorque, TorqueProblem, Weighting, effect_class
from robid_diagnosis.candidates import (
    EVERY_ORDER,
    ORDERS,
    Candidate,
    Scales,
    Spot,
    grid,
    place_at,
    scales_at,
    shape_of,
    spots,
)
from robid_diagnosis.projection import Rows
from robid_diagnosis.structures import alone, changed_robot, structure_candidates
from robid_diagnosis.travel_waves import Waves, goes_one_way, waves_of

WHOLE = "*"  # name of the column of a law that is linear in nothing: all that it does
UNFELT = 0.01  # of what another spring of a change does: no more than that one, held as it may be, shows
PHASES = (0.0, np.pi / 2)
TORQUES = ("torque", "torque_measurement")
MERE_DELAY = 1e-3  # of a law's power: one that leaves less beside a delay is a delay
ALIKE = 0.01  # of what laws see and do at a place: torques of the search before are those of this one
REMEMBERED = 10**9  # bytes of torques that the next search need not evaluate again
ALIGNING = 6  # rounds of Newton's method


@dataclass(frozen=True, eq=False)
class ColumnMeaning:
    """What the columns of one candidate are derivatives for."""

    names: tuple[str, ...]
    """Parameter of each; `*` for all that a law does."""
    phases: tuple[float, ...]
    """rad, where columns come in pairs."""
    positive: tuple[bool, ...]
    """Whether a size must not be negative."""
    delay: FloatArray | None = None
    """Of each torque, s, (n_axis,), that was taken off a law on torques: the fit's own delays take its place."""

    @property
    def paired(self) -> bool:
        """Whether columns are sines and cosines."""
        return len(set(self.phases)) > 1


@dataclass(frozen=True, eq=False)
class Columns:
    """Weighted derivatives of the torque for one candidate's parameters. Large: a search keeps their meaning only."""

    rows: Rows
    """(n_column, n_row)."""
    meaning: ColumnMeaning


@dataclass(frozen=True, eq=False)
class Added:
    """Torque that a candidate adds."""

    keys: tuple[tuple[str, float], ...]
    """Parameter of each column, `*` for all that a law does, and its phase, rad."""
    spectra: tuple[list[ComplexArray], ...]
    """Of each column in each block, N m, (n_config, n_exp, n_bin, n_axis), in single precision: there are many."""
    delay: FloatArray | None
    """As of `ColumnMeaning`."""


class Motion:
    """The motion of all blocks about fitted robots, and the weights of their residuals."""

    def __init__(
        self,
        problem: TorqueProblem,
        point: FloatArray,
        weights: Sequence[Weighting],
        before: Motion | None = None,
    ) -> None:
        """Prepare; `before` is that of the search before, with torques that need not be evaluated again."""
        self.residuals = problem.residuals(point)
        parts = zip(problem.blocks, problem.robots(point), self.residuals, strict=True)
        self.along = [
            EffectTorque(block, robot, residual, problem.delay(point)) for block, robot, residual in parts
        ]
        self.weights = tuple(weights)
        self.predicted = problem.predicted(point)
        self.largest_torque = problem.largest_torque
        self.friction_speed: FloatArray = np.median(problem.blocks[0].laws.odd, axis=0)
        self._before = before
        if before is not None:
            before._before = None
        self._alike: dict[Spot, bool] = {}
        self._at_spot: dict[tuple[str, Spot], list[Candidate]] = {}
        self._known: dict[Candidate, Added] = {}
        self._known_bytes = 0
        self._scales: dict[tuple[int, str, bytes, bool], Scales] = {}

    @property
    def robot(self) -> Robot:
        """The robot of the first block."""
        return self.along[0].robot

    def weighted(self, spectra: Sequence[ComplexArray]) -> Rows:
        """One column, (n_row,), from the acting torque's spectra in each block."""
        gains = (one.block.drive_gain for one in self.along)
        commands = [one if gain is None else one / gain for one, gain in zip(spectra, gains, strict=True)]
        parts = [weight.residual(one).ravel() for weight, one in zip(self.weights, commands, strict=True)]
        return np.concatenate(parts)

    def scales(self, place: Place, effect: type[Effect]) -> Scales:
        """What the motion at a place is like, over all blocks."""
        key = place.axis, place.side, place.direction.tobytes(), issubclass(effect, SignalEffect)
        if key not in self._scales:
            self._scales[key] = self._scales_at(place, effect)
        return self._scales[key]

    def _scales_at(self, place: Place, effect: type[Effect]) -> Scales:
        row = place.direction
        seen = [one.seen(row) for one in self.along]
        signal = None
        if issubclass(effect, SignalEffect):
            axis = place.axis
            kind = "angle" if place.side == "position" else "torque"
            signal = np.concatenate([getattr(o.motion, kind)[..., axis].ravel() for o in self.along])
        position, speed = (np.concatenate(_alike_in_length(parts)) for parts in zip(*seen, strict=True))
        width = float(self.friction_speed[place.axis])
        largest = float(self.largest_torque[place.axis])
        return scales_at(self.robot, place, position, speed, signal, width, largest, self._orders(place.axis))

    def _orders(self, axis: int) -> tuple[float, ...]:
        """Orders of waves that are worth a try at an axis: those of what is left, and low whole ones where it turns."""
        peaks = self.waves[axis].peaks
        return peaks if axis in self._slides else (*ORDERS, *(one for one in peaks if one not in ORDERS))

    @functools.cached_property
    def _slides(self) -> list[int]:
        unit = self.robot.parameter_unit
        names = enumerate(self.robot.axis_names)
        return [axis for axis, name in names if unit(f"friction.{name}.viscous") == "N s/m"]

    @functools.cached_property
    def waves(self) -> dict[int, Waves]:
        """Waves over the travel of each axis: a metre has no whole orders, a turn more than can all be tried."""
        motions = [one.block.motion for one in self.along]
        left = [
            one.block.motion.over_time(one.block.counted(r))
            for one, r in zip(self.along, self.residuals, strict=True)
        ]
        angle, speed = [motion.angle for motion in motions], [motion.rate(1) for motion in motions]
        highest = float(motions[0].frequency_hz[-1])

        def joined(parts: list[FloatArray], axis: int) -> FloatArray:
            return np.concatenate([part[..., axis].ravel() for part in parts])

        def over_travel(axis: int) -> Waves:
            slides, way = axis in self._slides, joined(speed, axis)
            if not slides and goes_one_way(way):
                return Waves((), 0)
            lowest = 0.0 if slides else EVERY_ORDER + 0.5
            return waves_of(joined(left, axis), joined(angle, axis), way, highest, lowest)

        return {axis: over_travel(axis) for axis in range(self.robot.n_axis)}

    def candidates(self, use: str) -> list[Candidate]:
        """An effect at every place, with every value to begin from."""
        effect, found = effect_class(use), list[Candidate]()
        if issubclass(effect, StructureEffect):
            first = self.along[0]
            highest = float(first.motion.frequency_hz[-1])
            return list(structure_candidates(self.robot, use, effect, first.block.angle, highest))
        for spot in spots(self.robot, effect):
            place = place_at(self.robot, spot)
            if place is not None:
                self._at_spot[use, spot] = self._again(use, spot, place) or self._at(use, effect, spot, place)
                found += self._at_spot[use, spot]
        return found

    def _again(self, use: str, spot: Spot, place: Place) -> list[Candidate]:
        """Candidates of the search before, with their torques, at a place where the motion has hardly changed since."""
        before = self._before
        if before is None or (use, spot) not in before._at_spot:
            return []
        if spot not in self._alike:
            pairs = zip(self.along, before.along, strict=True)
            self._alike[spot] = all(now.change_since(then, place) < ALIKE for now, then in pairs)
        if not self._alike[spot]:
            return []
        effect, found = effect_class(use), list[Candidate]()
        orders, known = self._orders(place.axis), before._orders(place.axis)
        counted = [row.name for row in effect.parameters if row.unit == "1/turn"]
        for old in before._at_spot[use, spot]:
            if all(old.values[name] in orders for name in counted):
                found.append(replace(old, place=place))
                if old in before._known:
                    self._remember(found[-1], before._known[old])
        if counted and orders != known:
            made = self._at(use, effect, spot, place)
            found += [one for one in made if any(one.values[name] not in known for name in counted)]
        return found

    def _at(self, use: str, effect: type[Effect], spot: Spot, place: Place) -> list[Candidate]:
        probe = {row.name: row.default for row in effect.parameters}
        first = Candidate(use, spot, effect, probe, place)
        linear = _linear_names(first)
        shape = shape_of(effect, linear, spot.side)
        scales = self.scales(place, effect)
        values = [one for start in effect.starts(place) for one in grid(effect, linear, scales, start)]
        return [Candidate(use, spot, effect, one, place, tuple(n for n in shape if one[n])) for one in values]

    def whole(self, candidate: Candidate, values: Mapping[str, float]) -> FloatArray:
        """All that an effect does with some values, in standard deviations, (n_row,)."""
        return self.weighted(self.torques(candidate, values))

    def torques(self, candidate: Candidate, values: Mapping[str, float]) -> list[ComplexArray]:
        """All that an effect does with some values in each block, N m, (n_config, n_exp, n_bin, n_axis)."""
        if candidate.place is None:
            return [one.of_structure(changed_robot(one.robot, candidate, values)) for one in self.along]
        bound = candidate.bound(values)
        return [one.of_effect(bound) for one in self.along]

    def columns(self, candidate: Candidate, values: Mapping[str, float] | None = None) -> Columns:
        """Evaluate a candidate along the motion."""
        if candidate.springs:
            each = [self.whole(candidate, alone(candidate, name, values or {})) for name in candidate.springs]
            size = np.linalg.norm(each, axis=1)
            felt = size > UNFELT * size.max()
            n = len(each)
            meaning = ColumnMeaning(candidate.springs, (0.0,) * n, (True,) * n)
            return Columns(np.array(each) * felt[:, None], meaning)
        if candidate.place is None:
            every = self.whole(candidate, values or {})[None]
            return Columns(every, ColumnMeaning((WHOLE,), (0.0,), (not candidate.signed,)))
        added = self._known.get(candidate) if not values else None
        if added is None:
            added = self._added(candidate, values or {})
            if not values:
                self._remember(candidate, added)
        rows = {row.name: row for row in candidate.effect.parameters}
        paired = len({phase for _, phase in added.keys}) > 1
        meaning = ColumnMeaning(
            tuple(name for name, _ in added.keys),
            tuple(phase for _, phase in added.keys),
            tuple(not paired and (name == WHOLE or rows[name].lower >= 0) for name, _ in added.keys),
            added.delay,
        )
        return Columns(np.stack([self.weighted(spectra) for spectra in added.spectra]), meaning)

    def _remember(self, candidate: Candidate, added: Added) -> None:
        """Keep torques for the next search, as long as all of them are not too large: 48 experiments have 3 GB."""
        size = sum(one.nbytes for spectra in added.spectra for one in spectra)
        if self._known_bytes + size <= REMEMBERED:
            self._known[candidate] = added
            self._known_bytes += size

    def forget_torques(self) -> None:
        """Free the memory of torques that were kept for another search: there will be none."""
        self._known.clear()
        self._known_bytes = 0

    def _added(self, candidate: Candidate, values: Mapping[str, float]) -> Added:
        has_phase = any(row.name == "phase" for row in candidate.effect.parameters)
        spectra: dict[tuple[str, float], list[ComplexArray]] = {}
        delay = None
        for one, predicted in zip(self.along, self.predicted, strict=True):
            for phase in PHASES if has_phase else (0.0,):
                bound = candidate.bound({**values, **({"phase": phase} if has_phase else {})})
                units = one.units(bound)
                if not units:
                    whole = one.of_effect(bound)
                    if bound.place.side in TORQUES:
                        delay, whole = without_delay(whole, predicted, one.motion)
                    units = {WHOLE: whole}
                for name, torque in units.items():
                    spectra.setdefault((name, phase), []).append(torque.astype(np.complex64))
        return Added(tuple(spectra), tuple(spectra.values()), delay)


def _alike_in_length(lanes: Sequence[FloatArray]) -> list[FloatArray]:
    """Return samples of all lanes (n_lane, n_time), as many of each as the shortest have, evenly over all of it."""
    n = min(one.shape[1] for one in lanes)
    return [one[:, np.linspace(0, one.shape[1] - 1, n).round().astype(int)] for one in lanes]


def without_delay(
    added: ComplexArray, predicted: ComplexArray, motion: MotionSpectra
) -> tuple[FloatArray, ComplexArray]:
    """Take the delay off what a law adds to torques: a fit has delays of its own, exact ones, and a column only slopes.

    Parameters
    ----------
    added, predicted
        Spectra, (n_config, n_exp, n_bin, n_axis).
    motion
        In which they were measured.

    Returns
    -------
    The delay d of each axis, s, with which ``e^(i w d) (predicted + added)`` is nearest to what is predicted, and what
    is then left.
    """
    delay = np.zeros(predicted.shape[-1])
    omega, slope = motion.omega[:, None], motion.advancing(predicted)
    at_window = 1j * omega * predicted - slope  # a window does not come earlier with the torque
    size = np.maximum((np.abs(slope) ** 2).sum(axis=(0, 1, 2)), 1e-300)
    left = added
    for _ in range(ALIGNING):
        delay -= (slope.conj() * left).real.sum(axis=(0, 1, 2)) / size
        left = np.exp(1j * omega * delay) * (predicted + added) - delay * at_window - predicted
    power, remains = ((np.abs(values) ** 2).sum() for values in (added, left))
    return delay, left if remains > MERE_DELAY * power else np.zeros_like(left)


def _linear_names(candidate: Candidate) -> tuple[str, ...]:
    """Parameters in which a law is linear, as its regressor says."""
    bound = candidate.bound()
    one = np.zeros((1, 4))
    found: dict[str, FloatArray] = bound.effect.regressor(one, one, one, bound.parameters, bound.place)
    return tuple(found)
