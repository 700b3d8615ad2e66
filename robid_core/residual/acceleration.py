"""Acceleration of a fixed-point iteration by what its last steps showed of it.

The next point is the combination of the last results whose moves cancel best, in the metric of the Gauss-Newton matrix:
a move counts by what it changes of the cost. Source: D. G. Anderson, Iterative procedures for nonlinear integral
equations, J. ACM 12, 1965; H. F. Walker, P. Ni, Anderson acceleration for fixed-point iterations, SIAM J. Numer. Anal.
49, 2011.
"""

from __future__ import annotations

import numpy as np

from robid_core.arrays import FloatArray

SMALLEST = 1e-3  # of the largest singular value of the moves: what lies below is noise of the inner minimum


class History:
    """The last steps of the iteration: points that went in and points that came out."""

    def __init__(self, memory: int) -> None:
        self.memory = memory
        self.entered: list[FloatArray] = []
        self.left: list[FloatArray] = []

    def add(self, entered: FloatArray, left: FloatArray) -> None:
        """Take note of a step; points have shape (n,)."""
        self.entered, self.left = [*self.entered, entered][-self.memory :], [*self.left, left][-self.memory :]

    def next_point(self, metric: FloatArray) -> FloatArray:
        """Where to go on, shape (n,); `metric` is the Gauss-Newton matrix, (n, n)."""
        if len(self.left) < 2:
            return self.left[-1]
        root = np.linalg.cholesky(metric).T
        moves = (np.stack(self.left) - np.stack(self.entered)) @ root.T
        share = np.linalg.lstsq(np.diff(moves, axis=0).T, moves[-1], rcond=SMALLEST)[0]
        result: FloatArray = self.left[-1] - share @ np.diff(np.stack(self.left), axis=0)
        return result

    def contraction(self, metric: FloatArray) -> float:
        """What the iteration left of the difference between its last two points; NaN before there are two."""
        if len(self.left) < 2:
            return float("nan")
        root = np.linalg.cholesky(metric).T
        before, after = (np.linalg.norm(root @ (pair[-1] - pair[-2])) for pair in (self.entered, self.left))
        return float(after / before) if before > 0 else float("nan")
