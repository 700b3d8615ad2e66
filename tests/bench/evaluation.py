"""What an evaluation of a robot with one other number costs: set it, linearise, response at 6 poses and 120 lines.

    python tests/bench/evaluation.py [--rounds 40]

Contestants take turns in one process on one thread; ratios are medians over rounds against another spring of the same
robot without effects. The number that changes is another one in every round, so that nothing is found in a cache.
"""

from __future__ import annotations

import argparse
import itertools
import os
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_name] = "1"  # before numpy is imported
if str(Path(__file__).parent) not in sys.path:
    sys.path.append(str(Path(__file__).parent))

import numpy as np  # noqa: E402
from stopwatch import Contestant, Race  # noqa: E402

from robid_core import Robot  # noqa: E402

SPRING = "spring"
CASES = {  # effect in the file, the number that changes, at most so many times the spring
    SPRING: ("", "gear_stiffness.axis_2", 1.0),
    "friction": ("", "friction.axis_2.viscous", 1.5),
    "friction effect": ("{use: friction.stribeck, on: axis_2}", "effect.tried.coulomb", 1.5),
    "signal effect": ("{use: sensing.delay, on: axis_2}", "effect.tried.delay", 1.5),
    "mass": ("", "mass.axis_3", 2.0),
    "nonlinear spring": ("{use: transmission.stiffening, on: axis_2}", "effect.tried.cubic", 3.0),
}


def contestant(folder: Path, effect: str, name: str) -> Callable[[], object]:
    """Return a function that evaluates the robot with another value of a number each time."""
    path = folder / f"{name}.yaml"
    effects = f"effects:\n  tried: {effect}\n" if effect else ""
    path.write_text(f"robid_robot: 1\nname: tried\nbase: six_axis\n{effects}", encoding="utf-8")
    robot = Robot.load(str(path))
    angle = np.random.default_rng(0).uniform(-1, 1, (6, 6)) * [1, 0.8, 0.8, 1, 1, 1]
    lines, value, count = np.geomspace(4, 80, 120), robot.parameter(name), itertools.count(1)
    robot.response(angle, lines)
    return lambda: robot.with_parameters({name: value * (1 + 1e-5 * next(count))}).response(angle, lines)


def main() -> None:
    """Run the race and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=40)
    rounds = parser.parse_args().rounds
    with tempfile.TemporaryDirectory() as top:
        race = Race(
            {
                case: Contestant(contestant(Path(top), effect, name), 1)
                for case, (effect, name, _) in CASES.items()
            },
            rounds,
        )
    print("| another | ms | times a spring | at most |\n|---|---|---|---|")
    for case, (_, _, most) in CASES.items():
        print(f"| {case} | {1e3 / race.rate(case):.2f} | {race.ratio(SPRING, case):.2f} | {most:g} |")


if __name__ == "__main__":
    main()
