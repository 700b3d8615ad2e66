"""The acquisition through drives: what it asks of them, what it rejects, what it keeps."""

import logging
from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from robid_acquisition.drives import (
    DriveAcquisition,
    drift_per_period,
    reject_drift,
    reject_saturated,
    unsaturated_share,
)
from robid_core import (
    ConfigurationError,
    Configurations,
    Context,
    DataRejected,
    Excitation,
    MotionAborted,
    MotionLimits,
    MotionRefused,
    Robot,
    Trace,
)
from robid_core.stage import map_in_process

AXES = ("axis_1", "axis_2")
N_SAMPLE = 40


class RobotDouble:
    """What the stage asks of a robot: gears of 100, limits."""

    name, axis_names, n_axis, sample_time_s = "double", AXES, 2, 1e-3
    limits = MotionLimits(AXES, np.full(2, -500.0), np.full(2, 500.0), np.full(2, 50.0), np.full(2, 1e6))

    def motor_angle(self, angle):
        return 100.0 * np.asarray(angle)

    def to_yaml(self):
        return "name: double\n"


@dataclass
class DrivesDouble:
    """Drives that answer with numbers from which the experiment can be told."""

    spoil: object = staticmethod(lambda number, trace: trace)
    performed: list = field(default_factory=list)
    events: list = field(default_factory=list)

    def open(self, session):
        self.session = session
        return self

    def __enter__(self):
        self.events.append("up")
        return self

    def __exit__(self, *exception):
        self.events.append("down")

    def perform(self, experiment):
        number = len(self.performed)
        self.performed.append(experiment)
        shape = (experiment.traced, *experiment.reference.shape)
        generator = np.random.default_rng(experiment.seed)
        within = experiment.start + np.cumsum(experiment.reference, axis=0) * 1e-3
        position = np.broadcast_to(within, shape) + 1e-6 * generator.standard_normal(shape)
        torque = generator.standard_normal(shape)
        trace = Trace(
            position, torque, np.ones(shape[:2], dtype=bool), np.zeros(2), experiment.reference, number * 1.0
        )
        return self.spoil(number, trace)


def configurations(angle=((0.1, 0.2), (-0.3, 0.4))):
    return Configurations(AXES, np.array(angle))


def excitation(scale=1.0, n_realization=2):
    phase = 2 * np.pi * np.arange(N_SAMPLE) / N_SAMPLE
    reference = np.empty((n_realization, 2, 2, N_SAMPLE, 2))
    for index in np.ndindex(n_realization, 2, 2):
        number = 1 + np.ravel_multi_index(index, (n_realization, 2, 2))
        reference[index] = scale * np.sin(phase + number)[:, None] * [1.0, 2.0]
    return Excitation(AXES, 1e-3, 0, np.array([1], dtype=np.int64), reference, np.zeros(2))


def context(seed=3, **changes):
    steps = []
    made = Context(
        generator=np.random.default_rng(seed),
        map=map_in_process,
        progress=lambda done, total, note="": steps.append((done, total, note)),
        log=logging.getLogger("robid.acquire"),
        **changes,
    )
    return made, steps


def acquire(drives, stage=None, **changes):
    lent, _ = context(**changes)
    stage = stage or DriveAcquisition()
    return stage.run(configurations(), excitation(), RobotDouble(), drives, lent)


def test_every_experiment_stands_in_its_place_of_the_record():
    drives = DrivesDouble()
    record = acquire(drives)
    reference = excitation().reference
    assert record.run.valid.shape == (2, 2, 2, 2, N_SAMPLE)
    assert record.run.valid.all()
    for number, place in enumerate(np.ndindex(2, 2, 2)):
        performed = drives.performed[number]
        np.testing.assert_array_equal(performed.reference, reference[place])
        # The motion goes about the configuration: start plus the mean of the reference's integral is its angle.
        travel = np.cumsum(performed.reference, axis=0) * performed.sample_time_s
        middle = 100.0 * configurations().angle[place[0]]
        np.testing.assert_allclose(performed.start + travel.mean(axis=0), middle, atol=1e-12)
        assert (performed.periods, performed.traced) == (3, 2)
        spoken = record.run.values("speed_reference")[place]
        np.testing.assert_array_equal(spoken, np.broadcast_to(reference[place], (2, N_SAMPLE, 2)))
        position = record.run.values("motor_position")[place]
        np.testing.assert_allclose(position[:, -1], np.broadcast_to(performed.start, (2, 2)), atol=1e-3)
    np.testing.assert_array_equal(record.angle, configurations().angle)
    assert record.frequency_hz.tolist() == [25.0]
    assert record.torque_hold == "zero_order_hold"
    assert {(c.side, c.unit_symbol) for c in record.run.channels.values()} == {
        ("motor", "rad"),
        ("motor", "N m"),
        ("motor", "rad/s"),
    }


