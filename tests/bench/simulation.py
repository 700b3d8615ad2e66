"""Speed and accuracy of the simulator against its peers, as a table: `python tests/bench/simulation.py`.

Every ratio is of contestants that took turns in this process on one thread. Accuracies are against MuJoCo's or our own
Runge-Kutta at a fine step, which agree to rounding (tests/robid_core/validation).
"""

from __future__ import annotations

import argparse
import os
import sys
import time
import tracemalloc
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_name] = "1"  # before numpy is imported: one thread unless said
for _folder in (Path(__file__).parent, Path(__file__).parents[1]):
    if str(_folder) not in sys.path:
        sys.path.append(str(_folder))

import mujoco  # noqa: E402
import numpy as np  # noqa: E402
import numpy.typing as npt  # noqa: E402
from bench_table import FIGURES, LOOK, Row, Size, markdown  # noqa: E402
from oracles.mujoco_robot import MujocoRobot  # noqa: E402
from oracles.pinocchio_robot import PinocchioRobot  # noqa: E402
from oracles.runs import at_rest, measured_at_rest, run  # noqa: E402
from simulation_accuracy import accuracy_against_mujoco, frontier, response_of_data  # noqa: E402
from stopwatch import Contestant, Race  # noqa: E402
from workload import (  # noqa: E402
    Experiments,
    bench_ripple,
    bench_robot,
    random_experiments,
)

FloatArray = npt.NDArray[np.float64]

N_EXPERIMENT, N_CONFIGURATION, DURATION = 24, 100, 15.0  # Paper B's procedure


# Speed --------------------------------------------------------------------------------------------------------


def rate_of_one_core(size: Size) -> list[Row]:
    """Simulated seconds per second and core, many experiments at once and one alone."""
    robot = bench_robot()
    many, one = (random_experiments(robot, n, size.seconds) for n in (N_EXPERIMENT, 1))
    race = Race(
        {
            "lanes": Contestant(lambda: robot.simulate(many.reference, many.angle), many.seconds),
            "one": Contestant(lambda: robot.simulate(one.reference, one.angle), one.seconds),
        },
        size.n_round,
    )
    return [
        Row(
            f"simulated seconds per second and core, {effects_in_words()}; {N_EXPERIMENT} experiments",
            f"{race.rate('lanes'):.0f} ({race.spread('lanes')})",
            "200",
            race.rate("lanes") >= 200,
        ),
        Row("the same, one experiment", f"{race.rate('one'):.0f} ({race.spread('one')})", ""),
    ]


def against_pinocchio(size: Size) -> list[Row]:
    """Ratio to a Python Runge-Kutta loop over pinocchio at the same step."""
    robot, ripple = bench_robot(), bench_ripple()
    many = random_experiments(robot, N_EXPERIMENT, size.seconds)
    rest = at_rest(robot, many.angle)
    peer, n_sample = PinocchioRobot(bench_robot(ripple=False), ripple), 50

    def loop() -> object:
        return peer.closed_loop(rest.position[0], rest.holding_torque[0], many.reference[0, :n_sample], 4)

    race = Race(
        {
            "ours": Contestant(lambda: robot.simulate(many.reference, many.angle), many.seconds),
            "pinocchio": Contestant(loop, n_sample * robot.sample_time_s),
        },
        size.n_round,
    )
    ratio = race.ratio("ours", "pinocchio")
    return [
        Row(
            "against a Python Runge-Kutta loop over pinocchio, same step of 0.25 ms "
            f"({race.rate('pinocchio'):.2g} x real time)",
            f"{ratio:.0f} x",
            "50 x",
            ratio >= 50,
        )
    ]


