"""A servo a thousand times smaller than the packaged robots: nothing may hang on a robot's size.

Rotor 1e-5 kg m^2, ratio 50, a lever of 150 g on an elastic gear; equations and integrator share nothing with robid.
"""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np
import pytest

from robid_core import Context, DataRejected, Diagnosis, Record, Robot
from robid_core.stage import map_in_process
from robid_diagnosis.effects import Effects

SERVO = """robid_robot: 1
name: servo
sample_time_s: 0.0005
bodies:
  - {joint: lever, axis: [0, 1, 0], mass: 0.15, centre_of_mass: [0, 0, 0.06],
     inertia: [[1.2e-4, 0, 0], [0, 1.2e-4, 0], [0, 0, 1.0e-6]]}
axes:
  lever: {gear_ratio: 50, rotor_inertia: 1.0e-5, gear: {stiffness: 100.0, damping: 0.07},
          friction: {coulomb: 1.5e-3, viscous: 8.0e-6}, sensors: {torque_noise: 2.0e-4}}
"""
RATIO, ROTOR, LEVER, WEIGHT = 50.0, 1e-5, 1.2e-4 + 0.15 * 0.06**2, 0.15 * 9.81 * 0.06
STIFFNESS, DAMPING, COULOMB, TURNS_AT, VISCOUS = 120.0, 0.05, 2e-3, 2.0, 5e-6
SAMPLE_S, FINER, PERIOD_S, PERIODS = 5e-4, 2, 1.0, 2
LINES_HZ = np.unique(np.round(np.geomspace(6, 120, 40)))
POSES = np.repeat([-2.0, -0.2, 1.9], 2)


def rates(state: np.ndarray, torque: np.ndarray, by_load: float) -> np.ndarray:
    """Speeds and accelerations of rotor and lever, (4, n_lane)."""
    motor, joint, motor_speed, joint_speed = state
    passed = STIFFNESS * (motor / RATIO - joint) + DAMPING * (motor_speed / RATIO - joint_speed)
    friction = (COULOMB + by_load * np.abs(passed / RATIO)) * np.tanh(motor_speed / TURNS_AT)
    motor_rate = (torque - friction - VISCOUS * motor_speed - passed / RATIO) / ROTOR
    return np.stack((motor_speed, joint_speed, motor_rate, (passed + WEIGHT * np.sin(joint)) / LEVER))


def measured(by_load: float, lines_hz: np.ndarray = LINES_HZ) -> Record:
    """Multisines of 40 lines to 120 Hz, or others, on a slow sine, in three poses, two experiments each."""
    generator, n = np.random.default_rng(8), round(PERIOD_S / SAMPLE_S)
    time = SAMPLE_S * np.arange(n)
    omega, phase = 2 * np.pi * lines_hz, generator.uniform(0, 2 * np.pi, (len(POSES), len(lines_hz), 1))
    slow = 2 * np.pi * time + generator.uniform(0, 2 * np.pi, (len(POSES), 1))
    waves = omega[:, None] * time + phase
    speed = 40 * np.sin(slow) + (550.0 / omega[:, None] * np.sin(waves)).sum(axis=1)
    angle = -40 / (2 * np.pi) * np.cos(slow) - (550.0 / omega[:, None] ** 2 * np.cos(waves)).sum(axis=1)
    middle = RATIO * (POSES - WEIGHT / STIFFNESS * np.sin(POSES))
    wanted = angle + middle[:, None]
    state = np.stack((wanted[:, 0], wanted[:, 0] / RATIO, speed[:, 0], speed[:, 0] / RATIO))
    integral, step = np.zeros(len(POSES)), SAMPLE_S / FINER
    seen = np.empty((2, len(POSES), (PERIODS + 1) * n))
    for k in range(seen.shape[2]):
        error = speed[:, k % n] + 25 * (wanted[:, k % n] - state[0]) - state[2]
        integral = integral + 0.03 * SAMPLE_S * error
        torque = 2.5e-3 * error + integral
        seen[:, :, k] = state[0], torque
        for _ in range(FINER):
            first = rates(state, torque, by_load)
            second = rates(state + 0.5 * step * first, torque, by_load)
            third = rates(state + 0.5 * step * second, torque, by_load)
            fourth = rates(state + step * third, torque, by_load)
            state = state + step / 6 * (first + 2 * second + 2 * third + fourth)
    seen[1] += 2e-4 * generator.standard_normal(seen[1].shape)
    kept = seen[:, :, n:].reshape(2, 3, 1, 2, PERIODS, n, 1)
    counts = 2**18 / (2 * np.pi)
    return recorded(np.round(kept[0] * counts) / counts, kept[1], lines_hz)


