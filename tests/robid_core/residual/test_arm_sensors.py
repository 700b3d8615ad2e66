"""Sensors behind the gears in a simulated motion of six axes: what prescribed motor motion says of them."""

from __future__ import annotations

import numpy as np

from robid_core import Channel, DenseRun, Robot
from robid_core.estimation.torque.periodic import periodic_motion_of
from robid_core.estimation.torque.speed_functions import SpeedFunctions
from robid_core.parameters import FreeParameters
from robid_core.residual import PeriodicBlock
from robid_core.residual.arm_sensors import arm_spectra_of

T, N = 1e-3, 2000
LINES = np.array([9, 21, 47, 95, 139])


def test_a_prescribed_motion_shows_the_sensors_what_the_simulation_did(ideal: Robot) -> None:
    """Joint angles and the torques of gears, of the simulator's coordinates; the linear model errs ten times more."""
    generator, time = np.random.default_rng(3), T * np.arange(N)
    speed = 9 * np.sin(2 * np.pi * time / (N * T))[None, :, None] * np.ones((1, 1, 6))
    for line in LINES:
        phase = generator.uniform(0, 2 * np.pi, (1, 1, 6))
        speed = speed + 5 * np.sin(2 * np.pi * line / (N * T) * time[None, :, None] + phase)
    start = [[0.3, 0.4, -0.3, 0.5, 0.6, 0.2]]
    run = ideal.simulate(np.tile(speed, (1, 7, 1)), np.array(start), keep_coordinates=True)
    assert run.coordinates is not None
    mechanism, (stiffness, damping) = ideal.mechanism, ideal.spring_arrays()
    moved = run.coordinates[:, 4 * N :]
    bent = moved @ mechanism.spring_directions[:6].T
    rate = np.gradient(
        bent, T, axis=1
    )  # of a fiftieth of the torque: its error of (w T)^2 / 6 at 70 Hz counts little
    shown = {
        "joint_position": moved @ mechanism.constraint_map[mechanism.arm].T,
        "joint_torque": stiffness[:6] * bent + damping[:6] * rate,
    }
    rows = (1, 1, 1, 3, N, 6)
    channels = {name: Channel("joint", "rad", values.reshape(rows)) for name, values in shown.items()}
    dense = DenseRun(T, channels, time, np.ones(rows[:-1], dtype=bool))
    position, torque = (values[:, 4 * N :].reshape(rows) for values in (run.position, run.torque))
    motion = periodic_motion_of(position, torque, T, LINES, 100.0)
    levels = {n: 0.0 for n in ideal.layout if n.startswith("friction.") and n.endswith(".coulomb")}
    arm = arm_spectra_of(dense, 0, len(motion.bin), tuple(shown))
    quiet = ideal.with_parameters(levels)
    block = PeriodicBlock.of_record(quiet, motion, SpeedFunctions.of_widths((0.5,), 6), arm)
    free = FreeParameters.of_robot(quiet, ("friction.axis_1.viscous",))

    def left() -> np.ndarray:
        """Residual over what is measured, rms over all bins, of each sensor."""
        predicted = block.predicted(quiet, np.zeros(1), np.zeros((3, 6)))
        residual = block.residual(predicted, np.zeros(1))[..., 6:]
        powers = [(np.abs(values) ** 2).sum(axis=(0, 1, 2)) for values in (residual, block.measured[..., 6:])]
        return np.sqrt(powers[0] / powers[1])

    linear = left()
    for _ in range(3):  # until it has rung out
        block.renew(free, np.zeros(1))
    moved_rows = left()
    assert moved_rows[:6].max() < 1e-6
    assert moved_rows[6:].max() < 5e-3
    assert (linear > 3 * moved_rows).all()
