"""Robots that the default settings never met: drawn from one to four axes, with any friction and sample time.

Masses, reach, gears, springs and friction are drawn as builders choose them, each from what it has to carry, so that a
motor may be light and its friction sharp; only speeds are controlled, so that poses are approached slowly. On robid's
own simulator: whatever is found is a false alarm. From `tests`, `python -m blind.strangers FIRST LAST` tells of seeds.
"""

from __future__ import annotations

import logging
import sys
from typing import Any

import numpy as np
from oracles.robots import robot_of

from blind.experiments import PERIOD, SETTLE, Experiments, record_of
from blind.robots import true_robot
from robid_core import Context, Diagnosis, Record, Robot
from robid_core.stage import map_in_process
from robid_diagnosis.effects import Effects

MOST_AXES = 4
SAMPLE_TIMES = (0.0005, 0.001, 0.002)
REACH = (0.25, 0.8)  # m of a link
HEAVIEST, LIGHTER = 40.0, 0.55  # kg of the first link at most; each next one
GEARS = (50.0, 160.0)
ROTORS = (0.3, 1.5)  # of the arm's inertia at the motor
RESONANCES = (6.0, 20.0)  # Hz, of a gear under its arm
DAMPING = (0.01, 0.04)  # of critical
BANDWIDTHS = (20.0, 50.0)  # rad/s, of the speed controller
AT_ONCE = 0.5  # of a rotor's speed: what its controller takes away in a sample at most
FAST = 150.0  # rad/s^2: friction is told as a share of the torque for that acceleration and the weight
RESERVE = 4.0  # times what fast motions take
SETTLE_S = 8.0
STEPS = 20  # of the simulator, a sample


def stranger(generator: np.random.Generator) -> Robot:
    """Draw a robot."""
    n = int(generator.integers(1, MOST_AXES + 1))
    sample_time = float(generator.choice(SAMPLE_TIMES))
    length = generator.uniform(*REACH, n)
    mass = HEAVIEST * 2 ** generator.uniform(-2, 0) * LIGHTER ** np.arange(n)
    bodies, axes = list[dict[str, Any]](), dict[str, dict[str, Any]]()
    for a in range(n):
        centre = np.cumsum(np.concatenate(([0.0], length[a:-1]))) + length[a:] / 2
        inertia, weight = float(mass[a:] @ centre**2), 9.81 * float(mass[a:] @ centre)
        turns_upright, turns_wrist = a == 0 and n > 2, a == MOST_AXES - 1
        slender = mass[a] * length[a] ** 2 * np.array([1 / 10, 1 / 10, 1 / 60])
        bodies.append(
            {
                "joint": f"joint_{a + 1}",
                "parent": f"joint_{a}" if a else None,
                "axis": [0, 0, 1] if turns_upright else [1, 0, 0] if turns_wrist else [0, 1, 0],
                "translation": [0, 0, length[a - 1] if a else 0.3],
                "mass": mass[a],
                "centre_of_mass": [*(0.02 * generator.normal(size=2)), length[a] / 2],
                "inertia": np.diag(slender),
            }
        )
        axes[f"joint_{a + 1}"] = _drive(inertia, weight, sample_time, generator)
    return robot_of(
        name="stranger", gravity=[0, 0, -9.81], bodies=bodies, axes=axes, sample_time_s=sample_time
    )


def _drive(
    inertia: float, weight: float, sample_time: float, generator: np.random.Generator
) -> dict[str, Any]:
    """Draw motor, gear, friction and control for an arm of that inertia, kg m^2, and weight, N m, at the joint."""
    ratio = float(generator.uniform(*GEARS))
    behind = inertia / ratio**2
    rotor = behind * float(generator.uniform(*ROTORS))
    resonance = 2 * np.pi * float(generator.uniform(*RESONANCES))
    stiffness = inertia * resonance**2
    gain = min((rotor + behind) * float(generator.uniform(*BANDWIDTHS)), AT_ONCE * rotor / sample_time)
    usual = weight / ratio + behind * FAST
    coulomb = usual * float(generator.uniform(0.05, 0.3))
    limit = RESERVE * (weight / ratio + 2 * (rotor + behind) * FAST + coulomb)
    return {
        "gear_ratio": ratio,
        "rotor_inertia": rotor,
        "torque_limit": limit,
        "speed_limit": 500.0,
        "position_limits": [-2.0, 2.0],
        "gear": {
            "stiffness": stiffness,
            "damping": 2 * float(generator.uniform(*DAMPING)) * stiffness / resonance,
        },
        "friction": {
            "coulomb": coulomb,
            "viscous": coulomb * float(generator.uniform(0.002, 0.02)),
            "speed": float(generator.uniform(0.3, 1.5)),
        },
        "controller": {"speed_gain": gain, "integral_gain": gain * float(generator.uniform(4, 10))},
        "sensors": {
            "encoder_counts": int(2 ** generator.integers(17, 21)),
            "position_noise": 2e-5,
            "torque_noise": 0.003 * limit,
        },
    }


def measured(seed: int, settle_s: float = SETTLE_S) -> tuple[Robot, Record]:
    """Return a robot as it is told, and what the true one shows after so long: values off, nothing hidden."""
    generator = np.random.default_rng([seed, 77])
    told = stranger(generator)
    truth = true_robot(told, generator)
    experiments = Experiments.drawn(truth, "multisine", generator)
    settle = max(0, round(settle_s / (PERIOD * told.sample_time_s)) - SETTLE)
    more = np.tile(experiments.references[:, :PERIOD], (1, settle, 1))
    references = np.concatenate((more, experiments.references), axis=1)
    start = np.repeat(experiments.poses, experiments.each, axis=0)
    run = truth.simulate(references, start, seed=seed, step=truth.sample_time_s / STEPS)
    first = more.shape[1]
    return told, record_of(truth, experiments, run.position[:, first:], run.torque[:, first:])


def diagnosed(told: Robot, record: Record) -> Diagnosis:
    """Diagnose a record with default settings."""
    quiet = Context(np.random.default_rng(1), map_in_process, lambda *_: None, logging.getLogger("blind"))
    return Effects(separate=False, response_check=()).run((record,), told, quiet)


def main() -> None:
    """Say what is found on each robot."""
    first, last = (int(seed) for seed in sys.argv[1:])
    for seed in range(first, last + 1):
        told, record = measured(seed)
        diagnosis = diagnosed(told, record)
        found = ", ".join(
            f"{one.kind} {one.effect} at {one.on}, gain {one.gain:.0f}" for one in diagnosis.findings
        )
        misfit = next(line for line in diagnosis.verdict.split("\n") if line.startswith("Misfit"))
        print(
            f"{seed}: {told.n_axis} axes, {told.sample_time_s} s: {found or 'nothing'}; {misfit}", flush=True
        )


if __name__ == "__main__":
    main()
