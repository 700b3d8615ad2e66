"""Drives simulated in memory: no bus between the stage and the plant.

The fast path, and the oracle of every other way to a simulated plant: the same plant, reference and seed give
the same motion, here without increments of encoder and torque.
"""

from __future__ import annotations

from typing import Self

import numpy as np

from robid_core import (
    ConfigurationError,
    Drives,
    Experiment,
    FloatArray,
    MotionRefused,
    Robot,
    RobotName,
    Session,
    Trace,
    Truth,
)


class SimulatedDrives(Drives):
    """Simulated drives without a bus: the plant is called directly.

    Example
    -------
    ::

        drives: {use: simulated, with: {plant: six_axis_true}}
    """

    plant: RobotName
    """The robot that moves: packaged, or a path to a robot.yaml."""

    @property
    def moves_hardware(self) -> bool:
        """Nothing but a simulation moves."""
        return False

    def uses(self) -> list[tuple[str, str]]:
        """Return the plugins whose code the motion depends on: the plant's effects."""
        effects = Robot.load(self.plant).description.effects.values()
        return sorted({("robid.effects", effect.use) for effect in effects})

    def problems_with(self, robot: Robot) -> dict[tuple[str | int, ...], str]:
        """A plant of another number of motors."""
        n_axis = Robot.load(self.plant).n_axis
        if n_axis == robot.n_axis:
            return {}
        motors = f"{n_axis} motor{'' if n_axis == 1 else 's'}"
        return {("plant",): f"plant '{self.plant}' has {motors}, robot '{robot.name}' has {robot.n_axis}"}

    def truth(self, robot: Robot) -> Truth | None:
        """Return the parameters of the plant."""
        del robot
        parameters = Robot.load(self.plant).parameters()
        return Truth(self.plant, tuple(parameters), np.array(list(parameters.values()), dtype=float))

    def open(self, session: Session) -> OpenSimulatedDrives:
        """Return the plant at rest."""
        for message in self.problems_with(session.robot).values():
            raise ConfigurationError(f"drives: {message}")
        return OpenSimulatedDrives(Robot.load(self.plant))


def saturation_level(robot: Robot) -> FloatArray:
    """Measured torque from which a motor counts as limited, N m, shape (n_axis,).

    Three standard deviations of the torque's noise below the limit, at most a tenth of it.
    """
    d = robot.drives
    level: FloatArray = np.maximum(d.torque_limit - 3 * d.torque_noise, 0.9 * d.torque_limit)
    return level


class OpenSimulatedDrives:
    """Simulated drives that are up; between experiments the plant stays where it is."""

    def __init__(self, robot: Robot) -> None:
        self._plant = robot.plant()
        self._level = saturation_level(robot)
        self._time_s = 0.0

    def __enter__(self) -> Self:
        """Nothing has to come up."""
        return self

    def __exit__(self, *exception: object) -> None:
        """Nothing has to stop."""

    def perform(self, experiment: Experiment) -> Trace:
        """Simulate one cleared experiment."""
        if not experiment.cleared:
            raise MotionRefused(f"D03: {experiment.label}: the commands are not the ones that were cleared")
        n_sample, n_axis = experiment.reference.shape
        self._plant.rest(experiment.start)
        position, torque = self._plant.track(
            np.tile(experiment.reference, (experiment.periods, 1)), experiment.seed
        )
        kept = slice(-experiment.traced * n_sample, None)
        shape = (experiment.traced, n_sample, n_axis)
        begin_s = (
            self._time_s + (experiment.periods - experiment.traced) * n_sample * experiment.sample_time_s
        )
        self._time_s += experiment.periods * n_sample * experiment.sample_time_s
        return Trace(
            position=position[kept].reshape(shape),
            torque=torque[kept].reshape(shape),
            valid=np.ones(shape[:2], dtype=bool),
            saturated=(np.abs(torque[kept]) >= self._level).mean(axis=0),
            reference=experiment.reference,
            time_s=begin_s,
        )
