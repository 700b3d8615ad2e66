"""Ceilings: what free functions at a place gain, of which every law of the place is a special case, or nearly.

A law that reaches little of its ceiling is not the cause, only the nearest of the catalogue.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from robid_core import FloatArray, Robot
from robid_diagnosis.columns import Motion
from robid_diagnosis.memory import sliders
from robid_diagnosis.projection import Projection, Rows
from robid_diagnosis.wording import FREE

KNOTS = (0.0, 0.05, 0.12, 0.25, 0.5, 0.8, 1.2, 1.8, 2.6)  # of the rms speed
BENDS = (-0.8, -0.6, -0.4, -0.25, -0.12, 0.0, 0.12, 0.25, 0.4, 0.6, 0.8)  # of a deflection hardly exceeded
ORDERS = (1, 2, 3, 4, 6, 8, 12)
WIDTHS = (0.5, 1.0, 2.0)  # of friction's zero-speed width
HARDLY = 0.99
BANDS = 12  # of frequency
RESPONSE = "frequency: a linear response"
ANGLE = "motor angle"
SESSION = "the order of the experiments: friction that changes over the session"
POWERS = (1, 2, 3)  # of an experiment's number: warming up is an exponential, near to a cubic
MOTOR, GEAR = "motor displacement", "gear deflection"
THRESHOLDS = (3e-4, 1e-3, 3e-3, 0.01, 0.03, 0.1, 0.3)  # of a way that is hardly exceeded
REMEMBERED = " since a reversal"
PER_NUMBER = 2.0  # of twice the log-likelihood: what a free number gains by chance, and somewhat more


@dataclass(frozen=True)
class Ceiling:
    """Gain of free functions of one variable at one axis: an upper bound of what any law of it can explain."""

    axis: str
    variable: str
    """In words: motor speed, load and speed, gear deflection, motor angle, frequency."""
    gain: float
    """Of twice the log-likelihood, less what as many numbers gain by chance."""
    of_data: float
    """Likewise, of the data alone: without that told numbers need not leave their tolerances."""
    freedom: int
    """Number of functions."""

    @property
    def function_of(self) -> str:
        """In words, with the place."""
        return f"{FREE}{self.variable} at {self.axis}"


def ceilings(motion: Motion, projection: Projection, axes: tuple[int, ...]) -> list[Ceiling]:
    """Gains of free functions at some axes, largest first."""
    found = []
    for axis in axes:
        for variable, direction, functions in _families(motion, axis):
            rows = [
                motion.weighted([one.of_force(direction, function(k)) for k, one in enumerate(motion.along)])
                for function in functions
            ]
            found.append(_ceiling(motion, projection, axis, variable, rows))
        found.append(_ceiling(motion, projection, axis, RESPONSE, list(_responses(motion, axis))))
    return sorted(found, key=lambda one: -one.gain)


def drifts(motion: Motion, projection: Projection, axes: tuple[int, ...]) -> list[Ceiling]:
    """Gains of viscous and Coulomb friction that change from experiment to experiment, in the order of the record.

    No law of one experiment is a special case of these, but many gain a little in what they explain.
    """
    count = np.cumsum([0, *(len(one.along.position) for one in motion.along)])
    found = []
    for axis in axes:
        motor = np.eye(motion.robot.mechanism.n_coordinate)[axis]
        speed, width = [one.seen(motor)[1] for one in motion.along], float(motion.friction_speed[axis])
        rows = []
        for power in POWERS:
            late = [(np.arange(a, b)[:, None] / max(count[-1] - 1, 1)) ** power for a, b in pairwise(count)]
            for turns in (speed, [np.tanh(one / width) for one in speed]):
                forces = [share * one for share, one in zip(late, turns, strict=True)]
                rows.append(
                    motion.weighted(
                        [one.of_force(motor, f) for one, f in zip(motion.along, forces, strict=True)]
                    )
                )
        found.append(_ceiling(motion, projection, axis, SESSION, rows))
    return found


def memories(motion: Motion, projection: Projection, axes: tuple[int, ...]) -> list[Ceiling]:
    """Gains of forces that depend on the way since reversals, of motors and of their gears.

    Causes are not held against them: a law without memory is no special case.
    """
    found = []
    for axis in axes:
        bending = _bending(motion.robot, axis)
        ways = {MOTOR: np.eye(motion.robot.mechanism.n_coordinate)[axis], GEAR: bending}
        for what, row in ways.items():
            if row is None:
                continue
            position = [one.seen(row)[0] for one in motion.along]
            way = float(
                np.quantile(
                    np.abs(_joined([one - one.mean(axis=1, keepdims=True) for one in position])), HARDLY
                )
            )
            slid = [
                sliders(one, way * np.array(THRESHOLDS), repeats=along.motion.settling > 0)
                for one, along in zip(position, motion.along, strict=True)
            ]
            rows = [
                motion.weighted(
                    [one.of_force(row, own[k]) for one, own in zip(motion.along, slid, strict=True)]
                )
                for k in range(len(THRESHOLDS))
            ]
            found.append(_ceiling(motion, projection, axis, f"{what}{REMEMBERED}", rows))
    return found


def _ceiling(motion: Motion, projection: Projection, axis: int, variable: str, rows: list[Rows]) -> Ceiling:
    sums = projection.sums(np.stack(rows))
    gain = projection.gain(sums, [False] * len(rows), blind=1e-4, together=True)
    (of_data,) = projection.by_group(sums, gain, [range(len(projection.folds))])
    chance = PER_NUMBER * gain.freedom
    return Ceiling(
        motion.robot.axis_names[axis], variable, gain.total - chance, float(of_data) - chance, gain.freedom
    )


def _responses(motion: Motion, axis: int) -> Iterator[Rows]:
    """A linear response that is free in bands of frequency, from the motor's acceleration to its own torque."""
    frequency = motion.along[0].motion.frequency_hz
    edges = np.geomspace(frequency[1], frequency[-1] * 1.001, BANDS + 1)
    for low, high in pairwise(edges):
        for turn in (1.0, 1j):
            spectra = []
            for one in motion.along:
                within = (one.motion.frequency_hz >= low) & (one.motion.frequency_hz < high)
                moved = np.zeros_like(one.motion.acceleration_spectrum)
                moved[..., axis] = turn * within * one.motion.acceleration_spectrum[..., axis]
                spectra.append(moved)
            yield motion.weighted(spectra)


