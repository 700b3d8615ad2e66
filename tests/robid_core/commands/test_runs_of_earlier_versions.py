"""What earlier versions of robid made is shown and compared, or refused in one sentence.

`golden/run_of_0_1.tar.xz` is a run of the packaged one-axis robot, all but its page and raw log, made by the first
whole state of 0.1 (commit 8e5fea4) from the pipeline that stands in it; its manifest says less of the machine.
"""

from __future__ import annotations

import hashlib
import json
import tarfile
from collections.abc import Callable
from pathlib import Path

import h5py
import pytest

from robid_core import Fit, StoreError
from robid_core.artifacts import Artifact
from robid_core.commands import main

GOLDEN = Path(__file__).parent / "golden" / "run_of_0_1.tar.xz"
# A line of each result as `robid show` of that version wrote it.
SHOWN = {
    "where": "  angle: 1 n_config x 1 n_axis, 0.2376 to 0.2376 rad",
    "excite": "  reference: 1 n_realization x 1 n_block x 1 n_exp x 100 n_sample x 1 n_axis, -77.37 to 85.94 rad/s",
    "acquire": "      values: 1 n_config x 1 n_block x 1 n_exp x 2 n_period x 100 n_sample x 1 n_axis, -6.852 to 6.355",
    "frf": "  response: 1 n_config x 3 n_freq x 1 n_out x 1 n_in, size 842.7 to 956.7 (rad/s^2)/(N m)",
    "fit": "    estimate: 3 n_parameter, 1.03 to 5.877e+04",
    "choose": "  information: 1 n_parameter x 1 n_parameter, 4.85e+07 to 4.85e+07",
    "verify": "  motor_torque                200 samples          3.72 %",
}


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """Folder of the old run."""
    with tarfile.open(GOLDEN) as archive:
        archive.extractall(tmp_path, filter="data")
    return tmp_path / "old"


@pytest.fixture(name="robid")
def command(capsys: pytest.CaptureFixture[str]) -> Callable[..., str]:
    """Return a function that runs a command line to a good end and gives its output."""

    def robid(*arguments: str | Path) -> str:
        with pytest.raises(SystemExit) as end:
            main(tuple(str(argument) for argument in arguments))
        out, err = capsys.readouterr()
        assert not end.value.code, err
        return out

    return robid


def test_a_run_of_0_1_is_listed_and_each_of_its_results_shown(run: Path, robid: Callable[..., str]) -> None:
    listed = robid("show", run)
    for stage, line in SHOWN.items():
        assert f"artifacts/{stage}.h5" in listed
        by_stage, by_file = robid("show", run, stage), robid("show", run / "artifacts" / f"{stage}.h5")
        assert by_stage == by_file
        assert line in by_stage.splitlines()


def test_a_run_of_0_1_is_compared_with_itself_and_with_another(
    run: Path, tmp_path: Path, robid: Callable[..., str]
) -> None:
    assert robid("diff", run, run) == "no difference: the same settings, versions and results\n"
    other = tmp_path / "other"
    run.rename(other)
    with tarfile.open(GOLDEN) as archive:
        archive.extractall(tmp_path, filter="data")
    # As this version would write a fit: a stiffness two standard errors (of the difference) higher.
    fit = Fit.read(run / "artifacts" / "fit.h5")
    table = fit.parameters
    higher = table.estimate.copy()
    higher[0] += 2 * 2**0.5 * table.standard_error[0]
    path = other / "artifacts" / "fit.h5"
    path.unlink()
    fit.replace(parameters=table.replace(estimate=higher)).write(path)
    manifest = json.loads((other / "manifest.json").read_text())
    manifest["stages"]["fit"]["sha256"] = hashlib.sha256(path.read_bytes()).hexdigest()
    manifest["robot"]["sha256"] = "0" * 64
    (other / "manifest.json").write_text(json.dumps(manifest))
    lines = robid("diff", run, other).splitlines()
    assert "  robot: one_axis says something else in the second" in lines
    (row,) = [line.split() for line in lines if "gear_stiffness.axis_1" in line]
    assert row[-1] == "+2.00"


def without_angle(file: h5py.File) -> None:
    del file["angle"]


def with_an_axis_less(file: h5py.File) -> None:
    del file["angle"]
    file["angle"] = [0.0]


def of_a_class_that_is_gone(file: h5py.File) -> None:
    file.attrs["robid_artifact"] = "Poses"


def of_a_newer_format(file: h5py.File) -> None:
    file.attrs["robid_version"] = 99


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (without_angle, "/ is not a whole Configurations of this version of robid: angle is missing; make it again"),
        (with_an_axis_less, "/ cannot be a Configurations of this version of robid: Configurations.angle: shape (1,) "),
        (of_a_class_that_is_gone, "holds an artifact of class Poses, which no installed package defines"),
        (of_a_newer_format, "written by a newer robid; update robid to read it"),
    ],
)  # fmt: skip
def test_what_this_version_cannot_take_is_refused_in_one_sentence(
    run: Path, change: Callable[[h5py.File], None], told: str
) -> None:
    path = run / "artifacts" / "where.h5"
    path.chmod(0o644)
    with h5py.File(path, "r+") as file:
        change(file)
    with pytest.raises(StoreError) as refused:
        Artifact.read(path)
    message = str(refused.value)
    assert message.startswith(f"{path}: ")
    assert told in message
    assert "\n" not in message
