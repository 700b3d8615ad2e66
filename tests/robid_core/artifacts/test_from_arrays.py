"""Records and responses made of arrays are those that were meant: axes, units, periods, uncertainty."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from robid_core import DataRejected, Diagnosis, Frf, Record, Robot
from robid_core.artifacts.tables import Table
from robid_core.testing import MassSpringPlant, example_frf, example_robot, plant_record

STEP = 1e-3


def test_a_record_in_other_units_and_another_order_of_axes_is_the_same_record() -> None:
    """The closed-form record of the kit, handed over as a user has it: degrees, axes turned round, periods joined."""
    record = plant_record(MassSpringPlant.of(2))
    run = record.run
    position, torque = (run.values(name) for name in ("motor_position", "motor_torque"))
    turned = [np.moveaxis(values, (0, 1, 2, 3, 4, 5), (2, 1, 0, 3, 4, 5)) for values in (position, torque)]
    joined = [values.reshape(*values.shape[:3], -1, 2) for values in turned]
    again = Record.from_arrays(
        motor_position=np.degrees(joined[0]),
        motor_torque=1000 * joined[1],
        units={"motor_position": "deg", "motor_torque": "mN m"},
        axes="n_exp n_block n_config n_sample n_axis",
        sample_time_s=run.sample_time_s,
        period_s=1.0,
        excited_hz=record.frequency_hz,
        angle=record.angle,
        torque_hold="zero_order_hold",
    )
    for mine, theirs in zip(again.spectra(), record.spectra(), strict=True):
        np.testing.assert_allclose(mine, theirs, rtol=0, atol=1e-12 * np.abs(theirs).max())
    np.testing.assert_array_equal(again.frequency_hz, record.frequency_hz)
    assert again.axis_names == record.axis_names


def test_a_robot_names_the_axes_and_tells_where_it_stood() -> None:
    robot = example_robot(2)
    stood = np.array([0.3, -0.2])
    motor = robot.motor_angle(stood) + 0.1 * np.sin(2 * np.pi * np.arange(100) / 100)[:, None]
    record = Record.from_arrays(motor_position=motor, sample_time_s=STEP, robot=robot)
    np.testing.assert_allclose(record.angle, stood[None], atol=1e-12)
    assert record.axis_names == robot.axis_names


def test_samples_that_are_not_known_are_marked() -> None:
    position = np.zeros((5, 2))
    position[3, 1] = np.nan
    record = Record.from_arrays(motor_position=position, sample_time_s=STEP, angle=[[0.0, 0.0]])
    assert record.run.valid.ravel().tolist() == [True, True, True, False, True]


def test_channels_on_the_joint_side_say_so() -> None:
    zero = np.zeros(4)
    record = Record.from_arrays(joint_position=zero, motor_speed=zero, sample_time_s=STEP, angle=[[0.0]])
    assert record.run.channel("joint_position").side == "joint"
    assert record.run.channel("motor_speed").unit_symbol == "rad/s"


TEN = np.zeros((10, 2))


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"motor_position": np.zeros((3, 4, 5))}, "name each of its 3 axes"),
        ({"axes": "n_sample n_motor"}, "out of n_config, n_block, n_exp, n_period, n_sample, n_axis"),
        ({"units": {"motor_position": "grad"}}, "unit 'grad' is not known; there are: rad, mrad, deg"),
        ({"units": {"motor_torque": "N m"}}, "there is no channel motor_torque; there are: motor_position"),
        (
            {"motor_torque": np.zeros((10, 2)), "units": {"motor_torque": "A"}},
            "multiply by the torque constant",
        ),
        ({"motor_torque": np.zeros((9, 2))}, "the channels differ in shape"),
        ({"vibration": TEN}, "its name does not say what it holds"),
        ({"angle": None}, "where the robot stood is not known; give robot="),
        ({"angle": [[0.0, 0.0]] * 2}, "angle: 2 rows for 1 configurations"),
        ({"axis_names": ("one",)}, "the arrays have 2 axes, and 1 are named"),
        ({"period_s": 4e-3}, "no whole number of periods of 4 samples"),
        ({"torque_hold": "linear"}, "torque_hold: 'linear', not zero_order_hold or continuous"),
        ({"excited_hz": [100.0]}, "torque_hold is missing, which excited_hz goes with"),
        (
            {"excited_hz": [150.0], "torque_hold": "continuous"},
            "150 Hz has no whole number of cycles in a period of 0.01 s",
        ),
    ],
)
def test_what_does_not_belong_together_is_refused_in_a_sentence(changes: dict[str, Any], told: str) -> None:
    given: dict[str, Any] = {"motor_position": TEN, "sample_time_s": STEP, "angle": [[0.0, 0.0]]}
    with pytest.raises(DataRejected, match=told):
        Record.from_arrays(**{**given, **changes})


def test_a_mobility_becomes_the_response_with_its_deviation() -> None:
    """Of the kit's example: divided by i w and given back, response and variance are what they were."""
    robot = Robot.load("one_axis")
    frf = example_frf(robot)
    s = 2j * np.pi * frf.frequency_hz[:, None, None]
    again = Frf.from_arrays(
        frf.response / s,
        frf.frequency_hz,
        unit="(rad/s)/(N m)",
        deviation=np.sqrt(frf.variance()) / np.abs(s),
        degrees_of_freedom=20.0,
        angle=frf.angle,
        robot=robot,
        sample_time_s=frf.sample_time_s,
        torque_hold="zero_order_hold",
    )
    np.testing.assert_allclose(again.response, frf.response, rtol=1e-12)
    np.testing.assert_allclose(again.variance(), frf.variance(), rtol=1e-12)
    for c in range(len(frf.angle)):
        np.testing.assert_allclose(again.covariance(c), frf.covariance(c), rtol=1e-12)
    assert again.degrees_of_freedom is not None
    assert (again.degrees_of_freedom == 20).all()


