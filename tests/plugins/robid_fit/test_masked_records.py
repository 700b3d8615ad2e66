"""Fits of motions that do not repeat take the pieces between gaps; all that take none ask for `gaps: split`."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from robid_compensation.ripple import RippleCompensation
from robid_core import Context, DataRejected, Record, Robot
from robid_core.stage import map_in_process
from robid_fit.friction import FrictionFromPlateaus
from robid_fit.state_space import StateSpaceFit
from robid_fit.time_domain import TimeDomainFit
from robid_fit.torque_residual import TorqueResidualFit

ROBOT = Robot.load("one_axis")
TRUTH = {"gear_stiffness.axis_1": 6.0e4, "friction.axis_1.coulomb": 0.6}
STEP, N = 1e-3, 8000


def context() -> Context:
    return Context(
        np.random.default_rng(0), map_in_process, lambda *_, **__: None, logging.getLogger("test"), None
    )


@pytest.fixture(scope="module")
def masked() -> Record:
    """Two experiments of 8 s; a fifth of a second is missing in the middle of one, and a sample of the other."""
    machine, chance = ROBOT.with_parameters(TRUTH), np.random.default_rng(1)
    time, angles, torques = STEP * np.arange(N), [], []
    lines = 4.125 + 1.5 * np.arange(30)[:, None]
    for seed in (1, 2):
        small = 2 * np.sin(2 * np.pi * (lines * time + chance.random((30, 1)))).sum(axis=0)
        speed = 14 * np.sin(2 * np.pi * (time / 4 + chance.random())) + small
        done = machine.simulate(speed[None, :, None], chance.uniform(-0.6, 0.6, (1, 1)), seed=seed)
        angles.append(done.position[0])
        torques.append(done.torque[0])
    for one in (angles, torques):
        one[0][3000:3200] = np.nan
        one[1][2000] = np.nan
    return Record.from_arrays(
        motor_position=np.stack(angles),
        motor_torque=np.stack(torques),
        axes="n_exp n_sample n_axis",
        sample_time_s=STEP,
        robot=ROBOT,
        torque_hold="zero_order_hold",
    )


def test_a_torque_fit_takes_pieces_of_different_length(
    masked: Record, caplog: pytest.LogCaptureFixture
) -> None:
    fit = TorqueResidualFit().run((masked,), ROBOT, context())
    assert fit.converged
    assert fit.doubts == ()
    for name, value in TRUTH.items():
        estimate, error = (
            fit.parameters.as_mapping()[name],
            fit.parameters.standard_error[fit.parameters.names.index(name)],
        )
        assert error < 0.01 * value
        assert estimate == pytest.approx(value, abs=4 * error)
    assert "fit.torque_residual takes the pieces between the gaps: 4 of 2 s and more, 98.7 %" in caplog.text


@pytest.mark.parametrize(
    "run",
    [
        lambda record: FrictionFromPlateaus().run(record, ROBOT, context()),
        lambda record: StateSpaceFit().run(record, ROBOT, context()),
        lambda record: TimeDomainFit().run((record,), ROBOT, context()),
        lambda record: RippleCompensation().run(record, ROBOT, context()),
    ],
    ids=["fit.friction", "fit.state_space", "fit.time_domain", "compensate.ripple"],
)
def test_stages_that_take_no_gaps_name_what_reads_the_record_without(
    masked: Record, run: Callable[[Record], Any]
) -> None:
    with pytest.raises(DataRejected, match="gaps: split"):
        run(masked)
