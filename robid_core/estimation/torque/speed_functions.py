"""Free functions of a motor's speed that together stand for its friction, whatever its shape.

Odd ones ``tanh(v / w)`` and even ones ``tanh^2(v / w)``; widths are dense about the speed at which friction is told to
turn and go up to the speeds that were measured. The told speed may be wrong by a factor of two, friction may fall with
speed (Stribeck) and differ by direction: least squares over the speeds of a multisine on a slow sine then leave in the
median less than 4e-4 of the Coulomb level, and of a fifth between directions 0.5 % (`test_torque_spectra.py`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from robid_core.arrays import FloatArray

NEAR = (0.5, 0.75, 1.1, 1.7)  # of the told speed
NEAR_ALONE = (0.5, 0.7, 1.0, 1.4, 2.0)  # likewise, of Coulomb friction alone
FAR = 5  # widths above, up to TOP
TOP = 2.0  # of the rms speed
LEAST_TOP = 6.0  # of the told speed: for motions that are slower
PART = 4096  # speeds of all axes at once
NEARLY_ALIKE = 1e-6  # sums of functions that differ by less are one
EVEN = 0.6  # of the told speed; two more lie among the far ones


@dataclass(frozen=True, eq=False)
class SpeedFunctions:
    """Widths of the functions of each axis."""

    odd: FloatArray
    """rad/s at the motor, shape (n_odd, n_axis)."""
    even: FloatArray
    """Shape (n_even, n_axis)."""

    @classmethod
    def about(cls, told: FloatArray, rms: FloatArray) -> SpeedFunctions:
        """Choose widths by the speed at which friction is told to turn and the rms speed, rad/s, (n_axis,) each."""
        near = np.multiply.outer(NEAR, told)
        top = np.maximum(TOP * rms, LEAST_TOP * told)
        share = np.arange(1, FAR + 1)[:, None] / FAR
        far = near[-1] * (top / near[-1]) ** share
        return cls(np.concatenate((near, far)), np.stack((EVEN * told, far[1], far[3])))

    @classmethod
    def near(cls, told: FloatArray, shares: Sequence[float] = NEAR_ALONE) -> SpeedFunctions:
        """Return odd functions about the told speed, (n_axis,): Coulomb friction whose zero-speed width is uncertain.

        `shares` of the told speed are their widths; one alone is the friction that a robot file has.
        Between half and twice the told width ``tanh(v / w)`` is a sum of these but for 1 % of its level at Gaussian
        speeds of five widths; other shapes (Stribeck, directions) are not.
        """
        return cls(np.multiply.outer(shares, told), np.zeros((0, len(told))))

    def width_of(self, size: FloatArray, speeds: Sequence[FloatArray]) -> FloatArray:
        """Width of the one ``tanh(v / w)`` that is nearest to a sum of odd functions, rad/s, (n_axis,).

        Parameters
        ----------
        size
            Of the odd functions, (n_odd, n_axis).
        speeds
            Over which they are compared, of each axis, rad/s, (n_sample,) each.
        """
        found = np.empty(size.shape[1])
        for a, own in enumerate(size.T):
            speed = speeds[a]
            total = np.tanh(np.divide.outer(speed, self.odd[:, a])) @ own

            def left(log_width: float, speed: FloatArray = speed, total: FloatArray = total) -> float:
                law = np.tanh(speed / np.exp(log_width))
                return float(total @ total - (law @ total) ** 2 / (law @ law))

            ends = np.log(self.odd[:, a].min() / 2), np.log(self.odd[:, a].max() * 2)
            best = scipy.optimize.minimize_scalar(left, bounds=ends, method="bounded")
            found[a] = float(np.exp(best.x))
        return found

    def meeting(self, others: SpeedFunctions, size: FloatArray, speed: FloatArray) -> FloatArray:
        """Return sizes with which the sum is nearest to that of other functions of sizes (n_law, n_axis), likewise.

        `speed`: over which they are compared, rad/s, (n_sample, n_axis).
        """
        found = np.empty((len(self.odd) + len(self.even), size.shape[1]))
        for a, own in enumerate(size.T):
            mine, theirs = (
                np.stack([law[:, 0] for law in laws.of_axis(a).along(speed[:, a : a + 1])], axis=1)
                for laws in (self, others)
            )
            found[:, a] = np.linalg.lstsq(mine, theirs @ own, rcond=NEARLY_ALIKE)[0]
        return found

    @classmethod
    def of_widths(cls, widths: Sequence[float], n_axis: int) -> SpeedFunctions:
        """Return odd functions of these widths, alike for all axes, and an even one of the middle width."""
        odd = np.repeat(np.array(widths, dtype=np.float64)[:, None], n_axis, axis=1)
        return cls(odd, odd[len(widths) // 2 : len(widths) // 2 + 1])

    @property
    def names(self) -> tuple[str, ...]:
        """Of the functions, in their order, and of the constant torque that stands beside them."""
        odd = (f"odd_{number + 1}" for number in range(len(self.odd)))
        even = (f"even_{number + 1}" for number in range(len(self.even)))
        return (*odd, *even, "constant")

    def of_axis(self, axis: int) -> SpeedFunctions:
        """Return those of one axis."""
        return SpeedFunctions(self.odd[:, axis : axis + 1], self.even[:, axis : axis + 1])

    def along(self, speed: FloatArray) -> Iterator[FloatArray]:
        """Evaluate one after another at speeds, rad/s, shape (..., n_axis), in their precision."""
        squares: dict[int, FloatArray] = {}
        for width in self.odd:
            value = speed / width.astype(speed.dtype)
            np.tanh(value, out=value)
            for number in np.flatnonzero((self.even == width).all(axis=1)).tolist():
                squares[number] = value * value
            yield value
        for number, width in enumerate(self.even):
            yield squares[number] if number in squares else np.tanh(speed / width.astype(speed.dtype)) ** 2

    def braking(self, size: FloatArray, speed: FloatArray) -> FloatArray:
        """Return sizes of the odd functions, none below zero, with which their sum is nearest to that of others.

        Fits of what no friction does make them large against one another; what brakes a motor has no such slopes.

        Parameters
        ----------
        size
            Of the odd functions, N m, (n_odd, n_axis), whose sum is to be met.
        speed
            Where it is to be met, rad/s, (n_sample, n_axis).
        """
        found = np.empty_like(size)
        for a, own in enumerate(size.T):
            values = np.tanh(np.divide.outer(speed[:, a], self.odd[:, a]))
            found[:, a] = own if (own >= 0).all() else scipy.optimize.nnls(values, values @ own)[0]
        return found

    def total(self, speed: FloatArray, size: FloatArray) -> FloatArray:
        """Sum of the odd functions at speeds, N m; arguments as of `total_and_slope`."""
        return self.total_and_slope(speed, size)[0]

    def total_and_slope(self, speed: FloatArray, size: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Sum of the odd functions at speeds, N m, and its derivative by the speed, N m s/rad, in their precision.

        Parameters
        ----------
        speed
            rad/s, shape (..., n_axis), which the results have.
        size
            Of each function, N m, (n_odd, n_axis).
        """
        total, slope = np.zeros_like(speed, order="C"), np.zeros_like(speed, order="C")
        rows = [_rows(speed, of_axes) for of_axes in (1 / self.odd, size, size / self.odd)]
        for part, level, steepness in zip(_parts(speed), _parts(total), _parts(slope), strict=True):
            n = len(part)
            for inverse, height, steepest in zip(*rows, strict=True):
                turned = np.tanh(part * inverse[:n])
                level += height[:n] * turned
                steepness += steepest[:n] * (1 - turned * turned)
        return total, slope


def _parts(values: FloatArray) -> Iterator[FloatArray]:
    """Values one after another, a few at a time: what is computed of them stays in the processor's cache."""
    flat, length = np.ascontiguousarray(values).reshape(-1), PART * values.shape[-1]
    return (flat[first : first + length] for first in range(0, flat.size, length))


def _rows(speed: FloatArray, of_axes: FloatArray) -> FloatArray:
    """Repeat numbers of functions and axes, (n_function, n_axis), along one part of speeds, in their precision."""
    rows = min(PART, max(1, speed.size // speed.shape[-1]))
    return np.tile(of_axes.astype(speed.dtype), (1, rows))
