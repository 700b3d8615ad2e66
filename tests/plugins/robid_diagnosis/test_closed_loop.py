"""Closed-loop simulation against a plant that is solved exactly from sample to sample."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from oracles.slide import (
    MASS,
    OFFSET,
    POSITION_GAIN,
    SPEED_GAIN,
    STEP,
    VISCOUS,
    exact_run,
    record,
    reference,
    slide,
)  # fmt: skip

from robid_core import (
    Channel,
    ConfigurationError,
    Context,
    DataRejected,
    Diagnosis,
    Fit,
    NotTrustworthy,
    ParameterTable,
    Record,
    Robot,
)
from robid_core.stage import map_in_process
from robid_core.testing import check_stage
from robid_diagnosis.closed_loop import ClosedLoopSimulation, with_prefix


def fit(values: dict[str, float], converged: bool = True) -> Fit:
    n = len(values)
    table = ParameterTable(
        tuple(values), ("",) * n, ("",) * n, np.zeros(n), np.array(list(values.values())), np.ones(n),
        np.ones(n, dtype=bool), np.zeros(n, dtype=bool),
    )  # fmt: skip
    return Fit("test", "stopped early", converged, 1.0, 1, 1, table, np.eye(n), tuple(values))


def diagnose(
    robot: Robot,
    measured: Record,
    values: dict[str, float],
    left_out: tuple[str, ...] = (),
    **settings: Any,
) -> Diagnosis:
    context = Context(
        np.random.default_rng(0), map_in_process, lambda done, total, note="": None, logging.getLogger("test")
    )
    found = fit(values).replace(model=robot.model(values, left_out=left_out))
    return ClosedLoopSimulation(**settings).run(measured, found, robot, context)


TRUE = {"mass.x": MASS - 1.0, "friction.x.viscous": VISCOUS, "friction.x.offset": OFFSET}


def test_the_true_parameters_repeat_the_recording(tmp_path: Path) -> None:
    robot = slide(tmp_path, viscous=50.0, offset=0.0)
    diagnosis = diagnose(robot, record(robot, exact_run(reference(), 0.1)), TRUE)
    position, force = diagnosis.time
    # Midpoint steps of h = 0.25 ms on a time constant of M/F = 0.45 s: relative error (h F / M)^2 / 12 = 3e-8.
    assert position.relative_error < 1e-6
    assert force.relative_error < 1e-5
    assert (position.channel, position.unit_symbol, force.unit_symbol) == ("motor_position", "m", "N")
    # The constant force that the position loop cannot remove: offset / (gains) away from where it would be.
    still = exact_run(np.full(3000, 0.1), 0.1)[0]
    assert still[-1] - 0.1 == pytest.approx(-OFFSET / (SPEED_GAIN * POSITION_GAIN), rel=1e-3)


def test_saturation_is_simulated(tmp_path: Path) -> None:
    robot = slide(tmp_path, limit=400.0, offset=0.0)
    measured = record(robot, exact_run(reference(), 0.1, offset=0.0, limit=400.0))
    position, force = diagnose(robot, measured, {**TRUE, "friction.x.offset": 0.0}).time
    assert np.abs(force.measured).max() == np.abs(force.modelled).max() == 400.0
    assert position.relative_error < 1e-6


def test_wrong_parameters_do_not(tmp_path: Path) -> None:
    robot = slide(tmp_path)
    measured = record(robot, exact_run(reference(), 0.1))
    errors = {
        name: diagnose(robot, measured, {**TRUE, name: value}).time[1].relative_error
        for name, value in (("mass.x", 95.0), ("friction.x.viscous", 230.0), ("friction.x.offset", 3.0))
    }
    assert min(errors.values()) > 0.005


def test_each_experiment_starts_at_its_own_rest_and_the_start_can_be_skipped(tmp_path: Path) -> None:
    robot = slide(tmp_path)
    measured = record(robot, exact_run(reference(), 0.1), exact_run(reference(), 0.13))
    diagnosis = diagnose(robot, measured, TRUE, skip_s=0.4)
    position = diagnosis.time[0]
    assert position.relative_error < 1e-6
    np.testing.assert_allclose(position.time_s, np.r_[np.arange(0.4, 3, STEP), 3 + np.arange(0.4, 3, STEP)])
    np.testing.assert_array_equal(position.measured[2600:, 0], exact_run(reference(), 0.13)[0][400:])


def test_a_recording_that_begins_under_way_is_taken_up_in_motion(tmp_path: Path) -> None:
    robot, first = slide(tmp_path), 200
    whole = record(robot, exact_run(reference(), 0.1))
    run = whole.run
    channels = {
        name: Channel("motor", channel.unit_symbol, channel.values[..., first:, :])
        for name, channel in run.channels.items()
    }
    cut = run.replace(channels=channels, valid=run.valid[..., first:], time_s=run.time_s[:-first])
    under_way = whole.replace(runs=(cut,))
    position, force = diagnose(robot, under_way, TRUE, start="motion").time
    # Acceleration is known from the first three samples: the speed is wrong by a third of its change in 1 ms^2.
    assert position.relative_error < 1e-5
    assert force.relative_error < 1e-2
    assert diagnose(robot, under_way, TRUE).time[1].relative_error > 0.1


def test_the_verdict_tells_errors_in_units_place_and_gain(tmp_path: Path) -> None:
    robot = slide(tmp_path)
    position, force = exact_run(reference(), 0.1)
    force = force.copy()
    force[1234] += 50.0
    verdict = diagnose(robot, record(robot, (position, force)), TRUE, ("joint_inertia.x.xx",)).verdict
    assert "motor position within" in verdict
    assert "motor force within" in verdict
    assert "at most 50 N, on x at 1.23 s" in verdict
    assert "with the robot file's parameters" in verdict
    assert "no place for them: joint_inertia.x.xx." in verdict


def test_a_fit_that_did_not_converge_is_not_simulated(tmp_path: Path) -> None:
    robot = slide(tmp_path)
    context = Context(np.random.default_rng(0), map_in_process, lambda *_: None, logging.getLogger("test"))
    measured = record(robot, exact_run(reference(), 0.1))
    with pytest.raises(NotTrustworthy, match="stopped early"):
        ClosedLoopSimulation().run(measured, fit(TRUE, converged=False), robot, context)


@pytest.mark.parametrize(
    ("change", "error", "told"),
    [
        ({"drop": "position_reference"}, DataRejected, "neither position_reference nor speed_reference"),
        ({"drop": "motor_torque"}, DataRejected, "motor_torque"),
        ({"sample_time": 2e-3}, ConfigurationError, "set sample_time_s in the robot file"),
    ],
)
def test_a_record_that_cannot_be_simulated_is_refused(
    tmp_path: Path, change: dict[str, Any], error: type[Exception], told: str
) -> None:
    robot = slide(tmp_path)
    with pytest.raises(error, match=told):
        diagnose(robot, record(robot, exact_run(reference(), 0.1), **change), TRUE)


def test_a_fit_without_a_model_is_simulated_by_its_parameters(tmp_path: Path) -> None:
    robot = slide(tmp_path, viscous=50.0, offset=0.0)
    context = Context(np.random.default_rng(0), map_in_process, lambda *_: None, logging.getLogger("test"))
    measured = record(robot, exact_run(reference(), 0.1))
    diagnosis = ClosedLoopSimulation().run(measured, fit(TRUE), robot, context)
    assert diagnosis.time[0].relative_error < 1e-6
    with pytest.raises(ConfigurationError, match=r"slide has no parameter a, b; it has: "):
        ClosedLoopSimulation().run(measured, fit({"a": 1.0, "b": 2.0}), robot, context)


def test_skipping_everything_is_refused(tmp_path: Path) -> None:
    robot = slide(tmp_path)
    with pytest.raises(DataRejected, match="shorter than skip_s = 3 s"):
        diagnose(robot, record(robot, exact_run(reference(), 0.1)), TRUE, skip_s=3.0)


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [(2.2e-6, "m", "2.2 µm"), (0.0034, "m", "3.4 mm"), (1.5e-8, "rad", "15 nrad"), (2.0, "m", "2 m"),
     (0.002, "N", "0.002 N"), (0.0, "m", "0 m")],
)  # fmt: skip
def test_small_lengths_and_angles_take_a_prefix(value: float, unit: str, text: str) -> None:
    assert with_prefix(value, unit) == text


def test_the_stage_keeps_the_contract() -> None:
    check_stage(ClosedLoopSimulation, skip_s=0.1)
