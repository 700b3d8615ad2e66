"""Degrees of freedom behind each entry of a table of misfits: how far chance alone lets it be from one.

A bin of one axis is a complex number, two degrees of freedom; what was fitted takes a share of each (`block.share`).
Where the noise is estimated from periods, the ratio of both powers has an F distribution in place of chi-square: its
relative variance is ``m / (m - 2)`` times as large for a noise of 2 m degrees of freedom, and the entry counts as one
of so many fewer.
"""

from __future__ import annotations

import numpy as np

from robid_core.artifacts import MisfitTable
from robid_core.residual.problem import TorqueProblem


def with_freedom(table: MisfitTable, problem: TorqueProblem) -> MisfitTable:
    """Return the table of a problem's misfit with the degrees of freedom of each entry, zero where it has no bin."""
    edges = table.band_edges_hz
    n_band = len(edges) - 1
    freedom = np.zeros((2, len(table.axis_names), n_band))
    for block in problem.blocks:
        used = np.ones(block.measured.shape[:2], dtype=bool) if block.used is None else block.used
        share, of_noise = block.share[used].sum(axis=0), block.noise_freedom
        fewer = 1.0 if not np.isfinite(of_noise) else max(of_noise - 2.0, 0.0) / of_noise
        band = np.searchsorted(edges, block.motion.frequency_hz, side="right") - 1
        for which, bins in enumerate((block.motion.excited, ~block.motion.excited)):
            for b in range(n_band):
                chosen = bins & (band == b) & (block.motion.bin > 0)
                freedom[which, :, b] += 2 * fewer * share[chosen].sum(axis=0)
    return table.replace(line_freedom=freedom[0], other_freedom=freedom[1])
