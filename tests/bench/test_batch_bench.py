"""The bench of batches runs, and memory is what is recorded; times are printed, not asserted."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

BENCH = Path(__file__).with_name("batch.py")


@pytest.mark.full
def test_memory_is_what_is_recorded() -> None:
    said = subprocess.run(
        [sys.executable, str(BENCH), "memory", "--check"], capture_output=True, text=True, timeout=600
    )
    assert said.returncode == 0, said.stdout + said.stderr
    assert said.stdout.count("reached") == 2


@pytest.mark.full
def test_every_way_to_two_cores_is_timed() -> None:
    said = subprocess.run(
        [sys.executable, str(BENCH), "time", "--configurations", "1"],
        capture_output=True,
        text=True,
        timeout=600,
    )
    for words in ("2 threads", "2 processes", "2 workers of dask"):
        assert words in said.stdout, said.stderr
