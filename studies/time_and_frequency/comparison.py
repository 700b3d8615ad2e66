"""Fits in time and in frequency on the same records of a two-axis arm: springs, what is stated of them, seconds.

Bodies are told right, so that nothing but springs, dampers and friction is free; poses, phases, springs and noise are
drawn for each seed.
"""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from robid_core import Channel, DenseRun, Fit, FloatArray, Record, Robot
from studies.fit_accuracy.comparison import fitted
from studies.fit_accuracy.experiments import Experiments, excitation_of, references
from studies.fit_accuracy.plants import Hidden, drawn
from studies.fit_accuracy.tables import Question, Row

ROBOT = str(Path(__file__).parents[1] / "hidden_effects" / "two_axes.yaml")
EXPERIMENTS = Experiments(poses=4, each=2, periods=2, period_s=3.0)
LINEAR = ("gear_stiffness.*", "gear_damping.*", "friction.*.viscous")
SCENARIOS = {"linear": 0.0, "friction": 1.0}
"""Of Coulomb friction, by what the plant has of the robot file's."""
LESS_FRICTION = "state_space_less_friction"
METHODS: dict[str, tuple[tuple[str, ...], dict[str, object]]] = {
    "state_space": (("fit.state_space",), {"free": LINEAR}),
    LESS_FRICTION: (("fit.state_space",), {"free": LINEAR}),
    "time_domain": (
        ("fit.time_domain",),
        {"free": (*LINEAR, "friction.*.coulomb"), "start": "motion", "skip_s": 0.5},
    ),
    "log_response": (("frf.lrm", "fit.log_response"), {}),
    "torque_residual": (("fit.torque_residual",), {"free": LINEAR}),
}
"""Stages from a record to a fit, and settings of the last. `less_friction`: the plant's Coulomb torque, told, is taken
off the measured one before (thesis 3.1.4)."""
CASES = tuple(
    f"{scenario} {method}"
    for scenario in SCENARIOS
    for method in METHODS
    if (scenario, method) != ("linear", LESS_FRICTION)
)
"""Rows of a seed."""
QUANTILE = 1.96


def measured(robot: Robot, nominal: Robot, seed: int) -> Record:
    """Closed loop under multisines of 4 to 80 Hz on slow sines of 9 rad/s; one period settles."""
    where, excitation = excitation_of(nominal, EXPERIMENTS, seed)
    speed, start = references(nominal, where, excitation, EXPERIMENTS, np.random.default_rng([seed, 2]))
    run = robot.simulate(speed, nominal.joint_angle(start), seed=seed)
    n_sample, n_axis = round(EXPERIMENTS.period_s / nominal.sample_time_s), nominal.n_axis
    rows = (EXPERIMENTS.poses, 1, EXPERIMENTS.each, EXPERIMENTS.periods, n_sample, n_axis)

    def channel(unit: str, values: FloatArray) -> Channel:
        return Channel("motor", unit, values[:, n_sample:].reshape(rows))

    channels = {
        "motor_position": channel("rad", run.position),
        "motor_torque": channel("N m", run.torque),
        "speed_reference": channel("rad/s", speed),
    }
    instants, valid = nominal.sample_time_s * np.arange(n_sample), np.ones(rows[:-1], dtype=bool)
    dense = DenseRun(nominal.sample_time_s, channels, instants, valid)
    return Record(nominal.axis_names, "simulated", "zero_order_hold", (dense,), where.angle, excitation.line)


def less_friction(record: Record, robot: Robot) -> Record:
    """Take Coulomb's torque at the measured speed off the measured torque."""
    run, drives = record.run, robot.drives
    position, torque = run.lanes("motor_position"), run.channel("motor_torque")
    speed = np.gradient(position, run.sample_time_s, axis=1)
    friction = drives.coulomb * np.tanh(speed / drives.friction_speed)
    # Torque is held to the next sample: the friction of both instants counts half.
    held = 0.5 * (friction + np.concatenate((friction[:, 1:], friction[:, -1:]), axis=1))
    values = torque.values - held.reshape(torque.values.shape)
    return record.replace(
        runs=(run.replace(channels=run.channels | {"motor_torque": replace(torque, values=values)}),)
    )


def row(case: str, seed: int) -> Row:
    """Measure a plant, fit it, compare."""
    scenario, method = case.split()
    plant = drawn((seed, 20261125), Hidden(), ROBOT)
    friction = {
        name: SCENARIOS[scenario] * plant.robot.parameter(name)
        for name in plant.robot.layout
        if name.endswith(".coulomb")
    }
    robot = plant.robot.with_parameters(friction)
    nominal = plant.nominal.with_parameters(dict.fromkeys(friction, 0.0) if scenario == "linear" else {})
    record = measured(robot, nominal, seed)
    if method == LESS_FRICTION:
        record = less_friction(record, robot)
    chain, settings = METHODS[method]
    if scenario == "linear" and method == "time_domain":
        settings = settings | {"free": LINEAR}
    several = method == "time_domain"
    started = time.process_time()
    fit = fitted(chain, (record,) if several else record, nominal, seed, **settings)
    seconds = time.process_time() - started
    return {"converged": str(fit.converged), "cpu_s": f"{seconds:.1f}"} | springs(fit, robot)


def springs(fit: Fit, robot: Robot) -> Row:
    """Relative errors and stated standard errors of the springs."""
    found: Row = {}
    for name in robot.stiffness_names:
        index, true = fit.parameters.names.index(name), robot.parameter(name)
        found[f"error.{name}"] = f"{fit.parameters.estimate[index] / true - 1:.4e}"
        found[f"stated.{name}"] = f"{fit.parameters.standard_error[index] / true:.4e}"
    return found


def report(rows: list[Row]) -> list[str]:
    """One line a case."""
    head = f"{'scenario, method':37}{'plants':>7}{'rms %':>9}{'bias %':>9}{'stated %':>10}"
    head += f"{'rms z':>8}{'covered':>9}{'cpu s':>7}"
    lines = [head]
    for case in CASES:
        own = [one for one in rows if one["case"] == case]
        if not own:
            continue
        names = [key.removeprefix("error.") for key in own[0] if key.startswith("error.")]
        error, stated = (
            np.array([[float(one[f"{what}.{name}"]) for name in names] for one in own])
            for what in ("error", "stated")
        )
        z = error / stated
        failed = sum(one["converged"] != "True" for one in own)
        lines.append(
            f"{case:37}{len(own):7}{100 * np.sqrt((error**2).mean()):9.4f}{100 * error.mean():9.4f}"
            f"{100 * np.sqrt((stated**2).mean()):10.4f}{np.sqrt((z**2).mean()):8.2f}"
            f"{100 * (np.abs(z) < QUANTILE).mean():8.0f}%{np.median([float(one['cpu_s']) for one in own]):7.1f}"
            + (f"  {failed} did not converge" if failed else "")
        )
    return lines


QUESTION = Question({"case": CASES}, "seed", row, report)
