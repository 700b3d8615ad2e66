"""Many recordings as one record: patterns of files, tables, parts of a file; every value in its place."""

from __future__ import annotations

import hashlib
import itertools
import json
import logging
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from robid_acquisition.recorded import RecordedAcquisition
from robid_core import ConfigurationError, Context, DataRejected, ExtraMissing, Frf, Record, Robot
from robid_core.pipeline import Pipeline
from robid_core.run import RunOptions, run_pipeline
from robid_core.stage import map_in_process
from robid_core.testing import MassSpringPlant, example_context, example_robot, plant_record
from robid_core.yaml_file.problems import FileProblems
from robid_frf.h1 import H1

TEN_LINES = """\
robid: 1
name: lab
seed: 1
robot: six_axis
stages:
  acquire:
    use: acquisition.recorded
    with: {pattern: "lab/c{config}_b{block}_e{exp}.npz", sample_time_s: 0.001, period_s: 0.01, lines: [1, 3],
      torque_hold: continuous, channels: {motor_position: {column: q, unit: deg},
                 motor_torque: {column: i, unit: A, scale: 0.5, unit_to: N m}}}
"""
CHANNELS = {"motor_position": {"column": "q", "unit": "rad"}}
AXIS = {"rotor_inertia": 1e-3, "torque_limit": 10.0, "speed_limit": 100.0, "controller": {"speed_gain": 0.1}}


