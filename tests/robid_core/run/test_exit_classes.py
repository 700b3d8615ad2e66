"""What goes wrong has the exit code of what it is: the machine, a plugin, a setting, or nothing at all."""

from __future__ import annotations

import errno
import os
import re
import resource
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from faults.fault import fault

from robid_core.errors import ConfigurationError, PluginError, StoreError
from robid_core.pipeline import Pipeline
from robid_core.store import Files, failures_named

GUARD = "robid_core/run/guard.py"
FILES = "robid_core/store/files.py"
FOLDER = "robid_core/run/folder.py"
FIT = '        called("fit")\n'


@fault(
    "R04",
    sees="exit 7: memory is limited to so many MB (ulimit -v), which libraries need; runs hung",
    mutant=("robid_core/commands/app.py", "    guarded(ask_room, debug)()\n", ""),
)
@pytest.mark.parametrize("limit_mb", [200, 450, 550])
def test_R04_a_limit_of_memory_that_the_libraries_exceed_is_told_at_once(limit_mb: int) -> None:
    """With 450 or 550 MB a run hung, and no SIGTERM ended it; with less, libraries could not be loaded (exit 70)."""
    main = "from robid_core.commands import main; main(['stages'])"
    command = f'ulimit -v {1024 * limit_mb}; exec "$@"'
    words = ["bash", "-c", command, "limited", sys.executable, "-c", main]
    done = subprocess.run(words, capture_output=True, text=True, timeout=20, check=False)
    assert done.returncode == StoreError.exit_code
    assert done.stderr == (
        f"memory is limited to {limit_mb} MB (ulimit -v), and robid asks for at least 1024 MB, "
        "most of it for libraries; raise the limit and run again\n"
    )


@fault(
    "R04",
    sees="exit 7: which stage and plugin, too many open files, and to raise ulimit -n; an error of its own stays 8",
    mutant=(GUARD, "error.errno in OF_THE_MACHINE", "error.errno in ()"),
)
def test_R04_what_the_machine_refuses_a_plugin_is_no_fault_of_the_plugin(world: Any) -> None:
    world.edit(FIT, FIT + "        raise OSError(24, 'Too many open files', '/data/one')\n")
    with pytest.raises(StoreError) as caught:
        world.run(last="fit")
    assert str(caught.value) == (
        "cannot run stage fit, 'strange.estimate' (robid_strange_stages 1.0), with /data/one: Too many open files; "
        "what was finished before is kept; raise the limit of open files (ulimit -n) and run again"
    )


UNTIL_NONE_IS_LEFT = """\
        files = []
        while True:
            files.append(open("/dev/null"))
"""


@fault(
    "R04",
    sees="exit 7, and a manifest that says failed, where a stage has opened all files that it may",
    mutant=(
        "robid_core/run/runner.py",
        "        traceback.clear_frames(each.__traceback__)\n",
        "        pass\n",
    ),
)
@pytest.mark.parametrize("trust", [True, False])
def test_R04_the_files_that_a_failed_stage_has_open_are_let_go(world: Any, trust: bool) -> None:
    world.run(last="frf")
    world.edit(FIT, FIT + UNTIL_NONE_IS_LEFT)
    limited = [
        "bash",
        "-c",
        'ulimit -n 64; exec "$@"',
        "bash",
        *world.command(last="fit", trust_plugins=trust),
    ]
    done = subprocess.run(limited, env=world.environment, capture_output=True, text=True, timeout=60)
    assert done.returncode == 7, done.stderr
    assert re.search("cannot run stage fit, .* with /dev/null: Too many open files; .*ulimit -n", done.stderr)
    assert '"status": "failed"' in (world.folder / "manifest.json").read_text()


