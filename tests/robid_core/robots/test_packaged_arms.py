"""The packaged arms run the worked example, shortened, on drives simulated in memory: every stiffness is found."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from robid_core import Design, Fit, Robot
from robid_core.pipeline import Pipeline
from robid_core.run import RunResult, run_pipeline

# The stages of pipeline.yaml with two poses of 1 s. Three tenths of the torque limits: half of them, which is the
# default, takes light wrists beyond their speed limits, and the excitation refuses that.
PIPELINE = """robid: 1
name: worked
seed: 7
robot: {name}
drives: {{use: simulated, with: {{plant: {name}_true}}}}
stages:
  where:   {{use: design.candidates, with: {{count: 2}}}}
  excite:
    use: excitation.multisine
    with: {{band_hz: [4, 80], lines: 24, period_s: 1, blocks: 2, slow_sine_rad_s: 9, torque_share: 0.3}}
  acquire: {{use: acquisition.drives, inputs: {{configurations: where}}, with: {{periods: 2, settle_periods: 1}}}}
  frf:     {{use: frf.log}}
  log_fit: {{use: fit.log_response, with: {{starts: 1}}}}
  fit:     {{use: fit.torque_residual}}
  choose:  {{use: design.optimal, inputs: {{fit: log_fit}}, with: {{criterion: D, candidates: 40, experiments: 4}}}}
"""


def read(result: RunResult, stage: str, kind: type[Any]) -> Any:
    return kind.read(result.folder.path / result.manifest.stages[stage].file)


@pytest.mark.parametrize("name", ["scara", "universal_arm", "seven_axis"])
def test_the_worked_example_finds_every_stiffness(name: str, tmp_path: Path) -> None:
    """Within four standard errors as stated, and 0.1 % (the tool's axis of seven_axis, hardly seen: 0.05 % stated).

    `fit.log_response` from 1 s a pose states up to 3 %; four of its standard errors hold the truth, too.
    """
    (tmp_path / "pipeline.yaml").write_text(PIPELINE.format(name=name))
    result = run_pipeline(Pipeline.load(tmp_path / "pipeline.yaml"))
    assert result.exit_code == 0
    truth, nominal = Robot.load(f"{name}_true"), Robot.load(name)
    for stage, bound in (("fit", 1e-3), ("log_fit", 0.1)):
        fit = read(result, stage, Fit)
        assert fit.converged
        assert fit.model is not None
        errors = fit.model.standard_errors()
        for spring in truth.stiffness_names:
            true = truth.parameter(spring)
            assert abs(nominal.parameter(spring) / true - 1) > 0.2  # what was believed before
            assert abs(fit.parameters.value(spring) - true) < min(4 * errors[spring], bound * true), spring
    design = read(result, "choose", Design)
    assert design.angle.shape[1] == truth.n_axis
    lower, upper = nominal.drives.lower, nominal.drives.upper
    assert np.all((design.angle >= lower) & (design.angle <= upper))
    assert design.experiments.sum() == 4
