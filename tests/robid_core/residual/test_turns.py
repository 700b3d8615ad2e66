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
    """Without its turns hardly a sample would be left, however much their noise hides."""
    records = [
        record_of([run(k, n_period=3, width=0.05, slow=slow) for k in range(4)], n_period=3)
        for slow in (0.0, 10.0)
    ]
    for record, expected in zip(records, ((), ("axis_1",)), strict=True):
        narrow = robot().with_parameters({"friction.axis_1.speed": 0.05})
        problem = TorqueResidualFit(free=("rotor_inertia.*",)).problem((record,), narrow)
        point = np.zeros(problem.n_unknown)
        problem.friction_size(point)[0] = LEVEL  # of the narrowest function
        assert clearer_without_turns(problem, point) == expected


def test_a_fit_stands_where_too_little_is_left_without_turns(caplog: pytest.LogCaptureFixture) -> None:
    """A second and a half up to 30 Hz: noise says that turns should not count, and all unknowns need them."""
    runs = [run(10, width=0.05)]
    cut = [Run(one.angle[:1500], one.torque[:1500], one.held[:1500]) for one in runs]
    with caplog.at_level("INFO"):
        fit = robid.use(
            "fit.torque_residual", free=["rotor_inertia.*"], prior={"rotor_inertia.*": 1.0}, highest_hz=30.0
        )(record_of(cut), robot=robot().with_parameters({"friction.axis_1.speed": 0.05}))
    assert fit.misfit < 2
    assert "the fit of before stands" in caplog.text


@pytest.mark.parametrize("n_period", [1, 3], ids=["cuts", "periods"])
def test_a_record_in_which_an_axis_stands_still_decides_nothing(
    n_period: int, caplog: pytest.LogCaptureFixture
) -> None:
    """Beside one in which it moves: no sample of it says anything of a turn."""
    moving = record_of([run(k, n_period=n_period, width=0.05) for k in range(4)], n_period=n_period)
    noise, n = np.random.default_rng(1), 5000 * n_period
    still = [
        Run(NOISE * noise.normal(size=n), TORQUE_NOISE * noise.normal(size=n), np.ones(n, dtype=bool))
        for _ in range(4)
    ]
    fit = robid.use("fit.torque_residual", free=["rotor_inertia.*"], prior={"rotor_inertia.*": 1.0})
    narrow = robot().with_parameters({"friction.axis_1.speed": 0.05})
    with caplog.at_level("INFO"):
        alone, beside = (
            fit(*records, robot=narrow)
            for records in ((moving,), (moving, record_of(still, n_period=n_period)))
        )
    assert caplog.text.count("noise of angles hides friction at turns") == 2
    for found in (alone, beside):
        assert found.misfit == pytest.approx(1.0, abs=0.1)
        assert np.isfinite(found.misfit_table.other).any()
    inertia = [one.parameters.value("rotor_inertia.axis_1") for one in (alone, beside)]
    assert inertia[1] == pytest.approx(inertia[0], rel=2e-4)
