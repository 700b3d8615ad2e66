"""What columns gain in a residual once everything that was fitted may move with them.

All is in standard deviations. With the fit's derivatives J, precision matrix H (priors in it) and ``Q = J L^-T``, H = L
L^T, a column c gains ``s^2 / S`` of twice the log-likelihood, where ``s = c^T y - (Q^T c)^T (Q^T y - g)`` and ``S = c^T
c - (Q^T c)^T (Q^T c)``; y is the residual and g what the priors pull. Folds are parts of the rows: a fold is held out
by taking its share off every sum, so that nothing is fitted anew.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from robid_core import FloatArray
from robid_diagnosis.sums import SAME, Sums, inverse, solved

Rows = FloatArray
"""Weighted columns, (n_column, n_row)."""

WORTH = 9.0  # what a further column of one candidate must gain


@dataclass(frozen=True, eq=False)
class Gain:
    """Gain of one candidate in twice the log-likelihood, and the sizes of its columns that reach it."""

    total: float
    """Of twice the log-likelihood."""
    chosen: tuple[int, ...]
    """Columns that take part."""
    size: FloatArray
    """Of each of these."""
    error: FloatArray
    """Their standard errors."""
    visible: float
    """Share of the columns' square that the fit's unknowns cannot do, the largest."""

    @property
    def freedom(self) -> int:
        """Number of columns that take part."""
        return len(self.chosen)


NOTHING = Gain(0.0, (), np.empty(0), np.empty(0), 0.0)


class Projection:
    """A fitted problem's derivatives and residual, prepared for columns of candidates."""

    def __init__(
        self,
        rows: FloatArray,
        residual: FloatArray,
        precision: FloatArray,
        pull: FloatArray,
        folds: Sequence[slice],
    ) -> None:
        """Prepare.

        Parameters
        ----------
        rows
            Weighted derivatives, (n_row, n_unknown).
        residual
            Weighted, (n_row,).
        precision
            ``J^T J`` and what the priors add, (n_unknown, n_unknown).
        pull
            Gradient of the priors at the point, (n_unknown,).
        folds
            Rows of each fold.
        """
        scale = np.sqrt(np.diag(precision))
        lower = np.linalg.cholesky(precision / np.outer(scale, scale)) * scale[:, None]
        apart = np.linalg.inv(lower)
        self.fitted: Rows = rows @ apart.T
        self.residual = residual
        self.folds = tuple(folds)
        self.pull: FloatArray = apart @ pull
        self.shares = np.stack([_product(self.fitted[fold].T, self.fitted[fold]) for fold in self.folds])
        self.told = np.stack([_product(self.fitted[fold].T, self.residual[fold]) for fold in self.folds])
        self._told: FloatArray = self.told.sum(axis=0) - self.pull

    def sums(self, columns: Rows) -> Sums:
        """Products of columns (n_column, n_row) with the residual and the fit, fold by fold."""
        parts = [columns[:, fold] for fold in self.folds]
        return Sums(
            self.shares,
            self.told,
            np.stack([_product(self.fitted[f].T, part.T) for f, part in zip(self.folds, parts, strict=True)]),
            np.stack([_product(part, part.T) for part in parts]),
            np.stack([_product(part, self.residual[f]) for f, part in zip(self.folds, parts, strict=True)]),
        )

    def normal(self, sums: Sums) -> tuple[FloatArray, FloatArray]:
        """Normal equations of columns with the fit projected out, (n, n) and (n,)."""
        cross = sums.cross.sum(axis=0)
        matrix = sums.own.sum(axis=0) - cross.T @ cross
        return matrix, sums.slope.sum(axis=0) - cross.T @ self._told

    def gain(self, sums: Sums, positive: Sequence[bool], blind: float, together: bool = False) -> Gain:
        """What columns gain.

        Parameters
        ----------
        sums
            Of the columns.
        positive
            Which sizes must not be negative.
        blind
            Share of a column's square: where less is left, the fit's own unknowns can do the same.
        together
            Whether all take part, as sine and cosine do; else only those that are worth it.
        """
        matrix, slope = self.normal(sums)
        square = np.diag(sums.own.sum(axis=0))
        visible = np.diag(matrix) / np.maximum(square, 1e-300)
        left = [i for i in range(len(slope)) if square[i] > 0 and visible[i] > blind]
        best, chosen, size = 0.0, list[int](), np.empty(0)
        if together and left:
            size = solved(matrix[np.ix_(left, left)], slope[left])
            best, chosen, left = float(size @ slope[left]), left, []
        while left:
            trials = []
            for i in left:
                if i in chosen or _own_share(matrix, chosen, i) < blind * square[i]:
                    continue
                members, found = _not_negative([*chosen, i], matrix, slope, positive)
                if i in members:
                    trials.append((float(found @ slope[members]), members, found))
            if not trials:
                break
            total, members, found = max(trials, key=lambda trial: trial[0])
            if chosen and total < best + WORTH:
                break
            best, chosen, size = total, members, found
        if not chosen:
            return NOTHING
        inside = matrix[np.ix_(chosen, chosen)]
        error = np.sqrt(np.abs(np.diag(inverse(inside))))
        return Gain(best, tuple(chosen), size, error, float(visible[chosen].max()))

    def held_out(self, sums: Sums, gain: Gain, groups: Sequence[Sequence[int]]) -> FloatArray:
        """What the columns gain in each group of folds with sizes that the other folds tell, (n_group,).

        Each model about its own optimum; a size that the others do not show is pulled to zero.
        """
        some = sums.of_columns(gain.chosen)
        whole, none = self._whole(some), np.zeros(gain.freedom)
        pull = 1 / np.maximum(gain.size**2, 1e-300)
        found = []
        for group in groups:
            part = some.over(group)
            rest = whole.less(part)
            without = np.asarray(np.linalg.solve(rest.shares, rest.told), dtype=np.float64)
            found.append(part.left(without, none) - part.left(*rest.solved(pull)))
        return np.array(found)

    def by_group(self, sums: Sums, gain: Gain, groups: Sequence[Sequence[int]]) -> FloatArray:
        """What the columns gain in each group of folds with the sizes that all tell, (n_group,)."""
        some = sums.of_columns(gain.chosen)
        whole, none = self._whole(some), np.zeros(gain.freedom)
        unknown, size = whole.solved()
        parts = (some.over(group) for group in groups)
        return np.array([part.left(whole.told, none) - part.left(unknown, size) for part in parts])

    def by_own_size(self, sums: Sums, gain: Gain, groups: Sequence[Sequence[int]]) -> FloatArray:
        """What columns gain in each group by sizes of its own, beside sizes of their own in all others, (n_group,).

        The fit's unknowns are those that suit all groups with these; nothing is gained where the columns do not act.
        """
        matrix, slope = self._own_sizes(sums, gain, groups)
        n, found, every = gain.freedom, [], np.arange(len(slope))
        for first in range(0, len(slope), n):
            own, rest = every[first : first + n], np.delete(every, slice(first, first + n))
            between, others = matrix[np.ix_(own, rest)], matrix[np.ix_(rest, rest)]
            taken = np.stack([solved(others, one) for one in between], axis=1)
            left = slope[own] - taken.T @ slope[rest]
            found.append(left @ solved(matrix[np.ix_(own, own)] - between @ taken, left))
        return np.array(found)

    def concentration(self, sums: Sums, gain: Gain, groups: Sequence[Sequence[int]]) -> float:
        """Share of the squared columns, with the sizes that all tell, in the group that has most of it."""
        some = sums.of_columns(gain.chosen)
        each = np.array([gain.size @ some.over(group).own @ gain.size for group in groups])
        return float(each.max() / each.sum())

    def disagreement(self, sums: Sums, gain: Gain, groups: Sequence[Sequence[int]]) -> tuple[float, int]:
        """What sizes of its own in each group gain beyond common ones: chi-square by chance, of so many degrees."""
        matrix, slope = self._own_sizes(sums, gain, groups)
        acts = np.diag(matrix) > SAME * np.diag(matrix).max()
        together, both = self.normal(sums.of_columns(gain.chosen))
        beyond = slope @ solved(matrix, slope) - both @ solved(together, both)
        return float(beyond), int(acts.sum()) - gain.freedom

    def _own_sizes(
        self, sums: Sums, gain: Gain, groups: Sequence[Sequence[int]]
    ) -> tuple[FloatArray, FloatArray]:
        """Normal equations of the columns of each group, zero elsewhere, with the fit projected out."""
        some = sums.of_columns(gain.chosen)
        parts, whole = [some.over(group) for group in groups], self._whole(some)
        cross = np.concatenate([part.cross for part in parts], axis=1)
        matrix = scipy.linalg.block_diag(*(part.own for part in parts)) - cross.T @ cross
        return matrix, np.concatenate([part.slope for part in parts]) - cross.T @ whole.told

    def _whole(self, sums: Sums) -> Sums:
        """Sums over all rows, with the priors: what the fit has is orthonormal with them."""
        whole = sums.over(range(len(self.folds)))
        return Sums(np.eye(len(self.pull)), whole.told - self.pull, whole.cross, whole.own, whole.slope)


def _not_negative(
    members: list[int], matrix: FloatArray, slope: FloatArray, positive: Sequence[bool]
) -> tuple[list[int], FloatArray]:
    """Members of which none that must not be negative is, and their sizes: whoever would be most goes, one by one."""
    while members:
        size = solved(matrix[np.ix_(members, members)], slope[members])
        bound = np.where([positive[i] for i in members], size, 0.0)
        if (bound >= 0).all():
            return members, size
        members = [i for i in members if i != members[int(bound.argmin())]]
    return members, np.empty(0)


def _own_share(matrix: FloatArray, chosen: Sequence[int], i: int) -> float:
    """What is left of a column's square when some others are projected out, too."""
    among = list(chosen)
    if not among:
        return float(matrix[i, i])
    taken = solved(matrix[np.ix_(among, among)], matrix[among, i])
    return float(matrix[i, i] - matrix[among, i] @ taken)


def _product(left: Rows, right: Rows) -> FloatArray:
    product: FloatArray = left @ right
    return product
