"""Fingerprints of experiments: two that are alike to the last digit are copies, since noise does not repeat."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence

import numpy as np

from robid_core.arrays import FloatArray
from robid_core.artifacts import DenseRun, Record
from robid_core.errors import DataRejected

PROBES = (0.2, 0.4, 0.6, 0.8)  # of an experiment
WINDOW = 64  # samples
Place = tuple[int, int, int]
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


def overlaps(run: DenseRun) -> Iterator[tuple[Place, Place, int]]:
    """Yield experiments of which another one holds a part, moved: (experiment, the other, samples it is moved by).

    At four places of each experiment a window of samples is looked for in the others, to the last digit; two found
    with the same move are a part. Left out are windows in which a torque hardly changes.
    """
    if any(name not in run.channels for name in CHANNELS):
        return
    rows = {
        place: np.concatenate(
            [run.values(name)[place].reshape(-1, run.values(name).shape[-1]) for name in CHANNELS], axis=1
        )
        for place in np.ndindex(*run.values("motor_torque").shape[:3])
    }
    keys = {place: own @ np.sqrt(np.arange(2.0, 2.0 + own.shape[1])) for place, own in rows.items()}
    for place, own in rows.items():
        starts = [int(share * len(own)) for share in PROBES]
        windows = [(start, own[start : start + WINDOW]) for start in starts if start + WINDOW <= len(own)]
        windows = [(start, window) for start, window in windows if _changes(window)]
        for other, its in rows.items():
            if other <= place:
                continue
            moves = [
                int(hit) - start
                for start, window in windows
                for hit in np.flatnonzero(keys[other] == keys[place][start])
                if hit != start and np.array_equal(its[hit : hit + WINDOW], window)
            ]
            found = next((move for move in moves if moves.count(move) > 1), None)
            if found is not None:
                yield place, other, found


def _changes(window: FloatArray) -> bool:
    """Whether every column of a window is known, and torques have many values."""
    torques = window[:, window.shape[1] // 2 :]
    return bool(np.isfinite(window).all()) and max(len(np.unique(one)) for one in torques.T) > WINDOW // 2


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
