"""What a run would stumble over is told by validation, at its place; the same settings made right are valid."""

from __future__ import annotations

from pathlib import Path

import pytest

from robid_core.commands import main
from robid_core.pipeline import Pipeline
from robid_core.yaml_file.problems import FileProblems

STAGES = {
    "where": "{use: design.candidates, with: {count: 2}}",
    "excite": "{use: excitation.multisine, with: {band_hz: [4, 80], lines: 20, period_s: 4}}",
    "acquire": "{use: acquisition.drives, with: {periods: 2}}",
    "frf": "{use: frf.log}",
}
SIMULATED = "{use: simulated, with: {plant: one_axis_true}}"
CLASSICAL = "{{use: excitation.{}, with: {{band_hz: [4, 80], {}}}}}"


def text_of(drives: str = SIMULATED, **stages: str) -> str:
    told = "".join(f"  {name}: {entry}\n" for name, entry in {**STAGES, **stages}.items())
    return f"robid: 1\nname: example\nseed: 1\nrobot: one_axis\ndrives: {drives}\nstages:\n{told}"


def problems(folder: Path, text: str) -> list[tuple[str, str]]:
    file = folder / "pipeline.yaml"
    file.write_text(text, encoding="utf-8")
    try:
        Pipeline.load(file)
    except FileProblems as error:
        return [(one.path, one.message) for one in error.problems]
    return []


def multisine(settings: str) -> str:
    return f"{{use: excitation.multisine, with: {{lines: 20, {settings}}}}}"


@pytest.mark.parametrize(
    ("excitation", "place", "message"),
    [
        (multisine("band_hz: [4, 500], period_s: 4"), "band_hz", "500 Hz is not below half the sampling rate"),
        (multisine("band_hz: [4, 80], period_s: 4.0005"), "period_s", "is not an even number of the robot's samples"),
        (multisine("band_hz: [4, 80], period_s: 1.0e+9"), "period_s", "take a shorter period"),
        (multisine("band_hz: [4, 4.001], period_s: 1.0e+9"), "period_s", "GB of this machine"),
        (multisine("band_hz: [4, 80], period_s: 4, axis_scale: [1, 2]"), "axis_scale", "2 factors for the 1 axes"),
        (multisine("band_hz: [4, 80], period_s: 4, exponents: [1, 2]"), "exponents", "2 factors for the 1 axes"),
        (
            multisine("band_hz: [4, 80], period_s: 4, weights: {axis_2: [[4, 1]]}"),
            "weights",
            "one_axis has no axis 'axis_2'",
        ),
        ("{use: excitation.chirp, with: {band_hz: [4, 600], period_s: 4}}", "band_hz", "half the sampling rate"),
        ("{use: excitation.chirp, with: {band_hz: [4, 80], period_s: 4.0003}}", "period_s", "not a whole number"),
        (CLASSICAL.format("filtered_noise", "duration_s: 1.0e+9"), "duration_s", "GB of this machine"),
        (
            "{use: excitation.binary_sequence, with: {band_hz: [4, 80], register_bits: 9, clock_hz: 300}}",
            "clock_hz",
            "does not hold a sign for whole samples",
        ),
    ],
)  # fmt: skip
def test_excitations_that_the_robot_cannot_have_are_told_at_the_setting(
    tmp_path: Path, excitation: str, place: str, message: str
) -> None:
    ((path, told),) = problems(tmp_path, text_of(excite=excitation))
    assert path == f"stages.excite.with.{place}"
    assert message in told


@pytest.mark.parametrize(
    ("drives", "place", "message"),
    [
        ("{use: simulated, with: {plant: six_axis_true}}", "plant", "has 6 motors, robot 'one_axis' has 1"),
        ("{use: can, with: {plant: six_axis_true}}", "plant", "has 6 motors, robot 'one_axis' has 1"),
        ("{use: can, with: {plant: one_axis_true, node_ids: [1, 2]}}", "node_ids", "has 2 entries, the robot has 1"),
        ("{use: can, with: {plant: one_axis_true, serial_numbers: [1, 2]}}", "serial_numbers", "has 2 entries"),
    ],
)  # fmt: skip
def test_drives_of_another_robot_are_told(tmp_path: Path, drives: str, place: str, message: str) -> None:
    ((path, told),) = problems(tmp_path, text_of(drives))
    assert path == f"drives.with.{place}"
    assert message in told


def test_a_response_needs_an_excitation_with_lines(tmp_path: Path) -> None:
    noise = CLASSICAL.replace("{}, with", "filtered_noise, with").replace(
        "{}}}}}", "duration_s: 20, periodic: {}}}}}"
    )
    ((path, told),) = problems(tmp_path, text_of(excite=noise.format("false")))
    assert path == "stages.frf.use"
    assert "stage 'excite' has none" in told
    assert not problems(tmp_path, text_of(excite=noise.format("true")))
    spectral = "{use: frf.spectral, with: {segment_s: 2, band_hz: [4, 80]}}"
    assert not problems(tmp_path, text_of(excite=noise.format("false"), frf=spectral))


def test_a_record_on_its_way_through_a_stage_is_followed(tmp_path: Path) -> None:
    sweeps = "{use: excitation.constant_velocity, with: {speeds_rad_s: [5, 10]}}"
    cleaned = "{use: compensate.friction, inputs: {record: acquire}}"
    found = problems(
        tmp_path, text_of(excite=sweeps, clean=cleaned, frf="{use: frf.h1, inputs: {record: clean}}")
    )
    assert ("stages.frf.use", True) in [(path, "lines of a periodic record" in told) for path, told in found]


def test_a_floor_above_all_configurations_is_told(tmp_path: Path) -> None:
    """The pendulum's centre of mass reaches 0.502 m above its axis."""
    where = "{{use: design.candidates, with: {{count: 2, room: {{floor_m: {}}}}}}}"
    ((path, told),) = problems(tmp_path, text_of(where=where.format(0.6)))
    assert path == "stages.where.with.room"
    assert "ask for less room" in told
    assert not problems(tmp_path, text_of(where=where.format(0.4)))


def test_an_effect_is_no_stage(tmp_path: Path) -> None:
    ((path, told),) = problems(tmp_path, text_of(grease="{use: friction.lugre}"))
    assert path == "stages.grease.use"
    assert "is an effect, and no stage: it goes into a robot file" in told
    assert "effects: {lugre: {use: friction.lugre" in told


def test_lack_of_memory_is_a_message(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def exhausted(*arguments: object, **settings: object) -> None:
        raise MemoryError("Unable to allocate 283. GiB")

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(Pipeline, "load", exhausted)
    monkeypatch.setattr("sys.argv", ["robid", "validate"])
    with pytest.raises(SystemExit) as end:
        main()
    assert end.value.code == 2
    assert "not enough memory: Unable to allocate 283. GiB; ask for less" in capsys.readouterr().err
