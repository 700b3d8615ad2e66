"""How an effect changes the frequency response of a drive: simulated with and without it, at two amplitudes.

The packaged robot `one_axis`, a motor that drives an arm through an elastic gear, follows a multisine on odd lines on
top of a slow sine in closed loop. The response is the best linear approximation, motor acceleration over motor torque,
each against the reference: ``sum(Y R*) / sum(U R*)`` over realisations of the phases (Pintelon and Schoukens 2012,
chapter 3). Effects that need more joints are tried on the packaged `six_axis`, at the axis that moves.
"""

from __future__ import annotations

import functools

import numpy as np

from generated_pages.chart import Curve, chart
from robid_core import ComplexArray, FloatArray, Robot

PERIOD_S, PERIODS, SLOW_SINE_HZ, SLOW_SINE_SPEED = 2.0, 2, 1.0, 9.0
BAND_HZ, LINES, REALISATIONS, SEED = (4.0, 80.0), 40, 8, 1
AMPLITUDES = (
    (400.0, "second", "small motion"),
    (2000.0, "first", "five times larger"),
)  # rms acceleration, rad/s^2
POSE = 0.4  # rad: gravity loads the gear


@functools.cache
def lines() -> FloatArray:
    """Return the excited lines in Hz: odd bins, logarithmic, each once."""
    grid = np.geomspace(*BAND_HZ, LINES) * PERIOD_S
    return np.unique(2 * np.round((grid - 1) / 2) + 1) / PERIOD_S


def measured(robot: Robot, axis: int) -> ComplexArray:
    """Return motor acceleration over motor torque of an axis, (rad/s^2)/(N m), shape (n_amplitude, n_line)."""
    n = round(PERIOD_S / robot.sample_time_s)
    time = robot.sample_time_s * np.arange(n)
    omega = 2 * np.pi * lines()
    phases = np.random.default_rng(SEED).uniform(0, 2 * np.pi, (REALISATIONS, len(omega)))
    waves = np.sin(time[:, None] * omega + phases[:, None]) / omega * np.sqrt(2 / len(omega))
    slow = SLOW_SINE_SPEED * np.sin(2 * np.pi * SLOW_SINE_HZ * time)
    multisine = np.stack([rms * waves.sum(axis=-1) for rms, _, _ in AMPLITUDES]).reshape(-1, n)
    reference = np.zeros((len(multisine), PERIODS * n, robot.n_axis))
    reference[..., axis] = np.tile(multisine + slow, (1, PERIODS))
    run = robot.simulate(reference, np.full((len(reference), robot.n_axis), POSE), seed=SEED)
    bins = np.round(lines() * PERIOD_S).astype(int)
    spectra = (np.fft.rfft(v[:, -n:, axis], axis=1)[:, bins] for v in (run.position, run.torque, reference))
    angle, torque, asked = (v.reshape(len(AMPLITUDES), REALISATIONS, -1) for v in spectra)
    response: ComplexArray = (
        -(omega**2) * (angle * asked.conj()).sum(axis=1) / (torque * asked.conj()).sum(axis=1)
    )
    return response


@functools.cache
def _without(name: str, axis: int) -> ComplexArray:
    return measured(Robot.load(name), axis)


def fingerprint(robot: Robot, base: str, axis: int) -> list[str]:
    """Return two charts: change of magnitude and of phase against the same robot without the effect."""
    ratio = measured(robot, axis) / _without(base, axis)
    magnitude, phase = [], []
    for row, (_, style, name) in zip(ratio, AMPLITUDES, strict=True):
        magnitude.append(Curve(lines(), 20 * np.log10(np.abs(row)), style, name))
        phase.append(Curve(lines(), np.degrees(np.angle(row)), style, name))
    across = "frequency, Hz"
    return [
        chart(
            "Change of the response", across, "magnitude, dB", magnitude, logarithmic=True, least_height=0.2
        ),
        chart("Change of the response", across, "phase, degrees", phase, logarithmic=True, least_height=1.0),
    ]
