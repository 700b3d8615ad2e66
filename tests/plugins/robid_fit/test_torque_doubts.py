"""What `fit.torque_residual` hands to the list of doubts: its priors, and what its misfit is against."""

from __future__ import annotations

import logging

import numpy as np
import pytest

from robid_core import Context, Record
from robid_core.stage import map_in_process
from robid_core.testing.inputs import example_artifacts
from robid_core.testing.robots import example_robot
from robid_fit.torque_residual import TorqueResidualFit


def test_priors_are_stated_in_the_units_of_the_parameters() -> None:
    robot = example_robot(2)
    record = example_artifacts(robot)[Record]
    assert isinstance(record, Record)
    context = Context(
        np.random.default_rng(0), map_in_process, lambda *a, **k: None, logging.getLogger("test")
    )
    fit = TorqueResidualFit(passes=1, prior={"gear_stiffness.*_1": 0.3}).run((record,), robot, context)
    table = fit.parameters
    assert table.prior is not None
    prior = dict(zip(table.names, table.prior.tolist(), strict=True))
    first, second = robot.axis_names
    # Logarithms: standard deviations are shares of the estimate; wide is a factor e, a data sheet one percent.
    for name, share in (
        (f"gear_stiffness.{first}", 0.3),
        (f"gear_stiffness.{second}", 1.0),
        (f"rotor_inertia.{first}", 0.01),
    ):
        assert prior[name] == pytest.approx(share * table.value(name), rel=1e-6)
    assert prior["torque_delay"] == record.run.sample_time_s
    assert fit.misfit_against == "differences between periods"
