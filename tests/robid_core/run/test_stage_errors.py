"""What goes wrong inside a stage is told with the stage's name, and nothing wrong is stored."""

from __future__ import annotations

import re
from typing import Any

import pytest
from faults.fault import fault

from robid_core.artifacts import Report
from robid_core.errors import DataRejected, PluginError, StoreError
from robid_core.run import Manifest, RunFolder, Silence


def test_a_strangers_exception_is_a_plugin_error_with_version_and_three_lines(world: Any) -> None:
    with pytest.raises(PluginError) as caught:
        world.run("stages.fit.with.outcome=raises")
    lines = str(caught.value).splitlines()
    assert len(lines) == 3
    assert lines[0] == (
        "stage fit: 'strange.estimate' (robid_strange_stages 1.0) failed: ZeroDivisionError: a stranger's mistake"
    )
    assert str(world.source) in lines[1]
    assert "raise ZeroDivisionError" in lines[1]
    assert str(world.folder / "log.txt") in lines[2]
    assert caught.value.exit_code == 8
    log = (world.folder / "log.txt").read_text()
    assert "Traceback (most recent call last)" in log
    assert "with a second line" in log


def test_finished_stages_are_kept_and_the_manifest_says_failed(world: Any) -> None:
    with pytest.raises(PluginError):
        world.run("stages.fit.with.outcome=raises")
    world.ran()
    assert '"status": "failed"' in (world.folder / "manifest.json").read_text()
    world.run()
    assert world.ran() == ["fit", "choose", "page"]


def test_an_error_of_ours_keeps_its_class_and_names_the_stage(world: Any) -> None:
    with pytest.raises(
        DataRejected, match=r"^stage fit: ParameterTable.estimate: 1 values are NaN"
    ) as caught:
        world.run("stages.fit.with.outcome=nan")
    assert caught.value.exit_code == 5


@pytest.mark.parametrize(
    "outcome, words", [("a list", "R12: .* returned a list"), ("exits", "SystemExit: 3")]
)
def test_what_breaks_the_contract_is_not_stored(world: Any, outcome: str, words: str) -> None:
    with pytest.raises(PluginError, match=words):
        world.run(f"stages.fit.with.outcome={outcome}")
    assert not (world.folder / "artifacts" / "fit.h5").exists()


@fault(
    "R12",
    sees="exit 8: the stage, its plugin and its version gave a result that cannot be; nothing is stored",
    mutant=("robid_core/run/guard.py", '    problem = next(unsound(result), "")', '    problem = ""'),
)
@pytest.mark.parametrize("value", ["nan", "inf"])
def test_R12_a_response_of_no_value_is_not_stored(world: Any, value: str) -> None:
    world.edit("np.eye(blocks.shape[2]) + 0j + BIAS", f"0 + 0j + float('{value}')")
    with pytest.raises(PluginError) as caught:
        world.run()
    assert caught.value.exit_code == 8
    message = str(caught.value)
    assert message.startswith("stage frf: R12: 'strange.respond' (robid_strange_stages ")
    assert "gave a result that cannot be: Frf.response: " in message
    assert message.endswith("; nothing was stored")
    assert "values are" in message
    assert not (world.folder / "artifacts" / "frf.h5").exists()


def test_a_fit_that_did_not_converge_is_kept_shown_and_doubted(world: Any) -> None:
    result = world.run("stages.fit.with.outcome=not converged")
    assert result.exit_code == 6
    fit, choose = result.doubts
    assert fit.startswith(
        "stage fit: the fit did not converge: the budget of 3 steps is spent; its numbers must"
    )
    assert choose == "stage choose: the fit it stands on did not converge"
    page = (world.folder / "artifacts" / "page.html").read_text()
    assert "no design" in page
    assert result.outcomes["choose"] == "refused"
    again = world.run("stages.fit.with.outcome=not converged")
    assert again.exit_code == 6
    assert again.outcomes["fit"] == "kept"


