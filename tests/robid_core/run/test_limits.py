"""A deadline and a memory limit, where they are asked for (R10, R11)."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import time
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

import pytest
from faults.fault import fault

from robid_core.errors import MotionAborted, NotTrustworthy, PluginError
from robid_core.interruption import SIGNALS
from robid_core.run import confine

FIT = '        called("fit")\n'
SPINNING = """\
        import resource

        resource.setrlimit(resource.RLIMIT_CPU, (1, resource.getrlimit(resource.RLIMIT_CPU)[1]))
        while True:
            pass
"""


def test_limits_that_are_kept_change_no_byte(world: Any) -> None:
    world.run()
    before = world.hashes()
    subprocess.run(["rm", "-rf", str(world.folder)], check=True)
    world.ran()
    world.run(deadline_s=60.0, memory_mb=4000, last="frf")
    assert world.ran() == ["where", "acquire", "frf"]
    assert world.hashes().items() <= before.items()
    assert list((world.folder / "store" / "temporary").iterdir()) == []


def test_a_stage_that_hangs_is_killed_at_its_deadline(world: Any) -> None:
    world.run(last="frf")
    with pytest.raises(PluginError, match=r"stage fit: R10: not finished after 3 s, and killed"):
        world.run("stages.fit.with.hold=1000.0", deadline_s=3.0, last="fit")


def test_a_stage_that_takes_too_much_memory_is_ended(world: Any) -> None:
    world.run(last="frf")
    with pytest.raises(PluginError, match=r"stage fit: .* failed: .*not enough memory") as caught:
        world.run("stages.fit.with.outcome=memory", memory_mb=1000, last="fit")
    assert "np.ones(10**9)" in str(caught.value)


@fault(
    "R11",
    sees="exit 8: the stage, and that a limit of processor time is used up, not a mistake in compiled code",
    mutant=("robid_core/run/confined_stage.py", "_out_of_time(job, why) if why else error", "error"),
)
def test_R11_a_stage_that_uses_up_its_processor_time_is_told_as_that(world: Any) -> None:
    world.run(last="frf")
    world.edit(FIT, FIT + SPINNING)
    with pytest.raises(PluginError) as caught:
        world.run(last="fit", trust_plugins=False)
    assert str(caught.value) == (
        "stage fit: 'strange.estimate' (robid_strange_stages 1.0): R11: the processor time that a limit allows each "
        "process is used up (ulimit -t); nothing was stored; raise the limit, or give it less work"
    )


@fault(
    "D18",
    sees="exit 130: interrupted, and that a limit of processor time is used up; commands ended without a word (152)",
    mutant=("robid_core/interruption.py", ", signal.SIGXCPU)", ")"),
)
def test_D18_a_command_that_uses_up_its_processor_time_says_so() -> None:
    command = (
        "import resource, time\n"
        "from robid_core.commands import main\n"
        "_, most = resource.getrlimit(resource.RLIMIT_CPU)\n"
        "resource.setrlimit(resource.RLIMIT_CPU, (int(time.process_time()) + 1, most))\n"
        "while True:\n"
        "    main(['stages'])\n"
    )
    done = subprocess.run([sys.executable, "-c", command], capture_output=True, text=True, timeout=60)
    assert done.returncode == 130
    told = "interrupted: the processor time that a limit allows each process is used up (ulimit -t)\n"
    assert done.stderr.endswith(told)
    assert "Traceback" not in done.stderr


def test_errors_come_out_as_they_went_in(world: Any) -> None:
    world.run(last="frf")
    with pytest.raises(
        PluginError, match=r"failed: ZeroDivisionError: a stranger's mistake\n.*raise ZeroDiv"
    ):
        world.run("stages.fit.with.outcome=raises", deadline_s=60.0, last="fit")
    result = world.run("stages.fit.with.outcome=refused", deadline_s=60.0, last="fit")
    assert result.exit_code == NotTrustworthy.exit_code


def test_hardware_is_not_run_where_it_could_be_killed(world: Any) -> None:
    world.say("{use: strange}", "{use: strange_hardware}")
    world.say("{use: strange.measure,", "{use: strange.measure, with: {seconds: 0.3},")
    world.run(last="where")
    result = world.run(last="acquire", at_the_robot=True, deadline_s=0.2)
    assert result.outcomes["acquire"] == "made"


# However early, however deaf, the process ends -------------------------------------------------------------


def heard() -> None:
    """Let a run hear signals that whoever runs the tests ignores."""
    for number in SIGNALS:
        signal.signal(number, signal.SIG_DFL)


def children_of(pid: int) -> list[int]:
    """Return the processes that a process has started and that live."""
    found = []
    for place in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            state, parent = place.read_text().rpartition(")")[2].split()[:2]
            if int(parent) == pid and state != "Z":
                found.append(int(place.parent.name))
    return found


def stage_processes() -> list[int]:
    """Return the living processes of stages: children of the server that starts them."""
    found = []
    for pid in children_of(os.getpid()):
        with contextlib.suppress(OSError):
            if b"multiprocessing.forkserver" in Path(f"/proc/{pid}/cmdline").read_bytes():
                found += children_of(pid)
    return found


def test_a_deadline_that_passes_while_the_process_still_starts_ends_it(world: Any) -> None:
    world.run(last="frf")
    world.edit("BIAS = 0.0", f"BIAS = 0.0 if os.getpid() == {os.getpid()} else time.sleep(30)")
    before = stage_processes()
    began = time.monotonic()
    with pytest.raises(PluginError, match=r"stage fit: R10: not finished after 0.1 s, and killed"):
        world.run("stages.fit.with.hold=1000.0", deadline_s=0.1, last="fit")
    assert time.monotonic() - began < 10  # it has no group of its own yet: killing that would kill nothing
    assert stage_processes() == before


def test_a_process_that_cannot_be_collected_is_not_waited_for(
    world: Any, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(confine, "GONE_S", 0.2)
    spared: list[int] = []
    kill, killpg = BaseProcess.kill, os.killpg
    monkeypatch.setattr(BaseProcess, "kill", lambda self: spared.append(self.pid))
    monkeypatch.setattr(confine.os, "killpg", lambda pid, number: None)
    world.run(last="frf")
    began = time.monotonic()
    try:
        with pytest.raises(PluginError, match="R10"):
            world.run("stages.fit.with.hold=1000.0", deadline_s=0.1, last="fit")
        assert time.monotonic() - began < 10
    finally:  # else the end of all tests would wait for it
        monkeypatch.undo()
        with contextlib.suppress(ProcessLookupError):
            killpg(spared[0], signal.SIGKILL)
        os.kill(spared[0], signal.SIGKILL)
    assert f"process {spared[0]} of stage fit does not end" in caplog.text
    assert kill is BaseProcess.kill


@pytest.mark.parametrize("delay_s", [0.0, pytest.param(0.3, marks=pytest.mark.full), 1.5])
def test_D18_signals_end_a_run_with_a_deadline_whenever_they_come(world: Any, delay_s: float) -> None:
    world.run(last="frf")
    world.say("{use: strange.estimate}", "{use: strange.estimate, with: {hold: 1000.0}}")
    process = subprocess.Popen(
        world.command(deadline_s=900.0), env=world.environment, stderr=subprocess.PIPE, preexec_fn=heard
    )
    limit = time.monotonic() + 60
    while len(children_of(process.pid)) < 2:  # the resource tracker, and the server of processes
        assert time.monotonic() < limit
        time.sleep(0.002)
    time.sleep(delay_s)
    began = time.monotonic()
    for number in SIGNALS:
        process.send_signal(number)
    process.communicate(timeout=20)
    assert process.returncode == 130
    assert time.monotonic() - began < 10
    assert '"status": "interrupted"' in (world.folder / "manifest.json").read_text()


STOPPING = """\
        import multiprocessing, signal
        from robid_core import StopNotConfirmed

        try:
            os.kill(multiprocessing.parent_process().pid, signal.SIGTERM)  # the run is told to stop
            time.sleep(1000.0)
        except KeyboardInterrupt:
            called("stopped")
            OUTCOME
            raise
