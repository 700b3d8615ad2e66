"""Fits beside friction that turns abruptly, which holds a motor for thousandths of a second where it turns back."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np
import pytest
from oracles.sticking_rotor import INERTIA, LEVEL, STEP, record_of, robot, run

import robid_core as robid
from robid_core import DataRejected, Robot
from robid_core.estimation.torque.periodic import periodic_motion_of
from robid_core.estimation.torque.spectra import MotionSpectra
from robid_core.estimation.torque.speed_functions import SpeedFunctions
from robid_core.residual import torque_problem
from robid_core.residual.moving_samples import moving_samples
from robid_core.residual.periodic_block import PeriodicBlock
from robid_fit.torque_residual import TorqueResidualFit


@pytest.mark.parametrize("n_period", [1, 3], ids=["one cut", "periods"])
@pytest.mark.parametrize("seed", [1, 2])
def test_friction_that_holds_a_motor_where_it_turns_back_does_not_count(seed: int, n_period: int) -> None:
    """Kept, such samples leave a hundred times the noise and more: what friction is there no function of speed says."""
    record = record_of([run(10 * seed + k, n_period=n_period) for k in range(4)], n_period=n_period)
    fit, kept = (
        robid.use(
            "fit.torque_residual", free=["rotor_inertia.*"], prior={"rotor_inertia.*": 1.0}, at_rest=at_rest
        )(record, robot=robot())
        for at_rest in ("leave_out", "keep")
    )
    assert kept.misfit > 100
    assert fit.misfit == pytest.approx(1.0, abs=0.12)
    error = dict(zip(fit.parameters.names, fit.parameters.standard_error, strict=True))
    truth = {"rotor_inertia.axis_1": INERTIA, "friction.axis_1.coulomb": LEVEL}
    for name, true in truth.items():
        assert abs(fit.parameters.value(name) - true) < 4 * error[name], name
    assert error["rotor_inertia.axis_1"] < 3e-4 * INERTIA


@pytest.mark.parametrize("n_period", [1, 3], ids=["one cut", "periods"])
def test_turns_behind_a_coarse_encoder_do_not_count(n_period: int) -> None:
    """Of steps of 1 mrad: their noise says so, in one cut what is left. Counted, turns leave ten times the noise."""
    record = record_of([run(k, n_period=n_period, step=1e-3) for k in range(4)], n_period=n_period)
    fit = robid.use("fit.torque_residual", free=["rotor_inertia.*"], prior={"rotor_inertia.*": 1.0})(
        record, robot=robot()
    )
    assert 0.8 < fit.misfit < 1.2
    error = dict(zip(fit.parameters.names, fit.parameters.standard_error, strict=True))
    for name, true in {"rotor_inertia.axis_1": INERTIA, "friction.axis_1.coulomb": LEVEL}.items():
        assert abs(fit.parameters.value(name) - true) < 4 * error[name], name
    said = " ".join(one.sentence for one in fit.stated_doubts)
    assert "turns back more abruptly than its angle" in said
    of_what_is_left = "torque is no function of the speed" in said
    assert of_what_is_left == (n_period == 1)


def test_turns_of_which_only_what_is_left_says_that_they_should_not_count() -> None:
    """Of steps of 1 mrad in one cut, beside gradual friction: rounding of a slow motor is no white noise."""
    record = record_of([run(k, step=1e-3, width=0.2) for k in range(4)], n_period=1)
    fit = robid.use("fit.torque_residual", free=["rotor_inertia.*"], prior={"rotor_inertia.*": 1.0})(
        record, robot=robot()
    )
    assert 0.8 < fit.misfit < 1.2
    assert any("turns back, torque is no function of the speed" in one.sentence for one in fit.stated_doubts)


@pytest.mark.parametrize(("step", "alike"), [(3e-4, True), (0.0, False)])
def test_what_the_steps_of_an_encoder_do_alike_in_all_periods_is_noise(step: float, alike: bool) -> None:
    """Differences between periods do not show it, the top of the spectrum does: a twelfth of the step squared.

    Somewhat less, since errors of a slow motor are not white.
    """
    record = record_of([run(k, n_period=3, width=0.2, step=step) for k in range(4)], n_period=3)
    problem = TorqueResidualFit().problem((record,), robot())
    (block,) = problem.blocks
    assert isinstance(block, PeriodicBlock)
    if alike:
        assert 0.6 < float(block.repeated_noise[0]) / (step**2 / 12) < 1.05
    else:
        np.testing.assert_array_equal(block.repeated_noise, 0.0)


def test_an_axis_that_turns_back_all_the_time_counts() -> None:
    """A small multisine alone: without its turns nothing would be left, and what stands still is a doubt."""
    record = record_of([run(k, n_period=3, slow=0.0) for k in range(4)], n_period=3)
    fit = robid.use("fit.torque_residual", free=["rotor_inertia.*"])(record, robot=robot())
    assert fit.misfit > 100
    assert any(one.kind == "standstill" and not one.is_remark for one in fit.stated_doubts)
    problem = partial(torque_problem, (record,), robot(), ["rotor_inertia.axis_1"], {}, of_speed)
    problem()
    with pytest.raises(
        DataRejected, match="axis_1: without the samples at which an axis turns back too little"
    ):
        problem(sticking=["axis_1"])


def of_speed(nominal: Robot, motions: Sequence[MotionSpectra]) -> SpeedFunctions:
    return SpeedFunctions.near(nominal.drives.friction_speed)


def test_weights_of_a_motion_that_repeats_turn_with_its_beginning() -> None:
    """Where a period begins is of no account: weights of one that begins later are those, later."""
    angle, n, shift = run(7, n_period=3).angle, 5000, 2500
    later = np.roll(angle.reshape(3, n), -shift, axis=1)  # each period by itself, so that their noise stays
    found = []
    for periods in (angle.reshape(3, n), later):
        position = (periods - periods.mean(axis=1, keepdims=True))[None, None, None, ..., None]
        motion = periodic_motion_of(position, np.zeros_like(position), STEP, np.array([2]), 100.0)
        (moving,) = moving_samples([motion])
        assert moving is not None
        found.append(moving.weight[0, 0, :, 0])
    np.testing.assert_array_equal(found[1], np.roll(found[0], -len(found[0]) // 2))
    assert 0.05 < (found[0] == 0).mean() < 0.7
