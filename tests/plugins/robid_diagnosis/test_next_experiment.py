"""The experiment that separates ties as configurations and an excitation."""

from __future__ import annotations

import numpy as np
import pytest

from robid_core import DataRejected, Diagnosis, Finding, Robot, SeparatingExperiment
from robid_core.stage import Stage
from robid_core.testing import check_stage
from robid_diagnosis.next_experiment import SeparatingConfigurations, SeparatingExcitation

NONE = np.empty(0)
WAVE = np.sin(2 * np.pi * np.arange(8) / 8)


def finding(ratio: float, angle: float, length: int = 8, n_axis: int = 1) -> Finding:
    separation = SeparatingExperiment(
        rivals=("load.counterbalance at axis_1 (arm)",),
        amplitude=1.0,
        duration_s=9.0,
        n_period=2,
        n_settling=1,
        difference="",
        configuration=np.full(n_axis, angle),
        reference=angle * np.tile(WAVE[:length, None], n_axis),
        ratio=np.array([ratio]),
        repeat=np.array([0.0]),
        line=np.array([3]),
    )
    return Finding(
        "cause", "load.cable_spring", "axis_1", "arm", 50.0, 1e-9, 1.0, (), (), NONE, NONE, NONE, NONE, NONE, NONE,
        separation=separation,
    )  # fmt: skip


def test_each_finding_has_its_configuration_and_its_motion_often_enough() -> None:
    """Blocks are as many as bring the expected ratio of the weakest to five: 5 / 2.1, rounded up."""
    robot = Robot.load("one_axis")
    found = (finding(2.1, 0.5), finding(0.3, 0.7), finding(9.0, -1.0), finding(9.0, 0.1, length=4))
    diagnosis = Diagnosis("effects", "", findings=found)
    assert SeparatingConfigurations().run(diagnosis, robot).angle.tolist() == [[0.5], [-1.0]]
    excitation = SeparatingExcitation().run(diagnosis, robot)
    assert excitation.reference.shape == (2, 3, 1, 8, 1)
    assert (excitation.reference[0] == 0.5 * WAVE[:, None]).all()
    assert (excitation.reference[1] == -1.0 * WAVE[:, None]).all()
    assert excitation.line.tolist() == [3]
    assert SeparatingExcitation(most=2).run(diagnosis, robot).reference.shape[1] == 2


def test_nothing_to_separate_is_one_sentence() -> None:
    diagnosis = Diagnosis("effects", "", findings=(finding(0.3, 0.7),))
    with pytest.raises(DataRejected, match="no ties that an experiment would separate"):
        SeparatingConfigurations().run(diagnosis, Robot.load("one_axis"))


@pytest.mark.parametrize("cls", [SeparatingConfigurations, SeparatingExcitation])
def test_the_stages_keep_the_contract(cls: type[Stage]) -> None:
    check_stage(
        cls,
        artifacts=lambda robot: {
            Diagnosis: Diagnosis("effects", "", findings=(finding(2.1, 0.1, n_axis=robot.n_axis),))
        },
    )