def recorded(angle: np.ndarray, torque: np.ndarray, lines_hz: np.ndarray = LINES_HZ) -> Record:
    return Record.from_arrays(
        motor_position=angle, motor_torque=torque, axes="n_config n_block n_exp n_period n_sample n_axis",
        sample_time_s=SAMPLE_S, axis_names=("lever",), angle=POSES[::2, None], excited_hz=lines_hz,
        torque_hold="zero_order_hold",
    )  # fmt: skip


def diagnosed(record: Record | tuple[Record, ...], folder: Path, **settings: object) -> Diagnosis:
    (folder / "servo.yaml").write_text(SERVO)
    context = Context(np.random.default_rng(0), map_in_process, lambda *_: None, logging.getLogger("test"))
    stage = Effects.model_validate({"separate": False, "response_check": ()} | settings)
    records = record if isinstance(record, tuple) else (record,)
    return stage.run(records, Robot.load(str(folder / "servo.yaml")), context)


def test_friction_that_grows_with_the_load_is_named_and_sized(tmp_path: Path) -> None:
    found = diagnosed(measured(0.06), tmp_path)
    assert [(one.kind, one.effect) for one in found.findings] == [("cause", "friction.load_dependent")]
    (cause,) = found.findings
    size = cause.names.index("load_coulomb")
    assert abs(cause.value[size] - 0.06) < 4 * cause.standard_error[size] < 0.02
    values = found.values
    assert values is not None
    stiffness = values.names.index("gear_stiffness.lever")
    assert (
        abs(values.estimate[stiffness] - STIFFNESS) < 4 * values.standard_error[stiffness] < 0.05 * STIFFNESS
    )


def test_moves_of_different_lengths_on_a_clock_that_is_off_by_millionths(tmp_path: Path) -> None:
    """Both ended in a traceback; simulations go by the steps of the robot file, 20 ppm beside them are as good."""
    record = measured(0.05)
    whole = [record.run.values(name) for name in ("motor_position", "motor_torque")]
    moves = []
    for configurations, n in ((slice(0, 2), 4000), (slice(2, 3), 3100)):
        angle, torque = (one[configurations].reshape(-1, 1, 2, 1, 4000, 1)[..., :n, :] for one in whole)
        moves.append(
            Record.from_arrays(
                motor_position=angle, motor_torque=torque, axes="n_config n_block n_exp n_period n_sample n_axis",
                sample_time_s=1.00002 * SAMPLE_S, axis_names=("lever",), angle=POSES[::2, None][configurations],
                torque_hold="zero_order_hold",
            )
        )  # fmt: skip
    diagnosis = diagnosed(tuple(moves), tmp_path, only=("friction.load_dependent", "transmission.stiffening"))
    (cause,) = diagnosis.findings
    assert (cause.kind, cause.effect) == ("cause", "friction.load_dependent")
    size = cause.names.index("load_coulomb")
    assert abs(cause.value[size] - 0.05) < 4 * cause.standard_error[size] < 0.02


def test_a_record_that_is_given_twice_is_refused(tmp_path: Path) -> None:
    """Its noise counted twice, and four laws that the plant does not have were named with p < 0.001."""
    record = measured(0.0)
    with pytest.raises(DataRejected, match=r"\(record 2\) holds the samples of .* \(record 1\) to the last"):
        diagnosed((record, record.replace(source="a copy")), tmp_path)


def test_a_right_model_is_given_no_cause_and_torques_of_another_motion_are_refused(tmp_path: Path) -> None:
    record = measured(0.0)
    assert not diagnosed(record, tmp_path).findings
    run = record.run
    another = recorded(run.values("motor_position"), run.values("motor_torque")[..., ::-1, :])
    with pytest.raises(DataRejected, match="explains nothing of the torque of lever"):
        diagnosed(another, tmp_path, only=("friction.viscous",))


def test_a_damper_that_the_data_do_not_tell_stays_as_told_and_is_named(tmp_path: Path) -> None:
    """To 12 Hz, far below the resonance at 68 Hz, the lever follows the motor whatever the damper: not refused."""
    found = diagnosed(
        measured(0.06, np.arange(5.0, 13.0)), tmp_path, only=("friction.load_dependent",), highest_hz=15.0
    )
    assert [one.effect for one in found.findings] == ["friction.load_dependent"]
    assert "These data do not determine gear_damping.lever: taken from the robot file." in found.verdict
    assert found.values is not None
    assert "gear_damping.lever" not in found.values.names
