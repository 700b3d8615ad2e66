"""A plant known in closed form, and records of it that are exact but for the noise that is asked for.

Masses, springs and dampers: ``M a + D v + K x = B torque``, so ``G = (i w)^2 (K + i w D - w^2 M)^-1 B`` from torque
to acceleration, which is not symmetric. It is measured under control, ``u = d(r) - F y`` with the noise of y in the
loop, by a controller of speed or by that of a robot. A record is made in the frequency domain at the excited lines
and turned into samples: it is periodic, in steady state, and has energy at no other line.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid_core.arrays import ComplexArray, FloatArray
from robid_core.artifacts import Record
from robid_core.artifacts.dense_run import Channel, DenseRun
from robid_core.artifacts.record import MOTOR_POSITION, MOTOR_TORQUE, SPEED_REFERENCE
from robid_core.estimation.response.controller import controller_response, feedback_from_acceleration
from robid_core.robot import Robot

N_SAMPLE = 1000
SAMPLE_TIME_S = 0.001
LINES = np.arange(21, 80, 2, dtype=np.int64)  # odd bins of one second: 21 to 79 Hz
LOOP_GAIN = 0.5  # of the controller of speed where the plant answers most: noise comes back at most doubled


@dataclass(frozen=True)
class MassSpringPlant:
    """Coupled masses on springs; all of shape (n_axis, n_axis), all but `input` symmetric."""

    mass: FloatArray
    damping: FloatArray
    stiffness: FloatArray
    input: FloatArray

    @classmethod
    def of(cls, n_axis: int) -> MassSpringPlant:
        """Return a plant whose resonances (damping ratio 5 to 12 %) lie between 30 and 60 Hz."""
        generator = np.random.default_rng(n_axis)
        root = np.eye(n_axis) + 0.15 * generator.normal(size=(n_axis, n_axis))
        omega = 2 * np.pi * np.linspace(30, 60, n_axis)
        ratio = np.linspace(0.05, 0.12, n_axis)
        # Modal form: M = R^T R, K = R^T diag(w^2) R, D = R^T diag(2 z w) R.
        mass, damping, stiffness = (
            root.T @ np.diag(d) @ root for d in (np.ones(n_axis), 2 * ratio * omega, omega**2)
        )
        return cls(mass, damping, stiffness, np.eye(n_axis) + 0.4 * np.eye(n_axis, k=1))

    @property
    def n_axis(self) -> int:
        """Number of masses."""
        return len(self.mass)

    def response(self, frequency_hz: FloatArray) -> ComplexArray:
        """Response from torque to acceleration, shape (n_freq, n_axis, n_axis)."""
        s = 2j * np.pi * frequency_hz[:, None, None]
        dynamic = np.linalg.inv(self.mass * s**2 + self.damping * s + self.stiffness)
        return np.asarray(s**2 * dynamic @ self.input, dtype=np.complex128)


def plant_record(
    plant: MassSpringPlant,
    *,
    n_config: int = 2,
    n_block: int = 2,
    n_period: int = 3,
    noise: float = 0.0,
    seed: int = 0,
    robot: Robot | None = None,
) -> Record:
    """Return a record of a plant in closed loop, its torque a full random orthogonal multisine but for the noise.

    Parameters
    ----------
    plant
        The plant, the same in every configuration.
    n_config, n_block, n_period
        Size of the record; every block has as many experiments as axes.
    noise
        Standard deviation (complex: of real plus imaginary part) of the disturbance of the acceleration's DFT
        coefficient of a block, per line and axis, relative to the root mean square of all of them; what the
        controller answers to it comes on top. White over lines and axes, independent over periods (each has
        sqrt(n_period) times as much).
    seed
        Of phases and noise.
    robot
        Whose controller is in the loop; None: a proportional one, the same for all axes.
    """
    generator = np.random.default_rng(seed)
    n_axis, n_freq = plant.n_axis, len(LINES)
    frequency_hz: FloatArray = LINES / np.float64(N_SAMPLE * SAMPLE_TIME_S)
    omega = 2 * np.pi * frequency_hz
    turn = np.exp(2j * np.pi * np.outer(np.arange(n_axis), np.arange(n_axis)) / n_axis)
    phase = generator.uniform(0, 2 * np.pi, (n_config, n_block, 1, n_freq, n_axis))
    u = (
        np.exp(1j * phase) * turn[:, None, :]
    )  # (n_config, n_block, n_exp, n_freq, n_axis), axis a of experiment e
    response = plant.response(frequency_hz)
    y = (response @ u[..., None])[..., 0]
    size = noise * np.sqrt(np.mean(np.abs(y) ** 2) * n_period / 2)
    parts = generator.normal(size=(2, n_config, n_block, n_axis, n_period, n_freq, n_axis))
    disturbance = size * (parts[0] + 1j * parts[1])
    from_reference, feedback = _controller(plant, frequency_hz, robot)
    # u' = u - F (G (u' - u) + n): what the noise n adds to the torque is -(I + F G)^-1 F n.
    answer = np.linalg.solve(np.eye(n_axis) + feedback[:, :, None] * response, np.eye(n_axis) + 0j)
    added = -(answer @ (feedback * disturbance)[..., None])[..., 0]
    disturbed = y[:, :, :, None] + (response @ added[..., None])[..., 0] + disturbance
    torque = u[:, :, :, None] + added
    reference = np.broadcast_to(((u + feedback * y) / from_reference)[:, :, :, None], disturbed.shape)
    channels = {
        MOTOR_POSITION: Channel("motor", "rad", _samples(-disturbed / omega[:, None] ** 2)),
        MOTOR_TORQUE: Channel("motor", "N m", _samples(torque)),
        SPEED_REFERENCE: Channel("motor", "rad/s", _samples(reference)),
    }
    valid = np.ones((n_config, n_block, n_axis, n_period, N_SAMPLE), dtype=bool)
    run = DenseRun(SAMPLE_TIME_S, channels, np.arange(N_SAMPLE, dtype=np.float64) * SAMPLE_TIME_S, valid)
    names = tuple(f"axis_{number}" for number in range(1, n_axis + 1))
    angle = np.zeros((n_config, n_axis))
    return Record(names, "closed form", "zero_order_hold", (run,), angle, LINES)


def _controller(
    plant: MassSpringPlant, frequency_hz: FloatArray, robot: Robot | None
) -> tuple[ComplexArray, ComplexArray]:
    """Return torque over speed reference, and F of ``u = ... - F y``, each (n_freq, n_axis)."""
    if robot is not None:
        if robot.sample_time_s != SAMPLE_TIME_S:
            raise ValueError(
                f"{robot.name} samples every {robot.sample_time_s} s, the record {SAMPLE_TIME_S} s"
            )
        controller = controller_response(robot.drives, SAMPLE_TIME_S, frequency_hz)
        return controller.from_speed_alone, feedback_from_acceleration(controller, frequency_hz)
    omega = 2 * np.pi * frequency_hz
    speed = plant.response(frequency_hz) / (1j * omega[:, None, None])
    gain = LOOP_GAIN / np.linalg.norm(speed, 2, axis=(1, 2)).max()
    shape = (len(omega), plant.n_axis)
    return np.full(shape, gain + 0j), np.broadcast_to(gain / (1j * omega[:, None]), shape).copy()


def _samples(coefficient: ComplexArray) -> FloatArray:
    """Return the samples whose DFT, scaled by 1/n_sample, is `coefficient` (..., n_freq, n_axis) at the lines."""
    spectrum = np.zeros((*coefficient.shape[:-2], N_SAMPLE // 2 + 1, coefficient.shape[-1]), dtype=complex)
    spectrum[..., LINES, :] = coefficient
    return np.fft.irfft(spectrum, N_SAMPLE, axis=-2) * N_SAMPLE
