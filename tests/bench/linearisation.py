"""Speed of linearisation, response and its derivatives against what one writes without them, as a table.

    python tests/bench/linearisation.py [--rounds 15] [--configurations 100] [--lines 100]

Contestants take turns in this process on one thread; times are medians over rounds, per configuration and line where
not said otherwise. Ours starts from motor angles: gravity equilibrium, linear model, response as a sampled system,
factored derivative for 12 stiffnesses and 12 dampings (and the motors' dampers, which come with it).

Peers get mass matrix and gravity stiffness for nothing. *Loop*: ``C (i w I - A)^-1 B`` of the 36 states, one solve a
line, central differences for the 24 parameters. *Stacked numpy*: all lines at once in second order, derivatives from
the same solution (`mechanics.reference`).
"""

from __future__ import annotations

import argparse
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

from robid_core import Robot  # noqa: E402
from robid_core.mechanics import SecondOrderModel, response, response_with_gradient  # noqa: E402
from robid_core.mechanics.reference import response_by_solving  # noqa: E402

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]

PEER_LINES = 50  # enough that forming its matrices costs the loop nothing
RELATIVE_STEP = 1e-4  # of the central differences; their error is about its square over the damping ratio's


def state_space_response(model: SecondOrderModel, omega: FloatArray) -> ComplexArray:
    """Motor torque to motor acceleration at one configuration by one solve of all states a line."""
    n, n_axis = model.input_map.shape
    a = np.zeros((2 * n, 2 * n))
    a[:n, n:] = np.eye(n)
    a[n:, :n], a[n:, n:] = (
        -np.linalg.solve(model.mass, model.stiffness),
        -np.linalg.solve(model.mass, model.damping),
    )
    b = np.concatenate((np.zeros((n, n_axis)), np.linalg.solve(model.mass, model.input_map)))
    c, identity = np.eye(n_axis, 2 * n), np.eye(2 * n)
    return np.array([-(w**2) * (c @ np.linalg.solve(1j * w * identity - a, b)) for w in omega])


def loop_with_differences(
    model: SecondOrderModel, stiffness: FloatArray, damping: FloatArray, omega: FloatArray
) -> tuple[ComplexArray, ComplexArray]:
    """Response, and its derivatives for every spring and every damper, (2 n_spring, n_freq, n_axis, n_axis)."""

    def moved(field: str, spring: int, change: float) -> ComplexArray:
        e = model.spring_directions[spring]
        parts = {name: getattr(model, name) for name in ("mass", "damping", "stiffness")}
        parts[field] = parts[field] + change * np.outer(e, e)
        return state_space_response(
            SecondOrderModel(**parts, input_map=model.input_map, spring_directions=model.spring_directions),
            omega,
        )

    slopes = [
        (moved(field, s, RELATIVE_STEP * value) - moved(field, s, -RELATIVE_STEP * value))
        / (2 * RELATIVE_STEP * value)
        for field, values in (("stiffness", stiffness), ("damping", damping))
        for s, value in enumerate(values)
    ]
    return state_space_response(model, omega), np.array(slopes)


def largest_difference(robot: Robot, model: SecondOrderModel, omega: FloatArray) -> float:
    """Our derivatives against the loop's, relative to the largest entry of each parameter's."""
    ours = response_with_gradient(model, omega)
    squares = -np.einsum("fsi,fsj->sfij", ours.spring_vectors, ours.spring_vectors)
    exact = np.concatenate((squares, 1j * omega[:, None, None] * squares))
    _, differences = loop_with_differences(model, *robot.spring_arrays(), omega)
    size = abs(exact).max(axis=(1, 2, 3), keepdims=True)
    return float((abs(differences - exact) / size).max())


def main() -> None:
    """Run the race and print its table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rounds", type=int, default=15)
    parser.add_argument("--configurations", type=int, default=100)
    parser.add_argument("--lines", type=int, default=100)
    given = parser.parse_args()
    n_config, n_line = given.configurations, given.lines
    robot = Robot.load("six_axis")
    generator = np.random.default_rng(0)
    angle = generator.uniform(robot.drives.lower, robot.drives.upper, (n_config, robot.n_axis))
    frequency = np.geomspace(4, 80, n_line)
    omega, hold = 2 * np.pi * frequency, robot.sample_time_s
    stiffness, damping = robot.spring_arrays()
    motor = robot.motor_angle(angle)
    rest = robot.batches.solve_equilibrium(robot.mechanism, stiffness, motor)
    many, one = robot.second_order(angle), robot.second_order(angle[0])
    few = omega[:: max(1, n_line // PEER_LINES)][:PEER_LINES]
    lines = n_config * n_line
    calls: dict[str, tuple[Callable[[], object], int]] = {
        "all of it": (lambda: robot.response_with_gradient(angle, frequency), lines),
        "response alone": (lambda: robot.response(angle, frequency), lines),
        "kernel: response": (lambda: response(many, omega, hold), lines),
        "kernel: response, derivative": (lambda: response_with_gradient(many, omega, hold), lines),
        "loop": (lambda: loop_with_differences(one, stiffness, damping, few), len(few)),
        "stacked numpy": (lambda: response_by_solving(one, omega, hold), n_line),
        "equilibrium": (
            lambda: robot.batches.solve_equilibrium(robot.mechanism, stiffness, motor),
            n_config,
        ),
        "linear model": (
            lambda: robot.batches.second_order_model(robot.mechanism, stiffness, damping, rest.position),
            n_config,
        ),
    }
    race = Race({name: Contestant(run, work) for name, (run, work) in calls.items()}, given.rounds)
    print(f"six_axis, {n_config} configurations, {n_line} lines, {given.rounds} rounds; microseconds")
    for name in calls:
        per = "configuration" if name in ("equilibrium", "linear model") else "configuration and line"
        slow, fast = 1e6 / race.rates[name].min(), 1e6 / race.rates[name].max()
        print(f"{name:30s} {1e6 / race.rate(name):9.3f} per {per} ({fast:.3f} to {slow:.3f})")
    print(f"all of it against the loop     {race.ratio('all of it', 'loop'):9.0f} x (wanted: 100 x, 5 us)")
    print(f"... against stacked numpy      {race.ratio('all of it', 'stacked numpy'):9.1f} x")
    print(f"largest difference from the loop's derivatives {largest_difference(robot, one, few):.1e}")


if __name__ == "__main__":
    main()
