"""Errors of the simulator and of MuJoCo against fine references, in the closed loop and in responses from its data."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from bench_table import Row, Size
from oracles.mujoco_robot import MujocoRobot
from oracles.runs import Method, at_rest, measured_at_rest, run
from workload import bench_ripple, bench_robot, orthogonal_block, random_experiments

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]


def accuracy_against_mujoco(size: Size) -> list[Row]:
    """Errors of the closed loop, ours and MuJoCo's, against MuJoCo at a fine step."""
    errors = closed_loop_errors(0.5 * size.seconds)
    ours, theirs = errors["ours, 0.25 ms"][0], errors["MuJoCo RK4, 0.25 ms, friction held over the step"][0]
    return [
        Row(
            "error of motor speed (rms, worst axis) against a fine reference: ours; that MuJoCo",
            f"{ours:.1e}; {theirs:.1e}",
            "ours below",
            ours < theirs,
        )
    ]


def closed_loop_errors(seconds: float) -> dict[str, tuple[float, float]]:
    """Relative rms error on the worst axis, of many methods: {method: (of speed, of torque)}."""
    robot, ripple = bench_robot(encoder=False), bench_ripple()
    bare = bench_robot(ripple=False, encoder=False)
    case = random_experiments(robot, 1, seconds)
    rest = measured_at_rest(robot, at_rest(robot, case.angle), ripple)
    start = rest.position[0], rest.holding_torque[0], case.reference[0]
    truth = MujocoRobot(bare, ripple=ripple).closed_loop(*start, 32)

    def error(position: FloatArray, torque: FloatArray) -> tuple[float, float]:
        pairs = (np.diff(position, axis=0), np.diff(truth[0], axis=0)), (torque, truth[1])
        relative = [np.sqrt(np.mean((x - y) ** 2, axis=0) / np.var(y, axis=0)).max() for x, y in pairs]
        return float(relative[0]), float(relative[1])

    found = {}
    methods: tuple[tuple[str, Method, tuple[int, ...]], ...] = (
        ("ours", "implicit_midpoint", (1, 2, 4, 8)),
        ("our Runge-Kutta", "runge_kutta", (2, 4)),
    )
    for name, method, steps in methods:
        for n_step in steps:
            ours = run(robot, rest, case.reference, method=method, n_step=n_step)
            found[f"{name}, {1 / n_step:g} ms"] = error(ours.position[0], ours.torque[0])
    peers: tuple[tuple[str, str, tuple[int, ...]], ...] = (
        ("RK4", "step", (1, 2, 4, 8)),
        ("RK4", "stage", (2, 4)),
        ("implicitfast", "step", (4,)),
        ("Euler", "step", (4,)),
    )
    for integrator, friction, steps in peers:
        twin = MujocoRobot(bare, integrator, ripple=ripple)
        held = "held over the step" if friction == "step" else "in every stage"
        for n_step in steps:
            name = f"MuJoCo {integrator}, {1 / n_step:g} ms, friction {held}"
            found[name] = error(*twin.closed_loop(*start, n_step, friction=friction))
    return found


def response_of_data(size: Size) -> list[Row]:
    """Response from simulated data against that of Runge-Kutta at an eighth of the step."""
    fine, coarse = response_errors(size)
    median, largest = np.median(coarse), coarse.max()
    return [
        Row(
            f"response from simulated data against Runge-Kutta at 1/8 step, {size.n_line} lines from 4 to 80 Hz: "
            f"median and maximum error (Runge-Kutta at 1/4 and 1/8 step: {fine.max():.1e})",
            f"{median:.1e}, {largest:.1e}",
            "2e-4, 2e-3",
            bool(median <= 2e-4 and largest <= 2e-3),
        )
    ]


def response_errors(size: Size) -> tuple[FloatArray, FloatArray]:
    """Relative error at each line (matrix norm) of Runge-Kutta at 1/4 step, and of the default method."""
    robot = bench_robot(encoder=False)
    case, line = orthogonal_block(robot, size.period_s, size.n_line, n_period=2)
    rest = measured_at_rest(robot, at_rest(robot, case.angle), bench_ripple())
    period = round(size.period_s / robot.sample_time_s)
    n_step = round(robot.sample_time_s / robot.step_s)

    def response(method: Method, n: int) -> ComplexArray:
        done = run(robot, rest, case.reference, method=method, n_step=n)
        return response_matrix(done.position[:, -period:], done.torque[:, -period:], line)

    truth = response("runge_kutta", 8 * n_step)

    def error(other: ComplexArray) -> FloatArray:
        return np.asarray(
            np.linalg.norm(other - truth, 2, axis=(1, 2)) / np.linalg.norm(truth, 2, axis=(1, 2))
        )

    return error(response("runge_kutta", 4 * n_step)), error(response("implicit_midpoint", n_step))


def response_matrix(position: FloatArray, torque: FloatArray, line: npt.NDArray[np.int64]) -> ComplexArray:
    """Torque to acceleration from one period of as many experiments as axes, (n_freq, n_axis, n_axis)."""
    omega = 2 * np.pi * line / (position.shape[1] * 1e-3)
    y = -(omega[:, None, None] ** 2) * np.fft.rfft(position, axis=1)[:, line].transpose(1, 2, 0)
    u = np.fft.rfft(torque, axis=1)[:, line].transpose(1, 2, 0)
    return np.asarray(y @ np.linalg.inv(u))


def frontier(size: Size) -> str:
    """Return a second table: error of every method and step."""
    errors = closed_loop_errors(0.5 * size.seconds)
    lines = ["| method, step | error of speed | error of torque |", "|---|---|---|"]
    lines += [f"| {name} | {speed:.1e} | {torque:.1e} |" for name, (speed, torque) in errors.items()]
    return "\n".join(lines)