def against_mujoco(size: Size) -> list[Row]:
    """Ratios to MuJoCo's Runge-Kutta in a Python loop with the same friction, ripple and control."""
    robot, ripple = bench_robot(), bench_ripple()
    bare = bench_robot(ripple=False)
    many, one = (random_experiments(robot, n, size.seconds) for n in (N_EXPERIMENT, 1))
    rest = at_rest(robot, many.angle)
    n_sample = min(300, many.reference.shape[1])
    start = rest.position[0], rest.holding_torque[0], many.reference[0, :n_sample]
    twins = {friction: MujocoRobot(bare, ripple=ripple) for friction in ("step", "stage")}
    alone = MujocoRobot(bare)
    alone.put(rest.position[0], np.zeros_like(rest.position[0]))

    def loop(friction: str) -> Callable[[], object]:
        return lambda: twins[friction].closed_loop(*start, 4, friction=friction)

    duration = n_sample * robot.sample_time_s
    ready = measured_at_rest(robot, rest, ripple)

    def runge_kutta() -> object:
        return run(robot, ready, many.reference, method="runge_kutta", n_step=4)

    race = Race(
        {
            "lanes": Contestant(lambda: robot.simulate(many.reference, many.angle), many.seconds),
            "one": Contestant(lambda: robot.simulate(one.reference, one.angle), one.seconds),
            "formula": Contestant(runge_kutta, many.seconds),
            "step": Contestant(loop("step"), duration),
            "stage": Contestant(loop("stage"), duration),
            "alone": Contestant(lambda: mujoco.mj_step(alone.model, alone.data, 4 * n_sample), duration),
        },
        size.n_round,
    )
    lanes, single = race.ratio("lanes", "step"), race.ratio("one", "step")
    what = "against MuJoCo's Runge-Kutta in a Python loop, 0.25 ms, friction held over the step"
    return [
        Row(
            f"{what} ({race.rate('step'):.3g} x real time); lanes",
            f"{lanes:.0f} x",
            "20 x",
            lanes >= 20,
        ),
        Row("the same; one lane", f"{single:.1f} x", "10 x", single >= 10),
        Row(
            f"the same, friction in every stage ({race.rate('stage'):.3g} x real time); lanes, one lane",
            f"{race.ratio('lanes', 'stage'):.0f} x, {race.ratio('one', 'stage'):.1f} x",
            "",
        ),
        Row(
            "the same formula on both sides: our Runge-Kutta against that, 0.25 ms; lanes",
            f"{race.ratio('formula', 'stage'):.0f} x",
            "",
        ),
        Row(
            "MuJoCo's own rate, steps in C without friction, ripple and control",
            f"{race.rate('alone'):.0f} x real time; ours is {race.ratio('lanes', 'alone'):.1f} x that",
            "",
        ),
    ]


def two_cores(size: Size, n_configuration: int | None = None) -> list[Row]:
    """Paper B's procedure, a share of its configurations, dealt to two threads."""
    count = n_configuration or size.n_configuration
    robot = bench_robot()
    duration = DURATION if size is not LOOK else 3.0
    jobs = [random_experiments(robot, N_EXPERIMENT, duration, seed) for seed in range(count)]

    def simulate(job: Experiments) -> float:
        return float(robot.simulate(job.reference, job.angle).torque[-1, -1, -1])

    def on(n_worker: int) -> Callable[[], object]:
        def all_jobs() -> object:
            with ThreadPoolExecutor(n_worker) as pool:
                return list(pool.map(simulate, jobs))

        return all_jobs

    work = sum(job.seconds for job in jobs)
    rounds = min(3, size.n_round) if count < N_CONFIGURATION else 1
    contestants = {"two": Contestant(on(2), work)}
    if count < N_CONFIGURATION:
        contestants["one"] = Contestant(on(1), work)
    race, busy = Race(contestants, rounds, wall=True), time.process_time()
    on(2)()
    busy = (time.process_time() - busy) / work * N_EXPERIMENT * N_CONFIGURATION * DURATION
    whole = N_EXPERIMENT * N_CONFIGURATION * DURATION / race.rate("two")
    extent = f"measured on {count} configurations" if count < N_CONFIGURATION else "all measured"
    gain = f", {race.ratio('two', 'one'):.2f} x one core" if "one" in contestants else ""
    return [
        Row(
            f"24 x 100 x 15 s on 2 cores ({extent}{gain})",
            f"{whole:.0f} s ({busy:.0f} s of processor time)",
            "120 s",
            whole <= 120,
        )
    ]


