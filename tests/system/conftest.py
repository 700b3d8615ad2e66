"""One run of the worked example feeds every test of pages, commands and store in this folder."""

import os
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
ROBID = str(Path(sys.executable).with_name("robid"))


@dataclass(frozen=True)
class Told:
    """What a command said."""

    code: int
    out: str
    err: str


def run_robid(folder: Path, *arguments: str, **environment: str) -> Told:
    """Run the command line as a user would."""
    done = subprocess.run(
        [ROBID, *arguments],
        cwd=folder,
        capture_output=True,
        text=True,
        env={**os.environ, **environment},
        check=False,
    )
    return Told(done.returncode, done.stdout, done.stderr)


@dataclass(frozen=True)
class FirstLight:
    """The folder of the finished run and what it printed."""

    folder: Path
    told: Told

    @property
    def artifacts(self) -> Path:
        return self.folder / "runs" / "six-axis" / "artifacts"


@pytest.fixture(scope="session")
def first_light(tmp_path_factory: pytest.TempPathFactory) -> FirstLight:
    folder = tmp_path_factory.mktemp("first_light")
    shutil.copy(ROOT / "pipeline.yaml", folder)
    return FirstLight(folder, run_robid(folder, "run", "pipeline.yaml"))


@pytest.fixture(scope="session")
def robid():
    """The command line, as a function of a folder and arguments."""
    return run_robid
