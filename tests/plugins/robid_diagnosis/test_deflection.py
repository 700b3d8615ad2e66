"""Encoders on both sides of a gear: plants whose link moves as prescribed, so that gear and motor are known exactly.

The link's angle l(t) is a sum of sines. The gear then passes T = J l'' + G sin l; it bends by T / K, hangs back by half
its lost motion against direction or torque, and the motor is ahead of the link by just that. The motor's torque is T
with its rotor and its friction.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from robid_core import Channel, DataRejected, DenseRun, Diagnosis, Record, Robot
from robid_core.testing import check_stage
from robid_diagnosis.deflection import GearDeflection
from robid_diagnosis.link_encoder import is_computed, step_of

STEP, SECONDS, RATIO = 0.004, 20.0, 100.0
ARM, WEIGHT = 60.0, 400.0  # kg m^2, N m
ROTOR, COULOMB = 2e-3, 0.8  # at the motor
STIFFNESS = 2e5  # N m/rad
NOISE = 2e-6  # rad, of both encoders
FILE = f"""
robid_robot: 1
name: joint
sample_time_s: {STEP}
bodies:
  - {{joint: axis_1, axis: [0, 1, 0], mass: 20.0, centre_of_mass: [0.5, 0, 0],
     inertia: [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}}
axes:
  axis_1: {{gear_ratio: {RATIO}, rotor_inertia: {ROTOR}, friction: {{coulomb: {COULOMB}}}}}
"""


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    path: Path = tmp_path_factory.mktemp("joint") / "robot.yaml"
    path.write_text(FILE)
    return Robot.load(str(path))


def recorded(
    seed: int = 0,
    stiffness: float = STIFFNESS,
    late: float = 0.0,
    reversal: float = 0.0,
    play: float = 0.0,
    weight: float = WEIGHT,
    n_sine: int = 12,
    noise: float = NOISE,
) -> Record:
    """Both angles and the torque of such a plant; the link's channel comes `late`, s."""
    generator = np.random.default_rng(seed)
    frequency = np.sort(generator.uniform(0.1, 1.5, n_sine))
    phase, amplitude = generator.uniform(0, 2 * np.pi, n_sine), 0.25 / np.sqrt(n_sine)

    def sines(time: np.ndarray, order: int) -> np.ndarray:
        omega = 2 * np.pi * frequency[:, None]
        return np.asarray(
            (amplitude * (omega**order * np.sin(omega * time + phase[:, None] + order * np.pi / 2))).sum(
                axis=0
            )
        )

    time = STEP * np.arange(round(SECONDS / STEP))
    passed = ARM * sines(time, 2) + weight * np.sin(sines(time, 0))
    back = 0.5 * reversal * np.tanh(sines(time, 1) / 1e-3) + 0.5 * play * np.tanh(passed / 2.0)
    motor = sines(time, 0) + passed / stiffness + back
    bent = np.gradient(np.gradient(passed / stiffness, STEP), STEP)
    rotor = ROTOR * RATIO**2 * (sines(time, 2) + bent)
    torque = passed + rotor + COULOMB * RATIO * np.tanh(sines(time, 1) / 1e-3)
    link = sines(time - late, 0) + noise * generator.standard_normal(time.shape)
    motor = motor + noise * generator.standard_normal(time.shape)
    return record_of(RATIO * motor, torque / RATIO, link)


def record_of(motor: np.ndarray, torque: np.ndarray, link: np.ndarray) -> Record:
    def channel(side: str, unit: str, values: np.ndarray) -> Channel:
        return Channel(side, unit, values.reshape(1, 1, 1, 1, -1, 1))

    channels = {
        "motor_position": channel("motor", "rad", motor),
        "motor_torque": channel("motor", "N m", torque),
        "joint_position": channel("joint", "rad", link),
    }
    time = STEP * np.arange(len(motor), dtype=np.float64)
    run = DenseRun(STEP, channels, time, np.ones((1, 1, 1, 1, len(motor)), dtype=bool))
    return Record(("axis_1",), "test", "continuous", (run,), np.zeros((1, 1)))


def ends(diagnosis: Diagnosis, name: str) -> tuple[float, float]:
    """Both ends of an interval of 95 %, as the table has it."""
    table = diagnosis.values
    assert table is not None
    i = table.names.index(f"{name}.axis_1")
    half = 1.96 * table.standard_error[i]
    return float(table.estimate[i] - half), float(table.estimate[i] + half)


def holds(diagnosis: Diagnosis, name: str, value: float) -> bool:
    low, high = ends(diagnosis, name)
    return low <= value <= high


@pytest.mark.parametrize("seed", range(4))
def test_the_intervals_hold_what_the_plant_has(robot: Robot, seed: int) -> None:
    """A late link, lost motion at the reversal and play, all at once, and a stiffness known to a few percent."""
    true: dict[str, Any] = {"late": 3e-3, "reversal": 4e-5, "play": 6e-5}
    found = GearDeflection().run(recorded(seed, **true), robot)
    assert holds(found, "gear_compliance", 1 / STIFFNESS)
    low, high = ends(found, "gear_compliance")
    assert high - low < 0.2 / STIFFNESS
    assert holds(found, "time_shift", true["late"])
    assert holds(found, "reversal", true["reversal"])
    assert holds(found, "play", true["play"])


def test_a_time_shift_is_no_stiffness(robot: Robot) -> None:
    """Of a rigid gear the late channel alone makes a deflection of a milliradian: no upper bound of the stiffness."""
    found = GearDeflection().run(recorded(stiffness=1e12, late=3e-3), robot)
    assert holds(found, "gear_compliance", 0.0)
    assert ends(found, "gear_compliance")[1] < 0.02 / STIFFNESS
    assert "no upper bound" in found.verdict
    assert "comes late by 3" in found.verdict


@pytest.mark.parametrize("rounded", [0.0, 2e-4])
def test_a_computed_link_is_no_measurement(robot: Robot, rounded: float) -> None:
    """The motor's angle of the sample before, as it is or rounded."""
    real = recorded()
    motor, torque = (real.run.lanes(name)[0, :, 0] for name in ("motor_position", "motor_torque"))
    link = np.concatenate((motor[:1], motor[:-1])) / RATIO
    link = np.round(link / rounded) * rounded if rounded else link
    found = GearDeflection().run(record_of(motor, torque, link), robot)
    assert "says nothing of the gear" in found.verdict
    assert found.values is not None
    assert found.values.names == ()


def test_an_encoder_too_coarse_for_the_deflection_says_nothing(robot: Robot) -> None:
    """Steps of 10 mrad, twice the largest deflection: the same to the last digit as a computed channel."""
    real = recorded(noise=0.0)
    link = np.round(real.run.lanes("joint_position")[0, :, 0] / 1e-2) * 1e-2
    motor, torque = (real.run.lanes(name)[0, :, 0] for name in ("motor_position", "motor_torque"))
    found = GearDeflection().run(record_of(motor, torque, link), robot)
    assert "says nothing of the gear" in found.verdict


def test_one_sine_does_not_tell_a_load_from_an_angle(robot: Robot) -> None:
    """Without gravity the torque is in proportion to the angle."""
    found = GearDeflection().run(recorded(n_sine=1, weight=0.0), robot)
    assert "several frequencies" in found.verdict


def test_a_link_that_runs_ahead_is_refused(robot: Robot) -> None:
    """The sign of the torque turned round."""
    real = recorded()
    motor, torque, link = (
        real.run.lanes(name)[0, :, 0] for name in ("motor_position", "motor_torque", "joint_position")
    )
    found = GearDeflection().run(record_of(motor, -torque, link), robot)
    assert "no gear does that" in found.verdict


def test_a_record_without_link_encoders_is_refused(robot: Robot) -> None:
    real = recorded()
    channels = {name: one for name, one in real.run.channels.items() if name != "joint_position"}
    bare = real.replace(runs=(real.run.replace(channels=channels),))
    with pytest.raises(DataRejected, match="joint_position"):
        GearDeflection().run(bare, robot)


def test_rounding_is_seen_and_measured_angles_are_not_computed() -> None:
    generator = np.random.default_rng(1)
    angle = np.cumsum(generator.standard_normal(3000)) * 1e-3
    assert step_of(np.round(angle / 5e-4) * 5e-4) == pytest.approx(5e-4)
    assert step_of(angle) == 0.0
    assert is_computed(angle, 0.3 * angle + 0.1)
    assert not is_computed(angle, angle + 1e-6 * generator.standard_normal(3000))


def test_the_stage_keeps_the_contract() -> None:
    # What it tells are bounds, not errors of the model: the tests above hold them to known gears.
    check_stage(GearDeflection, for_axes=(1,), artifacts=lambda _: {Record: recorded()}, recovery=False)
