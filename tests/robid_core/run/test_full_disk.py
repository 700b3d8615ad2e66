"""A real file system that is full (R03): exit 7 at every amount of room, and the run completes once there is more."""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from faults.fault import fault

from robid_core.errors import StoreError


@pytest.fixture(params=["size=400k"])
def small_disk(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[Path]:
    place = tmp_path / "disk"
    place.mkdir()
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", request.param, "tmpfs", str(place)], capture_output=True, check=False
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


@fault(
    "R03",
    sees="exit 7 on a real disk without inodes: all 24 files that it can hold are there; later the run completes",
    mutant=(
        "robid_core/store/files.py",
        "            if system.f_files and not system.f_favail:\n",
        "            if False:\n",
    ),
)
@pytest.mark.skipif(sys.platform != "linux", reason="mounts a tmpfs")
@pytest.mark.parametrize("small_disk", ["nr_inodes=24"], indirect=True)
def test_R03_a_disk_that_can_hold_no_more_files_is_told_as_that_and_completes_later(
    world: Any, small_disk: Path
) -> None:
    world.run()
    wanted = world.hashes()
    runs = world.project / "runs"
    shutil.rmtree(runs)
    runs.symlink_to(small_disk)
    with pytest.raises(StoreError) as caught:
        world.run()
    assert "No space left on device (all 24 files that this disk can hold are there; remove some)" in str(
        caught.value
    )
    subprocess.run(["mount", "-o", "remount,nr_inodes=200", str(small_disk)], check=True)
    world.run()
    assert world.hashes() == wanted
    assert list((world.folder / "store" / "temporary").iterdir()) == []
