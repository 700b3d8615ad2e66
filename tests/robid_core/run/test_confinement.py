"""A third party's stage has a process of its own: its end is told, its state ends with it, nothing else changes."""

from __future__ import annotations

import json
import locale
import logging
import os
import re
import subprocess
import time
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from faults.fault import fault

from robid_core.errors import DataRejected, PluginError
from robid_core.run import Silence
from robid_core.run.process_state import PARTS, state_taken_back

CONFINE = "robid_core/run/confine.py"
CALLING = "robid_core/run/calling.py"
DEFAULT = "        wanted = limited or (foreign and not self._options.trust_plugins)\n"
RUNNER = "robid_core/run/runner.py"
FIT = '        called("fit")\n'


class Ear(Silence):
    """Hears notes and progress."""

    def __init__(self) -> None:
        self.notes: list[str] = []
        self.told: list[tuple[str, float, float, str]] = []

    def note(self, text: str) -> None:
        self.notes.append(text)

    def progress(self, stage: str, done: float, total: float, note: str) -> None:
        self.told.append((stage, done, total, note))


def confined(world: Any, *overrides: str, **options: Any) -> Any:
    """Run as a user does who says nothing about trust."""
    return world.run(*overrides, trust_plugins=False, **options)


@fault(
    "R16",
    sees="the same artifacts, progress and log lines, whether a stage has a process of its own or not",
    mutant=("robid_core/run/confined_stage.py", '        self._line.send("log", record)\n', "        pass\n"),
)
def test_R16_a_confined_stage_gives_the_same_bytes_and_has_all_that_a_context_lends(world: Any) -> None:
    world.run()
    before = world.hashes()
    lent = (
        "        import multiprocessing; run = multiprocessing.parent_process().pid\n"
        '        Path(os.environ["STRANGE_CALLS"]).write_text(f"{context.scratch.name} {run}\\n")\n'
    )
    world.edit('        called("frf")\n', '        context.progress(1, 3, "far")\n' + lent)
    ear = Ear()
    result = confined(world, listener=ear, jobs=2, last="fit", force=("frf", "fit"))
    assert (result.outcomes["frf"], result.outcomes["fit"]) == ("same", "same")
    assert world.hashes() == before
    assert ("frf", 1, 3, "far") in ear.told
    assert world.ran() == ["raw", str(os.getpid()), "fit"]
    log = (world.folder / "log.txt").read_text()
    assert log.count("robid.fit: fitting converged") == 2
    assert list((world.folder / "store" / "temporary").iterdir()) == []


@fault(
    "R09",
    sees="exit 8: stage, plugin and version; its code ended its process with exit code 0",
    mutant=(CALLING, DEFAULT, "        wanted = limited\n"),
)
def test_R09_a_plugin_that_ends_its_process_ends_no_run(world: Any) -> None:
    world.run(last="frf")
    world.edit(FIT, FIT + "        os._exit(0)\n")
    with pytest.raises(PluginError) as caught:
        confined(world, last="fit")
    assert str(caught.value) == (
        "stage fit: 'strange.estimate' (robid_strange_stages 1.0): R09: its code ended its process with exit code 0 "
        "before there was a result; nothing was stored; a plugin returns or raises; it calls no os._exit and "
        "closes only its own files; tell its author"
    )
    assert caught.value.exit_code == 8


@fault(
    "R09",
    sees="exit 8: stage, plugin and version; no traceback on the screen where a stage closed every file there is",
    mutant=(
        "robid_core/run/confined_stage.py",
        "            os._exit(1)\n",
        "            raise\n",
    ),
)
def test_R09_a_plugin_that_closes_files_of_others_is_told(world: Any, capfd: Any) -> None:
    world.run(last="frf")
    world.edit(FIT, FIT + "        os.closerange(3, 256)\n")
    with pytest.raises(
        PluginError, match="R09: its code ended its process with exit code 1 .* only its own files"
    ):
        confined(world, last="fit")
    assert capfd.readouterr().err == ""


