"""`robid run`, `robid show` and `robid diff` as a person types them."""

from __future__ import annotations

import dataclasses
import importlib.util
import io
import json
import re
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import pytest
from faults.fault import fault

from robid_core import Fit, MisfitTable, ParameterTable
from robid_core.commands.app import command_line
from robid_core.commands.diff_page import compared_stages
from robid_core.registry import registry
from robid_core.run.manifest import with_hash

NAME = "robid_strange_world"


class Said(NamedTuple):
    code: int
    out: str
    err: str


Robid = Callable[..., Said]


QUICK = ("--jobs", "1", "--trust-plugins")  # no process for each stage


@pytest.fixture
def world(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    if NAME not in sys.modules:
        place = Path(__file__).parent.parent / "run" / "strange_world.py"
        spec = importlib.util.spec_from_file_location(NAME, place)
        assert spec is not None
        assert spec.loader is not None
        sys.modules[NAME] = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(sys.modules[NAME])
    module = sys.modules[NAME]
    world = module.World(tmp_path)
    monkeypatch.syspath_prepend(world.site)
    monkeypatch.setenv("STRANGE_CALLS", str(world.calls))
    monkeypatch.setenv("COLUMNS", "100")
    monkeypatch.setattr("robid_core.run.identity.core_hash", lambda: "core")
    monkeypatch.setattr("robid_core.pipeline.pipeline.registry", world.registry)
    monkeypatch.chdir(world.project)
    yield world
    sys.modules.pop(module.PACKAGE, None)
    registry.cache_clear()  # the stranger's package is gone


@pytest.fixture
def robid(world: Any, capsys: pytest.CaptureFixture[str]) -> Robid:
    """Return a function that runs the command line and tells what it said."""

    def run(*words: str) -> Said:
        with pytest.raises(SystemExit) as ended:
            command_line(list(words))
        out, err = capsys.readouterr()
        return Said(int(ended.value.code or 0), out, err)

    return run


def test_the_last_screen_has_the_table_the_page_and_the_way_to_run_it_again(world: Any, robid: Robid) -> None:
    said = robid("run", *QUICK)
    assert said.code == 0
    lines = said.out.splitlines()
    assert len(lines) <= 25
    assert re.fullmatch(r"strange: 6 stages, 6 made, 0 up to date, \d+\.\d s", lines[0])
    head, row = lines[2], lines[3]
    assert head.endswith("true  start  estimate  std error  off / std error")
    assert row.split()[:5] == ["gear_stiffness.axis_1", "N", "m/rad", "2", "1"]
    assert lines[4] == "fit: converged; misfit 1; 1 of 1 starts agree"
    assert "page       runs/strange/artifacts/page.html" in lines
    assert "results    robid show runs/strange" in lines
    assert lines[-1] == "run again  robid run pipeline.yaml"
    assert "[2/6] acquire: never made" in said.err
    assert re.search(r"acquire: made in \d+\.\d s", said.err)


@fault(
    "R07",
    sees="exit 0: the last screen without the true parameters; everything that was made is there",
    mutant=(
        "robid_core/commands/last_screen.py",
        "    except RobidError:  # a file that was changed or removed meanwhile; the run itself has ended well",
        "    except KeyError:",
    ),
)
def test_a_robot_file_that_was_removed_meanwhile_does_not_spoil_the_last_screen(world: Any) -> None:
    from robid_core.commands.last_screen import last_screen

    result = world.run()
    pipeline = world.pipeline()
    gone = dataclasses.replace(pipeline, robot=dataclasses.replace(pipeline.robot, source="gone.yaml"))
    with_truth, without = (last_screen(one, result, "robid run") for one in (pipeline, gone))
    assert with_truth[2].split()[2:] == [
        "true",
        "start",
        "estimate",
        "std",
        "error",
        "off",
        "/",
        "std",
        "error",
    ]
    assert without[2].split() == ["parameter", "unit", "start", "estimate", "std", "error"]
    assert without[-1] == "run again  robid run"


def test_nothing_to_do_is_said(robid: Robid) -> None:
    robid("run", *QUICK)
    said = robid("run", *QUICK)
    assert said.code == 0
    assert said.out.startswith("strange: nothing to do, all 6 stages are up to date\n")


def test_settings_of_the_command_line_are_used_and_repeated(world: Any, robid: Robid) -> None:
    said = robid("run", "pipeline.yaml", "--set", "stages.page.with.title=a b", *QUICK)
    assert said.code == 0
    assert (
        said.out.splitlines()[-1] == "run again  robid run pipeline.yaml --set 'stages.page.with.title=a b'"
    )
    assert "a b" in (world.folder / "artifacts" / "page.html").read_text()


def test_on_a_terminal_the_progress_leaves_the_last_screen_alone(
    robid: Robid, monkeypatch: pytest.MonkeyPatch
) -> None:
    from robid_core.commands import run_screen

    monkeypatch.setattr(run_screen, "on_terminal", lambda: True)
    monkeypatch.setenv("FORCE_COLOR", "1")
    said = robid("run", *QUICK)
    assert said.code == 0
    assert len(said.out.splitlines()) == 9
    assert "[2/6] acquire" in said.err
    assert "never made" not in said.err


def test_a_reader_that_went_away_does_not_end_a_run(
    world: Any, robid: Robid, monkeypatch: pytest.MonkeyPatch
) -> None:
    import typer

    def closed(text: str, err: bool = False) -> None:
        if err:
            raise BrokenPipeError

    monkeypatch.setattr(typer, "echo", closed)
    assert robid("run", *QUICK).code == 0
    assert world.ran()[-1] == "page"


def test_quiet_prints_one_line(robid: Robid) -> None:
    said = robid("run", "-q", *QUICK)
    assert len(said.out.splitlines()) == 1
    assert said.out.rstrip().endswith("page.html")
    assert said.err == ""


def test_verbose_prints_the_log(robid: Robid) -> None:
    assert "robid.fit: fitting converged" in robid("run", "-v", *QUICK).err


def test_a_dry_run_gives_a_reason_for_every_stage(world: Any, robid: Robid) -> None:
    said = robid("run", "--dry-run")
    assert said.code == 0
    assert [line.split()[0] for line in said.out.splitlines()] == [
        "where",
        "acquire",
        "frf",
        "fit",
        "choose",
        "page",
    ]
    assert not world.folder.exists()
    robid("run", *QUICK)
    lines = robid("run", "--dry-run", "--set", "stages.fit.with.hold=1.0").out.splitlines()
    assert lines[0].split() == ["where", "cached"]
    assert re.fullmatch(r"fit +run +setting hold: 0\.0 -> 1\.0", lines[3])
    assert re.fullmatch(
        r"page +run if its input changes +takes the output of fit, choose, to be made first", lines[5]
    )


@pytest.mark.parametrize(
    "words", [("--force", "fit"), ("pipeline.yaml", "--force", "fit"), ("--force", "fit", "pipeline.yaml")]
)
def test_force_takes_stages(world: Any, robid: Robid, words: tuple[str, ...]) -> None:
    robid("run", *QUICK)
    world.ran()
    assert robid("run", *QUICK, *words).code == 0
    assert world.ran() == ["fit"]


def test_force_alone_takes_all_and_until_fewer(world: Any, robid: Robid) -> None:
    robid("run", *QUICK)
    world.ran()
    robid("run", *QUICK, "--force", "--until", "acquire")
    assert world.ran() == ["where", "acquire"]


@pytest.mark.parametrize(
    "words, code, message",
    [
        (("--until", "fitt"), 2, "pipeline.yaml has no stage 'fitt'; did you mean 'fit'?"),
        (("pipeline.yaml", "fit"), 2, "fit: what shall be done with it? To run up to a stage, write --until fit"),
        (("none.yaml",), 2, "none.yaml: there is no such file"),
        (("--locked",), 2, "there is no manifest; run once without it"),
        (("--from", "fit"), 2, "stage fit needs the output of 'frf', which is not up to date (never made"),
        (("--set", "stages.fit.with.outcome=raises"), 8, "failed: ZeroDivisionError: a stranger's mistake"),
        (("--set", "stages.fit.with.outcome=nan"), 5, "ParameterTable.estimate: 1 values are NaN"),
        (("--set", "drives.use=strange_hardware"), 3, "stand at the emergency stop"),
        (("--jobs", "-1"), 2, "greater than or equal to 0"),
    ],
)  # fmt: skip
def test_mistakes_are_told_with_their_exit_code_and_no_traceback(
    robid: Robid, words: tuple[str, ...], code: int, message: str
) -> None:
    said = robid("run", *(() if "--jobs" in words else QUICK), *words)
    assert said.code == code
    assert message in said.err
    assert "Traceback" not in said.err + said.out


def test_a_fit_that_did_not_converge_is_shown_and_ends_with_6(robid: Robid) -> None:
    said = robid("run", *QUICK, "--set", "stages.fit.with.outcome=not converged")
    assert said.code == 6
    assert (
        "! stage fit: the fit did not converge: the budget of 3 steps is spent; its numbers must" in said.out
    )
    assert "page.html" in said.out


DOUBTED = ("run", *QUICK, "--set", "stages.fit.with.outcome=doubted")
SENTENCES = (
    "misfit 1.5 against the stated uncertainty, more than 1.08; the data show what the model lacks; robid diagnose "
    "looks for it, or add or free what acts there",
    "only 3 of 8 starts reached the best fit; a better one may be elsewhere; give better start values, or more starts",
    "it rained, and the cell was wet; wait for the sun",
)


def test_doubts_about_a_fit_are_told_whole_in_a_pipe_and_end_a_strict_run_with_6(
    robid: Robid, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "40")
    said = robid(*DOUBTED)
    assert said.code == 0
    lines = said.out.splitlines()
    assert lines[1:4] == [f"! stage fit: {sentence}" for sentence in SENTENCES]
    assert "fit: DO NOT RELY ON IT: converged; misfit 1.5; 3 of 8 starts agree" in lines
    strict = robid(*DOUBTED, "--strict")
    assert strict.code == 6
    assert strict.out.splitlines()[1:4] == lines[1:4]
    quiet = robid(*DOUBTED, "--strict", "-q")
    assert quiet.code == 6
    assert quiet.err.splitlines() == [f"stage fit: {sentence}" for sentence in SENTENCES]
    assert robid("run", *QUICK, "--strict").code == 0


def test_what_a_stage_warns_of_is_on_the_last_screen_also_where_it_is_up_to_date(
    world: Any, robid: Robid
) -> None:
    """In the log alone nobody found what explains a misfit: a torque constant, a file with another sign."""
    told = "the torque of axis_1 is -1 times what the robot makes of the motion"
    world.edit('        called("frf")\n', f'        called("frf")\n        context.log.warning("{told}")\n')
    for outcome in ("6 made", "nothing to do"):
        said = robid("run", *QUICK, "--strict")
        assert said.code == 0
        assert outcome in said.out.splitlines()[0]
        assert said.out.splitlines()[1] == f"! stage frf: {told}"
    assert f"! stage frf: {told}" in robid("show").out.splitlines()
    assert robid("run", *QUICK, "-q").err.splitlines() == [f"stage frf: {told}"]


def test_what_was_warned_of_is_told_where_the_run_fails_later(world: Any, robid: Robid) -> None:
    told = "the torque of axis_1 is -1 times what the robot makes of the motion"
    world.edit('        called("frf")\n', f'        called("frf")\n        context.log.warning("{told}")\n')
    said = robid("run", *QUICK, "--set", "stages.fit.with.outcome=raises")
    assert said.code == 8
    assert f"! stage frf: {told}" in said.err.splitlines()


def test_on_a_terminal_doubts_are_broken_at_its_edge_and_nothing_of_them_is_lost(
    robid: Robid, monkeypatch: pytest.MonkeyPatch
) -> None:
    from robid_core.commands import fit_screen

    monkeypatch.setattr(fit_screen.sys, "stdout", Terminal())
    monkeypatch.setenv("COLUMNS", "70")
    lines = fit_screen.doubt_lines(SENTENCES)
    assert max(len(line) for line in lines) <= 70
    assert sum(line.startswith("! ") for line in lines) == 3
    assert [" ".join(" ".join(lines).split("! ")[i + 1].split()) for i in range(3)] == list(SENTENCES)
    assert fit_screen.first_line("x" * 90) == "x" * 67 + "..."


def test_a_remark_is_told_everywhere_and_says_nowhere_not_to_rely_on_it(robid: Robid) -> None:
    told = "it rained, and the errors count it; wait for the sun"
    said = robid("run", *QUICK, "--set", "stages.fit.with.outcome=remarked", "--strict")
    assert said.code == 0
    assert f"- stage fit: {told}" in said.out.splitlines()
    assert f"- stage fit: {told}" in robid("show").out.splitlines()
    assert f"- {told}" in robid("show", "fit").out.splitlines()
    assert "RELY" not in said.out + robid("show", "fit").out


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_show_tells_the_doubts_of_a_fit_and_of_a_run(world: Any, robid: Robid) -> None:
    robid(*DOUBTED)
    for sentence in SENTENCES:
        assert f"! {sentence}" in robid("show", "fit").out.splitlines()
        assert f"! stage fit: {sentence}" in robid("show").out.splitlines()


def test_show_tells_where_a_model_misfits(tmp_path: Path, robid: Robid) -> None:
    table = MisfitTable(
        ("axis_1", "axis_2"),
        np.array([0.0, 3.0, 25.0]),
        np.array([[np.nan, 1.04], [np.nan, 0.98]]),
        np.array([[35.2, 1.5], [1.0, 1.1]]),
    )
    parameters = ParameterTable((), (), (), *np.zeros((3, 0)), *np.zeros((2, 0), dtype=bool))
    fit = Fit("test", "ended", True, 2.0, 1, 1, parameters, np.zeros((0, 0)), misfit_table=table)
    fit.write(tmp_path / "fit.h5")
    said = robid("show", str(tmp_path / "fit.h5")).out.splitlines()
    place = said.index("  misfit: lines | other bins  below 3 Hz     3-25 Hz")
    assert said[place + 1 : place + 3] == [
        "  axis_1                        - | 35.2  1.04 | 1.5",
        "  axis_2                           - | 1  0.98 | 1.1",
    ]
    assert any(line.startswith("! misfit 2 against") and "35.2 on axis_1 below 3 Hz" in line for line in said)


def test_a_fit_says_what_it_estimated_beside_what_it_shows() -> None:
    names = (
        "gear_stiffness.a",
        "friction.a.coulomb",
        "friction.a.viscous",
        "friction.a.offset",
        "gear_damping.a",
    )
    groups = ("stiffness", "friction", "friction", "friction", "damping", "nuisance")
    ones, shown = np.ones(6), np.array([True, False, False, False, False, False])
    errors = np.array([1.0, 0.1, 0.1, np.nan, 0.1, 0.1])  # the offset was held
    table = ParameterTable(names, ("1",) * 6, groups, ones, ones, errors, shown, np.zeros(6, dtype=bool))
    fit = Fit("test", "ended", True, 1.0, 1, 1, table, np.eye(6))
    said = "3 more parameters of the robot (2 of friction, 1 of damping), 1 nuisance parameter, 1 held"
    assert fit.parameters.unreported() == said
    assert table.replace(reported=np.ones(6, dtype=bool)).unreported() == ""


def test_a_long_table_is_cut_to_the_screen(world: Any, robid: Robid) -> None:
    from robid_core.commands.last_screen import last_screen

    result = world.run("stages.fit.with.rows=40", "stages.fit.with.outcome=not converged")
    lines = last_screen(world.pipeline("stages.fit.with.rows=40"), result, "robid run")
    assert len(lines) == 25
    shown = sum(line.startswith("gear_stiffness") for line in lines)
    assert f"... {40 - shown} more: robid show runs/strange fit" in lines


def test_show_lists_a_run_and_explains_each_artifact(world: Any, robid: Robid) -> None:
    robid("run", *QUICK)
    listed = robid("show").out
    assert re.search(r"^fit +Fit +yes +artifacts/fit\.h5 +[0-9a-f]{12}$", listed, re.MULTILINE)
    fit = robid("show", "fit").out
    assert "strange: converged; misfit 1; 1 of 1 starts agree" in fit
    assert "gear_stiffness.axis_1" in fit
    frf = robid("show", str(world.folder), "frf").out
    assert "1 of   1" in frf
    assert "response: 3 n_config x 1 n_freq x 1 n_out x 1 n_in, size " in frf
    assert "(rad/s^2)/(N m)" in frf
    assert "block_response: absent" in frf
    record = robid("show", "pipeline.yaml", "acquire").out
    assert "runs[0]: DenseRun" in record
    assert "channels[motor_position]: Channel" in record
    assert "valid: 3 n_config x 1 n_block x 1 n_exp x 1 n_period x 64 n_sample, 192 of 192 true" in record
    design = robid("show", str(world.folder / "artifacts" / "choose.h5")).out
    assert "criterion D: gap 0, efficiency after rounding 1.0000" in design
    assert "a page of 0 kB" in robid("show", "page").out


@pytest.mark.parametrize(
    "words, message",
    [
        (("show",), "not a run"),
        (("show", "nothing"), "nothing: no such run; robid run makes one in runs"),
        (("show", "nowhere", "fit"), "nowhere: no such run; robid run makes one"),
        (("diff", "a", "b"), "not a run"),
    ],
)
def test_what_is_no_run_is_refused(robid: Robid, words: tuple[str, ...], message: str) -> None:
    said = robid(*words)
    assert said.code == 2
    assert message in said.err


def test_show_names_the_stages_there_are(robid: Robid) -> None:
    robid("run", *QUICK, "--set", "stages.fit.with.outcome=refused")
    said = robid("show", "fitt")
    assert said.code == 2
    assert "stage 'fitt' is not in this run; there are: where, acquire, frf" in said.err
    assert "gave no result: the numbers would be wrong; measure longer" in robid("show", "fit").err


def test_diff_of_a_run_with_itself_finds_nothing(robid: Robid) -> None:
    robid("run", *QUICK)
    assert (
        robid("diff", "runs/strange", "pipeline.yaml").out
        == "no difference: the same settings, versions and results\n"
    )


def test_diff_takes_many_runs_and_writes_a_page(world: Any, robid: Robid) -> None:
    robid("run", "--jobs", "1")
    for name, rows in (("two", 2), ("three", 3)):
        world.run(f"name={name}", f"stages.fit.with.rows={rows}")
    done = robid("diff", "runs/strange", "runs/two", "runs/three", "--page", "beside.html")
    assert done.code == 0, done.err
    headings = [line for line in done.out.splitlines() if " -> runs/" in line or line.startswith("runs/")]
    assert len([line for line in headings if "runs/two" in line or "runs/three" in line]) >= 2
    page = (world.project / "beside.html").read_text()
    assert all(f">{name}<" in page for name in ("strange", "two", "three"))
    alone = robid("diff", "runs/strange")
    assert alone.code == 2
    assert "one run is no comparison" in alone.err


def test_the_page_of_diff_compares_the_last_fit_that_differs() -> None:
    def made(**sha256: str) -> Any:
        records = {
            name: SimpleNamespace(artifact="Fit", file=name, sha256=sha) for name, sha in sha256.items()
        }
        return SimpleNamespace(
            stages=records | {"frf": SimpleNamespace(artifact="Frf", file="f", sha256="x")}
        )

    assert compared_stages([made(first="a", last="c"), made(first="b", last="c")]) == ["first", "first"]
    assert compared_stages([made(first="a", last="c"), made(first="b", last="d")]) == ["last", "last"]
    assert compared_stages([made(first="a", last="c"), made(first="a", last="c")]) == ["last", "last"]
    assert compared_stages([made(one="a"), made(other="b"), made()]) == ["one", "other", ""]


def test_diff_tells_settings_versions_and_results(world: Any, robid: Robid) -> None:
    robid("run", *QUICK)
    world.folder.rename(world.project / "before")
    world.say("seed: 7", "seed: 8")
    robid("run", *QUICK, "--set", "stages.acquire.with.noise=0.2")
    path = world.project / "before" / "manifest.json"
    content = json.loads(path.read_text())
    content["environment"]["versions"]["numpy"] = "1.0"
    path.write_text(json.dumps(with_hash(content)))
    lines = robid("diff", "before", "runs/strange").out.splitlines()
    assert lines[:3] == ["settings:", "  seed: 7 -> 8", "  stage acquire: setting noise: 0.1 -> 0.2"]
    assert lines[3] == "versions:"
    assert lines[4].startswith("  numpy: 1.0 -> ")
    assert "  where: other bytes (" in "\n".join(lines)
    row = next(line.split() for line in lines if "gear_stiffness.axis_1" in line)
    first, second = float(row[1]), float(row[2])
    assert float(row[3]) == pytest.approx(100 * (second - first) / first, rel=1e-2)
    # Estimates are written to the second digit of their errors of 0.1: 0.005 each.
    assert float(row[5]) == pytest.approx((second - first) / (0.1 * 2**0.5), abs=0.011 / 0.14)
