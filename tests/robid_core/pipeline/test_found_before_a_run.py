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
        ("{use: can, with: {plant: one_axis_true, node_ids: [1, 2]}}", "node_ids", "has 2 entries, the robot 1 motor"),
        ("{use: can, with: {plant: one_axis_true, serial_numbers: [1, 2]}}", "serial_numbers", "has 2 entries"),
    ],
)  # fmt: skip
def test_drives_of_another_robot_are_told(tmp_path: Path, drives: str, place: str, message: str) -> None:
    ((path, told),) = problems(tmp_path, text_of(drives))
    assert path == f"drives.with.{place}"
    assert message in told


# Changes of the sound text, and what is told: the setting, then words.
MISTAKES: dict[str, tuple[tuple[str, str], str, str]] = {
    "a slow sine beyond the motor": (
        ("period_s: 4", "period_s: 4, slow_sine_rad_s: 1.0e+300"),
        "slow_sine_rad_s",
        "above its speed",
    ),
    "a slow sine in turns a minute": (
        ("period_s: 4", "period_s: 4, slow_sine_rad_s: 900"),
        "slow_sine_rad_s",
        "above its speed limit",
    ),
    "a slow sine backwards": (
        ("period_s: 4", "period_s: 4, slow_sine_rad_s: -9"),
        "slow_sine_rad_s",
        "greater than or equal to 0",
    ),
    "a million periods": (("periods: 2", "periods: 1000000"), "periods", "less than or equal to 10000"),
    "a million periods to settle": (
        ("periods: 2", "settle_periods: 1000000"),
        "settle_periods",
        "less than or equal to 10000",
    ),
    "half a period": (("periods: 2", "periods: 2.5"), "periods", "2.5 must be a whole number"),
    "a period of no time": (("period_s: 4", "period_s: 0"), "period_s", "greater than 0"),
    "a period of days": (("period_s: 4", "period_s: 999999.5"), "period_s", "take a shorter period"),
    "a period between samples": (
        ("period_s: 4", "period_s: 2.0001"),
        "period_s",
        "not an even number of the robot's samples",
    ),
    "a period from the environment": (
        ("period_s: 4", "period_s: $PERIOD"),
        "period_s",
        "'$PERIOD' must be a number",
    ),
    "a band upside down": (("[4, 80]", "[80, 4]"), "band_hz", "80 Hz is not below 4 Hz"),
    "a band of one": (("[4, 80]", "80"), "band_hz", "80 must be a list"),
    "a band of three": (("[4, 80]", "[4, 40, 80]"), "band_hz", "at most 2 items"),
    "a band from zero": (("[4, 80]", "[0, 80]"), "band_hz", "greater than 0"),
    "a band without end": (("[4, 80]", "[4, 1.0e+300]"), "period_s", "take a shorter period"),
    "more lines than bins": (("lines: 20", "lines: 1000"), "excite", "ask for at most 152 lines"),
    "lines as a float": (("lines: 20", "lines: 1e3"), "lines", "write 1000"),
    "no configurations": (("count: 2", "count: 0"), "count", "greater than 0"),
    "configurations without end": (
        ("count: 2", "count: 1000000000"),
        "count",
        "less than or equal to 100000",
    ),
    "a share that nothing keeps": (
        ("count: 2", "count: 2, gravity_share: 1.0e-9"),
        "gravity_share",
        "raise gravity_share",
    ),
    "a setting of the wrong stage": (
        ("count: 2", "count: 2, periods: 2"),
        "where.with.periods",
        "unknown key 'periods'",
    ),
    "an input misspelt": (
        ("{use: frf.log}", "{use: frf.log, inputs: {recrod: acquire}}"),
        "frf.inputs.recrod",
        "did you mean 'record'?",
    ),
    "an input of no stage": (
        ("{use: frf.log}", "{use: frf.log, inputs: {record: aquire}}"),
        "frf.inputs.record",
        "did you mean 'acquire'?",
    ),
    "an input of another type": (
        ("{use: frf.log}", "{use: frf.log, inputs: {record: where}}"),
        "frf.inputs.record",
        "not a Record",
    ),
    "an input that is itself": (
        ("{use: frf.log}", "{use: frf.log, inputs: {record: frf}}"),
        "frf.inputs.record",
        "cannot feed itself",
    ),
    "a circle": (
        ("{use: design.candidates, with: {count: 2}}", "{use: design.optimal, inputs: {frf: frf}}"),
        "stages",
        "cycle",
    ),
    "a stage without a plugin": (("{use: frf.log}", "{}"), "frf.use", "the key 'use' is missing"),
    "a stage that is text": (("{use: frf.log}", "frf.log"), "stages.frf", "write `{use: frf.log}`"),
    "a stage that is a module": (("frf.log", "os.system"), "frf.use", "no stage 'os.system'"),
    "a robot from the environment": (("robot: one_axis", "robot: $ROBOT"), "robot", "no robot '$ROBOT'"),
    "a name that leads away": (("name: example", "name: ../other"), "name", "is no name"),
    "a seed of a thousand digits": (("seed: 1", f"seed: {'1' * 1000}"), "seed", "it has 1000 digits"),
    "a seed in words": (("seed: 1", "seed: now"), "seed", "'now' must be a whole number"),
    "drives misspelt": (("use: simulated", "use: simulatd"), "drives.use", "did you mean 'simulated'?"),
    "drives without a plant": (
        (SIMULATED, "{use: simulated}"),
        "drives.with.plant",
        "the key 'plant' is missing",
    ),
    "nodes twice": (
        (SIMULATED, "{use: can, with: {plant: one_axis_true, node_ids: [1, 1]}}"),
        "drives.with",
        "the same node id",
    ),
    "a node beyond all": (
        (SIMULATED, "{use: can, with: {plant: one_axis_true, node_ids: [200]}}"),
        "drives.with",
        "no node id",
    ),
    "fewer processes than none": (
        ("stages:", "executor: {use: process, with: {jobs: -1}}\nstages:"),
        "executor.with.jobs",
        "greater than or equal to 0",
    ),
    "processes without end": (
        ("stages:", "executor: {use: process, with: {jobs: 1000000000}}\nstages:"),
        "executor.with.jobs",
        "less than or equal to 1024",
    ),
    "dynamics of nobody": (
        ("robot: one_axis", "robot: {model: one_axis, dynamics: numpi}"),
        "robot.dynamics",
        "no dynamics 'numpi'",
    ),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_is_told_once_at_its_setting(name: str, tmp_path: Path) -> None:
    (old, new), place, words = MISTAKES[name]
    text = text_of()
    assert text.count(old) == 1
    ((path, told),) = problems(tmp_path, text.replace(old, new))
    assert place in path
    assert words in told


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


def test_a_record_that_no_machine_holds_is_told_with_what_makes_it_long(tmp_path: Path) -> None:
    """2000 x 50 x 1 experiments of 100 periods of 400 s at 1 ms: 4e12 samples of three channels of 8 bytes."""
    long = text_of(
        where="{use: design.candidates, with: {count: 2000}}",
        excite=multisine("band_hz: [4, 80], period_s: 400, blocks: 50"),
        acquire="{use: acquisition.drives, with: {periods: 100}}",
    )
    ((path, told),) = problems(tmp_path, long)
    assert path == "stages.acquire.use"
    assert "the record takes 9.6e+04 GB (2000 configurations x 50 blocks x 1 experiment x 10" in told
    assert not problems(
        tmp_path, long.replace("count: 2000", "count: 2").replace("periods: 100", "periods: 2")
    )


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


def test_a_fit_takes_several_records_only_where_they_are_named(tmp_path: Path) -> None:
    """One of two might be kept to judge by."""
    again = "{use: acquisition.drives, with: {periods: 3}}"

    def read(fit: str, **stages: str) -> Pipeline:
        (tmp_path / "pipeline.yaml").write_text(text_of(**stages, fit=f"{{use: {fit}}}"), encoding="utf-8")
        return Pipeline.load(tmp_path / "pipeline.yaml")

    frf = "{use: frf.log, inputs: {record: acquire}}"
    ((place, message),) = problems(tmp_path, text_of(again=again, frf=frf, fit="{use: fit.torque_residual}"))
    assert place == "stages.fit.inputs.record"
    assert message == (
        "ambiguous: acquire and again each make a Record; write `inputs: {record: acquire}` or "
        "`inputs: {record: again}`, or of several a list, `inputs: {record: [acquire, again]}`"
    )
    for plugin in ("fit.torque_residual", "fit.rigid"):
        for named, taken in (("again", ("again",)), ("[again, acquire]", ("again", "acquire"))):
            pipeline = read(f"{plugin}, inputs: {{record: {named}}}", again=again, frf=frf)
            assert pipeline.stage("fit").inputs == {"record": taken}
        assert read(plugin).stage("fit").inputs == {"record": ("acquire",)}


@pytest.mark.parametrize("resistance", ["-0.48", "[-0.48]"])
def test_a_number_out_of_bounds_is_that_where_a_list_would_do(tmp_path: Path, resistance: str) -> None:
    law = f"{{column: v, torque_constant: 0.1, resistance: {resistance}}}"
    channels = f"{{motor_torque: {{voltage: {law}}}}}"
    read = f"{{use: acquisition.recorded, with: {{path: a.csv, channels: {channels}}}}}"
    found = problems(tmp_path, text_of(acquire=read))
    assert [told for path, told in found if "resistance" in path] == ["-0.48 must be greater than 0"]


@pytest.mark.parametrize(("constant", "sign"), [("-0.48", "-1"), ("[-0.48]", "[-1]")])
def test_a_torque_constant_with_a_sign_is_told_where_the_sign_goes(
    tmp_path: Path, constant: str, sign: str
) -> None:
    channels = f"{{motor_torque: {{column: [i], unit: A, torque_constant: {constant}}}}}"
    read = f"{{use: acquisition.recorded, with: {{path: a.csv, channels: {channels}}}}}"
    (told,) = [told for path, told in problems(tmp_path, text_of(acquire=read)) if "torque_constant" in path]
    assert told == f"a torque constant has no sign; leave it positive and give sign: {sign}"


def test_an_optional_input_that_several_stages_could_feed_may_stay_away(tmp_path: Path) -> None:
    stages = {
        "explain": "{use: diagnosis.effects}",
        "encoders": "{use: diagnosis.deflection}",
        "check": "{use: diagnosis.prediction}",
    }
    ((place, message),) = problems(tmp_path, text_of(**stages))
    assert place == "stages.check.inputs.explained"
    assert message.endswith("`inputs: {explained: encoders}`, or `inputs: {explained: []}` for none")
    stages["check"] = "{use: diagnosis.prediction, inputs: {explained: []}}"
    (tmp_path / "pipeline.yaml").write_text(text_of(**stages), encoding="utf-8")
    pipeline = Pipeline.load(tmp_path / "pipeline.yaml")
    assert pipeline.stage("check").inputs == {"record": ("acquire",)}
    one_too_many = "{use: diagnosis.prediction, inputs: {explained: [explain]}}"
    ((place, message),) = problems(tmp_path, text_of(**stages | {"check": one_too_many}))
    assert (place, "write the name of one stage, no list" in message) == (
        "stages.check.inputs.explained",
        True,
    )
    ((place, message),) = problems(tmp_path, text_of(frf="{use: frf.log, inputs: {record: []}}"))
    assert (place, "write the name of one stage, no list" in message) == ("stages.frf.inputs.record", True)
