"""A real file system that is full (R03): exit 7 at every amount of room, and the run completes once there is more."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    place = tmp_path / "disk"
    place.mkdir()
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=400k", "tmpfs", str(place)], capture_output=True, check=False
    )
    if mounted.returncode:
        pytest.skip("mounting a small file system needs the rights of root")
    yield place
    subprocess.run(["umount", str(place)], check=True)


@pytest.mark.skipif(sys.platform != "linux", reason="mounts a tmpfs")
def test_a_run_on_a_disk_that_fills_up_says_so_and_completes_later(world: Any, small_disk: Path) -> None:
    world.run()
    wanted = world.hashes()
    runs = world.project / "runs"
    subprocess.run(["rm", "-rf", str(runs)], check=True)
    runs.symlink_to(small_disk)
    filler, ends = small_disk / "filler", []
    for free in (20_000, 100_000):
        filler.write_bytes(b"x" * (400 * 1024 - free))
        done = world.elsewhere()
        ends.append(done.returncode)
        assert done.returncode in (0, 7), done.stderr
        if done.returncode == 7:
            assert "No space left on device" in done.stderr
            assert len(done.stderr.splitlines()) == 1, done.stderr
        filler.unlink()
    assert ends[0] == 7
    assert world.elsewhere().returncode == 0
    assert world.hashes() == wanted
    assert list((world.folder / "store" / "temporary").iterdir()) == []
