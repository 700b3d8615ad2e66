"""Blocks of records that do not repeat: any cut of a motion, large moves included.

What is behind the motors swings at the start of a cut in a way that nobody measured. The prescribed motion begins as if
it hung still and moved along; what that leaves is free swinging of the linear model with motors held, in time
``T(t) = sum_j c_j g_j exp(l_j t)`` with eigenvalues l_j and torques g_j of its modes, and is projected out of each
experiment: two unknowns a mode and experiment that need no prior.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from robid_core.errors import DataRejected
from robid_core.estimation.torque.spectra import friction_spectra, speed_functions
from robid_core.estimation.torque.windowed import WindowedMotion
from robid_core.residual.block import TorqueBlock
from robid_core.residual.impedance import impedance
from robid_core.robot import Robot

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]

LARGE = (
    0.05  # rad on the arm from the middle of a motion to its ends: a linear model in the middle is no start
)


@dataclass(eq=False)
class WindowedBlock(TorqueBlock[WindowedMotion]):
    """Spectra of cuts under a window; their noise is what the robot file tells of its sensors."""

    @classmethod
    def of_record(cls, robot: Robot, motion: WindowedMotion, widths: tuple[float, ...]) -> WindowedBlock:
        """Prepare a block; `widths` are those of the friction functions, rad/s.

        Raises DataRejected where the robot file tells no noise of torque: a single cut cannot show it.
        """
        if not (robot.drives.torque_noise > 0).all():
            raise DataRejected(
                f"{robot.name}: what does not repeat shows no noise, and the robot file tells none; give "
                "sensors: {torque_noise: ...} for every axis"
            )
        laws = tuple(speed_functions(widths))
        middle = 0.5 * (motion.angle.max(axis=(1, 2)) + motion.angle.min(axis=(1, 2)))
        friction = friction_spectra(motion, laws, motion.fine_speed())
        return cls(robot, motion, laws, friction, robot.joint_angle(middle))

    @property
    def moves_far(self) -> bool:
        """Whether the arm leaves what a linear model can tell."""
        joints = self.robot.joint_angle(self.motion.angle)
        return bool((np.abs(joints - self.angle[:, None, None]) > LARGE).any())

    def simulated_torque(self, robot: Robot, final: bool) -> ComplexArray:
        """Spectra of the torque that this motion takes, smooth between samples, (n_config, n_exp, n_bin, n_axis)."""
        run = robot.prescribe(self.motion.motor_motion(robot.step_s))
        return self.motion.spectrum_of(run.torque.reshape(self.motion.angle.shape))

    def ringing(self, robot: Robot) -> ComplexArray:
        """Torques of free swinging, spectra of one real unknown each, shape (n_config, n_bin, n_axis, n_unknown)."""
        n, motion = robot.n_axis, self.motion
        start = robot.joint_angle(motion.angle[:, :, 0].mean(axis=1))
        model = robot.second_order(start)
        mass, damping, stiffness = (
            getattr(model, name)[:, n:, n:] for name in ("mass", "damping", "stiffness")
        )
        count = mass.shape[1]
        top = np.concatenate((np.zeros_like(mass), np.broadcast_to(np.eye(count), mass.shape)), axis=2)
        low = -np.linalg.solve(mass, np.concatenate((stiffness, damping), axis=2))
        value, vector = np.linalg.eig(np.concatenate((top, low), axis=1))
        shape = vector[:, :count]
        rows = [
            np.matmul(getattr(model, name)[:, :n, n:], shape) for name in ("stiffness", "damping", "mass")
        ]
        torque = rows[0] + rows[1] * value[:, None] + rows[2] * value[:, None] ** 2
        time = motion.sample_time_s * np.arange(motion.n_sample)
        decay = np.exp(value[:, None, None, :] * time[:, None])  # (n_config, 1, n_sample, n_mode)
        waves = [motion.held_spectrum(part)[:, 0] for part in (decay.real, decay.imag)]
        # Pairs of conjugates give the same two columns twice: projections do not mind.
        pairs = [
            (waves[0], torque.real, waves[1], -torque.imag),
            (waves[0], torque.imag, waves[1], torque.real),
        ]
        columns = [
            np.einsum("cfm,cam->cfam", cosine, by_cosine) + np.einsum("cfm,cam->cfam", sine, by_sine)
            for cosine, by_cosine, sine, by_sine in pairs
        ]
        return np.concatenate(columns, axis=-1)

    def noise(self, robot: Robot, coefficient: FloatArray) -> ComplexArray:
        """Covariance of the residual from the noise that the robot file tells, shape (n_bin, n_axis, n_axis)."""
        motion, drives = self.motion, robot.drives
        z = impedance(robot, self.angle, motion, "zero_order_hold") * (motion.omega**2)[:, None, None]
        moved = np.einsum("cfab,b,cfdb->fad", z, drives.position_noise**2, z.conj()) / len(z)
        covariance: ComplexArray = (moved + np.diag(drives.torque_noise**2)) / motion.n_sample
        return covariance

    @property
    def noise_freedom(self) -> float:
        """Complex degrees of freedom of the noise at each bin: it is told."""
        return float("inf")
