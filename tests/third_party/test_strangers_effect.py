"""Effects that robid has never heard of run inside the simulator, and what is edited is what runs."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import numpy as np
import pytest
from oracles.quick_start import ROBID, run

from robid_core.testing import check_effect

HERE = Path(__file__).parent
PACKAGE = HERE / "robid_wear"

ROBOT = """\
robid_robot: 1
name: worn
base: one_axis
effects:
  brake: {use: friction.wear, on: axis_1, side: motor, with: {fresh: 0.6, worn: 0.2, path: 4.0}}
"""
MOVE = """\
import sys
import numpy as np
from robid_core import Robot
found = {}
for path in sys.argv[1:]:
    robot = Robot.load(path)
    wave = np.sin(2 * np.pi * 10 * robot.sample_time_s * np.arange(150))
    reference = 20.0 * (1 + np.arange(9))[:, None, None] * wave[:, None]
    angle = np.full((9, 1), 0.3)
    together = robot.simulate(reference, angle)
    found[f"{path} alone"] = robot.simulate(reference[:1], angle[:1]).torque
    found[f"{path} together"] = together.torque
    found[f"{path} path"] = together.state.law_state
np.savez("out.npz", **found)
"""
LAWS = ("friction.wear", "friction.wear_lanes")


PIPELINE = """\
robid: 1
name: worn
seed: 3
robot: robot.yaml
drives: {use: simulated, with: {plant: robot.yaml}}
stages:
  where: {use: design.candidates, with: {count: 1}}
  excite:
    use: excitation.multisine
    with: {band_hz: [5, 80], lines: 10, period_s: 1, blocks: 1, slow_sine_rad_s: 9, speed_rms_rad_s: 4}
  acquire: {use: acquisition.drives, with: {periods: 2, settle_periods: 1}}
