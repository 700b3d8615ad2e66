"""Moves with rests, an everyday encoder, and friction that turns within its noise: a foreign plant of one motor."""

from __future__ import annotations

from pathlib import Path

import pytest
from oracles.multisine import context
from oracles.one_motor import COULOMB, INERTIA, LINK, TURNS, VISCOUS, recorded, told

from robid_fit.torque_residual import TorqueResidualFit


@pytest.mark.parametrize(
    "seed", [1, pytest.param(2, marks=pytest.mark.full), pytest.param(3, marks=pytest.mark.full)]
)
def test_friction_and_inertia_are_right_where_an_axis_is_slow(tmp_path: Path, seed: int) -> None:
    """Noise of the speed is half of that within which friction turns: taken as motion it is friction that was not."""
    robot = told(tmp_path)
    fit = TorqueResidualFit(highest_hz=20.0, prior={"rotor_inertia.*": 0.3}).run(
        (recorded(robot, seed),), robot, context()
    )
    table, error = fit.parameters, dict(zip(fit.parameters.names, fit.parameters.standard_error, strict=True))
    assert fit.misfit < 1.6
    truth = {"rotor_inertia.a": INERTIA - LINK, "friction.a.coulomb": COULOMB, "friction.a.viscous": VISCOUS}
    for name, true in truth.items():
        assert abs(table.value(name) - true) < 4 * error[name], name
        assert error[name] < 0.02 * true, name
    assert table.value("friction.a.speed") == pytest.approx(TURNS, rel=0.05)


STUCK = {"rotor_inertia.a": INERTIA - LINK, "friction.a.coulomb": COULOMB, "friction.a.viscous": VISCOUS}


@pytest.mark.parametrize(
    "seed", [11, pytest.param(12, marks=pytest.mark.full), pytest.param(13, marks=pytest.mark.full)]
)
def test_what_holds_an_axis_at_rest_does_not_count(tmp_path: Path, seed: int) -> None:
    """At rest friction is any torque up to its level: no function of the speed, so that all else bends to it."""
    robot = told(tmp_path)
    record = recorded(robot, seed, sticks=True, rest_s=(0.5, 2.0))
    fitted = {
        at_rest: TorqueResidualFit(highest_hz=40.0, prior={"rotor_inertia.*": 0.3}, at_rest=at_rest).run(
            (record,), robot, context()
        )
        for at_rest in ("leave_out", "keep")
    }
    fit, kept = fitted["leave_out"], fitted["keep"]
    table, error = fit.parameters, dict(zip(fit.parameters.names, fit.parameters.standard_error, strict=True))
    assert kept.misfit > 10
    assert fit.misfit < 1.3
    for name, true in STUCK.items():
        assert abs(table.value(name) - true) < 4 * error[name], name
        assert error[name] < 0.01 * true, name
    assert [(one.kind, one.degree) for one in fit.stated_doubts if one.kind == "standstill"] == [
        ("standstill", "remark")
    ]
    assert kept.stated_doubts[0].kind == "standstill"
