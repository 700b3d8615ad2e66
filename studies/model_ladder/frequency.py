"""Ladder in frequency: responses of the models beside those measured on the plant, and their resonances.

Measured as on a robot: speed control, orthogonal random-phase multisines (4.1) on a slow sine, torque and motion of the
last period; the response is the best linear approximation over realisations, ``H = Y U^H (U U^H)^-1`` (3.10). No sensor
noise: what scatters is the plant's own nonlinearity.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigh
from scipy.signal import find_peaks

from robid_core import ComplexArray, FloatArray, Robot
from robid_core.estimation.excitation.multisine import logarithmic_odd_lines, multisine, sine
from robid_core.estimation.response.spectra import response_from_spectra
from robid_core.mechanics.response import hold_factor
from robid_core.mechanics.tool import pose_of
from studies.model_ladder.tracking import TOOL

POSES = {
    "stretched": (0.0, 0.9, -0.7, 0.0, 0.3, 0.0),
    "working": (0.5, 0.3, 0.2, 0.4, -0.8, 0.3),
    "folded": (-0.3, -0.6, 1.0, 0.2, 0.9, 0.5),
}
PERIOD_S = 8.0
BAND_HZ = (1.0, 120.0)
REALISATIONS = 4
N_LINE = 80
FLAT_HZ = 10.0  # flat torque down to 1 Hz would swing the arm too far for one linear model
TORQUE_SHARE = 0.10  # rms of the multisine's torque of a motor alone, of its limit
SINE_SPEED = 25.0  # rad/s
SINE_BIN = 4


@dataclass(frozen=True)
class Responses:
    """Motor torque to motor acceleration and to tool acceleration (world axes) at one pose."""

    frequency_hz: FloatArray
    """(n_freq,)."""
    motor: ComplexArray
    """(rad/s^2)/(N m), (n_freq, n_axis, n_axis)."""
    tool: ComplexArray
    """(m/s^2)/(N m), (n_freq, 3, n_axis)."""


@dataclass(frozen=True)
class Measured:
    """Responses of the plant, and the motion under which they were measured."""

    responses: Responses
    speed_rms: FloatArray
    """Of the multisine's part of the motor speeds, rad/s, (n_axis,)."""
    sine_speed: FloatArray
    """Amplitude of the slow sine's part, rad/s, (n_axis,)."""


def measure(plant: Robot, pose: tuple[float, ...], seed: int) -> Measured:
    """Responses of the plant at a pose by simulated experiments."""
    generator = np.random.default_rng(seed)
    n_axis, n_sample = plant.n_axis, round(PERIOD_S / plant.sample_time_s)
    line = logarithmic_odd_lines(BAND_HZ, N_LINE, PERIOD_S)
    frequency = line / PERIOD_S
    drives = plant.drives
    crossover = drives.speed_gain / (2 * np.pi * drives.rotor_inertia)
    # speed of a free rotor: alike up to FLAT_HZ, its torque beyond; the reference asks for what the loop leaves out
    speed = 1.0 / np.hypot(frequency, FLAT_HZ)[:, None] * np.ones(n_axis)
    free_torque = 2 * np.pi * frequency[:, None] * drives.rotor_inertia * speed
    speed *= TORQUE_SHARE * drives.torque_limit / np.sqrt(0.5 * np.sum(free_torque**2, axis=0))
    amplitude = speed * np.hypot(1.0, frequency[:, None] / crossover)
    references = []
    for _ in range(REALISATIONS):
        phase, own = generator.uniform(0, 2 * np.pi, (2, len(line), n_axis))
        slow = sine(np.full(n_axis, SINE_SPEED), generator.uniform(0, 2 * np.pi, n_axis), SINE_BIN, n_sample)
        references.append(multisine(amplitude, phase, own, line, n_sample) + slow)
    period = np.concatenate(references)
    reference = np.concatenate((period, period, period[:, :1]), axis=1)
    run = plant.simulate(reference, np.tile(pose, (len(reference), 1)), keep_coordinates=True)
    assert run.coordinates is not None
    last = run.coordinates[:, n_sample:]
    torque = run.torque[:, n_sample:]
    joint = last @ plant.mechanism.constraint_map.T
    tool = pose_of(plant.chain, joint, TOOL.body, TOOL.point).position
    omega = 2j * np.pi * frequency[:, None, None]
    u, motor, place = (
        np.fft.rfft(_one_period(signal), axis=1)[:, line].transpose(1, 2, 0) / n_sample
        for signal in (torque, last[..., :n_axis], tool)
    )
    both = response_from_spectra(u, np.concatenate((motor, place), axis=1) * omega**2, frequency)
    rate = np.fft.rfft(_one_period(last[..., :n_axis]), axis=1) * (2j * np.pi / PERIOD_S / n_sample)
    rate = rate * np.arange(rate.shape[1])[None, :, None]
    rms = np.sqrt(2 * np.mean(np.sum(abs(rate[:, line]) ** 2, axis=1), axis=0))
    slow_speed = 2 * np.sqrt(np.mean(abs(rate[:, SINE_BIN]) ** 2, axis=0))
    return Measured(Responses(frequency, both[:, :n_axis], both[:, n_axis:]), rms, slow_speed)