@fault(
    "R09",
    sees="exit 8: stage, plugin and class of what it raised, also what is no Exception (cancelled, skipped)",
    mutant=(
        "robid_core/run/guard.py",
        "    except BaseException as error:  #",
        "    except (Exception, SystemExit) as error:  #",
    ),
)
@pytest.mark.parametrize("trust", [True, False])
def test_R09_whatever_a_plugin_raises_is_told(world: Any, trust: bool) -> None:
    world.edit(FIT, FIT + "        import asyncio; raise asyncio.CancelledError('no more')\n")
    with pytest.raises(PluginError, match=r"stage fit: .* failed: CancelledError: no more"):
        world.run(last="fit", trust_plugins=trust)


@fault(
    "R09",
    sees="exit 8: crashed with SIGSEGV, and the line of the plugin where it did",
    mutant=(CONFINE, "{last_frame(crash_file(self._job))}", ""),
)
def test_R09_a_segmentation_fault_is_told_with_its_line(world: Any) -> None:
    world.run(last="frf")
    world.edit(FIT, FIT + "        import ctypes; ctypes.string_at(0)\n")
    with pytest.raises(PluginError) as caught:
        confined(world, last="fit")
    message = str(caught.value)
    assert "R09: its code crashed with SIGSEGV at " in message
    assert "in string_at" in message
    assert '"status": "failed"' in (world.folder / "manifest.json").read_text()
    assert list((world.folder / "store" / "temporary").iterdir()) == []


@fault(
    "R09",
    sees="the next run: the run before was cut off while stage fit was made",
    mutant=(RUNNER, "        self.manifest.making = node.name\n", ""),
)
def test_R09_the_next_run_tells_how_the_last_one_ended(world: Any) -> None:
    world.edit(FIT, FIT + "        os._exit(0)\n")
    assert world.elsewhere(last="fit").returncode == 0  # trusted: nobody is left who could say otherwise
    assert json.loads((world.folder / "manifest.json").read_text())["status"] == "running"
    world.edit("        os._exit(0)\n", "        raise ValueError('no weather')\n")
    ears = [Ear(), Ear(), Ear()]
    with pytest.raises(PluginError):
        world.run(last="fit", listener=ears[0])
    world.edit("        raise ValueError('no weather')\n", "")
    confined(world, last="fit", listener=ears[1])  # this process has the code of before
    world.run(last="fit", listener=ears[2])
    cut, failed, done = ([note for note in ear.notes if note.startswith("the run before")] for ear in ears)
    assert "was cut off while stage fit was made: its process was killed, crashed or ended itself" in cut[0]
    assert failed[0].startswith(
        "the run before failed: stage fit: 'strange.estimate' (robid_strange_stages 1.0) failed"
    )
    assert done == []


AWKWARD = """\
        class Awkward(BASE):
            def __init__(self, a, b): super().__init__(f"{a} and {b}")
        raise Awkward("rain", "snow")
"""


@pytest.mark.parametrize(
    ("base", "kind", "words"),
    [
        ("Exception", PluginError, "failed: Awkward: rain and snow"),
        ("DataRejected", DataRejected, "^stage fit: rain and snow"),
    ],
)
def test_an_exception_that_cannot_travel_keeps_class_and_words(
    world: Any, base: str, kind: type[Exception], words: str
) -> None:
    world.run(last="frf")
    world.edit("    MotionRefused,\n", "    DataRejected,\n    MotionRefused,\n")
    world.edit(FIT, FIT + AWKWARD.replace("BASE", base))
    with pytest.raises(kind, match=words):
        confined(world, last="fit")


