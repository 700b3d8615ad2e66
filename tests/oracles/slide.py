"""A mass on a slide under a sampled cascade, in closed form from sample to sample."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from robid_core import Channel, DenseRun, Record, Robot

STEP, MASS, VISCOUS, OFFSET, LIMIT = 1e-3, 90.0, 200.0, -3.0, 4000.0
POSITION_GAIN, SPEED_GAIN = 20.0, 5000.0


def slide(folder: Path, limit: float = LIMIT, **friction: float) -> Robot:
    data = {
        "robid_robot": 1,
        "name": "slide",
        "bodies": [{"joint": "x", "type": "prismatic", "axis": [1, 0, 0], "mass": MASS - 1.0}],
        "axes": {
            "x": {
                "rotor_inertia": 1.0,
                "torque_limit": limit,
                "speed_limit": 10.0,
                "friction": {"viscous": VISCOUS, "offset": OFFSET, **friction},
                "controller": {
                    "speed_gain": SPEED_GAIN, "position_gain": POSITION_GAIN, "speed_feedforward": 0.0,
                },
            }
        },
    }  # fmt: skip
    (folder / "slide.yaml").write_text(json.dumps(data))
    return Robot.load("slide.yaml", folder)


def exact_run(
    reference: np.ndarray, start: float, offset: float = OFFSET, limit: float = LIMIT
) -> tuple[np.ndarray, np.ndarray]:
    """Position and force of a mass with viscous friction under a sampled cascade; between samples in closed form.

    M dv/dt = u - offset - F v with u held: v tends to (u - offset) / F with the time constant M / F.
    """
    position, force = np.empty_like(reference), np.empty_like(reference)
    q, v, last, decay = start, 0.0, start, np.exp(-VISCOUS / MASS * STEP)
    for k, wanted in enumerate(reference):
        u = np.clip(SPEED_GAIN * (POSITION_GAIN * (wanted - q) - (q - last) / STEP), -limit, limit)
        position[k], force[k], last = q, u, q
        final = (u - offset) / VISCOUS
        q += final * STEP + (v - final) * MASS / VISCOUS * (1 - decay)
        v = final + (v - final) * decay
    return position, force


def reference(n_sample: int = 3000) -> np.ndarray:
    time = np.arange(n_sample) * STEP
    return 0.1 + 0.05 * (1 - np.cos(2 * np.pi * 0.7 * time)) + np.where(time > 1.5, 0.02, 0.0)


def record(
    robot: Robot, *lanes: tuple[np.ndarray, np.ndarray], drop: str = "", sample_time: float = STEP
) -> Record:
    names, n_sample = ("position_reference", "motor_position", "motor_torque"), len(lanes[0][0])
    units = ("m", "m", "N")
    columns = [[reference(n_sample), *lane] for lane in lanes]
    channels = {
        name: Channel("motor", units[i], np.array([c[i] for c in columns])[None, :, None, None, :, None])
        for i, name in enumerate(names)
        if name != drop
    }  # fmt: skip
    valid = np.ones((1, len(lanes), 1, 1, n_sample), dtype=bool)
    run = DenseRun(sample_time, channels, np.arange(n_sample) * sample_time, valid)
    return Record(robot.axis_names, "computed", "zero_order_hold", (run,), np.zeros((1, 1)))
