"""The packaged six axes with ideal sensors: what a simulation leaves is then the model's error alone."""

from __future__ import annotations

import dataclasses

import pytest

from robid_core import Robot


@pytest.fixture(scope="session")
def ideal() -> Robot:
    """Six axes with friction, without noise or steps of the encoders."""
    robot = Robot.load("six_axis")
    exact = {"position_noise": 0.0, "torque_noise": 0.0, "encoder_counts": 0}
    axes = {
        name: axis.model_copy(update={"sensors": axis.sensors.model_copy(update=exact)})
        for name, axis in robot.description.axes.items()
    }
    return dataclasses.replace(robot, description=robot.description.model_copy(update={"axes": axes}))
