"""What a third party's code does while a pipeline is read or planned ends no command without a word."""

from __future__ import annotations

import errno
import os
import tempfile
import threading
from typing import Any

import pytest
from faults.fault import fault
from oracles.quick_start import ROBID, run

from robid_core.commands import main
from robid_core.registry import registry

TRIAL = "robid_core/commands/trial.py"
REGISTRY = "robid_core/registry.py"
ENDED = "        except EOFError:\n"
COUNT = "class Where(CandidateDesign):\n"
SETTINGS = COUNT + "    def problems_with(self, robot):\n        {}\n\n"
FORESEEN = COUNT + "    def plan_lines(self, upstream):\n        {}\n\n"
BIAS = "BIAS = 0.0  # tests edit this line\n"
TRUTH = '        return Truth("strange", ("gear_stiffness.axis_1",), np.array([self.stiffness]))\n'
ELSEWHERE = f"os.getpid() == {os.getpid()} or os._exit(0)"  # here it would end all tests with success
CRASH = "import ctypes; ctypes.string_at(0)"


def told(world: Any, capsys: Any, *words: str) -> tuple[int, str, str]:
    """Exit code and words of a command on the pipeline, in this process and with this world's plugins."""
    return heard(capsys, *words, str(world.file))


def heard(capsys: Any, *words: str) -> tuple[int, str, str]:
    """Return the same of a command that reads no pipeline."""
    registry.cache_clear()
    try:
        with pytest.raises(SystemExit) as end:
            main(words)
    finally:
        registry.cache_clear()
    return int(end.value.code or 0), *capsys.readouterr()


@fault(
    "R09",
    sees="exit 8 of validate, plan and run: a plugin's settings ended the process with exit code 0",
    mutant=(
        "robid_core/commands/arguments.py",
        "    if plugins := foreign_plugins(file):\n",
        "    if False:\n",
    ),
)
@pytest.mark.parametrize("command", ["validate", "plan", "run"])
def test_R09_settings_of_a_plugin_that_end_the_process_are_told(
    world: Any, capsys: Any, command: str
) -> None:
    world.edit(COUNT, SETTINGS.format(ELSEWHERE))
    code, out, err = told(world, capsys, command)
    assert (code, out) == (8, "")
    assert (
        "R09: while the pipeline was read, the code of robid_strange_stages 1.0 ended the process with exit code 0"
        in err
    )
    assert not (world.project / "runs").exists()


@fault(
    "R09",
    sees="exit 8 of validate, plan and run: a plugin's settings raised SystemExit, which would be exit 0",
    mutant=(TRIAL, "        if isinstance(value, Exception) or (", "        if True or ("),
)
@pytest.mark.parametrize("command", ["validate", "plan", "run"])
def test_R09_settings_of_a_plugin_that_ask_to_exit_are_told(world: Any, capsys: Any, command: str) -> None:
    world.edit(COUNT, SETTINGS.format("raise SystemExit(0)"))
    code, out, err = told(world, capsys, command)
    assert (code, out) == (8, "")
    assert "while the pipeline was read, the code of robid_strange_stages 1.0 raised SystemExit" in err


@fault(
    "R14",
    sees="exit 8 of validate and run: a plugin raised KeyboardInterrupt when imported; it was exit 130",
    mutant=(
        TRIAL,
        "(isinstance(value, KeyboardInterrupt) and may_be_requested())",
        "isinstance(value, KeyboardInterrupt)",
    ),
)
@pytest.mark.parametrize("command", ["validate", "run"])
def test_R14_a_plugin_that_interrupts_itself_is_told(world: Any, capsys: Any, command: str) -> None:
    at_import(world, "raise KeyboardInterrupt")
    code, out, err = told(world, capsys, command)
    assert (code, out) == (8, "")
    assert "the code of robid_strange_stages 1.0 raised KeyboardInterrupt, which no plugin may" in err


