"""What moves behind the drives: straight moves to a target, traced runs of the plant, and ramps down to rest.

Moves and ramps are kinematic (constant speed, constant deceleration); a run is simulated when it starts and
becomes known to the drives as simulated time passes. A motor that leaves a run slows down by itself, the others
go on as simulated: that the arm couples them is left out there.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from robid_core import FloatArray, Plant


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

    def velocity(self, now_ns: int) -> float:
        """How fast the motor turns, rad/s."""
        return float(np.copysign(self.speed, self.target - self.start)) if self.under_way(now_ns) else 0.0


@dataclass(frozen=True)
class Ramp:
    """A motor that slows down to rest at constant deceleration (rad/s^2; infinite: at once), times in ns."""

    start: float
    velocity_at_start: float
    deceleration: float
    began_ns: int

    @property
    def end_ns(self) -> int:
        """When the motor has come to rest."""
        return self.began_ns + math.ceil(1e9 * abs(self.velocity_at_start) / self.deceleration)

    def velocity(self, now_ns: int) -> float:
        """How fast the motor turns, rad/s."""
        if now_ns >= self.end_ns:
            return 0.0
        lost = self.deceleration * (now_ns - self.began_ns) * 1e-9
        return float(np.copysign(max(abs(self.velocity_at_start) - lost, 0.0), self.velocity_at_start))

    def angle(self, now_ns: int) -> float:
        """Where the motor is, rad: the mean of first and present speed over the time on the ramp."""
        seconds = (min(now_ns, self.end_ns) - self.began_ns) * 1e-9
        return self.start + 0.5 * (self.velocity_at_start + self.velocity(now_ns)) * seconds


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
    """All motors of a drive system over one plant; a ramp of a motor overrides what else it was doing."""

    def __init__(self, plant: Plant, sample_time_s: float) -> None:
        self.plant = plant
        self.sample_ns = round(sample_time_s * 1e9)
        self.angle: FloatArray = np.zeros(plant.n_axis)
        self.moves: dict[int, Move] = {}
        self.ramps: dict[int, Ramp] = {}
        self.run: Run | None = None

    def angle_of(self, axis: int, now_ns: int) -> float:
        """Where a motor stands, rad."""
        if axis in self.ramps:
            return self.ramps[axis].angle(now_ns)
        if self.run is not None:
            taken = self.run.taken(now_ns)
            return float(self.run.position[taken - 1, axis]) if taken else float(self.angle[axis])
        if axis in self.moves:
            return self.moves[axis].angle(now_ns)
        return float(self.angle[axis])

    def speed_of(self, axis: int, now_ns: int) -> float:
        """How fast a motor turns, rad/s."""
        if axis in self.ramps:
            return self.ramps[axis].velocity(now_ns)
        if self.run is not None:
            return self.run.speed(axis, now_ns)
        return self.moves[axis].velocity(now_ns) if axis in self.moves else 0.0

    def move(self, axis: int, target: float, speed: float, now_ns: int) -> None:
        """Begin a move of one motor from where it is, at `speed` rad/s."""
        self.moves[axis] = Move(self.angle_of(axis, now_ns), target, speed, now_ns)
        self.ramps.pop(axis, None)

    def slow_down(self, axis: int, deceleration: float, now_ns: int) -> Ramp:
        """Let one motor ramp down to rest, rad/s^2; a ramp under way is only made steeper."""
        angle, velocity = self.angle_of(axis, now_ns), self.speed_of(axis, now_ns)
        ramp = Ramp(angle, velocity, deceleration, now_ns)
        under_way = self.ramps.get(axis)
        if under_way is not None and under_way.end_ns <= ramp.end_ns:
            return under_way
        self.ramps[axis] = ramp
        self.moves.pop(axis, None)
        return ramp

    def settle(self, now_ns: int) -> None:
        """End moves and run; every motor stands where it is now, or goes on with its ramp."""
        self.angle = np.array([self.angle_of(axis, now_ns) for axis in range(self.plant.n_axis)])
        self.ramps = {axis: ramp for axis, ramp in self.ramps.items() if now_ns < ramp.end_ns}
        self.moves, self.run = {}, None

    def track(self, reference: FloatArray, periods: int, kept: int, seed: int, now_ns: int) -> None:
        """Simulate `periods` of a speed reference, rad/s, shape (n_sample, n_axis), from rest here."""
        self.settle(now_ns)
        self.ramps = {}
        self.plant.rest(self.angle)
        position, torque = self.plant.track(np.tile(reference, (periods, 1)), seed)
        self.run = Run(position, torque, kept * len(reference), now_ns, self.sample_ns)


class MotorSystem(Protocol):
    """What an axis needs of its drive system."""

    motors: Motors
    now_ns: int

    def slow_down(self, axis: int, deceleration: float) -> int:
        """Let a motor ramp down to rest; return when it is there, ns."""


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
        self._system.motors.move(self._index, angle, speed, self._system.now_ns)

    def slow_down(self, deceleration: float) -> int:
        """Ramp down to rest at `deceleration` rad/s^2; return when the motor is there, us."""
        return -(-self._system.slow_down(self._index, deceleration) // 1000)

    def halt(self) -> None:
        """Stand still here: the voltage is off and the brake has closed."""
        self._system.slow_down(self._index, math.inf)
