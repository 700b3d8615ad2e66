"""Drives: the way to the motors, and the only noun with side effects.

A simulated plant is a *setting of the drives*; no stage can read it. After a simulated run the drives hand
the report a `Truth`. Sides and signs: everything here is at the motor shaft with the sign of the URDF axis.
"""

from __future__ import annotations

import abc
import logging
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar, Protocol

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, ConfigDict

from robid_core.artifacts import Truth
from robid_core.gate import Clearance
from robid_core.robot import Robot

FloatArray = npt.NDArray[np.float64]


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
    """One cleared motion: go to `start`, repeat `reference` `periods` times, keep the last `traced` ones."""

    label: str
    start: FloatArray  # (n_axis,) motor angle, rad
    reference: FloatArray  # (n_sample, n_axis) motor speed, rad/s, one period
    periods: int
    traced: int
    sample_time_s: float
    seed: int
    clearance: Clearance


@dataclass(frozen=True)
class Trace:
    """What the drives sampled on their own clock during the traced periods."""

    position: FloatArray  # (traced, n_sample, n_axis) rad, motor side
    torque: FloatArray  # (traced, n_sample, n_axis) N m, motor side
    valid: npt.NDArray[np.bool_]  # (traced, n_sample)
    saturated: FloatArray  # (n_axis,) share of samples at the torque limit


@dataclass(frozen=True)
class Session:
    """What a motion needs from its surroundings."""

    robot: Robot
    log: logging.Logger
    raw_log: Path | None  # where the raw log goes; None keeps none
    note: Callable[[str], None]  # tells a person what is going on


class Drives(BaseModel, abc.ABC):
    """A way to the motors; its fields are what `drives: {use: ..., with: {...}}` sets."""

    model_config = ConfigDict(
        extra="forbid", frozen=True, strict=True, allow_inf_nan=False, use_attribute_docstrings=True
    )

    moves_hardware: ClassVar[bool] = True
    """True unless nothing but a simulation moves: motion on hardware is never repeated by itself."""

    @abc.abstractmethod
    def open(self, session: Session) -> OpenDrives:
        """Bring the drives up, up to enabled; a context manager stops them on every way out."""

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