@fault(
    "R04",
    sees="exit 7: no space left on device, where a stage's file fails only when it is closed; no other disk is blamed",
    mutant=(GUARD, "Path(error.filename) if error.filename else None", "Path(error.filename or log_path)"),
)
@pytest.mark.skipif(not Path("/dev/full").is_char_device(), reason="needs a device that is always full")
def test_R04_a_file_of_a_stage_that_fails_to_close_is_the_machines_fault(world: Any) -> None:
    world.edit(
        FIT, FIT + '        file = open("/dev/full", "w")\n        file.write("x")\n        file.close()\n'
    )
    with pytest.raises(StoreError) as caught:
        world.run(last="fit")
    assert str(caught.value) == (
        "cannot run stage fit, 'strange.estimate' (robid_strange_stages 1.0): No space left on device; "
        "what was finished before is kept; free some space and run again"
    )


@pytest.mark.skipif(not Path("/dev/full").is_char_device(), reason="needs a device that is always full")
def test_a_log_whose_disk_is_full_when_it_is_closed_ends_no_run(world: Any) -> None:
    world.folder.mkdir(parents=True)
    (world.folder / "log.txt").symlink_to("/dev/full")
    done = world.elsewhere(last="where")
    assert (done.returncode, done.stderr) == (0, "")
    assert '"status": "done"' in (world.folder / "manifest.json").read_text()


@fault(
    "R03",
    sees="exit 7: the file for which a stage found a disk full, and no room of another disk",
    mutant=(GUARD, ", file, needed=None):", ", file):"),
)
def test_R03_the_room_of_a_disk_that_is_not_known_is_not_told(world: Any) -> None:
    world.edit(FIT, FIT + "        raise OSError(28, 'No space left on device', '/other/disk/file')\n")
    with pytest.raises(StoreError) as caught:
        world.run(last="fit")
    assert "with /other/disk/file: No space left on device; what was finished before is kept" in str(
        caught.value
    )


def test_a_plugins_own_system_error_stays_the_plugins(world: Any) -> None:
    world.edit(FIT, FIT + "        open('/nowhere/at/all')\n")
    with pytest.raises(PluginError, match="FileNotFoundError"):
        world.run(last="fit")


@fault(
    "R09",
    sees="exit 8: plugin, version and class of an exception whose text cannot be shown",
    mutant=(
        "robid_core/errors.py",
        "    except BaseException as second:",
        "    except LookupError as second:",
    ),
)
def test_R09_an_exception_whose_text_fails_is_told(world: Any) -> None:
    mute = "        class Mute(Exception):\n            def __str__(self): return 1 / 0\n        raise Mute\n"
    world.edit(FIT, FIT + mute)
    with pytest.raises(PluginError, match="failed: Mute: .its text cannot be shown: ZeroDivisionError"):
        world.run(last="fit")


