"""What a law costs in the simulator: built-in and a stranger's, for lanes and with branches.

    python tests/bench/laws.py

Six laws, one on each motor of `six_axis`, 24 experiments of 2 s on one thread; the difference to the robot without them
over steps, lanes and laws. Contestants take turns; the least processor time of the rounds counts.
"""

from __future__ import annotations

import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "third_party" / "robid_wear"))

from robid_wear import Wear, WearOnLanes

from robid_core import ForceEffect, Robot, load_plugin
from robid_core.robot.effects import BoundEffect, place_of

N_LANE, N_SAMPLE, ROUNDS = 24, 2000, 5


def with_law_on_each_motor(robot: Robot, effect: type[ForceEffect]) -> Robot:
    changed = replace(robot)
    changed.__dict__["effects"] = tuple(
        BoundEffect(name, effect, effect.defaults(), place_of(robot, name, name, "motor"))
        for name in robot.axis_names
    )
    return changed


def main() -> None:
    robot = Robot.load("six_axis")
    built_in = ("friction.viscous", "friction.coulomb_tanh", "friction.dahl", "friction.lugre")
    effects = {name: load_plugin("robid.effects", name) for name in built_in}
    effects |= {"a stranger's, for lanes": WearOnLanes, "a stranger's, with branches": Wear}
    robots = {"none": robot} | {
        name: with_law_on_each_motor(robot, effect) for name, effect in effects.items()
    }
    instants = robot.sample_time_s * np.arange(N_SAMPLE)
    wave = 10.0 * np.sin(2 * np.pi * 5.0 * instants[:, None] + np.arange(robot.n_axis))
    reference = np.tile(wave, (N_LANE, 1, 1))
    angle = np.tile(0.5 * (robot.drives.lower + robot.drives.upper) + 0.1, (N_LANE, 1))
    least = dict.fromkeys(robots, np.inf)
    for _ in range(ROUNDS + 1):
        for name, each in robots.items():
            start = time.process_time()
            each.simulate(reference, angle)
            least[name] = min(least[name], time.process_time() - start)
    calls = N_LANE * N_SAMPLE * robot.sample_time_s / robot.step_s * robot.n_axis
    print("| law | x real time | ns per law, step and lane |\n|---|---|---|")
    for name, seconds in least.items():
        rate = N_LANE * N_SAMPLE * robot.sample_time_s / seconds
        print(f"| {name} | {rate:.0f} | {(seconds - least['none']) / calls * 1e9:.1f} |")


if __name__ == "__main__":
    main()
