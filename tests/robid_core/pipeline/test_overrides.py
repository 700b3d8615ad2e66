"""Values from the command line are typed like the file, and their mistakes name the override."""

from collections.abc import Callable

import pytest

from robid_core.pipeline import Pipeline

Load = Callable[..., Pipeline]
Read = Callable[..., list[str]]

GOOD = """\
robid: 1
name: example
seed: 7
robot: one_axis
stages:
  where: {use: design.candidates, with: &s {count: 4}}
  other: {use: design.candidates, with: *s}
  excite: {use: excitation.multisine, inputs: {configurations: where}, with: {band_hz: [4, 80]}}
"""


def test_overrides_replace_and_add_settings(load: Load) -> None:
    pipeline = load(
        GOOD,
        "seed=8",
        "stages.excite.with.lines=7",
        "stages.excite.with.band_hz=[5, 6.5]",
        "stages.excite.with.odd=false",
    )
    excite = pipeline.stage("excite").stage
    assert pipeline.seed == 8
    assert excite.model_dump() == {"band_hz": (5, 6.5), "lines": 7, "odd": False}


def test_an_override_of_a_list_item_keeps_the_others(load: Load) -> None:
    pipeline = load(GOOD, "stages.excite.with.band_hz.1=40")
    assert pipeline.stage("excite").stage.band_hz == (4, 40)  # type: ignore[attr-defined]


def test_an_override_changes_one_user_of_an_anchor_only(load: Load) -> None:
    pipeline = load(GOOD, "stages.where.with.count=9")
    assert pipeline.stage("where").stage.count == 9  # type: ignore[attr-defined]
    assert pipeline.stage("other").stage.count == 4  # type: ignore[attr-defined]


def test_an_override_can_wire(load: Load) -> None:
    assert load(GOOD, "stages.excite.inputs.configurations=other").stage("excite").inputs == {
        "configurations": "other"
    }


def test_the_last_override_wins(load: Load) -> None:
    assert load(GOOD, "seed=8", "seed=9").seed == 9


def test_the_robot_has_a_long_form(load: Load) -> None:
    assert load(GOOD, "robot.dynamics=kernel").robot.written == "one_axis"


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("stages.fti.with.starts=5", "stages.fti: no stage 'fti'; there are: where, other, excite"),
        ("stages.wher.with.count=5", "stages.wher: no stage 'wher'; did you mean 'where'?"),
        (
            "stages.where.with.count=5.0",
            "stages.where.with.count: 5.0 must be a whole number; write 5",
        ),
        (
            "stages.where.with.count=yes",
            "stages.where.with.count: 'yes' must be a whole number",
        ),
        ("stages.where.with.count=0", "stages.where.with.count: 0 must be greater than 0"),
        ("stages.where.with.cout=5", "stages.where.with.cout: unknown key 'cout'; did you mean 'count'?"),
        (
            "stages.excite.with.band_hz.2=5",
            "stages.excite.with.band_hz.2: the list stages.excite.with.band_hz has",
        ),
        (
            "stages.excite.with.band_hz.0=x",
            "stages.excite.with.band_hz[0]: 'x' must be a number",
        ),
        ("stages.where.with.count", "write it as path=value, for example stages.fit.with.starts=50"),
        ("=5", "write it as path=value, for example stages.fit.with.starts=50"),
        ("stages.where.with.count=", "stages.where.with.count: there is no value after '='"),
        ("stages.where.with.count=[1", "stages.where.with.count: not YAML: "),
        ("stages.where.with.count=!!int 3", "stages.where.with.count: the tag '!!int' is refused"),
        ("sed=5", "sed: unknown key 'sed'; did you mean 'seed'?"),
        (
            "stages.excite.inputs.configurations=excite",
            "stages.excite.inputs.configurations: stage 'excite' cannot",
        ),
    ],
)
def test_a_wrong_override_is_told_by_its_own_text(problems: Read, override: str, message: str) -> None:
    (line,) = problems(GOOD, override)
    assert line.startswith(f"--set {override}: {message}")


def test_overrides_come_after_the_lines_of_the_file(problems: Read) -> None:
    found = problems(GOOD.replace("seed: 7", "seed: x"), "stages.where.with.count=0", "name=/")
    assert [line.split(": ")[0] for line in found] == [
        "bad.yaml:3:1",
        "--set stages.where.with.count=0",
        "--set name=/",
    ]
