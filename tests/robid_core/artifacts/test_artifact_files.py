"""Artifacts on disk: exact, equal content in equal bytes, open to others, refused when they are not whole."""

from pathlib import Path

import h5py
import numpy as np
import pytest

from robid_core import Channel, Configurations, DataRejected, DenseRun, Design, Frf, Record, StoreError
from robid_core.artifacts import Artifact


def small_record() -> Record:
    rng = np.random.default_rng(3)
    shape = (2, 1, 2, 3, 16, 1)
    run = DenseRun(
        sample_time_s=0.001,
        channels={
            "motor_torque": Channel(side="motor", unit_symbol="N m", values=rng.standard_normal(shape)),
            "motor_position": Channel(side="motor", unit_symbol="rad", values=rng.standard_normal(shape)),
        },
        time_s=np.arange(16) * 0.001,
        valid=np.ones(shape[:-1], dtype=bool),
    )
    return Record(
        axis_names=("axis_1",),
        source="test",
        torque_hold="zero_order_hold",
        runs=(run,),
        angle=np.zeros((2, 1)),
        line=np.array([1, 3]),
    )


def design() -> Design:
    return Design(
        axis_names=("axis_1",),
        angle=np.array([[0.1]]),
        criterion="D",
        parameter_names=("gear_stiffness.axis_1",),
        gap=1e-7,
        efficiency=0.99,
        weight=np.array([1.0]),
        experiments=np.array([4]),
        candidate_index=np.array([2]),
        information=np.array([[2.0]]),
        predicted_standard_error=np.array([np.nan]),
    )


def test_a_nested_record_survives_the_file_to_the_last_bit(tmp_path: Path) -> None:
    record = small_record()
    record.write(tmp_path / "record.h5")
    back = Record.read(tmp_path / "record.h5")
    assert back.axis_names == record.axis_names
    assert set(back.run.channels) == set(record.run.channels)
    for name, channel in record.run.channels.items():
        np.testing.assert_array_equal(back.run.values(name), channel.values)
    assert back.line is not None
    np.testing.assert_array_equal(back.line, [1, 3])


def test_complex_responses_keep_every_bit_and_absent_fields_stay_absent(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    response = rng.standard_normal((1, 3, 2, 2)) + 1j * rng.standard_normal((1, 3, 2, 2))
    frf = Frf(
        axis_names=("a", "b"), estimator="test", pooling="", sample_time_s=1e-3, torque_hold="continuous",
        angle=np.zeros((1, 2)), frequency_hz=np.array([1.0, 2.0, 3.0]), response=response,
    )  # fmt: skip
    frf.write(tmp_path / "frf.h5")
    back = Frf.read(tmp_path / "frf.h5")
    np.testing.assert_array_equal(back.response, response)
    assert back.valid is None
    assert not back.has_covariance


@pytest.mark.parametrize("make", [small_record, design])
def test_equal_content_gives_equal_bytes(make, tmp_path: Path) -> None:
    make().write(tmp_path / "one.h5")
    make().write(tmp_path / "two.h5")
    assert (tmp_path / "one.h5").read_bytes() == (tmp_path / "two.h5").read_bytes()


def test_other_programs_find_axes_and_units_inside(tmp_path: Path) -> None:
    small_record().write(tmp_path / "record.h5")
    with h5py.File(tmp_path / "record.h5") as file:
        values = file["runs/0000/channels/motor_torque/values"]
        assert values.attrs["axes"] == "n_config n_block n_exp n_period n_sample n_axis"
        assert file["angle"].attrs["unit"] == "rad"
        assert values.dims[4].label == "n_sample"


def test_a_design_is_read_where_configurations_are_wanted_but_not_the_reverse(tmp_path: Path) -> None:
    design().write(tmp_path / "design.h5")
    assert isinstance(Configurations.read(tmp_path / "design.h5"), Design)
    Configurations(axis_names=("axis_1",), angle=np.zeros((1, 1))).write(tmp_path / "plain.h5")
    with pytest.raises(DataRejected, match="holds a Configurations, not a Design"):
        Design.read(tmp_path / "plain.h5")


def test_arrays_of_an_artifact_cannot_be_changed() -> None:
    configurations = Configurations(axis_names=("axis_1",), angle=np.zeros((1, 1)))
    with pytest.raises(ValueError, match="read-only"):
        configurations.angle[0, 0] = 1.0


def test_a_nan_is_named_with_its_place() -> None:
    angle = np.zeros((2, 3))
    angle[1, 2] = np.nan
    with pytest.raises(DataRejected, match=r"Configurations.angle: 1 values .* n_config=1, n_axis=2"):
        Configurations(axis_names=("a", "b", "c"), angle=angle)


def test_axes_of_one_name_must_agree() -> None:
    with pytest.raises(DataRejected, match="axis n_freq has length 2, elsewhere in this artifact it has 3"):
        Frf(
            axis_names=("a",), estimator="", pooling="", sample_time_s=1e-3, torque_hold="continuous",
            angle=np.zeros((1, 1)), frequency_hz=np.ones(3), response=np.ones((1, 2, 1, 1), complex),
        )  # fmt: skip


def test_selecting_lines_cuts_every_field_that_has_lines() -> None:
    record = small_record()
    assert record.select("n_config", [1]).angle.shape == (1, 1)


def test_a_file_that_is_no_artifact_is_refused(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "foreign.h5", "w") as file:
        file["x"] = [1, 2]
    with pytest.raises(StoreError, match="not one of robid's"):
        Artifact.read(tmp_path / "foreign.h5")
    (tmp_path / "broken.h5").write_bytes(b"not hdf5")
    with pytest.raises(StoreError, match=r"broken\.h5: cannot be read"):
        Artifact.read(tmp_path / "broken.h5")


def test_spectra_follow_the_sign_and_the_scale_of_the_docstring() -> None:
    """A cos(w t) has the spectrum A/2; a position -B cos(w t + p) the acceleration w^2 B/2 e^(i p)."""
    n, line = 64, 5
    t = np.arange(n) * 1e-3
    omega = 2 * np.pi * line / (n * 1e-3)
    torque, position = 3.0 * np.cos(omega * t), -2.0 * np.cos(omega * t + 0.3)
    channels = {
        name: Channel(side="motor", unit_symbol="", values=np.tile(v, (1, 1, 1, 2, 1))[..., None])
        for name, v in (("motor_torque", torque), ("motor_position", position))
    }
    valid = np.ones((1, 1, 1, 2, n), dtype=bool)
    run = DenseRun(sample_time_s=1e-3, channels=channels, time_s=t, valid=valid)
    record = Record(
        axis_names=("a",), source="", torque_hold="continuous", runs=(run,), angle=np.zeros((1, 1)),
        line=np.array([line]),
    )  # fmt: skip
    u, y = record.spectra()
    assert u.shape == (1, 1, 1, 1, 1)
    np.testing.assert_allclose(u.ravel(), 1.5, rtol=1e-12)
    np.testing.assert_allclose(y.ravel(), omega**2 * 1.0 * np.exp(0.3j), rtol=1e-12)


def test_a_missing_sample_is_named_and_may_be_discarded_with_its_period() -> None:
    record = small_record()
    valid = np.ones((2, 1, 2, 3, 16), dtype=bool)
    valid[1, 0, 1, 0, 7] = False
    holed = record.replace(runs=(record.run.replace(valid=valid),))
    with pytest.raises(DataRejected, match="configuration 2, block 1, experiment 2, period 1, at 0.0070 s"):
        holed.spectra()
    holed.spectra(discard=1)
