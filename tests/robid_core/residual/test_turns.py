"""Whether turns of an axis count: friction that turns within less than its angle resolves is noise there."""

from __future__ import annotations

import numpy as np
import pytest
from oracles.sticking_rotor import INERTIA, LEVEL, NOISE, TORQUE_NOISE, Run, record_of, robot, run

import robid_core as robid
from robid_core import Fit
from robid_core.residual.turns import clearer_without_turns
from robid_fit.torque_residual import TorqueResidualFit

TRUTH = {"rotor_inertia.axis_1": INERTIA, "friction.axis_1.coulomb": LEVEL}


def fitted(seed: int, width: float, at_rest: str = "leave_out") -> Fit:
    record = record_of([run(10 * seed + k, n_period=3, width=width) for k in range(4)], n_period=3)
    fit: Fit = robid.use(
        "fit.torque_residual", free=["rotor_inertia.*"], prior={"rotor_inertia.*": 1.0}, at_rest=at_rest
    )(record, robot=robot().with_parameters({"friction.axis_1.speed": width}))
    return fit


def test_friction_that_turns_gradually_counts_at_all_samples() -> None:
    left_out, kept = (fitted(0, 0.4, at_rest) for at_rest in ("leave_out", "keep"))
    np.testing.assert_array_equal(left_out.parameters.estimate, kept.parameters.estimate)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_what_noise_hides_about_turns_is_not_spread_over_all_else(seed: int) -> None:
    """Friction that turns within 0.05 rad/s, where noise of the angle is 0.01 rad/s: at once, and not held there."""
    without, counted = (fitted(seed, 0.05, at_rest) for at_rest in ("leave_out", "keep"))
    assert without.misfit == pytest.approx(1.0, abs=0.1)
    errors = [
        dict(zip(one.parameters.names, one.parameters.standard_error, strict=True))
        for one in (without, counted)
    ]
    for name, true in TRUTH.items():
        assert abs(without.parameters.value(name) - true) < 4 * errors[0][name], name
    assert errors[0]["rotor_inertia.axis_1"] < 0.75 * errors[1]["rotor_inertia.axis_1"]


@pytest.mark.full
@pytest.mark.parametrize(("width", "clearer"), [(0.05, True), (0.4, False)])
def test_what_is_chosen_is_nearer_to_the_truth(width: float, clearer: bool) -> None:
    """Rms error of the inertia over twelve records: what is chosen by noise alone errs less, or no more."""
    chosen, counted = (
        np.array(
            [fitted(seed, width, at_rest).parameters.value("rotor_inertia.axis_1") for seed in range(20, 32)]
        )
        for at_rest in ("leave_out", "keep")
    )
    rms = [float(np.sqrt(np.mean((one - INERTIA) ** 2))) for one in (chosen, counted)]
    assert rms[0] < (0.8 if clearer else 1.1) * rms[1]


def test_an_axis_that_turns_back_all_the_time_has_to_count() -> None:
    record = record_of([run(k, n_period=3, width=0.05, slow=0.0) for k in range(4)], n_period=3)
    problem = TorqueResidualFit(free=("rotor_inertia.*",)).problem((record,), robot())
    assert clearer_without_turns(problem, np.zeros(problem.n_unknown)) == ()


def test_a_record_in_which_an_axis_stands_still_decides_nothing() -> None:
    """Beside one in which it moves: no sample of it counts there, with turns or without."""
    moving = record_of([run(k, width=0.05) for k in range(4)], n_period=1)
    noise = np.random.default_rng(1)
    still = [
        Run(
            NOISE * noise.normal(size=5000), TORQUE_NOISE * noise.normal(size=5000), np.ones(5000, dtype=bool)
        )
        for _ in range(4)
    ]
    fit = robid.use("fit.torque_residual", free=["rotor_inertia.*"], prior={"rotor_inertia.*": 1.0})
    narrow = robot().with_parameters({"friction.axis_1.speed": 0.05})
    for records in ((moving,), (moving, record_of(still, n_period=1))):
        found: Fit = fit(*records, robot=narrow)
        assert any("turns back more abruptly than its angle" in one.sentence for one in found.stated_doubts)
        assert found.misfit == pytest.approx(1.0, abs=0.1)
