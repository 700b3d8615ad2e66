"""Long recordings in parts: nothing is lost or moved between channels, and periods stay whole."""

from __future__ import annotations

import numpy as np
import pytest

from robid_core import Channel, DataRejected, DenseRun, Record
from robid_diagnosis.parts import cut_into_parts

N_EXP, N_SAMPLE, N_AXIS = 2, 1003, 3


def record(line: np.ndarray | None = None) -> Record:
    shape = (1, 1, N_EXP, 1, N_SAMPLE, N_AXIS)
    values = np.arange(np.prod(shape), dtype=float).reshape(shape)
    run = DenseRun(
        sample_time_s=1e-3,
        channels={
            "motor_position": Channel("motor", "rad", values),
            "motor_torque": Channel("motor", "N m", -values),
        },
        time_s=1e-3 * np.arange(N_SAMPLE),
        valid=np.ones(shape[:-1], dtype=bool),
        test=np.array([[[False, True]]]),
        constant_names=("payload",),
        constants=np.array([[[[1.0], [2.0]]]]),
    )
    return Record(("a", "b", "c"), "test", "zero_order_hold", (run,), np.zeros((1, N_AXIS)), line)


def test_parts_follow_one_another() -> None:
    whole, cut = record(), cut_into_parts(record(), 10, 0.003)
    assert cut.run.valid.shape == (1, 1, 10 * N_EXP, 1, 100)
    for name in ("motor_position", "motor_torque"):
        joined = cut.run.lanes(name).reshape(N_EXP, 1000, N_AXIS)
        np.testing.assert_array_equal(joined, whole.run.lanes(name)[:, 3:])


def test_what_an_experiment_is_told_holds_for_its_parts() -> None:
    run = cut_into_parts(record(), 4).run
    assert run.test is not None
    np.testing.assert_array_equal(run.test.ravel(), [False] * 4 + [True] * 4)
    np.testing.assert_array_equal(run.constant("payload").ravel(), [1.0] * 4 + [2.0] * 4)


def test_one_part_is_the_record_itself() -> None:
    whole = record()
    assert cut_into_parts(whole, 1) is whole


def test_periods_and_short_recordings_are_refused() -> None:
    with pytest.raises(DataRejected, match="stays whole"):
        cut_into_parts(record(np.array([3, 5])), 2)
    with pytest.raises(DataRejected, match="cannot be cut"):
        cut_into_parts(record(), 600)
