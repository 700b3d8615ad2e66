"""Drives: the way to the motors, and the only noun with side effects.

A simulated plant is a *setting of the drives*; no stage can read it. After a simulated run the drives hand
the report a `Truth`. Sides and signs: everything here is at the motor shaft with the sign of the URDF axis.
"""

from __future__ import annotations

import abc
import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, ConfigDict

from robid_core.arrays import FloatArray
from robid_core.artifacts import Channel, DenseRun, Record, Truth, frozen
from robid_core.artifacts.record import MOTOR_POSITION, MOTOR_TORQUE, SPEED_REFERENCE
from robid_core.gate import Clearance
from robid_core.robot import Robot
from robid_core.yaml_file.problems import KeyPath


class Plant(Protocol):
    """What stands behind simulated drives: motors, gears and arm, stepped in simulated time.

    The core's kernel is one; a double integrator or MuJoCo in tests are others.
    """

    n_axis: int

    def rest(self, motor_angle: FloatArray) -> None:
        """Stand still at these motor angles (rad, shape (n_axis,)), gravity held."""

    def track(self, speed_reference: FloatArray, seed: int) -> tuple[FloatArray, FloatArray]:
        """Follow a speed reference in closed loop, from the present state, one row per control sample.

        Takes rad/s, shape (n_sample, n_axis). Returns (position in rad, torque in N m), each of that shape:
        position sampled at the instant, torque held from that instant to the next.
        """


@dataclass(frozen=True)
class Experiment:
    """One cleared motion: go to `start`, repeat `reference` `periods` times, keep the last `traced` ones.

    >>> import numpy as np, robid_core as robid
    >>> still, one = np.zeros(1), np.ones(1)
    >>> limits = robid.MotionLimits(("axis_1",), -one, one, 2 * one, 1000 * one)
    >>> wave = np.sin(2 * np.pi * np.arange(1000) / 1000)[:, None]
    >>> clearance = robid.clear_motion(still, wave, 0.001, 2, limits)
    >>> robid.Experiment("first", still, wave, 2, 1, 0.001, 0, clearance).cleared
    True
    """

    label: str
    start: FloatArray  # (n_axis,) motor angle, rad
    reference: FloatArray  # (n_sample, n_axis) motor speed, rad/s, one period
    periods: int
    traced: int
    sample_time_s: float
    seed: int
    clearance: Clearance

    @property
    def cleared(self) -> bool:
        """Whether exactly this motion went through the safety gate; nothing else may be sent."""
        return self.clearance.covers(self.start, self.reference, self.sample_time_s, self.periods)


@dataclass(frozen=True)
class Trace:
    """What the drives sampled on their own clock during the traced periods."""

    position: FloatArray  # (traced, n_sample, n_axis) rad, motor side
    torque: FloatArray  # (traced, n_sample, n_axis) N m, motor side
    valid: npt.NDArray[np.bool_]  # (traced, n_sample)
    saturated: FloatArray  # (n_axis,) share of samples at the torque limit
    reference: FloatArray  # (n_sample, n_axis) rad/s, one period as the drives applied it
    time_s: float  # clock of the drives at the first sample
    position_unit: FloatArray | None = None  # (n_axis,) rad per increment, where positions are whole ones
    torque_unit: FloatArray | None = None  # (n_axis,) N m per increment, likewise
    reference_unit: FloatArray | None = None  # (n_axis,) rad/s per increment, likewise


ExperimentIndex = tuple[int, int, int]
"""Configuration, block, experiment."""


@dataclass(frozen=True)
class RecordPlan:
    """What an acquisition is going to measure: everything of its record but the traces."""

    axis_names: tuple[str, ...]
    source: str
    sample_time_s: float
    n_block: int
    n_exp: int
    n_period: int
    n_sample: int
    angle: FloatArray  # (n_config, n_axis) rad, joint side
    line: npt.NDArray[np.int64]  # (n_freq,); empty where the motion is not for a frequency response


