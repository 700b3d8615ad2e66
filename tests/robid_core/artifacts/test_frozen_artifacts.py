"""What is inside an artifact stays as it was: nobody writes into it, by no way that numpy leaves open."""

import copy
import pickle
from pathlib import Path

import numpy as np
import pytest

from robid_core import Channel, Configurations, DenseRun, frozen

SHAPE = (1, 1, 1, 2, 8, 3)


def configurations(angle: np.ndarray) -> Configurations:
    return Configurations(axis_names=("a", "b", "c"), angle=angle)


def run_of(values: np.ndarray) -> DenseRun:
    channels = {"motor_torque": Channel("motor", "N m", values)}
    return DenseRun(1e-3, channels, np.arange(8) * 1e-3, np.ones(SHAPE[:-1], dtype=bool))


def test_what_the_caller_writes_later_does_not_reach_the_artifact() -> None:
    angle = np.zeros((2, 3))
    whole = np.zeros((4, 3))
    marked_only = np.zeros((2, 3))
    view_marked = marked_only.view()
    view_marked.flags.writeable = False  # says nothing about the array that it is a view of
    made = [configurations(values) for values in (angle, whole[::2], whole[1:3].T.T, view_marked)]
    for values in (angle, whole, marked_only):
        values[:] = 1.0
    assert all((one.angle == 0.0).all() for one in made)


def test_an_artifacts_array_refuses_writing_and_stays_that_way() -> None:
    for angle in (np.zeros((2, 3)), frozen(np.zeros((2, 3))), np.zeros((4, 3))[::2]):
        one = configurations(angle)
        with pytest.raises(ValueError, match="read-only"):
            one.angle[0, 0] = 1.0
        with pytest.raises(ValueError, match="cannot set WRITEABLE"):
            one.angle.flags.writeable = True


def test_a_frozen_array_and_parts_of_an_artifact_are_taken_without_a_copy() -> None:
    values = frozen(np.zeros((2, *SHAPE))[0])
    run = run_of(values)
    assert np.shares_memory(run.values("motor_torque"), values)
    again = run.replace(sample_time_s=2e-3)
    assert np.shares_memory(again.values("motor_torque"), values)
    assert np.shares_memory(run.channel("motor_torque").select("n_sample", slice(2, 4)).values, values)
    repeated = np.broadcast_to(frozen(np.zeros(3)), SHAPE)  # as a reference that is the same in every period
    assert run_of(repeated).values("motor_torque").strides[:5] == (0,) * 5


def test_freezing_a_view_freezes_what_it_is_a_view_of() -> None:
    whole = np.zeros((4, 3))
    frozen(whole[1:3].T)
    with pytest.raises(ValueError, match="read-only"):
        whole[0] = 1.0


def test_channels_can_be_neither_set_nor_taken_away() -> None:
    given = {"motor_torque": Channel("motor", "N m", np.zeros(SHAPE))}
    run = DenseRun(1e-3, given, np.arange(8) * 1e-3, np.ones(SHAPE[:-1], dtype=bool))
    given.clear()
    assert set(run.channels) == {"motor_torque"}
    with pytest.raises(TypeError, match="read-only"):
        run.channels["motor_torque"] = run.channels["motor_torque"]
    for change in ("clear", "popitem", "update"):
        with pytest.raises(TypeError, match="read-only"):
            getattr(run.channels, change)()
    assert set(run.channels | {"motor_position": run.channel("motor_torque")}) == {
        "motor_position",
        "motor_torque",
    }


def test_copies_and_files_come_back_frozen(tmp_path: Path) -> None:
    run = run_of(np.arange(48.0).reshape(SHAPE))
    run.write(tmp_path / "run.h5")
    for again in (pickle.loads(pickle.dumps(run)), copy.deepcopy(run), DenseRun.read(tmp_path / "run.h5")):
        values = again.values("motor_torque")
        np.testing.assert_array_equal(values, run.values("motor_torque"))
        with pytest.raises(ValueError, match="cannot set WRITEABLE"):
            values.flags.writeable = True
        with pytest.raises(TypeError, match="read-only"):
            again.channels.clear()
