"""Torque that is held from sample to sample, and torque that is not: both known in closed form, under either name."""

from __future__ import annotations

import logging
from dataclasses import replace

import numpy as np
import pytest

from robid_core import Channel, ConfigurationError, Context, DataRejected, DenseRun, Fit, Record, Robot
from robid_core.residual import prescribe_record
from robid_core.stage import map_in_process
from robid_fit.torque_residual import TorqueResidualFit

T, N, N_EXP, N_PERIOD = 1e-3, 2000, 2, 2
LINES = np.arange(9, 200, 4)  # of two seconds: 4.5 to 98.5 Hz
ANGLE_NOISE, TORQUE_NOISE = 1e-6, 1e-5  # rad, and of the torque's limit
HOLDS = ("zero_order_hold", "continuous")
SPRING = "gear_stiffness.axis_1"


@pytest.fixture(scope="module")
def nominal() -> Robot:
    """One axis that rubs in proportion to the speed, with the sensors of these records."""
    robot = Robot.load("one_axis")
    noise = TORQUE_NOISE * float(robot.drives.torque_limit[0])
    told = {"encoder_counts": 0, "position_noise": ANGLE_NOISE, "torque_noise": noise}
    values = {f"sensors.axis_1.{name}": value for name, value in told.items()}
    return robot.with_parameters({**values, "friction.axis_1.coulomb": 0.0})


@pytest.fixture(scope="module")
def plant(nominal: Robot) -> Robot:
    return nominal.with_parameters({SPRING: 1.1 * nominal.parameter(SPRING)})


