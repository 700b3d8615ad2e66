"""What moves behind the drives: straight moves to a target, and traced runs of the plant.

Moves are kinematic (a profile of constant speed); a run is simulated when it starts and becomes known to the
drives as simulated time passes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from robid_core import Plant

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Move:
    """A straight move at constant speed, times in ns."""

    start: float
    target: float
    speed: float
    began_ns: int

    def angle(self, now_ns: int) -> float:
        """Where the move is, rad."""
        way = self.speed * (now_ns - self.began_ns) * 1e-9
        left = self.target - self.start
        return self.target if way >= abs(left) else self.start + float(np.copysign(way, left))

    def under_way(self, now_ns: int) -> bool:
        """Tell whether the target is still ahead."""
        return self.angle(now_ns) != self.target


@dataclass(frozen=True)
class Run:
    """A simulated run: all samples from its start, shape (n_total, n_axis); the last `n_kept` are traced."""

    position: FloatArray
    torque: FloatArray
    n_kept: int
    began_ns: int
    sample_ns: int

    @property
    def end_ns(self) -> int:
        """When the last sample has been held for its time."""
        return self.began_ns + len(self.position) * self.sample_ns

    @property
    def first_kept(self) -> int:
        """Number of the first traced sample."""
        return len(self.position) - self.n_kept

    def taken(self, now_ns: int) -> int:
        """Samples taken so far."""
        return int(np.clip((now_ns - self.began_ns) // self.sample_ns, 0, len(self.position)))

    def speed(self, axis: int, now_ns: int) -> float:
        """Mean speed over the last sampling interval, rad/s."""
        n = self.taken(now_ns)
        if n < 2:
            return 0.0
        return float(np.diff(self.position[n - 2 : n, axis])[0]) / (self.sample_ns * 1e-9)


class Motors:
    """All motors of a drive system over one plant."""

    def __init__(self, plant: Plant, sample_time_s: float) -> None:
        self.plant = plant
        self.sample_ns = round(sample_time_s * 1e9)
        self.angle: FloatArray = np.zeros(plant.n_axis)
        self.moves: dict[int, Move] = {}
        self.run: Run | None = None

    def angle_of(self, axis: int, now_ns: int) -> float:
        """Where a motor stands, rad."""
        if self.run is not None:
            taken = self.run.taken(now_ns)
            return float(self.run.position[taken - 1, axis]) if taken else float(self.angle[axis])
        if axis in self.moves:
            return self.moves[axis].angle(now_ns)
        return float(self.angle[axis])

    def speed_of(self, axis: int, now_ns: int) -> float:
        """How fast a motor turns, rad/s."""
        if self.run is not None:
            return self.run.speed(axis, now_ns)
        move = self.moves.get(axis)
        return move.speed if move is not None and move.under_way(now_ns) else 0.0

    def settle(self, now_ns: int) -> None:
        """Let every motor stand where it is now."""
        self.angle = np.array([self.angle_of(axis, now_ns) for axis in range(self.plant.n_axis)])
        self.moves, self.run = {}, None

    def track(self, reference: FloatArray, periods: int, kept: int, seed: int, now_ns: int) -> None:
        """Simulate `periods` of a speed reference, rad/s, shape (n_sample, n_axis), from rest here."""
        self.settle(now_ns)
        self.plant.rest(self.angle)
        position, torque = self.plant.track(np.tile(reference, (periods, 1)), seed)
        self.run = Run(position, torque, kept * len(reference), now_ns, self.sample_ns)


class MotorSystem(Protocol):
    """What an axis needs of its drive system."""

    motors: Motors
    now_ns: int

    def halt(self, axis: int) -> None:
        """Bring a motor to rest."""


class MotorAxis:
    """One motor as its drive sees it."""

    def __init__(self, system: MotorSystem, index: int) -> None:
        self._system = system
        self._index = index

    @property
    def angle(self) -> float:
        """Where the motor stands, rad."""
        return self._system.motors.angle_of(self._index, self._system.now_ns)

    @property
    def speed(self) -> float:
        """How fast it turns, rad/s."""
        return self._system.motors.speed_of(self._index, self._system.now_ns)

    @property
    def moving(self) -> bool:
        """Whether a move to a target is under way."""
        move = self._system.motors.moves.get(self._index)
        return move is not None and move.under_way(self._system.now_ns)

    def move_to(self, angle: float, speed: float) -> None:
        """Begin a move at `speed` rad/s."""
        now_ns = self._system.now_ns
        self._system.motors.moves[self._index] = Move(self.angle, angle, speed, now_ns)

    def halt(self) -> None:
        """Come to rest here; a run under way ends for all motors, for one plant cannot stop in parts."""
        self._system.halt(self._index)
