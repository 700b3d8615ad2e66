"""What is shown ends no run: a full, a closed and a broken stream, and a listener that fails."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from faults.fault import fault

from robid_core.pipeline import Pipeline
from robid_core.run import RunOptions, Silence, run_pipeline

ROBID = [sys.executable, "-c", "from robid_core.commands import main; main()"]
PIPELINE = """\
robid: 1
name: shown
seed: 1
robot: one_axis
stages:
  where: {use: design.candidates, with: {count: 2}}
"""
STREAMS = "robid_core/standard_streams.py"


@pytest.fixture(name="project")
def project_folder(tmp_path: Path) -> Path:
    (tmp_path / "pipeline.yaml").write_text(PIPELINE, encoding="utf-8")
    return tmp_path


def robid(project: Path, redirection: str, *words: str, unbuffered: str = "1") -> int:
    """Run a command under a shell with its streams redirected; return its exit code."""
    environment = {**os.environ, "PYTHONUNBUFFERED": unbuffered}
    command = ["bash", "-c", f'"$@" {redirection}', "bash", *ROBID, *words]
    return subprocess.run(
        command, cwd=project, env=environment, capture_output=True, check=False, timeout=60
    ).returncode


def status(project: Path) -> str:
    """Return what the manifest says of the run."""
    found = json.loads((project / "runs" / "shown" / "manifest.json").read_text(encoding="utf-8"))
    assert found["stages"]["where"]["outcome"] in ("made", "same")
    return str(found["status"])


@fault(
    "R03",
    sees="nothing where the log's disk is full, and the run goes on: exit 0",
    mutant=(
        STREAMS,
        "        except OSError as error:\n            self.lost",
        "        except KeyError as error:\n            self.lost",
    ),
)
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full, a disk that is always full")
def test_R03_a_full_disk_behind_the_screen_ends_no_run(project: Path) -> None:
    assert robid(project, "> /dev/full 2>&1", "run", "-v", unbuffered="") == 0
    assert status(project) == "done"
    bad = PIPELINE.replace("design.candidates", "design.candidate")
    (project / "bad.yaml").write_text(bad, encoding="utf-8")
    assert (
        robid(project, "2> /dev/full", "run", "bad.yaml", unbuffered="") == 2
    )  # also what fails keeps its code


@fault(
    "R03",
    sees="nothing where stderr is closed, and the run goes on; no file gets what was meant for the screen",
    mutant=("robid_core/commands/__init__.py", "        open_closed_streams()\n", ""),
)
def test_R03_a_closed_screen_ends_no_run_and_no_file_takes_its_place(project: Path) -> None:
    script = (
        "import os, sys; from robid_core.commands import main\n"
        "try: main()\n"
        "finally: print(*(os.path.realpath(f'/proc/self/fd/{n}') for n in (0, 1, 2)), file=open('fds', 'w'))"
    )
    command = ["bash", "-c", '"$@" <&- >&- 2>&-', "bash", sys.executable, "-c", script, "run", "-v"]
    assert subprocess.run(command, cwd=project, check=False, timeout=60).returncode == 0
    assert status(project) == "done"
    assert (project / "fds").read_text().split() == [os.devnull] * 3


def test_a_reader_who_went_away_ends_no_run(project: Path) -> None:
    assert robid(project, "2>&1 | true; exit ${PIPESTATUS[0]}", "run", "-v") == 0
    assert status(project) == "done"


@fault(
    "R03",
    sees="the log: the run could not be shown; the run goes on",
    mutant=("robid_core/run/runner.py", "Shielded(listener or Silence())", "(listener or Silence())"),
)
def test_R03_a_listener_that_fails_ends_no_run(project: Path) -> None:
    class Broken(Silence):
        def begin(self, *_: Any) -> None:
            raise OSError(28, "No space left on device")

        def end(self, *_: Any) -> None:
            raise ValueError("I/O operation on closed file")

    result = run_pipeline(Pipeline.load(project / "pipeline.yaml"), RunOptions(jobs=1), Broken())
    assert result.outcomes == {"where": "made"}
    log = (project / "runs" / "shown" / "log.txt").read_text(encoding="utf-8")
    assert log.count("the run could not be shown") == 2


@fault(
    "R03",
    sees="exit 7 of a command whose words are its result, and why they could not be written: no space left",
    mutant=(
        "robid_core/commands/__init__.py",
        "        code = _exit_code(arguments) or _undelivered()\n",
        "        code = _exit_code(arguments)\n",
    ),
)
@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_R03_a_result_that_could_not_be_printed_is_no_success(project: Path, unbuffered: str) -> None:
    assert robid(project, ">/dev/full", "stages", "design.candidates", unbuffered=unbuffered) == 7
    assert robid(project, ">/dev/full", "run", "pipeline.yaml", unbuffered=unbuffered) == 0  # it is stored
    assert status(project) == "done"


@fault(
    "R03",
    sees="nothing where a pipe is closed, as by `head -1`: exit 0, and no traceback",
    mutant=(
        STREAMS,
        "    return None if isinstance(error, BrokenPipeError) else error\n",
        "    return error\n",
    ),
)
def test_R03_who_closes_the_pipe_wanted_no_more(project: Path) -> None:
    environment = {**os.environ, "PYTHONUNBUFFERED": "1"}
    script = '"$@" | true; exit ${PIPESTATUS[0]}'
    done = subprocess.run(
        ["bash", "-c", script, "bash", *ROBID, "stages", "design.candidates"],
        cwd=project,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")
