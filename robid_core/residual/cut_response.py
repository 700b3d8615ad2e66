"""How the torque of a cut changes with the linear model: what changes is filtered first, and windowed afterwards.

On the motion x that a robot makes, a change of its matrices acts as a force does, ``F = dK x + dD x' + dM x''``. Behind
motors that move as measured the rest moves by y, ``M y'' + D y' + K y = -F`` with ``y(0) = y'(0) = 0``, and the torques
of the motors change by their rows of ``F + M y'' + D y' + K y``: the sensitivity equations of the linear model along
the motion. y is the steady answer to the odd continuation of F, less the free vibration that this answer begins with.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import scipy.fft

from robid_core.arrays import ComplexArray, FloatArray
from robid_core.estimation.torque.windowed import WindowedMotion, odd_continuation
from robid_core.mechanics.linearize import SecondOrderModel
from robid_core.residual.free_vibration import vibration_about
from robid_core.robot import Robot

V = TypeVar("V", FloatArray, ComplexArray)

BEYOND = 1.25  # of the highest bin: what moves faster reaches no bin through the window


@dataclass(frozen=True, eq=False)
class CutResponse:
    """The linear model of each configuration, and the motion that its changes act on."""

    motion: WindowedMotion
    model: SecondOrderModel
    omega: FloatArray
    """Of the odd continuation's lines, rad/s, (n_line,)."""
    spectrum: ComplexArray
    """Of all coordinates' odd continuation, unscaled, (n_config, n_exp, n_line, n_coordinate)."""
    first: FloatArray
    """Of the line through first and last sample, from the equilibrium, (n_config, n_exp, 1, n_coordinate)."""
    slope: FloatArray
    """Of that line, likewise."""
    behind: ComplexArray
    """Motion behind the motors for a force there, (n_config, n_line, n_behind, n_behind)."""
    vibration: ComplexArray
    """Torques of unit initial states, (n_config, n_bin, n_axis, 2 n_behind)."""
    time: ComplexArray
    """Spectrum of the time since the first sample, s, (n_bin,)."""

    @classmethod
    def of_motion(
        cls, robot: Robot, angle: FloatArray, motion: WindowedMotion, coordinates: FloatArray
    ) -> CutResponse:
        """Prepare.

        Parameters
        ----------
        robot
            Whose linear model changes.
        angle
            Joint-side, about which it is linear, (n_config, n_axis).
        motion
            Under its window.
        coordinates
            Of the robot in this motion at the samples, (n_config, n_exp, n_sample, n_coordinate).
        """
        n, model = robot.n_axis, robot.second_order(angle)
        odd, first, slope = odd_continuation(coordinates, motion.sample_time_s)
        line = 2 * np.pi / (odd.shape[2] * motion.sample_time_s)
        n_line = min(odd.shape[2] // 2, int(BEYOND * motion.omega.max() / line) + 2)
        omega = line * np.arange(n_line)
        time = motion.sample_time_s * np.arange(motion.n_sample, dtype=np.float64)[None, None, :, None]
        w = omega[:, None, None]
        mass, damping, stiffness = (
            matrix[:, None, n:, n:] for matrix in (model.mass, model.damping, model.stiffness)
        )
        return cls(
            motion,
            model,
            omega,
            scipy.fft.rfft(odd, axis=2)[:, :, :n_line],
            first - robot.equilibrium(angle).position[:, None, None],
            slope,
            np.linalg.inv(stiffness + 1j * w * damping - w**2 * mass),
            vibration_about(robot, angle, motion),
            motion.spectrum_of(time)[0, 0, :, 0],
        )

    def change(self, other: SecondOrderModel) -> ComplexArray:
        """Change of the smooth torques' spectra from this model to another one, to first order of what differs.

        Shape (n_config, n_exp, n_bin, n_axis).
        """
        n, iw, own = self.model.n_axis, 1j * self.omega[:, None], self.model
        stiffness, damping, mass = (
            getattr(other, name) - getattr(own, name) for name in ("stiffness", "damping", "mass")
        )
        force = np.zeros_like(self.spectrum)
        for matrix, factor in ((stiffness, 1.0), (damping, iw), (mass, iw**2)):
            if matrix.any():
                force += factor * _along(matrix, self.spectrum)
        moved = -np.matmul(self.behind[:, None], force[..., n:, None])[..., 0]
        torque = force[..., :n]
        for matrix, factor in ((own.stiffness, 1.0), (own.damping, iw), (own.mass, iw**2)):
            torque = torque + factor * _along(matrix[:, :n, n:], moved)
        n_odd, n_sample = 2 * (self.motion.n_sample - 1), self.motion.n_sample
        steady: FloatArray = scipy.fft.irfft(torque, n=n_odd, axis=2)[:, :, :n_sample]
        begin = [self._at_first(part, n_odd) for part in (moved, iw * moved)]
        of_line, angle, rate = self._of_line(stiffness, damping)
        shown = (self.motion.spectrum_of(steady) + of_line) / self.motion.hold[:, None]
        state = np.concatenate((begin[0] + angle, begin[1] + rate), axis=-1)
        rings: ComplexArray = np.matmul(self.vibration[:, None], state[:, :, None, :, None])[..., 0]
        changed: ComplexArray = shown - rings
        return changed

    @staticmethod
    def _at_first(spectrum: ComplexArray, n: int) -> FloatArray:
        """Value at the first sample, (n_config, n_exp, n_behind)."""
        value: FloatArray = (spectrum[:, :, 0].real + 2 * spectrum[:, :, 1:].sum(axis=2).real) / n
        return value

    def _of_line(
        self, stiffness: FloatArray, damping: FloatArray
    ) -> tuple[ComplexArray, FloatArray, FloatArray]:
        """Torques' spectra that the line through the ends adds, and the state behind the motors that it begins with."""
        n, own, motion = self.model.n_axis, self.model, self.motion
        constant = _along(stiffness, self.first) + _along(damping, self.slope)
        growing = _along(stiffness, self.slope)
        held = np.linalg.inv(own.stiffness[:, n:, n:]).astype(np.float64, copy=False)
        rate = -_along(held, growing[..., n:])
        angle = -_along(held, constant[..., n:] + _along(own.damping[:, n:, n:], rate))
        constant = (
            constant[..., :n] + _along(own.stiffness[:, :n, n:], angle) + _along(own.damping[:, :n, n:], rate)
        )
        growing = growing[..., :n] + _along(own.stiffness[:, :n, n:], rate)
        return (
            motion.constant[:, None] * constant + self.time[:, None] * growing,
            angle[:, :, 0],
            rate[:, :, 0],
        )


def _along(matrix: FloatArray, vectors: V) -> V:
    """Matrices of each configuration times vectors, (n_config, n_exp, n_time, n)."""
    product: V = np.matmul(vectors, matrix.swapaxes(-1, -2)[:, None])
    return product
