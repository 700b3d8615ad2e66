"""Stretches of samples that are marked, one after another without a gap."""

from __future__ import annotations

import numpy as np

from robid_core.arrays import BoolArray


def stretches(marks: BoolArray) -> list[tuple[int, int]]:
    """Return first and stop of every stretch of marks, (n_sample,).

    >>> import numpy as np
    >>> stretches(np.array([True, True, False, True]))
    [(0, 2), (3, 4)]
    """
    edges = np.diff(np.concatenate([[0], marks.astype(int), [0]]))
    return list(zip(np.flatnonzero(edges == 1).tolist(), np.flatnonzero(edges == -1).tolist(), strict=True))