def _bending(robot: Robot, axis: int) -> FloatArray | None:
    """Deflection of an axis' gear as a row over all coordinates; None where it is rigid."""
    gears = robot.mechanism.elastic_gear
    return robot.mechanism.spring_directions[int(gears[:axis].sum())] if gears[axis] else None


def _joined(parts: Sequence[FloatArray]) -> FloatArray:
    """Return all samples of blocks, which need not be equally long."""
    return np.concatenate([part.ravel() for part in parts])


Family = tuple[str, FloatArray, list[Callable[[int], FloatArray]]]


def _families(motion: Motion, axis: int) -> Iterator[Family]:
    """Free functions at one axis, each of the number of a block: what they depend on, and along what they act."""
    robot, along = motion.robot, motion.along
    motor = np.eye(robot.mechanism.n_coordinate)[axis]
    angle, speed = ([one.seen(motor)[k] for one in along] for k in (0, 1))
    rms, width = float(np.std(_joined(speed))), float(motion.friction_speed[axis])
    odd = [lambda b, k=k: np.sign(speed[b]) * np.clip(np.abs(speed[b]) - k * rms, 0, None) for k in KNOTS]
    even = [lambda b, k=k: np.clip(np.abs(speed[b]) - k * rms, 0, None) for k in KNOTS]
    signs = [lambda b, w=w: np.tanh(speed[b] / (w * width)) for w in WIDTHS]
    yield "motor speed", motor, [*odd, *even, *signs, lambda b: np.tanh(np.abs(speed[b]) / width)]
    weigh = robot.drives.gear[:, axis]
    load = [one.load_of(weigh) for one in along]
    size = float(np.std(_joined(load))) + 1e-12
    sign = [np.tanh(v / width) for v in speed]
    yield (
        "load and speed",
        motor,
        [
            lambda b: load[b],
            lambda b: np.abs(load[b]),
            lambda b: np.abs(load[b]) * sign[b],
            lambda b: load[b] * sign[b],
            lambda b: np.abs(load[b]) * speed[b] / rms,
            lambda b: load[b] ** 2 / size * sign[b],
            lambda b: np.abs(load[b]) * sign[b] * np.exp(-((speed[b] / (0.3 * rms)) ** 2)),
        ],
    )
    row = _bending(robot, axis)
    if row is not None:
        bent, rate = ([one.seen(row)[k] for one in along] for k in (0, 1))
        most = float(np.quantile(np.abs(_joined(bent)), HARDLY))
        fast = 0.1 * float(np.std(_joined(rate)))
        bends = [lambda b, k=k: np.clip(bent[b] / most - k, 0, None) for k in BENDS]
        yield GEAR, row, [*bends, lambda b: np.tanh(rate[b] / fast)]
    waves = [lambda b, o=o, f=f: f(o * angle[b]) for o in ORDERS for f in (np.sin, np.cos)]
    joint = robot.drives.gear[axis, axis]
    turns = [lambda b: np.sin(joint * angle[b]), lambda b: np.cos(joint * angle[b])]
    yield ANGLE, motor, [*waves, *turns]
