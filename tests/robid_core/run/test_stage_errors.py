"""What goes wrong inside a stage is told with the stage's name, and nothing wrong is stored."""

from __future__ import annotations

from typing import Any

import pytest
from faults.fault import fault

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