"""


def robid(*arguments: str, folder: Path, environment: dict[str, str]) -> subprocess.CompletedProcess[str]:
    return run([*ROBID, *arguments], folder, environment)


def moved(folder: Path, environment: dict[str, str]) -> dict[str, np.ndarray]:
    """Torques on one lane and on nine, and the paths slid, with either law and without; by a new process."""
    for name in LAWS:
        (folder / name).write_text(ROBOT.replace("friction.wear", name))
    (folder / "without").write_text(ROBOT[: ROBOT.index("effects")])
    done = run(["-c", MOVE, *LAWS, "without"], folder, environment)
    assert done.returncode == 0, done.stderr
    with np.load(folder / "out.npz") as values:
        return dict(values)


def test_the_effect_is_explained(stranger: dict[str, str], tmp_path: Path) -> None:
    done = robid("stages", "friction.wear", folder=tmp_path, environment=stranger)
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert lines[0] == "friction.wear: robid.effects, robid-wear 0.3, robid_wear:Wear"
    assert lines[1] == "a force on side: motor (the default), arm; its law has 1 state"
    assert "  path   rad    2    0.001 to 1e+06  that it slides until then" in lines
    assert (
        "Source: J. F. Archard, Contact and rubbing of flat surfaces, Journal of Applied Physics 24, 1953"
        in lines
    )


def test_a_mistake_in_a_robot_file_is_told_like_any_other(stranger: dict[str, str], tmp_path: Path) -> None:
    (tmp_path / "robot.yaml").write_text(ROBOT.replace("fresh", "frehs"))
    code = "from robid_core import Robot; Robot.load('robot.yaml')"
    done = run(["-c", code], tmp_path, stranger)
    assert done.returncode == 1
    assert "did you mean 'fresh'?" in done.stderr


def test_both_laws_run_inside_the_simulator(stranger: dict[str, str], tmp_path: Path) -> None:
    found = moved(tmp_path, stranger)
    # 150 ms of 20 to 180 rad/s, 2 / pi of that in the mean, are 2 to 17 rad: worn in half, and long ago
    assert found["friction.wear path"][0, 0] < 4.0 < found["friction.wear path"][8, 0]
    for key in ("alone", "together", "path"):
        # one law, rounded in another order; nothing amplifies it in 150 ms
        np.testing.assert_allclose(
            found[f"friction.wear {key}"], found[f"friction.wear_lanes {key}"], rtol=0, atol=1e-9
        )
    for name in LAWS:
        alone, together = found[f"{name} alone"], found[f"{name} together"]
        np.testing.assert_allclose(alone[0], together[0], rtol=0, atol=1e-12)  # BLAS, at the start
        assert np.abs(alone - found["without alone"]).max() > 0.3  # of 0.6 N m


def test_an_edited_law_is_what_runs(stranger: dict[str, str], tmp_path: Path) -> None:
    """Even if the edit changes neither the length of the file nor its time."""
    installed, folder = tmp_path / "installed", tmp_path / "project"
    shutil.copytree(stranger["PYTHONPATH"], installed, ignore=shutil.ignore_patterns("__pycache__"))
    folder.mkdir()
    environment = stranger | {"PYTHONPATH": str(installed)}
    source = installed / "robid_wear" / "__init__.py"
    time, text = source.stat().st_mtime_ns, source.read_text()
    before = moved(folder, environment)
    source.write_text(text.replace("slid / path", "slid * path"))
    os.utime(source, ns=(time, time))
    edited = moved(folder, environment)
    for name in LAWS:
        for key in (f"{name} alone", f"{name} together"):
            assert np.abs(edited[key] - before[key]).max() > 0.05
    np.testing.assert_array_equal(edited["without together"], before["without together"])
    source.write_text(text)
    again = moved(folder, environment)
    for key, value in before.items():
        np.testing.assert_array_equal(again[key], value)


def test_an_edited_effect_is_recorded_anew(stranger: dict[str, str], tmp_path: Path) -> None:
    installed, folder = tmp_path / "installed", tmp_path / "project"
    shutil.copytree(stranger["PYTHONPATH"], installed, ignore=shutil.ignore_patterns("__pycache__"))
    folder.mkdir()
    (folder / "robot.yaml").write_text(ROBOT)
    (folder / "pipeline.yaml").write_text(PIPELINE)
    source = installed / "robid_wear" / "__init__.py"

    def outcomes() -> dict[str, str]:
        done = robid("run", folder=folder, environment=stranger | {"PYTHONPATH": str(installed)})
        assert done.returncode == 0, done.stderr
        manifest = json.loads((folder / "runs" / "worn" / "manifest.json").read_text())
        assert manifest["environment"]["versions"]["robid-wear"] == "0.3"
        return {name: stage["outcome"] for name, stage in manifest["stages"].items()}

    assert outcomes()["acquire"] == "made"
    assert outcomes()["acquire"] == "kept"
    source.write_text(source.read_text().replace("level = worn\n", "level = 0.9 * worn\n"))
    assert outcomes()["acquire"] == "made"


def test_its_own_tests_pass(stranger: dict[str, str], tmp_path: Path) -> None:
    shutil.copy(PACKAGE / "tests" / "test_wear.py", tmp_path)
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "test_wear.py"]
    done = subprocess.run(command, cwd=tmp_path, env=stranger, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
    assert "3 passed" in done.stdout


def test_the_effect_of_the_documentation_keeps_the_contract(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    page = (HERE.parent.parent / "docs" / "plugins.md").read_text(encoding="utf-8")
    (text,) = (block for block in re.findall(r"```python\n(.*?)```", page, re.DOTALL) if "@kernel" in block)
    path = tmp_path / "robid_churning.py"
    path.write_text(text)
    spec = spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    monkeypatch.setitem(sys.modules, path.stem, module)
    spec.loader.exec_module(module)
    check_effect(module.Churning)


LAB = """\
robid_robot: 1
name: lab_NAME
base: one_axis
effects:
  oil: {use: friction.churning, on: axis_1, with: {drag: DRAG}}