def test_configurations_beyond_the_realizations_use_them_again():
    drives = DrivesDouble()
    lent, _ = context()
    three = configurations(((0.1, 0.2), (-0.3, 0.4), (0.0, 0.0)))
    DriveAcquisition().run(three, excitation(), RobotDouble(), drives, lent)
    np.testing.assert_array_equal(drives.performed[8].reference, drives.performed[0].reference)


def test_every_experiment_is_cleared_before_the_first_one_moves():
    drives = DrivesDouble()
    lent, _ = context()
    tight = configurations(((0.1, 0.2), (-0.3, 5.0)))  # the second stands on the position limit
    with pytest.raises(
        MotionRefused, match=r"configuration 2, block 1, experiment 1: D03: axis_2.*nothing was sent"
    ):
        DriveAcquisition().run(tight, excitation(), RobotDouble(), drives, lent)
    assert drives.events == []
    with pytest.raises(MotionRefused, match="speed"):
        DriveAcquisition().run(configurations(), excitation(scale=60.0), RobotDouble(), drives, lent)
    assert drives.events == []


def test_clearance_covers_all_periods_that_will_run():
    drives = DrivesDouble()
    acquire(drives, DriveAcquisition(periods=4, settle_periods=3))
    for performed in drives.performed:
        assert performed.cleared
        assert performed.periods == 7


def test_chance_comes_from_the_stage_alone_and_each_experiment_has_its_own(tmp_path):
    first, second, other = (DrivesDouble() for _ in range(3))
    acquire(first).write(tmp_path / "first.h5")
    acquire(second).write(tmp_path / "second.h5")
    acquire(other, seed=4)
    assert len({performed.seed for performed in first.performed}) == 8
    assert [p.seed for p in first.performed] == [p.seed for p in second.performed]
    assert [p.seed for p in first.performed] != [p.seed for p in other.performed]
    assert (tmp_path / "first.h5").read_bytes() == (tmp_path / "second.h5").read_bytes()


def test_progress_counts_experiments_up_to_all_of_them():
    lent, steps = context()
    DriveAcquisition().run(configurations(), excitation(), RobotDouble(), DrivesDouble(), lent)
    assert [done for done, _, _ in steps] == list(range(9))
    assert {total for _, total, _ in steps} == {8}
    assert steps[3][2] == "configuration 1, block 2, experiment 2"


def test_samples_that_the_drives_did_not_take_are_masked_in_the_record():
    def gap(number, trace):
        valid = trace.valid.copy()
        valid[1, 7] = number != 5
        return replace(trace, valid=valid)

    record = acquire(DrivesDouble(gap))
    assert np.argwhere(~record.run.valid).tolist() == [[1, 0, 1, 1, 7]]
    with pytest.raises(DataRejected, match="configuration 2, block 1, experiment 2, period 2"):
        record.spectra()


def test_D02_saturated_torque_rejects_the_data_and_proposes_an_amplitude():
    def saturate(number, trace):
        return replace(trace, saturated=np.array([0.0, 0.05 if number == 3 else 0.0]))

    drives = DrivesDouble(saturate)
    expected = (
        r"D02: configuration 1, block 2, experiment 2: axis_2: .* 5\.00% .* amplitude of this axis to 0\.50"
    )
    with pytest.raises(DataRejected, match=expected):
        acquire(drives)
    assert drives.events == ["up", "down"]
    assert len(drives.performed) == 4  # and no motion more


def test_little_saturation_is_only_noted(caplog):
    def saturate(number, trace):
        return replace(trace, saturated=np.array([0.002, 0.0]))

    with caplog.at_level(logging.WARNING):
        acquire(DrivesDouble(saturate))
    assert "axis_1: the torque is at its limit in 0.20% of the samples" in caplog.text
    assert reject_saturated("x", np.zeros(2), AXES, 0.0) == []


@pytest.mark.parametrize("share", [0.011, 0.05, 0.3])
def test_proposed_amplitude_leaves_the_limit_alone(share):
    generator = np.random.default_rng(1)
    torque = generator.standard_normal(1_000_000)
    limit = np.quantile(np.abs(torque), 1 - share)
    left = (np.abs(unsaturated_share(share) * torque) >= limit).mean()
    # 3.9 standard deviations: 1e-4 expected; the count scatters by its root, 10 of 100
    assert left == pytest.approx(1e-4, abs=5e-5)