def test_what_breaks_the_contract_is_told_as_in_the_runs_own_process(world: Any) -> None:
    world.run(last="frf")
    told = []
    for trust in (True, False):
        with pytest.raises(PluginError, match="R12: .* returned a list") as caught:
            world.run("stages.fit.with.outcome=a list", last="fit", trust_plugins=trust)
        told.append(str(caught.value))
    assert told[0] == told[1]


def test_hardware_is_never_confined(world: Any) -> None:
    world.say("{use: strange}", "{use: strange_hardware}")
    world.edit('        called("acquire")\n', '        called(f"acquire{os.getpid()}")\n')
    world.run(last="where")
    confined(world, last="acquire", at_the_robot=True)
    assert world.ran()[-1] == f"acquire{os.getpid()}"


STATE = """\
        import locale, threading, warnings
        from threadpoolctl import threadpool_info, threadpool_limits
        mask = os.umask(0); os.umask(mask)
        state = [np.geterr(), mask, os.getcwd(), locale.setlocale(locale.LC_ALL), sorted(os.environ), warnings.filters]
        called(repr([*state, [entry["num_threads"] for entry in threadpool_info()]]).replace(" ", ""))
        called(str([thread.name for thread in threading.enumerate() if thread.name == "left"]))
"""
CHANGE = """\
        np.seterr(all="raise"); os.umask(0o007); os.chdir("/"); warnings.simplefilter("ignore")
        locale.setlocale(locale.LC_ALL, OTHER); os.environ["STRANGE_STATE"] = "left"; threadpool_limits(2)
        threading.Thread(target=time.sleep, args=(HOLD,), name="left").start()
"""


@fault(
    "R16",
    sees="a stage of a third party leaves no numpy error mode, umask, folder, locale or thread to the next",
    mutant=(CALLING, DEFAULT, "        wanted = limited\n"),
)
@pytest.mark.parametrize("trust", [False, True])
def test_R16_what_a_stage_does_to_its_process_reaches_no_other_stage(world: Any, trust: bool) -> None:
    other = "C.UTF-8" if locale.setlocale(locale.LC_ALL) == "C" else "C"
    change = CHANGE.replace("OTHER", repr(other)).replace("HOLD", "2" if trust else "1000")
    world.edit(
        '        called("where")\n        return Configurations(robot.axis_names, context',
        STATE + change + "        return Configurations(robot.axis_names, context",
    )
    world.edit('        called("acquire")\n', STATE)
    done = world.elsewhere(trust_plugins=trust, last="acquire")
    assert done.returncode == 0, done.stderr
    before, none, after, left = world.ran()
    assert before == after
    assert (none, left) == ("[]", "['left']" if trust else "[]")
    log = (world.folder / "log.txt").read_text()
    told = (
        "R16: it changed numpy's error mode, umask, working folder, locale, environment variables, filters of"
    )
    assert (told in log) == trust
    assert ("R16: it left threads running, which go on beside the next stages: left" in log) == trust


@fault(
    "R16",
    sees="the log: what a stage in the run's process changed of it, taken back",
    mutant=(
        "robid_core/run/process_state.py",
        "            PARTS[name].put(before[name])\n",
        "            pass\n",
    ),
)
def test_R16_state_is_taken_back_also_after_a_failure(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    before = {name: part.ask() for name, part in PARTS.items()}

    def fail() -> None:
        np.seterr(all="raise")
        os.umask(0o007)
        os.chdir("/")
        os.environ["STRANGE_STATE"] = "left"
        warnings.simplefilter("ignore")
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError), state_taken_back(logging.getLogger("robid.test")):
        fail()
    assert {name: part.ask() for name, part in PARTS.items()} == before


