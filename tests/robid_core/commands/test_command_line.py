"""The command line as a user meets it: light help, plain messages, exit codes, no traceback for a mistake."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest

from robid_core import __version__
from robid_core.commands import main
from robid_core.commands.app import COMMANDS

MAIN = "from robid_core.commands import main; main()"
HEAVY = {
    "can", "canopen", "cvxpy", "h5py", "jinja2", "llvmlite", "mcap", "numba", "numpy", "pinocchio", "plotly",
    "pydantic", "rich", "ruamel", "scipy",
}  # fmt: skip

GOOD = """\
robid: 1
name: example
seed: 1
robot: one_axis
drives: {use: simulated, with: {plant: one_axis_true}}
stages:
  where: {use: design.candidates, with: {count: 3}}
  excite: {use: excitation.multisine, with: {band_hz: [4, 80], lines: 20, period_s: 2, slow_sine_rad_s: 9}}
  acquire: {use: acquisition.drives, with: {periods: 2, settle_periods: 1}}
  frf: {use: frf.log}
"""


class Done(NamedTuple):
    """How a command ended."""

    returncode: int
    stdout: str
    stderr: str


@pytest.fixture(name="robid")
def command_in_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Callable[..., Done]:
    """Return a function that runs a command line in this process, as the console script does."""

    def run(*arguments: str, folder: Path = tmp_path) -> Done:
        monkeypatch.chdir(folder)
        with pytest.raises(SystemExit) as end:
            main(arguments)
        out, err = capsys.readouterr()
        return Done(int(end.value.code or 0), out, err)

    return run


Robid = Callable[..., Done]


def test_help_names_every_command_and_imports_nothing_heavy(tmp_path: Path) -> None:
    code = (
        "import sys\n"
        "from robid_core.commands import main\n"
        "try:\n    main(['--help'])\n"
        "except SystemExit as end:\n    assert not end.code\n"
        "print(sorted({name.partition('.')[0] for name in sys.modules}), file=sys.stderr)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    for name, summary in COMMANDS.items():
        (line,) = [line for line in done.stdout.splitlines() if line.strip().startswith(f"{name} ")]
        assert summary.startswith(line.split(maxsplit=1)[1])
    assert not HEAVY & set(json.loads(done.stderr.replace("'", '"')))


def test_the_version_is_printed(robid: Robid) -> None:
    assert robid("--version").stdout == f"robid {__version__}\n"


def test_a_good_pipeline_is_valid(robid: Robid, tmp_path: Path) -> None:
    (tmp_path / "pipeline.yaml").write_text(GOOD)
    done = robid("validate")
    assert (done.returncode, done.stdout, done.stderr) == (0, "pipeline.yaml: valid, 4 stages\n", "")


def test_a_wrong_pipeline_is_lines_on_stderr_and_exit_code_2(robid: Robid, tmp_path: Path) -> None:
    (tmp_path / "bad.yaml").write_text(GOOD.replace("count: 3", "count: 0").replace("frf.log", "frf.lgo"))
    done = robid("validate", "bad.yaml", "--set", "seed=-1")
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr.splitlines() == [
        "bad.yaml:7:42: stages.where.with.count: 0 must be greater than 0",
        "bad.yaml:10:9: stages.frf.use: no stage 'frf.lgo'; did you mean 'frf.log'?",
        "--set seed=-1: seed: -1 must be greater than or equal to 0",
    ]


@pytest.mark.parametrize(
    "arguments",
    [
        ("validate", "none.yaml"),
        ("validate", "--nonsense"),
        ("nonsense",),
        ("plan", "none.yaml"),
        ("stages", "frf.lgo"),
        ("records", "none.mat"),
        ("records", "a", "b", "c"),
        ("validate", "--data", "none"),
        ("init", "new", "--robot", "eight_axis"),
        ("adopt", "frf"),
        ("adopt", "none.yaml", "frf"),
        ("adopt", "pipeline.yaml", "frf", "fit"),
    ],
)
def test_a_mistake_is_a_message_and_exit_code_2(
    robid: Robid, tmp_path: Path, arguments: tuple[str, ...]
) -> None:
    (tmp_path / "pipeline.yaml").write_text(GOOD)
    done = robid(*arguments)
    assert done.returncode == 2
    assert done.stderr
    assert "Traceback" not in done.stderr


def test_debug_shows_the_traceback_of_a_mistake_wherever_it_stands(robid: Robid, tmp_path: Path) -> None:
    for arguments in (("--debug", "validate", "none.yaml"), ("validate", "none.yaml", "--debug")):
        done = robid(*arguments)
        assert done.returncode == 2
        assert "Traceback" in done.stderr


def test_plan_prints_wiring_and_robot_time(robid: Robid, tmp_path: Path) -> None:
    (tmp_path / "pipeline.yaml").write_text(GOOD)
    lines = robid("plan").stdout.splitlines()
    assert lines[0] == "example: robot one_axis, drives simulated, seed 1"
    assert "acquire  acquisition.drives    configurations: where, excitation: excite" in lines
    # one experiment per motor: 3 x 2 x 1 x (2 + 1) x 2 s
    assert any(
        "3 configurations x 2 blocks x 1 experiment x 3 periods of 2 s = 36 s of robot time" in x
        for x in lines
    )


def test_plan_draws_every_wire_in_mermaid(robid: Robid, tmp_path: Path) -> None:
    (tmp_path / "pipeline.yaml").write_text(GOOD)
    lines = robid("plan", "--mermaid").stdout.splitlines()
    assert lines[0] == "flowchart TD"
    assert [line.strip() for line in lines if "--" in line] == [
        "s_where -- Configurations --> s_excite",
        "s_where -- Configurations --> s_acquire",
        "s_excite -- Excitation --> s_acquire",
        "s_acquire -- Record --> s_frf",
    ]


def test_schema_is_written_for_editors(robid: Robid, tmp_path: Path) -> None:
    done = robid("schema", "--output", "robid.schema.json")
    assert done.returncode == 0
    schema = json.loads((tmp_path / "robid.schema.json").read_text())
    assert schema["$schema"] == "http://json-schema.org/draft-07/schema#"
    assert "stages.frf.log" in schema["definitions"]
    assert robid("schema", "-o", "no/such/folder.json").returncode == 7


@pytest.mark.parametrize("arguments", [(), ("--own-robot",), ("--robot", "six_axis")])
def test_a_new_project_is_valid_and_never_overwrites(
    robid: Robid, tmp_path: Path, arguments: tuple[str, ...]
) -> None:
    done = robid("init", "my first_project", *arguments)
    assert done.returncode == 0, done.stderr
    project = tmp_path / "my first_project"
    assert 'name: "my-first-project"' in (project / "pipeline.yaml").read_text()
    assert not any("@" in path.read_text() for path in project.glob("[pR]*"))
    assert robid("validate", folder=project).returncode == 0
    before = {path.name: path.read_bytes() for path in project.iterdir()}
    again = robid("init", "my first_project", *arguments)
    assert again.returncode == 2
    assert "would be overwritten" in again.stderr
    assert {path.name: path.read_bytes() for path in project.iterdir()} == before


def test_a_recording_is_described(robid: Robid, tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("time,torque\n0,1\n0.1,2\n0.2,3\n")
    done = robid("records", "a.csv")
    assert done.returncode == 0
    assert "3 rows, 2 columns of numbers" in done.stdout
    refused = robid("records", "recover", "a.csv")
    assert refused.returncode == 2
    assert "nothing to recover" in refused.stderr
    assert robid("records", "a.csv", "--format", "npz").returncode in (2, 5)


def test_doctor_checks_plugins_and_folders(
    robid: Robid, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    done = robid("doctor")
    assert done.returncode == 0, done.stdout
    assert "plugins can be imported" in done.stdout
    assert str(tmp_path) in done.stdout
    monkeypatch.setenv("ROBID_DATA", str(tmp_path / "none"))
    ill = robid("doctor")
    assert ill.returncode == 2  # a setting of the user's
    assert "FAIL" in ill.stdout
    assert "ROBID_DATA" in ill.stdout


@pytest.mark.parametrize(
    ("line", "completed"), [("robid val", ["validate"]), ("robid plan --mer", ["--mermaid"])]
)
def test_a_shell_completes_commands_and_options(tmp_path: Path, line: str, completed: list[str]) -> None:
    environment = {
        **os.environ,
        "_ROBID_COMPLETE": "complete_bash",
        "COMP_WORDS": line,
        "COMP_CWORD": str(len(line.split()) - 1),
    }
    done = subprocess.run(
        [sys.executable, "-c", MAIN],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stdout.split() == completed
