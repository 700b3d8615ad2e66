"""What sensors behind the gear add, in small: the model is the robot's, bounds are reached, tables are the code's."""

from __future__ import annotations

import csv
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.append(str(Path(__file__).parents[2]))
from robid_core import Robot
from studies.arm_side_sensors import run
from studies.arm_side_sensors.sensors import (
    ADDED,
    MOTOR,
    SETS,
    Experiment,
    Study,
    amplitude_for,
    deviations,
    errors,
    experiment,
)


@pytest.fixture(scope="module")
def whole() -> Study:
    """One axis with a spring in its gear, link encoder and torque sensor."""
    robot = Robot.load("one_axis")
    sensors = (MOTOR, ADDED["link encoders"], ADDED["joint torque sensors"])
    return Study(robot, experiment(robot, 1, n_config=2, n_line=20), sensors)


def test_the_response_of_the_motor_is_the_robots(whole: Study) -> None:
    omega = 2 * np.pi * whole.experiment.frequency_hz
    frequency = whole.experiment.frequency_hz
    known = whole.robot.response(whole.experiment.angle, frequency, hold="continuous")
    found = whole.response(np.zeros(len(whole.free.names)))[:, :, :1] * -(omega[:, None, None] ** 2)
    np.testing.assert_allclose(found, known, rtol=1e-6)


def test_the_link_encoder_shows_the_deflection_of_the_spring(whole: Study) -> None:
    """Torque of the gear over its stiffness, with a damper: arm angle less motor angle over the ratio."""
    motor, arm, torque = (whole.response(np.zeros(len(whole.free.names)))[:, :, k, 0] for k in range(3))
    robot, omega = whole.robot, 2 * np.pi * whole.experiment.frequency_hz
    name = robot.axis_names[0]
    soft = robot.parameter(f"gear_stiffness.{name}") + 1j * omega * robot.parameter(f"gear_damping.{name}")
    deflection = arm - robot.drives.gear[0, 0] * motor
    np.testing.assert_allclose(deflection * soft, -torque, rtol=1e-6)


def test_more_sensors_tell_no_less_and_more_torque_neither(whole: Study) -> None:
    alone, link = whole.chosen(()), whole.chosen(("link encoders",))
    both = whole.chosen(("link encoders", "joint torque sensors"))
    assert (errors(link) <= errors(alone) * (1 + 1e-9)).all()
    assert (errors(both) <= errors(link) * (1 + 1e-9)).all()
    assert (errors(alone, 2.0) < errors(alone)).all()
    factor = amplitude_for(link, errors(alone))
    for k, one in enumerate(factor.tolist()):
        assert errors(link, one)[k] == pytest.approx(errors(alone)[k], rel=1e-6)


@pytest.mark.parametrize(
    "added",
    [(), pytest.param(("link encoders",), marks=pytest.mark.full), ("link encoders", "joint torque sensors")],
)
def test_fits_to_noisy_spectra_reach_what_is_stated(whole: Study, added: tuple[str, ...]) -> None:
    study = whole.chosen(added)
    found = np.array([deviations(study, seed) for seed in range(30)])
    # The rms of 30 normal numbers or more scatters by 0.13 about one.
    assert 0.6 < np.sqrt((found**2).mean()) < 1.4


def test_noise_of_the_torque_reaches_all_sensors_alike(whole: Study) -> None:
    """Without noise of the sensors the covariance has the rank of the torques."""
    plain = whole.experiment
    loud = Experiment(plain.angle, plain.frequency_hz, plain.torque, plain.n_sample, 1e3)
    covariance = Study(whole.robot, loud, whole.sensors).covariance(np.zeros(len(whole.free.names)))
    scale = np.sqrt(np.diagonal(covariance, axis1=2, axis2=3).real)
    values = np.linalg.eigvalsh(covariance / scale[..., None] / scale[..., None, :])
    assert (values[..., -1] > 2.99).all()


def test_the_tables_are_those_of_the_code() -> None:
    worth, checks = (
        list(csv.DictReader((run.HERE / name).read_text(encoding="utf-8").splitlines()))
        for name in ("worth.csv", "check.csv")
    )
    assert list(dict.fromkeys(row["sensors"] for row in worth)) == list(SETS)
    assert [row["sensors"] for row in checks] == list(SETS)
    assert all(float(row["error_to_motor_side"]) <= 1 for row in worth)
    assert all(0.7 < float(row["rms_in_stated_errors"]) < 1.4 for row in checks)
