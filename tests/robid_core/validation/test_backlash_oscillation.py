"""Backlash in the gear of two free masses: the period of free swinging in closed form, and the describing function.

Without damping the deflection flies through the gap at constant speed and is thrown back by a flank in half a period of
the spring: T = 2 pi / w + 2 gap / (w a), a the bend of the spring at the turning point. A forced swing of amplitude A
meets the stiffness N(A) (Gelb and Vander Velde 1968).
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

from robid_core import Robot

MOTOR, LOAD, STIFFNESS, GAP = 1e-3, 3e-3, 60.0, 2e-3
ROBOT = f"""
robid_robot: 1
name: coupling
gravity: [0, 0, 0]
sample_time_s: 1.0e-4
step_s: 1.0e-4
bodies:
  - {{joint: axis_1, mass: 1.0, inertia: [[0.01, 0, 0], [0, 0.01, 0], [0, 0, {LOAD}]]}}
axes:
  axis_1:
    gear_ratio: 1.0
    rotor_inertia: {MOTOR}
    torque_limit: 1.0e+6
    speed_limit: 1.0e+6
    gear: {{stiffness: {STIFFNESS}, damping: DAMPING}}
    controller: {{speed_gain: 0.0}}
effects:
  play: {{use: transmission.backlash, on: axis_1, side: gear, with: {{gap: {GAP}}}}}
"""
OMEGA = np.sqrt(STIFFNESS * (1 / MOTOR + 1 / LOAD))


def _deflection(folder: Path, damping: float, torque: Any, motor_speed: Any = None) -> Any:
    path = folder / "robot.yaml"
    path.write_text(ROBOT.replace("DAMPING", f"{damping}"))
    robot = Robot.load(str(path))
    start = np.zeros((len(torque), 1))
    run = robot.drive(torque, start, keep_coordinates=True) if motor_speed is None else None
    if run is None:
        from dataclasses import replace

        from robid_core.robot.plant import drive_open_loop, standing

        state = standing(robot, start)
        speed = np.zeros((len(torque), 2))
        speed[:, 0] = motor_speed
        run = drive_open_loop(robot, torque, replace(state, speed=speed), keep_coordinates=True)
    return run.coordinates[..., 0] - run.coordinates[..., 1]


def test_the_period_of_free_swinging_is_that_of_flight_and_bounce(tmp_path: Path) -> None:
    bend = GAP * np.array([0.5, 1.0, 3.0, 10.0])  # of the spring, at the turning point
    deflection = _deflection(tmp_path, 0.0, np.zeros((4, 40000, 1)), motor_speed=bend * OMEGA)
    for d, a in zip(deflection, bend, strict=True):
        up = np.flatnonzero((d[1:-1] < 0) & (d[2:] >= 0)) + 1
        crossing = up - d[up] / (d[up + 1] - d[up])
        period = 1e-4 * (crossing[-1] - crossing[0]) / (len(crossing) - 1)
        # corners rounded over a tenth of the gap, and a thousandth of the stiffness inside it: 2 % of the
        # smallest bend,
        # less where the swing is large
        assert period == pytest.approx(2 * np.pi / OMEGA + 2 * GAP / (OMEGA * a), rel=0.01 * (GAP / a) ** 0.5)
        assert abs(d).max() == pytest.approx(GAP / 2 + a, rel=0.02)


def described(amplitude: float) -> float:
    """Share of the spring that a sine meets (Gelb and Vander Velde 1968, dead zone with sharp corners)."""
    mu = GAP / (2 * amplitude)
    return float(1 - 2 / np.pi * (np.arcsin(mu) + mu * np.sqrt(1 - mu**2)))


@pytest.mark.parametrize("share", [0.35, 0.5, 0.65])
def test_a_forced_swing_meets_the_stiffness_of_the_describing_function(tmp_path: Path, share: float) -> None:
    # Motor torque at a frequency above the resonance of the closed gap, where one amplitude only is possible:
    # deflection = torque / J / (k_N (1/J + 1/L) - w^2), half of it or more by the spring.
    omega = 2 * np.pi * 50.0
    assert 1.0 < omega / OMEGA < 1.2
    amplitude = float(brentq(lambda a: described(a) - share, GAP / 2, 50 * GAP))
    stiffness, damping = share * STIFFNESS, 0.05
    both = 1 / MOTOR + 1 / LOAD
    torque = amplitude * MOTOR * abs(stiffness * both - omega**2 + 1j * omega * damping * share * both)
    n_period, per_period = 200, 200
    t = 1e-4 * np.arange(n_period * per_period)
    push = (torque * np.sin(omega * t))[None, :, None]
    d = _deflection(tmp_path, damping, push)[0, -20 * per_period :]
    first = 2 * np.mean(d * np.exp(-1j * omega * t[-20 * per_period :]))
    # The third harmonic of the gap's torque is up to 1/5 of the first; the masses answer it with less than (1/3)^2 of
    # that, which moves the first by a few per cent.
    assert abs(first) == pytest.approx(amplitude, rel=0.06)
    unsprung = torque / MOTOR / omega**2
    assert abs(first) > 1.2 * unsprung  # the spring matters