def assemble_record(plan: RecordPlan, traces: Mapping[ExperimentIndex, Trace]) -> Record:
    """Record of a plan from the traces of its experiments.

    What was not measured is NaN and not valid, a trace that is not there included. Without lines the record has none.

    >>> import numpy as np, robid_core as robid
    >>> plan = robid.RecordPlan(("axis_1",), "bench", 0.001, 1, 2, 1, 50, np.zeros((1, 1)), np.array([5]))
    >>> wave, all_valid = np.zeros((1, 50, 1)), np.ones((1, 50), dtype=bool)
    >>> trace = robid.Trace(wave, wave, all_valid, np.zeros(1), wave[0], time_s=0.0)
    >>> record = robid.assemble_record(plan, {(0, 0, 0): trace})  # the second experiment was not measured
    >>> record.run.valid.shape, int(record.run.valid.sum())
    ((1, 1, 2, 1, 50), 50)
    """
    shape = (len(plan.angle), plan.n_block, plan.n_exp, plan.n_period, plan.n_sample, len(plan.axis_names))
    position, torque, reference = (np.full(shape, np.nan) for _ in range(3))
    valid = np.zeros(shape[:-1], dtype=bool)
    for place, trace in traces.items():
        position[place], torque[place], valid[place] = trace.position, trace.torque, trace.valid
        reference[place] = trace.reference  # the same in every period
    channels = {
        MOTOR_POSITION: Channel("motor", "rad", frozen(position)),
        MOTOR_TORQUE: Channel("motor", "N m", frozen(torque)),
        SPEED_REFERENCE: Channel("motor", "rad/s", frozen(reference)),
    }
    time_s = np.arange(plan.n_sample, dtype=float) * plan.sample_time_s
    line = plan.line if len(plan.line) else None
    run = DenseRun(plan.sample_time_s, channels, time_s, valid)
    return Record(plan.axis_names, plan.source, "zero_order_hold", (run,), plan.angle, line)


class RawLog(Protocol):
    """Where a motion is kept as it happens; a log format (`robid.records`) makes one with `create(path)`.

    Times are those of the drives' clock in seconds. The file grows beside its final name until `close`.
    """

    def attach(self, name: str, media_type: str, content: bytes) -> None:
        """Keep a whole file, such as the robot's description."""

    def plan(self, plan: RecordPlan) -> None:
        """Keep what is going to be measured, before anything moves."""

    def event(self, time_s: float, text: str) -> None:
        """Keep what happened."""

    def frame(self, time_s: float, identifier: int, data: bytes) -> None:
        """Keep one frame of a bus."""

    def bulk(self, time_s: float, note: str, n_frame: int, n_byte: int) -> None:
        """Count the frames of a bulk transfer, whose content is kept as a trace."""

    def trace(self, place: ExperimentIndex, label: str, trace: Trace) -> None:
        """Keep what was measured in one experiment."""

    def close(self, complete: bool) -> None:
        """Finish the file; only a complete one gets its final name."""


@dataclass(frozen=True)
class Session:
    """Services of a run for its motions."""

    robot: Robot
    log: logging.Logger
    raw_log: RawLog | None  # None keeps none
    note: Callable[[str], None]  # tells a person what is going on


class Drives(BaseModel, abc.ABC):
    """Base of all drives, the way to the motors; its fields are what `drives: {use: ..., with: {...}}` sets."""

    model_config = ConfigDict(
        extra="forbid", frozen=True, strict=True, allow_inf_nan=False, use_attribute_docstrings=True
    )

    @property
    def moves_hardware(self) -> bool:
        """True unless nothing but a simulation moves: motion on hardware is never repeated by itself."""
        return True

    @abc.abstractmethod
    def open(self, session: Session) -> OpenDrives:
        """Bring the drives up, up to enabled; a context manager stops them on every way out."""

    def problems_with(self, robot: Robot) -> Mapping[KeyPath, str]:
        """Say which settings this robot cannot have, by their place; empty where there are none. See `Stage`."""
        del robot
        return {}

    def truth(self, robot: Robot) -> Truth | None:
        """Return the simulated plant's parameters; None on hardware."""
        del robot
        return None


class OpenDrives(Protocol):
    """Drives that are up: a context manager that runs experiments one by one."""

    def __enter__(self) -> OpenDrives:
        """Enter; the drives are enabled."""

    def __exit__(self, *exception: object) -> None:
        """Stop the motors in a controlled way and hand the bus back."""

    def perform(self, experiment: Experiment) -> Trace:
        """Move to the start, run the cleared reference and read the trace back."""
