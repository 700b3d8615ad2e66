"""The study of fits in time and in frequency: friction that is taken off, and what the table tells."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from robid_core import Channel, DenseRun, Record, Robot

sys.path.append(str(Path(__file__).parents[2]))
from studies.time_and_frequency.comparison import CASES, LESS_FRICTION, ROBOT, less_friction, report


def test_friction_at_the_measured_speed_is_taken_off() -> None:
    """Constant speeds: all that the law says, and half of it where it begins."""
    robot = Robot.load(ROBOT)
    speed, n_sample = np.array([2.0, -0.3]), 200
    time = robot.sample_time_s * np.arange(n_sample)
    shape = (1, 1, 1, 1, n_sample, 2)
    channels = {
        "motor_position": Channel("motor", "rad", (time[:, None] * speed).reshape(shape)),
        "motor_torque": Channel("motor", "N m", np.ones(shape)),
    }
    run = DenseRun(robot.sample_time_s, channels, time, np.ones(shape[:-1], dtype=bool))
    record = Record(robot.axis_names, "by hand", "zero_order_hold", (run,), np.zeros((1, 2)))
    left = less_friction(record, robot).run.values("motor_torque")
    level, width = (
        np.array([robot.parameter(f"friction.{axis}.{name}") for axis in robot.axis_names])
        for name in ("coulomb", "speed")
    )
    expected = 1 - level * np.tanh(speed / width)
    np.testing.assert_allclose(left.reshape(n_sample, 2), np.tile(expected, (n_sample, 1)), rtol=1e-9)
    assert (record.run.values("motor_torque") == 1).all()


def test_the_table_tells_errors_bias_and_coverage_of_each_case() -> None:
    case = CASES[0]
    rows = [
        {"case": case, "cpu_s": "2.0", "converged": converged, "error.a": error, "stated.a": "0.01"}
        for error, converged in (("0.01", "True"), ("-0.03", "False"))
    ]
    head, line = report(rows)
    assert head.split()[-2:] == ["cpu", "s"]
    numbers = line.removesuffix("  1 did not converge").split()
    assert numbers[:3] == [*case.split(), "2"]
    # rms sqrt((1 + 9) / 2) %, mean -1 %, stated 1 %; z of 1 and 3.
    assert [float(one) for one in numbers[3:7]] == pytest.approx([2.2361, -1.0, 1.0, 2.24])
    assert numbers[7:] == ["50%", "2.0"]
    assert LESS_FRICTION not in "".join(one for one in CASES if one.startswith("linear"))
