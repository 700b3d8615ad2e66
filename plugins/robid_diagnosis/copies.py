"""Experiments that are copies of one another: what is noise in them counts twice, and looks like a cause."""

from __future__ import annotations

from collections.abc import Sequence

from robid_core import DataRejected, Record
from robid_core.estimation.copies import fingerprints


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
                        f"{name} holds the samples of {seen[mark]} to the last digit: noise does not repeat, and that "
                        "of a copy would look like a cause; leave one out"
                    )
                seen[mark] = name
