"""Prescribed motion: the motors move as recorded, and the model says what torque that takes.

The third way to run the simulator beside the closed loop (`simulate`) and given torques: elastic coordinates are
integrated under the motors' motion, with the same steps and laws, so that the torque of a simulated motion is given
back to rounding. Controllers, sensors and laws on signals have no part in it: the torque is what acts on the rotor,
motor friction included. It is the mean over each sampling interval, which is what a held torque would have to be.

The integrator moves a motor by ``x' = x + h v + h^2 a / 2, v' = v + h a``. With which accelerations it passes through
given periodic angles says `periodic_motion`: for a line e^(iwt) they are ``-(4 / h^2) sin(wh/2) tan(wh/2) e^(iwh/2)``
times the angle, not quite ``-w^2``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from robid_core.arrays import ComplexArray, FloatArray, IntArray
from robid_core.compiled.lanes import LANES
from robid_core.errors import ConfigurationError
from robid_core.mechanics.mechanical_model import MechanicalModel, motors_last
from robid_core.mechanics.mechanism import Mechanism
from robid_core.mechanics.prescribed_kernel import run_prescribed
from robid_core.mechanics.simulate import (
    FEWEST_LANES,
    Simulation,
    SimulationState,
    deal,
    divergence,
    lanes_of_state,
    state_of_lanes,
)
from robid_core.mechanics.simulation_arrays import robot_arrays, work_memory
from robid_core.mechanics.terms import ForceTerm


@dataclass(frozen=True)
class MotorMotion:
    """How the motors move, in the integrator's steps."""

    angle: FloatArray
    """At the first instant, rad, shape (n_exp, n_axis)."""
    speed: FloatArray
    """At the first instant, rad/s, shape (n_exp, n_axis)."""
    acceleration: FloatArray
    """During each step, rad/s^2, shape (n_exp, n_step, n_axis)."""


class Outputs(NamedTuple):
    """Arrays that the loop fills."""

    position: FloatArray
    torque: FloatArray
    coordinates: FloatArray
    diverged: IntArray
    force: FloatArray


