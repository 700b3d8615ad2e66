"""Some of the attacks that `attacks.py` makes by the thousand: the next run makes what an undisturbed one does."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).parent


def attack(*options: str) -> None:
    """Perform attacks; all of them must be good."""
    command = [sys.executable, str(HERE / "attacks.py"), *options]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]


@pytest.mark.system
def test_runs_that_were_attacked_end_with_the_bytes_of_an_undisturbed_one() -> None:
    attack("--kill", "4", "--fail", "6", "--corrupt", "4", "--seed", "20")


@pytest.mark.full
def test_thousands_of_runs_are_attacked() -> None:
    attack("--kill", "1760", "--fail", "3070", "--corrupt", "1500", "--seed", "21")
