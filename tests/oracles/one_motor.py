"""One motor that moves and rests under a speed loop, integrated here: a foreign plant with real stick, if asked for."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from oracles.rigid_arm import DRIVE, loaded

from robid_core import Record, Robot

STEP, SUB = 0.002, 20
INERTIA, COULOMB, VISCOUS, TURNS = 2e-4, 0.07, 6e-4, 0.2
TORQUE_NOISE = 0.002
LINK = 1e-6  # what turns beside the rotor
COUNT = 2 * np.pi / 16384


def told(folder: Path) -> Robot:
    """A fifth less inertia and a third less friction than the plant has."""
    return loaded(folder, {
        "robid_robot": 1, "name": "motor", "sample_time_s": STEP,
        "bodies": [{"joint": "a", "mass": 1e-3, "inertia": [[LINK, 0, 0], [0, LINK, 0], [0, 0, LINK]]}],
        "gravity": [0, 0, 0],
        "axes": {"a": {**DRIVE, "rotor_inertia": 0.8 * INERTIA,
                       "friction": {"coulomb": 0.05, "viscous": 4e-4, "speed": 0.5},
                       "sensors": {"torque_noise": TORQUE_NOISE, "position_noise": COUNT / np.sqrt(12)}}},
    })  # fmt: skip


def recorded(
    robot: Robot,
    seed: int,
    seconds: float = 30.0,
    *,
    sticks: bool = False,
    rest_s: tuple[float, float] = (0.1, 0.5),
    ripple: tuple[float, float] = (0.0, 1.0),
    swings: bool = False,
) -> Record:
    """Quintic moves of 20 to 120 rad and rests; sampled every 2 ms, integrated every 0.1 ms.

    `sticks`: at rest friction is any torque up to its level. `rest_s`: shortest and longest rest. `ripple`: amplitude,
    N m, and order of a cogging torque. `swings`: six slow sines of the speed in place of moves, which turn back all
    the time; a motor that sticks does so for 20 to 200 ms at each turn.
    """
    draw = np.random.default_rng(seed)
    speeds = [np.zeros(200)]
    if swings:
        time = np.arange(round(seconds / STEP)) * STEP
        turn = 2 * np.pi * draw.uniform(0.1, 1.5, 6) * time[:, None] + draw.uniform(0, 2 * np.pi, 6)
        speeds = [(draw.uniform(2, 15, 6) * np.sin(turn)).sum(axis=1) * np.minimum(time / 0.5, 1)]
    while sum(map(len, speeds)) * STEP < seconds:
        distance, n = draw.choice([-1, 1]) * draw.uniform(20, 120), int(draw.uniform(0.5, 2.0) / STEP)
        x = np.arange(n) / n
        speeds += [
            distance * 30 * (x * (1 - x)) ** 2 / (n * STEP),
            np.zeros(int(draw.uniform(*rest_s) / STEP)),
        ]
    wanted = np.concatenate(speeds)
    angle, torque, q, v, total = np.empty_like(wanted), np.empty_like(wanted), 0.0, 0.0, 0.0
    for k, speed in enumerate(wanted):
        total += (speed - v) * STEP
        u = 40 * INERTIA * (speed - v + 8 * total)
        angle[k], torque[k] = q, u
        for _ in range(SUB):
            push = u - ripple[0] * np.sin(ripple[1] * q)
            if sticks and v == 0 and abs(push) < COULOMB:
                continue
            turned = v + STEP / SUB * (push - COULOMB * _friction(v, push, sticks) - VISCOUS * v) / INERTIA
            v = 0.0 if sticks and v * turned < 0 else turned
            q += STEP / SUB * v
    return Record.from_arrays(
        sample_time_s=STEP,
        robot=robot,
        units={"motor_position": "rad", "motor_torque": "N m"},
        torque_hold="zero_order_hold",
        motor_position=COUNT * np.round(angle / COUNT)[:, None],
        motor_torque=(torque + TORQUE_NOISE * draw.normal(size=len(torque)))[:, None],
    )


def _friction(speed: float, push: float, sticks: bool) -> float:
    """Over its level: within TURNS it turns round, or jumps."""
    if not sticks:
        return float(np.tanh(speed / TURNS))
    return float(np.sign(speed) or np.sign(push))
