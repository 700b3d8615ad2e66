"""Records made again: a robot gives its own record back, from rest, in steady motion and from a motion under way."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from robid_core import (
    Channel,
    ConfigurationError,
    DataRejected,
    DenseRun,
    Record,
    Robot,
    simulate_record,
    simulate_records,
)
from robid_core.mechanics import SimulationDiverged
from robid_core.robot import recorded

T = 1e-3
ANGLE = np.array(
    [[0.1, 0.5, 0.2, 0.1, 0.3, 0.1], [-0.6, 0.1, 0.4, -0.8, -0.4, 1.0], [0.9, -0.3, 0.0, 0.5, 0.9, 0.2]]
)


def without_sensors(robot: Robot) -> Robot:
    """The robot with exact sensors: what is left of a difference is the start's."""
    data = json.loads(robot.description.model_dump_json())
    for axis in data["axes"].values():
        axis["sensors"] = {}
    return Robot(type(robot.description).model_validate_json(json.dumps(data)))


@pytest.fixture(scope="module")
def six() -> Robot:
    return without_sensors(Robot.load("six_axis_true"))


def waves(n_sample: int, n_lane: int = 3) -> np.ndarray:
    """Speed references of a period, rad/s."""
    generator, time = np.random.default_rng(2), np.arange(n_sample) / n_sample
    reference = np.zeros((n_lane, n_sample, 6))
    for line in (1, 3, 7, 11):
        reference += 3 * np.sin(2 * np.pi * line * time[:, None] + generator.uniform(0, 6, (n_lane, 1, 6)))
    return reference