"""


@pytest.mark.parametrize(
    ("outcome", "error", "match"),
    [
        ("pass", KeyboardInterrupt, "^$"),
        (
            "raise StopNotConfirmed('axis_2 (node 2) still turns')",
            MotionAborted,
            "axis_2 .node 2. still turns",
        ),
    ],
)
def test_a_stage_with_drives_may_stop_them_before_it_is_killed(
    world: Any, outcome: str, error: type[BaseException], match: str
) -> None:
    world.run(last="where")
    world.edit('called("acquire")\n', 'called("acquire")\n' + STOPPING.replace("OUTCOME", outcome))
    with pytest.raises(error, match=match):
        world.run(last="acquire", deadline_s=60.0)
    assert world.ran()[-2:] == ["acquire", "stopped"]
    assert not stage_processes()


def test_a_stage_with_drives_that_does_not_end_is_killed_all_the_same(
    world: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(confine, "STOPPING_S", 0.5)
    world.run(last="where")
    world.edit(
        'called("acquire")\n', 'called("acquire")\n' + STOPPING.replace("OUTCOME", "time.sleep(1000.0)")
    )
    began = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        world.run(last="acquire", deadline_s=60.0)
    assert time.monotonic() - began < 20
    assert world.ran()[-2:] == ["acquire", "stopped"]
    assert not stage_processes()
