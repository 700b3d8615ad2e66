"""Simulated experiments as they travel: a batch, cut into portions, and the function that computes one portion.

A portion is plain arrays and the robot as text. The rule that cuts knows nothing of who computes, every experiment
draws its noise from a seed of its own, and none depends on those beside it: a portion has the same bytes wherever,
and how often, it is computed.
"""

from __future__ import annotations

import functools
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from robid_core.arrays import FloatArray, IntArray
from robid_core.errors import ConfigurationError
from robid_core.robot.file.description import RobotDescription

if TYPE_CHECKING:
    from robid_core.robot.robot import Robot

Portion = tuple[int, int, int]  # batch, first experiment, behind the last

GROUP = 8  # experiments of a portion are a multiple of this: the lanes of the kernel
PORTION = 120_000  # samples of all experiments of a portion: half a second of work, 12 MB of six axes


@dataclass(frozen=True)
class ExperimentBatch:
    """Experiments of one robot in closed loop, each from rest at the gravity equilibrium."""

    robot: Robot
    speed_reference: FloatArray
    """One period of motor speed, rad/s, (n_reference, n_sample, n_axis)."""
    motor_angle: FloatArray
    """Where the motors start, rad at the shaft, (n_lane, n_axis)."""
    reference_of: IntArray | None = None
    """Which reference each experiment follows, (n_lane,); None: experiment i follows reference i."""
    seed: IntArray | None = None
    """Draws the sensors' noise of each experiment, (n_lane,); None: no noise."""
    n_period: int = 1
    """How often the reference runs."""
    n_kept: int | None = None
    """How many of the last periods are kept; None: all."""
    method: str = "implicit_midpoint"
    """Or runge_kutta, as a check."""
    keep_coordinates: bool = False
    """Whether the true coordinates are results, too."""

    @property
    def n_lane(self) -> int:
        """Number of experiments."""
        return len(self.motor_angle)

    @property
    def kept(self) -> int:
        """Periods that are kept."""
        return self.n_period if self.n_kept is None else self.n_kept

    @functools.cached_property
    def text(self) -> str:
        """The robot as text (JSON, which is YAML too)."""
        return self.robot.description.model_dump_json()

    @property
    def shape(self) -> tuple[int, int, int]:
        """Shape of position and torque: (n_lane, kept samples, n_axis)."""
        return self.n_lane, self.kept * self.speed_reference.shape[1], self.speed_reference.shape[2]

    def check(self, where: str = "") -> None:
        """Raise ConfigurationError for what cannot be simulated, before any of it travels."""
        reference, angle = np.shape(self.speed_reference), np.shape(self.motor_angle)
        n_axis = self.robot.n_axis
        if len(reference) != 3 or reference[2] != n_axis:
            raise ConfigurationError(
                f"{where}speed reference of shape {reference}, expected (n_reference, n_sample, {n_axis})"
            )
        if len(angle) != 2 or angle[1] != n_axis or not angle[0]:
            raise ConfigurationError(f"{where}motor angles of shape {angle}, expected (n_lane, {n_axis})")
        which = self.reference_of
        if which is None and reference[0] != angle[0]:
            raise ConfigurationError(
                f"{where}{reference[0]} references for {angle[0]} experiments; give reference_of"
            )
        if which is not None and (which.shape != angle[:1] or which.min() < 0 or which.max() >= reference[0]):
            raise ConfigurationError(
                f"{where}reference_of must name one of {reference[0]} references for each of {angle[0]} experiments"
            )
        if self.seed is not None and (self.seed.shape != angle[:1] or self.seed.min() < 0):
            raise ConfigurationError(f"{where}give one seed >= 0 for each of {angle[0]} experiments, or none")
        if not 1 <= self.kept <= self.n_period:
            raise ConfigurationError(
                f"{where}{self.kept} periods are to be kept, {self.n_period} are simulated"
            )


