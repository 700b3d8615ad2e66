"""What `fit.torque_residual` hands to the list of doubts: its priors, and what its misfit is against."""

from __future__ import annotations

import re

import numpy as np
import pytest
from oracles.multisine import context, record_of

from robid_core import Record, Robot
from robid_core.testing.inputs import example_artifacts
from robid_core.testing.robots import example_robot
from robid_fit.torque_residual import TorqueResidualFit


def test_priors_are_stated_in_the_units_of_the_parameters() -> None:
    robot = example_robot(2)
    record = example_artifacts(robot)[Record]
    assert isinstance(record, Record)
    fit = TorqueResidualFit(passes=1, prior={"gear_stiffness.*_1": 0.3}).run((record,), robot, context(0))
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


def test_bodies_that_are_further_off_than_promised_are_doubted() -> None:
    """An arm a tenth heavier than told: promised to 1 %, errors of the bodies are too small; to 20 %, they hold."""
    nominal = Robot.load("one_axis")
    moved = {
        name: 1.1 * nominal.parameter(name)
        for name in nominal.layout
        if name.startswith(("mass.", "inertia."))
    }
    record = record_of(nominal.with_parameters(moved), nominal, np.array([[0.3], [-0.8]]), 21)
    wide = {"mass.*": 0.2, "inertia.*": 0.2, "centre_of_mass.*": 0.2}
    told = {
        "narrow": TorqueResidualFit().run((record,), nominal, context()),
        "wide": TorqueResidualFit(prior=wide).run((record,), nominal, context()),
    }
    (doubt,) = [one for one in told["narrow"].doubts if one.kind == "tolerance"]
    assert float(re.findall(r"robot file by ([\d.]+) times", doubt.sentence)[0]) > 3.5
    assert "state how well they are known" in doubt.remedy
    worst, times = re.findall(r"tolerances, (\S+) by ([\d.]+) times its own", doubt.sentence)[0]
    assert worst in moved  # ten percent of each, promised to one
    table = told["narrow"].parameters
    assert float(times) == pytest.approx(
        100 * abs(table.value(worst) / nominal.parameter(worst) - 1), rel=0.01
    )
    groups = re.findall(r'"(\w+)\.\*": 0\.1', doubt.remedy)
    assert worst.partition(".")[0] in groups
    assert "rotor_inertia" not in groups  # it is right
    heavier = nominal.with_parameters({name: 1.3 * value / 1.1 for name, value in moved.items()})
    other = record_of(heavier, nominal, np.array([[0.3], [-0.8]]), 23)
    followed = TorqueResidualFit(prior=dict.fromkeys(wide, 0.02)).run((other,), nominal, context())
    (doubt,) = [one for one in followed.doubts if one.kind == "tolerance"]
    assert doubt.remedy.startswith("look for what the model lacks")
    assert "a tolerance of 0.02 was stated" in doubt.remedy
    assert not [one for one in told["wide"].doubts if one.kind == "tolerance"]
    rotor = nominal.with_parameters({"rotor_inertia.axis_1": 1.2 * nominal.parameter("rotor_inertia.axis_1")})
    spun = record_of(rotor, nominal, np.array([[0.3], [-0.8]]), 24)
    (doubt,) = [
        one
        for one in TorqueResidualFit(prior=wide).run((spun,), nominal, context()).doubts
        if one.kind == "tolerance"
    ]
    assert 'prior: {"rotor_inertia.*": 0.1}' in doubt.remedy
    right = record_of(nominal, nominal, np.array([[0.3], [-0.8]]), 22)
    assert not [
        one for one in TorqueResidualFit().run((right,), nominal, context()).doubts if one.kind == "tolerance"
    ]