def record_of(
    position: np.ndarray, torque: np.ndarray, n_period: int, lines: Any = None, **reference: np.ndarray
) -> Record:
    """Lanes (n_lane, n_sample, 6) as the experiments of one configuration."""
    n_lane, total, n_axis = position.shape
    shape = (1, 1, n_lane, n_period, total // n_period, n_axis)
    units = {"position_reference": "rad", "speed_reference": "rad/s"}
    channels = {
        name: Channel("motor", units[name], values.reshape(shape)) for name, values in reference.items()
    }
    channels["motor_position"] = Channel("motor", "rad", position.reshape(shape))
    channels["motor_torque"] = Channel("motor", "N m", torque.reshape(shape))
    valid = np.ones(shape[:-1], dtype=bool)
    run = DenseRun(T, channels, np.arange(shape[4]) * T, valid)
    names = tuple(f"axis_{a + 1}" for a in range(n_axis))
    return Record(names, "made up", "zero_order_hold", (run,), ANGLE[:1], lines)


def values(record: Record, name: str) -> np.ndarray:
    whole = record.run.values(name)
    return whole.reshape(whole.shape[2], -1, whole.shape[-1])


def test_a_record_that_begins_at_rest_is_given_back(six: Robot) -> None:
    reference = waves(700)
    done = six.simulate(reference, ANGLE)
    record = record_of(done.position, done.torque, 1, speed_reference=reference)
    again = simulate_record(six, record)
    # The angles at the start go to the joints and back: rounding of 1e-16 of some 70 rad, times gains.
    np.testing.assert_allclose(values(again, "motor_position"), done.position, rtol=0, atol=1e-10)
    np.testing.assert_allclose(values(again, "motor_torque"), done.torque, rtol=0, atol=1e-7)
    assert again.run.values("speed_reference") is record.run.values("speed_reference")
    assert again.source == f"made up, simulated with {six.name}"


def test_a_start_that_does_not_exist_is_refused(six: Robot) -> None:
    record = record_of(np.zeros((1, 9, 6)), np.zeros((1, 9, 6)), 1, speed_reference=np.zeros((1, 9, 6)))
    with pytest.raises(ConfigurationError, match="start 'measured': give one of: rest, motion"):
        simulate_record(six, record, "measured")  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("how", "calls"),
    [
        ({"start": "rest"}, 2),  # 700 and 740 samples beside one another, 900 alone
        ({"start": "motion"}, 2),
        ({"horizon_s": 0.05}, 1),  # windows are of one length
        ({"start": "rest", "seed": 4}, 3),  # noise is drawn for each run
    ],
    ids=["rest", "motion", "horizon", "noise"],
)
def test_several_records_side_by_side_come_out_as_each_alone(
    six: Robot, how: dict[str, Any], calls: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    records = []
    for n_sample, n_lane in ((740, 3), (900, 1), (700, 2)):
        reference = waves(n_sample, n_lane)
        done = six.simulate(reference, ANGLE[:n_lane])
        records.append(record_of(done.position, done.torque, 1, speed_reference=reference))
    alone = [simulate_record(six, one, **how) for one in records]
    simulate, seen = recorded.continue_simulation, []

    def counted(*arguments: Any, **options: Any) -> Any:
        seen.append(arguments)
        return simulate(*arguments, **options)

    monkeypatch.setattr(recorded, "continue_simulation", counted)
    together = simulate_records(six, records, **how)
    assert len(seen) == calls
    for one, other in zip(together, alone, strict=True):
        for name in ("motor_position", "motor_torque"):
            np.testing.assert_array_equal(one.run.values(name), other.run.values(name))


def test_what_happens_behind_the_end_of_a_shorter_record_ends_no_simulation(
    six: Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    references = [waves(n_sample, 1) for n_sample in (700, 740)]
    records = []
    for reference in references:
        done = six.simulate(reference, ANGLE[:1])
        records.append(record_of(done.position, done.torque, 1, speed_reference=reference))
    alone = [simulate_record(six, one) for one in records]
    simulate = recorded.continue_simulation

    def diverging(first: int) -> Any:
        def simulated(*arguments: Any, **options: Any) -> Any:
            done = simulate(*arguments, **options)
            done.position[0, first:] = np.nan
            raise SimulationDiverged("lane 0 left all bounds", done)

        return simulated

    monkeypatch.setattr(recorded, "continue_simulation", diverging(700))
    for one, other in zip(simulate_records(six, records), alone, strict=True):
        np.testing.assert_array_equal(one.run.values("motor_position"), other.run.values("motor_position"))
    monkeypatch.setattr(recorded, "continue_simulation", diverging(699))
    with pytest.raises(SimulationDiverged):
        simulate_records(six, records)


def test_a_periodic_record_is_given_back_in_steady_motion(six: Robot) -> None:
    reference = waves(1000)
    start = six.joint_angle(six.motor_angle(ANGLE) - (np.cumsum(reference, axis=1) * T).mean(axis=1))
    done = six.simulate(np.tile(reference, (1, 6, 1)), start)
    lines = np.array([1, 3, 7, 11])
    twice = np.tile(reference, (1, 2, 1))
    record = record_of(done.position[:, 4000:], done.torque[:, 4000:], 2, lines, speed_reference=twice)
    moving, resting = simulate_record(six, record, "motion"), simulate_record(six, record)
    error = {
        name: abs(values(again, "motor_torque") - done.torque[:, 4000:]).max() / np.ptp(done.torque)
        for name, again in (("moving", moving), ("resting", resting))
    }
    # After 4 s the made record itself still changes by 5e-4 of its swing from period to period.
    assert error["moving"] < 5e-3
    assert error["resting"] > 0.03
    # Motors stay where they were recorded: nothing but the first samples says where speed controllers go about.
    away = [abs(values(r, "motor_position") - done.position[:, 4000:]).max() for r in (moving, resting)]
    assert away[0] < 0.1 * away[1]


@pytest.mark.parametrize("by_position", [False, True])
def test_a_record_cut_from_a_motion_is_given_back(six: Robot, by_position: bool) -> None:
    reference, cut = np.tile(waves(1000), (1, 2, 1)), 317
    aim = np.cumsum(reference, axis=1) * T + six.motor_angle(ANGLE)[:, None]
    extra = {"position_reference": aim} if by_position else {}
    gain = {f"controller.{name}.position_gain": 8.0 * by_position for name in six.axis_names}
    robot = six.with_parameters(gain)
    done = robot.simulate(reference, ANGLE, **extra)
    channels = {name: v[:, cut:] for name, v in {"speed_reference": reference, **extra}.items()}
    record = record_of(done.position[:, cut:], done.torque[:, cut:], 1, **channels)
    again = {start: simulate_record(robot, record, start) for start in ("rest", "motion")}  # type: ignore[arg-type]
    torque = done.torque[:, cut:]
    first = values(again["motion"], "motor_torque")[:, 0]
    # The speed before is a parabola's: off by a third difference of angles, 9e-6 rad in 1 ms, times 0.2 N m s/rad.
    np.testing.assert_allclose(first, torque[:, 0], rtol=0, atol=2e-3)
    # What is behind the motors has rung out after a second; friction remembers nothing.
    error = {
        start: np.sqrt(((values(r, "motor_torque") - torque)[:, 1000:] ** 2).mean() / torque.var())
        for start, r in again.items()
    }
    assert error["motion"] < 2e-3
    assert error["rest"] > 2 * error["motion"]


def test_noise_of_the_first_samples_does_not_drive_the_motors_away(six: Robot) -> None:
    reference, cut = np.tile(waves(1000), (1, 2, 1)), 317
    done = six.simulate(reference, ANGLE)
    noise = 0.01 * six.drives.torque_limit * np.random.default_rng(5).standard_normal(done.torque.shape)
    torque, asked = (done.torque + noise)[:, cut:], reference[:, cut:]
    exact, noisy = (
        values(simulate_record(six, record, "motion"), "motor_position")
        for record in (
            record_of(done.position[:, cut:], done.torque[:, cut:], 1, speed_reference=asked),
            record_of(done.position[:, cut:], torque, 1, speed_reference=asked),
        )
    )
    # A torque T too much that the integrators hold moves a motor by T / integral gain.
    gain = np.array([six.parameter(f"controller.{name}.integral_gain") for name in six.axis_names])
    assert (abs(noisy - exact)[:, -1] < 0.5 * 0.01 * six.drives.torque_limit / gain).all()


def test_what_cannot_be_simulated_is_refused(six: Robot, tmp_path: Path) -> None:
    reference = waves(50)
    done = six.simulate(reference, ANGLE)
    bare = record_of(done.position, done.torque, 1)
    with pytest.raises(DataRejected, match="neither position_reference nor speed_reference"):
        simulate_record(six, bare)
    record = record_of(done.position, done.torque, 1, speed_reference=reference)
    run = record.run
    holes = run.replace(valid=np.zeros_like(run.valid))
    with pytest.raises(DataRejected, match="samples are missing"):
        simulate_record(six, record.replace(runs=(holes,)))
    with pytest.raises(ConfigurationError, match="set sample_time_s in the robot file"):
        simulate_record(six, record.replace(runs=(run.replace(sample_time_s=2e-3),)))
