"""Weights of the torque residual: covariances between axes, averaged over poses and experiments, smooth over bins."""

from __future__ import annotations

from typing import TypeVar

import numpy as np

from robid_core.arrays import BoolArray, ComplexArray, FloatArray

T = TypeVar("T", FloatArray, ComplexArray)

HALF_WINDOW = 8  # bins on either side
SMALLEST = 1e-12  # of the largest variance; keeps a bin without noise from being singular


def covariance_of(residual: ComplexArray, freedom: float | None = None) -> ComplexArray:
    """Covariance of residuals at each bin, smoothed over neighbouring bins, shape (n_bin, n_axis, n_axis).

    Parameters
    ----------
    residual
        Shape (..., n_bin, n_axis); the leading axes are averaged over.
    freedom
        What the sum is divided by; the number of leading entries where left out.

    The zero bin stands alone: there the residual is real, and its variance is that of its lowest neighbours.
    """
    rows = residual.reshape(-1, *residual.shape[-2:])
    total = np.einsum("xfa,xfb->fab", rows, rows.conj()) / (len(rows) if freedom is None else freedom)
    smooth: ComplexArray = np.empty_like(total)
    smooth[1:] = running_mean(total[1:])
    smooth[0] = smooth[1 : 2 + HALF_WINDOW].mean(axis=0).real
    return smooth


def covariance_apart(residual: ComplexArray, excited: BoolArray) -> ComplexArray:
    """Likewise, lines smoothed over neighbouring lines and other bins over other bins: a model errs differently there.

    `excited` tells the lines, shape (n_bin,); the first bin is none.
    """
    found: ComplexArray = np.empty((*residual.shape[-2:], residual.shape[-1]), dtype=np.complex128)
    found[~excited] = covariance_of(residual[..., ~excited, :])
    if excited.any():
        lines = residual[..., excited, :]
        found[excited] = covariance_of(np.concatenate((lines[..., :1, :], lines), axis=-2))[1:]
    return found


def running_mean(values: T) -> T:
    """Mean over HALF_WINDOW bins on either side, fewer at the ends; bins are the first axis.

    Every sum is taken anew: a difference of running totals loses what is a millionth of a millionth of the first bins,
    as noise of angles is of a motion's low frequencies.
    """
    n = len(values)
    total, count = np.zeros_like(values), np.zeros(n)
    reach = min(HALF_WINDOW, n - 1)
    for shift in range(-reach, reach + 1):
        own, other = slice(max(-shift, 0), n - max(shift, 0)), slice(max(shift, 0), n - max(-shift, 0))
        total[own] += values[other]
        count[own] += 1
    mean: T = total / count.reshape(-1, *(1 for _ in values.shape[1:]))
    return mean


def whitener(covariance: ComplexArray) -> ComplexArray:
    """Inverse Cholesky factors L^-1 with C = L L^H, shape of the covariance; ones where nothing varies."""
    n = covariance.shape[-1]
    floor = SMALLEST * np.einsum("faa->f", covariance).real.max()
    if floor == 0:
        return np.tile(np.eye(n, dtype=np.complex128), (len(covariance), 1, 1))
    lower: ComplexArray = np.linalg.cholesky(covariance + floor * np.eye(n))
    factor: ComplexArray = np.linalg.inv(lower).astype(np.complex128)
    return factor
