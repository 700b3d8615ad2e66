"""What a record is held against before anything is estimated from it: refused, or warned of, in plain words."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from robid_acquisition.agreement_of_channels import (
    dead_in_some,
    dead_torques,
    doubts_of_channels,
    empty_channels,
)
from robid_acquisition.coarse_angles import rounded_angles
from robid_acquisition.lags import doubts_of_timing
from robid_acquisition.odd_experiments import Place, copies_in, odd_experiments, parts_in
from robid_acquisition.plausible import (
    doubts_of_angle,
    doubts_of_offset,
    doubts_of_scale,
    sentence,
    slips_of,
    unsigned_torques,
)
from robid_acquisition.suspect_signals import doubts_of_limits, refuse_jumps
from robid_core import DataRejected, Record, Robot, other_sampling

MOST = 3  # objections of one kind that are told
MEND = "mend the channel map, or the robot file where that is wrong"


@dataclass(frozen=True)
class _Objections:
    """Where objections go."""

    log: logging.Logger
    refuse: bool
    source: str

    def object(self, words: str) -> None:
        """Refuse a record, or warn of what speaks against it."""
        if self.refuse:
            raise DataRejected(f"{self.source}: {words}; plausibility: warn takes the record as it is")
        self.warn(words)

    def warn(self, *words: str) -> None:
        """Say what the record may be used with."""
        for text in words:
            self.log.warning("%s", text)


def check_record(
    record: Record,
    robot: Robot,
    log: logging.Logger,
    mode: Literal["refuse", "warn", "ignore"],
    source: str,
    names: Mapping[Place, str],
    low_pass_hz: float | None = None,
) -> None:
    """Refuse a record that a slip in the channel map, or in the robot file, explains; or warn of it.

    Parameters
    ----------
    record, robot
        What was recorded, and the robot as its file says it is.
    log
        Of warnings.
    mode
        Whether what speaks against a record is refused, warned of, or not looked for.
    source
        Of the record, for messages.
    names
        Of its experiments by their places, where they were read from recordings of others.
    low_pass_hz
        Edge of the filter behind which all channels were read; None where there was none.

    Raises
    ------
    DataRejected
        With what the record looks like, and what to write.
    """
    if mode == "ignore":
        return
    tell = _Objections(log, mode == "refuse", source)
    if tell.refuse:
        refuse_jumps(record)
    if copies := copies_in(record, names):
        tell.object(f"{_listed(copies)}; leave copies out, they would count as measurements of their own")
    if parts := parts_in(record, names):
        tell.object(
            f"{_listed(parts)}; cut one (start_s, stop_s), or leave it out: what both have counts twice"
        )
    if dead := [*dead_torques(record)] or [*dead_in_some(record, names)]:
        tell.object(f"{_listed(dead)}; look at its column and its unit, or leave the recording out")
        return
    if empty := list(empty_channels(record)):
        tell.warn(*empty)
        return
    tell.warn(*doubts_of_limits(record), *doubts_of_channels(record, robot, low_pass_hz))
    if slips := slips_of(record, robot):
        tell.object(f"{sentence(slips)}; {MEND}")
        return
    if other := other_sampling(record.runs[0].sample_time_s, robot):
        tell.warn(
            f"{other} (0.001 where it states none): torque fits, diagnoses and predictions refuse it else"
        )
    tell.warn(*rounded_angles(record, robot))
    if unsigned := unsigned_torques(record, robot):
        tell.object(f"{_listed(unsigned)}; read the signed torque or current")
        return
    odd = list(odd_experiments(record, robot, names))
    if wrong := [one.words for one in odd if one.is_slip]:
        tell.object(f"{_listed(wrong)}; a channel map holds for all files: mend that one, or leave it out")
        return
    of_values = (
        [one.words for one in odd]
        or doubts_of_angle(record, robot)
        or doubts_of_scale(record, robot)
        or doubts_of_offset(record, robot)
    )
    tell.warn(*of_values, *doubts_of_timing(record, robot))


def _listed(words: list[str]) -> str:
    """Return the first few of many."""
    more = f"; and {len(words) - MOST} more" if len(words) > MOST else ""
    return "; ".join(words[:MOST]) + more
