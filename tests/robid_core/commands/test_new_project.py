"""The project that `robid init` makes ends without doubt: it is the first thing that a stranger sees."""

from pathlib import Path

import pytest

from robid_core.artifacts import Fit
from robid_core.commands.init import project_files
from robid_core.pipeline import Pipeline
from robid_core.robot import Robot
from robid_core.run import RunOptions, run_pipeline


@pytest.mark.parametrize("settings", [("seed=1",), ("seed=2", "stages.excite.with.torque_share=0.1")])
def test_a_new_project_ends_without_doubt_and_finds_the_plants_spring(
    tmp_path: Path, settings: tuple[str, ...]
) -> None:
    """Five standard errors: a chance of 6e-7 by a normal law."""
    for name, text in project_files(tmp_path, "one_axis", own_robot=False).items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    done = run_pipeline(Pipeline.load(tmp_path / "pipeline.yaml", settings), RunOptions(jobs=1, last="fit"))
    assert done.doubts == ()
    assert done.exit_code == 0
    table = Fit.read(done.folder.path / done.manifest.stages["fit"].file).parameters
    spring, true = "gear_stiffness.axis_1", Robot.load("one_axis_true").parameter("gear_stiffness.axis_1")
    error = table.standard_error[table.names.index(spring)]
    assert abs(table.value(spring) - true) < 5 * error
    assert error < 1e-3 * true
