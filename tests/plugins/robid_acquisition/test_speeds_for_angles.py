"""A speed that was recorded where an angle is claimed is refused by name, and what to write then is read."""

from __future__ import annotations

import json
import logging
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy
from oracles.rigid_arm import ARM, STEP, loaded, record_of, recording

from robid_acquisition.plausible import slips_of
from robid_acquisition.recorded import RecordedAcquisition
from robid_core import Context, DataRejected, Record, Robot
from robid_core.stage import map_in_process

SECONDS = 10.0
FLAT = {**ARM, "name": "flat", "gravity": [0.0, 0.0, 0.0]}


def moved(robot: Robot) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Angle, speed and torque of the motors, by pinocchio, (n_sample, n_axis) each."""
    run = recording(robot, 1, seconds=SECONDS, noise=0.02).run
    angle, torque = (run.values(name)[0, 0, 0, 0] for name in ("motor_position", "motor_torque"))
    inside = slice(1, -1)  # at both ends differences are one-sided
    return angle[inside], np.gradient(angle, STEP, axis=0)[inside], torque[inside]


@pytest.mark.parametrize("arm", [ARM, FLAT])
@pytest.mark.parametrize("axes", [(), (1,), (2,), (0, 1, 2)])
def test_speeds_in_place_of_angles_are_named(
    tmp_path: Path, arm: dict[str, Any], axes: tuple[int, ...]
) -> None:
    """With gravity and without: the torques then say where the motion began, or it does not matter."""
    robot = loaded(tmp_path, arm)
    angle, speed, torque = moved(robot)
    column = np.where(np.isin(np.arange(3), axes), speed, angle)
    found = [slip.what for slip in slips_of(record_of(robot, column, torque), robot)]
    names = ", ".join(f"j{a + 1}" for a in axes)
    one = f"the angle of {names} looks like a speed"
    assert found == (
        [] if not axes else [one] if len(axes) == 1 else [f"the angles of {names} look like speeds"]
    )


def test_a_robot_file_that_is_off_is_no_speed(tmp_path: Path) -> None:
    """Bodies a half heavier leave much of the torques, and no integral mends that."""
    robot = loaded(tmp_path, ARM)
    heavy = loaded(
        tmp_path,
        {**ARM, "name": "heavy", "bodies": [{**body, "mass": 1.5 * body["mass"]} for body in ARM["bodies"]]},
    )
    angle, _, torque = moved(robot)
    assert not any("speed" in slip.what for slip in slips_of(record_of(heavy, angle, torque), heavy))


def read(folder: Path, robot: Robot, **channels: Any) -> Record:
    channels |= {"motor_torque": {"column": "torque", "unit": "N m"}}
    words = {"path": "run.npz", "sample_time_s": STEP, "channels": channels}
    stage = RecordedAcquisition.model_validate_json(json.dumps(words), strict=True)
    logger = logging.getLogger("test")
    return stage.run(
        robot, Context(np.random.default_rng(0), map_in_process, lambda *_, **__: None, logger, folder)
    )


def test_the_advice_is_read(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """The angle's own column beside it, or where there is none, the integral."""
    robot = loaded(tmp_path, ARM)
    angle, speed, torque = moved(robot)
    integral = angle[0] + scipy.integrate.cumulative_trapezoid(speed, dx=STEP, axis=0, initial=0)
    np.savez(tmp_path / "run.npz", q=angle, dq=speed, integral=integral, torque=torque)
    with pytest.raises(DataRejected) as refused:
        read(tmp_path, robot, motor_position={"column": "dq", "unit": "rad"})
    advice = "motor_position: the column of the angle; this one is motor_speed, unit: rad/s"
    assert advice in str(refused.value)
    assert "a column with their integral, from the angle on at which the recording began" in str(
        refused.value
    )
    both = read(
        tmp_path,
        robot,
        motor_position={"column": "q", "unit": "rad"},
        motor_speed={"column": "dq", "unit": "rad/s"},
    )
    assert both.run.values("motor_speed").shape == both.run.values("motor_position").shape
    read(tmp_path, robot, motor_position={"column": "integral", "unit": "rad"})
    assert not caplog.records