def test_N07_N08_doubts_about_a_fit_stand_in_manifest_and_log_and_end_a_strict_run_with_6(world: Any) -> None:
    doubted = "stages.fit.with.outcome=doubted"
    result = world.run(doubted)
    assert result.exit_code == 0
    assert len(result.doubts) == 3
    assert result.doubts[2] == "stage fit: it rained, and the cell was wet; wait for the sun"
    manifest = Manifest.read(RunFolder(world.folder))
    assert manifest is not None
    assert [doubt["kind"] for doubt in manifest.stages["fit"].doubts] == ["misfit", "starts", "weather"]
    assert manifest.stages["fit"].doubts[2]["sentence"] == "it rained, and the cell was wet"
    assert manifest.stages["fit"].doubts[2]["remedy"] == "wait for the sun"
    assert "weather: it rained" in (world.folder / "log.txt").read_text()
    world.ran()
    again = world.run(doubted, strict=True)  # the fit is kept, and doubted all the same
    assert world.ran() == []
    assert again.exit_code == 6
    assert again.doubts == result.doubts
    assert world.run(strict=True).exit_code == 0


def test_remarks_about_a_fit_are_told_and_end_no_strict_run(world: Any) -> None:
    result = world.run("stages.fit.with.outcome=remarked", strict=True)
    assert result.exit_code == 0
    assert result.doubts == ()
    assert result.remarks == ("stage fit: it rained, and the errors count it; wait for the sun",)
    manifest = Manifest.read(RunFolder(world.folder))
    assert manifest is not None
    assert [doubt["degree"] for doubt in manifest.stages["fit"].doubts] == ["remark"]
    assert "weather: it rained" in (world.folder / "log.txt").read_text()


def test_what_needs_a_refused_result_is_refused_and_old_names_go(world: Any) -> None:
    world.run()
    result = world.run("stages.fit.with.outcome=refused")
    assert {name for name, outcome in result.outcomes.items() if outcome == "refused"} == {
        "fit",
        "choose",
        "page",
    }
    assert "stage page: needs fit, which gave no result" in result.doubts
    assert sorted(world.hashes()) == ["acquire.h5", "frf.h5", "where.h5"]
    assert world.run().exit_code == 0
    assert world.ran().count("fit") == 2  # the first fit was found again


def test_check_refuses_a_stage_that_is_not_deterministic(world: Any) -> None:
    assert world.run(check=True).exit_code == 0
    assert world.ran().count("where") == 2
    with pytest.raises(PluginError, match="R13: .* ran twice and gave other bytes"):
        world.run("stages.fit.with.outcome=clock", check=True)


def test_other_bytes_from_the_same_ingredients_are_noticed(world: Any) -> None:
    class Ear(Silence):
        heard = ""

        def note(self, text: str) -> None:
            self.heard += text

    ear = Ear()
    world.run("stages.fit.with.outcome=clock")
    world.run("stages.fit.with.outcome=clock", force=("fit",), listener=ear)
    assert "R13" in ear.heard


def test_a_stage_that_reads_a_damaged_input_is_not_run(world: Any) -> None:
    class Saboteur(Silence):
        def begin(self, stage: str, index: int, total: int, reasons: object) -> None:
            if stage == "fit":
                world.flip(world.blob("frf"))

    with pytest.raises(StoreError, match=r"frf: .* is damaged"):
        world.run(listener=Saboteur())
    assert "fit" not in world.ran()
    world.run()
    assert world.ran() == ["frf", "fit", "choose", "page"]