@fault(
    "R09",
    sees="exit 8 of validate, one sentence: a plugin took the standard streams away; it was exit 70 without a word",
    mutant=(
        TRIAL,
        "        sys.stdout.flush()\n        sys.stderr.flush()\n        there.send(message)\n",
        "        there.send(message)\n        sys.stdout.flush()\n        sys.stderr.flush()\n",
    ),
)
def test_R09_a_plugin_that_takes_the_streams_away_is_told(world: Any) -> None:
    at_import(world, "import sys; sys.stdout = sys.stderr = None")
    done = run([*ROBID, "validate", str(world.file)], env=world.environment)
    assert (done.returncode, done.stdout) == (8, "")
    assert len(done.stderr.splitlines()) == 1, done.stderr
    assert "the code of robid_strange_stages 1.0 ended the process" in done.stderr


@fault(
    "R09",
    sees="exit 8 of validate and run, one sentence: a plugin closed standard streams; a run went on unseen",
    mutant=(TRIAL, "    if _standard_files() != streams:", "    if False:"),
)
@pytest.mark.parametrize("command", ["validate", "run"])
@pytest.mark.parametrize(
    "code", ["os.closerange(0, 3)", "os.dup2(os.open(os.devnull, os.O_RDWR), 2)"], ids=["closed", "replaced"]
)
def test_R09_a_plugin_that_closes_standard_streams_is_told(world: Any, command: str, code: str) -> None:
    at_import(world, f"import os; {code}")
    done = run([*ROBID, command, str(world.file)], env=world.environment)
    assert (done.returncode, done.stdout) == (8, "")
    assert len(done.stderr.splitlines()) == 1, done.stderr
    assert "robid_strange_stages 1.0 closed or replaced a standard stream (file 0, 1 or 2)" in done.stderr


@fault(
    "R09",
    sees="exit 8 of validate, one sentence: a plugin's settings closed every file there is",
    mutant=(TRIAL, "        os._exit(1)\n", "        raise\n"),
)
def test_R09_settings_of_a_plugin_that_close_files_of_others_are_told(world: Any) -> None:
    """In a process of its own: a copy of the tests that is not ended there would go on testing."""
    world.edit(COUNT, SETTINGS.format("os.closerange(3, 256)"))
    done = run([*ROBID, "validate", str(world.file)], env=world.environment)
    assert (done.returncode, done.stdout) == (8, "")
    assert len(done.stderr.splitlines()) == 1, done.stderr
    assert (
        "while the pipeline was read, the code of robid_strange_stages 1.0 ended the process" in done.stderr
    )


def at_import(world: Any, line: str) -> None:
    """Let the package do something when it is imported."""
    world.edit(BIAS, f"{BIAS}{line}\n")


@fault(
    "R14",
    sees="the plugin cannot be imported: SystemExit, as a script ends; it was exit 0 of a run with nothing made",
    mutant=(
        "robid_core/registry.py",
        "        except BaseException as error:  #",
        "        except Exception as error:  #",
    ),
)
def test_R14_a_plugin_that_is_a_script_is_told(world: Any, capsys: Any) -> None:
    at_import(world, "raise SystemExit(0)")
    code, _, err = told(world, capsys, "run")
    assert code == 2
    assert "cannot be imported: SystemExit: 0" in err


@fault(
    "R14",
    sees="a plugin whose package lost its METADATA is one of an unknown package, known by its content; the run goes on",
    mutant=(REGISTRY, """found["Name"] or UNKNOWN""", """found["Name"]"""),
)
@fault(
    "R14",
    sees="the same where METADATA is no text",
    mutant=(REGISTRY, "(KeyError, FileNotFoundError, UnicodeDecodeError)", "(KeyError, FileNotFoundError)"),
)
def test_R14_a_plugin_of_a_package_with_damaged_metadata_runs(world: Any) -> None:
    (metadata,) = world.site.glob("*.dist-info/METADATA")
    for damage in (b"", b"\xff\xfe Name: robid_strange_stages\n"):
        metadata.write_bytes(damage)
        plugin = world.registry().find("robid.stages", "strange.where")
        assert (plugin.distribution, plugin.version) == ("unknown", "0")
        assert world.run(last="where").exit_code == 0