def record_of(plant: Robot, hold: str, *, quiet: bool = False) -> Record:
    """What a plant answers at the lines, exactly: two periods of each experiment."""
    generator, frequency = np.random.default_rng(0), LINES / (N * T)
    angle, limit = np.array([[0.3]]), plant.drives.torque_limit
    phase = 2 * np.pi * generator.uniform(size=(N_EXP, len(LINES), 1))
    torque = 0.05 * limit / np.sqrt(2 * len(LINES)) * np.exp(1j * phase)
    response = plant.response(angle, frequency, hold=hold)[0]
    swing = np.einsum("fij,xfj->xfi", response, torque) / -((2 * np.pi * frequency[:, None]) ** 2)
    shape = (1, 1, N_EXP, N_PERIOD, N, 1)
    channels = {}
    for name, unit, lines, still, noise in (
        ("motor_position", "rad", swing, plant.motor_angle(angle[0]), ANGLE_NOISE),
        ("motor_torque", "N m", torque, plant.gravity_torque(angle)[0], TORQUE_NOISE * limit),
    ):
        spectrum = np.zeros((N_EXP, N // 2 + 1, 1), dtype=complex)
        spectrum[:, LINES] = lines
        values = still + np.fft.irfft(spectrum, N, axis=1)[None, None, :, None] * N
        noisy = values + (0.0 if quiet else noise) * generator.standard_normal(shape)
        channels[name] = Channel("motor", unit, np.ascontiguousarray(noisy))
    run = DenseRun(T, channels, T * np.arange(N), np.ones(shape[:-1], dtype=bool))
    return Record(plant.axis_names, "closed form", hold, (run,), angle, LINES)


def fit_of(record: Record, robot: Robot) -> Fit:
    context = Context(
        np.random.default_rng(1), map_in_process, lambda *a, **k: None, logging.getLogger("test")
    )
    return TorqueResidualFit(free=("gear_*", "friction.*.viscous")).run((record,), robot, context)


@pytest.mark.parametrize(
    ("hold", "repeats"),
    [
        (HOLDS[0], True),
        (HOLDS[1], True),
        (HOLDS[0], False),
        pytest.param(HOLDS[1], False, marks=pytest.mark.full),
    ],
)
def test_the_right_hold_leaves_noise_and_the_other_one_half_a_sample(
    nominal: Robot, plant: Robot, hold: str, repeats: bool
) -> None:
    """The other hold turns all phases by half a sample: a delay takes most of that, and the misfit tells the rest.

    A cut was told 50 times the noise where a window stayed and the half sample between means and samples did not.
    """
    record = record_of(plant, hold)
    record = record if repeats else record.replace(line=None)
    right = fit_of(record, nominal)
    error = right.parameters.standard_error[right.parameters.names.index(SPRING)]
    assert abs(right.parameters.value(SPRING) - plant.parameter(SPRING)) < 3 * error
    assert error < 1e-4 * plant.parameter(SPRING)
    assert abs(right.parameters.value("torque_delay")) < 2e-3 * T
    # Noise alone scatters by a percent; numerics leave up to a half of a noise of 1e-5 of the limit under a window.
    assert right.misfit < (1.1 if repeats else 1.5)
    other = HOLDS[1 - HOLDS.index(hold)]
    wrong = fit_of(record.replace(torque_hold=other), nominal)
    late = 0.5 if hold == "continuous" else -0.5
    assert wrong.parameters.value("torque_delay") == pytest.approx(late * T, abs=0.01 * T)
    assert wrong.misfit > 1000
    (remark,) = [one for one in wrong.doubts if one.kind == "timing"]
    assert remark.is_remark
    assert f"torque_hold: {other} is stated, and with {hold} there would be no delay" in remark.remedy
    assert not [one for one in right.doubts if one.kind == "timing"]


def faster(robot: Robot, times: int) -> Robot:
    """The same robot under a controller that is so many times as fast."""
    clock = {"sample_time_s": T / times, "step_s": T / times}
    return replace(robot, description=robot.description.model_copy(update=clock))


@pytest.mark.parametrize("times", [2, 3])
def test_a_controller_faster_than_its_recording_is_recognised_by_the_delay(
    nominal: Robot, plant: Robot, times: int
) -> None:
    record = record_of(faster(plant, times), "zero_order_hold").replace(torque_hold="continuous")
    fit = fit_of(record, nominal)
    assert fit.parameters.value("torque_delay") == pytest.approx(-0.5 * T / times, abs=0.01 * T)
    (remark,) = [one for one in fit.doubts if one.kind == "timing"]
    assert f"{times} times as fast as the recording" in remark.sentence
    assert f"held_s: {T / times:.4g}" in remark.remedy


@pytest.mark.parametrize("hold", HOLDS)
def test_a_lag_of_the_current_is_known_under_either_hold(nominal: Robot, plant: Robot, hold: str) -> None:
    """Recorded is the command: without its lag of a fifth of a millisecond the torque is late by that."""
    lag = {"time_constant": 2e-4}
    late, told = (
        one.with_effect("lag", "drive.current_loop", "axis_1", "torque", lag) for one in (plant, nominal)
    )
    record = record_of(late, hold)
    fit = fit_of(record, told)
    assert abs(fit.parameters.value("torque_delay")) < 5e-3 * T
    # The exact gain of a law that runs in steps of 0.25 ms is met to (w h)^2 / 24: 1e-3 of what the lag adds.
    assert fit.parameters.value(SPRING) == pytest.approx(plant.parameter(SPRING), rel=2e-3)
    assert fit_of(record, nominal).parameters.value("torque_delay") == pytest.approx(-2e-4, abs=2e-5)


@pytest.mark.parametrize("hold", HOLDS)
def test_a_motion_gives_its_torque_back_under_the_right_hold(plant: Robot, hold: str) -> None:
    record = record_of(plant, hold, quiet=True)

    def off(told: str) -> float:
        ours = prescribe_record(plant, record.replace(torque_hold=told)).run.lanes("motor_torque")
        error = (ours - record.run.lanes("motor_torque"))[:, N // 2 : -N // 2]
        return float(error.std() / record.run.lanes("motor_torque").std())

    # Half a sample of the mean line, 50 Hz, is 0.16 rad.
    right, wrong = (off(told) for told in (hold, HOLDS[1 - HOLDS.index(hold)]))
    assert right < 2e-3
    assert wrong > 0.1


def test_a_hold_that_nobody_knows_is_refused(nominal: Robot, plant: Robot) -> None:
    with pytest.raises(DataRejected, match="torque_hold is 'linear'"):
        fit_of(record_of(plant, "continuous").replace(torque_hold="linear"), nominal)


def test_a_spring_with_nothing_behind_it_is_refused_by_name(nominal: Robot, plant: Robot) -> None:
    """As of a prismatic axis whose type is forgotten: the mass at the origin has no inertia about it."""
    values = {
        name: 0.0
        for name in nominal.layout
        if nominal.parameter_kind(name) == "inertia" and "rotor" not in name
    }
    with pytest.raises(ConfigurationError, match="nothing that .* moves behind its spring has a mass"):
        fit_of(record_of(plant, "continuous"), nominal.with_parameters(values))
