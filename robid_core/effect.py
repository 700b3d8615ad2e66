"""Effects: one physical phenomenon in one file, one law used three times (simulate, linearise, fit).

Three kinds, three signatures, one noun: `ForceEffect` (a force that depends on motion, load and a state of its
own), `SignalEffect` (on a command or a measurement) and `StructureEffect` (Robot -> Robot; `robot/structure_effect.py`,
nothing here knows robots). A hidden effect and a candidate cause are the same noun.

A law is one scalar function, compiled by numba (`robid_core.mechanics.kernel`). Written without `if` - with `where`,
`min`, `max`, `abs` and the functions of `robid_core.mechanics` - it runs on eight experiments at once; with
branches or library functions it still runs, one experiment after the other. `robid_core.testing.check_effect` tells
whether it keeps to all of this.
"""

from __future__ import annotations

import abc
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np
import numpy.typing as npt

from robid_core.arrays import ComplexArray, FloatArray
from robid_core.compiled.laws import Law
from robid_core.mechanics.terms import ForceTerm, SignalTerm

Side = Literal["motor", "gear", "arm", "bearing"]
SignalChannel = Literal["torque", "position", "torque_measurement"]


@dataclass(frozen=True)
class Parameter:
    """One row of an effect's table."""

    name: str
    unit: str
    default: float
    lower: float
    upper: float
    description: str


@dataclass(frozen=True)
class TestValue:
    """Expected value of a law for stated arguments, and its source.

    Arguments are those of the law by name (position, velocity, load, step, signal, angle, speed; state as a tuple) and
    parameters of the table by name; what is left out is zero, or the parameter's default. Expected: force or signal,
    slope_position, slope_velocity, next_state (a tuple). A number of the place (stiffness, damping, gear_ratio,
    rotor_inertia, torque_constant, torque_limit, sample_time) may be named too, where no parameter has that name; else
    there is no spring, samples of 1 ms and steps of 0.25 ms.
    """

    __test__ = False  # no test class of pytest

    arguments: Mapping[str, Any]
    expected: Mapping[str, Any]
    origin: str
    tolerance: float = 1e-9
    """Relative to the largest of 1 and the expected value."""


@dataclass(frozen=True, eq=False)
class Place:
    """Where an effect sits: an axis (or bearing) of a robot, its side, and the numbers there that a law may need."""

    name: str
    """Name of the axis or bearing."""
    axis: int
    """Index of the axis; of the axis whose joint the bearing follows."""
    side: str
    """Side of a force (motor, gear, arm, bearing) or channel of a signal."""
    label: str
    """The effect's name in the robot file."""
    stiffness: float
    """Of the linear spring at the place (gear, bearing), N m/rad; 0 where there is none."""
    damping: float
    """Of the damper beside it, N m s/rad."""
    gear_ratio: float
    """Motor turns per joint turn."""
    rotor_inertia: float
    torque_constant: float
    torque_limit: float | None
    """None: the robot file states none."""
    sample_time: float
    """Of control and measurement, s."""
    step: float
    """Of the integration, s."""
    direction: FloatArray
    """Row over the generalised coordinates that gives the place's coordinate, shape (n_coordinate,)."""
    motor: FloatArray
    """Row that gives the axis' motor angle."""
    transmission: FloatArray
    """Row that gives the deflection of the axis' gear, joint side; zeros where the gear is rigid."""
    load: FloatArray
    """Row over the torques of the transmissions that gives the load at the place, shape (n_axis,)."""
    motor_load: FloatArray
    """Row that gives the transmission's torque at the motor shaft, shape (n_axis,)."""


