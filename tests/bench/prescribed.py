"""What prescribed motion costs: against the closed loop, and many robots side by side against one after the other.

    python tests/bench/prescribed.py [--rounds 9] [--seconds 8]

`six_axis` under multisines of 1 to 50 Hz; the 24 robots differ from it in one number each, of springs, dampers and
bodies, and are made anew in every round as a fit makes them. Contestants take turns in one process on one thread;
ratios are medians over rounds of processor time.
"""

from __future__ import annotations

import argparse
import itertools
import os
import sys
from collections.abc import Callable
from pathlib import Path

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_name] = "1"  # before numpy is imported
if str(Path(__file__).parent) not in sys.path:
    sys.path.append(str(Path(__file__).parent))

import numpy as np  # noqa: E402
import numpy.typing as npt  # noqa: E402
from stopwatch import Contestant, Race  # noqa: E402

from robid_core import Robot, prescribe_many  # noqa: E402
from robid_core.mechanics import MotorMotion, periodic_motion  # noqa: E402

N_DERIVATIVE = N_EXPERIMENT = 24
POSE = np.array([0.1, 0.5, 0.2, 0.1, 0.3, 0.1])
LAWS = (
    ("friction.lugre", "axis_4", "motor", "stiffness"),
    ("transmission.stiffening", "axis_2", "gear", "cubic"),
    ("transmission.bouc_wen", "axis_6", "gear", "torque"),
)


def multisine(robot: Robot, n_sample: int) -> npt.NDArray[np.float64]:
    """Return motor angles of one experiment, rad, shape (1, n_sample, n_axis)."""
    generator, angle = np.random.default_rng(1), np.zeros((1, n_sample, robot.n_axis))
    time = robot.sample_time_s * np.arange(n_sample)
    for line in range(1, 51, 2):
        hertz = round(line * time[-1]) / (n_sample * robot.sample_time_s)
        phase = generator.uniform(0, 2 * np.pi, robot.n_axis)
        angle += 0.3 / line * np.cos(2 * np.pi * hertz * time[:, None] + phase)
    return angle + robot.motor_angle(POSE)


def derivatives(robot: Robot, names: list[str]) -> Callable[[], list[Robot]]:
    """Return a function that makes robots which differ in one number each, other numbers each time."""
    count = itertools.count(1)

    def anew() -> list[Robot]:
        factor = 1 + 1e-3 + 1e-6 * next(count)
        return [robot.with_parameters({name: robot.parameter(name) * factor}) for name in names]

    return anew


def names_of(robot: Robot) -> list[str]:
    """Return twelve springs and dampers, and numbers of bodies to make it 24 with the effects' parameters."""
    elastic = [n for n in robot.layout if robot.parameter_kind(n) in ("stiffness", "damping")]
    inertia = [n for n in robot.layout if robot.parameter_kind(n) == "inertia" and robot.parameter(n)]
    effects = [f"effect.{use.partition('.')[2]}.{row}" for use, _, _, row in LAWS]
    there = [name for name in effects if name in robot.layout]
    return [*there, *elastic[::2][:12], *inertia[::3]][:N_DERIVATIVE]


def main() -> None:
    """Run the races and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument("--seconds", type=float, default=8.0)
    options = parser.parse_args()
    six = Robot.load("six_axis")
    angle = multisine(six, round(options.seconds / six.sample_time_s))
    one = periodic_motion(angle, six.sample_time_s, six.step_s, 100.0)
    speed = np.diff(angle, axis=1, append=angle[:, :1]) / six.sample_time_s
    rows = []
    for n in (1, N_EXPERIMENT):
        motion = MotorMotion(*(np.repeat(x, n, axis=0) for x in (one.angle, one.speed, one.acceleration)))
        reference, start = np.repeat(speed, n, axis=0), np.tile(POSE, (n, 1))
        work = n * options.seconds
        race = Race(
            {
                "prescribed": Contestant(lambda m=motion: six.prescribe(m), work),
                "closed loop": Contestant(lambda r=reference, s=start: six.simulate(r, s), work),
            },
            options.rounds,
        )
        rows.append(
            (f"prescribed motion over closed loop, experiments: {n}", race, "prescribed", "closed loop", 1)
        )
    nonlinear = six
    for use, axis, side, _ in LAWS:
        nonlinear = nonlinear.with_effect(use.partition(".")[2], use, axis, side)
    for robot, what in ((six, "linear springs"), (nonlinear, "with LuGre, stiffening and Bouc-Wen")):
        anew, work = derivatives(robot, names_of(robot)), N_DERIVATIVE * options.seconds
        race = Race(
            {
                "side by side": Contestant(lambda a=anew: prescribe_many(a(), one), work),
                "one by one": Contestant(lambda a=anew: [r.prescribe(one) for r in a()], work),
            },
            options.rounds,
        )
        rows.append(
            (f"24 robots side by side over one by one, {what}", race, "side by side", "one by one", 3)
        )
    print("| | x real time | | ratio | at least |\n|---|---|---|---|---|")
    for what, race, ours, theirs, least in rows:
        ratio = race.ratio(ours, theirs)
        print(f"| {what} | {race.rate(ours):.0f} | {race.rate(theirs):.0f} | {ratio:.2f} | {least} |")


if __name__ == "__main__":
    main()
