"""Effects: one physical phenomenon in one file, one law used three times (simulate, linearise, fit).

Three kinds, three signatures, one noun: `ForceEffect` (a force that depends on motion, load and a state of its
own), `SignalEffect` (on a command or a measurement) and `StructureEffect` (Robot -> Robot). A hidden effect
and a candidate cause are the same noun. In this version the simulator knows one law, the Coulomb and viscous friction
of the drives (`mechanics.friction`); `friction.coulomb_viscous` states it as an effect, and no robot file names effects
yet.
"""

from __future__ import annotations

import abc
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
import numpy.typing as npt

from robid_core.robot import Robot

FloatArray = npt.NDArray[np.float64]
Side = Literal["motor", "gear", "arm"]

# (position, velocity, load, state, parameters, step) -> (force, slope in position, slope in velocity, next state);
# all float64 scalars but `parameters`, a float64 array in the order of the effect's table. Compiled by numba.
ForceLaw = Callable[[float, float, float, float, FloatArray, float], tuple[float, float, float, float]]


@dataclass(frozen=True)
class Parameter:
    """One row of an effect's table."""

    name: str
    unit: str
    default: float
    lower: float
    upper: float
    description: str


class Effect(abc.ABC):
    """One phenomenon: where it sits, its parameters, and where the theory comes from."""

    source: ClassVar[str]
    """The paper or book of the law."""
    parameters: ClassVar[tuple[Parameter, ...]]
    """The table: name, unit, default and bounds."""

    @classmethod
    def defaults(cls) -> FloatArray:
        """Return the default parameter values in the order of the table."""
        return np.array([parameter.default for parameter in cls.parameters])


class ForceEffect(Effect):
    """A force against the motion at a stated side of the gear."""

    sides: ClassVar[tuple[Side, ...]]
    """Where the effect may sit."""

    @classmethod
    @abc.abstractmethod
    def law(cls) -> ForceLaw:
        """Return the compiled law that the simulator calls."""

    @classmethod
    @abc.abstractmethod
    def equivalent_damping(
        cls, parameters: FloatArray, speed_rms: FloatArray, slow_sine_speed: FloatArray
    ) -> FloatArray:
        """Return E[d force / d velocity] under a Gaussian speed on top of a slow sine (statistical linearisation)."""

    @classmethod
    def regressor(cls, velocity: FloatArray, parameters: FloatArray) -> dict[str, FloatArray]:
        """Return the force per unit of each parameter in which it is linear; empty where there is none."""
        del velocity, parameters
        return {}


class SignalEffect(Effect):
    """A distortion of a command or a measurement: ripple, delay, quantisation, gain."""

    @classmethod
    @abc.abstractmethod
    def apply(cls, signal: FloatArray, angle: FloatArray, parameters: FloatArray, step: float) -> FloatArray:
        """Return the distorted signal, sampled every `step` seconds while the motor stood at `angle`."""


class StructureEffect(Effect):
    """A change of the robot itself: payload, extra coordinate, foundation."""

    @classmethod
    @abc.abstractmethod
    def apply(cls, robot: Robot, parameters: FloatArray) -> Robot:
        """Return the robot with the effect in it."""
