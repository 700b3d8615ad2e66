"""The study of response estimators in small: its sums are right, and its tables are those of the code."""

from __future__ import annotations

import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

sys.path.append(str(Path(__file__).parents[2]))
from studies.frf_methods import accuracy, coverage, estimates, iterations, stiffness, tables, variants
from studies.frf_methods.measurement import chance, first_experiments, measure, references
from studies.frf_methods.methods import METHODS
from studies.frf_methods.scenes import POSES, shipped_class

from reference.plants import reference_plant  # isort: skip
from robid_core import Record
from robid_core.registry import STAGES, registry


@pytest.fixture(scope="module")
def one_axis() -> Any:
    """A one-axis plant of the bench under a short excitation."""
    plant = reference_plant(1, "one_axis")
    return plant, shipped_class(plant, lines=12, period_s=2.0)


@pytest.fixture(scope="module")
def record(one_axis: Any) -> Record:
    plant, excitation = one_axis
    reference = references(excitation, 4, chance(1, 1, 1))
    return measure(plant.robot, plant.pose[0], excitation, reference, 3)


def test_methods_are_registered_stages_with_settings_that_they_know() -> None:
    for method in [*METHODS.values(), *iterations.methods().values()]:
        registry().load(STAGES, method.use)(**method.settings)
        for name in method.before:
            registry().load(STAGES, name)()


def test_first_experiments_are_whole_blocks_or_part_of_one(record: Record) -> None:
    torque = record.run.values("motor_torque")
    for count in (1, 2, 4):
        part = first_experiments(record, count).run.values("motor_torque")
        assert np.array_equal(part, torque[:, :count])  # one axis: one experiment a block


def test_estimates_of_two_experiments_know_nothing_of_the_rest(record: Record, one_axis: Any) -> None:
    plant, _ = one_axis
    few = {key: METHODS[key] for key in ("h1", "jio")}
    few = {
        key: SimpleNamespace(
            **{**vars(one), "counts": (2,), "prepare": one.prepare, "estimate": one.estimate}
        )
        for key, one in few.items()
    }
    whole = estimates.estimate(record, plant.nominal, few)
    part = estimates.estimate(first_experiments(record, 2), plant.nominal, few)
    assert set(whole) == {("h1", 2), ("jio", 2)}
    for variant, one in whole.items():
        assert np.array_equal(one.response, part[variant].response)


def test_estimates_survive_their_file(tmp_path: Path) -> None:
    chance_ = np.random.default_rng(0)
    response = chance_.standard_normal((5, 2, 2)) + 1j * chance_.standard_normal((5, 2, 2))
    one = estimates.Estimated(response, np.abs(response), np.arange(5.0))
    path = tmp_path / "a" / "b.npz"
    estimates.write(path, {("h1", 6): one, ("log", 24): one}, np.array([0, 3]))
    read = estimates.read(path)
    assert set(read) == {("h1", 6), ("log", 24)}
    assert read["log", 24].response == pytest.approx(response[[0, 3]], rel=1e-6)
    assert read["h1", 6].freedom.tolist() == [0, 3]
    assert [p.name for p in path.parent.iterdir()] == ["b.npz"]


def scene_of(truth: Any, seen: Any) -> Any:
    known = SimpleNamespace(
        response=truth,
        seen=seen,
        frequency_hz=np.linspace(4, 80, len(truth)),
        standard_error=np.zeros(truth.shape),
    )
    return SimpleNamespace(truth=known)


