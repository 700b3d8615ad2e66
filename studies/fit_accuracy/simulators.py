"""What a plant's sensors show: on robid's own simulator, or on MuJoCo with friction and control beside it."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from robid_core import FloatArray, Robot
from studies.fit_accuracy import foreign
from studies.fit_accuracy.plants import Plant

FOREIGN_NOISE = 0.004  # of the torque limit


class Simulator(Protocol):
    """Measures a plant."""

    name: str
    """As a record tells its source."""

    def torque_noise(self, robot: Robot) -> FloatArray:
        """Standard deviation of the measured torque, N m, shape (n_axis,)."""
        ...

    def measure(
        self, plant: Plant, reference: FloatArray, start: FloatArray, seed: int
    ) -> tuple[FloatArray, FloatArray]:
        """Measured motor angle, rad, and torque, N m, (n_exp, n_sample, n_axis) each.

        Parameters
        ----------
        plant
            With what it hides.
        reference
            Motor speed, rad/s, (n_exp, n_sample, n_axis).
        start
            Joint-side angles at the start, rad, (n_exp, n_axis).
        seed
            Of the sensors' noise.
        """
        ...


class Own:
    """robid's simulator with the noise of the robot file; what a plant hides are effects."""

    name = "simulated"

    def torque_noise(self, robot: Robot) -> FloatArray:
        """That of the robot file."""
        return np.array([axis.sensors.torque_noise for axis in robot.description.axes.values()])

    def measure(
        self, plant: Plant, reference: FloatArray, start: FloatArray, seed: int
    ) -> tuple[FloatArray, FloatArray]:
        """Simulate all experiments together; a lag is that of a torque measured ahead of its action."""
        run = _with_effects(plant).simulate(reference, start, seed=seed)
        return run.position, run.torque


class Foreign:
    """MuJoCo; torque noise is a share of the limit."""

    name = "MuJoCo"

    def __init__(self, noise: float = FOREIGN_NOISE) -> None:
        self.noise = noise

    def torque_noise(self, robot: Robot) -> FloatArray:
        """A share of the torque limit."""
        return self.noise * np.array(robot.drives.torque_limit)

    def measure(
        self, plant: Plant, reference: FloatArray, start: FloatArray, seed: int
    ) -> tuple[FloatArray, FloatArray]:
        """Simulate one experiment after another; noise of the angles acts through the controller."""
        hidden = foreign.Hidden(
            plant.breakaway,
            plant.stribeck_speed,
            plant.exponent,
            -plant.torque_ripple,
            plant.torque_order,
            plant.resolver_ripple,
            plant.resolver_order,
            plant.hidden.late,
        )
        machine, generator = foreign.ForeignPlant(plant.robot, hidden), np.random.default_rng([seed, 1])
        noise = self.torque_noise(plant.robot)
        runs = [
            machine.measure(one, angle, generator, noise) for one, angle in zip(reference, start, strict=True)
        ]
        position, torque = (np.stack(values) for values in zip(*runs, strict=True))
        return position, torque


SIMULATORS: dict[str, Simulator] = {"own": Own(), "foreign": Foreign()}


def earlier(torque: FloatArray, samples: float) -> FloatArray:
    """Return torques as a measurement ahead of the action shows them: exact for what repeats."""
    spectrum = np.fft.rfft(torque, axis=1)
    turn = np.exp(2j * np.pi * np.arange(spectrum.shape[1]) * samples / torque.shape[1])
    result: FloatArray = np.fft.irfft(spectrum * turn[:, None], n=torque.shape[1], axis=1)
    return result


def _with_effects(plant: Plant) -> Robot:
    """Return the plant's robot with what it hides."""
    robot = plant.robot
    for a, axis in enumerate(robot.axis_names):
        if plant.hidden.stribeck:
            numbers = {
                "coulomb": 0.0, "breakaway": plant.breakaway[a], "stribeck_speed": plant.stribeck_speed[a],
                "exponent": plant.exponent[a], "viscous": 0.0,
                "speed": plant.robot.parameter(f"friction.{axis}.speed"),
            }  # fmt: skip
            robot = robot.with_effect(f"stribeck_{a}", "friction.stribeck", on=axis, values=_plain(numbers))
        if plant.hidden.torque_ripple:
            numbers = {"amplitude": plant.torque_ripple[a], "order": plant.torque_order[a]}
            robot = robot.with_effect(f"ripple_{a}", "drive.cogging", on=axis, values=_plain(numbers))
        if plant.hidden.resolver_ripple:
            numbers = {"amplitude": plant.resolver_ripple[a], "order": plant.resolver_order[a]}
            robot = robot.with_effect(f"wave_{a}", "sensing.resolver_ripple", on=axis, values=_plain(numbers))
    return robot


def _plain(numbers: dict[str, float]) -> dict[str, float]:
    return {key: float(value) for key, value in numbers.items()}