def prescribe(
    models: Sequence[MechanicalModel],
    states: Sequence[SimulationState],
    motion: MotorMotion,
    *,
    sample_time: float = 1e-3,
    step: float = 2.5e-4,
    periods: int = 1,
    keep_coordinates: bool = False,
    n_thread: int = 1,
) -> list[Simulation]:
    """Motor torques that a motion takes of each of several robots, from given states of everything behind the motors.

    Each robot makes all experiments of the motion, n_exp lanes; what a lane gives depends on no other lane. The
    positions that come out are those of the motors at the sampling instants.

    Parameters
    ----------
    models
        Robots of one structure.
    states
        Where each of them starts, of the laws that act on it; angles and speeds of the motors are those of the motion.
    motion
        Of the motors, a whole number of samples long.
    sample_time, step
        Of torque and integration, s; the sample time is a whole number of steps.
    periods
        How often the motion is made, one time after another.
    keep_coordinates
        Whether to return all coordinates.
    n_thread
        Lanes are dealt to that many threads; results do not depend on it.

    Returns
    -------
    A simulation of each robot.

    Raises
    ------
    ConfigurationError
        Where the robots are not of one structure, or shapes do not fit.
    SimulationDiverged
        Where a lane leaves all bounds; the simulations of the robots before are lost.
    """
    n_step = round(sample_time / step)
    if n_step < 1 or abs(n_step * step - sample_time) > 1e-9 * sample_time:
        raise ConfigurationError(f"prescribe: {sample_time} s is not a whole number of steps of {step} s")
    mechanism, forces = _common_structure(models)
    n_axis, n = mechanism.n_axis, mechanism.n_coordinate
    acceleration = np.ascontiguousarray(motion.acceleration, dtype=np.float64)
    shape = acceleration.shape
    if acceleration.ndim != 3 or shape[2] != n_axis or shape[1] % n_step or not shape[1]:
        raise ConfigurationError(
            f"prescribe: accelerations of shape {shape}; give (n_exp, n_step, {n_axis}) with {n_step} steps a sample"
        )
    n_exp, n_sample = shape[0], periods * shape[1] // n_step
    n_lane = len(models) * n_exp
    width = LANES if n_lane >= FEWEST_LANES else 1
    lanes = lanes_of_state(_starts(models, states, motion, n_exp), mechanism, forces, n_lane, width)
    lane = np.minimum(np.arange(len(lanes.position) * width), n_lane - 1)
    robots, numbers = np.unique((lane // n_exp).reshape(-1, width), axis=0, return_inverse=True)
    if (robots == robots[:, :1]).all():
        robots = robots[:, :1]
    arrays, entries = robot_arrays(models, (), robots, width, step)
    outputs = Outputs(
        np.zeros((n_lane, n_sample, n_axis)),
        np.zeros((n_lane, n_sample, n_axis)),
        np.zeros((n_lane, n_sample, n) if keep_coordinates else (0, 0, 0)),
        np.full(n_lane, -1, dtype=np.int64),
        np.zeros((n_lane, len(forces))),
    )
    order, experiment = numbers.astype(np.int64), np.arange(n_lane) % n_exp

    def share(first: int, last: int) -> None:
        work = work_memory(mechanism, len(forces), lanes.law_state.shape[1], width)
        single, own = (None if size == 1 else size for size in (width, robots.shape[1]))
        run_prescribed(
            arrays,
            order,
            work,
            lanes,
            acceleration,
            experiment,
            n_step,
            sample_time,
            outputs,
            single,
            own,
            first,
            last,
        )

    deal(len(lanes.position), n_thread, share)
    del entries  # machine code of the laws, no longer called
    if (outputs.diverged >= 0).any() and not np.isfinite(acceleration).all():
        raise ConfigurationError("prescribe: the motion holds NaN or infinite values; fill gaps before")
    ended = state_of_lanes(lanes, mechanism, forces, n_lane)
    return [
        _result(models[0], outputs, ended, slice(i, i + n_exp), sample_time) for i in range(0, n_lane, n_exp)
    ]


def _result(
    model: MechanicalModel, outputs: Outputs, ended: SimulationState, own: slice, sample_time: float
) -> Simulation:
    """Results of one robot, which are those of its lanes; raises SimulationDiverged where one left all bounds."""
    mechanism, coordinates = model.mechanism, None
    if len(outputs.coordinates):
        coordinates = outputs.coordinates[own][..., np.argsort(motors_last(mechanism))]
    run = Simulation(
        outputs.position[own],
        outputs.torque[own],
        np.zeros_like(outputs.torque[own, 0]),
        coordinates,
        SimulationState(*(getattr(ended, field.name)[own] for field in fields(SimulationState))),
    )
    diverged = outputs.diverged[own]
    if (diverged >= 0).any():
        raise divergence("prescribe", mechanism, model.forces, run, diverged, outputs.force[own], sample_time)
    return run


def _common_structure(models: Sequence[MechanicalModel]) -> tuple[Mechanism, tuple[ForceTerm, ...]]:
    """Mechanism and laws of the first of several robots, which all have in common but for their numbers."""
    if not models:
        raise ConfigurationError("prescribe: no robot; give at least one")
    for model in models:
        model.mechanism.check_springs(stiffness=model.stiffness, damping=model.damping)
    if any(model.structure != models[0].structure for model in models[1:]):
        raise ConfigurationError(
            "prescribe: the robots differ in joints, gears or laws; only robots that differ in numbers run side by side"
        )
    return models[0].mechanism, models[0].forces


def _starts(
    models: Sequence[MechanicalModel], states: Sequence[SimulationState], motion: MotorMotion, n_exp: int
) -> SimulationState:
    """States of all lanes, robot by robot; the motors are where the motion begins."""
    for state in states:
        if len(state.position) != n_exp:
            raise ConfigurationError(
                f"prescribe: {n_exp} experiments and a state of {len(state.position)}; give one state an experiment"
            )
    n_axis, n_state = motion.angle.shape[1], sum(term.n_state for term in models[0].forces)
    whole = {
        field.name: np.concatenate([getattr(state, field.name) for state in states])
        for field in fields(SimulationState)
        if field.name != "law_state"
    }
    for name, motors in (("position", motion.angle), ("speed", motion.speed)):
        whole[name][:, :n_axis] = np.tile(motors, (len(states), 1))
    laws = np.concatenate([state.law_state[:, :n_state] for state in states])
    return SimulationState(**whole, law_state=laws)


def periodic_motion(angle: FloatArray, sample_time: float, step: float, highest_hz: float) -> MotorMotion:
    """Motion of motors through periodic angles, band-limited, with the accelerations that the integrator needs.

    Parameters
    ----------
    angle
        One period at the sampling instants, rad, shape (n_lane, n_sample, n_axis).
    sample_time, step
        s; a whole number of steps a sample.
    highest_hz
        What lies above is left out: noise, which second derivatives blow up.
    """
    n_sample, n_part = angle.shape[1], round(sample_time / step)
    spectrum = np.fft.rfft(angle, axis=1)
    omega = 2 * np.pi * np.arange(spectrum.shape[1]) / (n_sample * sample_time)
    spectrum[:, omega > 2 * np.pi * highest_hz] = 0.0
    half = 0.5 * omega * step
    turn = (-(4 / step**2) * np.sin(half) * np.tan(half) * np.exp(1j * half))[:, None]
    fine = n_part * n_sample
    acceleration = np.fft.irfft(_padded(turn * spectrum, fine), n=fine, axis=1) * n_part
    first, second = (np.fft.irfft(_padded(spectrum, fine), n=fine, axis=1) * n_part)[:, :2].swapaxes(0, 1)
    return MotorMotion(first, (second - first) / step - 0.5 * step * acceleration[:, 0], acceleration)


def mean_over_smooth(frequency_hz: FloatArray, sample_time: float, step: float) -> ComplexArray:
    """Spectrum of `Simulation.torque` over that of the smooth torque that moves a rotor alike, shape (n_freq,).

    The torque that a band-limited motion takes has the mean sinc(f T) e^(i pi f T) over an interval, and steps of
    constant acceleration that pass through the same angles take tan(w h / 2) / (w h / 2) as much. A held torque acts
    on the motion as sinc(f T) e^(-i pi f T) of its samples: over their spectrum the quotient is real.
    """
    frequency = np.asarray(frequency_hz, dtype=float)
    half = np.pi * frequency * step
    steps = np.divide(np.tan(half), half, out=np.ones_like(half), where=half > 0)
    turn = np.pi * frequency * sample_time
    ratio: ComplexArray = steps * np.sinc(frequency * sample_time) * np.exp(1j * turn)
    return ratio


def _padded(spectrum: npt.NDArray[np.complex128], n_fine: int) -> npt.NDArray[np.complex128]:
    """Return a spectrum with zeros above, for n_fine samples."""
    width = ((0, 0), (0, n_fine // 2 + 1 - spectrum.shape[1]), (0, 0))
    return np.pad(spectrum, width)
