"""Each kind of mistake in a pipeline file: where it is told, in which words, and that nothing echoes it."""

from collections.abc import Callable
from pathlib import Path

import pytest

from robid_core import ConfigurationError, Robot
from robid_core.pipeline import Pipeline

Read = Callable[..., list[str]]

GOOD = """\
robid: 1
name: example
seed: 7
robot: one_axis
drives: {use: can, with: {plant: one_axis_true}}
stages:
  where:
    use: design.candidates
    with: {count: 4}
  excite:
    use: excitation.multisine
    with: {band_hz: [4, 80], lines: 100}
  acquire:
    use: acquisition.drives
    inputs: {configurations: where}
    with: {periods: 2}
  frf: {use: frf.log}
  fit: {use: fit.log_response, with: {starts: 20}}
  choose: {use: design.optimal}
  page: {use: report.html}
"""


def changed(old: str, new: str, text: str = GOOD) -> str:
    assert text.count(old) == 1, f"{old!r} stands {text.count(old)} times"
    return text.replace(old, new)


def test_a_good_file_is_read_wired_and_ordered(load: Callable[..., Pipeline]) -> None:
    pipeline = load(GOOD)
    assert [node.name for node in pipeline.stages] == [
        "where",
        "excite",
        "acquire",
        "frf",
        "fit",
        "choose",
        "page",
    ]
    wires = {node.name: node.inputs for node in pipeline.stages}
    assert wires["excite"] == {"configurations": "where"}  # not choose, whose Design is Configurations too
    assert wires["choose"] == {"fit": "fit", "frf": "frf"}
    assert wires["page"] == {"fit": "fit", "design": "choose", "frf": "frf"}
    assert pipeline.seed == 7
    assert pipeline.drives is not None
    assert pipeline.drives.settings.plant == "one_axis_true"  # type: ignore[attr-defined]
    assert pipeline.stage("excite").stage.band_hz == (4, 80)  # type: ignore[attr-defined]
    assert (pipeline.stage("frf").line, pipeline.stage("frf").column) == (17, 3)


CHOOSY = changed("fit: {use: fit.log_response, with: {starts: 20}}", "fit: {use: fit.choosy, with: {PLACE}}")


def choosy(settings: str) -> str:
    return changed("{PLACE}", f"{{{settings}}}", CHOOSY)


def test_a_stage_takes_the_robot_of_a_fit_where_inputs_say_so(load: Callable[..., Pipeline]) -> None:
    text = changed("{use: design.optimal}", "{use: design.optimal, inputs: {robot: fit}}")
    pipeline = load(text)
    assert pipeline.stage("choose").inputs == {"robot": "fit", "fit": "fit", "frf": "frf"}
    second = "  again: {use: fit.log_response, inputs: {robot: fit}}\n"
    choice = changed("{use: design.optimal}", "{use: design.optimal, inputs: {fit: again}}")
    pipeline = load(choice.replace("report.html}", "report.html, inputs: {fit: fit}}") + second)
    names = [node.name for node in pipeline.stages]
    assert names.index("fit") < names.index("again") < names.index("choose")
    assert pipeline.stage("again").inputs == {"robot": "fit", "frf": "frf"}


