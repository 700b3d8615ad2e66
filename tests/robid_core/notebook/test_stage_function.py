"""Stages as functions: what a pipeline would make, with inputs by type, and every mistake in a sentence."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import NonNegativeInt

from robid_core import (
    ConfigurationError,
    Configurations,
    Excitation,
    Fit,
    Frf,
    FrfEstimator,
    NotTrustworthy,
    Pipeline,
    Record,
    Robot,
    Run,
    StoreError,
    load_plugin,
    use,
)
from robid_core.testing import example_artifacts, example_fit, example_frf, example_record, example_robot

STAGES = {
    "where": {"use": "design.candidates", "with": {"count": np.int64(2)}},
    "excite": {
        "use": "excitation.multisine",
        "with": {"band_hz": (10, 80), "lines": 12, "period_s": 1.0, "slow_sine_rad_s": 9},
    },
    "acquire": {"use": "acquisition.simulated", "with": {"plant": "one_axis_true", "periods": 2}},
    "frf": {"use": "frf.log"},
}


@pytest.fixture(scope="module")
def robot() -> Robot:
    return Robot.load("one_axis")


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    content = {"name": "dictionary", "seed": 3, "robot": "one_axis", "stages": STAGES}
    return Run.make(Pipeline.from_dict(content, tmp_path_factory.mktemp("project")))


def test_a_chain_of_functions_gives_what_the_pipeline_gives(robot: Robot, run: Run) -> None:
    """Each function on the pipeline's inputs; those with chance of their own are seeded by the stage's name there."""
    frf = use("frf.log")(run["acquire"])
    assert isinstance(frf, Frf)
    np.testing.assert_array_equal(frf.response, run["frf"].response)  # type: ignore[attr-defined]
    excitation = use("excitation.multisine", **STAGES["excite"]["with"])(robot, run["where"])  # type: ignore[arg-type]
    assert isinstance(excitation, Excitation)
    assert excitation.line.tolist() == run["excite"].line.tolist()  # type: ignore[attr-defined]


def test_equal_calls_give_equal_results_and_another_seed_others(robot: Robot) -> None:
    candidates = use("design.candidates", count=3)
    first, again, other = candidates(robot), candidates(robot), candidates(robot, seed=1)
    np.testing.assert_array_equal(first.angle, again.angle)
    assert not np.allclose(first.angle, other.angle)


def test_a_robot_in_memory_is_simulated_as_its_file_is(robot: Robot, run: Run) -> None:
    where, excitation = run["where"], run["excite"]
    by_file = use("acquisition.simulated", plant="one_axis_true", periods=1)(where, excitation, robot)
    itself = use("acquisition.simulated", periods=1)(where, excitation, Robot.load("one_axis_true"))
    for name in ("motor_position", "motor_torque"):
        np.testing.assert_array_equal(by_file.run.values(name), itself.run.values(name))


class Own(FrfEstimator):
    """The mean of the blocks' responses."""

    discard: NonNegativeInt = 0
    """Periods dropped."""

    def run(self, record: Record) -> Frf:
        u, y = record.spectra(discard=self.discard)
        return Frf.from_blocks(record, y @ np.linalg.inv(u), discard=self.discard)


def test_a_class_that_is_not_registered_is_a_function_too(robot: Robot) -> None:
    record = example_record(robot)
    frf = use(Own, discard=1)(record)
    np.testing.assert_array_equal(frf.response, Own(discard=1).run(record).response)
    with pytest.raises(
        ConfigurationError, match="^Own: discrad: unknown key 'discrad'; did you mean 'discard'"
    ):
        use(Own, discrad=1)


def test_a_fit_stands_for_the_robot_that_it_found(robot: Robot, run: Run) -> None:
    fit = example_fit(robot)
    assert fit.model is not None
    where, excitation = run["where"], run["excite"]
    simulate = use("acquisition.simulated", periods=1)
    mine = simulate(where, excitation, fit)
    theirs = simulate(where, excitation, robot=Robot.of_model(fit.model))
    np.testing.assert_array_equal(mine.run.values("motor_torque"), theirs.run.values("motor_torque"))
    with pytest.raises(NotTrustworthy, match="must not be used"):
        simulate(where, excitation, fit.replace(converged=False))


def test_a_stage_that_takes_many_takes_a_list_or_several(robot: Robot) -> None:
    fit, frf = example_fit(robot), example_frf(robot)
    page = use("report.html")
    both = page(robot, frf, fits=[fit, fit.replace(method="another")])
    assert "another" in both.html
    assert both.html == page(robot, frf=frf, fits=(fit, fit.replace(method="another"))).html


