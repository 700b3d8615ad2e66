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
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from robid_core.errors import ConfigurationError
from robid_core.mechanics.chain import FloatArray, IntArray
from robid_core.mechanics.lanes import LANES
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
from robid_core.mechanics.simulation_arrays import (
    motors_last,
    plant_arrays,
    robot_arrays,
    spring_weights,
    term_arrays,
    work_memory,
)
from robid_core.mechanics.terms import ForceTerm


@dataclass(frozen=True)
class MotorMotion:
    """How the motors move, in the integrator's steps."""

    angle: FloatArray
    """At the first instant, rad, shape (n_lane, n_axis)."""
    speed: FloatArray
    """At the first instant, rad/s, shape (n_lane, n_axis)."""
    acceleration: FloatArray
    """During each step, rad/s^2, shape (n_lane, n_step, n_axis)."""


class Outputs(NamedTuple):
    """Arrays that the loop fills."""

    torque: FloatArray
    coordinates: FloatArray
    diverged: IntArray
    force: FloatArray


def prescribe(
    mechanism: Mechanism,
    stiffness: FloatArray,
    damping: FloatArray,
    state: SimulationState,
    motion: MotorMotion,
    *,
    forces: Sequence[ForceTerm] = (),
    sample_time: float = 1e-3,
    step: float = 2.5e-4,
    n_thread: int = 1,
) -> Simulation:
    """Motor torques that a motion takes, from given states of everything behind the motors.

    The result's position is that of the motors at the sampling instants, its coordinates are all there are.

    Parameters
    ----------
    mechanism, stiffness, damping
        The robot; spring constants N m/rad and N m s/rad, shape (n_spring,).
    state
        Where each lane starts; angles and speeds of the motors are those of the motion.
    motion
        Of the motors, a whole number of samples long.
    forces
        Laws that act; the state must be of the same ones.
    sample_time, step
        Of torque and integration, s; the sample time is a whole number of steps.
    n_thread
        Lanes are dealt to that many threads; results do not depend on it.

    Raises
    ------
    SimulationDiverged
        Where a lane leaves all bounds.
    """
    mechanism.check_springs(stiffness=stiffness, damping=damping)
    n_step = round(sample_time / step)
    if n_step < 1 or abs(n_step * step - sample_time) > 1e-9 * sample_time:
        raise ConfigurationError(f"prescribe: {sample_time} s is not a whole number of steps of {step} s")
    n_axis, n = mechanism.n_axis, mechanism.n_coordinate
    acceleration = np.ascontiguousarray(motion.acceleration, dtype=np.float64)
    shape = acceleration.shape
    if acceleration.ndim != 3 or shape[2] != n_axis or shape[1] % n_step or not shape[1]:
        raise ConfigurationError(
            f"prescribe: accelerations of shape {shape}; give (n_lane, n_step, {n_axis}) with {n_step} steps a sample"
        )
    if not np.isfinite(acceleration).all():
        raise ConfigurationError("prescribe: the motion holds NaN or infinite values; fill gaps before")
    n_lane, n_sample = shape[0], shape[1] // n_step
    start = replace(
        state,
        position=np.concatenate((motion.angle, state.position[:, n_axis:]), axis=1),
        speed=np.concatenate((motion.speed, state.speed[:, n_axis:]), axis=1),
        law_state=state.law_state[:, : sum(term.n_state for term in forces)],
    )
    width = LANES if n_lane >= FEWEST_LANES else 1
    lanes = lanes_of_state(start, mechanism, forces, n_lane, width)
    weight = spring_weights(mechanism, stiffness, step)
    plant = plant_arrays(mechanism, stiffness, damping, forces, step, weight)
    terms, entries = term_arrays(mechanism, forces, (), width == 1, step, weight)
    arrays = robot_arrays(mechanism, plant, terms)
    outputs = Outputs(
        np.zeros((n_lane, n_sample, n_axis)),
        np.zeros((n_lane, n_sample, n)),
        np.full(n_lane, -1, dtype=np.int64),
        np.zeros((n_lane, len(forces))),
    )

    def share(first: int, last: int) -> None:
        work = work_memory(mechanism, len(forces), lanes.law_state.shape[1], width)
        single = None if width == 1 else width
        run_prescribed(arrays, work, lanes, acceleration, n_step, sample_time, outputs, single, first, last)

    deal(len(lanes.position), n_thread, share)
    del entries  # machine code of the laws, no longer called
    coordinates = outputs.coordinates[..., np.argsort(motors_last(mechanism))]
    result = Simulation(
        coordinates[..., :n_axis].copy(),
        outputs.torque,
        np.zeros((n_lane, n_axis)),
        coordinates,
        state_of_lanes(lanes, mechanism, forces, n_lane),
    )
    if (outputs.diverged >= 0).any():
        raise divergence("prescribe", mechanism, forces, result, outputs.diverged, outputs.force, sample_time)
    return result


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


def mean_over_held(frequency_hz: FloatArray, sample_time: float, step: float) -> FloatArray:
    """Spectrum of `Simulation.torque` over that of the held torque that moves a rotor alike, shape (n_freq,).

    A held torque acts on the motion as sinc(f T) e^(-i pi f T) of its samples; the torque that a band-limited motion
    takes has the mean sinc(f T) e^(i pi f T) over an interval, and steps of constant acceleration that pass through
    the same angles take tan(w h / 2) / (w h / 2) as much. The quotient is real.
    """
    frequency = np.asarray(frequency_hz, dtype=float)
    half = np.pi * frequency * step
    steps = np.divide(np.tan(half), half, out=np.ones_like(half), where=half > 0)
    ratio: FloatArray = steps * np.sinc(frequency * sample_time) ** 2
    return ratio


def _padded(spectrum: npt.NDArray[np.complex128], n_fine: int) -> npt.NDArray[np.complex128]:
    """Return a spectrum with zeros above, for n_fine samples."""
    width = ((0, 0), (0, n_fine // 2 + 1 - spectrum.shape[1]), (0, 0))
    return np.pad(spectrum, width)
