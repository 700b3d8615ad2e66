"""A motor integrated by hand, and records of constant speeds, for the tests of friction."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any

import numpy as np

from robid_core import Channel, Context, DenseRun, Record, Robot
from robid_core.robot import RobotDescription
from robid_core.stage import map_in_process

STEP = 1e-3
INERTIA, GEAR, MASS, LEVER = 1e-3, 50.0, 6.0, 0.3
SMOOTHING = 0.2
Law = Callable[[float, float], float]
"""Friction of speed and load, N m at the motor."""


def context(seed: int = 1) -> Context:
    log = logging.getLogger("test.friction")
    return Context(np.random.default_rng(seed), map_in_process, lambda done, total, note="": None, log)


def machine(axes: tuple[str, ...] = ("arm",), **friction: float) -> Robot:
    """Arms that swing in a vertical plane, stiff gears; each on its own foot."""
    bodies = [
        {"joint": name, "axis": (0.0, 1.0, 0.0), "mass": MASS, "centre_of_mass": (LEVER, 0.0, 0.0),
         "inertia": np.diag([0.1, 0.2, 0.2]).tolist()}
        for name in axes
    ]  # fmt: skip
    told = {"coulomb": 0.3, "viscous": 2e-3, "speed": SMOOTHING, **friction}
    drive: dict[str, Any] = {
        "gear_ratio": GEAR,
        "rotor_inertia": INERTIA,
        "torque_limit": 20.0,
        "speed_limit": 300.0,
        "position_limits": (-3.0, 3.0),
        "controller": {"speed_gain": 0.1, "integral_gain": 1.0},
        "friction": told,
    }
    document = {"robid_robot": 1, "name": "bench", "bodies": bodies, "axes": dict.fromkeys(axes, drive)}
    return Robot(RobotDescription.model_validate(document, strict=False))


def gravity(angle: float) -> float:
    """Torque that the arm asks of its motor at a motor angle, N m: a weight on a lever, about +y."""
    return -MASS * 9.81 * LEVER * float(np.cos(angle / GEAR)) / GEAR


def swept(
    speeds: list[float], law: Law, seconds: float = 1.2, finer: int = 4
) -> tuple[np.ndarray, np.ndarray]:
    """Angle and torque of one motor under a speed loop, to and fro at each speed, each (n_sample,).

    Semi-implicit Euler in quarters of a sample; the torque is held from sample to sample, friction is exact in speed.
    """
    inertia = INERTIA + (MASS * LEVER**2 + 0.2) / GEAR**2
    reference = np.concatenate(
        [sign * np.full(round(seconds / STEP), speed) for speed in speeds for sign in (1.0, -1.0)]
    )
    ramp = np.hanning(200)
    reference = np.convolve(reference, ramp / ramp.sum(), mode="same")
    angle, speed, integral = 0.0, 0.0, 0.0
    angles, torques = np.empty(len(reference)), np.empty(len(reference))
    for k, wanted in enumerate(reference.tolist()):
        error = wanted - speed
        integral += error * STEP
        torque = 0.3 * error + 3.0 * integral + gravity(angle)
        angles[k], torques[k] = angle, torque
        for _ in range(finer):
            load = gravity(angle)
            speed += STEP / finer * (torque - load - law(speed, load)) / inertia
            angle += STEP / finer * speed
    return angles, torques


def record_of(
    robot: Robot,
    experiments: list[tuple[np.ndarray, np.ndarray]],
    line: np.ndarray | None = None,
    **constants: list[float],
) -> Record:
    """Experiments of all axes, angle and torque (n_sample, n_axis) each, as one record."""
    position, torque = (np.stack(x)[None, None, :, None] for x in zip(*experiments, strict=True))
    shape = position.shape
    names = tuple(constants)
    run = DenseRun(
        sample_time_s=STEP,
        channels={
            "motor_position": Channel("motor", "rad", position),
            "motor_torque": Channel("motor", "N m", torque),
        },
        time_s=np.arange(shape[4], dtype=np.float64) * STEP,
        valid=np.ones(shape[:5], dtype=bool),
        constant_names=names,
        constants=np.stack([constants[name] for name in names], axis=-1)[None, None] if names else None,
    )
    return Record(robot.axis_names, "bench", "zero_order_hold", (run,), np.zeros((1, robot.n_axis)), line)


def stuck(
    amplitude: float,
    seconds: float,
    stiffness: float,
    damping: float,
    viscous: float,
    coulomb: float,
    finer: int = 10,
) -> tuple[np.ndarray, np.ndarray]:
    """Angle and torque of one motor under a small torque of three sines, on bristles after LuGre, each (n_sample,).

    ``b' = v - sigma_0 |v| b / F_c``, friction ``sigma_0 b + sigma_1 b' + sigma_2 v``; semi-implicit Euler.
    """
    inertia, step = INERTIA + (MASS * LEVER**2 + 0.2) / GEAR**2, STEP / finer
    n = round(seconds / STEP)
    angle = speed = bristle = 0.0
    angles, torques = np.empty(n), np.empty(n)
    for k in range(n):
        t = k * STEP
        wave = (
            np.sin(2 * np.pi * 1.3 * t)
            + np.sin(2 * np.pi * 3.1 * t + 1.0)
            + np.sin(2 * np.pi * 5.7 * t + 2.0)
        )
        torque = amplitude / 3.0 * float(wave) + gravity(0.0)
        angles[k], torques[k] = angle, torque
        for _ in range(finer):
            rate = speed - stiffness * abs(speed) * bristle / coulomb
            friction = stiffness * bristle + damping * rate + viscous * speed
            speed += step * (torque - gravity(angle) - friction) / inertia
            bristle += step * (speed - stiffness * abs(speed) * bristle / coulomb)
            angle += step * speed
    return angles, torques
