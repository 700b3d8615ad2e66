"""Pieces between gaps are records of their own; what is whole, or repeats, stays what it is."""

from __future__ import annotations

import numpy as np
import pytest

from robid_core import DataRejected, Record, Robot
from robid_core.residual import whole_pieces, words_of_pieces

STEP, N = 1e-3, 100
ROBOT = Robot.load("one_axis")


def record_of(angle: np.ndarray) -> Record:
    """One configuration for each row of angles, NaN where nothing was measured."""
    axes = "n_config n_sample"
    return Record.from_arrays(
        motor_position=angle, motor_torque=-angle, sample_time_s=STEP, axes=axes, robot=ROBOT, axis_names=()
    )


def with_gaps() -> Record:
    angle = np.arange(2.0 * N).reshape(2, N)
    angle[0, 40:50] = np.nan
    angle[1, [0, 95]] = np.nan
    record = record_of(angle)
    return record.replace(
        variants=("light", "loaded"),
        runs=(
            record.run.replace(
                test=np.array([[[False]], [[True]]]),
                constant_names=("kg",),
                constants=np.array([[[[1.0]]], [[[2.0]]]]),
            ),
        ),
    )


def test_pieces_keep_what_their_experiment_was() -> None:
    pieces = whole_pieces([with_gaps()], 0.01, "stage", "lower it")
    assert [len(one.run.time_s) for one in pieces] == [40, 50, 94]  # that of four samples is too short
    assert [one.variants for one in pieces] == [("light",), ("light",), ("loaded",)]
    assert [one.run.constant("kg").item() for one in pieces] == [1.0, 1.0, 2.0]
    assert [one.run.test.item() for one in pieces] == [False, False, True]
    for one, first in zip(pieces, (0, 50, N + 1), strict=True):
        position = one.run.values("motor_position").ravel()
        np.testing.assert_array_equal(position, first + np.arange(len(position)))
        np.testing.assert_array_equal(one.run.values("motor_torque").ravel(), -position)
        assert one.run.valid.all()
    told = words_of_pieces([with_gaps()], pieces)
    assert told == "takes the pieces between the gaps: 3 of 0.04 s and more, 92 % of what was recorded"


def test_whole_records_and_those_that_repeat_stay_as_they_are() -> None:
    whole = record_of(np.arange(1.0 * N)[None])
    repeating = with_gaps().replace(line=np.array([3]))
    assert whole_pieces([whole, repeating], 0.01, "stage", "lower it") == (whole, repeating)
    assert words_of_pieces([whole, repeating], [whole, repeating]) == ""


def test_a_record_of_nothing_but_short_pieces_is_refused() -> None:
    with pytest.raises(
        DataRejected, match=r"stage: no piece of arrays between its gaps lasts 0.1 s; lower it, or"
    ):
        whole_pieces([with_gaps()], 0.1, "stage", "lower it")
