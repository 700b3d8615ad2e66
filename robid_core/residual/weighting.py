"""Weights of a block: residuals and derivatives in standard deviations, free vibration projected out."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from robid_core.arrays import ComplexArray, FloatArray
from robid_core.residual.moving_samples import MovingSamples

INDEPENDENT = 1e-9  # of the largest singular value: columns below it are those of other modes again


@dataclass(frozen=True, eq=False)
class Weighting:
    """Whitening matrices of each bin, and for each experiment an orthonormal basis of its free vibration."""

    matrix: ComplexArray
    """By how often a bin counts, shape (n_bin, n_row, n_row)."""
    free_vibration: tuple[tuple[FloatArray, ...], ...] = ()
    """Of each configuration and experiment, (n_row, n_state), n_row = 2 n_bin n_axis; empty where motions repeat."""
    used: npt.NDArray[np.bool_] | None = None
    """Experiments that count, (n_config, n_exp); the rows of others are zero. None: all do."""
    moving: MovingSamples | None = None
    """Samples that count; None: all do."""

    @classmethod
    def of_block(
        cls,
        matrix: ComplexArray,
        free_vibration: ComplexArray | None,
        used: npt.NDArray[np.bool_] | None = None,
        moving: MovingSamples | None = None,
    ) -> Weighting:
        """Weights with whitening matrices and the torques of free vibration.

        `free_vibration` has shape (n_config, n_exp, n_bin, n_axis, n_state).
        """
        if free_vibration is None:
            return cls(matrix, used=used, moving=moving)
        if moving is not None:
            free_vibration = moving.of(free_vibration)
        bases = tuple(tuple(_basis(matrix, one) for one in own) for own in free_vibration)
        return cls(matrix, bases, used, moving)

    def residual(self, residual: ComplexArray) -> FloatArray:
        """Weighted residual of (n_config, n_exp, n_bin, n_axis), shape (n_config, n_exp, n_row)."""
        n_config, n_exp, n_bin, n_row = residual.shape
        if self.moving is not None:
            residual = self.moving.of(residual)
        of_bin = np.moveaxis(residual, 2, 0).reshape(n_bin, -1, n_row) @ self.matrix.swapaxes(1, 2)
        white = np.moveaxis(of_bin.reshape(n_bin, n_config, n_exp, -1), 0, 2)
        rows = np.concatenate((white.real, white.imag), axis=2).reshape(*white.shape[:2], -1)
        for own, bases in zip(rows, self.free_vibration, strict=False):
            for one, basis in zip(own, bases, strict=True):
                one -= basis @ (basis.T @ one)
        if self.used is not None:
            rows[~self.used] = 0.0
        return rows

    def columns(self, config: int, runs: Iterable[ComplexArray]) -> FloatArray:
        """Weighted derivatives, shape (n_exp n_row, n_unknown).

        `runs` have shape (n_bin, n_exp, n_axis, n_unknown), some bins after the others.
        """
        n_bin, first = len(self.matrix), 0
        rows = np.empty(0)
        if self.moving is not None:
            whole = np.concatenate(list(runs)).transpose(1, 0, 2, 3)[None]
            runs = [self.moving.at(config).of(whole)[0].transpose(1, 0, 2, 3)]
        for columns in runs:
            n_exp, n_axis, n_unknown = columns.shape[1:]
            if not first:
                rows = np.empty((n_exp, 2, n_bin, n_axis, n_unknown))
            bins = slice(first, first + len(columns))
            white = np.matmul(self.matrix[bins, None], columns).transpose(1, 0, 2, 3)
            rows[:, 0, bins], rows[:, 1, bins] = white.real, white.imag
            first = bins.stop
        if self.free_vibration:
            for own, basis in zip(
                rows.reshape(n_exp, -1, n_unknown), self.free_vibration[config], strict=True
            ):
                own -= basis @ (basis.T @ own)
        if self.used is not None:
            rows[~self.used[config]] = 0.0
        return rows.reshape(-1, n_unknown)

    def count(self, rows: FloatArray) -> float:
        """How many of the weighted residuals (n_config, n_exp, n_row) count."""
        share = np.ones(rows.shape[:2]) if self.moving is None else self.moving.share.mean(axis=(2, 3))
        return float((share if self.used is None else share[self.used]).sum() * rows.shape[2])


def _basis(matrix: ComplexArray, free_vibration: ComplexArray) -> FloatArray:
    """Orthonormal basis of weighted torques (n_bin, n_axis, n_state), shape (2 n_bin n_axis, n_independent)."""
    white = np.matmul(matrix, free_vibration)
    rows = np.concatenate((white.real, white.imag)).reshape(-1, free_vibration.shape[-1])
    norm = np.linalg.norm(rows, axis=0)  # none where all axes rest
    left, size, _ = np.linalg.svd(rows / np.where(norm > 0, norm, 1.0), full_matrices=False)
    return np.ascontiguousarray(left[:, size > INDEPENDENT * size[0]])
