"""The bench of rigid fits runs, with as many unknowns as it says; times are printed, not asserted."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest


@pytest.mark.full
def test_both_ways_are_timed_on_all_samples() -> None:
    bench = Path(__file__).with_name("rigid.py")
    said = subprocess.run(
        [sys.executable, str(bench), "--rounds", "1"], capture_output=True, text=True, timeout=600
    )
    assert "25000 samples of 6 axes, 66 unknowns: 149" in said.stdout, said.stderr
    assert "x the plain way" in said.stdout
