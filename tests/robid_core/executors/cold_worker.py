"""A worker without compiled laws: `cold_worker.py FOLDER START` waits for START and prints what it computed."""

from __future__ import annotations

import hashlib
import os
import sys
import time
from pathlib import Path

import numpy as np

from robid_core.compiled import laws
from robid_core.robot import Robot
from robid_core.robot.experiments import ExperimentBatch, simulate_experiments, task

PLANT = """\
robid_robot: 1
base: one_axis_true
effects:
  stick: {use: friction.lugre, on: axis_1}
  stribeck: {use: friction.stribeck, on: axis_1}
  ripple: {use: drive.torque_ripple, on: axis_1}
  play: {use: transmission.backlash, on: axis_1}
"""


def digest(folder: Path) -> str:
    """Return the hash of a simulation with four effects."""
    plant = folder / f"plant_{os.getpid()}.yaml"
    plant.write_text(PLANT)
    robot = Robot.load(str(plant))
    generator = np.random.default_rng(1)
    reference = generator.normal(size=(10, 400, 1)).cumsum(axis=1)
    batch = ExperimentBatch(robot, reference, generator.uniform(-1, 1, (10, 1)), seed=np.arange(10))
    position, torque, *_ = simulate_experiments(*task(batch, 0, 10))
    return hashlib.sha256(position.tobytes() + torque.tobytes()).hexdigest()


if __name__ == "__main__":
    cache, start = Path(sys.argv[1]), Path(sys.argv[2])
    laws.cache_folder = lambda what: cache  # type: ignore[assignment]
    print("ready", flush=True)
    while not start.exists():
        time.sleep(0.001)
    print(digest(start.parent))
    entries = [entry for _, found in laws._compiled.values() for entry in found.keep[1:] if entry is not None]
    print(len(entries), sum(1 for entry in entries if entry.cache_hits))
