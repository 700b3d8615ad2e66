"""compensate.friction: less scatter, the same best linear approximation, and nothing where there is no friction."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from robid_compensation.friction import FrictionCompensation
from robid_core import Channel, ComplexArray, DenseRun, Frf, Record, Robot
from robid_core.estimation.distortion.friction import before_hold, oversampled
from robid_core.estimation.excitation.multisine import logarithmic_odd_lines, multisine, sine
from robid_core.testing import check_stage, example_context
from robid_frf.h1 import H1

PERIOD_S, N_SAMPLE, SETTLE = 4.0, 4000, 1
LINE = logarithmic_odd_lines((4.0, 80.0), 40, PERIOD_S)


def measured(
    robot: Robot, n_block: int, *, seed: int, n_exp: int | None = None, noise: bool = True
) -> Record:
    """Speed multisines on a slow sine in closed loop, one period kept."""
    n, chance = robot.n_axis, np.random.default_rng(seed)
    n_exp = n if n_exp is None else n_exp
    amplitude = np.tile((40.0 / LINE**0.5)[:, None], (1, n))
    reference = np.empty((n_block, n, N_SAMPLE, n))
    for m in range(n_block):
        phase, own = chance.uniform(0, 2 * np.pi, (2, *amplitude.shape))
        reference[m] = multisine(amplitude, phase, own, LINE, N_SAMPLE)
        reference[m] += sine(np.full(n, 12.0), chance.uniform(0, 2 * np.pi, n), 2, N_SAMPLE)
    reference = reference[:, :n_exp]
    lanes = np.tile(reference.reshape(-1, N_SAMPLE, n), (1, SETTLE + 1, 1))
    result = robot.simulate(lanes, np.zeros((len(lanes), n)), seed if noise else None)
    shape = (1, n_block, n_exp, 1, N_SAMPLE, n)
    position, torque = (s[:, SETTLE * N_SAMPLE :].reshape(shape) for s in (result.position, result.torque))
    channels = {
        "motor_position": Channel("motor", "rad", position),
        "motor_torque": Channel("motor", "N m", torque),
        "speed_reference": Channel("motor", "rad/s", reference.reshape(shape)),
    }
    time_s = np.arange(N_SAMPLE) * (PERIOD_S / N_SAMPLE)
    run = DenseRun(PERIOD_S / N_SAMPLE, channels, time_s, np.ones(shape[:-1], dtype=bool))
    return Record(robot.axis_names, "simulated", "zero_order_hold", (run,), np.zeros((1, n)), LINE)


def compensated(record: Record, robot: Robot) -> Record:
    return FrictionCompensation().run(record, robot, example_context())


def block_responses(record: Record) -> ComplexArray:
    """Response of each block by itself, (n_block, n_freq, n_axis, n_axis)."""
    u, y = record.spectra()
    return np.asarray(y[0] @ np.linalg.inv(u[0]))


def scatter(blocks: ComplexArray) -> float:
    return float(np.sqrt(np.mean(np.var(blocks / blocks.mean(axis=0), axis=0, ddof=1))))


@pytest.fixture(scope="module")
def rubbing() -> tuple[Robot, Record]:
    robot = Robot.load("one_axis_true")
    return robot, measured(robot, 40, seed=1)


def test_scatter_between_realisations_falls_and_the_response_stays(rubbing: tuple[Robot, Record]) -> None:
    robot, record = rubbing
    before, after = (block_responses(r) for r in (record, compensated(record, robot)))
    # Noise is all that cannot be removed; the law has the plant's shape among its functions.
    assert scatter(after) < 0.35 * scatter(before)
    # The means of 40 blocks differ by what was removed, which averages to zero: its scatter over blocks says how
    # exactly. Of 40 lines the root mean square is within 40 % of one with a probability of 1 - 1e-5.
    change = after - before
    standard_error = np.std(change, axis=0, ddof=1) / np.sqrt(len(change))
    ratio = np.sqrt(np.mean(np.abs(change.mean(axis=0)) ** 2 / standard_error**2))
    assert ratio < 1.4


def test_a_friction_that_is_not_among_the_functions_is_removed_in_part_and_biases_nothing(
    tmp_path: Path,
) -> None:
    path = tmp_path / "bristles.yaml"
    path.write_text(
        "robid_robot: 1\nname: bristles\nbase: one_axis_true\nparameters: {friction.axis_1.coulomb: 1.0e-9}\n"
        "effects: {bristles: {use: friction.lugre, on: axis_1}}\n"
    )
    robot = Robot.load(str(path))
    record = measured(robot, 40, seed=2)
    before, after = (block_responses(r) for r in (record, compensated(record, robot)))
    assert scatter(after) < 0.7 * scatter(before)
    change = after - before
    standard_error = np.std(change, axis=0, ddof=1) / np.sqrt(len(change))
    assert np.sqrt(np.mean(np.abs(change.mean(axis=0)) ** 2 / standard_error**2)) < 1.4


def test_without_friction_the_record_stays_as_it_is() -> None:
    robot = Robot.load("one_axis_true").with_parameters({"friction.axis_1.coulomb": 1e-9})
    record = measured(robot, 4, seed=3)
    assert np.array_equal(
        compensated(record, robot).run.values("motor_torque"), record.run.values("motor_torque")
    )


def test_one_experiment_of_two_axes_leans_on_the_nominal_robot(two_axes: Robot) -> None:
    # The nominal robot's springs are a third too soft; what is removed from the torque still is the distortion: the
    # torque that a linear response leaves over falls, judged with the response of 20 blocks.
    whole = measured(two_axes, 20, seed=4)
    u, y = whole.spectra()
    response = np.mean(y[0] @ np.linalg.inv(u[0]), axis=0)
    one = measured(two_axes, 1, n_exp=1, seed=5)
    nominal = two_axes.with_parameters(
        {name: 0.7 * value for name, value in two_axes.parameters().items() if "stiffness" in name}
    )

    def rest(record: Record) -> float:
        u, y = (s[0, 0, ..., 0] for s in record.spectra())
        return float(np.sqrt(np.mean(np.abs(u - np.linalg.solve(response, y[..., None])[..., 0]) ** 2)))

    assert rest(compensated(one, nominal)) < 0.6 * rest(one)


@pytest.fixture(scope="module")
def two_axes() -> Robot:
    from robid_core.testing import example_robot

    robot = example_robot(2)
    return robot.with_parameters(
        {n: 0.05 * robot.drives.torque_limit[0] for n in robot.parameters() if n.endswith("coulomb")}
    )


def test_stated_regions_hold_the_mean_of_repetitions(rubbing: tuple[Robot, Record]) -> None:
    # What the equivalent damping misses is common to all experiments: no residual shows it, the deviation states it.
    robot, record = rubbing
    one = record.run

    def four_blocks(start: int) -> Frf:
        part = slice(start, start + 4)
        channels = {n: Channel(c.side, c.unit_symbol, c.values[:, part]) for n, c in one.channels.items()}
        run = one.replace(channels=channels, valid=one.valid[:, part])
        return H1().run(compensated(record.replace(runs=(run,)), robot), example_context())

    found = [four_blocks(start) for start in range(0, 40, 4)]
    response = np.stack([frf.response[0, :, 0, 0] for frf in found])
    variance = np.stack([frf.variance()[0, :, 0, 0] for frf in found])
    residuals_only = np.stack([frf.replace(damping_deviation=None).variance()[0, :, 0, 0] for frf in found])
    square = np.abs(response - response.mean(axis=0)) ** 2 / 0.9  # the mean of ten has a tenth of it
    # Ten repetitions and neighbouring lines that go together: mean squares within a third.
    assert 0.67 < np.mean(square / variance) < 1.33
    assert np.mean(square / residuals_only) > np.mean(square / variance)


def test_a_controller_that_is_not_the_robots_costs_precision_only(rubbing: tuple[Robot, Record]) -> None:
    robot, record = rubbing
    drives = {"axes": {"axis_1": {"controller": {"speed_gain": 5 * float(robot.drives.speed_gain[0])}}}}
    other = Robot(
        robot.description.model_validate(deep_update(robot.description.model_dump(mode="json"), drives))
    )
    right, wrong = (block_responses(compensated(record, r)).mean(axis=0) for r in (robot, other))
    error = np.sqrt(np.mean(np.abs(wrong / right - 1) ** 2))
    assert error < scatter(block_responses(record)) / np.sqrt(40)


def deep_update(data: dict[str, Any], change: dict[str, Any]) -> dict[str, Any]:
    """Nested mappings with some values replaced."""
    merged = {
        k: deep_update(data[k], v) if isinstance(v, dict) and isinstance(data.get(k), dict) else v
        for k, v in change.items()
    }
    return {**data, **merged}


def test_a_torque_before_the_hold_acts_as_it_should_after_it() -> None:
    # A held sequence u[n] = Re(U exp(i w n T)) acts, averaged against exp(-i w t) over time, as U H(w): closed form.
    share, fine = 0.08, 1000
    wanted = 0.7 - 0.2j
    samples = wanted * before_hold(np.array([share]))[0] * np.exp(2j * np.pi * share * np.arange(25))
    time = (np.arange(25 * fine) + 0.5) / fine  # two whole turns, midpoints
    acting = np.mean(np.repeat(samples, fine) * np.exp(-2j * np.pi * share * time))
    assert acting == pytest.approx(wanted, rel=1e-5)


def test_oversampled_samples_lie_on_the_signal() -> None:
    n = 400
    turns = 2 * np.pi * 5 / n
    spectrum = np.fft.rfft(np.sin(turns * np.arange(n)))[None, :21, None] / n
    assert oversampled(spectrum, n)[0, :, 0] == pytest.approx(np.sin(turns * np.arange(2 * n) / 2), abs=1e-12)


def test_friction_compensation_keeps_the_contract() -> None:
    check_stage(FrictionCompensation)
