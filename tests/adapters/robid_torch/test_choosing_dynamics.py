"""A robot carries the name of what computes its dynamics; a library that is missing is one line."""

from __future__ import annotations

import pickle
import subprocess
import sys
from pathlib import Path

import pytest

from robid_core import ConfigurationError, PluginError, Robot
from robid_core.pipeline import Pipeline

PIPELINE = """
robid: 1
name: missing
seed: 1
robot: {model: one_axis, dynamics: torch}
stages:
  excite: {use: excitation.multisine, with: {band_hz: [4, 60], repeats: 2}}
"""


@pytest.fixture
def without_torch(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make `import torch` fail as on a machine without it."""
    for name in [name for name in sys.modules if name.partition(".")[0] == "robid_torch"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "torch", None)


@pytest.mark.usefixtures("without_torch")
def test_a_robot_without_its_library_says_what_to_install() -> None:
    with pytest.raises(PluginError) as told:
        Robot.load("one_axis", dynamics="torch")
    assert str(told.value).startswith("robot uses dynamics 'torch'")
    assert str(told.value).endswith('run: pip install "robid[torch]"')
    assert "\n" not in str(told.value)


@pytest.mark.usefixtures("without_torch")
def test_a_pipeline_that_wants_a_missing_library_is_refused_before_it_runs(tmp_path: Path) -> None:
    file = tmp_path / "pipeline.yaml"
    file.write_text(PIPELINE)
    with pytest.raises(ConfigurationError) as told:
        Pipeline.load(file)
    about = [line for line in str(told.value).splitlines() if "'torch'" in line]
    assert len(about) == 1
    assert about[0].startswith(f"{file}:5:")
    assert about[0].endswith('run: pip install "robid[torch]"')


def test_plugins_are_listed_without_importing_the_library() -> None:
    pytest.importorskip("torch")
    listed = (
        "import sys; from robid_core.commands.stages import row; from robid_core.registry import DYNAMICS, registry; "
        "rows = [row(one) for one in registry().plugins(DYNAMICS)]; print('torch' in sys.modules, rows)"
    )
    said = subprocess.run([sys.executable, "-c", listed], capture_output=True, text=True, check=True).stdout
    assert said.startswith("False")
    assert "FAILS" not in said
    assert said.count("robid_torch") + said.count("The functions of") == 2


@pytest.fixture
def damaged_torch(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make what imports torch fail as with a library that is installed and damaged."""
    monkeypatch.setitem(sys.modules, "robid_torch.batches", None)


@pytest.mark.usefixtures("damaged_torch")
def test_a_library_that_is_damaged_is_told_where_it_is_used() -> None:
    pytest.importorskip("torch")
    robot = Robot.load("one_axis", dynamics="torch")
    with pytest.raises(PluginError, match="dynamics 'torch': .* when PyTorch was imported"):
        robot.equilibrium([[0.1]])


def test_dynamics_that_nobody_registered_are_refused() -> None:
    with pytest.raises(ConfigurationError, match="no dynamics 'troch'; did you mean 'torch'"):
        Robot.load("one_axis", dynamics="troch")


def test_changed_and_copied_robots_keep_their_dynamics() -> None:
    pytest.importorskip("torch")
    robot = Robot.load("one_axis", dynamics="torch")
    name = robot.stiffness_names[0]
    assert robot.with_parameters({name: 1e4}).dynamics == "torch"
    assert pickle.loads(pickle.dumps(robot)) == robot
    assert robot != Robot.load("one_axis")
    assert robot.to_yaml() == Robot.load("one_axis").to_yaml()
