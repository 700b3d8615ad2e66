"""Every way in which a command can fail has its exit code, and only bugs leave a report."""

from __future__ import annotations

import errno
from pathlib import Path

import pytest
import typer
from faults.fault import fault

from robid_core import errors
from robid_core.commands.failures import guarded


def failing(error: BaseException, debug: bool = False) -> int:
    def command() -> None:
        raise error

    with pytest.raises(SystemExit) as end:
        guarded(command, debug)()
    assert isinstance(end.value.code, int)
    return end.value.code


@pytest.mark.parametrize(
    ("cls", "code"),
    [
        (errors.ConfigurationError, 2),
        (errors.MotionRefused, 3),
        (errors.MotionAborted, 4),
        (errors.DataRejected, 5),
        (errors.PoorExcitation, 5),
        (errors.NotTrustworthy, 6),
        (errors.NotIdentifiable, 6),
        (errors.StoreError, 7),
        (errors.PluginError, 8),
    ],
)
def test_each_error_of_robid_is_its_message_and_its_code(
    cls: type[errors.RobidError], code: int, capsys: pytest.CaptureFixture[str]
) -> None:
    assert failing(cls("acquire: drive 2 is silent; is it on?")) == code
    out, err = capsys.readouterr()
    assert (out, err) == ("", "acquire: drive 2 is silent; is it on?\n")


def test_an_interruption_is_130(capsys: pytest.CaptureFixture[str]) -> None:
    assert failing(KeyboardInterrupt()) == 130
    assert capsys.readouterr().err == "interrupted\n"


def test_a_bug_is_70_and_leaves_a_report(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    assert failing(ZeroDivisionError("division by zero")) == 70
    (report,) = tmp_path.iterdir()
    err = capsys.readouterr().err
    assert "Traceback" not in err
    assert str(report) in err
    assert "--debug shows the traceback" in err
    assert "Traceback" in report.read_text()
    assert "ZeroDivisionError" in report.read_text()


def test_a_report_that_cannot_be_saved_is_no_second_failure(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "none"))
    assert failing(ZeroDivisionError()) == 70
    assert "no report could be saved" in capsys.readouterr().err


def test_debug_shows_the_traceback(capsys: pytest.CaptureFixture[str]) -> None:
    assert failing(ZeroDivisionError(), debug=True) == 70
    assert "Traceback" in capsys.readouterr().err


@pytest.mark.parametrize("error", [typer.Exit(3), typer.Abort(), typer.BadParameter("x"), BrokenPipeError()])
def test_what_the_parser_handles_is_left_to_it(error: Exception) -> None:
    def command() -> None:
        raise error

    with pytest.raises(type(error)):
        guarded(command, False)()


@fault(
    "R04",
    sees="exit 7: what the system refuses, wherever that happens, and the file; no report of a mistake of robid",
    mutant=(
        "robid_core/commands/failures.py",
        "            refused = error if isinstance(error, OSError) and error.errno else None\n",
        "            refused = None\n",
    ),
)
def test_R04_what_the_system_refuses_is_no_bug(capsys: pytest.CaptureFixture[str]) -> None:
    assert failing(OSError(errno.ENAMETOOLONG, "File name too long", "a" * 5000)) == 7
    assert capsys.readouterr().err == (
        f"{'a' * 200}...: File name too long; the system refuses it; --debug shows where\n"
    )
    assert failing(OSError("a library's own words")) == 70


def test_the_guard_keeps_signature_and_result() -> None:
    def command(number: int) -> int:
        """Help."""
        return number + 1

    wrapped = guarded(command, False)
    assert wrapped(2) == 3
    assert wrapped.__doc__ == "Help."


def test_memory_that_ends_without_a_word_is_told_with_what_may_limit_it(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert failing(MemoryError()) == 2
    assert (
        "not enough memory: none is left, or a limit is set (ulimit -v); ask for less"
        in capsys.readouterr().err
    )


def test_a_current_folder_that_is_gone_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    gone = tmp_path / "gone"
    gone.mkdir()
    monkeypatch.chdir(gone)
    gone.rmdir()
    assert failing(FileNotFoundError(errno.ENOENT, "No such file or directory")) == 7
    assert "the current folder is gone; go to one that exists" in capsys.readouterr().err
