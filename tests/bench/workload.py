"""What the bench simulates: the robot, and experiments as in Paper B: six multisines on a slow sine in many poses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from oracles.drives import Ripple
from oracles.robots import RESOLVER_RIPPLE, TORQUE_RIPPLE, with_exact_encoders, with_ripple

from robid_core import Robot
from robid_core.estimation.excitation import multisine
from robid_core.registry import EFFECTS, registry

FloatArray = npt.NDArray[np.float64]

BAND_HZ = (4.0, 80.0)
SINE_SPEED = 0.25  # amplitude, rad/s at the joints
MULTISINE_SPEED = 0.04  # rms
# Configurations are drawn between these angles, rad.
LOWER = np.array([-2.0, -0.8, -0.8, -2.0, -1.5, -2.0])
UPPER = np.array([2.0, 1.0, 0.8, 2.0, 1.5, 2.0])


def bench_ripple() -> Ripple:
    """Ripple of six axes: 1 % of the torque limit 6 times a turn, and 0.2 mrad of the resolver twice a turn."""
    if not {TORQUE_RIPPLE, RESOLVER_RIPPLE} <= set(registry().names(EFFECTS)):
        return Ripple.none(6)
    limit = Robot.load("six_axis_true").drives.torque_limit
    return Ripple(0.01 * limit, np.full(6, 6.0), np.full(6, 2e-4), np.full(6, 2.0))


def bench_robot(*, ripple: bool = True, encoder: bool = True) -> Robot:
    """Six axes with friction, sampled control and torque limits, and both ripples where the effects are installed.

    Parameters
    ----------
    ripple
        False: the same without ripple, for simulators that take it as a function of their own.
    encoder
        False: angles are measured without steps, so that errors of the integration are not rounded away.
    """
    robot = Robot.load("six_axis_true")
    if not encoder:
        robot = with_exact_encoders(robot)
    values = bench_ripple()
    return with_ripple(robot, values) if ripple and values.acts else robot


@dataclass(frozen=True)
class Experiments:
    """References of the drives and where they start."""

    reference: FloatArray
    """Motor speed, rad/s, (n_lane, n_sample, n_axis)."""
    angle: FloatArray
    """Joint-side motor angles at the start, rad, (n_lane, n_axis)."""

    @property
    def duration(self) -> float:
        """Simulated seconds of one lane."""
        return float(self.reference.shape[1] * 1e-3)

    @property
    def seconds(self) -> float:
        """Simulated seconds of all lanes."""
        return len(self.reference) * self.duration


def random_experiments(robot: Robot, n_lane: int, duration: float, seed: int = 0) -> Experiments:
    """Experiments in random configurations: random-phase multisines of 0.1 Hz spacing and a slow sine, from rest."""
    generator = np.random.default_rng(seed)
    angle = generator.uniform(LOWER, UPPER, (n_lane, robot.n_axis))
    period = 10_000
    line = multisine.logarithmic_odd_lines(BAND_HZ, 100, period * robot.sample_time_s)
    blocks = -(-n_lane // robot.n_axis)
    one_period = np.concatenate([_references(robot, line, period, generator) for _ in range(blocks)])[:n_lane]
    n_sample = round(duration / robot.sample_time_s)
    repeated = np.tile(one_period, (1, -(-n_sample // period), 1))[:, :n_sample]
    return Experiments(np.ascontiguousarray(repeated), angle)


def orthogonal_block(
    robot: Robot, period_s: float, n_line: int, n_period: int, seed: int = 0
) -> tuple[Experiments, npt.NDArray[np.int64]]:
    """As many orthogonal experiments as axes in one configuration, and their lines."""
    generator = np.random.default_rng(seed)
    period = round(period_s / robot.sample_time_s)
    line = multisine.logarithmic_odd_lines(BAND_HZ, n_line, period_s)
    reference = np.tile(_references(robot, line, period, generator), (1, n_period, 1))
    angle = np.tile([0.4, 0.3, -0.5, 0.6, 0.7, -0.4], (robot.n_axis, 1))
    return Experiments(reference, angle), line


def _references(
    robot: Robot, line: npt.NDArray[np.int64], period: int, generator: np.random.Generator
) -> FloatArray:
    """One period of n_axis experiments, (n_axis, period, n_axis)."""
    frequency = line / (period * robot.sample_time_s)
    rotor = robot.drives.rotor_inertia
    crossover = robot.drives.speed_gain / (2 * np.pi * rotor)
    rms = abs(robot.motor_angle(np.full(robot.n_axis, MULTISINE_SPEED)))
    amplitude = multisine.flat_torque_amplitude(frequency, crossover, rms)
    phase, experiment_phase = generator.uniform(0, 2 * np.pi, (2, *amplitude.shape))
    fast = multisine.multisine(amplitude, phase, experiment_phase, line, period)
    slow_amplitude = abs(robot.motor_angle(np.full(robot.n_axis, SINE_SPEED)))
    slow = multisine.sine(slow_amplitude, generator.uniform(0, 2 * np.pi, robot.n_axis), 4, period)
    return fast + slow
