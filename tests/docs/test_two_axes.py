"""The two axes of `docs/your_own_data.md`, from its blocks to what its text says: both springs, and a prediction."""

from __future__ import annotations

from pathlib import Path

import pytest

import robid_core as robid

PAGE = Path(__file__).parents[2] / "docs" / "your_own_data.md"
SPRINGS = {"gear_stiffness.shoulder": 4.5e4, "gear_stiffness.elbow": 2.6e4}


def test_a_folder_of_two_axes_gives_both_springs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("ROBID_DATA", str(tmp_path))
    section = (
        PAGE.read_text(encoding="utf-8").partition("## The same with two axes\n")[2].partition("\n## ")[0]
    )
    robot, recordings, pipeline = (part.partition("\n")[2] for part in section.split("```")[1::2])
    Path("lab").mkdir()
    Path("shoulder_and_elbow.yaml").write_text(robot)
    Path("pipeline.yaml").write_text(pipeline)
    exec(compile(recordings, "block of a page", "exec"), {})
    run = robid.Run.make("pipeline.yaml")
    fit, check = run["fit"], run["check"]
    assert isinstance(fit, robid.Fit)
    assert isinstance(check, robid.Diagnosis)
    table = dict(
        zip(
            fit.parameters.names,
            zip(fit.parameters.estimate, fit.parameters.standard_error, strict=True),
            strict=True,
        )
    )
    for name, true in SPRINGS.items():
        estimate, error = table[name]
        assert abs(estimate - true) < 4 * error  # one in 16 000 of sound fits is further off
        assert error < 0.002 * true
    assert fit.converged
    before, after = (float((one.relative**2).mean() ** 0.5) for one in (check.errors[0], check.errors[-1]))
    assert after < 0.01 < 0.3 < before  # the noise alone is half a percent of the torque