"""
FIT = """\
robid: 1
name: oiled
seed: 5
robot: told.yaml
drives: {use: simulated, with: {plant: true.yaml}}
stages:
  where: {use: design.candidates, with: {count: 2}}
  excite:
    use: excitation.multisine
    with: {band_hz: [4, 60], lines: 20, period_s: 2, blocks: 2, slow_sine_rad_s: 15}
  acquire: {use: acquisition.drives, with: {periods: 2}}
  fit:
    use: fit.torque_residual
    with: {free: [gear_*, friction.*.viscous, effect.oil.*], fixed: [gear_ratio.*], friction_widths: [0.5]}
"""


@pytest.fixture(name="lab")
def lab_environment(tmp_path: Path) -> dict[str, str]:
    """An environment in which the effect of the documentation is installed as its page says."""
    page = (HERE.parent.parent / "docs" / "plugins.md").read_text(encoding="utf-8")
    (law,) = (block for block in re.findall(r"```python\n(.*?)```", page, re.DOTALL) if "@kernel" in block)
    (entry,) = (b for b in re.findall(r"```toml\n(.*?)```", page, re.DOTALL) if "robid.effects" in b)
    target = tmp_path / "installed"
    metadata = target / "robid_churning-1.0.dist-info"
    metadata.mkdir(parents=True)
    (target / "robid_churning.py").write_text(law)
    (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: robid-churning\nVersion: 1.0\n")
    table = re.sub(r'\[project.entry-points."(.*)"\]', r"[\1]", entry).replace('"', "")
    (metadata / "entry_points.txt").write_text(table)
    return os.environ | {"PYTHONPATH": str(target)}


def test_the_effect_of_the_documentation_is_freed_in_a_fit_without_a_line_of_code(
    lab: dict[str, str], tmp_path: Path
) -> None:
    """Told half as strong in a robot file: `robid run` finds how strong it is."""
    folder = tmp_path / "project"
    folder.mkdir()
    for name, drag in (("told", 2e-4), ("true", 4e-4)):
        (folder / f"{name}.yaml").write_text(LAB.replace("NAME", name).replace("DRAG", str(drag)))
    (folder / "pipeline.yaml").write_text(FIT)
    done = robid("run", folder=folder, environment=lab)
    assert done.returncode == 0, done.stderr
    shown = (folder / "runs" / "oiled" / "robot.fit.yaml").read_text()
    found = re.search(r"effect.oil.drag: +([\d.e+-]+) .*standard error ([\d.e+-]+)", shown)
    assert found is not None, shown
    drag, error = map(float, found.groups())
    assert error < 2e-5
    assert abs(drag - 4e-4) < 3 * error


EXPLAIN = """\
robid: 1
name: oiled
seed: 5
robot: one_axis
drives: {use: simulated, with: {plant: true.yaml}}
stages:
  where: {use: design.candidates, with: {count: 3}}
  excite:
    use: excitation.multisine
    with: {band_hz: [4, 60], lines: 20, period_s: 2, blocks: 2, slow_sine_rad_s: 15}
  acquire: {use: acquisition.drives, with: {periods: 2}}
  explain: {use: diagnosis.effects}
"""


def test_the_effect_of_the_documentation_is_found_where_it_is_hidden(
    lab: dict[str, str], tmp_path: Path
) -> None:
    """Among all of the catalogue, by name and size: nothing in the package says how it is searched."""
    folder = tmp_path / "project"
    folder.mkdir()
    (folder / "true.yaml").write_text(LAB.replace("NAME", "true").replace("DRAG", "4e-4"))
    (folder / "pipeline.yaml").write_text(EXPLAIN)
    done = robid("run", folder=folder, environment=lab)
    assert done.returncode == 0, done.stderr
    told = json.loads((folder / "runs" / "oiled" / "verdict.explain.json").read_text())
    (finding,) = told["findings"]
    assert (finding["kind"], finding["effect"]) == ("cause", "friction.churning")
    (size,) = finding["parameters"]
    assert abs(size["estimate"] - 4e-4) < 4 * size["standard_error"]