def cost_is_linear(size: Size) -> list[Row]:
    """Time per simulated second over the number of experiments and over the duration."""
    robot = bench_robot()
    cases = {f"{n} experiments": random_experiments(robot, n, size.seconds) for n in (8, 24, 72)}
    cases |= {f"{k} x as long": random_experiments(robot, 8, k * size.seconds) for k in (3, 9)}

    def simulate(case: Experiments) -> Callable[[], object]:
        return lambda: robot.simulate(case.reference, case.angle)

    contestants = {name: Contestant(simulate(case), case.seconds) for name, case in cases.items()}
    race = Race(contestants, size.n_round)
    first = "8 experiments"
    costs = [f"{name}: {race.ratio(first, name):.2f}" for name in cases if name != first]
    worst = max(race.ratio(first, name) for name in cases)  # what is fixed makes it less
    return [
        Row(
            f"cost per simulated second relative to {first}, {size.seconds:g} s",
            "; ".join(costs),
            "at most 1.1 (linear)",
            worst <= 1.1,
        )
    ]


def memory(size: Size) -> list[Row]:
    """Peak of what a simulation allocates relative to what it returns."""
    robot = bench_robot()
    peaks, recorded = [], []
    for factor in (1, 3):
        case = random_experiments(robot, N_EXPERIMENT, factor * size.seconds)
        robot.simulate(case.reference[:, :2], case.angle)
        tracemalloc.start()
        done = robot.simulate(case.reference, case.angle)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        recorded.append(done.position.nbytes + done.torque.nbytes)
    growth = (peaks[1] - peaks[0]) / (recorded[1] - recorded[0])
    fixed = (peaks[0] - growth * recorded[0]) / 1e6
    return [
        Row(
            "memory: growth of the peak over growth of what is recorded (position and torque)",
            f"{growth:.2f}, and {max(fixed, 0.0):.1f} MB",
            "at most 1.5 (with a copy of the reference)",
            growth <= 1.55,
        )
    ]


# Table --------------------------------------------------------------------------------------------------------

BENCHES: dict[str, Callable[[Size], list[Row]]] = {
    "rate": rate_of_one_core,
    "pinocchio": against_pinocchio,
    "mujoco": against_mujoco,
    "accuracy": accuracy_against_mujoco,
    "response": response_of_data,
    "paper_b": two_cores,
    "linear": cost_is_linear,
    "memory": memory,
}


def effects_in_words() -> str:
    """Say what acts in the robot of the bench."""
    ripples = "both ripples" if bench_ripple().acts else "no ripples (their effects are not installed)"
    return f"six axes, friction, {ripples}, sampled control, saturation"


def main(arguments: list[str] | None = None) -> int:
    """Measure, print the table; exit code 1 where a target was missed and `--check` asked."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("benches", nargs="*", choices=[*BENCHES, []], help="which rows (default: all)")
    parser.add_argument("--look", action="store_true", help="a minute in place of ten: rough figures")
    parser.add_argument("--full", action="store_true", help="all 100 configurations of Paper B's procedure")
    parser.add_argument(
        "--frontier", action="store_true", help="the table of errors over method and step too"
    )
    parser.add_argument("--check", action="store_true", help="fail where a target is missed")
    options = parser.parse_args(arguments)
    size = LOOK if options.look else FIGURES
    if options.full:
        size = replace(size, n_configuration=N_CONFIGURATION)
    rows: list[Row] = []
    for name in options.benches or BENCHES:
        print(f"{name} ...", file=sys.stderr, flush=True)
        rows += BENCHES[name](size)
    print(markdown(rows))
    if options.frontier:
        print(f"\n{frontier(size)}")
    return int(options.check and any(row.reached is False for row in rows))


if __name__ == "__main__":
    sys.exit(main())
