"""What the columns of a recording may be: a guess for each channel, with its reason.

Names come first (`names.py`), then behaviour (`behaviour.py`): a column that rises evenly is the time, one that is the
derivative of another its speed, one that another follows with a delay its reference. A range tells degrees from
radians. Nothing here is certain; a person has to look at it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from robid_core.arrays import FloatArray
from robid_core.commands.recordings.behaviour import (
    Clock,
    clock_of,
    derivative_factor,
    follow_each_other,
    leads,
    rises_evenly,
)
from robid_core.commands.recordings.families import Family, sort_columns
from robid_core.commands.recordings.names import DEFAULT_UNITS, Said, said_by

MOST_UNKNOWN = 30  # columns without a telling name that are compared with others
TURN = 2 * np.pi
COUNTS = 1000.0  # whole numbers that reach so far are counts of an encoder
_FACTORS = {
    ("rad", "rad/s"): 1.0, ("rad", "deg/s"): 180 / np.pi, ("rad", "rpm"): 30 / np.pi,
    ("deg", "deg/s"): 1.0, ("deg", "rad/s"): np.pi / 180, ("deg", "rpm"): 1 / 6,
    ("m", "m/s"): 1.0, ("m", "mm/s"): 1e3, ("mm", "mm/s"): 1.0, ("mm", "m/s"): 1e-3,
}  # fmt: skip
_NEAR = 0.05  # by which a factor may be off
NO_CHANNEL = ("", "time", ENABLE := "enable")  # what a column may be beside a channel of a record


@dataclass(frozen=True)
class Guess:
    """A channel of a recording: what it may be, and what its samples are like.

    `meaning` is a name of a record's channel (`motor_position`), `time`, `enable`, or empty; `unit` is empty where none
    is known.
    `first` tells the one to take of several with one meaning; `reasons` say where meaning and unit come from.
    """

    label: str
    columns: tuple[str, ...]
    n_sample: int
    n_axis: int
    low: float
    high: float
    n_missing: int
    constant: tuple[str, ...]
    quantity: str = ""
    reference: bool = False
    side: str = ""
    unit: str = ""
    reasons: tuple[str, ...] = ()
    first: bool = False

    @property
    def meaning(self) -> str:
        """Name of the channel in a record."""
        if self.quantity in NO_CHANNEL:
            return self.quantity
        return f"{self.quantity}_reference" if self.reference else f"{self.side or 'motor'}_{self.quantity}"


@dataclass(frozen=True)
class Guesses:
    """All channels, the clock of most of them, single numbers, and arrays that are no signals."""

    channels: tuple[Guess, ...]
    clock: Clock | None
    constants: dict[str, float]
    short: tuple[str, ...]

    @property
    def chosen(self) -> list[Guess]:
        """The channels that a pipeline would take."""
        return [one for one in self.channels if one.first]


@np.errstate(over="ignore", invalid="ignore")  # numbers near the largest of all are no signals
def guess_channels(
    columns: Mapping[str, FloatArray], units: Mapping[str, str] | None = None, hint: str = ""
) -> Guesses:
    """Return what columns may be.

    Parameters
    ----------
    columns
        Arrays by name; (n_sample,), tables of several axes, or single numbers.
    units
        What the file states as their units, by column or by what columns of several axes have in common.
    hint
        Name of the file without its suffix, for columns that are called by their axis only.
    """
    sorted_ = sort_columns(columns)
    families = sorted_.families
    known = units or {}
    said = [said_by(one.label, known.get(one.names[0]) or known.get(one.label, ""), hint) for one in families]
    guesses = [_by_name(family, words) for family, words in zip(families, said, strict=True)]
    clocks = _clocks(families, guesses, said)
    length = _main_length(guesses)
    clock = min(
        (one for n_sample, one in clocks if n_sample == length),
        key=lambda one: (one.counts, not one.even),
        default=None,
    )
    time_s = None if clock is None or clock.counts else _instants(columns[clock.name], clock)
    _by_behaviour(families, guesses, said, time_s, length)
    _by_range(families, guesses)
    channels = _chosen([_of_time(one, clocks) for one in guesses], said, length)
    return Guesses(tuple(channels), clock, sorted_.constants, sorted_.short)


def _instants(values: FloatArray, clock: Clock) -> FloatArray:
    usual = float(np.median(np.diff(values[np.isfinite(values)])))
    instants: FloatArray = (values - values[0]) * (clock.step_s / usual)
    return instants


def _by_name(family: Family, said: Said) -> Guess:
    finite = family.samples[np.isfinite(family.samples)]
    columns = family.names
    still = np.fmax.reduce(family.samples, axis=0) == np.fmin.reduce(family.samples, axis=0)  # NaN is not
    labels = columns if len(columns) == len(still) else tuple(f"{columns[0]}[{i}]" for i in range(len(still)))
    known = said.quantity and not said.other
    reasons = ["name"] if known else ["not measured, by its name"] if said.other and said.quantity else []
    if known and said.by_current:
        reasons.append("of the motor's current")
    if known and said.unit:
        reasons.append("unit stated in the file")
    switches = (
        said.enabled and len(finite) == family.samples.size and np.isin(finite, (0, 1)).all() and finite.any()
    )
    if switches:
        reasons = ["name", f"1 in {100 * finite.mean():.3g} % of the samples"]
    return Guess(
        label=family.label,
        columns=columns,
        n_sample=family.samples.shape[0],
        n_axis=family.samples.shape[1],
        low=float(finite.min()) if len(finite) else np.nan,
        high=float(finite.max()) if len(finite) else np.nan,
        n_missing=family.samples.size - len(finite),
        constant=tuple(label for label, one in zip(labels, still, strict=False) if one),
        quantity=ENABLE if switches else said.quantity if known else "",
        reference=bool(known and said.reference),
        side=said.side,
        unit=said.unit if known else "",
        reasons=tuple(reasons),
    )


def _clocks(families: tuple[Family, ...], guesses: list[Guess], said: list[Said]) -> list[tuple[int, Clock]]:
    """Return the length and the clock of each column that may be the time, named ones first."""
    found = []
    for by_name in (True, False):
        for family, guess, words in zip(families, guesses, said, strict=True):
            values = family.samples[:, 0]
            called = guess.quantity == "time"
            if family.samples.shape[1] > 1 or called != by_name or (not called and not rises_evenly(values)):
                continue
            if not called and guess.quantity and not np.all(np.diff(values) == 1):
                continue  # a motion at constant speed rises evenly too
            if clock := clock_of(family.names[0], values, words.unit if called else ""):
                found.append((len(values), clock))
    return found


def _main_length(guesses: list[Guess]) -> int:
    """Return the number of samples that most recognised channels have."""
    meanings: dict[int, set[str]] = {}
    for guess in guesses:
        known = {guess.meaning} if guess.quantity not in NO_CHANNEL else set()
        meanings.setdefault(guess.n_sample, set()).update(known)
    return max(meanings, key=lambda length: (len(meanings[length]), length), default=0)


def _by_behaviour(
    families: tuple[Family, ...],
    guesses: list[Guess],
    said: list[Said],
    time_s: FloatArray | None,
    length: int,
) -> None:
    """Find speeds, positions and references among columns without a telling name, and units of speeds."""
    moving = {
        index: axis
        for index, (one, words) in enumerate(zip(guesses, said, strict=True))
        if one.n_sample == length and one.quantity != "time" and not words.other
        if (axis := _widest_axis(families[index].samples)) is not None
    }
    unknown = {index for index in moving if not guesses[index].quantity}
    if len(unknown) > MOST_UNKNOWN:
        unknown = set(sorted(unknown)[:MOST_UNKNOWN])
    pairs = [(a, b) for a in moving for b in moving if a != b and guesses[a].n_axis == guesses[b].n_axis]
    for a, b in pairs:
        quantities = guesses[a].quantity, guesses[b].quantity
        told = quantities in (("position", "speed"), ("position", ""), ("", "speed"), ("speed", ""))
        if told or {a, b} <= unknown:
            one, other = (families[index].samples[:, moving[a]] for index in (a, b))
            factor = derivative_factor(one, other, time_s)
            if factor:
                _relate(guesses, a, b, factor if time_s is not None else 0.0)
    for a, b in pairs:
        position = guesses[a]
        if position.quantity != "position" or position.reference or guesses[b].quantity or b not in unknown:
            continue
        one, other = (families[index].samples[:, moving[a]] for index in (a, b))
        if follow_each_other(one, other):
            ahead = leads(one, other)
            reason = f"{position.label} follows it" if ahead else f"moves as {position.label}"
            guesses[b] = replace(
                guesses[b], quantity="position", reference=ahead, unit=position.unit, reasons=(reason,)
            )
    for index, words in enumerate(said):
        if words.reference and guesses[index].quantity:
            guesses[index] = replace(guesses[index], reference=True)  # whatever it is the derivative of


def _widest_axis(samples: FloatArray) -> int | None:
    """Return the axis that moves most, of those without holes; None where none moves."""
    whole = np.isfinite(samples).all(axis=0)
    travel = np.where(whole, np.ptp(np.where(whole, samples, 0.0), axis=0), 0.0)
    return int(np.argmax(travel)) if travel.max() > 0 else None


def _relate(guesses: list[Guess], a: int, b: int, factor: float) -> None:
    """Enter that b is the derivative of a, with a factor where the time is known."""
    one, other = guesses[a], guesses[b]
    if not other.quantity:
        derived = "acceleration" if one.quantity == "speed" else "speed"
        other = replace(
            other, quantity=derived, reference=one.reference, reasons=(f"derivative of {one.label}",)
        )
    if not one.quantity and other.quantity == "speed":
        one = replace(
            one, quantity="position", reference=other.reference, reasons=(f"{other.label} is its derivative",)
        )
    if one.quantity == "position" and other.quantity == "speed" and factor:
        for (of_position, of_speed), exact in _FACTORS.items():
            fits = abs(abs(factor) / exact - 1) < _NEAR
            if fits and of_position == one.unit and not other.unit:
                other = replace(
                    other, unit=of_speed, reasons=(*other.reasons, f"unit as derivative of {one.label}")
                )
            elif fits and of_speed == other.unit and not one.unit:
                one = replace(
                    one, unit=of_position, reasons=(*one.reasons, f"unit as {other.label} is its derivative")
                )
    guesses[a], guesses[b] = one, other


def _by_range(families: tuple[Family, ...], guesses: list[Guess]) -> None:
    """Guess units that nothing else tells."""
    for index, guess in enumerate(guesses):
        if guess.unit or guess.quantity in NO_CHANNEL:
            continue
        unit, reason = (
            DEFAULT_UNITS[guess.quantity],
            f"unit not stated, {DEFAULT_UNITS[guess.quantity]} is usual",
        )
        if guess.quantity == "position":
            unit, reason = _unit_of_position(guess, families[index].samples)
        elif guess.quantity == "speed" and any(
            one.quantity == "position" and one.unit == "deg" and one.n_axis == guess.n_axis for one in guesses
        ):
            unit, reason = "deg/s", "unit not stated, positions are in degrees"
        guesses[index] = replace(guess, unit=unit, reasons=(*guess.reasons, reason))


def _unit_of_position(guess: Guess, samples: FloatArray) -> tuple[str, str]:
    reach = max(abs(guess.low), abs(guess.high))
    if reach > COUNTS and np.all(np.mod(samples[np.isfinite(samples)], 1) == 0):
        return "count", "whole numbers: counts of an encoder, put 2 pi over the counts of a turn as scale"
    if reach <= TURN:
        return "rad", "unit not stated, within a turn if rad"
    if guess.side == "motor":
        return "rad", f"unit not stated, reaches {reach:.3g}: rad of a motor behind a gear, or deg"
    return "deg", f"unit not stated, reaches {reach:.3g}, more than a turn in rad; rad where it is a motor's"


def _of_time(guess: Guess, clocks: list[tuple[int, Clock]]) -> Guess:
    """Say time of what is a clock, and of nothing else."""
    clock = next((one for _, one in clocks if one.name == guess.columns[0]), None)
    if clock is None:
        return replace(guess, quantity="", unit="", reasons=()) if guess.quantity == "time" else guess
    how = "counts samples" if clock.counts else "rises evenly" if clock.even else "rises"
    reasons = ("name", how) if guess.quantity == "time" else (how,)
    return replace(guess, quantity="time", unit=clock.unit, reference=False, reasons=reasons)


def _chosen(guesses: list[Guess], said: list[Said], length: int) -> list[Guess]:
    """Mark of every meaning the channel that says it best: measured, in the fewest words; none that never changes.

    Channels with another number of axes than the position are not of the same robot.
    """
    best: dict[str, tuple[tuple[bool, bool, int], int]] = {}
    for index, (guess, words) in enumerate(zip(guesses, said, strict=True)):
        still = len(guess.constant) == guess.n_axis
        if guess.quantity in NO_CHANNEL or guess.n_sample != length or still:
            continue
        rank = ("name" not in guess.reasons, not words.measured, words.n_word)
        if guess.meaning not in best or rank < best[guess.meaning][0]:
            best[guess.meaning] = (rank, index)
    taken = {index for _, index in best.values()}
    positions = [best[name][1] for name in ("motor_position", "joint_position") if name in best]
    if positions:
        n_axis = guesses[positions[0]].n_axis
        taken = {index for index in taken if guesses[index].n_axis == n_axis}
    return [replace(guess, first=index in taken) for index, guess in enumerate(guesses)]