def test_error_is_bias_and_scatter_together() -> None:
    # log(g / truth) = bias + Gaussian of known size; 400 seeds, 60 lines: a mean square is known to 1 / sqrt(24000).
    chance_ = np.random.default_rng(1)
    truth = np.ones((60, 1, 1), dtype=complex)
    noise = 0.02 * (chance_.standard_normal((400, 60, 1, 1)) + 1j * chance_.standard_normal((400, 60, 1, 1)))
    runs = [estimates.Estimated(np.exp(0.03 + n), np.zeros((60, 1, 1)), np.zeros(60)) for n in noise]
    found = accuracy.pose_errors(scene_of(truth, np.full(truth.shape, True)).truth, runs)
    assert found.scatter == pytest.approx(2 * 0.02**2, rel=0.03)
    assert found.bias == pytest.approx(0.03**2, rel=0.03)
    assert found.error == pytest.approx(found.bias + found.scatter, rel=0.01)
    rows = accuracy.table(
        {("log", 24): [found] * 3, ("h1", 24): [found] * 3}, {"log": "LOG", "h1": "H1"}, chance_
    )
    assert rows[1]["ratio_to_log_24"] == pytest.approx(1.0)
    assert rows[0]["error"] == pytest.approx(np.sqrt(found.error))


def test_coverage_of_honest_regions_is_what_they_state_and_bias_shows_in_that_of_the_truth() -> None:
    # g = 1 + bias + complex Gaussian; its variance told with 12 complex degrees of freedom.
    chance_, n_run, n_freq = np.random.default_rng(2), 300, 100
    deviation, bias = 0.05, 0.1

    def normal(*shape: int) -> Any:
        return (chance_.standard_normal(shape) + 1j * chance_.standard_normal(shape)) / np.sqrt(2)

    chosen = coverage.lines(n_freq)
    truth = np.ones((n_freq, 1, 1), dtype=complex)
    runs = []
    for _ in range(n_run):
        told = deviation**2 * np.mean(np.abs(normal(12, len(chosen), 1, 1)) ** 2, axis=0)
        response = 1 + bias + deviation * normal(len(chosen), 1, 1)
        runs.append(estimates.Estimated(response, told, np.full(len(chosen), 12.0)))
    row = coverage.row(scene_of(truth, np.full(truth.shape, True)), "made up", runs, 300)
    assert row["own_low"] < 0.95 < row["own_high"]
    assert row["g_bla_high"] < 0.9
    assert row["bias_over_deviation"] == pytest.approx(bias / deviation, rel=0.1)
    # Median radius: sqrt(F(2, 24) at 95 % = 3.40) deviations.
    assert row["size"] == pytest.approx(np.sqrt(3.40) * deviation, rel=0.05)


def test_published_tables_name_methods_that_exist() -> None:
    titles = {method.title for method in METHODS.values()}
    for name in ("accuracy", "coverage"):
        if (tables.HERE / f"{name}.csv").exists():
            assert {row["method"] for row in tables.read_table(name)} <= titles


def test_variants_of_the_stiffness_part_are_methods() -> None:
    assert {key for key, _ in stiffness.VARIANTS} <= set(METHODS)
    assert len(set(POSES)) == len(POSES) == 21


def test_variants_are_judged_at_common_lines_and_differ_as_they_say(one_axis: Any) -> None:
    plant, excitation = one_axis
    smooth = variants.without_friction(plant)
    assert not smooth.robot.description.effects
    assert not smooth.robot.drives.coulomb.any()
    assert smooth.robot.drives.viscous == pytest.approx(plant.robot.drives.viscous)
    assert references(excitation, 2, chance(1, 1, 1), 2).shape[:2] == (2, 2)
    full = shipped_class(plant, lines=None, grid="full", period_s=2.0)
    assert np.isin(excitation.line, full.line).all()
    truth = np.linspace(1, 2, len(full.line))[:, None, None] + 0j
    scene = scene_of(truth, np.full(truth.shape, True))
    scene.excitation = full
    off = np.where(np.isin(full.line, excitation.line), 1.02, 1.5)[:, None, None]
    one = estimates.Estimated(off * truth, np.zeros(truth.shape), np.zeros(len(truth)))
    found = variants.errors(scene, [{("h1", 6): one}, {("h1", 6): one}], excitation.line)
    assert found["h1", 6].error == pytest.approx(np.log(1.02) ** 2)
