"""Sentences of the verdict: values that are not as they were told."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from robid_core import DiagnosedData, Finding, ParameterTable, ResponseCheck, Robot
from robid_diagnosis.selection import explains_little, fits_worse
from robid_diagnosis.wording import (
    chance_text,
    data_line,
    finding_line,
    increment_line,
    left_out_line,
    misfit_line,
    response_check_line,
    values_line,
)


def table(estimate: list[float], error: list[float], group: str = "stiffness") -> ParameterTable:
    n = len(estimate)
    return ParameterTable(
        tuple(f"gear_stiffness.axis_{i + 1}" for i in range(n)), ("N m/rad",) * n, (group,) * n, np.full(n, 100.0),
        np.array(estimate), np.array(error), np.zeros(n, dtype=bool), np.zeros(n, dtype=bool),
    )  # fmt: skip


def test_values_that_are_surely_and_clearly_off_are_read_out_the_furthest_first() -> None:
    """A half is further than a third more; an error of a percent, or one that the data do not tell, is not read out."""
    line = values_line(table([130.0, 50.0, 101.0, 140.0], [0.2, 0.1, 0.1, 20.0]), 1.0)
    assert line == (
        "Values: gear_stiffness.axis_2 is 50 ± 0.1 % smaller than in the robot file; "
        "gear_stiffness.axis_1 is 30 ± 0.2 % larger than in the robot file."
    )


def test_where_much_lacks_values_may_stand_for_it() -> None:
    line = values_line(table([130.0], [0.2]), 500.0)
    assert line == (
        "Values: these cannot be distinguished from what the model lacks: gear_stiffness.axis_1 is 30 ± 0.2 % larger "
        "than in the robot file."
    )


def test_numbers_of_bodies_that_only_tolerances_tell_have_no_size() -> None:
    """A planar arm shows mass times centre of mass: of each alone the errors are the tolerances."""
    bodies = replace(
        table([130.0, 60.0, 140.0], [0.1, 0.9, 0.8], group="inertia"),
        names=("rotor_inertia.axis_1", "centre_of_mass.axis_1.z", "mass.axis_1"), prior=np.ones(3),
    )  # fmt: skip
    first, second = values_line(bodies, 1.0).split("\n")
    assert first == "Values: rotor_inertia.axis_1 is 30 ± 0.1 % larger than in the robot file."
    assert second.startswith(
        "Beyond their tolerances, too: centre_of_mass.axis_1.z, mass.axis_1; these data determine"
    )


def test_a_chance_that_no_number_holds_is_below_the_least() -> None:
    assert [chance_text(p) for p in (0.0, 2e-5, 0.034)] == ["p < 0.001", "p < 0.001", "p = 0.034"]
    assert [chance_text(p, 1e-300) for p in (0.0, 2e-5)] == ["p < 1e-300", "p = 2e-05"]


def test_one_experiment_is_no_plural() -> None:
    line = data_line(DiagnosedData(1, 2, 1, 100.0, ("differences between periods",)))
    assert line == (
        "Data: 2 experiments in 1 configuration, bins to 100 Hz, noise: differences between periods; "
        "1 experiment held out."
    )


def test_many_are_counted_and_none_is_no_line() -> None:
    assert values_line(table([200.0] * 7, [1.0] * 7), 1.0).endswith("; 2 more.")
    assert values_line(table([100.5], [0.01]), 1.0) == ""
    assert values_line(table([50.0], [0.01], group="friction"), 1.0) == ""


def test_a_gain_that_data_do_not_show_is_one_of_tolerances() -> None:
    """Eight configurations that each show a little are data; a gain that none shows is told numbers' nearness."""
    one = {
        "kind": "cause", "effect": "drive.torque_constant", "on": "axis_1", "side": "torque", "p_value": 1e-9,
        "share": float("nan"), "names": ("error",), "units": ("1",), "nominal": np.array([np.nan]),
        "value": np.array([0.07]), "standard_error": np.array([0.006]), "held_out": np.zeros(8),
        "by_own_size": np.array([10.0, *np.zeros(7)]),
    }  # fmt: skip
    spread = Finding(**one, gain=60.0, by_configuration=np.full(8, 7.5))
    assert "seen in 1 of 8 configurations" in finding_line(spread, 8)
    pulled = Finding(**one, gain=60.0, by_configuration=np.full(8, 0.1))
    assert "without it parameters of the robot file would leave their tolerances" in finding_line(pulled, 8)
    assert "shown by the experiments that are not used, in which it rattles" in finding_line(pulled, 8, 2)


def response_check(*z: float) -> ResponseCheck:
    n, torques = len(z), np.full(len(z), 100.0)
    return ResponseCheck(
        "frf.lrm, fit.log_response", "", 1.0, 3.5, tuple(f"gear_stiffness.axis_{i + 1}" for i in range(n)),
        ("N m/rad",) * n, torques + np.array(z), np.full(n, 0.8), torques, np.full(n, 0.6), np.array(z),
    )  # fmt: skip


