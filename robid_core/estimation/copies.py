"""Fingerprints of experiments: two that are alike to the last digit are copies, since noise does not repeat."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence

import numpy as np

from robid_core.artifacts import DenseRun, Record
from robid_core.errors import DataRejected

CHANNELS = ("motor_position", "motor_torque")


def fingerprints(run: DenseRun) -> Iterator[tuple[tuple[int, int, int], bytes]]:
    """Yield (configuration, block, experiment) of each experiment with the hash of its motor angles and torques.

    Left out are experiments whose torque never changes, and runs without a channel.
    """
    if any(name not in run.channels for name in CHANNELS):
        return
    position, torque = (run.values(name) for name in CHANNELS)
    for c, b, e in np.ndindex(*torque.shape[:3]):
        known = torque[c, b, e][np.isfinite(torque[c, b, e])]
        if len(known) and np.ptp(known) > 0:
            # -0.0 is 0.0: a table that a program has written again
            own = (np.ascontiguousarray(values[c, b, e] + 0.0).tobytes() for values in (position, torque))
            yield (c, b, e), hashlib.sha256(b"".join(own)).digest()


def refuse_copies(records: Sequence[Record]) -> None:
    """Refuse records in which two experiments hold the same samples to the last digit (DataRejected).

    One that a program hands over twice is no other one; that is for it to know.
    """
    seen = dict[bytes, str]()
    for number, record in enumerate({id(one): one for one in records}.values(), start=1):
        for run in record.runs:
            for (c, b, e), mark in fingerprints(run):
                place = f"experiment {e + 1} of block {b + 1}, configuration {c + 1}"
                name = f"{place}, of {record.source} (record {number})"
                if mark in seen:
                    raise DataRejected(
                        f"{name} holds the samples of {seen[mark]} to the last digit: noise does not repeat, and a "
                        "copy counts it twice; leave one out"
                    )
                seen[mark] = name
