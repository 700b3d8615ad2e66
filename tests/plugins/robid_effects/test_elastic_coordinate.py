"""Elastic coordinate: the same robot as with a bearing in its file; what cannot bend is refused."""

import numpy as np
import pytest

from robid_core import ConfigurationError, Robot
from robid_effects.elastic_coordinate import ElasticCoordinate


def test_it_is_a_bearing_that_the_file_leaves_out() -> None:
    robot = Robot.load("six_axis")
    bearings = dict(robot.description.bearings)
    missing = bearings.pop("axis_3_z")
    stiffer = Robot(robot.description.model_copy(update={"bearings": bearings}))
    values = np.array([0.0, 0.0, 0.5, missing.stiffness, missing.damping])
    again = ElasticCoordinate.apply(stiffer, values, "axis_3", "axis_3_z")
    angle, frequency = np.array([[0.2, 0.3, -0.4, 0.5, 0.6, -0.7]]), np.linspace(4, 80, 12)
    np.testing.assert_array_equal(again.response(angle, frequency), robot.response(angle, frequency))
    assert np.abs(stiffer.response(angle, frequency) - robot.response(angle, frequency)).max() > 1


def test_any_direction_is_made_a_unit_vector_behind_what_bends_already() -> None:
    robot = ElasticCoordinate.apply(
        Robot.load("six_axis"), np.array([1.0, 1.0, 0.0, 5e4, 10.0]), "axis_4", "wrist"
    )
    assert robot.chain.names[robot.chain.names.index("axis_4") + 1] == "wrist"
    np.testing.assert_allclose(
        robot.chain.axis[robot.chain.names.index("wrist")], [0.5**0.5, 0.5**0.5, 0], rtol=1e-15
    )
    assert robot.parameters()["bearing_stiffness.wrist"] == 5e4


@pytest.mark.parametrize(
    ("values", "on", "label", "message"),
    [
        ([0, 0, 0, 1e5, 1], "axis_4", "soft", "effects.soft: the axis .* is zero; give a direction"),
        ([1, 0, 0, 1e5, 1], "axis_9", "soft", "effects.soft: there is no body 'axis_9'"),
        ([1, 0, 0, 1e5, 1], "axis_4", "axis_1_x", "effects.axis_1_x: there is a bearing 'axis_1_x' already"),
        ([1, 0, 0, 1e5, 1], "axis_1", "soft", "effects.soft: bearings.soft.axis: .* can turn already"),
    ],
)
def test_what_cannot_bend_is_refused(values: list[float], on: str, label: str, message: str) -> None:
    with pytest.raises(ConfigurationError, match=message):
        ElasticCoordinate.apply(Robot.load("six_axis"), np.array(values, dtype=float), on, label)
