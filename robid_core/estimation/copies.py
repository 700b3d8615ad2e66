"""Fingerprints of experiments: two that are alike to the last digit are copies, since noise does not repeat."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator

import numpy as np

from robid_core.artifacts import DenseRun

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
            own = (np.ascontiguousarray(values[c, b, e]).tobytes() for values in (position, torque))
            yield (c, b, e), hashlib.sha256(b"".join(own)).digest()
