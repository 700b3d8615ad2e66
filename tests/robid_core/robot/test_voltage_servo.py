"""Servos that set a voltage: closed forms of the motor alone, an own integration of a pendulum, what files may say."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from robid_core import Channel, ConfigurationError, DataRejected, DenseRun, Record, Robot, simulate_record
from robid_core.robot.plant import continue_simulation, standing

T, STEP = 2e-3, 2.5e-4
CONSTANT, OHM, VOLT, GAIN = 0.4, 3.2, 7.4, 1.2
INERTIA, VISCOUS, WEIGHT = 0.004 + 0.002, 0.01, 0.5 * 9.81 * 0.1
TEXT = f"""\
robid_robot: 1
name: servo
sample_time_s: {T}
step_s: {STEP}
gravity: [0.0, 0.0, GRAVITY]
bodies:
  - {{joint: swing, axis: [0.0, 1.0, 0.0], mass: 0.5, centre_of_mass: [0.0, 0.0, -0.1],
     inertia: [[0, 0, 0], [0, 0, 0], [0, 0, 0]]}}
axes:
  swing:
    rotor_inertia: 0.001
    torque_constant: {CONSTANT}
    torque_limit: 40
    speed_limit: 20
    friction: {{viscous: {VISCOUS}}}
    DRIVE
"""
SERVO = f"servo: {{duty_gain: {GAIN}, supply_voltage: {VOLT}, resistance: {OHM}}}"


def servo(folder: Path, gravity: float = -9.81, drive: str = SERVO, **numbers: float) -> Robot:
    path = folder / "servo.yaml"
    path.write_text(TEXT.replace("GRAVITY", str(gravity)).replace("DRIVE", drive), encoding="utf-8")
    return Robot.load(str(path)).with_parameters({name.replace("__", "."): v for name, v in numbers.items()})


def simulated(
    robot: Robot, reference: np.ndarray, enabled: np.ndarray | None = None, speed: float = 0.0
) -> Any:
    """One lane a row of position references (n_lane, n_sample), from the lowest point."""
    wanted = np.asarray(reference, dtype=float)[..., None]
    state = standing(robot, np.zeros((len(wanted), 1)))
    state = replace(state, speed=np.full_like(state.speed, speed))
    on = None if enabled is None else np.broadcast_to(enabled[:, None], wanted.shape)
    return continue_simulation(
        robot, state, np.zeros_like(wanted), None, wanted, enabled=on, keep_coordinates=True
    )


def test_a_motor_at_full_voltage_runs_up_to_the_speed_at_which_it_induces_that_voltage(
    tmp_path: Path,
) -> None:
    robot = servo(tmp_path, gravity=0.0, friction__swing__viscous=0.0)
    n = 200
    done = simulated(robot, np.full((1, n), 1e3))  # far away: the duty cycle is one
    time, tau = T * np.arange(n), (0.001 + 0.5 * 0.1**2) * OHM / CONSTANT**2
    speed = VOLT / CONSTANT * (1 - np.exp(-time / tau))
    # The midpoint rule: (h / tau)^2 / 12 of the exponent's time, 5e-7; the first step has no acceleration yet.
    np.testing.assert_allclose(done.torque[0, :, 0], CONSTANT / OHM * (VOLT - CONSTANT * speed), atol=1e-5)
    position = VOLT / CONSTANT * (time - tau * (1 - np.exp(-time / tau)))
    np.testing.assert_allclose(done.position[0, :, 0], position, atol=1e-4)
    assert done.saturated[0, 0] == 1.0


def test_a_motor_that_is_off_coasts(tmp_path: Path) -> None:
    robot = servo(tmp_path, gravity=0.0, friction__swing__viscous=0.0)
    n = 100
    done = simulated(robot, np.full((1, n), -5.0), np.zeros(n), speed=3.0)
    np.testing.assert_allclose(done.position[0, :, 0], 3.0 * T * np.arange(n), atol=1e-12)
    np.testing.assert_array_equal(done.torque, 0.0)


def integrated(reference: np.ndarray, enabled: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The same pendulum by scipy: the duty cycle held over each sample; position and torque at the samples."""
    inertia = 0.001 + 0.5 * 0.1**2
    state, positions, torques = np.zeros(2), [], []
    for wanted, on in zip(reference, enabled, strict=True):
        duty = np.clip(GAIN * (wanted - state[0]), -1.0, 1.0)

        def change(_: float, x: np.ndarray, duty: float = duty, on: float = on) -> list[float]:
            torque = on * CONSTANT / OHM * (duty * VOLT - CONSTANT * x[1])
            return [x[1], (torque - VISCOUS * x[1] - WEIGHT * np.sin(x[0])) / inertia]

        positions.append(state[0])
        torques.append(on * CONSTANT / OHM * (duty * VOLT - CONSTANT * state[1]))
        state = solve_ivp(change, (0, T), state, rtol=1e-10, atol=1e-12).y[:, -1]
    return np.array(positions), np.array(torques)