def test_progress_and_reasons_are_told(world: Any) -> None:
    class Ear(Silence):
        def __init__(self) -> None:
            self.heard: list[tuple[object, ...]] = []

        def begin(self, stage: str, index: int, total: int, reasons: object) -> None:
            self.heard.append((stage, index, total, reasons))

        def progress(self, stage: str, done: float, total: float, note: str) -> None:
            self.heard.append((stage, done, total, note))

        def end(self, stage: str, outcome: str, seconds: float) -> None:
            self.heard.append((stage, outcome))

    ear = Ear()
    world.run(listener=ear, last="acquire")
    ear.heard = [entry for entry in ear.heard if "compiling" not in str(entry)]  # told once a process
    assert ear.heard[:3] == [
        ("where", 1, 6, ("never made",)),
        ("where", "made"),
        ("acquire", 2, 6, ("never made",)),
    ]
    assert ear.heard[3] == ("acquire", 0, 10, "measuring")
    assert ear.heard[-1] == ("acquire", "made")


def test_each_run_leaves_its_lines_in_the_log(world: Any) -> None:
    world.run()
    world.run()
    log = (world.folder / "log.txt").read_text()
    assert log.count("==================== run of") == 2
    assert "robid.fit: fitting converged" in log
    assert "robid.page: kept" in log


FIT = '        called("fit")\n'


@fault(
    "R09",
    sees="exit 5: plugin, class, line and the log, where a stage raises an error of robid without a message",
    mutant=("robid_core/run/guard.py", "            if not text:", "            if False:"),
)
@pytest.mark.parametrize("trust", [True, False])
def test_R09_an_error_of_ours_without_a_message_is_told_by_class_and_line(world: Any, trust: bool) -> None:
    raises = "        from robid_core.errors import DataRejected\n        raise DataRejected\n"
    world.edit(FIT, FIT + raises)
    with pytest.raises(DataRejected) as caught:
        world.run(last="fit", trust_plugins=trust)
    first, place, log = str(caught.value).splitlines()
    assert first == (
        "stage fit: 'strange.estimate' (robid_strange_stages 1.0) raised DataRejected without a message"
    )
    assert "raise DataRejected" in place
    assert str(world.folder / "log.txt") in log


@fault(
    "R09",
    sees="exit 8: a stage that raises KeyboardInterrupt, or sends itself a signal, failed; nobody interrupted the run",
    mutant=(
        "robid_core/interruption.py",
        "    return _latch.requested or not _latch.listening",
        "    return True",
    ),
)
@pytest.mark.parametrize(
    "line", ["raise KeyboardInterrupt", "import os, signal; os.kill(os.getpid(), signal.SIGTERM)"]
)
def test_R09_a_stage_that_interrupts_itself_has_failed(world: Any, line: str) -> None:
    world.edit(FIT, f"{FIT}        {line}\n")
    with pytest.raises(PluginError, match=r"stage fit: 'strange\.estimate'.*failed: KeyboardInterrupt"):
        world.run(last="fit", trust_plugins=False)
    assert '"status": "failed"' in (world.folder / "manifest.json").read_text()


@fault(
    "R16",
    sees="processes that a stage forks are ended by SIGTERM as any other, with no traceback of robid's",
    mutant=("robid_core/interruption.py", "os.register_at_fork(after_in_child=_forget)\n", ""),
)
def test_R16_processes_that_a_stage_forks_hear_no_signals_for_the_run(world: Any) -> None:
    """Sixteen sleepers are told to end: without a traceback, each by the signal."""
    forks = """\
        import os, signal, time
        sleepers = []
        for _ in range(16):
            pid = os.fork()
            if not pid:
                try:
                    time.sleep(30)
                finally:
                    os._exit(3)
            sleepers.append(pid)
        time.sleep(0.2)
        for pid in sleepers:
            os.kill(pid, signal.SIGTERM)
        ends = {os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) for pid in sleepers}
        if ends != {-signal.SIGTERM}:
            raise ValueError(ends)
"""
    world.edit(FIT, FIT + forks)
    done = world.elsewhere(last="fit")
    assert (done.returncode, done.stderr) == (0, "")


@fault(
    "R09",
    sees="exit 8: the beginning of what a plugin says, where that is very long",
    mutant=("robid_core/run/guard.py", "    if len(what) > LONGEST_LINE:", "    if False:"),
)
def test_R09_a_very_long_text_of_an_exception_is_cut(world: Any) -> None:
    world.edit(FIT, FIT + '        raise ValueError("x" * 10_000_000)\n')
    with pytest.raises(PluginError, match="failed: ValueError: xxx") as caught:
        world.run(last="fit")
    assert len(str(caught.value)) < 2000


