"""Parts of a record: test experiments left out, what belongs to a configuration goes with it, dense or refused."""

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from robid_core import Channel, DataRejected, DenseRun, Record


def record(test: Any = None, shape: tuple[int, int, int] = (4, 2, 3), **changes: Any) -> Record:
    """Each sample is a number of its own."""
    full = (*shape, 2, 5, 1)
    channel = Channel("motor", "rad", np.arange(np.prod(full), dtype=float).reshape(full))
    n = shape[0]
    run = DenseRun(
        sample_time_s=0.1,
        channels={"motor_position": channel},
        time_s=np.arange(5) * 0.1,
        valid=channel.values[..., 0] != 7.0,
        test=None if test is None else np.broadcast_to(test, shape),
        constant_names=("payload_kg", "temperature_degC"),
        constants=np.arange(np.prod(shape) * 2, dtype=float).reshape(*shape, 2),
    )
    settings: dict[str, Any] = {
        "axis_names": ("axis_1",),
        "source": "",
        "torque_hold": "zero_order_hold",
        "runs": (run,),
        "angle": np.arange(float(n))[:, None],
        "line": np.array([1]),
        "damping_deviation": np.arange(float(n))[:, None, None],
        "variants": tuple(f"v{i}" for i in range(n)),
    }
    return Record(**{**settings, **changes})


def marked(*places: Any) -> Any:
    test = np.zeros((4, 2, 3), dtype=bool)
    for place in places:
        test[place] = True
    return test


def test_without_test_experiments_the_training_part_is_the_record_itself() -> None:
    for plain in (record(), record(marked())):
        assert plain.training() is plain


@pytest.mark.parametrize(
    ("places", "index"),
    [
        ([1], np.ix_([0, 2, 3], [0, 1], [0, 1, 2])),
        ([(slice(None), 0)], np.ix_([0, 1, 2, 3], [1], [0, 1, 2])),
        ([(slice(None), slice(None), 1)], np.ix_([0, 1, 2, 3], [0, 1], [0, 2])),
        ([0, 1, 2, (3, 0)], np.ix_([3], [1], [0, 1, 2])),
    ],
)
def test_the_training_part_holds_the_other_experiments_with_all_that_is_known_of_them(
    places: list[Any], index: Any
) -> None:
    whole = record(marked(*places))
    part = whole.training()
    configurations = index[0].ravel()
    np.testing.assert_array_equal(
        part.run.values("motor_position"), whole.run.values("motor_position")[index]
    )
    np.testing.assert_array_equal(part.run.valid, whole.run.valid[index])
    np.testing.assert_array_equal(part.run.constant("payload_kg"), whole.run.constant("payload_kg")[index])
    assert part.run.test is not None
    assert not part.run.test.any()
    np.testing.assert_array_equal(part.angle, whole.angle[configurations])
    assert part.damping_deviation is not None
    np.testing.assert_array_equal(part.damping_deviation.ravel(), configurations)
    assert part.variants == tuple(f"v{i}" for i in configurations)


def test_blocks_of_different_number_close_up() -> None:
    """Block 0 of one configuration and block 1 of the others are held out: one block is left of each."""
    whole = record(marked((0, 0), (1, 1), (2, 1), (3, 1)))
    values = whole.run.values("motor_position")
    np.testing.assert_array_equal(
        whole.training().run.values("motor_position")[:, 0],
        np.stack([values[0, 1], values[1, 0], values[2, 0], values[3, 0]]),
    )


@pytest.mark.parametrize(
    ("places", "told"),
    [
        (
            [(1, 0)],
            "configuration 1 keeps blocks of 3 and 3 experiments, configuration 2 of 3; hold out whole",
        ),
        ([(0, 0, 0)], "configuration 1 keeps blocks of 2 and 3 experiments, configuration 1 of 2 and 3"),
        ([slice(None)], "no experiment of the record is left: all are held out for tests"),
    ],
)
def test_what_is_left_without_a_common_shape_is_refused(places: list[Any], told: str) -> None:
    with pytest.raises(DataRejected, match=told):
        record(marked(*places)).training()


def test_names_must_fit_what_they_name() -> None:
    with pytest.raises(DataRejected, match="2 names for 4 configurations"):
        record(variants=("a", "b"))
    with pytest.raises(DataRejected, match="2 constants with 1 names"):
        record().run.replace(constant_names=("payload_kg",))
    with pytest.raises(DataRejected, match="no constant mass; it has payload_kg, temperature_degC"):
        record().run.constant("mass")


def test_all_of_it_survives_the_file_and_a_file_from_before_is_read(tmp_path: Path) -> None:
    whole = record(marked(2))
    whole.write(tmp_path / "record.h5")
    back = Record.read(tmp_path / "record.h5")
    assert back.variants == whole.variants
    assert back.run.constant_names == whole.run.constant_names
    assert back.run.test is not None
    np.testing.assert_array_equal(back.run.test, marked(2))
    record(variants=()).write(tmp_path / "old.h5")
    with h5py.File(tmp_path / "old.h5", "a") as file:
        file.attrs["robid_version"] = 1
        run = file["runs/0000"]
        del file.attrs["variants"], run.attrs["constant_names"], run["constants"]
    old = Record.read(tmp_path / "old.h5")
    assert old.variants == ()
    assert old.run.constants is None
    assert old.training() is old