@pytest.mark.parametrize("n_lane", [1, 8])
def test_a_pendulum_on_a_servo_moves_as_scipy_integrates_it(tmp_path: Path, n_lane: int) -> None:
    """Limited and not, switched off and on again; one experiment, and eight in a register."""
    robot, time = servo(tmp_path), T * np.arange(300)
    phase = np.arange(n_lane)[:, None]
    reference = 1.4 * np.sin(2 * np.pi * 2.0 * time + phase)
    enabled = np.where((time > 0.25) & (time < 0.4), 0.0, 1.0)
    done = simulated(robot, reference, enabled)
    for lane in {0, n_lane - 1}:
        position, torque = integrated(reference[lane], enabled)
        # Second order: steps of a quarter of a millisecond against the motor's time of 0.1 s, 5e-7 a radian each 0.1 s.
        np.testing.assert_allclose(done.position[lane, :, 0], position, atol=2e-5)
        np.testing.assert_allclose(done.torque[lane, :, 0], torque, atol=5e-5)
    assert 0 < done.saturated[0, 0] < 1


def test_its_numbers_are_those_of_a_cascade_while_the_voltage_is_not_at_the_limit(tmp_path: Path) -> None:
    drives = servo(tmp_path).drives
    assert drives.speed_gain[0] == drives.back_emf[0] == pytest.approx(CONSTANT**2 / OHM)
    assert drives.speed_gain[0] * drives.position_gain[0] == pytest.approx(CONSTANT / OHM * VOLT * GAIN)
    assert drives.torque_limit[0] == pytest.approx(CONSTANT / OHM * VOLT)
    changed = servo(tmp_path, servo__swing__resistance=6.4, torque_constant__swing=0.2)
    assert changed.drives.back_emf[0] == pytest.approx(0.2**2 / 6.4)
    assert not [name for name in changed.layout if name.startswith("controller.")]
    assert (
        Robot.of_model(changed.model({"servo.swing.resistance": 5.0})).parameter("servo.swing.resistance")
        == 5.0
    )


def test_a_drive_is_one_of_both(tmp_path: Path) -> None:
    neither = servo(tmp_path, drive="")
    with pytest.raises(ConfigurationError, match="lacks .*controller of swing"):
        neither.simulate(np.zeros((1, 5, 1)), np.zeros((1, 1)))
    with pytest.raises(ConfigurationError, match="the drive has a controller and a servo; give"):
        servo(tmp_path, drive=f"{SERVO}\n    controller: {{speed_gain: 1.0}}")
    with pytest.raises(ConfigurationError, match="lower its duty_gain 50000 1.rad"):
        servo(tmp_path, servo__swing__duty_gain=5e4).simulate(np.zeros((1, 5, 1)), np.zeros((1, 1)))


def record_of(robot: Robot, reference: np.ndarray, enabled: np.ndarray) -> Record:
    done = simulated(robot, reference, enabled)
    shape = (1, 1, len(reference), 1, reference.shape[1], 1)
    channels = {
        "motor_position": Channel("motor", "rad", done.position.reshape(shape)),
        "position_reference": Channel("motor", "rad", reference.reshape(shape)),
        "drive_enabled": Channel("motor", "1", np.broadcast_to(enabled, reference.shape).reshape(shape)),
    }
    run = DenseRun(T, channels, T * np.arange(reference.shape[1]), np.ones(shape[:-1], dtype=bool))
    return Record(("swing",), "simulated", "continuous", (run,), np.zeros((1, 1)))


def test_a_record_is_given_back_with_the_samples_at_which_the_drive_was_off(tmp_path: Path) -> None:
    robot, time = servo(tmp_path), T * np.arange(400)
    enabled = np.where(time > 0.5, 0.0, 1.0)
    record = record_of(robot, np.sin(2 * np.pi * time)[None], enabled)
    again = simulate_record(robot, record)
    np.testing.assert_allclose(
        again.run.values("motor_position"), record.run.values("motor_position"), atol=1e-12
    )
    assert set(again.run.channels) == set(record.run.channels)
    half = record_of(robot, np.sin(2 * np.pi * time)[None], 0.5 * enabled)
    with pytest.raises(DataRejected, match="drive_enabled says when drives are on and must be 0 or 1"):
        simulate_record(robot, half)
