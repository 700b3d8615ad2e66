"""The stages that read recordings, as YAML to paste: whatever is a guess is marked as one."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Sequence
from pathlib import Path

from robid_core.commands.recordings.guesses import ENABLE, Guess
from robid_core.commands.recordings.inspection import Inspected
from robid_core.commands.recordings.motion import poses_differ
from robid_core.commands.recordings.pattern import pattern_of
from robid_core.commands.recordings.screen import clock_text, listed, step_of
from robid_core.robot.file.wording import PLACEHOLDER

FEWEST = 4  # experiments of a diagnosis; fewer are cut, which periods are not
CHANNELS = "  channels:"
LENGTH_TOLERANCE = 0.1  # share of the longest by which a recording of one stage may be shorter
SAMPLE_TIME_S = 0.001  # written where no file tells the sampling time
_PLAIN = re.compile(r"[A-Za-z_/][A-Za-z0-9_./-]*(?: [A-Za-z0-9_./-]+)*")
_WORDS_OF_YAML = {"true", "false", "yes", "no", "on", "off", "null", "y", "n", "none"}


def stage_lines(recordings: Sequence[Inspected], root: Path) -> list[str]:
    """Return the `stages` of a pipeline that reads recordings below a data root; empty where no channel is recognised.

    Recordings with one map of channels are read by one stage; so are files of equal length that hold different channels
    of one motion.
    """
    groups: dict[tuple[object, ...], list[Inspected]] = {}
    for one in recordings:
        if one.is_record or (one.guesses is not None and one.guesses.chosen):
            groups.setdefault(one.kind, []).append(one)
    alike = [part for group in groups.values() for part in _of_one_length(group)]
    stages = [_stage(group, root) for group in _joined(alike)]
    if not stages:
        return []
    if len(alike) > len(groups):
        _share_channels(stages)
    lines = ["stages:"]
    names = [f"acquire{'' if number == 1 else f'_{number}'}" for number in range(1, len(stages) + 1)]
    for name, stage in zip(names, stages, strict=True):
        lines += [f"  {name}:", *(f"    {line}" for line in stage)]
    if len(alike) > len(groups):
        lines.append(
            "  # their lengths differ; fits and diagnoses take several records: "
            f"inputs: {{record: [{', '.join(names)}]}}"
        )
    return lines


def _share_channels(stages: Sequence[list[str]]) -> None:
    """Let stages take the channels of the first one that has the same."""
    heads: dict[tuple[str, ...], str] = {}
    for number, lines in enumerate(stages, start=1):
        first = next((i for i, line in enumerate(lines) if line == CHANNELS), len(lines))
        map_ = tuple(lines[first + 1 :])
        if map_ in heads:
            lines[first:] = [f"{CHANNELS} *{heads[map_]}"]
        elif map_:
            heads[map_] = f"channels{'' if number == 1 else f'_{number}'}"
            lines[first] = f"{CHANNELS} &{heads[map_]}"


def _of_one_length(group: list[Inspected]) -> list[list[Inspected]]:
    """Return recordings one by one where their lengths differ so much that one stage refuses them; periods do not."""
    if group[0].is_record or all(one.repeats is not None for one in group):
        return [group]
    lengths = [_length(one) for one in group]
    if min(lengths) >= (1 - LENGTH_TOLERANCE) * max(lengths):
        return [group]
    return [[one] for one in group]


def _joined(groups: list[list[Inspected]]) -> list[list[list[Inspected]]]:
    """Return groups, those of single files put together that are parts of one recording."""
    parts = [group for group in groups if len(group) == 1 and not group[0].is_record]
    lengths = {_length(group[0]) for group in parts}
    meanings = [channel.meaning for group in parts for channel in _chosen(group[0])]
    folders = {group[0].file.parent for group in parts}
    clocks = [group for group in parts if group[0].guesses is not None and group[0].guesses.clock is not None]
    if len(parts) < 2 or len(lengths) > 1 or len(set(meanings)) < len(meanings) or len(folders) > 1:
        return [[group] for group in groups]
    main = clocks[0] if clocks else parts[0]
    whole = [main, *(group for group in parts if group is not main)]
    return [whole, *([group] for group in groups if group not in parts)]


def _chosen(one: Inspected) -> list[Guess]:
    return one.guesses.chosen if one.guesses is not None else []


def _length(one: Inspected) -> int:
    return _chosen(one)[0].n_sample


def _stage(groups: list[list[Inspected]], root: Path) -> list[str]:
    """Return a stage: of one group of files with the same channels, or of files that each hold some channels."""
    first = groups[0][0]
    names = [_below(one.file, root) for one in groups[0]]
    lines = ["use: acquisition.recorded", "with:"]
    motions = [one.motion for one in groups[0] if one.motion is not None]
    differ = len(motions) == len(names) and poses_differ(motions)
    pattern = pattern_of(names, differ) if len(names) > 1 else ""
    if pattern:
        why = "; the poses differ" if differ else ""
        lines.append(f"  pattern: {json.dumps(pattern)}  # guess: which number counts what{why}")
    else:
        lines.append(f"  path: {scalar(names[0])}")
        if len(names) > 1:
            lines.append(
                f"  # the same columns: {listed(names[1:])}; a table says which is which (index: ...)"
            )
    lines.append(f"  format: {first.reader_name}")
    if first.guesses is None:
        return lines
    lines += [*_time_lines(first), *_period_lines([one for group in groups for one in group])]
    taken = {channel.meaning for group in groups for channel in _chosen(group[0])}
    if first.guesses.constants:
        pairs = [f"{name} = {value:g}" for name, value in first.guesses.constants.items()]
        lines.append(f"  # constants of the file: {listed(pairs, 12)}")
    if any(channel.quantity in ("torque", "current") for channel in _chosen(first)):
        lines.append(
            "  torque_hold: zero_order_hold  # guess: held from sample to sample; continuous: measured, filtered, or "
            "the controller is faster than the recording (its own sampling time: motor_torque: held_s)"
        )
    lines.append(CHANNELS)
    for group in groups:
        other = "" if group is groups[0] else _below(group[0].file, root)
        enable = _enabled(group[0])
        lines += [
            f"    {_channel_line(channel, taken, other, enable.get(channel.meaning))}"
            for channel in _chosen(group[0])
        ]
        left = (
            [channel for channel in group[0].guesses.channels if not channel.first]
            if group[0].guesses
            else []
        )
        used = {"time", ENABLE} if enable else {"time"}
        lines += _left_lines([channel for channel in left if channel.meaning not in used])
    return lines


def _time_lines(one: Inspected) -> list[str]:
    clock = one.guesses.clock if one.guesses is not None else None
    if clock is None or clock.counts:
        why = "no column is the time" if clock is None else f"{clock.name} only counts samples"
        return [f"  sample_time_s: {SAMPLE_TIME_S}  # guess: {why}; put the true sampling time here"]
    lines = [f"  time_column: {scalar(clock.name)}  # guess: {clock_text(clock)}"]
    if clock.unit != "s":
        lines.append(f"  time_unit: {clock.unit}  # guess: from its name, or the size of its steps")
    return lines


def _period_lines(recordings: Sequence[Inspected]) -> list[str]:
    """Return the period of recordings that all repeat after as many samples; files without a position do not count."""
    moving = [
        one
        for one in recordings
        if one.guesses is not None and any(channel.quantity == "position" for channel in one.guesses.chosen)
    ]
    found = [one.repeats for one in moving]
    first = found[0] if found else None
    if first is None or any(one is None or one.lag != first.lag for one in found):
        return []
    clock = moving[0].guesses.clock if moving[0].guesses is not None else None
    told = first.text(step_of(clock))
    if len(recordings) < FEWEST:
        return [
            f"  # period_s: auto  # it {told}; with `lines: auto` for fits. A diagnosis of fewer than {FEWEST} "
            "files cuts one long motion (blocks: 10)",
        ]
    return [
        f"  period_s: auto  # guess: it {told}",
        "  lines: auto  # the excited frequencies; without lines the single periods are not used",
    ]


def _enabled(one: Inspected) -> dict[str, Guess]:
    """Return the column that says when drives were enabled, by the channel that it goes with: one masks them all."""
    chosen = _chosen(one)
    first = next(
        (own for own in chosen if own.quantity in ("torque", "current")), chosen[0] if chosen else None
    )
    found = [
        own
        for own in (one.guesses.channels if one.guesses is not None else ())
        if first is not None
        and own.meaning == ENABLE
        and own.n_sample == first.n_sample
        and own.n_axis in (1, first.n_axis)
    ]
    return {first.meaning: found[0]} if first is not None and len(found) == 1 else {}


def _channel_line(channel: Guess, taken: set[str], file: str, enable: Guess | None) -> str:
    """Return the entry of a channel; what is known at the joints only is taken through the gear."""
    name = channel.meaning
    motor = name.replace("joint_", "motor_", 1)
    if name.startswith("joint_") and motor not in taken:
        name = motor
    column = ", ".join(scalar(one) for one in channel.columns)
    entry = f"column: {column}" if len(channel.columns) == 1 else f"column: [{column}]"
    entry += f", unit: {channel.unit}"
    if name == "motor_current" and "motor_torque" not in taken:
        entry += f", torque_constant: {PLACEHOLDER}"  # N m/A; stages read torques
        name = "motor_torque"
    if channel.unit == "count":
        entry += ", scale: 1.0, unit_to: rad"
    if channel.side == "joint":
        entry += ", side: joint"
    if file:
        entry += f", file: {scalar(file)}"
    why = list(channel.reasons)
    if enable is not None:
        names = ", ".join(scalar(one) for one in enable.columns)
        entry += f", enable: {names if len(enable.columns) == 1 else f'[{names}]'}"
        why += [f"enabled: {enable.reasons[-1]}"]
    if not channel.side and channel.quantity in ("position", "speed", "torque"):
        why.append("side of the gear not stated")
    if channel.n_missing:
        why.append(f"{channel.n_missing} values missing")
    if channel.constant:
        why.append(f"constant: {listed(channel.constant)}")
    return f"{name}: {{{entry}}}  # guess: {'; '.join(why)}"


def _left_lines(channels: Iterable[Guess]) -> list[str]:
    another = [f"{one.label} ({one.meaning})" for one in channels if one.meaning]
    unknown = [one.label for one in channels if not one.meaning]
    further = "those of further axes belong into the list of a channel: column: [FIRST, SECOND]"
    lines = [f"    # not taken: {listed(another)}; {further}"] if another else []
    return lines + ([f"    # not recognised: {listed(unknown)}"] if unknown else [])


def data_root(files: Sequence[Path], root: Path) -> Path:
    """Return the data root where all files lie below it, else the folder that they have in common."""
    full = [file.resolve() for file in files]
    if all(file.is_relative_to(root) for file in full):
        return root
    folder = full[0].parent
    while not all(file.is_relative_to(folder) for file in full):
        folder = folder.parent
    return folder


def _below(file: Path, root: Path) -> str:
    return file.resolve().relative_to(root).as_posix()


def scalar(text: str) -> str:
    """Return a text as YAML within braces, in quotes where it needs them."""
    plain = _PLAIN.fullmatch(text) and text.lower() not in _WORDS_OF_YAML
    return text if plain else json.dumps(text, ensure_ascii=False)