def test_deviations_by_output_and_input_are_kept_and_others_refused() -> None:
    response = np.ones((3, 2, 2), dtype=complex)
    size = np.outer([1.0, 3.0], [2.0, 0.5])
    given: dict[str, Any] = {"angle": [[0.0, 0.0]], "sample_time_s": STEP, "torque_hold": "continuous"}
    frf = Frf.from_arrays(response, [1.0, 2.0, 3.0], deviation=np.broadcast_to(size, (3, 2, 2)), **given)
    np.testing.assert_allclose(np.sqrt(frf.variance()[0]), np.broadcast_to(size, (3, 2, 2)), rtol=1e-12)
    odd = size + np.array([[0.0, 0.0], [0.0, 1.0]])
    with pytest.raises(DataRejected, match="these variances are no such product"):
        Frf.from_arrays(response, [1.0, 2.0, 3.0], deviation=np.broadcast_to(odd, (3, 2, 2)), **given)
    with pytest.raises(DataRejected, match="must be finite and positive"):
        Frf.from_arrays(response, [1.0, 2.0, 3.0], deviation=0.0, **given)
    with pytest.raises(DataRejected, match="is none of"):
        Frf.from_arrays(response, [1.0, 2.0], **given)
    with pytest.raises(DataRejected, match=r"there are: \(rad/s\^2\)/\(N m\)"):
        Frf.from_arrays(response, [1.0, 2.0, 3.0], unit="dB", **given)


@pytest.mark.parametrize("order", ["n_out n_in n_freq", "n_in n_freq n_config n_out", "n_freq n_in n_out"])
def test_a_response_may_have_its_axes_in_any_order(order: str) -> None:
    """Turned back by its names it is the response of the usual order, and so are its deviations."""
    generator, words = np.random.default_rng(1), order.split()
    usual = generator.normal(size=(1, 5, 2, 2)) + 1j * generator.normal(size=(1, 5, 2, 2))
    size = np.einsum("fi,fj->fij", *generator.uniform(1.0, 2.0, (2, 5, 2)))[None]
    given: dict[str, Any] = {"angle": [[0.0, 0.0]], "sample_time_s": STEP, "torque_hold": "continuous"}
    frequency = np.arange(1.0, 6.0)

    def turned(values: np.ndarray) -> np.ndarray:
        known = ["n_config", "n_freq", "n_out", "n_in"]
        dropped = values if "n_config" in words else values[0]
        names = known if "n_config" in words else known[1:]
        return dropped.transpose([names.index(word) for word in words])

    expected = Frf.from_arrays(usual, frequency, deviation=size, **given)
    frf = Frf.from_arrays(turned(usual), frequency, axes=order, deviation=turned(size), **given)
    np.testing.assert_array_equal(frf.response, expected.response)
    np.testing.assert_allclose(frf.variance(), expected.variance(), rtol=1e-12)
    one = Frf.from_arrays(turned(usual), frequency, axes=order, deviation=0.1, **given)
    np.testing.assert_allclose(one.variance(), 0.01, rtol=1e-12)


def test_axes_that_are_not_those_of_a_response_are_refused() -> None:
    given: dict[str, Any] = {"angle": [[0.0, 0.0]], "sample_time_s": STEP, "torque_hold": "continuous"}
    response, frequency = np.ones((2, 2, 5)), np.arange(1.0, 6.0)
    for axes in ("n_out n_in", "n_out n_out n_freq", "n_out n_in n_sample"):
        with pytest.raises(DataRejected, match='name each of its 3 axes, as axes="n_out n_in n_freq"'):
            Frf.from_arrays(response, frequency, axes=axes, **given)
    with pytest.raises(
        DataRejected, match=r"shape \(1, 2, 2, 5\) as .*, by axes='n_freq n_out n_in', has not 5 freq"
    ):
        Frf.from_arrays(response, frequency, axes="n_freq n_out n_in", **given)
    with pytest.raises(
        DataRejected, match="is none of .* with 5 frequencies .*; name its axes in their order"
    ):
        Frf.from_arrays(response, frequency, **given)


def test_lines_without_a_value_are_masked() -> None:
    frf = Frf.from_arrays(
        [1.0, np.nan, 1.0], [1.0, 2.0, 3.0], angle=[[0.0]], sample_time_s=STEP, torque_hold="continuous"
    )
    assert frf.valid_lines.tolist() == [[True, False, True]]
    assert frf.table()["frequency_hz"] == [1.0, 3.0]


def test_a_table_shows_its_first_rows_and_escapes_text() -> None:
    table = Table(name=["<b>bold</b>"] * 40, value=[float("nan")] * 40)
    html = table._repr_html_()
    assert "<b>bold" not in html
    assert html.count("<tr>") == 31
    assert "10 more rows" in html


def test_a_diagnosis_prints_its_verdict() -> None:
    assert (
        str(Diagnosis(method="prediction", verdict="1.5 % of the torque is left."))
        == "1.5 % of the torque is left."
    )