@fault(
    "R14",
    sees="exit 8 of every command: the package whose list of plugins cannot be read; install it again",
    mutant=(
        REGISTRY,
        "    except Exception as error:  # whatever",
        "    except OSError as error:  # whatever",
    ),
)
def test_R14_a_damaged_list_of_plugins_is_told_with_its_package(world: Any, capsys: Any) -> None:
    (points,) = world.site.glob("*.dist-info/entry_points.txt")
    points.write_bytes(b"[robid.stages]\n\xff")
    code, _, err = told(world, capsys, "validate")
    assert code == 8
    assert "entry_points.txt) of a package cannot be read: robid_strange_stages; install it" in err


def test_a_plugin_whose_error_at_import_has_no_text_is_told(world: Any, capsys: Any) -> None:
    at_import(world, "raise type('Mute', (Exception,), {'__str__': lambda self: 1 / 0})")
    code, _, err = told(world, capsys, "validate")
    assert code == 2
    assert "cannot be imported: Mute: (its text cannot be shown: ZeroDivisionError)" in err


@fault(
    "R14",
    sees="`robid stages`: the line of a plugin that ended its process when it was imported, and all other plugins",
    mutant=("robid_core/commands/stages.py", "loaded_apart(plugin, checked)", "checked(plugin.load())"),
)
def test_R14_a_list_of_plugins_survives_one_that_ends_its_process(world: Any, capsys: Any) -> None:
    at_import(world, ELSEWHERE)
    code, out, err = heard(capsys, "stages")
    assert (code, err) == (0, "")
    lines = out.splitlines()
    (own,) = (line for line in lines if line.startswith("strange.estimate"))
    assert (
        "FAILS: R09: while strange.estimate was imported, the code of robid_strange_stages 1.0 ended" in own
    )
    assert any(line.startswith("friction.lugre") and "FAILS" not in line for line in lines)


@fault(
    "R14",
    sees="exit 8 of `robid stages NAME`: what the plugin did when it was imported",
    mutant=(
        "robid_core/commands/stages.py",
        "loaded_apart(plugin, functools.partial(explain, plugin))",
        "explain(plugin, plugin.load())",
    ),
)
def test_R14_a_plugin_that_ends_its_process_is_not_explained(world: Any, capsys: Any) -> None:
    at_import(world, ELSEWHERE)
    code, _, err = heard(capsys, "stages", "strange.estimate")
    assert code == 8
    assert "ended the process with exit code 0" in err


@fault(
    "R14",
    sees="exit 8 of `robid doctor`: FAIL at the plugin that ends its process, and all other findings",
    mutant=(
        "robid_core/commands/doctor.py",
        "loaded_apart(plugin, functools.partial(check_registered, plugin))",
        "check_registered(plugin, plugin.load())",
    ),
)
def test_R14_a_doctor_survives_a_plugin_that_ends_its_process(world: Any, capsys: Any) -> None:
    at_import(world, ELSEWHERE)
    code, out, _ = heard(capsys, "doctor")
    assert code == 8
    assert "FAIL plugin robid.stages R09: while strange.estimate was imported" in out
    assert "compiled kernels are kept in" in out


@fault(
    "R14",
    sees="exit 8 of `robid schema`: whose code ended the process",
    mutant=(
        "robid_core/commands/schema.py",
        'in_a_copy(making, foreign, "the schema was made")',
        "making()",
    ),
)
def test_R14_a_schema_says_which_plugin_ends_its_process(world: Any, capsys: Any) -> None:
    at_import(world, ELSEWHERE)
    code, _, err = heard(capsys, "schema")
    assert code == 8
    assert "while the schema was made, the code of" in err


