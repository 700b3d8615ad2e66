"""The server from which stages' processes are forked: killed, without a place, between runs that differ."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import threading
import time
from collections.abc import Iterator
from multiprocessing import forkserver
from pathlib import Path
from typing import Any

import pytest
from faults.fault import fault

from robid_core.errors import PluginError
from robid_core.run import warm_start

CONFINE = "robid_core/run/confine.py"
INSIDE = "robid_core/run/confined_stage.py"
WARM_START = "robid_core/run/warm_start.py"
FIT = '        called("fit")\n'
KILL_SERVER = "        import signal; os.kill(os.getppid(), signal.SIGKILL)\n"
WHO = "        called(str(os.getppid()))\n"
OWN_END = "its code ended its process with exit code 255"


@fault(
    "R11",
    sees="exit 8: the server that starts processes was killed, not that the plugin ended itself with exit code 255",
    mutant=(CONFINE, "has_died(self._server)", "not has_died(self._server)"),
)
@pytest.mark.parametrize(
    ("end", "words"),
    [
        ("os.kill(os.getpid(), signal.SIGKILL)", "R11: the server that starts processes was killed"),
        ("raise ValueError('no weather')", "failed: ValueError: no weather"),
    ],
)
def test_R11_a_stage_that_dies_after_its_server_is_not_said_to_have_ended_itself(
    world: Any, end: str, words: str
) -> None:
    world.run(last="frf")
    world.edit(FIT, f"{FIT}{KILL_SERVER}        {end}\n")
    with pytest.raises(PluginError, match=words) as caught:
        world.run(last="fit", trust_plugins=False)
    assert OWN_END not in str(caught.value)


def test_a_plugin_that_ends_itself_with_the_code_of_a_lost_server_is_named(world: Any) -> None:
    world.run(last="frf")
    world.edit(FIT, FIT + "        os._exit(255)\n")
    with pytest.raises(PluginError, match=f"R09: {OWN_END}"):
        world.run(last="fit", trust_plugins=False)


@fault(
    "R11",
    sees="exit 8: its process ended before the stage began: limits of the system, or the plugin while it is imported",
    mutant=(CONFINE, "        elif not self._begun:\n", "        elif False:\n"),
)
def test_R11_a_process_that_ends_before_its_stage_begins_is_told_as_that(world: Any) -> None:
    world.run(last="frf")
    world.edit("BIAS = 0.0", f"BIAS = 0.0 if os.getpid() == {os.getpid()} else os._exit(3)")
    with pytest.raises(
        PluginError, match="R11: its process ended with exit code 3 before the stage began; .*ulimit"
    ):
        world.run(last="fit", trust_plugins=False, force=("fit",))


def test_the_server_that_python_keeps_is_the_parent_of_a_stage(world: Any) -> None:
    """`_forkserver_pid` is private to multiprocessing: this is where a Python that changed it is noticed."""
    line = "        return Configurations(robot.axis_names, context"
    world.edit(line, WHO + line)
    world.run(last="where", trust_plugins=False)
    assert world.ran()[-1] == str(warm_start._server())


def test_a_python_that_keeps_no_server_starts_stages_all_the_same(
    world: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(warm_start, "forkserver", object())
    assert warm_start._server() is None
    assert world.run(last="where", trust_plugins=False).outcomes["where"] == "made"


def test_stages_go_on_when_their_server_is_killed_during_one_and_between_two(world: Any) -> None:
    world.edit('        called("where")\n', '        called("where")\n' + KILL_SERVER)
    world.run(last="acquire", trust_plugins=False)
    with contextlib.suppress(ProcessLookupError):
        os.kill(forkserver._forkserver._forkserver_pid, signal.SIGKILL)  # type: ignore[attr-defined]
    assert world.run(last="frf", trust_plugins=False).outcomes["frf"] == "made"
    assert world.ran() == ["where", "acquire", "frf"]


@fault(
    "R11",
    sees="the log: no server can start the process of a stage, and why; the stage is made",
    mutant=(
        WARM_START,
        "        except (OSError, EOFError, RuntimeError) as error:",
        "        except (EOFError, RuntimeError) as error:",
    ),
)
def test_R11_a_folder_for_temporary_files_that_holds_no_socket_ends_no_run(
    world: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    deep = tmp_path / ("x" * 108)  # longer than the path of a socket can be
    deep.mkdir()
    monkeypatch.setenv("TMPDIR", str(deep))
    done = world.elsewhere(trust_plugins=False, last="where")
    assert (done.returncode, world.ran()) == (0, ["where"]), done.stderr
    log = (world.folder / "log.txt").read_text()
    assert "no server can start the process of a stage (AF_UNIX path too long)" in log


@fault(
    "R11",
    sees="a server that does not answer is killed after a minute, and the stage is made without it",
    mutant=(WARM_START, "        os.kill(server, signal.SIGKILL)", "        os.kill(server, 0)"),
)
def test_R11_a_server_that_does_not_answer_is_done_without(
    world: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    world.run(last="where", trust_plugins=False)
    server = forkserver._forkserver._forkserver_pid  # type: ignore[attr-defined]
    os.kill(server, signal.SIGSTOP)
    monkeypatch.setattr(warm_start, "LONGEST_START_S", 0.3)
    wake = threading.Timer(
        20.0, os.kill, (server, signal.SIGCONT)
    )  # a run that waits for it shall fail, not hang
    wake.start()
    try:
        assert world.run(last="acquire", trust_plugins=False).outcomes["acquire"] == "made"
    finally:
        wake.cancel()
        with contextlib.suppress(ProcessLookupError):
            os.kill(server, signal.SIGCONT)
    assert warm_start.has_died(server)


STATE = """\
        mask = os.umask(0); os.umask(mask)
        called(f"{mask} {os.getcwd()} {os.environ.get('STRANGE')} {time.strftime('%Z')} {np.random.random()}")