def modelled(robot: Robot, pose: tuple[float, ...], measured: Measured) -> Responses:
    """Responses of a linear model at the same pose, torque held and motion sampled as in the experiment.

    Friction is replaced by its equivalent gain under the measured speeds.
    """
    damping = robot.equivalent_motor_damping(measured.speed_rms, measured.sine_speed)
    model = robot.second_order(np.array([pose]), damping[None])
    mass, loss, stiffness = model.mass[0], model.damping[0], model.stiffness[0]
    joint = robot.equilibrium(np.array([pose])).joint[0]
    tool = pose_of(robot.chain, joint, TOOL.body, TOOL.point).jacobian[3:] @ robot.mechanism.constraint_map
    out = np.concatenate((model.input_map.T, tool))
    omega = 2 * np.pi * measured.responses.frequency_hz
    w = omega[:, None, None]
    moved = np.linalg.solve(stiffness - w**2 * mass + 1j * w * loss, model.input_map.astype(complex))
    hold, image = (factor[:, None, None] for factor in hold_factor(omega, robot.sample_time_s))
    inertial = out @ np.linalg.solve(mass, model.input_map)
    both = -(w**2) * hold * (out @ moved) + image * inertial
    n = robot.n_axis
    return Responses(measured.responses.frequency_hz, both[:, :n], both[:, n:])


def relative_error(found: ComplexArray, truth: ComplexArray, rotor_inertia: FloatArray) -> FloatArray:
    """Distance of two response matrices over the size of the second, (n_freq,).

    Torques (and motor accelerations) are scaled by the root of the rotors' inertia, so that every axis weighs alike.
    """
    scale = np.sqrt(rotor_inertia)
    rows = scale[:, None] if found.shape[1] == len(scale) else 1.0
    difference, size = (np.linalg.norm(rows * part * scale, axis=(1, 2)) for part in (found - truth, truth))
    return np.asarray(difference / size)


def resonances_hz(robot: Robot, pose: tuple[float, ...]) -> FloatArray:
    """Natural frequencies with free motors at the gravity equilibrium, without the motions that no spring resists."""
    model = robot.second_order(np.array([pose]))
    square = eigh(model.stiffness[0], model.mass[0], eigvals_only=True)
    return np.asarray(np.sqrt(square[robot.n_axis :]) / (2 * np.pi))


def peaks_hz(responses: Responses, rotor_inertia: FloatArray) -> FloatArray:
    """Frequencies where the largest singular value of the scaled motor response stands 2 dB above its surroundings."""
    scale = np.sqrt(rotor_inertia)
    size = np.linalg.svd(scale[:, None] * responses.motor * scale, compute_uv=False)[:, 0]
    top, _ = find_peaks(20 * np.log10(size), prominence=2.0)
    return np.asarray(responses.frequency_hz[top])


def _one_period(signal: FloatArray) -> FloatArray:
    """A period (n_lane, n, ...) of n + 1 samples, less the straight drift that a speed loop leaves."""
    n = signal.shape[1] - 1
    drift = signal[:, -1:] - signal[:, :1]
    return np.asarray(signal[:, :n] - drift * (np.arange(n) / n)[None, :, None])