def test_an_exception_that_hides_its_class_and_its_text_is_told(world: Any) -> None:
    """And also from another process, to which it does not get."""
    hides = """\
        class Hidden(type):
            @property
            def __name__(cls):
                raise KeyboardInterrupt

        class Odd(Exception, metaclass=Hidden):
            def __str__(self):
                raise KeyboardInterrupt

        raise Odd
"""
    world.edit(FIT, FIT + hides)
    for trust in (True, False):
        with pytest.raises(
            PluginError, match="an exception whose class cannot be named: .its text cannot be shown"
        ):
            world.run(last="fit", trust_plugins=trust)


@fault(
    "R12",
    sees="exit 8: the class of the result, which no other process could read back; nothing is stored",
    mutant=("robid_core/run/guard.py", "    if not _found_again(type(result)) or", "    if"),
)
@pytest.mark.parametrize("body", ["pass", "suffix = '.html'"])
def test_R12_a_class_that_only_one_process_has_is_not_stored(world: Any, body: str) -> None:
    world.edit(
        "\n        converged = self.outcome",
        f"\n        class Own(Fit):\n            {body}\n\n        converged = self.outcome",
    )
    world.edit(
        '        return Fit("strange", status, converged', '        return Own("strange", status, converged'
    )
    for trust in (True, False):
        with pytest.raises(
            PluginError, match=r"R12: .* returned an Own, a class that nobody could read back"
        ):
            world.run(last="fit", trust_plugins=trust)
    assert not (world.folder / "artifacts" / "fit.h5").exists()


@fault(
    "R09",
    sees="exit 8: plugin, class and line of an exception that answers every question by another error",
    mutant=(
        "robid_core/run/guard.py",
        'object.__getattribute__(error, "__dict__").get("robid_frames")',
        'getattr(error, "robid_frames", None)',
    ),
)
def test_R09_an_exception_that_cannot_be_asked_is_told(world: Any) -> None:
    raises = """\
        class Mute(Exception):
            def __getattr__(self, name):
                raise ValueError(name)

        raise Mute("mine")
"""
    world.edit(FIT, FIT + raises)
    done = world.elsewhere(last="fit")  # pytest, too, would ask it
    assert done.returncode == 8
    assert re.search(r"failed: Mute: mine\n .*raise Mute", done.stderr)


@fault(
    "R09",
    sees="exit 8, not 0 or 70: plugin and line, where a stage raises an error of robid's with an exit code of its own",
    mutant=("robid_core/run/guard.py", " and error.exit_code in OUR_CODES:", ":"),
)
@pytest.mark.parametrize("trust", [True, False])
@pytest.mark.parametrize("code", [0, 70, "'x'"])
def test_R09_an_error_with_an_exit_code_of_its_own_is_the_plugins(
    world: Any, code: object, trust: bool
) -> None:
    raises = f"""\
        from robid_core.errors import RobidError

        class Odd(RobidError):
            exit_code = {code}

        raise Odd("mine")
"""
    world.edit(FIT, FIT + raises)
    with pytest.raises(PluginError, match=r"'strange\.estimate' .*failed: .*: mine"):
        world.run(last="fit", trust_plugins=trust)


def test_a_result_whose_class_has_no_name_is_told(world: Any) -> None:
    world.edit(FIT, FIT + "        return type('', (), {})()\n")
    with pytest.raises(PluginError, match=r"R12: 'strange\.estimate' .* returned "):
        world.run(last="fit")


def test_a_page_that_is_empty_or_no_text_is_no_page() -> None:
    with pytest.raises(TypeError, match=r"Report\.html is a text, not int"):
        Report(html=5)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=r"Report\.html is empty"):
        Report(html="")