@dataclass(frozen=True, eq=False)
class Motion:
    """The motion about which a law is linearised, at the place's coordinate; every field a number or an array.

    A small multisine (Gaussian in position and velocity) on top of a slow sine, about a mean position, under a
    mean load.
    """

    velocity_rms: npt.ArrayLike = 0.0
    """Of the Gaussian part, rad/s."""
    sine_speed: npt.ArrayLike = 0.0
    """Amplitude of the slow sine's velocity, rad/s."""
    position_bias: npt.ArrayLike = 0.0
    """rad."""
    position_rms: npt.ArrayLike = 0.0
    """Of the Gaussian part, rad."""
    sine_omega: npt.ArrayLike = 0.0
    """Of the slow sine, rad/s; 0 where not known."""
    load: npt.ArrayLike = 0.0
    """Mean torque of the transmission at the place, N m."""
    omega: npt.ArrayLike = 0.0
    """Where the gain of a law with memory is wanted, rad/s."""
    signal_rms: npt.ArrayLike = 0.0
    """Of the Gaussian part of a channel's signal, in its unit: what a limit clips."""


@dataclass(frozen=True, eq=False)
class Equivalent:
    """Linear spring and damper that stand for a law under a motion, at the place's coordinate."""

    stiffness: FloatArray
    damping: FloatArray


class Effect(abc.ABC):
    """Base of all effects: one physical phenomenon with its places, its parameters and its source."""

    source: ClassVar[str]
    """The paper or book of the law."""
    parameters: ClassVar[tuple[Parameter, ...]]
    """The table: name, unit, default and bounds."""
    test_values: ClassVar[tuple[TestValue, ...]] = ()
    """Values of the law that are known from elsewhere."""
    searched: ClassVar[bool] = True
    """Whether a diagnosis tries it unasked; not one of which a law with fewer numbers is a special case."""
    smoothest: ClassVar[Mapping[str, float]] = {}
    """Values with which a law that has corners has none, nearly: where a fit goes astray, it begins again from them."""

    @classmethod
    def defaults(cls) -> FloatArray:
        """Return the default parameter values in the order of the table."""
        return np.array([parameter.default for parameter in cls.parameters])

    @classmethod
    def starts(cls, place: Place | None) -> tuple[Mapping[str, float], ...]:
        """Return values with which a diagnosis begins its search, one search each; it scales what is left out.

        `place` is where the effect would sit; None for a change of the robot itself.
        """
        del place
        return ({},)


class _LawEffect(Effect):
    law: ClassVar[Law]
    """The compiled law."""
    n_state: ClassVar[int] = 0
    """Length of the law's own state."""

    @classmethod
    def arguments(cls, parameters: FloatArray, place: Place) -> FloatArray:
        """Return what the law receives: the parameters of the table, and what else it needs of its place."""
        del place
        return np.array(parameters, dtype=np.float64)


