"""What is left of a log that was cut: the configurations that are whole, as a record that every stage takes."""

from __future__ import annotations

import numpy as np

from robid_core import Channel, DenseRun, Record
from robid_core.commands.records import whole_configurations

SHAPE = (4, 2, 3, 2, 50)  # configurations, blocks, experiments, periods, samples


def record_with(valid: np.ndarray) -> Record:
    draw = np.random.default_rng(0)
    channels = {
        "motor_position": Channel("motor", "rad", draw.standard_normal((*SHAPE, 3))),
        "motor_torque": Channel("motor", "N m", draw.standard_normal((*SHAPE, 3))),
    }
    run = DenseRun(1e-3, channels, 1e-3 * np.arange(SHAPE[-1]), valid)
    pose = np.arange(12.0).reshape(4, 3)
    return Record(("a", "b", "c"), "log", "zero_order_hold", (run,), pose, np.array([1, 3, 5]))


def test_configurations_that_are_cut_are_left_out_and_named() -> None:
    valid = np.ones(SHAPE, dtype=bool)
    valid[3, 1, 2, 1, 20:] = False
    valid[1, 0, 0, 0, 7] = False
    whole, told = whole_configurations(record_with(valid))
    assert told == "; left out: configurations 2, 4, which are cut"
    assert whole.run.valid.all()
    np.testing.assert_array_equal(whole.angle, record_with(valid).angle[[0, 2]])
    expected = record_with(valid).run.values("motor_torque")[[0, 2]]
    np.testing.assert_array_equal(whole.run.values("motor_torque"), expected)


def test_where_none_is_whole_all_is_written_and_a_sound_record_is_left_alone() -> None:
    valid = np.ones(SHAPE, dtype=bool)
    assert whole_configurations(record_with(valid))[1] == ""
    valid[..., -1] = False
    kept, told = whole_configurations(record_with(valid))
    assert "no configuration is whole" in told
    assert kept.run.valid.sum() == valid.sum()