@fault(
    "R03",
    sees="exit 7: all files that the disk can hold are there, not how many MB are free",
    mutant=(FILES, "            if system.f_files and not system.f_favail:\n", "            if False:\n"),
)
def test_R03_a_disk_without_inodes_is_not_said_to_lack_room(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    full = SimpleNamespace(f_files=1000, f_favail=0, f_bavail=10**6, f_frsize=4096)
    monkeypatch.setattr(os, "statvfs", lambda _: full)
    with pytest.raises(StoreError) as caught, failures_named("write", tmp_path / "x"):
        raise OSError(errno.ENOSPC, "No space left on device")
    assert "(all 1000 files that this disk can hold are there; remove some)" in str(caught.value)
    assert "MB" not in str(caught.value)


@fault(
    "R03",
    sees="exit 7: file too large, and that a limit (ulimit -f) is set, not that the disk should be checked",
    mutant=(FILES, "    errno.EFBIG: ", "    -1: "),
)
def test_R03_a_limit_on_the_size_of_files_is_told_as_what_it_is(world: Any) -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (4096, hard))
    try:
        with pytest.raises(StoreError, match=r"File too large; .*\(ulimit -f\)"):
            world.run(last="where")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@fault(
    "R04",
    sees="nothing: the results are stored, and the lock is let go whatever closing its file says",
    mutant=(
        "robid_core/run/lock.py",
        "        with contextlib.suppress(OSError):  # the lock is let go whatever closing says\n",
        "        with contextlib.nullcontext():\n",
    ),
)
def test_R04_a_lock_file_that_fails_to_close_ends_no_run(world: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    close = os.close

    def failing(descriptor: int) -> None:
        name = os.path.realpath(f"/proc/self/fd/{descriptor}")
        close(descriptor)
        if name.endswith("/store/lock"):
            raise OSError(errno.EIO, "Input/output error")

    monkeypatch.setattr(os, "close", failing)
    assert world.run(last="where").outcomes == {"where": "made"}


@fault(
    "Y02",
    sees="exit 2: file, line and stage; these numbers are too large to be computed with",
    mutant=(
        "robid_core/pipeline/checking.py",
        "    except (ArithmeticError, MemoryError) as error:",
        "    except ZeroDivisionError as error:",
    ),
)
def test_Y02_a_number_beyond_all_arithmetic_is_a_mistake_in_the_file(tmp_path: Path) -> None:
    file = tmp_path / "pipeline.yaml"
    settings = "{band_hz: [5, 80], lines: 20, period_s: 1e308, blocks: 2}"
    file.write_text(
        "robid: 1\nname: big\nseed: 1\nrobot: one_axis\nstages:\n  where: {use: design.candidates}\n"
        f"  excite:\n    use: excitation.multisine\n    with: {settings}\n"
    )
    with pytest.raises(
        ConfigurationError, match=r"pipeline.yaml:9:\d+: stages.excite.with: these numbers are too large"
    ):
        Pipeline.load(file)


@fault(
    "Y05",
    sees="exit 2: `runs` is a link to no folder",
    mutant=(FOLDER, "        if runs.is_symlink() and not runs.is_dir():\n", "        if False:\n"),
)
def test_Y05_runs_may_be_a_link_to_a_folder_and_to_nothing_else(world: Any, tmp_path: Path) -> None:
    runs, elsewhere = world.project / "runs", tmp_path / "elsewhere"
    runs.symlink_to(elsewhere)
    with pytest.raises(
        ConfigurationError, match=r"runs: a link to .*elsewhere, which is no folder; make that folder"
    ):
        world.run(last="where")
    elsewhere.write_text("")
    with pytest.raises(ConfigurationError, match="runs: a link to"):
        world.run(last="where")
    elsewhere.unlink()
    elsewhere.mkdir()
    world.run(last="where")
    assert (elsewhere / "strange" / "manifest.json").is_file()


@fault(
    "R04",
    sees="exit 0 where everything is up to date; else exit 7: read-only file system",
    mutant=(
        "robid_core/run/runner.py",
        "        if (result := kept_without_writing(pipeline, options)) is not None:\n            return result\n",
        "",
    ),
)
@pytest.mark.skipif(
    sys.platform != "linux" or os.geteuid() != 0, reason="mounting read-only needs the rights of root"
)
def test_R04_a_read_only_folder_is_no_hindrance_where_nothing_has_to_be_done(world: Any) -> None:
    doubted = "stages.fit.with.outcome=doubted"
    made = world.run(doubted)
    place = str(world.project)
    if subprocess.run(["mount", "--bind", place, place], check=False, capture_output=True).returncode:
        pytest.skip("this machine lets nobody mount")
    try:
        subprocess.run(["mount", "-o", "remount,bind,ro", place], check=True)
        kept = world.run(doubted, strict=True)
        assert kept.idle
        assert (kept.doubts, kept.remarks, kept.exit_code) == (made.doubts, made.remarks, 6)
        with pytest.raises(StoreError, match="the file system is read-only"):
            world.run("stages.fit.with.rows=2")
    finally:
        subprocess.run(["umount", place], check=True)
    assert Files().names(world.folder / "store" / "temporary") == []
