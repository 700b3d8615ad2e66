"""One axis driven by multisines: what tests of the diagnosis measure."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from robid_core import Channel, DenseRun, Record, Robot

PERIOD, T = 3000, 1e-3
LINES = np.unique(2 * np.round((np.geomspace(3.0, 80.0, 60) * PERIOD * T - 1) / 2).astype(int) + 1)
Measured = Callable[..., Record]


@pytest.fixture(scope="session")
def told() -> Robot:
    return Robot.load("one_axis")


@pytest.fixture(scope="session")
def plant_of() -> Callable[[Robot, int], Robot]:
    """The robot with springs, dampers and friction a third off, inertia as it is told."""

    def drawn(robot: Robot, seed: int) -> Robot:
        generator = np.random.default_rng(seed)
        off = [
            name
            for name in robot.layout
            if robot.parameter_kind(name) in ("stiffness", "damping")
            or (name.startswith("friction.") and not name.endswith("offset"))
        ]
        return robot.with_parameters(
            {name: robot.parameter(name) * np.exp(0.3 * generator.standard_normal()) for name in off}
        )

    return drawn


@pytest.fixture(scope="session")
def measured() -> Measured:
    """Two experiments of two periods in each of some poses: a multisine on a slow sine, from rest.

    `settled`: after one period, which is left out. `faster`: of so many samples of the controller one is recorded.
    """

    def simulated(
        plant: Robot,
        seed: int,
        n_config: int = 4,
        with_reference: bool = False,
        settled: bool = True,
        faster: int = 1,
    ) -> Record:
        if faster > 1:
            clock = {"sample_time_s": T / faster, "step_s": plant.step_s / faster}
            plant = replace(plant, description=plant.description.model_copy(update=clock))
        generator, time = np.random.default_rng(seed), T / faster * np.arange(faster * PERIOD)
        poses = np.repeat(generator.uniform(-1.2, 1.2, (n_config, 1)), 2, axis=0)
        reference = np.zeros((len(poses), len(time), 1))
        for lane in reference:
            phase = generator.uniform(0, 2 * np.pi, len(LINES))
            wave = np.cos(2 * np.pi * np.outer(time, LINES / (PERIOD * T)) + phase).sum(axis=1)
            lane[:, 0] = 4 * wave / wave.std() + 10 * np.sin(4 * np.pi * time / (PERIOD * T) + phase[0])
        run, first = plant.simulate(np.tile(reference, (1, 3, 1)), poses, seed=seed), len(time) * settled
        shape = (n_config, 1, 2, 2, PERIOD, 1)
        channels = {
            "motor_position": Channel(
                "motor", "rad", run.position[:, first : first + 2 * len(time) : faster].reshape(shape)
            ),
            "motor_torque": Channel(
                "motor", "N m", run.torque[:, first : first + 2 * len(time) : faster].reshape(shape)
            ),
        }
        if with_reference:
            values = np.tile(reference[:, ::faster], (1, 2, 1)).reshape(shape)
            channels["speed_reference"] = Channel("motor", "rad/s", values)
        dense = DenseRun(T, channels, time[::faster], np.ones(shape[:5], dtype=bool))
        return Record(plant.axis_names, "simulated", "zero_order_hold", (dense,), poses[::2], line=LINES)

    return simulated
