"""What of a motor's torque is not linear in the motion, at every bin: where friction, ripple and distortion show.

With periodic data ``U(k) = H(k) Y(k) + D(k)`` at each bin k, U the torques, Y the accelerations, H the inverse of the
response and D everything else. H is the least-squares fit of all experiments at each excited line, and interpolated
to the bins between (detection lines), where Y is distortion only, so that an error of H is of second order there.

It offers, for one configuration, experiments of all blocks side by side:

- ``motion_basis(motion, line, bins)``: made once from the accelerations;
- ``basis.relation(signal)``: H of any signal at all bins; of the torques: the inverse of the response;
- ``torque_residual(signal, basis)``: ``D = signal - H motion``.

The residual is *linear in the signal*, projection at the lines included. So it may be taken of regressors too (friction
as a function of the measured speed, ripple as one of the angle), and least squares of ``torque_residual(U)`` on
``torque_residual(X)`` is that of U on X with a free response beside them (Frisch and Waugh 1933).

A regressor must be what the torque meets: where the torque is held from a sample to the next, the *mean* of the
friction or the wave over that step. Friction taken at the sample instants comes half a step early, and leaves
several times as much (`order_analysis.speed_in_steps`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid_core.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from robid_core.errors import PoorExcitation
from robid_core.estimation.response.spectra import CONDITION_LIMIT, factor_inputs


@dataclass(frozen=True, eq=False)
class MotionBasis:
    """Accelerations of all experiments at all bins, and what solves for a response at the excited ones.

    `usable` tells the bins whose residual means something: detection lines, and excited lines at which the
    experiments span all axes. `freedom` counts the complex degrees of freedom that each bin's residual has over the
    experiments: n_exp at a detection line, n_exp - n_axis at an excited one, zero where it is not usable.
    """

    motion: ComplexArray
    """rad/s^2, shape (n_exp, n_bin, n_axis)."""
    excited: BoolArray
    """Shape (n_bin,)."""
    usable: BoolArray
    """Shape (n_bin,)."""
    solver: ComplexArray
    """Y^+ of the usable excited bins, shape (n_good, n_exp, n_axis)."""
    good: IntArray
    """These bins, as indices into the bins, ascending."""
    lower: IntArray
    """For each bin, the last good line at or below it (the first two good lines at the ends), shape (n_bin,)."""
    share: FloatArray
    """How far the bin is on its way from there to the next good line, 0 to 1, shape (n_bin,)."""

    @property
    def freedom(self) -> FloatArray:
        """Degrees of freedom of the residual at each bin, shape (n_bin,)."""
        n_exp, _, n_axis = self.motion.shape
        return np.where(self.usable, n_exp - n_axis * self.excited, 0).astype(np.float64)

    def relation(self, signal: ComplexArray) -> ComplexArray:
        """Linear relation of signals to the motion, ``signal = H motion``, at all bins.

        Parameters
        ----------
        signal
            Spectra at the bins, shape (n_exp, n_bin, n_signal).

        Returns
        -------
        Shape (n_bin, n_signal, n_axis): the least-squares fit at the good lines, straight between them, constant
        beyond. (H belongs to accelerations: at high frequency it tends to the motors' inertia.)
        """
        at_lines: ComplexArray = signal[:, self.good].transpose(1, 2, 0) @ self.solver
        share = self.share[:, None, None]
        result: ComplexArray = (1 - share) * at_lines[self.lower] + share * at_lines[self.lower + 1]
        return result


def motion_basis(
    motion: ComplexArray, line: IntArray, bins: IntArray, condition_limit: float = CONDITION_LIMIT
) -> MotionBasis:
    """Make the basis of one configuration.

    Parameters
    ----------
    motion
        Spectra of the motors' accelerations, shape (n_exp, n_bin, n_axis); experiments of all blocks side by side.
    line
        Excited bins, shape (n_freq,).
    bins
        Bins of `motion`, ascending, shape (n_bin,).
    condition_limit
        An excited line at which the motions have a larger condition number is not used.

    Raises
    ------
    PoorExcitation
        If there are fewer experiments than axes, or fewer than two lines at which they span all axes.
    """
    n_exp, _, n_axis = motion.shape
    if n_exp < n_axis:
        raise PoorExcitation(
            f"{n_exp} experiments in a configuration cannot determine how torque depends on the motion of {n_axis} "
            f"axes; measure at least {n_axis}"
        )
    excited: BoolArray = np.isin(bins, line)
    candidates = np.flatnonzero(excited)
    factors = factor_inputs(motion[:, candidates].transpose(1, 2, 0), condition_limit)
    spans = factors.condition <= condition_limit
    good = candidates[spans].astype(np.int64)
    if len(good) < 2:
        raise PoorExcitation(
            f"at {len(good)} of {len(candidates)} excited lines in the band do the motions of {n_exp} experiments span "
            f"{n_axis} axes; excite every axis, or widen the band"
        )
    usable = ~excited
    usable[good] = n_exp > n_axis
    lower = np.clip(np.searchsorted(good, np.arange(len(bins)), side="right") - 1, 0, len(good) - 2)
    start, end = bins[good[lower]], bins[good[lower + 1]]
    share = np.clip((bins - start) / (end - start), 0.0, 1.0)
    return MotionBasis(motion, excited, usable, factors.inverse[spans], good, lower, share)


def torque_residual(signal: ComplexArray, basis: MotionBasis) -> ComplexArray:
    """Part of signals that is not linear in the motion, ``signal - H motion``.

    Zero, but for rounding, at excited lines with as many experiments as axes.

    Parameters
    ----------
    signal
        Spectra at the bins of the basis, shape (n_exp, n_bin, n_signal): torques, or anything compared with them.

    Returns
    -------
    Shape of `signal`, in its unit.
    """
    relation = basis.relation(signal)
    # One product of matrices a bin: (n_exp, n_axis) (n_axis, n_signal).
    linear = basis.motion.transpose(1, 0, 2) @ relation.swapaxes(-1, -2)
    result: ComplexArray = signal - linear.transpose(1, 0, 2)
    return result
