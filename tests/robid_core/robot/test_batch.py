"""Batches of simulated experiments: the same bytes whoever computes them, each experiment as it is alone."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from robid_core import ConfigurationError, Robot
from robid_core.executors import process_executor
from robid_core.robot import experiments
from robid_core.robot.batch import BatchDiverged, simulate_over, simulate_portions
from robid_core.robot.experiments import ExperimentBatch, lanes_per_portion, portions, robot_of, task
from robid_core.stage import map_in_process

N_LANE, N_SAMPLE = 21, 150


@pytest.fixture(scope="module")
def robot() -> Robot:
    return Robot.load("one_axis_true")


@pytest.fixture(scope="module")
def asked(robot: Robot) -> dict[str, Any]:
    generator = np.random.default_rng(3)
    reference = generator.normal(size=(N_LANE, N_SAMPLE, 1)).cumsum(axis=1)
    return {
        "speed_reference": reference - reference.mean(axis=1, keepdims=True),
        "angle": generator.uniform(-0.5, 0.5, (N_LANE, 1)),
        "seed": generator.integers(2**62, size=N_LANE),
    }


@pytest.fixture(autouse=True)
def small_portions(monkeypatch: pytest.MonkeyPatch) -> None:
    """Cut after eight experiments of 150 samples, so that there are three portions."""
    monkeypatch.setattr(experiments, "PORTION", 8 * N_SAMPLE)


def data(result: Any) -> list[bytes]:
    return [result.position.tobytes(), result.torque.tobytes(), result.saturated.tobytes()]


@pytest.mark.parametrize("name", ["one_axis_true", "six_axis_true"])
def test_each_experiment_is_bit_by_bit_what_the_robot_does_alone(name: str) -> None:
    robot, generator = Robot.load(name), np.random.default_rng(4)
    reference = generator.normal(size=(11, N_SAMPLE, robot.n_axis)).cumsum(axis=1)
    angle = generator.uniform(-0.5, 0.5, (11, robot.n_axis))
    batch = simulate_over(map_in_process, robot, reference, angle, range(5, 16))
    for lane in (0, 3, 7, 8, 10):
        alone = robot.simulate(reference[lane][None], angle[lane][None], 5 + lane)
        assert batch.position[lane].tobytes() == alone.position[0].tobytes()
        assert batch.torque[lane].tobytes() == alone.torque[0].tobytes()
        np.testing.assert_array_equal(batch.saturated[lane], alone.saturated[0])
    assert len({batch.torque[lane].tobytes() for lane in range(11)}) == 11


def test_bytes_do_not_depend_on_how_the_batch_is_cut(
    robot: Robot, asked: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    three = data(simulate_over(map_in_process, robot, **asked))
    monkeypatch.setattr(experiments, "PORTION", 10**9)
    assert data(simulate_over(map_in_process, robot, **asked)) == three


def test_bytes_do_not_depend_on_threads_processes_or_how_tasks_are_handed_over(
    robot: Robot, asked: dict[str, Any]
) -> None:
    expected = data(simulate_over(map_in_process, robot, **asked, n_thread=1))
    assert data(simulate_over(map_in_process, robot, **asked, n_thread=3)) == expected
    assert data(simulate_over(map_in_process, robot, **asked, n_thread=0)) == expected
    with process_executor(jobs=2) as workers:
        assert data(simulate_over(workers, robot, **asked)) == expected
        assert workers._pool is None, "compiled loops run in threads of this process"
        assert data(simulate_over(workers, robot, **asked, n_thread=0)) == expected
        assert workers._pool is not None


def test_portions_are_multiples_of_eight_experiments_whoever_computes() -> None:
    assert lanes_per_portion(N_SAMPLE) == 8
    assert lanes_per_portion(10**9) == 8, "at least the lanes of the kernel"
    assert lanes_per_portion(N_SAMPLE // 3) == 24
    robot, none = Robot.load("one_axis"), np.zeros((0, 0, 0))
    batches = [
        ExperimentBatch(robot, np.zeros((1, N_SAMPLE, 1)), np.zeros((n, 1)), np.zeros(n, dtype=np.int64))
        for n in (17, 8, 3)
    ]
    assert none.size == 0
    assert list(portions(batches)) == [(0, 0, 8), (0, 8, 16), (0, 16, 17), (1, 0, 8), (2, 0, 3)]


def test_many_robots_are_many_batches_and_come_in_order(robot: Robot, asked: dict[str, Any]) -> None:
    softer = robot.with_parameters({name: 0.5 * robot.parameters()[name] for name in robot.stiffness_names})
    start = robot.motor_angle(asked["angle"])
    batches = [
        ExperimentBatch(one, asked["speed_reference"], start, seed=asked["seed"]) for one in (robot, softer)
    ]
    steps: list[tuple[float, float]] = []

    def progress(done: float, total: float, note: str) -> None:
        steps.append((done, total))

    found = list(simulate_portions(map_in_process, batches, progress))
    assert [(p.batch, p.first, p.last) for p in found] == list(portions(batches))
    for index, one in enumerate((robot, softer)):
        whole = simulate_over(map_in_process, one, **asked)
        mine = np.concatenate([p.torque for p in found if p.batch == index])
        assert mine.tobytes() == whole.torque.tobytes()
    assert steps == [(done, 2 * N_LANE) for done in (0, 8, 16, 21, 29, 37, 42)]


def test_a_reference_repeats_and_the_last_periods_are_kept(robot: Robot, asked: dict[str, Any]) -> None:
    plain = {name: values[:3] for name, values in asked.items()}
    repeated = {**plain, "speed_reference": np.tile(plain["speed_reference"], (1, 3, 1))}
    whole = simulate_over(map_in_process, robot, **repeated)
    kept = simulate_over(map_in_process, robot, **plain, n_period=3, n_kept=2)
    assert kept.position.tobytes() == np.ascontiguousarray(whole.position[:, N_SAMPLE:]).tobytes()
    assert kept.torque.tobytes() == np.ascontiguousarray(whole.torque[:, N_SAMPLE:]).tobytes()
    np.testing.assert_array_equal(kept.saturated, whole.saturated)


def test_experiments_can_share_references(robot: Robot, asked: dict[str, Any]) -> None:
    which = np.array([2, 0, 2, 1, 1], dtype=np.int64)
    start = robot.motor_angle(asked["angle"][:5])
    shared = ExperimentBatch(robot, asked["speed_reference"][:3], start, which)
    own = replace(shared, speed_reference=asked["speed_reference"][which], reference_of=None)
    one, other = (next(simulate_portions(map_in_process, [batch])) for batch in (shared, own))
    assert data(one) == data(other)


def test_the_robot_arrives_as_it_was_sent() -> None:
    robot = Robot.load("six_axis_true")
    batch = ExperimentBatch(robot, np.zeros((1, 2, 6)), np.zeros((1, 6)))
    arrived = robot_of(task(batch, 0, 1)[0])
    assert arrived == robot
    assert arrived.to_yaml() == robot.to_yaml()


def test_an_experiment_that_diverges_is_named_and_the_others_are_kept(robot: Robot) -> None:
    axis = robot.description.axes["axis_1"].model_copy(update={"torque_limit": 1e12})
    strong = Robot(robot.description.model_copy(update={"axes": {"axis_1": axis}}))
    reference = np.zeros((19, N_SAMPLE, 1))
    reference[9] = 1e9  # rad/s: beyond all bounds after a few samples
    with pytest.raises(BatchDiverged, match=r"^experiment 10 left all bounds at 0\.\d+ s") as told:
        simulate_over(map_in_process, strong, reference, np.zeros((19, 1)))
    partial = told.value.partial
    assert partial is not None
    assert np.isfinite(partial.position[[0, 7, 8, 15]]).all()
    assert np.isnan(partial.position[9, -1])
    assert np.isnan(partial.torque[16:]).all(), "not computed any more"


def test_an_unstable_controller_is_refused_before_anything_travels(robot: Robot) -> None:
    axis = robot.description.axes["axis_1"]
    wild = axis.model_copy(update={"controller": axis.controller.model_copy(update={"speed_gain": 50.0})})
    unstable = Robot(robot.description.model_copy(update={"axes": {"axis_1": wild}}))
    with pytest.raises(ConfigurationError, match="axis_1: the controller is unstable"):
        simulate_over(map_in_process, unstable, np.zeros((3, 5, 1)), np.zeros((3, 1)), n_thread=0)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            {"speed_reference": np.zeros((3, 5, 2))},
            r"shape \(3, 5, 2\), expected \(n_reference, n_sample, 1\)",
        ),
        ({"motor_angle": np.zeros((0, 1))}, r"angles of shape \(0, 1\), expected \(n_lane, 1\)"),
        ({"motor_angle": np.zeros((4, 1))}, "3 references for 4 experiments; give reference_of"),
        ({"reference_of": np.array([0, 1, 3])}, "name one of 3 references for each of 3 experiments"),
        ({"seed": np.array([1, 2])}, "one seed >= 0 for each of 3 experiments"),
        ({"seed": np.array([1, 2, -1])}, "one seed >= 0"),
        ({"n_kept": 3, "n_period": 2}, "3 periods are to be kept, 2 are simulated"),
        ({"n_kept": 0}, "0 periods are to be kept"),
    ],
)
def test_arrays_that_do_not_fit_are_told_before_anything_is_computed(
    robot: Robot, change: dict[str, Any], words: str
) -> None:
    good = ExperimentBatch(robot, np.zeros((3, 5, 1)), np.zeros((3, 1)))
    with pytest.raises(ConfigurationError, match=words):
        next(simulate_portions(map_in_process, [good, replace(good, **change)]))