ONE_MISTAKE = {
    "setting the robot cannot have": (
        choosy("axes: [axis_1, axis_7]"),
        ["bad.yaml:18:48: stages.fit.with.axes[1]: no axis 'axis_7'"],
    ),
    "key the robot cannot have": (
        choosy("weights: {axis_1: 1.0, shoulder: 2.0}"),
        ["bad.yaml:18:56: stages.fit.with.weights.shoulder: no axis 'shoulder'"],
    ),
    "settings that do not go together": (
        choosy("fault: whole"),
        ["bad.yaml:18:26: stages.fit.with: these settings do not go together"],
    ),
    "robot refused by a stage": (
        choosy("fault: refuses"),
        [
            "bad.yaml:18:3: stages.fit: 'fit.choosy' (unknown 0) cannot be used with one_axis: not with this one"
        ],
    ),
    "stage that fails at the robot": (
        choosy("fault: fails"),
        [
            "bad.yaml:18:3: stages.fit: 'fit.choosy' (unknown 0) cannot be used with one_axis: ZeroDivisionError: a "
            "stranger's mistake"
        ],
    ),
    "unknown stage": (
        changed("excitation.multisine", "excitation.multisin"),
        [
            "bad.yaml:11:5: stages.excite.use: no stage 'excitation.multisin'; did you mean 'excitation.multisine'?"
        ],
    ),
    "unknown setting": (
        changed("periods: 2", "perids: 2"),
        ["bad.yaml:16:12: stages.acquire.with.perids: unknown key 'perids'; did you mean 'periods'?"],
    ),
    "misspelt required setting": (
        changed("band_hz", "band"),
        ["bad.yaml:12:12: stages.excite.with.band: unknown key 'band'; did you mean 'band_hz'?"],
    ),
    "unlike required setting": (
        changed("count: 4", "n: 4"),
        ["bad.yaml:9:12: stages.where.with.n: unknown key 'n'; the key 'count' is missing: is it that?"],
    ),
    "missing setting": (
        changed("    with: {count: 4}\n", ""),
        ["bad.yaml:7:3: stages.where.with.count: the key 'count' is missing: How many"],
    ),
    "out of bounds": (
        changed("periods: 2", "periods: 0"),
        ["bad.yaml:16:12: stages.acquire.with.periods: 0 must be greater than 0"],
    ),
    "list too short": (
        changed("[4, 80]", "[4]"),
        [
            "bad.yaml:12:12: stages.excite.with.band_hz: the list is too short: item 1 (counted from 0) is "
            "missing"
        ],
    ),
    "wrong item of a list": (
        changed("[4, 80]", "[4, high]"),
        ["bad.yaml:12:25: stages.excite.with.band_hz[1]: 'high' must be a number"],
    ),
    "missing input": (
        changed("  frf: {use: frf.log}\n", ""),
        [
            "bad.yaml:17:3: stages.fit.inputs.frf: 'fit' needs an Frf (so does choose), and no stage makes one; "
            "add a stage of kind frf"
        ],
    ),
    "input of an unknown stage": (
        changed("configurations: where", "configurations: were"),
        ["bad.yaml:15:14: stages.acquire.inputs.configurations: no stage 'were'; did you mean 'where'?"],
    ),
    "input of the wrong type": (
        changed("configurations: where", "configurations: fit"),
        [
            "bad.yaml:15:14: stages.acquire.inputs.configurations: 'fit' makes a Fit, not Configurations; "
            "where or choose makes one"
        ],
    ),
    "unknown input": (
        changed("{configurations: where}", "{configs: where}"),
        [
            "bad.yaml:15:14: stages.acquire.inputs.configs: 'acquisition.drives' (unknown 0) has no input "
            "'configs'; did you mean 'configurations'?"
        ],
    ),
    "input that robid hands in": (
        changed("{configurations: where}", "{configurations: where, drives: where}"),
        ["bad.yaml:15:37: stages.acquire.inputs.drives: 'drives' is handed in by robid and not wired"],
    ),
    "robot of a stage that finds none": (
        changed("{use: design.optimal}", "{use: design.optimal, inputs: {robot: where}}"),
        [
            "bad.yaml:19:42: stages.choose.inputs.robot: 'where' makes Configurations, not a Fit or Diagnosis; "
            "fit makes one; without this line the stage takes the nominal robot"
        ],
    ),
    "robot of an unknown stage": (
        changed("{use: design.optimal}", "{use: design.optimal, inputs: {robot: fitt}}"),
        ["bad.yaml:19:42: stages.choose.inputs.robot: no stage 'fitt'; did you mean 'fit'?"],
    ),
    "robot for a stage that takes none": (
        changed("{use: frf.log}", "{use: frf.log, inputs: {robot: fit}}"),
        [
            "bad.yaml:17:32: stages.frf.inputs.robot: 'frf.log' (unknown 0) has no input 'robot'; its inputs are: "
            "record"
        ],
    ),
    "robot misspelt": (
        changed("{use: design.optimal}", "{use: design.optimal, inputs: {robt: fit}}"),
        [
            "bad.yaml:19:42: stages.choose.inputs.robt: 'design.optimal' (unknown 0) has no input 'robt'; did you "
            "mean 'robot'?"
        ],
    ),
    "fit that begins at its own robot": (
        changed("with: {starts: 20}}", "with: {starts: 20}, inputs: {robot: fit}}"),
        ["bad.yaml:18:61: stages.fit.inputs.robot: stage 'fit' cannot feed itself"],
    ),
    "robot of a fit that needs the stage": (
        changed(
            "    use: excitation.multisine\n", "    use: excitation.multisine\n    inputs: {robot: fit}\n"
        ),
        [
            "bad.yaml:12:5: stages.excite.inputs.robot: cycle: excite -> acquire -> frf -> fit -> excite, each feeds "
            "the next; let 'excite' take another stage than 'fit', by `inputs: {robot: ...}`"
        ],
    ),
    "stage that feeds itself": (
        changed("configurations: where", "configurations: acquire"),
        ["bad.yaml:15:14: stages.acquire.inputs.configurations: stage 'acquire' cannot feed itself"],
    ),
    "cycle": (
        changed("configurations: where", "configurations: choose"),
        [
            "bad.yaml:15:5: stages.acquire.inputs.configurations: cycle: acquire -> frf -> choose -> acquire, "
            "each feeds the next; let 'acquire' take another stage than 'choose', by `inputs: {configurations: "
            "...}`"
        ],
    ),
    "ambiguous input": (
        GOOD + "  again: {use: acquisition.drives, inputs: {configurations: where}}\n",
        [
            "bad.yaml:17:3: stages.frf.inputs.record: ambiguous: acquire and again each make a Record; write "
            "`inputs: {record: acquire}` or `inputs: {record: again}`"
        ],
    ),
    "bad stage name": (
        changed("  frf:", "  frf-1:"),
        [
            "bad.yaml:17:3: stages.frf-1: 'frf-1' cannot name a stage: it becomes a file name; use letters, "
            "digits and '_', a letter first, 64 characters at most"
        ],
    ),
    "stage name of a device": (
        changed("  frf:", "  con:"),
        [
            "bad.yaml:17:3: stages.con: 'con' cannot name a stage: it becomes a file name; use letters, digits "
            "and '_', a letter first, 64 characters at most"
        ],
    ),
    "stage without braces": (
        changed("{use: frf.log}", "frf.log"),
        ["bad.yaml:17:3: stages.frf: 'frf.log' must be a mapping; write `{use: frf.log}`"],
    ),
    "use misspelt": (
        changed("{use: frf.log}", "{ues: frf.log}"),
        ["bad.yaml:17:9: stages.frf.ues: unknown key 'ues'; did you mean 'use'?"],
    ),
    "inputs misspelt": (
        changed("inputs:", "input:"),
        ["bad.yaml:15:5: stages.acquire.input: unknown key 'input'; did you mean 'inputs'?"],
    ),
    "drives misspelt": (
        changed("drives: {", "drive: {"),
        ["bad.yaml:5:1: drive: unknown key 'drive'; did you mean 'drives'?"],
    ),
    "no drives": (
        changed("drives: {use: can, with: {plant: one_axis_true}}\n", ""),
        [
            "bad.yaml:13:5: stages.acquire.use: 'acquisition.drives' (unknown 0) moves motors, but the pipeline "
            "has no drives; add `drives: {use: simulated, with: {plant: six_axis_true}}`"
        ],
    ),
    "unknown drives": (
        changed("use: can", "use: cann"),
        ["bad.yaml:5:10: drives.use: no drives 'cann'; did you mean 'can'?"],
    ),
    "drives that are none": (
        changed("drives: {use: can, with: {plant: one_axis_true}}", "drives: {use: plain}"),
        ["bad.yaml:5:10: drives.use: 'plain' (unknown 0) is no subclass of robid_core.Drives"],
    ),
    "an executor that is none": (
        changed("stages:\n", "executor: {use: plain}\nstages:\n"),
        ["bad.yaml:6:12: executor.use: 'plain' (unknown 0) is no executor: it must return a context manager"],
    ),
    "dynamics that are none": (
        changed("robot: one_axis\n", "robot: {model: one_axis, dynamics: plain}\n"),
        [
            "bad.yaml:4:26: robot.dynamics: 'plain' (unknown 0) computes no dynamics: it lacks solve_equilibrium"
        ],
    ),
    "unknown executor": (
        changed("stages:\n", "executor: {use: pol}\nstages:\n"),
        ["bad.yaml:6:12: executor.use: no executor 'pol'; did you mean 'pool'?"],
    ),
    "unknown setting of a function": (
        changed("stages:\n", "executor: {use: pool, with: {workes: 3}}\nstages:\n"),
        ["bad.yaml:6:30: executor.with.workes: unknown key 'workes'; did you mean 'workers'?"],
    ),
    "unknown robot": (
        changed("robot: one_axis", "robot: one_axs"),
        ["bad.yaml:4:1: robot: no robot 'one_axs'; did you mean 'one_axis'? (or the path of a robot.yaml)"],
    ),
    "unknown dynamics": (
        changed("robot: one_axis", "robot: {model: one_axis, dynamics: fortran}"),
        ["bad.yaml:4:26: robot.dynamics: no dynamics 'fortran'; there are: kernel"],
    ),
    "unknown version": (
        changed("robid: 1", "robid: 2"),
        ["bad.yaml:1:1: robid: version 2 of the file format is unknown; write `robid: 1`"],
    ),
    "version that is no whole number": (
        changed("robid: 1", "robid: 1.0"),
        ["bad.yaml:1:1: robid: 1.0 must be a whole number; write 1"],
    ),
    "version that is a boolean": (
        changed("robid: 1", "robid: true"),
        ["bad.yaml:1:1: robid: true must be a whole number"],
    ),
    "negative seed": (
        changed("seed: 7", "seed: -7"),
        ["bad.yaml:3:1: seed: -7 must be greater than or equal to 0"],
    ),
    "missing key": (
        changed("seed: 7\n", ""),
        [
            "bad.yaml:1:1: seed: the key 'seed' is missing: The only source of chance; each stage gets its own "
            "child seed"
        ],
    ),
    "name that is a path": (
        changed("name: example", "name: ../example"),
        [
            "bad.yaml:2:1: name: '../example' is no name: begin with a letter or digit, then letters, digits, "
            "' ._-', 64 at most"
        ],
    ),
    "plugin that cannot be imported": (
        changed("frf.log}", "broken.module}"),
        [
            "bad.yaml:17:9: stages.frf.use: 'broken.module' (unknown 0) needs the module "
            "robid_module_that_is_not_there, which is not installed"
        ],
    ),
    "plugin that breaks the contract": (
        changed("report.html", "broken.contract"),
        [
            "bad.yaml:20:10: stages.page.use: 'broken.contract' (unknown 0) breaks the contract of stages: "
            "Explain.run: parameter 'record' is neither an artifact nor Robot, Drives, Context"
        ],
    ),
    "repeated key": (
        changed("seed: 7\n", "seed: 7\nseed: 8\n"),
        ["bad.yaml:4:1: seed: repeated key 'seed': it stands at line 3 already; keep one"],
    ),
    "repeated stage": (
        changed("  frf: {", "  fit: {"),
        ["bad.yaml:18:3: stages.fit: repeated key 'fit': it stands at line 17 already; keep one"],
    ),
    "tag": (
        changed("seed: 7", "seed: !!python/object/apply:os.system [ls]"),
        [
            "bad.yaml:3:7: seed: the tag '!!python/object/apply:os.system' is refused; write the value without "
            "a tag"
        ],
    ),
    "merge key": (
        changed("with: {periods: 2}", "with: {<<: {periods: 2}}"),
        [
            "bad.yaml:16:12: stages.acquire.with.<<: merge keys are not part of YAML 1.2; write the keys out, or "
            "repeat a whole value"
        ],
    ),
    "syntax": (
        changed("{count: 4}", "{count: 4"),
        [
            "bad.yaml:10:9: not YAML: expected ',' or '}', but got ':', while parsing a flow mapping that begins "
            "at line 9; check indentation, quotes and brackets before this place"
        ],
    ),
    "quote that does not end": (
        changed("name: example", 'name: "example'),
        ["bad.yaml:2:7: not YAML: found unexpected end of stream, while scanning a quoted scalar; check "],
    ),
    "a list of stages": (
        GOOD[: GOOD.index("stages:")] + "stages:\n  - {use: frf.log}\n",
        [
            "bad.yaml:6:1: stages: this list must be a mapping; write a name before each stage, no dash: `acquire: {"
        ],
    ),
    "no stages": (
        GOOD[: GOOD.index("stages:")] + "stages: {}\n",
        ["bad.yaml:6:1: stages: This mapping should have at least 1 item, not 0"],
    ),
    "settings that contradict each other": (
        changed("[4, 80]", "[80, 4]"),
        ["bad.yaml:12:12: stages.excite.with.band_hz: 80 Hz is not below 4 Hz"],
    ),
    "reference to an unknown stage": (
        changed("{starts: 20}", "{estimator: frf.lgo}"),
        ["bad.yaml:18:39: stages.fit.with.estimator.use: no stage 'frf.lgo'; did you mean 'frf.log'?"],
    ),
    "wrong setting of a referenced stage": (
        changed("{starts: 20}", "{estimator: {use: frf.h1, with: {discard: -1}}}"),
        ["bad.yaml:18:71: stages.fit.with.estimator.with.discard: -1 must be greater than or equal to 0"],
    ),
}


