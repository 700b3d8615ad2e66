"""What a run with multisines would measure on a plant that only the simulator knows."""

from __future__ import annotations

import logging
from typing import Any

import numpy as np

from robid_core import Channel, Configurations, Context, DenseRun, Record, Robot, load_plugin
from robid_core.stage import map_in_process

T = 1e-3  # s, sampling time


def context(seed: int = 1) -> Context:
    return Context(
        np.random.default_rng(seed), map_in_process, lambda *a, **k: None, logging.getLogger("test")
    )


def record_of(plant: Robot, nominal: Robot, angle: np.ndarray, seed: int, **settings: Any) -> Record:
    """What a run would measure: multisines of the stage, two periods behind one, noise as the plant has it."""
    where = Configurations(nominal.axis_names, angle)
    asked = {"band_hz": (4, 80), "lines": 60, "period_s": 4, "blocks": 1, "slow_sine_rad_s": 9, **settings}
    excite = load_plugin("robid.stages", "excitation.multisine")(**asked)
    excitation = excite.run(where, nominal, context(seed))
    references, starts = [], []
    for c, middle in enumerate(nominal.motor_angle(angle)):
        references.append(excitation.realization(c).reshape(-1, *excitation.reference.shape[3:]))
        starts.append((middle - excitation.start_offset(c)).reshape(-1, nominal.n_axis))
    reference, start = np.concatenate(references), plant.joint_angle(np.concatenate(starts))
    run = plant.simulate(np.tile(reference, (1, 3, 1)), start, seed=seed)
    n_sample = reference.shape[1]
    rows = (len(angle), 1, -1, 2, n_sample, nominal.n_axis)
    position, torque = (getattr(run, name)[:, n_sample:].reshape(rows) for name in ("position", "torque"))
    channels = {
        "motor_position": Channel("motor", "rad", position),
        "motor_torque": Channel("motor", "N m", torque),
    }
    dense = DenseRun(T, channels, T * np.arange(n_sample), np.ones(position.shape[:-1], dtype=bool))
    return Record(plant.axis_names, "simulated", "zero_order_hold", (dense,), angle, excitation.line)