class ForceEffect(_LawEffect):
    """A force against the motion at a stated side of the gear.

    law(position, velocity, load, state, next_state, parameters, step) -> (force, slope_position, slope_velocity)

    All numbers are float64; state and next_state (n_state,) and parameters are indexed arrays. The generalised force on
    the place's coordinate is minus `force`. The law returns the force at the middle of the step and its slopes
    there; the slope in velocity holds what the velocity does to the state within half a step. It writes the
    state at the end of the
    step, advanced at constant velocity in a way that is stable for any step, into next_state. With step = 0 the
    state stays and the force is the static one.
    """

    sides: ClassVar[tuple[Side, ...]]
    """Where the effect may sit; the first is the default."""

    searched_at: ClassVar[tuple[Side, ...]] = ()
    """Sides beside the first at which a diagnosis tries it: only `arm`, behind gears that are elastic."""

    @classmethod
    def bind(cls, parameters: FloatArray, place: Place) -> tuple[ForceTerm, ...]:
        """Return the terms that the simulator runs: one at the place, unless the law sees another coordinate."""
        arguments = cls.arguments(parameters, place)
        return (
            ForceTerm(
                cls.law, arguments, place.direction, place.direction, place.load, cls.n_state, place.label
            ),
        )

    @classmethod
    def linearize(cls, parameters: FloatArray, place: Place, motion: Motion) -> Equivalent:
        """Return the spring and damper that a small signal sees in a law at a motor or on the arm.

        E[d force / d position] and E[d force / d velocity] under the motion (statistical linearisation); by numerical
        integration of the law here, in closed form where an effect has one. Laws along springs are taken with their
        slope at rest, or along a motion (`forces_along`).
        """
        from robid_core.mechanics.statistical import linearize_law

        stiffness, damping = linearize_law(
            cls.law,
            cls.arguments(parameters, place),
            cls.n_state,
            step=place.step,
            velocity_rms=motion.velocity_rms,
            sine_speed=motion.sine_speed,
            position_bias=motion.position_bias,
            position_rms=motion.position_rms,
            sine_omega=motion.sine_omega,
            load=motion.load,
            omega=motion.omega,
        )
        return Equivalent(stiffness, damping)

    @classmethod
    def regressor(
        cls,
        position: FloatArray,
        velocity: FloatArray,
        load: FloatArray,
        parameters: FloatArray,
        place: Place,
    ) -> dict[str, FloatArray]:
        """Return the force per unit of each parameter in which it is linear; empty where there is none.

        `effect_columns` gives these to fits, and differences of the law for all other parameters.
        """
        del position, velocity, load, parameters, place
        return {}

    @classmethod
    def hardly_told(
        cls, parameters: FloatArray, place: Place, positions: Sequence[FloatArray]
    ) -> Mapping[str, str]:
        """Return the parameters that the data do not determine though a fit states small errors, with the reason.

        A verdict states no error of them, and repeats the sentence beside the cause. Where a motion reaches one end of
        a law only, a fit takes what it cannot know from the shape of the law near that end. `positions` are those that
        the law sees in each experiment, (n_time,) each.
        """
        del parameters, place, positions
        return {}


class SignalEffect(_LawEffect):
    """A distortion of a command or a measurement: ripple, delay, quantisation, gain.

    law(signal, angle, speed, state, next_state, parameters, step) -> signal

    On the channel "torque" it turns the commanded into the acting motor torque, once every integration step, with the
    motor's angle and speed in the middle of the step, and returns the mean over the step. On "position" (true to
    measured motor angle; the controller sees it) and "torque_measurement" it is called at every sampling instant.
    """

    channels: ClassVar[tuple[SignalChannel, ...]]
    """Where the effect may sit; the first is the default."""
    invertible: ClassVar[bool] = True
    """Whether the commanded torque follows from the acting one. Of a limit it does not: fits ask such a law
    about the recorded torque of its axis, noise and all, and all other laws about the torque that the model expects."""

    @classmethod
    def bind(cls, parameters: FloatArray, place: Place) -> tuple[SignalTerm, ...]:
        """Return the terms that the simulator runs."""
        arguments = cls.arguments(parameters, place)
        return (SignalTerm(cls.law, arguments, place.axis, place.side, cls.n_state, None, place.label),)

    @classmethod
    @abc.abstractmethod
    def gain(cls, parameters: FloatArray, place: Place, omega: FloatArray, motion: Motion) -> ComplexArray:
        """Return the complex gain that a small signal sees at omega (rad/s), shape (n_freq,)."""

    @classmethod
    def regressor(
        cls,
        signal: FloatArray,
        angle: FloatArray,
        speed: FloatArray,
        parameters: FloatArray,
        place: Place,
    ) -> dict[str, FloatArray]:
        """Return the change of the signal per unit of each parameter in which it is linear; empty: none."""
        del signal, angle, speed, parameters, place
        return {}

    @classmethod
    def draw(
        cls,
        parameters: FloatArray,
        place: Place,
        shape: tuple[int, int],
        generator: np.random.Generator,
    ) -> FloatArray | None:
        """Return what is added to the channel, shape (n_lane, n_sample), drawn before the run; None: nothing."""
        del parameters, place, shape, generator
        return None