@fault(
    "R09",
    sees="exit 8 and the line of a plugin that asks to exit in the run's own process (drives, effects)",
    mutant=(
        "robid_core/commands/failures.py",
        "            raise SystemExit(PluginError.exit_code) from error\n",
        "            raise\n",
    ),
)
def test_R09_drives_that_ask_to_exit_are_told(world: Any, capsys: Any) -> None:
    world.edit(TRUTH, "        raise SystemExit(0)\n" + TRUTH)
    code, _, err = told(world, capsys, "run", "--trust-plugins", "--until", "fit")
    assert code == 8
    assert "__init__.py:" in err
    assert "in truth, raised SystemExit" in err


@fault(
    "R09",
    sees="exit 8 of plan: what a stage foresees crashed with SIGSEGV, and the line of the plugin where it did",
    mutant=(TRIAL, "    faulthandler.enable(crash, all_threads=False)\n", ""),
)
def test_R09_a_crash_of_what_a_stage_foresees_is_told_with_its_line(world: Any, capsys: Any) -> None:
    world.edit(COUNT, FORESEEN.format(CRASH))
    code, _, err = told(world, capsys, "plan", "--dry")
    assert code == 8
    assert "crashed with SIGSEGV at" in err
    assert "__init__.py:" in err


@fault(
    "R09",
    sees="exit 8 of plan: which stage and plugin cannot say what it foresees, and why",
    mutant=(
        "robid_core/commands/plan.py",
        "        except Exception as error:\n",
        "        except KeyError as error:\n",
    ),
)
def test_R09_an_error_of_what_a_stage_foresees_is_told(world: Any, capsys: Any) -> None:
    world.edit(COUNT, FORESEEN.format('raise ValueError("no idea")'))
    code, _, err = told(world, capsys, "plan", "--dry")
    assert code == 8
    assert (
        "stage where: R09: 'strange.where' (robid_strange_stages 1.0) cannot say what it foresees: ValueError: no idea"
        in err
    )


@fault(
    "R04",
    sees="nothing where no folder for temporary files can be written: a pipeline is read without one",
    mutant=(TRIAL, 'os.memfd_create("robid-crash")', "__import__('tempfile').TemporaryFile().fileno()"),
)
def test_R04_plugins_of_others_need_no_temporary_file(
    world: Any, capsys: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", None)
    monkeypatch.setattr(tempfile, "_candidate_tempdir_list", list)
    with pytest.raises(FileNotFoundError):
        tempfile.gettempdir()
    assert told(world, capsys, "validate")[0] == 0


@fault(
    "R04",
    sees="exit 7: the system starts no process for the code of third parties, and why",
    mutant=(
        TRIAL,
        'failures_named("read plugins of third parties in a copy of this process", None):',
        "contextlib.nullcontext():",
    ),
)
def test_R04_a_system_that_starts_no_process_is_told(
    world: Any, capsys: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused() -> int:
        raise BlockingIOError(errno.EAGAIN, "Resource temporarily unavailable")

    monkeypatch.setattr(os, "fork", refused)
    code, _, err = told(world, capsys, "validate")
    assert code == 7
    assert (
        "cannot read plugins of third parties in a copy of this process: Resource temporarily unavailable"
        in err
    )


@fault(
    "Y05",
    sees="exit 2: a pipe or a device is no file; it was waited for without end",
    mutant=("robid_core/pipeline/pipeline.py", "not (file.is_file() or file.is_dir()):", "False:"),
)
def test_Y05_a_pipeline_is_a_file_and_no_pipe(world: Any, capsys: Any) -> None:
    world.file.unlink()
    os.mkfifo(world.file)
    writer = os.open(world.file, os.O_RDWR)  # or a wrong robid would wait for ever for one
    os.set_blocking(writer, False)
    threading.Timer(5.0, os.close, (writer,)).start()
    code, _, err = told(world, capsys, "validate")
    assert code == 2
    assert "pipeline.yaml: is no file; name a pipeline file" in err


def test_a_mistake_in_the_file_is_told_as_ever_where_plugins_of_others_are_named(
    world: Any, capsys: Any
) -> None:
    world.file.write_text(world.file.read_text().replace("seed:", "sed:"), "utf-8")
    code, _, err = told(world, capsys, "validate")
    assert code == 2
    assert "did you mean" in err
