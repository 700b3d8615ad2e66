"""Moves with rests, an everyday encoder, and friction that turns within its noise: a foreign plant of one motor."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from oracles.multisine import context
from oracles.rigid_arm import DRIVE, loaded

from robid_core import Record, Robot
from robid_fit.torque_residual import TorqueResidualFit

STEP, SUB = 0.002, 20
INERTIA, COULOMB, VISCOUS, TURNS = 2e-4, 0.07, 6e-4, 0.2
TORQUE_NOISE = 0.002
LINK = 1e-6  # what turns beside the rotor
COUNT = 2 * np.pi / 16384


def told(folder: Path) -> Robot:
    return loaded(folder, {
        "robid_robot": 1, "name": "motor", "sample_time_s": STEP,
        "bodies": [{"joint": "a", "mass": 1e-3, "inertia": [[LINK, 0, 0], [0, LINK, 0], [0, 0, LINK]]}],
        "gravity": [0, 0, 0],
        "axes": {"a": {**DRIVE, "rotor_inertia": 0.8 * INERTIA,
                       "friction": {"coulomb": 0.05, "viscous": 4e-4, "speed": 0.5},
                       "sensors": {"torque_noise": TORQUE_NOISE, "position_noise": COUNT / np.sqrt(12)}}},
    })  # fmt: skip


def recorded(robot: Robot, seed: int, seconds: float = 30.0) -> Record:
    """Quintic moves of 20 to 120 rad and rests under a speed loop; sampled every 2 ms, integrated every 0.1 ms."""
    draw = np.random.default_rng(seed)
    speeds = [np.zeros(200)]
    while sum(map(len, speeds)) * STEP < seconds:
        distance, n = draw.choice([-1, 1]) * draw.uniform(20, 120), int(draw.uniform(0.5, 2.0) / STEP)
        x = np.arange(n) / n
        speeds += [
            distance * 30 * (x * (1 - x)) ** 2 / (n * STEP),
            np.zeros(int(draw.uniform(0.1, 0.5) / STEP)),
        ]
    wanted = np.concatenate(speeds)
    angle, torque, q, v, total = np.empty_like(wanted), np.empty_like(wanted), 0.0, 0.0, 0.0
    for k, speed in enumerate(wanted):
        total += (speed - v) * STEP
        u = 40 * INERTIA * (speed - v + 8 * total)
        angle[k], torque[k] = q, u
        for _ in range(SUB):
            v += STEP / SUB * (u - COULOMB * np.tanh(v / TURNS) - VISCOUS * v) / INERTIA
            q += STEP / SUB * v
    return Record.from_arrays(
        sample_time_s=STEP,
        robot=robot,
        units={"motor_position": "rad", "motor_torque": "N m"},
        torque_hold="zero_order_hold",
        motor_position=COUNT * np.round(angle / COUNT)[:, None],
        motor_torque=(torque + TORQUE_NOISE * draw.normal(size=len(torque)))[:, None],
    )


@pytest.mark.parametrize(
    "seed", [1, pytest.param(2, marks=pytest.mark.full), pytest.param(3, marks=pytest.mark.full)]
)
def test_friction_and_inertia_are_right_where_an_axis_is_slow(tmp_path: Path, seed: int) -> None:
    """Noise of the speed is half of that within which friction turns: taken as motion it is friction that was not."""
    robot = told(tmp_path)
    fit = TorqueResidualFit(highest_hz=20.0, prior={"rotor_inertia.*": 0.3}).run(
        (recorded(robot, seed),), robot, context()
    )
    table, error = fit.parameters, dict(zip(fit.parameters.names, fit.parameters.standard_error, strict=True))
    assert fit.misfit < 1.6
    truth = {"rotor_inertia.a": INERTIA - LINK, "friction.a.coulomb": COULOMB, "friction.a.viscous": VISCOUS}
    for name, true in truth.items():
        assert abs(table.value(name) - true) < 4 * error[name], name
        assert error[name] < 0.02 * true, name
    assert table.value("friction.a.speed") == pytest.approx(TURNS, rel=0.05)