@pytest.mark.parametrize(
    ("text", "expected"),
    ONE_MISTAKE.values(),
    ids=[k.replace(" ", "_") for k in ONE_MISTAKE],
)
def test_one_mistake_is_told_once_at_its_place(text: str, expected: list[str], problems: Read) -> None:
    found = problems(text)
    assert len(found) == len(expected)
    for line, beginning in zip(found, expected, strict=True):
        assert line.startswith(beginning)


MANY = """\
robid: 1
name: example
seed: 7
robot: one_axis
stages:
  read: {use: acquisition.recorded, with: {path: bad.csv}}
  a: {use: frf.log}
  b: {use: frf.h1}
  fit: {use: fit.joint}
"""


def test_a_stage_may_take_all_artifacts_of_a_type_or_those_that_are_listed(
    load: Callable[..., Pipeline], tmp_path: Path
) -> None:
    (tmp_path / "bad.csv").write_text("1\n")
    node = load(MANY, data_root=tmp_path).stage("fit")
    assert node.inputs == {"frfs": ("a", "b"), "records": ("read",)}
    assert node.feeds == ("a", "b", "read")
    listed = MANY.replace("fit.joint", "fit.joint, inputs: {frfs: [b, a], records: []}")
    assert load(listed, data_root=tmp_path).stage("fit").inputs == {"frfs": ("b", "a"), "records": ()}
    changed_by_option = load(MANY, "stages.fit.inputs.frfs=[b]", data_root=tmp_path).stage("fit")
    assert changed_by_option.inputs == {"frfs": ("b",), "records": ("read",)}
    one = MANY.replace("fit.joint", "fit.joint, inputs: {frfs: b}")
    assert load(one, data_root=tmp_path).stage("fit").inputs == {"frfs": ("b",), "records": ("read",)}