def test_a_check_that_agrees_states_what_is_furthest_apart() -> None:
    assert response_check_line(response_check(0.1, -2.0, 1.0)) == (
        "Check by frequency responses, fitted separately: they agree about 3 stiffnesses, all that both determine; "
        "furthest apart: gear_stiffness.axis_2, 98 ± 0.8 N m/rad by responses, 100 ± 0.6 by torques: 2.0 standard "
        "errors, where 3.5 would count as a difference."
    )


def test_disagreements_are_read_out_the_furthest_first_and_many_are_counted() -> None:
    line = response_check_line(response_check(0.1, 5.0, -9.0))
    assert "disagree about 2 of 3 stiffnesses: gear_stiffness.axis_3, 91 ± 0.8" in line
    assert line.index("axis_3") < line.index("axis_2")
    assert response_check_line(response_check(*[9.0] * 7)).endswith("; 2 more.")


def test_of_a_body_none_of_whose_numbers_moved_by_itself_the_furthest_are_read_out() -> None:
    names = ("mass.j1", "centre_of_mass.j1.x", "centre_of_mass.j1.z", "inertia.j1.xx", "inertia.j1.xy")
    body = Finding(
        kind="value", effect="body", on="j1", side=None, names=names, units=("kg", "m", "m", "kg m^2", "kg m^2"),
        value=np.array([24.3, -0.0004, 0.466, 1.16, 0.0]), standard_error=np.array([4.6, 0.0014, 0.088, 1.0, 0.05]),
        nominal=np.array([22.2, 0.0, 0.42, 1.09, 0.0]), gain=120.0, p_value=1e-9, share=float("nan"),
        held_out=np.full(4, np.nan), by_configuration=np.full(4, np.nan), by_own_size=np.full(4, np.nan),
    )  # fmt: skip
    line = finding_line(body, 4)
    assert "mass.j1 24.3" in line
    assert "centre_of_mass.j1.z 0.466" in line
    assert "inertia.j1" not in line
    assert "the data determine combinations of them alone" in line
    sure = body.replace(standard_error=np.array([0.1, 0.0014, 0.088, 1.0, 0.05]))
    assert "combinations" not in finding_line(sure, 4)
    assert finding_line(sure, 4).startswith("j1: wrong value: body of j1 (")
    assert finding_line(sure, 4, 0, ["j1"]).startswith(
        "j1: a part is explained by another value, which may stand for what nothing explains here: body of j1 ("
    )
    assert "centre_of_mass" not in finding_line(sure, 4)


def test_experiments_that_are_not_used_are_counted_by_configuration() -> None:
    line = left_out_line((0, 2, 1, 0), 12)
    assert line.startswith("3 of 12 experiments are not used (configuration 2, 3): ")
    assert not left_out_line((0, 0), 4)


def test_a_misfit_that_rises_says_why() -> None:
    assert misfit_line(1.4, None) == "Misfit 1.4 with all values refitted."
    assert misfit_line(439.0, 1.02) == "Misfit 439 with all values refitted, 1.02 with what was found."
    assert "439 with all values refitted, 508 with what was found (more, since" in misfit_line(439.0, 508.0)


def test_a_law_may_promise_less_noise_where_noise_is_a_small_part_of_what_is_left() -> None:
    assert not fits_worse(-0.1, 1.2, 1.2)
    assert fits_worse(-0.1, 1.3, 1.2)
    assert not fits_worse(-0.1, 508.0, 439.0)
    assert fits_worse(0.1, 400.0, 439.0)


def test_little_of_much_is_no_cause_and_a_seventh_is_as_in_real_recordings() -> None:
    """EMPS names causes of 40 to 14 % at misfits from 3400 to 690; near the noise little may be all there is."""
    assert explains_little(-0.043, 437.0)
    assert not explains_little(-0.137, 691.0)
    assert not explains_little(-0.004, 1.06)


def test_what_adds_to_an_effect_of_the_robot_file_is_said_to() -> None:
    nothing = np.zeros(1)
    found = Finding("cause", "friction.power_law", "axis_1", "motor", 99.0, 0.0, 1.0, ("drag_forwards",), ("N m",),
                    nothing, nothing, nothing, nothing, nothing, nothing)  # fmt: skip
    robot = Robot.load("one_axis")
    assert increment_line(found, robot) == ""
    line = increment_line(found, robot.with_effect("oil", "friction.power_law", "axis_1", "motor"))
    assert "has friction.power_law at axis_1 already (effects: oil)" in line
    assert "free: effect.oil.drag_forwards" in line
    assert increment_line(replace(found, effect="friction.eyring"), robot) == ""