def lanes_per_portion(n_sample: int) -> int:
    """Return how many experiments of so many samples make a portion; who computes it takes no part."""
    return GROUP * max(1, PORTION // (GROUP * max(n_sample, 1)))


def portions(batches: Sequence[ExperimentBatch]) -> Iterator[Portion]:
    """Yield every portion of some batches."""
    for index, batch in enumerate(batches):
        size = lanes_per_portion(batch.n_period * batch.speed_reference.shape[1])
        for first in range(0, batch.n_lane, size):
            yield index, first, min(first + size, batch.n_lane)


def task(batch: ExperimentBatch, first: int, last: int) -> tuple[Any, ...]:
    """Return the arguments of `simulate_experiments` for some experiments of a batch."""
    lanes = slice(first, last)
    which = lanes if batch.reference_of is None else batch.reference_of[lanes]
    return (
        batch.text,
        np.ascontiguousarray(batch.speed_reference[which], dtype=np.float64),
        np.ascontiguousarray(batch.motor_angle[lanes], dtype=np.float64),
        None if batch.seed is None else np.ascontiguousarray(batch.seed[lanes], dtype=np.int64),
        batch.n_period,
        batch.kept,
        batch.method,
        batch.keep_coordinates,
    )


def simulate_experiments(
    robot: str,
    speed_reference: FloatArray,
    motor_angle: FloatArray,
    seed: IntArray | None,
    n_period: int,
    n_kept: int,
    method: str,
    keep_coordinates: bool,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray | None, str, int]:
    """Simulates experiments of a robot as one task of parallel work, registered as `simulate.experiments`.

    Parameters
    ----------
    robot
        The whole robot as text (JSON, which is YAML too).
    speed_reference, motor_angle, seed, n_period, n_kept, method, keep_coordinates
        As in `ExperimentBatch`, one reference an experiment.

    Returns
    -------
    Position, torque, saturation and coordinates as in `BatchPortion`, what went wrong, if anything did, and in which
    experiment.
    """
    from robid_core.mechanics import SimulationDiverged, simulate
    from robid_core.robot.plant import controller_of, sensor_noise, standing

    plant = robot_of(robot)
    n_sample, n_axis = speed_reference.shape[1:]
    whole = np.tile(speed_reference, (1, n_period, 1))
    position_noise = torque_noise = None
    if seed is not None:  # as each experiment alone would draw it
        position_noise, torque_noise = np.empty(whole.shape), np.empty(whole.shape)
        for lane, one in enumerate(seed.tolist()):
            position_noise[lane : lane + 1], torque_noise[lane : lane + 1] = sensor_noise(
                plant, (1, n_period * n_sample, n_axis), one
            )
    stiffness, damping = plant.spring_arrays()
    problem, lane = "", -1
    try:
        done = simulate(
            plant.mechanism,
            stiffness,
            damping,
            controller_of(plant),
            standing(plant, motor_angle),
            whole,
            forces=plant.forces,
            signals=plant.signals,
            position_noise=position_noise,
            torque_noise=torque_noise,
            sample_time=plant.sample_time_s,
            step=plant.step_s,
            method=method,  # type: ignore[arg-type]
            keep_coordinates=keep_coordinates,
        )
    except SimulationDiverged as error:
        named = re.match(r"simulate: lane (\d+) ", str(error))
        done, lane = error.partial, int(named[1]) if named else 0
        problem = str(error)[named.end() if named else 0 :]
    last = slice((n_period - n_kept) * n_sample, None)
    coordinates = None if done.coordinates is None else _whole(done.coordinates, last)
    return (
        _whole(done.position, last),
        _whole(done.torque, last),
        done.saturated,
        coordinates,
        problem,
        lane,
    )


def _whole(values: FloatArray, kept: slice) -> FloatArray:
    """Return the kept samples without holding on to the others."""
    return values if not kept.start else values[:, kept].copy()


@functools.lru_cache(maxsize=8)
def robot_of(text: str) -> Robot:
    """Return the robot that a text describes."""
    from robid_core.robot.robot import Robot

    return Robot(RobotDescription.model_validate_json(text))
