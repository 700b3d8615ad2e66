"""The bench of backends runs, and both modes of automatic differentiation agree; times are printed, not asserted."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

BENCH = Path(__file__).with_name("backends.py")


@pytest.mark.full
def test_both_modes_agree_and_are_timed() -> None:
    pytest.importorskip("torch")
    said = subprocess.run(
        [sys.executable, str(BENCH), "modes", "--rounds", "1"], capture_output=True, text=True, timeout=300
    )
    assert said.returncode == 0, said.stderr  # it compares the two
    assert said.stdout.count("reverse over forward") == 4