@fault(
    "R16",
    sees="no stage is blamed where somebody moves the working folder while it runs",
    mutant=(
        "robid_core/run/process_state.py",
        "        with contextlib.suppress(FileNotFoundError):",
        "        with contextlib.nullcontext():",
    ),
)
def test_R16_a_working_folder_that_is_gone_is_no_fault_of_a_stage(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    here = tmp_path / "here"
    here.mkdir()
    monkeypatch.chdir(here)
    with state_taken_back(logging.getLogger("robid.test")):
        here.rename(tmp_path / "there")
    assert Path.cwd() == tmp_path / "there"


@fault(
    "R09",
    sees="exit 8 at once: its code ended its process, though a process that it has left goes on",
    mutant=(
        CONFINE,
        "        ended = self._process.exitcode not in (None, SERVER_GONE)",
        "        ended = False",
    ),
)
def test_R09_a_process_that_a_stage_leaves_behind_does_not_hold_the_run(world: Any) -> None:
    leaves = """\
        if not os.fork():
            os.setsid()
            time.sleep(20)
            os._exit(0)
        os._exit(5)
"""
    world.run(last="frf")
    world.edit(FIT, FIT + leaves)
    began = time.monotonic()
    with pytest.raises(PluginError, match="R09: its code ended its process with exit code 5"):
        confined(world, last="fit")
    assert time.monotonic() - began < 15


@fault(
    "R09",
    sees="exit 8: its code put another program in its place; that program is ended, and not called a lack of memory",
    mutant=(CONFINE, "        elif code is None:", "        elif False:"),
)
def test_R09_a_stage_that_becomes_another_program_is_told(
    world: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("robid_core.run.confine.GONE_S", 0.5)
    world.run(last="frf")
    world.edit(FIT, FIT + "        os.execvp('sleep', ['sleep', '41.75'])\n")
    with pytest.raises(
        PluginError, match="R09: .* no longer answers: its code put another program in its place"
    ):
        confined(world, last="fit")
    assert "sleep 41.75" not in subprocess.run(["ps", "-eo", "args"], capture_output=True, text=True).stdout


@fault(
    "R09",
    sees="nothing on the screen, and the stage's result, where a line of its log cannot be made or sent",
    mutant=(
        "robid_core/run/confined_stage.py",
        "    def handleError(self, record: logging.LogRecord) -> None:",
        "    def unheard(self, record: logging.LogRecord) -> None:",
    ),
)
def test_R09_a_line_of_the_log_that_cannot_be_sent_is_lost_without_a_traceback(world: Any) -> None:
    lines = """\
        context.log.info("%d", "no number")
        context.log.info("a function", extra={"given": lambda: 0})
        context.log.info("a line")
"""
    world.edit(FIT, FIT + lines)
    done = world.elsewhere(last="fit", trust_plugins=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert "robid.fit: a line" in (world.folder / "log.txt").read_text()


STUBBORN = """\
class Stubborn(Exception):
    def __setattr__(self, name, value):
        if name == "robid_frames":
            raise ValueError(name)
        super().__setattr__(name, value)


"""
EMPTIED = """\
        import sys
        for name in list(sys.modules):
            if name.startswith(("robid", "numpy", "json")):
                del sys.modules[name]
        raise ValueError("mine")
"""


@fault(
    "R09",
    sees="exit 8 and no traceback, also where a stage's code leaves too little of Python to tell what it raised",
    mutant=(
        "robid_core/run/confined_stage.py",
        "        with contextlib.suppress(Exception):  # some exceptions let nobody add to them",
        "        with contextlib.nullcontext():",
    ),
)
@pytest.mark.parametrize(
    "code, told", [('        raise Stubborn("mine")\n', "failed: Stubborn: mine"), (EMPTIED, "R09|mine")]
)
def test_R09_no_traceback_of_a_stages_process_is_shown(world: Any, code: str, told: str) -> None:
    world.edit("BIAS = 0.0", f"{STUBBORN}BIAS = 0.0")  # a class that reaches the run
    world.edit(FIT, FIT + code)
    done = world.elsewhere(last="fit", trust_plugins=False)
    assert done.returncode == 8
    assert re.search(told, done.stderr)
    assert "Traceback" not in done.stderr
