"""Kernels are compiled before the first simulation, said so, and nowhere else."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from robid_core import Pipeline, Robot
from robid_core.estimation.rigid.rigid_torque import motor_torque
from robid_core.residual import rigid_drives

_SMALL = "from robid_core.compiled.kernel import kernel\n\n\n@kernel\ndef plus(x):\n    return x + 1.0\n"
_AHEAD = """
import robid_core.run.compilation as c
def part():
    import small
    small.plus(1.0)
c._WAVES = (((part,),),)
if __name__ == "__main__":
    c.compile_ahead(lambda done, total, text: print(done, total, text), say=lambda text: print("say", text))
"""
_TOLD = """
from robid_core.compiled.telling import compilation_told
import small
with compilation_told(print):
    small.plus(1.0)
"""


def said(script: Path, text: str, cache: Path) -> list[str]:
    script.write_text(text)
    small = script.with_name("small.py")
    if not small.exists():
        small.write_text(_SMALL)
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), "NUMBA_CACHE_DIR": str(cache)}
    done = subprocess.run(
        [sys.executable, str(script)], env=environment, capture_output=True, text=True, check=True
    )
    return done.stdout.splitlines()


def test_what_is_compiled_ahead_is_told_and_found_by_the_next_process(tmp_path: Path) -> None:
    told = said(tmp_path / "ahead.py", _AHEAD, tmp_path / "cache")
    assert [line.split(" ", 2)[:2] for line in told[1:3]] == [["0", "1"], ["1", "1"]]
    assert "compiling kernels, once" in told[1]
    assert told[0].startswith("say compiling kernels, once, on")
    assert told[0].endswith("15 to 40 s; later runs on this machine load them from disk")
    (seconds,) = re.findall(r"^say kernels compiled in ([\d.]+) s$", told[3])
    assert 0 < float(seconds) < 60
    assert said(tmp_path / "told.py", _TOLD, tmp_path / "cache") == [], "nothing is left to compile"


def test_the_first_kernel_that_is_not_on_disk_is_told_before_it_is_compiled(tmp_path: Path) -> None:
    told = said(tmp_path / "told.py", _TOLD, tmp_path / "cache")
    assert len(told) == 1
    assert said(tmp_path / "told.py", _TOLD, tmp_path / "cache") == []


@pytest.mark.usefixtures("monkeypatch")
def test_nothing_is_done_where_the_simulator_is_on_disk(monkeypatch: pytest.MonkeyPatch) -> None:
    from robid_core.run import compilation

    monkeypatch.setattr(compilation, "kept_codes", lambda _: 2)
    monkeypatch.setattr(compilation, "process_executor", lambda _: pytest.fail("work is given out"))
    compilation.compile_ahead()


def test_a_log_is_told_when_compiling_begins_and_how_long_it_took(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], world: Any
) -> None:
    """A pipe or the log of a CI run shows no bar: 22 s passed in silence there."""
    from robid_core.commands.run_screen import Lines
    from robid_core.run import calling, rehearsal

    def compiled(_note: object, _jobs: int = 0, say: Callable[[str], None] | None = None) -> None:
        assert say is not None
        say("compiling kernels")

    monkeypatch.setattr(rehearsal, "compile_ahead", compiled)
    monkeypatch.setattr(calling, "compile_ahead", compiled)
    multisine = {"band_hz": [4, 40], "lines": 8, "period_s": 1}
    pipeline = Pipeline.from_dict(
        {
            "robot": "one_axis",
            "drives": {"use": "simulated", "with": {"plant": "one_axis_true"}},
            "stages": {
                "where": {"use": "design.candidates", "with": {"count": 1}},
                "excite": {"use": "excitation.multisine", "with": multisine},
                "acquire": {"use": "acquisition.drives", "inputs": {"configurations": "where"}},
            },
        }
    )
    rehearsal.rehearse(pipeline, Lines())
    assert "compiling kernels\n" in capsys.readouterr().err
    world.run(listener=Lines())
    assert "compiling kernels\n" in capsys.readouterr().err


_RECORDING = """
robid: 1
name: recording
seed: 1
robot: scara
stages:
  acquire:
    use: acquisition.recorded
    with:
      path: run.npz
      sample_time_s: 0.001
      torque_hold: zero_order_hold
      channels: {motor_position: {column: angle, unit: rad}, motor_torque: {column: torque, unit: N m}}
  fit: {use: fit.rigid}
"""


def test_a_recording_is_read_checked_and_fitted_without_compiling(tmp_path: Path) -> None:
    """No motion is simulated: not for the check against the robot file either, on an arm with springs."""
    robot = Robot.load("scara")
    time, draw = 1e-3 * np.arange(6000), np.random.default_rng(1)
    rate, phase = draw.uniform(2.0, 8.0, (5, 1, 4)), draw.uniform(0, 2 * np.pi, (5, 1, 4))
    joints = 0.05 * np.sin(rate * time[:, None] + phase).sum(axis=0) + [0.3, 0.4, -0.1, 0.2]
    angle = robot.motor_angle(joints)
    speed = np.gradient(angle, time, axis=0)
    torque = motor_torque(rigid_drives(robot), angle, speed, np.gradient(speed, time, axis=0))
    np.savez(tmp_path / "run.npz", angle=angle, torque=torque + 0.002 * draw.standard_normal(torque.shape))
    (tmp_path / "recording.yaml").write_text(_RECORDING)
    words = "from robid_core.commands import main; import sys; sys.argv[0] = 'robid'; main()"
    done = subprocess.run(
        [sys.executable, "-c", words, "run", "recording.yaml", "--data", "."],
        env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache")},
        cwd=tmp_path, capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert "fit: made" in done.stdout + done.stderr
    assert not list((tmp_path / "cache").rglob("*.nbi"))
