"""An accelerometer and a gyroscope on a body of a chain: what they show of its motion.

An accelerometer shows ``R^T (p'' - g)``, with p its place, R its axes in the world and g gravity; a gyroscope
``R^T w``, with w the turning of the body (Jacobians: B. Siciliano and others, Robotics: Modelling, Planning and
Control, 2009, chapter 3).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from robid_core.arrays import ComplexArray, FloatArray
from robid_core.mechanics.chain import Chain
from robid_core.mechanics.tool import pose_of


@dataclass(frozen=True, eq=False)
class InertialSensor:
    """Where an accelerometer and a gyroscope are mounted."""

    body: str
    """Joint that carries the body."""
    point: FloatArray
    """In the body's frame, m, (3,)."""
    axes: FloatArray
    """Axes of the sensor in the body's frame as columns, (3, 3)."""

    def shown(
        self, chain: Chain, joint: FloatArray, rate: Callable[[FloatArray], FloatArray]
    ) -> tuple[FloatArray, FloatArray]:
        """Acceleration without gravity, m/s^2, and rate of turn, rad/s, in the sensor's axes, (n_time, ..., 3) each.

        Parameters
        ----------
        chain
            The mechanism.
        joint
            Joint coordinates over time, (n_time, ..., n_joint).
        rate
            Differentiates with respect to time, along the first axis.
        """
        pose = pose_of(chain, joint, self.body, self.point)
        axes = pose.rotation @ self.axes
        force = rate(rate(pose.position)) - chain.gravity
        turning = (pose.jacobian[..., :3, :] @ rate(joint)[..., None])[..., 0]
        return _in_axes(axes, force), _in_axes(axes, turning)

    def linear(self, chain: Chain, joint: FloatArray, omega: FloatArray) -> ComplexArray:
        """What both show per small motion of the joints about rest, (n_config, n_omega, 6, n_joint).

        With Jacobians J of the place and W of the turning ``R^T (-w^2 J - g x W)`` and ``R^T i w W``: where the
        sensor is tilted it shows another part of gravity.

        Parameters
        ----------
        chain
            The mechanism.
        joint
            Joint coordinates at rest, (n_config, n_joint).
        omega
            rad/s, (n_omega,).
        """
        pose = pose_of(chain, joint, self.body, self.point)
        turning, moving = pose.jacobian[:, None, :3], pose.jacobian[:, None, 3:]
        tilted = np.cross(chain.gravity, turning, axisb=-2, axisc=-2)
        w = omega[:, None, None]
        unturned = np.swapaxes(pose.rotation @ self.axes, -1, -2)[:, None]
        shown: ComplexArray = np.concatenate(
            (unturned @ (-(w**2) * moving - tilted), unturned @ (1j * w * turning)), axis=-2
        )
        return shown


def _in_axes(axes: FloatArray, vector: FloatArray) -> FloatArray:
    """Components of vectors along the columns of matrices."""
    found: FloatArray = np.einsum("...ji,...j->...i", axes, vector)
    return found