def test_drives_are_handed_in(robot: Robot, run: Run) -> None:
    drives = load_plugin("robid.drives", "simulated")(plant="one_axis_true")
    record = use("acquisition.drives", periods=1)(run["where"], run["excite"], robot, drives)
    assert isinstance(record, Record)


@pytest.mark.parametrize(
    ("call", "told"),
    [
        (lambda robot: use("frf.logg"), "frf.logg: no stage 'frf.logg'; did you mean 'frf.log'?"),
        (
            lambda robot: use("frf.log")(),
            "frf.log needs record: Record; it takes record: Record and makes a Frf",
        ),
        (lambda robot: use("frf.log")(robot), "frf.log takes no Robot here; it takes record: Record"),
        (lambda robot: use("frf.log")(data=1), "frf.log has no parameter 'data'"),
        (lambda robot: use("frf.log")(record=robot), "record is a Record, not Robot"),
        (lambda robot: use("design.candidates", count=1)(), "design.candidates needs robot: Robot"),
        (lambda robot: use("design.candidates", count=1)(robot=3), "a Robot is wanted, not a int"),
        (
            lambda robot: use("fit.torque_residual", free=["mas.*"])(example_record(robot), robot),
            "free[0]: the robot has no parameter 'mas.*'",
        ),
        (lambda robot: use("acquisition.simulated", plant=robot), "a Robot cannot be a setting"),
        (
            lambda robot: use("excitation.multisine", band_hz=[4], lines=0),
            "lines: 0 must be greater than 0",
        ),
    ],
)
def test_a_mistake_is_told_in_a_sentence(robot: Robot, call: Any, told: str) -> None:
    with pytest.raises(ConfigurationError, match=re.escape(told)):
        call(robot)


def test_a_run_is_a_mapping_of_what_its_stages_made(run: Run) -> None:
    assert list(run) == ["where", "excite", "acquire", "frf"]
    assert len(run) == 4
    assert isinstance(run["where"], Configurations)
    assert run.outcomes == dict.fromkeys(run, "made")
    assert run.doubts == ()
    with pytest.raises(ConfigurationError, match="stage 'fit' is not in this run; there are: where, excite"):
        run["fit"]
    with pytest.raises(ConfigurationError, match="holds no model"):
        run.robot("frf")
    assert "<td" in run._repr_html_()


def test_a_run_is_brought_up_to_date_and_read_again(run: Run) -> None:
    again = Run.load(run.path)
    assert again["frf"].response.tolist() == run["frf"].response.tolist()  # type: ignore[attr-defined]
    content = {"name": "dictionary", "seed": 3, "robot": "one_axis", "stages": STAGES}
    kept = Run.make(Pipeline.from_dict(content, run.path.parents[1]))
    assert set(kept.outcomes.values()) == {"kept"}


def test_a_result_that_was_changed_is_refused(robot: Robot, tmp_path: Path) -> None:
    content = {"robot": "one_axis", "stages": {"where": STAGES["where"]}}
    made = Run.make(Pipeline.from_dict(content, tmp_path))
    target = (made.path / made.manifest.stages["where"].file).resolve()
    target.chmod(0o644)
    target.write_bytes(target.read_bytes() + b" ")
    with pytest.raises(StoreError, match="it was changed or damaged"):
        made["where"]


def test_every_mistake_of_a_dictionary_is_told_by_its_place() -> None:
    wrong = {"robot": "one_axes", "stages": {"where": {"use": "design.candidates", "with": {"cuont": 2}}}}
    with pytest.raises(ConfigurationError) as error:
        Pipeline.from_dict(wrong)
    first, second = str(error.value).splitlines()
    assert first.startswith("robot: no robot 'one_axes'; did you mean 'one_axis'?")
    assert second == "stages.where.with.cuont: unknown key 'cuont'; did you mean 'count'?"


def test_every_artifact_shows_itself_with_its_text_escaped() -> None:
    robot = example_robot(1)
    for kind, artifact in example_artifacts(robot).items():
        html = artifact._repr_html_()
        assert html.startswith(f"<div><b>{kind.__name__}</b>")
    poisoned = example_fit(robot).replace(method="<script>alert(1)</script>", converged=False)
    html = poisoned._repr_html_()
    assert "<script" not in html
    assert "the fit did not converge" in html
    assert isinstance(poisoned, Fit)
    assert "one_axis" in robot._repr_html_()