def test_drift_is_the_mean_way_between_periods_and_noise_averages_out():
    generator = np.random.default_rng(2)
    within = np.sin(2 * np.pi * np.arange(4000) / 4000)[:, None] * [1.0, 2.0]
    position = np.stack([within + p * np.array([0.02, 0.0]) for p in range(3)])
    noisy = position + 1e-3 * generator.standard_normal(position.shape)
    # mean over 4000 samples of a difference of two noises: 1e-3 * sqrt(2 / 4000) = 2e-5
    np.testing.assert_allclose(drift_per_period(noisy), [0.02, 0.0], atol=1e-4)
    np.testing.assert_array_equal(drift_per_period(noisy[:1]), [0.0, 0.0])
    reject_drift("x", noisy, AXES, 0.03)
    with pytest.raises(DataRejected, match=r"x: axis_1: the motor angle drifts by 0\.02 rad per period"):
        reject_drift("x", noisy, AXES, 0.01)


def test_motor_that_walks_away_rejects_the_data():
    def walk(number, trace):
        return replace(trace, position=trace.position + np.arange(2)[:, None, None] * [0.0, 0.2])

    with pytest.raises(
        DataRejected, match="configuration 1, block 1, experiment 1: axis_2: the motor angle drifts"
    ):
        acquire(DrivesDouble(walk))


def test_inputs_of_another_robot_are_refused():
    lent, _ = context()
    wrong = replace(configurations(), axis_names=("a", "b"))
    with pytest.raises(
        ConfigurationError, match="configurations are for the axes a, b, robot 'double' has axis_1"
    ):
        DriveAcquisition().run(wrong, excitation(), RobotDouble(), DrivesDouble(), lent)
    slow = replace(excitation(), sample_time_s=2e-3)
    with pytest.raises(
        ConfigurationError, match=r"sampled at 0\.002 s, the drives of robot 'double' at 0\.001 s"
    ):
        DriveAcquisition().run(configurations(), slow, RobotDouble(), DrivesDouble(), lent)


# The raw log


def test_raw_log_gives_the_record_of_the_acquisition(tmp_path):
    from robid_mcap.records import McapRecords

    record = acquire(DrivesDouble(), scratch=tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["acquire.mcap"]
    again = McapRecords.read_record(tmp_path / "acquire.mcap")
    again.write(tmp_path / "again.h5")
    record.write(tmp_path / "record.h5")
    assert (tmp_path / "again.h5").read_bytes() == (tmp_path / "record.h5").read_bytes()
    assert any("robot.yaml" in line for line in McapRecords.describe(tmp_path / "acquire.mcap"))


def test_aborted_motion_keeps_what_was_measured_and_says_how_much(tmp_path):
    from robid_mcap.records import McapRecords

    def abort(number, trace):
        if number == 5:
            raise MotionAborted("B07: axis_2 has been silent")
        return trace

    drives = DrivesDouble(abort)
    with pytest.raises(
        MotionAborted, match="B07: axis_2 has been silent; 5 of 8 experiments are kept in the raw log"
    ):
        acquire(drives, scratch=tmp_path)
    assert drives.events == ["up", "down"]
    assert [path.name for path in tmp_path.iterdir()] == ["acquire.mcap.part"]
    record = McapRecords.read_record(tmp_path / "acquire.mcap.part")
    assert record.run.valid.all(axis=(3, 4)).sum() == 5


def test_rejected_data_are_kept_in_the_raw_log_too(tmp_path):
    from robid_mcap.records import McapRecords

    with pytest.raises(DataRejected):
        acquire(DrivesDouble(lambda number, trace: replace(trace, saturated=np.ones(2))), scratch=tmp_path)
    record = McapRecords.read_record(tmp_path / "acquire.mcap.part")
    assert record.run.valid.all(axis=(3, 4)).sum() == 1


def test_without_a_folder_or_a_format_there_is_no_raw_log(tmp_path):
    drives = DrivesDouble()
    acquire(drives)
    assert drives.session.raw_log is None
    acquire(drives, DriveAcquisition(raw_log=None), scratch=tmp_path)
    assert drives.session.raw_log is None
    assert list(tmp_path.iterdir()) == []


def test_format_that_cannot_write_is_refused(tmp_path):
    with pytest.raises(ConfigurationError, match="'npz' is for reading only"):
        acquire(DrivesDouble(), DriveAcquisition(raw_log="npz"), scratch=tmp_path)


@pytest.mark.parametrize(
    "settings", [{"periods": 0}, {"settle_periods": -1}, {"saturation_limit": 1.0}, {"period": 2}]
)
def test_settings_that_cannot_be_meant_are_refused(settings):
    with pytest.raises(ValueError, match="validation error"):
        DriveAcquisition(**settings)


def test_stage_says_what_it_takes():
    assert [(i.name, i.artifact) for i in DriveAcquisition.inputs()] == [
        ("configurations", Configurations),
        ("excitation", Excitation),
    ]
    assert set(DriveAcquisition.lends()) == {"robot", "drives", "context"}
    assert DriveAcquisition.lends()["robot"] is Robot