"""


@fault(
    "R16",
    sees="each stage has umask, folder, variables and time zone of its run, and random numbers of its own",
    mutant=(INSIDE, "    os.umask(umask)\n", ""),
)
@fault(
    "R16",
    sees="two stages that draw from numpy without a seed do not draw the same numbers",
    mutant=(INSIDE, "    np.random.seed()", "    pass"),
)
@fault(
    "R16",
    sees="a second run in one process has its own time zone",
    mutant=(INSIDE, "    time.tzset()\n", ""),
)
def test_R16_a_second_run_in_a_process_has_its_own_state(
    world: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    world.edit('        called("where")\n', '        called("where")\n' + STATE)
    world.edit('        called("acquire")\n', '        called("acquire")\n' + STATE)
    monkeypatch.setenv("TZ", "AAA-1")
    world.run(last="where", trust_plugins=False)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("STRANGE", "other")
    monkeypatch.setenv("TZ", "BBB-2")
    mask = os.umask(0o027)
    try:
        world.run(last="acquire", trust_plugins=False)
    finally:
        os.umask(mask)
    _, umask, _, variable, _, drawn, _, *second = world.ran()
    assert (int(umask), variable) == (mask, "None")
    assert second[:-1] == [str(0o027), str(tmp_path), "other", "BBB"]
    assert second[-1] != drawn


def test_runs_in_threads_of_a_process_with_many_threads_give_the_same_bytes(world: Any) -> None:
    world.run(last="frf")
    wanted = world.hashes()
    over = threading.Event()
    others = [threading.Thread(target=over.wait) for _ in range(50)]
    run = threading.Thread(
        target=world.run, kwargs={"force": ("frf",), "last": "frf", "trust_plugins": False}
    )
    for thread in [*others, run]:
        thread.start()
    run.join(30)
    over.set()
    assert world.ran()[-1] == "frf"
    assert world.hashes() == wanted


# What is left when a run ends ------------------------------------------------------------------------------


def parent_of(pid: int) -> int:
    """Return the parent of a living process; 0 where it does not live."""
    with contextlib.suppress(OSError):
        state, parent = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[:2]
        return int(parent) if state != "Z" else 0
    return 0


def descendants(pid: int) -> set[int]:
    """Return the living processes that a process has started, and those that these have."""
    parents = {int(place.name): parent_of(int(place.name)) for place in Path("/proc").glob("[0-9]*")}
    found, new = set[int](), {pid}
    while new:
        new = {child for child, parent in parents.items() if parent in new}
        found |= new
    return found


@contextlib.contextmanager
def a_run_in_its_stage(world: Any) -> Iterator[tuple[subprocess.Popen[str], set[int]]]:
    """Give a run of its own session that is in a stage, and all its processes."""
    world.edit('        called("where")\n', '        called("where")\n        time.sleep(1000)\n')
    command = world.command(trust_plugins=False)
    run = subprocess.Popen(
        command,
        env=world.environment,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    limit = time.monotonic() + 60
    while not world.calls.exists():
        assert run.poll() is None
        assert time.monotonic() < limit
        time.sleep(0.02)
    all_of_it = descendants(run.pid)
    assert len(all_of_it) == 3  # the tracker of resources, the server, the stage
    try:
        yield run, all_of_it
    finally:
        for pid in all_of_it:
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        run.kill()
        run.communicate()


@pytest.mark.parametrize(("number", "code"), [(signal.SIGKILL, -signal.SIGKILL), (signal.SIGINT, 130)])
def test_nothing_is_left_of_a_run_that_is_killed_or_interrupted_at_a_terminal(
    world: Any, number: signal.Signals, code: int
) -> None:
    with a_run_in_its_stage(world) as (run, all_of_it):
        if number == signal.SIGINT:
            os.killpg(run.pid, number)  # a terminal sends it to the whole group
        else:
            run.send_signal(number)
        words = run.communicate(timeout=20)[1]
        limit = time.monotonic() + 5
        while any(map(parent_of, all_of_it)) and time.monotonic() < limit:
            time.sleep(0.02)
        assert not any(map(parent_of, all_of_it))
    assert (run.returncode, words) == (code, "")
