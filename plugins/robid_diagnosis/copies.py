"""Experiments that are copies of one another: what is noise in them counts twice, and looks like a cause."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence

import numpy as np

from robid_core import DataRejected, Record

CHANNELS = ("motor_position", "motor_torque")


def refuse_copies(records: Sequence[Record]) -> None:
    """Refuse records in which two experiments hold the same samples to the last digit (DataRejected).

    One that a program hands over twice is no other one; that is for it to know.
    """
    seen = dict[bytes, str]()
    for number, record in enumerate({id(one): one for one in records}.values(), start=1):
        for run in record.runs:
            if any(name not in run.channels for name in CHANNELS):
                continue
            signals = [run.values(name) for name in CHANNELS]
            for place in np.ndindex(*signals[0].shape[:3]):
                own = [np.ascontiguousarray(one[place]).tobytes() for one in signals]
                digest = hashlib.sha256(b"".join(own)).digest()
                configuration, block, experiment = (i + 1 for i in place)
                name = f"experiment {experiment} of block {block}, configuration {configuration}, of {record.source}"
                if digest in seen:
                    raise DataRejected(
                        f"{name} (record {number}) holds the samples of {seen[digest]} to the last digit: noise does "
                        "not repeat, and that of a copy would look like a cause; leave one out"
                    )
                seen[digest] = f"{name} (record {number})"
