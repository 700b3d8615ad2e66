"""How the plants of blind cases are moved, and records of what their sensors show."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from oracles.drives import of_axes

from robid_core import Channel, DenseRun, FloatArray, Record, Robot

PERIOD, SETTLE, KEPT = 3000, 1, 2  # samples; periods
POSES = {1: 6, 2: 6, 3: 4, 4: 4, 6: 4}  # by axes
EACH = {1: 2, 2: 2, 3: 3, 4: 3, 6: 3}  # experiments of a pose
BAND_HZ, LINES = (3.0, 80.0), 60
FAST, SLOW = 4.0, 10.0  # rad/s at the motor: rms of the multisine, amplitude of the slow sine
MOVE, STANDING = (0.3, 0.6), 0.2  # rad at the joint; s in which a multisine begins
QUIET = 0.5  # of a motion
NOISE = (0.7, 3.0)  # of periodic records' torque, over what is told; what does not repeat has what is told


@dataclass(frozen=True, eq=False)
class Experiments:
    """Poses, references and noise of one case."""

    poses: FloatArray
    """Joint-side angles, rad, (n_pose, n_axis)."""
    references: FloatArray
    """Motor speeds, rad/s, (n_pose * each, n_sample, n_axis), with what settles."""
    each: int
    """Experiments a pose."""
    torque_noise: FloatArray
    """N m, (n_axis,)."""
    lines: np.ndarray | None
    """Excited bins of a period; None: nothing repeats."""
    repeats: int = 1
    """Times that a period counts that was moved through once: without noise the next one is like it."""

    @classmethod
    def drawn(
        cls, robot: Robot, motion: Literal["multisine", "moves"], generator: np.random.Generator
    ) -> Experiments:
        """Draw poses within the limits, and multisines on a slow sine, or on a move forth and back."""
        n_pose, each = POSES[robot.n_axis], EACH[robot.n_axis]
        limits = (np.maximum(robot.drives.lower, -2.0) * 0.6, np.minimum(robot.drives.upper, 2.0) * 0.6)
        poses = generator.uniform(*limits, (n_pose, robot.n_axis))
        low, high = BAND_HZ
        bins = np.geomspace(low, high, LINES) * PERIOD * robot.sample_time_s
        lines = np.unique(2 * np.round((bins - 1) / 2).astype(int) + 1)
        multisine = [_multisine(lines, robot, generator) for _ in range(n_pose * each)]
        told = of_axes(robot, "sensors", "torque_noise")
        if motion == "multisine":
            slow = [_slow(robot, generator) for _ in range(n_pose * each)]
            references = np.stack(
                [np.tile(a + b, (SETTLE + KEPT, 1)) for a, b in zip(multisine, slow, strict=True)]
            )
            return cls(poses, references, each, told * generator.uniform(*NOISE), lines)
        fade = np.minimum(1.0, np.arange(PERIOD) * robot.sample_time_s / STANDING)[:, None]
        moves = np.stack(
            [fade * wave + _move(robot, poses[k // each], generator) for k, wave in enumerate(multisine)]
        )
        return cls(poses, moves, each, told, None)

    def quiet_but(self, pose: int) -> Experiments:
        """Return the same with small motions in all poses but one (-1: in all)."""
        share = np.where(np.arange(len(self.references)) // self.each == pose, 1.0, QUIET)
        return replace(self, references=self.references * share[:, None, None])

    def first(self) -> Experiments:
        """Return the first experiment of each pose, for a plant without noise: one period stands for those kept."""
        first = self.references[:: self.each]
        if self.lines is None:
            return replace(self, references=first, each=1)
        return replace(self, references=first[:, : (SETTLE + 1) * PERIOD], each=1, repeats=KEPT)

    def with_noise(self, clean: Record, robot: Robot, generator: np.random.Generator) -> Record:
        """Return a record with the noise of the sensors added, which no controller sees."""
        run = clean.run
        deviations = {
            "motor_position": of_axes(robot, "sensors", "position_noise"),
            "motor_torque": self.torque_noise,
        }
        channels = {
            name: Channel(
                "motor",
                "rad" if name == "motor_position" else "N m",
                run.values(name) + deviation * generator.standard_normal(run.values(name).shape),
            )
            for name, deviation in deviations.items()
        }
        return replace(clean, runs=(replace(run, channels=channels),))


def record_of(robot: Robot, experiments: Experiments, position: FloatArray, torque: FloatArray) -> Record:
    """Make a record of what was measured, (n_pose * each, n_sample, n_axis) each; what settles is cut off."""
    periodic = experiments.lines is not None
    first, length = (SETTLE * PERIOD, PERIOD) if periodic else (0, position.shape[1])
    n_period = (position.shape[1] - first) // length
    shape = (len(experiments.poses), 1, experiments.each, n_period, length, robot.n_axis)
    position, torque = (
        np.repeat(one[:, first:].reshape(shape), experiments.repeats, axis=3) for one in (position, torque)
    )
    channels = {
        "motor_position": Channel("motor", "rad", position),
        "motor_torque": Channel("motor", "N m", torque),
    }
    time = robot.sample_time_s * np.arange(length)
    run = DenseRun(robot.sample_time_s, channels, time, np.ones(position.shape[:5], dtype=bool))
    return Record(
        robot.axis_names, "MuJoCo", "zero_order_hold", (run,), experiments.poses, line=experiments.lines
    )


def _multisine(lines: np.ndarray, robot: Robot, generator: np.random.Generator) -> FloatArray:
    """One period of motor speeds, rad/s, (PERIOD, n_axis), with random phases."""
    time, period = robot.sample_time_s * np.arange(PERIOD), PERIOD * robot.sample_time_s
    angle = 2 * np.pi * np.outer(time, lines / period)
    waves = []
    for _ in range(robot.n_axis):
        wave = np.cos(angle + generator.uniform(0, 2 * np.pi, len(lines))).sum(axis=1)
        waves.append(FAST * wave / wave.std())
    return np.stack(waves, axis=1)


def _slow(robot: Robot, generator: np.random.Generator) -> FloatArray:
    """Two turns of a sine a period, rad/s, (PERIOD, n_axis)."""
    turn = 4 * np.pi * np.arange(PERIOD) / PERIOD
    slow: FloatArray = SLOW * np.sin(turn[:, None] + generator.uniform(0, 2 * np.pi, robot.n_axis))
    return slow


def _move(robot: Robot, pose: FloatArray, generator: np.random.Generator) -> FloatArray:
    """Speeds of one move forth and back of every axis, away from the nearer limit, rad/s, (PERIOD, n_axis)."""
    period = PERIOD * robot.sample_time_s
    middle = 0.5 * (np.array(robot.drives.lower) + np.array(robot.drives.upper))
    way = np.where(pose > middle, -1.0, 1.0) * generator.uniform(*MOVE, robot.n_axis)
    shape = np.sin(2 * np.pi * np.arange(PERIOD) / PERIOD) * np.pi / period
    return shape[:, None] * robot.motor_angle(way[None])[0]
