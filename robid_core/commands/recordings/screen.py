"""Recordings as text: a table of channels with guesses, the clock, single numbers."""

from __future__ import annotations

import re
from collections.abc import Sequence

from robid_core.commands.recordings.behaviour import JITTER, Clock
from robid_core.commands.recordings.guesses import NO_CHANNEL, Guess
from robid_core.commands.recordings.inspection import Inspected
from robid_core.foreign.limits import size_of

DAMAGE = re.compile("A0[0-9]: ")  # begins what a reader says is wrong with a file
LONGEST_NAME = 40
MOST_NAMES = 6


def recording_lines(one: Inspected) -> list[str]:
    """Return a recording: what its reader says, a row for each channel, time, constants, arrays that are no signals."""
    lines = [f"{one.file} ({size_of(one.file)} bytes)", *(f"  {line}" for line in one.lines)]
    guesses = one.guesses
    if guesses is None:
        return lines
    rows = [["column", "may be", "unit", "samples", "axes", "from", "to", "why, and what to look at"]]
    rows += [_row(channel) for channel in guesses.channels]
    lines += ["", *(f"  {line}" for line in table_lines(rows)), ""]
    if guesses.clock is not None:
        lines.append(f"  time: {clock_text(guesses.clock)}")
    else:
        lines.append("  time: no column rises as a clock does")
    if one.repeats is not None:
        lines.append(f"  motion: {one.repeats.text(step_of(guesses.clock))}")
    if guesses.constants:
        pairs = [f"{name} = {value:g}" for name, value in guesses.constants.items()]
        lines.append(f"  constants: {listed(pairs, 12)}")
    if guesses.short:
        lines.append(f"  not sampled: {listed(guesses.short)}")
    return lines


def short_line(one: Inspected) -> str:
    """Return a recording that is like one already shown in a line."""
    words = [f"{one.file}: the same columns"]
    if one.guesses is not None and one.guesses.channels:
        words.append(f"{max(channel.n_sample for channel in one.guesses.channels)} samples")
        if one.guesses.clock is not None:
            words.append(clock_text(one.guesses.clock))
        if one.repeats is not None:
            words.append(one.repeats.text(step_of(one.guesses.clock)))
        missing = sum(channel.n_missing for channel in one.guesses.channels)
        if missing:
            words.append(f"{missing} values missing")
    damage = [f"  {line}" for line in one.lines if DAMAGE.match(line)]
    return "\n".join([", ".join(words), *damage])


def step_of(clock: Clock | None) -> float | None:
    """Return the sampling time in s, None where it is not known."""
    return None if clock is None or clock.counts else clock.step_s


def clock_text(clock: Clock) -> str:
    """Say how a clock goes."""
    if clock.counts:
        return f"{clock.name} counts samples; the sampling time is not in the file"
    least, usual, greatest = (f"{1e3 * step:.6g}" for step in (clock.least_s, clock.step_s, clock.greatest_s))
    text = f"{clock.name} [{clock.unit}], {1 / clock.step_s:.6g} Hz, "
    text += (
        _even_steps(usual, clock)
        if clock.even
        else f"uneven: steps of {least} to {greatest} ms, usual {usual} ms"
    )
    text += f", {clock.n_gap} gaps" if clock.n_gap else ", no gaps"
    return text + (f", stands or runs back {clock.n_back} times" if clock.n_back else "")


def _even_steps(usual: str, clock: Clock) -> str:
    """Say how even steps are that are taken as even; `acquisition.recorded` warns of the same."""
    return (
        f"even steps of {usual} ms"
        if clock.unevenness < JITTER
        else (f"steps of {usual} ms, off by up to {100 * clock.unevenness:.2g} %, taken as even")
    )


def _row(channel: Guess) -> list[str]:
    columns = channel.columns
    name = columns[0] if len(columns) == 1 else f"{columns[0]} ... {columns[-1]}"
    if len(name) > LONGEST_NAME and len(columns) > 1:
        name = f"{columns[0]} and {len(columns) - 1} more"
    told = [*channel.reasons]
    if channel.quantity not in NO_CHANNEL and not channel.first:
        told.append("not taken")
    if channel.constant:
        whole = len(channel.constant) == channel.n_axis
        told.append("constant" if whole else f"constant: {listed(channel.constant)}")
    if channel.n_missing:
        told.append(f"{channel.n_missing} values missing")
    return [
        name if len(name) <= LONGEST_NAME else f"...{name[3 - LONGEST_NAME :]}",
        channel.meaning or "-",
        channel.unit or "-",
        str(channel.n_sample),
        str(channel.n_axis),
        f"{channel.low:.4g}",
        f"{channel.high:.4g}",
        "; ".join(told),
    ]


def table_lines(rows: Sequence[Sequence[str]]) -> list[str]:
    """Return rows as lines with aligned columns."""
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    return [
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows
    ]


def listed(items: Sequence[str], most: int = MOST_NAMES) -> str:
    """Return the first of a list of things as text, and how many there are in all where there are more."""
    shown = ", ".join(items[:most])
    return shown if len(items) <= most else f"{shown}, ... ({len(items)})"