@pytest.mark.parametrize(
    ("inputs", "expected"),
    [
        (
            "{frfs: [a, x]}",
            ["bad.yaml:9:44: stages.fit.inputs.frfs[1]: no stage 'x'; the other stages are: "],
        ),
        ("{frfs: [a, a]}", ["bad.yaml:9:44: stages.fit.inputs.frfs[1]: stage 'a' is listed already"]),
        (
            "{frfs: []}",
            ["bad.yaml:9:34: stages.fit.inputs.frfs: the list is empty; name the stages that make an Frf"],
        ),
        (
            "{frfs: [a, 3], records: [b]}",
            [
                "bad.yaml:9:44: stages.fit.inputs.frfs[1]: 3 must be text; write it in quotes",
                "bad.yaml:9:58: stages.fit.inputs.records[0]: 'b' makes an Frf, not a Record; read makes one",
            ],
        ),
        ("{frfs: {a: b}}", ["bad.yaml:9:34: stages.fit.inputs.frfs: this mapping must be text"]),
        ("{frfs: [fit]}", ["bad.yaml:9:41: stages.fit.inputs.frfs[0]: stage 'fit' cannot feed itself"]),
    ],
)
def test_a_mistake_in_a_list_of_inputs_is_told_at_its_item(
    inputs: str, expected: list[str], problems: Read, tmp_path: Path
) -> None:
    (tmp_path / "bad.csv").write_text("1\n")
    found = problems(MANY.replace("fit.joint", f"fit.joint, inputs: {inputs}"), data_root=tmp_path)
    assert len(found) == len(expected)
    for line, beginning in zip(found, expected, strict=True):
        assert line.startswith(beginning)