@pytest.fixture(scope="module", name="robot")
def one_axis_robot(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    folder = tmp_path_factory.mktemp("robot")
    data = {"robid_robot": 1, "name": "test", "bodies": [{"joint": "axis_1", "mass": 1.0}], "axes": {
        "axis_1": {**AXIS, "gear_ratio": 10.0}}}  # fmt: skip
    (folder / "robot.yaml").write_text(json.dumps(data))
    return Robot.load("robot.yaml", folder)


Read = Callable[..., Record]


@pytest.fixture(name="read")
def reading(tmp_path: Path, robot: Robot) -> Read:
    """Return a function that imports what lies in the folder; progress is kept in its attribute."""
    told: list[tuple[float, float]] = []

    def read(**settings: Any) -> Record:
        with_defaults = {"sample_time_s": 0.1, "channels": CHANNELS, **settings}
        stage = RecordedAcquisition.model_validate_json(json.dumps(with_defaults), strict=True)
        context = Context(
            np.random.default_rng(0),
            map_in_process,
            lambda done, total, note="": told.append((done, total)),
            logging.getLogger("test"),
            tmp_path,
        )
        return stage.run(robot, context)

    read.told = told  # type: ignore[attr-defined]
    return read


def number(configuration: int, block: int, experiment: int) -> float:
    return 100.0 * configuration + 10.0 * block + experiment


def save(folder: Path, name: str, value: float, n: int = 20) -> None:
    """A recording whose samples begin at `value` and grow by a thousandth each."""
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    np.savez(path, q=value + 1e-3 * np.arange(n))


def firsts(record: Record) -> list[Any]:
    """First sample of each experiment."""
    return record.run.values("motor_position")[:, :, :, 0, 0, 0].tolist()


# 192 files of a foreign robot


@pytest.fixture(name="lab")
def lab_files(tmp_path: Path) -> Path:
    (tmp_path / "data" / "lab").mkdir(parents=True)
    for c, b, e in itertools.product(range(1, 17), range(1, 3), range(1, 7)):
        draw = np.random.default_rng([c, b, e])
        q = 1e-3 * draw.normal(size=(25, 6)) + 100 * c
        np.savez(tmp_path / "data" / "lab" / f"c{c}_b{b}_e{e}.npz", q=q, i=draw.normal(size=(25, 6)))
    (tmp_path / "pipeline.yaml").write_text(TEN_LINES)
    return tmp_path


def run_lab(folder: Path) -> Any:
    pipeline = Pipeline.load(folder / "pipeline.yaml", data_root=folder / "data")
    return run_pipeline(pipeline, RunOptions(jobs=1))


def test_192_files_are_imported_by_ten_lines(lab: Path) -> None:
    assert len(TEN_LINES.splitlines()) == 10
    result = run_lab(lab)
    record = Record.read(result.folder.path / "artifacts" / "acquire.h5")
    run, robot = record.run, Robot.load("six_axis")
    position, torque = run.values("motor_position"), run.values("motor_torque")
    assert position.shape == torque.shape == (16, 2, 6, 2, 10, 6)
    for c, b, e in itertools.product(range(16), range(2), range(6)):
        with np.load(lab / "data" / "lab" / f"c{c + 1}_b{b + 1}_e{e + 1}.npz") as file:
            expected = file["q"][:20].reshape(2, 10, 6)
            np.testing.assert_array_equal(position[c, b, e], expected * (np.pi / 180))
            np.testing.assert_array_equal(torque[c, b, e], 0.5 * file["i"][:20].reshape(2, 10, 6))
    mean = position.mean(axis=(1, 2, 3, 4))
    np.testing.assert_allclose(record.angle, robot.joint_angle(mean), rtol=1e-13)
    np.testing.assert_allclose(record.frequency_hz, [100.0, 300.0])
    assert run.valid.all()
    assert run.test is None
    assert record.variants == ()
    log = (result.folder.path / "log.txt").read_text()
    assert "A11: left out after the last whole period: 5 samples of c10_b1_e1.npz, " in log
    assert "5 samples of c10_b1_e6.npz, ... (192)" in log
    assert "poses" not in log


def test_the_ten_lines_of_the_documentation_are_ten_and_are_understood(lab: Path) -> None:
    page = (Path(__file__).parents[3] / "docs" / "your_own_data.md").read_text(encoding="utf-8")
    (block,) = [part for part in page.split("```") if part.startswith("yaml") and "pattern:" in part]
    text = block.removeprefix("yaml\n")
    assert len(text.splitlines()) == 10
    ours = {"lab_robot.yaml": "six_axis", "column: current": "column: i", "0.0005": "0.0002"}
    for theirs, our in {**ours, "period_s: 4.0": "period_s: 0.004", "[17, 19, 23, 27, 29]": "[1, 3]"}.items():
        assert theirs in text
        text = text.replace(theirs, our)
    (lab / "pipeline.yaml").write_text(text)
    stage = Pipeline.load(lab / "pipeline.yaml", data_root=lab / "data").stage("acquire").stage
    assert isinstance(stage, RecordedAcquisition)
    assert len(stage.recordings(lab / "data")) == 192
    assert stage.channels["motor_torque"].symbol == "N m"


def test_a_changed_or_a_further_file_is_a_changed_input(lab: Path) -> None:
    assert run_lab(lab).outcomes == {"acquire": "made"}
    assert run_lab(lab).outcomes == {"acquire": "kept"}
    changed = lab / "data" / "lab" / "c7_b2_e3.npz"
    np.savez(changed, q=np.full((25, 6), 700.0), i=np.zeros((25, 6)))
    result = run_lab(lab)
    assert result.outcomes == {"acquire": "made"}
    assert "begins: file lab/c7_b2_e3.npz changed" in (result.folder.path / "log.txt").read_text()
    for c in (1, 2, 3):
        (lab / "data" / "lab" / f"c{c}_b1_e1.npz").write_bytes(changed.read_bytes())
    (lab / "data" / "lab" / "c17_b1_e1.npz").write_bytes(changed.read_bytes())
    result = run_lab(lab)
    assert result.outcomes == {"acquire": "made"}
    log = (result.folder.path / "log.txt").read_text()
    assert (
        "begins: file lab/c1_b1_e1.npz changed; file lab/c2_b1_e1.npz changed; file lab/c3_b1_e1.npz changed; "
        in log
    )
    assert "; file lab/c17_b1_e1.npz appeared\n" in log
    assert "configuration 17, block 1 lacks experiment 2, 3, 4, 5, 6" in log
    for c in range(1, 17):
        (lab / "data" / "lab" / f"c{c}_b2_e2.npz").write_bytes(changed.read_bytes())
    log = (run_lab(lab).folder.path / "log.txt").read_text()
    assert "file lab/c12_b2_e2.npz changed; 13 more files appeared, changed or went away\n" in log


FRF = """\
robid: 1
name: plant
seed: 1
robot: robot.yaml
stages:
  acquire:
    use: acquisition.recorded
    with:
      index: plant.csv
      sample_time_s: {step}
      period_s: {period}
      lines: {lines}
      torque_hold: continuous
      channels: {{motor_position: {{column: q, unit: rad}}, motor_torque: {{column: tau, unit: N m}}}}
  frf: {{use: frf.h1}}
"""


def test_the_response_of_imported_files_is_that_of_the_record_that_they_were_written_from(
    tmp_path: Path,
) -> None:
    """Both of a pose's last blocks are held out: the response is that of the first two, to the last bit."""
    plant = MassSpringPlant.of(2)
    original = plant_record(plant, n_block=4, noise=0.1)
    run = original.run
    rows = ["file,configuration,block,experiment,role"]
    for c, b, e in itertools.product(range(2), range(4), range(2)):
        q, tau = (run.values(name)[c, b, e].reshape(-1, 2) for name in ("motor_position", "motor_torque"))
        np.savez(tmp_path / f"{c}{b}{e}.npz", q=q, tau=tau)
        rows.append(f"{c}{b}{e}.npz,{c},{b},{e},{'test' if b >= 2 else 'train'}")
    (tmp_path / "plant.csv").write_text("\n".join(rows))
    (tmp_path / "robot.yaml").write_text(example_robot(2).to_yaml())
    text = FRF.format(
        step=run.sample_time_s,
        period=run.sample_time_s * len(run.time_s),
        lines=np.asarray(original.line).tolist(),
    )
    (tmp_path / "pipeline.yaml").write_text(text)
    pipeline = Pipeline.load(tmp_path / "pipeline.yaml", data_root=tmp_path)
    folder = run_pipeline(pipeline, RunOptions(jobs=1)).folder.path
    found = Frf.read(folder / "artifacts" / "frf.h5")
    kept = np.zeros((2, 4, 2), dtype=bool)
    kept[:, :2] = True
    expected = H1().run(original.part(kept), example_context())
    np.testing.assert_array_equal(found.response, expected.response)
    assert found.output_covariance is not None
    assert expected.output_covariance is not None
    np.testing.assert_array_equal(found.output_covariance, expected.output_covariance)
    everything = H1().run(original, example_context())
    assert np.abs(found.response - everything.response).max() > 1e-3 * np.abs(everything.response).max()
    assert "8 of 16 experiments are held out for tests and left out" in (folder / "log.txt").read_text()


# Patterns


def test_numbers_are_numbers_wherever_they_begin_and_however_they_are_written(
    tmp_path: Path, read: Read
) -> None:
    for c, e in itertools.product((9, 10, 11), (0, 1)):
        save(tmp_path, f"c{c}_e{e:03d}.npz", number(c, 0, e))
    record = read(pattern="c{config}_e{exp}.npz", incomplete="refuse")
    assert firsts(record) == [[[number(c, 0, 0), number(c, 0, 1)]] for c in (9, 10, 11)]
    assert read.told[-1] == (6, 6)  # type: ignore[attr-defined]
    assert read.told[0] == (0, 6)  # type: ignore[attr-defined]


def test_fields_may_stand_in_folders_and_twice_and_a_star_for_what_does_not_matter(
    tmp_path: Path, read: Read
) -> None:
    for c, b in itertools.product((1, 2), (1, 2)):
        save(tmp_path, f"robot [3]/pose{c}/c{c}b{b}-2024050{b}.npz", number(c, b, 0))
    save(tmp_path, "robot [3]/pose1/c2b1-20240509.npz", -1.0)  # says two things
    save(tmp_path, "robot [3]/pose1/deeper/c1b1-20240501.npz", -1.0)
    record = read(pattern="robot [3]/pose{config}/c{config}b{block}-*.npz")
    assert firsts(record) == [[[number(c, 1, 0)], [number(c, 2, 0)]] for c in (1, 2)]


def test_variants_are_configurations_of_their_own_and_roles_mark_experiments(
    tmp_path: Path, read: Read
) -> None:
    for variant, c, (b, role) in itertools.product(
        ("heavy_tool", "none"), (1, 2), ((1, "train"), (2, "test"))
    ):
        save(tmp_path, f"{variant}_{role}_c{c}_b{b}.npz", number(c, b, len(variant)))
    pattern = "{variant}_{role}_c{config}_b{block}.npz"
    record = read(pattern=pattern)
    assert record.variants == ("heavy_tool", "heavy_tool", "none", "none")
    assert firsts(record) == [
        [[number(c, 1, n)], [number(c, 2, n)]] for n, c in ((10, 1), (10, 2), (4, 1), (4, 2))
    ]
    np.testing.assert_array_equal(record.run.test, np.tile([[False], [True]], (4, 1, 1)))
    assert firsts(record.training()) == [[[number(c, 1, n)]] for n, c in ((10, 1), (10, 2), (4, 1), (4, 2))]
    light = read(pattern=pattern, variant="none")
    assert light.variants == ("none", "none")
    assert firsts(light) == firsts(record)[2:]
    with pytest.raises(ConfigurationError, match="no variant 'light'; there are heavy_tool, none"):
        read(pattern=pattern, variant="light")


def test_variants_of_unequal_numbers_of_experiments_are_told_apart(
    tmp_path: Path, read: Read, caplog: pytest.LogCaptureFixture
) -> None:
    """Nothing is missing: three bare runs and two with a load."""
    for k in range(1, 6):
        save(tmp_path, f"r{k}.npz", float(k))
    rows = "".join(f"r{k}.npz,{'bare' if k < 4 else 'loaded'}\n" for k in range(1, 6))
    (tmp_path / "runs.csv").write_text(f"file,variant\n{rows}")
    read(index="runs.csv")
    assert "variant loaded, configuration 1, block 1 lacks experiment 3" in caplog.text
    assert "variants have unequal numbers of experiments: make each a configuration of its own" in caplog.text
    numbered = "".join(f"r{k}.npz,{'bare' if k < 4 else 'loaded'},{k}\n" for k in range(1, 6))
    (tmp_path / "runs.csv").write_text(f"file,variant,configuration\n{numbered}")
    caplog.clear()
    assert len(read(index="runs.csv").angle) == 5
    assert "left out" not in caplog.text


def test_where_no_variant_is_told_the_setting_names_it(tmp_path: Path, read: Read) -> None:
    save(tmp_path, "c1.npz", 1.0)
    save(tmp_path, "c2.npz", 2.0)
    assert read(pattern="c{config}.npz", variant="8 kg").variants == ("8 kg", "8 kg")
    assert read(path="c1.npz", variant="8 kg").variants == ("8 kg",)
    assert read(path="c1.npz").variants == ()


def test_one_role_for_all_experiments(tmp_path: Path, read: Read) -> None:
    """Whatever names of files say."""
    save(tmp_path, "c1_train.npz", 1.0)
    save(tmp_path, "c2_test.npz", 2.0)
    test = read(pattern="c{config}_{role}.npz", role="test").run.test
    assert test is not None
    assert test.all()
    assert read(pattern="c{config}_{role}.npz", role="train").run.test is None
    with pytest.raises(ValidationError, match="'train' or 'test'"):
        read(path="c1_test.npz", role="judge")


@pytest.mark.parametrize(
    ("pattern", "told"),
    [
        ("c{conf}.npz", "'{conf}' is no field; there are {config}, {block}, {exp}, {variant}, {role}"),
        ("c1.npz", "give `path` for one file"),
        ("c*.npz", "a pattern names files by fields"),
        ("c{config.npz", "names files by fields"),
        ("../c{config}.npz", "leaves its root by '..'"),
        ("/c{config}.npz", "is absolute"),
    ],
)
def test_a_wrong_pattern_is_told_before_anything_is_read(read: Read, pattern: str, told: str) -> None:
    with pytest.raises(ValidationError) as caught:
        read(pattern=pattern)
    assert told in str(caught.value)


@pytest.mark.parametrize(
    ("settings", "told"),
    [
        ({"path": "a.npz", "pattern": "c{config}.npz"}, "give one of path"),
        ({}, "give one of path"),
        ({"pattern": "c{config}.npz", "channels": {}}, "channels are missing"),
        ({"pattern": "c{config}.npz", "starts_s": [0.0], "duration_s": 1.0}, "needs path and duration_s"),
        ({"path": "a.npz", "starts_s": [0.0]}, "needs path and duration_s"),
        ({"path": "a.npz", "duration_s": 1.0}, "starts_s is missing"),
        ({"path": "a.npz", "starts_s": [0.0], "duration_s": 1.0, "stop_s": 3.0}, "leave out start_s and stop_s"),
        ({"path": "a.npz", "starts_s": [0.0, 1.0], "duration_s": 1.0, "layout": [1, 1, 3]}, "1 x 1 x 3 are 3 exp"),
        ({"index": "i.csv", "channels": {"motor_position": {**CHANNELS["motor_position"], "file": "b.npz"}}},
         "comes from a file of its own"),
    ],
)  # fmt: skip
def test_settings_that_contradict_each_other_are_refused(
    read: Read, settings: dict[str, Any], told: str
) -> None:
    with pytest.raises(ValidationError) as caught:
        read(**settings)
    assert told in str(caught.value)


def test_files_that_are_not_there_are_told_when_the_pipeline_is_read(lab: Path) -> None:
    (lab / "pipeline.yaml").write_text(TEN_LINES.replace("lab/c{config}", "lab/pose{config}"))
    with pytest.raises(FileProblems) as caught:
        run_lab(lab)
    (line,) = str(caught.value).splitlines()
    assert "pipeline.yaml:8:5: stages.acquire.with: no file in" in line
    assert "fits 'lab/pose{config}_b{block}_e{exp}.npz'; lab holds c10_b1_e1.npz, c10_b1_e2.npz" in line
    assert "set ROBID_DATA or pass --data" in line


# What is missing, twice there, or unlike the others


def some(folder: Path, *left_out: tuple[int, int, int], shape: tuple[int, int, int] = (3, 2, 2)) -> None:
    for c, b, e in itertools.product(*(range(1, n + 1) for n in shape)):
        if (c, b, e) not in left_out:
            save(folder, f"c{c}_b{b}_e{e}.npz", number(c, b, e))


PATTERN = "c{config}_b{block}_e{exp}.npz"


def test_an_incomplete_block_is_left_out_with_a_warning_or_refused(
    tmp_path: Path, read: Read, caplog: pytest.LogCaptureFixture
) -> None:
    some(tmp_path, (2, 1, 2), shape=(3, 3, 2))
    record = read(pattern=PATTERN)
    # Two blocks of each configuration leave 12 experiments, three of the two whole configurations as many: more poses.
    assert firsts(record) == [
        [[number(c, b, e) for e in (1, 2)] for b in blocks]
        for c, blocks in ((1, (1, 2)), (2, (2, 3)), (3, (1, 2)))
    ]
    assert "incomplete blocks are left out: configuration 2, block 1 lacks experiment 2" in caplog.text
    assert "2 blocks of each configuration are kept, further ones left out of 1, 3" in caplog.text
    with pytest.raises(
        DataRejected, match=r"configuration 2, block 1 lacks experiment 2.*set incomplete: drop"
    ):
        read(pattern=PATTERN, incomplete="refuse")


def test_a_configuration_goes_where_that_leaves_most_experiments(
    tmp_path: Path, read: Read, caplog: pytest.LogCaptureFixture
) -> None:
    some(tmp_path, (4, 1, 1), (7, 1, 1), (7, 1, 2), (7, 2, 1), (7, 2, 2), shape=(8, 2, 2))
    record = read(pattern=PATTERN)
    assert [blocks[0][0] for blocks in firsts(record)] == [number(c, 1, 1) for c in (1, 2, 3, 5, 6, 8)]
    assert "configurations are numbered 1 to 8 without 7" in caplog.text
    assert "configurations with less than 2 whole blocks are left out: 4" in caplog.text


def test_one_experiment_too_many_costs_no_other_block(
    tmp_path: Path, read: Read, caplog: pytest.LogCaptureFixture
) -> None:
    some(tmp_path)
    save(tmp_path, "c2_b2_e3.npz", -1.0)
    assert np.array(firsts(read(pattern=PATTERN))).min() > 0
    assert "blocks have 2 experiments, left out beyond these: c2_b2_e3.npz" in caplog.text


def test_two_files_that_claim_to_be_the_same_experiment_are_both_named(tmp_path: Path, read: Read) -> None:
    some(tmp_path)
    save(tmp_path, "c02_b1_e1.npz", -1.0)
    with pytest.raises(
        DataRejected,
        match=r"c02_b1_e1\.npz and c2_b1_e1\.npz are both configuration 2, block 1, experiment 1; rename",
    ):
        read(pattern=PATTERN)


def test_a_little_shorter_file_cuts_all_and_a_much_shorter_one_is_refused(
    tmp_path: Path, read: Read, caplog: pytest.LogCaptureFixture
) -> None:
    some(tmp_path)
    save(tmp_path, "c2_b2_e1.npz", number(2, 2, 1), n=19)
    save(tmp_path, "c3_b1_e1.npz", number(3, 1, 1), n=21)
    record = read(pattern=PATTERN)
    assert record.run.values("motor_position").shape == (3, 2, 2, 1, 19, 1)
    assert record.run.time_s.shape == (19,)
    expected = number(3, 1, 1) + 1e-3 * np.arange(19)
    np.testing.assert_array_equal(record.run.values("motor_position")[2, 0, 0, 0, :, 0], expected)
    assert "c3_b1_e1.npz has 21 samples and c2_b2_e1.npz 19; all are cut to the shortest" in caplog.text
    save(tmp_path, "c2_b2_e1.npz", number(2, 2, 1), n=17)
    with pytest.raises(
        DataRejected, match=r"A11: c1_b1_e1\.npz and c2_b2_e1\.npz hold 1 x 20 and 1 x 17 samples"
    ):
        read(pattern=PATTERN)


def test_a_file_of_another_rate_is_refused_and_named(tmp_path: Path, read: Read) -> None:
    for c, step in ((1, 0.1), (2, 0.1001), (3, 0.1)):
        np.savez(tmp_path / f"c{c}.npz", q=np.zeros(20), t=np.arange(20) * step)
    timed = {"pattern": "c{config}.npz", "time_column": "t", "sample_time_s": None}
    assert read(**timed).run.sample_time_s == pytest.approx(0.1)  # the middle of three clocks
    np.savez(tmp_path / "c2.npz", q=np.zeros(20), t=np.arange(20) * 0.2)
    with pytest.raises(DataRejected, match=r"c1\.npz and c2\.npz are sampled every 0\.1 s and 0\.2 s"):
        read(**timed)


def test_a_period_of_another_number_of_samples_is_never_cut(tmp_path: Path, read: Read) -> None:
    for c, step in ((1, 0.1), (2, 0.1 * 1000 / 1001)):
        np.savez(tmp_path / f"c{c}.npz", q=np.zeros(2002), t=np.arange(2002) * step)
    with pytest.raises(DataRejected, match=r"A09: a period has 1000 and 1001 samples in c1\.npz and c2\.npz"):
        read(pattern="c{config}.npz", time_column="t", sample_time_s=None, period_s=100.0)


def test_periods_beyond_the_common_number_are_left_out(
    tmp_path: Path, read: Read, caplog: pytest.LogCaptureFixture
) -> None:
    for c, n in ((1, 200), (2, 190)):
        save(tmp_path, f"c{c}.npz", c, n=n)
    record = read(pattern="c{config}.npz", period_s=1.0, lines=[1], torque_hold="continuous")
    assert record.run.n_period == 19
    assert "c1.npz has 200 samples and c2.npz 190" in caplog.text


def test_what_is_wrong_with_one_file_of_many_names_it(tmp_path: Path, read: Read) -> None:
    some(tmp_path)
    q = np.zeros(20)
    q[7] = np.nan
    np.savez(tmp_path / "c2_b1_e2.npz", q=q)
    with pytest.raises(DataRejected, match=r"^A05: c2_b1_e2\.npz: channel motor_position .* at sample 7;"):
        read(pattern=PATTERN)
    np.savez(tmp_path / "c2_b1_e2.npz", Q=q)
    with pytest.raises(DataRejected, match=r"^c2_b1_e2\.npz: the file has no column 'q'"):
        read(pattern=PATTERN)


def test_experiments_of_one_configuration_in_different_poses_are_told(
    tmp_path: Path, read: Read, caplog: pytest.LogCaptureFixture
) -> None:
    # A gear of 10: motor angles 0.2 rad apart are 0.02 rad of the joint, 0.01 from their mean.
    for e, q in ((1, 0.0), (2, 0.19)):
        save(tmp_path, f"c1_e{e}.npz", q)
    read(pattern="c{config}_e{exp}.npz")
    assert "poses" not in caplog.text
    save(tmp_path, "c1_e2.npz", 0.21)
    record = read(pattern="c{config}_e{exp}.npz")
    assert (
        "1 of 1 configurations hold poses that differ by more than 0.01 from their mean (number 1)"
        in caplog.text
    )
    assert "with 0.0105 at axis_1" in caplog.text
    np.testing.assert_allclose(record.angle, [[(0.105 + 1e-3 * 9.5) / 10]])
    caplog.clear()
    read(pattern="c{config}_e{exp}.npz", angle_tolerance=0.02)
    assert "poses" not in caplog.text


def test_the_hash_of_many_files_is_that_of_what_sha256sum_prints(tmp_path: Path, read: Read) -> None:
    some(tmp_path)
    lines = [
        f"{hashlib.sha256(f.read_bytes()).hexdigest()}  {f.name}\n" for f in sorted(tmp_path.glob("c*.npz"))
    ]
    together = hashlib.sha256("".join(lines).encode()).hexdigest()
    read(pattern=PATTERN, sha256=together)
    save(tmp_path, "c3_b2_e2.npz", -1.0)
    with pytest.raises(
        DataRejected, match=r"A13: c\{config\}.* is other files than the one this pipeline was"
    ):
        read(pattern=PATTERN, sha256=together)


# Parts of one file


def test_a_long_file_is_cut_where_experiments_begin(tmp_path: Path, read: Read) -> None:
    q = 1e-4 * np.arange(1000)
    np.savez(tmp_path / "long.npz", q=q)
    starts = [1.0, 11.0, 30.0, 41.04, 60.0, 75.0, 80.0, 90.0]
    record = read(path="long.npz", starts_s=starts, duration_s=5.0, layout=[2, 2, 2])
    values = record.run.values("motor_position")[:, :, :, 0, :, 0]
    assert values.shape == (2, 2, 2, 50)
    for one, start in zip(values.reshape(8, 50), starts, strict=True):
        np.testing.assert_array_equal(one, q[round(start / 0.1) : round(start / 0.1) + 50])
    one_block = read(
        path="long.npz", starts_s=starts, duration_s=5.0, period_s=2.0, lines=[1], torque_hold="continuous"
    )
    assert one_block.run.values("motor_position").shape == (1, 1, 8, 2, 20, 1)
    np.testing.assert_array_equal(one_block.run.values("motor_position")[0, 0, 1, 1, :, 0], q[130:150])


def test_an_experiment_that_the_file_does_not_hold_is_told(tmp_path: Path, read: Read) -> None:
    np.savez(tmp_path / "long.npz", q=np.arange(1000.0))
    with pytest.raises(DataRejected, match=r"long\.npz from 97 s hold 1 x 50 and 1 x 30 samples"):
        read(path="long.npz", starts_s=[0.0, 97.0], duration_s=5.0)
    with pytest.raises(
        DataRejected, match=r"long\.npz from 200 s: nothing lies between 200 s and 205 s; it lasts 100 s"
    ):
        read(path="long.npz", starts_s=[0.0, 200.0], duration_s=5.0)


# Tables

TABLE = """\
file;configuration;block;experiment;start_s;stop_s;role;variant;payload_kg;#operator
long.npz;3;1;1;0;5;train;light;0;Ada
long.npz;3;1;2;5;10;train;light;0;Ada
long.npz;3;2;1;10;15;test;light;0;Ada
long.npz;3;2;2;15;20;test;light;;Ada
other.npz;3;1;1;;5;;heavy;8.5;
other.npz;3;1;2;5;;;heavy;8.5;Grace
long.npz;3;2;1;20;25;test;heavy;8.5;Ada
long.npz;3;2;2;25;30;test;heavy;8.5;Ada
"""


@pytest.fixture(name="table")
def table_and_files(tmp_path: Path) -> Path:
    folder = tmp_path / "lab"
    folder.mkdir()
    np.savez(folder / "long.npz", q=1e-3 * np.arange(400))
    np.savez(folder / "other.npz", q=100 + 1e-3 * np.arange(100))
    (folder / "index.csv").write_text(TABLE, encoding="utf-8-sig")
    return folder / "index.csv"


def test_a_table_gives_places_times_roles_variants_and_constants(table: Path, read: Read) -> None:
    record = read(index="lab/index.csv")
    assert record.variants == ("heavy", "light")
    assert record.run.values("motor_position").shape == (2, 2, 2, 1, 50, 1)
    assert firsts(record) == pytest.approx(
        np.array([[[100.0, 100.05], [0.2, 0.25]], [[0.0, 0.05], [0.1, 0.15]]])
    )
    np.testing.assert_array_equal(record.run.test, [[[False] * 2, [True] * 2]] * 2)
    assert record.run.constant_names == ("payload_kg",)
    np.testing.assert_array_equal(
        record.run.constant("payload_kg"), [[[8.5, 8.5], [8.5, 8.5]], [[0.0, 0.0], [0.0, np.nan]]]
    )


def test_lines_without_a_place_are_experiments_of_one_block(table: Path, read: Read) -> None:
    table.write_text(
        "file;start_s;stop_s;role\nlong.npz;0;5;train\nlong.npz;10;15;train\nlong.npz;20;25;test\n"
    )
    record = read(index="lab/index.csv")
    assert record.run.values("motor_position").shape == (1, 1, 3, 1, 50, 1)
    np.testing.assert_allclose(firsts(record), [[[0.0, 0.1, 0.2]]])
    np.testing.assert_array_equal(record.run.test, [[[False, False, True]]])


def test_a_file_is_read_once_however_many_experiments_it_holds(
    table: Path, read: Read, monkeypatch: pytest.MonkeyPatch
) -> None:
    from robid_core.foreign import reader

    opened: list[str] = []
    real = reader.read_apart
    monkeypatch.setattr(
        reader, "read_apart", lambda path, *rest, **how: opened.append(path.name) or real(path, *rest, **how)
    )
    read(index="lab/index.csv")
    assert opened == ["long.npz", "other.npz"]


def test_the_files_of_a_table_are_part_of_the_key(table: Path, tmp_path: Path) -> None:
    stage = RecordedAcquisition(index="lab/index.csv", sample_time_s=0.1, channels=CHANNELS)
    assert stage.external_files(tmp_path) == [table, table.parent / "long.npz", table.parent / "other.npz"]
    assert ("robid.records", "npz") in stage.uses()


def test_a_table_needs_the_extra_of_those_files_only_that_it_lists(
    table: Path, read: Read, monkeypatch: pytest.MonkeyPatch
) -> None:
    stage = RecordedAcquisition(index="lab/index.csv", sample_time_s=0.1, channels=CHANNELS)
    for name in [name for name in sys.modules if name.partition(".")[0] in ("pyarrow", "robid_parquet")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    assert ("robid.records", "parquet") not in stage.uses()
    assert len(read(index="lab/index.csv").angle) == 2
    text = table.read_text(encoding="utf-8-sig")
    table.write_text(text.replace("other.npz", "other.parquet"), encoding="utf-8-sig")
    (table.parent / "other.parquet").write_bytes(b"")
    with pytest.raises(ExtraMissing, match=r"run: pip install \"robid\[formats\]\""):
        read(index="lab/index.csv")


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("file;conf", "File;conf", r"index\.csv:1: there is no column 'File'; did you mean 'file'\?"),
        (";configuration;", ";config;", r":1: there is no column 'config'; did you mean 'configuration'\?"),
        ("#operator", "variant", r":1: two columns are called 'variant'"),
        ("3;1;1;0;5", "3;1;one;0;5", r":2: experiment 'one' is no whole number"),
        ("3;1;1;0;5", "-3;1;1;0;5", r":2: configuration '-3' is no whole number"),
        ("3;1;1;0;5", "3;1;1;nan;5", r":2: start_s 'nan' is no time in seconds"),
        ("train;light;0;Ada\nlong.npz;3;1;2", "training;light;0;Ada\nlong.npz;3;1;2", r":2: role 'training' is none"),
        ("heavy;8.5;Grace", "heavy;8,5;Grace", r":7: payload_kg '8,5' is no number; constants are numbers"),
        ("#operator", "operator", r":2: operator 'Ada' is no number; constants are numbers, '#operator' is left out"),
        ("heavy;8.5;Grace", ";8.5;Grace", r":7: there is no variant in this line"),
        ("heavy;8.5;Grace", "heavy;8.5", r":7: 9 cells where the first line has 10"),
        ("other.npz;3;1;2", ";3;1;2", r":7: there is no file in this line"),
        ("other.npz;3;1;2", "../../x.npz;3;1;2", r":7: .*leaves its root by '\.\.'"),
        ("long.npz;3;2;1;10", "long.npz;3;1;1;10", r"s are both variant light, configuration 3, block 1, exp.* 1;"),
    ],
)  # fmt: skip
def test_a_wrong_table_is_told_by_its_line(table: Path, read: Read, old: str, new: str, told: str) -> None:
    assert TABLE.count(old) == 1
    table.write_text(TABLE.replace(old, new))
    with pytest.raises(DataRejected, match=told):
        read(index="lab/index.csv")


def test_files_that_a_table_lists_and_that_are_not_there_are_named(table: Path, read: Read) -> None:
    (table.parent / "other.npz").unlink()
    with pytest.raises(
        ConfigurationError, match=r"lists 1 file that is not in .*: lab/other\.npz; files are named"
    ):
        read(index="lab/index.csv")


def test_a_file_without_its_suffix_and_a_folder_in_place_of_one_are_told(table: Path, read: Read) -> None:
    table.write_text(TABLE.replace("other.npz", "other"))
    with pytest.raises(
        ConfigurationError, match=r"lab/other; other\.npz is there: write names with their suffix"
    ):
        read(index="lab/index.csv")
    (table.parent / "other").mkdir()
    with pytest.raises(ConfigurationError, match=r"lab/other; lab/other is a folder"):
        read(index="lab/index.csv")


def test_a_table_without_lines_or_text_is_refused(table: Path, read: Read) -> None:
    for content, told in (
        (b"", "is empty"),
        (TABLE[:84].encode(), "no line"),
        (b"file\n\xff\n", "not UTF-8"),
    ):
        table.write_bytes(content)
        with pytest.raises(DataRejected, match=told):
            read(index="lab/index.csv")
