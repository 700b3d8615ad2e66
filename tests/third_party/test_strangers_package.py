"""A package that robid has never heard of is found, explained, run and cached like a built-in one."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from oracles.quick_start import ROBID, run

PACKAGE = Path(__file__).parent / "robid_etfe"

PIPELINE = """\
robid: 1
name: stranger
seed: 3
robot: one_axis
drives: {use: simulated, with: {plant: one_axis_true}}
stages:
  where: {use: design.candidates, with: {count: 2}}
  excite:
    use: excitation.multisine
    with: {band_hz: [5, 80], lines: 20, period_s: 2, blocks: 2, slow_sine_rad_s: 9, speed_rms_rad_s: 4}
  acquire: {use: acquisition.drives, with: {periods: 2, settle_periods: 1}}
  frf: {use: frf.etfe}
"""


@pytest.fixture(name="project")
def project_folder(tmp_path: Path) -> Path:
    (tmp_path / "pipeline.yaml").write_text(PIPELINE)
    return tmp_path


def robid(*arguments: str, project: Path, environment: dict[str, str]) -> subprocess.CompletedProcess[str]:
    return run([*ROBID, *arguments], project, environment)


def test_the_package_is_listed_with_its_version(stranger: dict[str, str], project: Path) -> None:
    done = robid("stages", project=project, environment=stranger)
    assert done.returncode == 0
    (line,) = [line for line in done.stdout.splitlines() if line.startswith("frf.etfe")]
    assert "robid-etfe 1.2" in line
    assert "FRF as the ratio of period-averaged spectra" in line


def test_the_package_is_explained(stranger: dict[str, str], project: Path) -> None:
    done = robid("stages", "frf.etfe", project=project, environment=stranger)
    assert done.returncode == 0
    assert "takes record: Record; makes Frf" in done.stdout
    assert "discard  integer >= 0  0  Leading periods dropped as transient." in done.stdout


def test_its_mistakes_are_told_like_any_other(stranger: dict[str, str], project: Path) -> None:
    (project / "pipeline.yaml").write_text(PIPELINE.replace("frf.etfe", "frf.etfe, with: {discrad: 1}"))
    done = robid("validate", project=project, environment=stranger)
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr == (
        "pipeline.yaml:12:31: stages.frf.with.discrad: unknown key 'discrad'; did you mean 'discard'?\n"
    )


def test_without_the_package_the_file_is_refused_before_anything_runs(project: Path) -> None:
    done = robid("validate", project=project, environment=dict(os.environ))
    assert done.returncode == 2
    assert done.stderr.startswith("pipeline.yaml:12:9: stages.frf.use: no stage 'frf.etfe'; ")
    assert "Traceback" not in done.stderr


def test_the_package_runs_in_a_pipeline_and_is_cached(stranger: dict[str, str], project: Path) -> None:
    done = robid("run", project=project, environment=stranger)
    assert done.returncode == 0, done.stderr
    manifest = json.loads((project / "runs" / "stranger" / "manifest.json").read_text())
    text = json.dumps(manifest)
    assert "robid-etfe" in text
    assert manifest["stages"]["frf"]["artifact"] == "Frf"
    again = robid("run", project=project, environment=stranger)
    assert again.returncode == 0, again.stderr
    after = json.loads((project / "runs" / "stranger" / "manifest.json").read_text())
    assert {name: stage["outcome"] for name, stage in after["stages"].items()} == dict.fromkeys(
        ["where", "excite", "acquire", "frf"], "kept"
    )


def test_its_own_test_passes(stranger: dict[str, str], tmp_path: Path) -> None:
    shutil.copy(PACKAGE / "tests" / "test_etfe.py", tmp_path)
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "test_etfe.py"]
    done = subprocess.run(command, cwd=tmp_path, env=stranger, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
    assert "1 passed" in done.stdout