def test_a_list_for_an_input_that_takes_one_is_refused(problems: Read) -> None:
    (line,) = problems(changed("inputs: {configurations: where}", "inputs: {configurations: [where]}"))
    assert line.startswith("bad.yaml:15:14: stages.acquire.inputs.configurations: 'acquisition.drives'")
    assert "takes one Configurations here; write the name of one stage, no list" in line


def test_two_distributions_with_one_name_are_both_named(problems: Read) -> None:
    (line,) = problems(changed("{use: frf.log}", "{use: twice.named}"))
    assert "17:9: stages.frf.use: stage 'twice.named' is claimed by unknown 0 and unknown 0" in line


def test_all_mistakes_come_at_once_in_line_order_without_echoes(problems: Read) -> None:
    text = """
    robid: 1
    name: example
    sed: 7
    robot: six_axs
    drives: {use: can, with: {bitrate: fast}}
    stages:
      where: {use: design.candidates, with: {count: .inf}}
      excite: {use: excitation.multisin, with: {band_hz: [4, 80]}}
      acquire: {use: acquisition.drives, wiht: {periods: 0}, inputs: {configurations: where}}
      frf: {use: frf.log, with: {discard: 1.0}}
      fit: {use: fit.log_response, with: {starts: yes, criterion: log_respons}}
      fit: {use: fit.log_response}
      page: {use: report.html, inputs: {fit: page}}
    """
    found = problems(text)
    places = [":".join(line.split(":")[1:4]) for line in found]
    assert places == [
        "3:1: sed",
        "4:1: robot",
        "5:27: drives.with.bitrate",
        "7:42: stages.where.with.count",
        "8:12: stages.excite.use",
        "9:38: stages.acquire.wiht",
        "9:45: stages.acquire.with.periods",
        "10:30: stages.frf.with.discard",
        "11:39: stages.fit.with.starts",
        "11:52: stages.fit.with.criterion",
        "12:3: stages.fit",
        "13:37: stages.page.inputs.fit",
    ]


