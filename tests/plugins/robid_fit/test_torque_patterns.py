"""`robid validate` tells at its place in the file what `fit.torque_residual` cannot free in this robot."""

from __future__ import annotations

from pathlib import Path

import pytest

from robid_core.commands.app import command_line

TEXT = """\
robid: 1
name: patterns
seed: 7
robot: robot.yaml
drives: {use: simulated, with: {plant: one_axis_true}}
stages:
  where:   {use: design.candidates, with: {count: 3}}
  excite:  {use: excitation.multisine, with: {band_hz: [10, 80], lines: 12, period_s: 1.0, slow_sine_rad_s: 9}}
  acquire: {use: acquisition.drives, with: {periods: 2}}
  fit:
    use: fit.torque_residual
    with: WITH
"""
ROBOT = """\
robid_robot: 1
name: greased
base: one_axis
effects:
  grease: {use: friction.stribeck, on: axis_1, with: {breakaway: 1.2}}
  warm: {use: drive.torque_constant, on: axis_1}
  ripple: {use: drive.torque_ripple, on: axis_1, with: {relative: 0.01, phase: 0.4}}
"""


def said(
    command: str,
    settings: str,
    folder: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> tuple[int, list[str]]:
    monkeypatch.chdir(folder)
    (folder / "robot.yaml").write_text(ROBOT, encoding="utf-8")
    (folder / "pipeline.yaml").write_text(TEXT.replace("WITH", settings), encoding="utf-8")
    with pytest.raises(SystemExit) as ended:
        command_line([command])
    out, err = capsys.readouterr()
    return int(ended.value.code or 0), (err or out).splitlines()


NO = "the robot has no parameter"
WRONG: dict[str, dict[str, str]] = {  # settings, and what is said where in them
    "{free: [gear_stifness.*, effect.gease.*], prior: {mass: 0.1}}": {
        "gear_stifness": f"free[0]: {NO} 'gear_stifness.*'; did you mean 'gear_stiffness.*'?",
        "effect.gease": f"free[1]: {NO} 'effect.gease.*'; did you mean 'effect.grease.",
        "mass: 0.1": f"prior.mass: {NO} 'mass'; did you mean 'mass.*'?",
    },
    "{fixed: [mass.*], prior: {mass.*: 0.1}}": {
        "mass.*: 0.1": "prior.mass.*: prior 'mass.*': what it means is held fixed"
    },
    "{free: [gear_*, controller.*, friction.*]}": {
        "controller": "free[1]: 'controller.*' means controller.axis_1.",
        "friction": "free[2]: 'friction.*' means friction.axis_1.coulomb: free functions of speed stand in its place",
    },
    "{free: [gear_*, mass.*, effect.warm.error, effect.ripple.*]}": {
        "free": "free: effect.warm.error: torques, inertia and springs have a common scale that no motion shows",
    },
    "{fixed: [inertia.*.xy]}": {
        "inertia": "fixed[0]: inertia.axis_1: its moments are free together"
    },
}  # fmt: skip


@pytest.mark.parametrize("settings", WRONG)
@pytest.mark.parametrize("command", ["validate", "run"])
def test_what_cannot_be_freed_is_told_before_anything_runs(
    settings: str,
    command: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    code, lines = said(command, settings, tmp_path, capsys, monkeypatch)
    assert code == 2
    for line, (place, message) in zip(lines, WRONG[settings].items(), strict=True):
        column = len("    with: ") + settings.index(place) + 1
        assert line.startswith(f"pipeline.yaml:12:{column}: stages.fit.with.{message}"), line
    assert not (tmp_path / "runs").exists()


@pytest.mark.parametrize(
    "settings",
    [
        "{}",
        "{free: [gear_*, effect.grease.*, effect.ripple.*, inertia.*], prior: {inertia.*: 0.05}}",
        "{free: [gear_*, friction.*.viscous, effect.warm.error]}",
    ],
)
def test_right_patterns_are_valid(
    settings: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert said("validate", settings, tmp_path, capsys, monkeypatch) == (
        0,
        ["pipeline.yaml: valid, 4 stages"],
    )
