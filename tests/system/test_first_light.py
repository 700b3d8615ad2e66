"""The worked example from end to end: twelve stiffnesses, a page, and a second run that does nothing."""

import hashlib
import json
import re
from pathlib import Path

import numpy as np
import pytest

from robid_core import Design, Fit, Frf, Record, Robot
from robid_core.registry import registry

pytestmark = pytest.mark.system


def digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def test_the_run_ends_well_and_its_last_screen_fits_25_lines(first_light) -> None:
    assert first_light.told.code == 0, first_light.told.err
    screen = first_light.told.out.splitlines()
    assert len(screen) <= 25
    table = [line.split() for line in screen if "stiffness" in line]
    assert len(table) == 12
    assert "page.html" in first_light.told.out
    assert "robid run pipeline.yaml" in first_light.told.out


def test_springs_from_the_torque_are_within_a_thousandth_and_misfit_is_one(first_light) -> None:
    """Bodies are told right here, and the noise is small; what else may happen is measured by the study of the fit."""
    fit, truth = Fit.read(first_light.artifacts / "fit.h5"), Robot.load("six_axis_true").parameters()
    assert fit.converged
    assert not fit.doubts
    assert fit.misfit == pytest.approx(1.0, abs=0.05)
    for name in Robot.load("six_axis").stiffness_names:
        assert fit.parameters.value(name) == pytest.approx(truth[name], rel=1e-3), name


def test_stiffnesses_from_responses_are_within_two_percent(
    first_light,
) -> None:
    fit, truth = Fit.read(first_light.artifacts / "log_fit.h5"), Robot.load("six_axis_true").parameters()
    assert fit.converged
    assert not fit.doubts
    for name in Robot.load("six_axis").stiffness_names:
        assert fit.parameters.value(name) == pytest.approx(truth[name], rel=0.02), name


@pytest.mark.parametrize("stage", ["fit", "log_fit"])
def test_stated_errors_are_of_the_size_of_the_real_ones(first_light, stage: str) -> None:
    """Twelve squared standardised errors have mean 1 +- 5 sqrt(2/12) where they hold; twice for the model's error."""
    fit, truth = Fit.read(first_light.artifacts / f"{stage}.h5"), Robot.load("six_axis_true").parameters()
    table = fit.parameters
    rows = [table.names.index(n) for n in table.names if "stiffness" in n]
    true = np.array([truth[table.names[i]] for i in rows])
    z = (table.estimate[rows] - true) / table.standard_error[rows]
    assert np.mean(z**2) < 2 * (1 + 5 * np.sqrt(2 / 12))


def test_the_fitted_model_explains_the_diagonal_of_the_measured_response(first_light) -> None:
    fit = Fit.read(first_light.artifacts / "log_fit.h5")
    assert fit.response is not None
    index = np.arange(6)
    measured = fit.response.measured[:, :, index, index]
    fitted = np.abs(np.log(fit.response.modelled[:, :, index, index] / measured))
    start = np.abs(np.log(fit.response.start[:, :, index, index] / measured))
    assert np.median(fitted) < 0.3 * np.median(start)
    assert np.median(fitted) < 0.1


def test_the_response_has_a_positive_definite_covariance_on_every_valid_line(first_light) -> None:
    frf = Frf.read(first_light.artifacts / "frf.h5")
    assert frf.has_covariance
    for c in range(4):
        values = np.linalg.eigvalsh(frf.covariance(c)[frf.valid_lines[c]])
        assert (values > 0).all()


def test_the_design_is_certified_and_spends_its_eight_experiments(first_light) -> None:
    design = Design.read(first_light.artifacts / "choose.h5")
    assert design.experiments.sum() == 8
    assert 0 <= design.gap + 1e-6 < 1e-2
    assert 0.8 < design.efficiency <= 1 + 1e-9


def test_the_page_sets_the_two_fits_side_by_side(first_light) -> None:
    page = (first_light.artifacts / "page.html").read_text(encoding="utf-8")
    section = page[page.index("Another fit beside it") :].partition("</section>")[0].replace("<wbr>", "")
    assert section.count("gear_stiffness.axis_") == 6
    assert section.count("bearing_stiffness.axis_") == 6
    assert "The model is that of another fit" in page
    assert "Errors are promised for a fit of responses" in page


def test_the_page_is_one_file_that_fetches_nothing(first_light) -> None:
    page = (first_light.artifacts / "page.html").read_text(encoding="utf-8")
    markup = re.sub(
        r"<script.*?</script>", "", page, flags=re.DOTALL
    )  # plotly's own text names its home page
    assert not re.search(r"""(?:src|href)\s*=\s*["']?(?:https?:)?//""", markup)
    assert "<script src" not in page
    assert "default-src 'none'" in page
    for name in Robot.load("six_axis").stiffness_names:
        assert name in page


def test_a_second_run_does_nothing_and_says_so(first_light, robid) -> None:
    before = {p.name: p.stat().st_mtime_ns for p in first_light.artifacts.iterdir()}
    told = robid(first_light.folder, "run", "pipeline.yaml")
    assert {p.name: p.stat().st_mtime_ns for p in first_light.artifacts.iterdir()} == before
    assert told.code == 0
    assert "nothing to do, all 8 stages are up to date" in told.out


def test_one_changed_setting_reruns_what_depends_on_it_and_nothing_else(first_light, robid) -> None:
    told = robid(
        first_light.folder, "run", "pipeline.yaml", "--dry-run", "--set", "stages.log_fit.with.starts=5"
    )
    plan = dict(line.split(maxsplit=2)[:2] for line in told.out.splitlines() if line)
    assert {name for name, verb in plan.items() if verb == "run"} == {"log_fit", "choose", "page"}
    assert "starts: 20 -> 5" in told.out


def test_a_damaged_artifact_is_named_set_aside_and_made_again(first_light, robid) -> None:
    artifact = first_light.artifacts / "choose.h5"
    good = digest(artifact)
    artifact.chmod(0o644)
    data = bytearray(artifact.read_bytes())
    data[len(data) // 2] ^= 1
    artifact.write_bytes(bytes(data))
    shown = robid(first_light.folder, "show", "pipeline.yaml", "choose")
    assert shown.code == 7
    assert "changed or damaged" in shown.err
    told = robid(first_light.folder, "run", "pipeline.yaml")
    assert told.code == 0
    assert "choose" in told.err + told.out
    assert digest(first_light.artifacts / "choose.h5") == good


def test_the_manifest_holds_what_is_needed_to_make_the_run_again(first_light) -> None:
    manifest = json.loads((first_light.folder / "runs/six-axis/manifest.json").read_text(encoding="utf-8"))
    text = json.dumps(manifest)
    for word in ("python", "numpy", "numba", "robid", "seed", "sha256"):
        assert word in text.lower(), word


def test_the_raw_log_gives_the_same_record(first_light) -> None:
    (log,) = (first_light.folder / "runs/six-axis").rglob("*.mcap")
    again = registry().load("robid.records", "mcap").read_record(log)
    record = Record.read(first_light.artifacts / "acquire.h5")
    for name in record.run.channels:
        np.testing.assert_array_equal(again.run.values(name), record.run.values(name))
    np.testing.assert_array_equal(again.angle, record.angle)