def test_a_pipeline_that_does_not_exist_is_one_line(tmp_path: object) -> None:
    from robid_core import ConfigurationError

    with pytest.raises(ConfigurationError, match=r"there is no such file; name a pipeline file, or make one"):
        Pipeline.load(f"{tmp_path}/none.yaml")


@pytest.mark.parametrize(
    ("data", "told"),
    [
        (b"- a\n", "bad.yaml:1:1: this list must be a mapping"),
        (b"", "bad.yaml:1:1: the file is empty; begin with `robid: 1`, or see `robid init`"),
        (
            b"\xef\xbb\xbfrobid: 1\n",
            "bad.yaml:1:1: byte 0 is 0xef: a byte order mark; save the file as UTF-8",
        ),
    ],
)
def test_what_is_no_pipeline_file_at_all_is_told_once(problems: Read, data: bytes, told: str) -> None:
    (line,) = problems(data)
    assert line.startswith(told)


def test_all_that_the_robot_cannot_have_is_told_at_once_and_beside_other_mistakes(problems: Read) -> None:
    text = changed("periods: 2", "perids: 2", choosy("axes: [a, axis_1, b], weights: {c: 1.0}"))
    lines = problems(text)
    assert [line.rpartition(" ")[2] for line in lines] == ["'periods'?", "'a'", "'b'", "'c'"]


def test_a_setting_that_was_given_on_the_command_line_is_told_there(problems: Read) -> None:
    (line,) = problems(choosy("axes: [axis_1]"), "stages.fit.with.axes=[axis_7]")
    assert line == "--set stages.fit.with.axes=[axis_7]: stages.fit.with.axes[0]: no axis 'axis_7'"


def test_the_robot_is_made_only_where_a_stage_looks_at_it_and_told_where_it_cannot_be(
    problems: Read, load: Callable[..., Pipeline], monkeypatch: pytest.MonkeyPatch
) -> None:
    def impossible(*_: object, **__: object) -> Robot:
        raise ConfigurationError("two motors move the joints alike")

    monkeypatch.setattr(Robot, "load", impossible)
    assert load(GOOD.partition("  excite:")[0]).stage("where")
    assert problems(choosy("axes: [axis_7]")) == ["bad.yaml:4:1: robot: two motors move the joints alike"]
