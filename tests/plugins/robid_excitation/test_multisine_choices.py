"""excitation.multisine: grids, amplitudes, one experiment more, searched phases, and what is told of ripple."""

from __future__ import annotations

import logging
from typing import Any

import numpy as np
import pytest
from scipy.special import jv

from robid_core import Configurations, Context, Excitation, FloatArray, Robot
from robid_core.stage import map_in_process
from robid_excitation.amplitudes import motor_speed_of, speed_of_torque, tabulated_weight
from robid_excitation.multisine import CREST, Multisine
from robid_excitation.realisations import torque_crest, torque_response
from robid_excitation.ripple_reach import planned_reach, reaches, ripple_orders

SETTINGS: dict[str, Any] = {
    "band_hz": (4.0, 80.0),
    "lines": 30,
    "period_s": 2.0,
    "blocks": 1,
    "slow_sine_rad_s": 9.0,
    "speed_rms_rad_s": 1.0,
}


@pytest.fixture(scope="module")
def robot() -> Robot:
    return Robot.load("one_axis")


@pytest.fixture(scope="module")
def standing(robot: Robot) -> Configurations:
    return Configurations(robot.axis_names, np.array([[0.3]]))


def run(robot: Robot, standing: Configurations, seed: int = 1, **changes: Any) -> Excitation:
    log = logging.getLogger("test.excitation")
    context = Context(np.random.default_rng(seed), map_in_process, lambda done, total, note="": None, log)
    return Multisine(**{**SETTINGS, **changes}).run(standing, robot, context)


def amplitude(excitation: Excitation) -> FloatArray:
    """Amplitudes of the first experiment's cosines at all bins, shape (n_bin, n_axis)."""
    return np.abs(np.fft.rfft(excitation.reference[0, 0, 0], axis=0)) * 2 / excitation.n_sample


def test_detection_lines_are_drawn_anew_and_carry_nothing(robot: Robot, standing: Configurations) -> None:
    first, again, other = (run(robot, standing, seed, detection_group=3) for seed in (1, 1, 2))
    candidates = Multisine(**SETTINGS, detection_group=3).line()
    assert len(candidates) == 45
    for excitation in (first, other):
        assert len(excitation.line) == 30
        out = np.setdiff1d(candidates, excitation.line)
        assert [np.isin(group, out).sum() for group in candidates.reshape(-1, 3)] == [1] * 15
        assert amplitude(excitation)[out].max() < 1e-12
        assert amplitude(excitation)[excitation.line].min() > 1e-3
    assert np.array_equal(first.line, again.line)
    assert not np.array_equal(first.line, other.line)


def test_linear_and_full_grids(robot: Robot, standing: Configurations) -> None:
    # 76 odd bins from 9 to 159; 30 of them are 150 / 29 = 5.2 bins apart.
    line = run(robot, standing, grid="linear").line
    assert set(np.diff(line).tolist()) == {4, 6}
    assert run(robot, standing, grid="full", lines=None).line.tolist() == list(range(9, 160, 2))


def test_an_odd_sine_has_its_odd_multiples_to_itself(robot: Robot, standing: Configurations) -> None:
    excitation = run(robot, standing, grid="full", lines=None, slow_sine_parity="odd")
    assert excitation.slow_sine_bin == 3
    assert excitation.line.tolist() == [k for k in range(9, 160, 2) if k % 3]
    assert amplitude(excitation)[3] == pytest.approx(9.0)
    other = run(robot, standing, grid="full", lines=None, slow_sine_parity="odd", slow_sine_hz=2.5)
    assert (other.slow_sine_bin, other.line.tolist()) == (5, [k for k in range(9, 160, 2) if k % 5])


@pytest.mark.parametrize(
    ("changes", "exponent"),
    [
        ({"spectrum": "flat_speed"}, 0.0),
        ({"spectrum": "flat_acceleration"}, -1.0),
        ({"spectrum": "flat_acceleration", "exponents": (1.5,)}, 0.5),
    ],
)
def test_the_reference_has_the_spectrum_that_was_asked_for(
    robot: Robot, standing: Configurations, changes: dict[str, Any], exponent: float
) -> None:
    excitation = run(robot, standing, **changes)
    spectrum = amplitude(excitation)[excitation.line, 0]
    frequency = excitation.frequency_hz
    expected = frequency**exponent
    assert spectrum / spectrum[0] == pytest.approx(expected / expected[0], rel=1e-10)
    # Under the loop's lag at the crossover K / (2 pi J) the motor has the speed that was asked for.
    inertia = 1 / np.abs(robot.response(standing.angle, frequency[:1])[0, 0, 0, 0])
    crossover = robot.drives.speed_gain[0] / inertia / (2 * np.pi)
    speed = spectrum / np.hypot(1, frequency / crossover)
    assert np.sqrt(0.5 * np.sum(speed**2)) == pytest.approx(1.0, rel=1e-9)


def test_weights_multiply_the_spectrum_along_straight_lines_on_logarithmic_axes(
    robot: Robot, standing: Configurations
) -> None:
    plain = run(robot, standing)
    # A table of ones is no other spectrum, and neither is a common factor: the level stays.
    for table in (((4.0, 1.0),), ((10.0, 7.0), (20.0, 7.0))):
        same = run(robot, standing, weights={"axis_1": table})
        assert same.reference == pytest.approx(plain.reference, abs=1e-12)
    weighted = run(robot, standing, weights={"axis_1": ((20.0, 4.0), (5.0, 1.0))})
    ratio = (amplitude(weighted) / np.maximum(amplitude(plain), 1e-9))[plain.line, 0]
    # From factor 1 at 5 Hz to 4 at 20 Hz: proportional to frequency in between, constant beyond.
    assert ratio / ratio[0] == pytest.approx(np.clip(plain.frequency_hz, 5, 20) / 5, rel=1e-9)


def test_a_table_is_straight_between_its_rows() -> None:
    weight = tabulated_weight(
        np.array([1.0, 10.0, 20.0, 40.0, 80.0, 99.0]), [(80.0, 0.5), (10.0, 2.0), (40.0, 0.5)]
    )
    assert weight == pytest.approx([2.0, 2.0, 1.0, 0.5, 0.5, 0.5])


def test_speed_of_a_given_torque_peak() -> None:
    frequency = np.array([5.0, 10.0, 20.0])
    rms = speed_of_torque(np.array([3.2]), np.array([0.01]), frequency)
    # Three cosines of 3.2 / 3.2 / sqrt(1.5) N m on 0.01 kg m^2.
    speed = 1 / np.sqrt(1.5) / 0.01 / (2 * np.pi * frequency)
    assert rms == pytest.approx([np.sqrt(0.5 * (speed**2).sum())])
    # The same as a shape, whatever its unit; and a shape whose torque is 3.2 / 3.2 rms in all.
    assert speed_of_torque(np.array([3.2]), np.array([0.01]), frequency, 7 * speed[:, None]) == pytest.approx(
        rms
    )
    flat = np.ones((3, 1))
    rms = speed_of_torque(np.array([3.2]), np.array([0.01]), frequency, flat)
    torque = 0.01 * 2 * np.pi * frequency * rms * np.sqrt(2 / 3)
    assert np.sqrt(0.5 * np.sum(torque**2)) == pytest.approx(1.0)


def test_one_experiment_more_leaves_a_column_free(robot: Robot, standing: Configurations) -> None:
    excitation = run(robot, standing, experiments_per_block="n_plus_1", blocks=2)
    assert excitation.reference.shape == (1, 2, 2, 2000, 1)
    spectrum = np.fft.rfft(excitation.reference[0], axis=2) / 2000
    # The multisines of a block sum to zero, sample by sample; the slow sine is the same in all and stays.
    assert np.abs(spectrum[:, :, excitation.line].sum(axis=1)).max() < 1e-13
    assert np.abs(spectrum[:, :, 2].mean(axis=1)) == pytest.approx(np.full((2, 1), 4.5))
    own = run(robot, standing, experiments_per_block="n_plus_1", experiment_phases="random")
    line = np.fft.rfft(own.reference[0, 0], axis=1)[:, own.line, 0] / 2000
    assert np.abs(line.sum(axis=0)).max() > 0.1 * np.abs(line).max()


def test_experiments_share_their_phases_where_that_is_asked() -> None:
    robot = Robot.load("six_axis")
    standing = Configurations(robot.axis_names, np.full((1, 6), 0.3))
    excitation = run(robot, standing, experiment_phases="common", draws=1, speed_rms_rad_s=0.5)
    spectrum = np.fft.rfft(excitation.reference[0, 0], axis=1)[:, excitation.line]
    turn = spectrum / spectrum[0]  # (n_exp, n_freq, n_axis)
    # (4.3): experiment e has axis c turned by e c / 6 of a turn, at every line alike.
    expected = np.exp(2j * np.pi * np.outer(np.arange(6), np.arange(6)) / 6)
    assert np.abs(turn - expected[:, None, :]).max() < 1e-9


def test_searched_phases_put_more_torque_under_the_same_peaks(robot: Robot, standing: Configurations) -> None:
    settings: dict[str, Any] = {"speed_rms_rad_s": None, "slow_sine_rad_s": 0.0}
    drawn = run(robot, standing, **settings)
    found = run(robot, standing, **settings, crest="minimise")
    response = torque_response(robot, standing.angle, drawn.frequency_hz)
    crests = [torque_crest(one.reference, response, one.line)[0] for one in (drawn, found)]
    assert crests[1] < 1.8 < crests[0]
    # Same spectrum, larger by as much as the crest factor is smaller than the one that draws are taken to have.
    ratio = (amplitude(found) / np.maximum(amplitude(drawn), 1e-9))[drawn.line, 0]
    assert ratio == pytest.approx(np.full(30, CREST / crests[1]), rel=1e-9)
    # And the simulated robot agrees, friction and resonances included: more torque at the lines, peaks within limits.
    assert found.predicted_torque is not None
    assert (found.predicted_torque <= 0.9 * robot.drives.torque_limit).all()
    # Where the speed was asked for, it stays what it was.
    fixed = run(robot, standing, crest="minimise", crest_of="reference", slow_sine_rad_s=0.0)
    assert amplitude(fixed)[fixed.line] == pytest.approx(
        amplitude(run(robot, standing))[fixed.line], rel=1e-9
    )
    reference = fixed.reference[0, 0, 0, :, 0]
    assert np.abs(reference).max() / np.sqrt(np.mean(reference**2)) < 1.8


def test_torque_of_the_nominal_loop_is_that_of_the_simulation(robot: Robot, standing: Configurations) -> None:
    # Without Coulomb friction, which the response leaves out.
    smooth = robot.without_friction()
    excitation = run(smooth, standing, slow_sine_rad_s=0.0, speed_rms_rad_s=0.2)
    reference = np.concatenate([excitation.reference[0, :, 0]] * 3, axis=1)
    torque = smooth.simulate(reference, standing.angle).torque[:, 4000:]
    line = excitation.line
    simulated = np.fft.rfft(torque[0, :, 0])[line] / np.fft.rfft(excitation.reference[0, 0, 0, :, 0])[line]
    expected = torque_response(smooth, standing.angle, excitation.frequency_hz)[0, :, 0, 0]
    # Continuous time against a loop sampled at 1 ms that sees the speed half a sample late, and at 80 Hz (0.08 radian
    # a sample) is another half late by the hold: loop gain times 0.25 radian, above the crossover well below one.
    assert np.abs(simulated / expected - 1).max() < 0.2


def test_speed_of_the_motor_is_that_of_the_reference_below_the_crossover() -> None:
    speed = motor_speed_of(np.ones((3, 1)), np.array([0.01, 5.0, 500.0]), np.array([5.0]))
    assert speed[:, 0] == pytest.approx([1.0, np.sqrt(0.5), 0.01], rel=1e-4)


def with_ripple(robot: Robot) -> Robot:
    data = robot.description.model_dump()
    data["effects"] = {
        "ripple": {"use": "drive.torque_ripple", "on": "axis_1", "with": {"order": 18.0}},
        "resolver": {"use": "sensing.resolver_ripple", "on": "axis_1", "with": {"order": 3.0}},
        "grease": {"use": "friction.stribeck", "on": "axis_1"},
    }
    return Robot(type(robot.description).model_validate(data))


def test_ripple_orders_are_those_of_the_robot_and_the_suspects(robot: Robot) -> None:
    assert ripple_orders(robot, (2.0,)) == [(0, 2.0)]
    assert ripple_orders(with_ripple(robot), (18.0, 2.0)) == [(0, 2.0), (0, 3.0), (0, 18.0)]


def test_the_log_tells_which_lines_a_ripple_reaches(
    robot: Robot, standing: Configurations, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO)
    run(robot, standing, ripple_orders=(0.5, 18.0))
    told = [record.getMessage() for record in caplog.records if "ripple of order" in record.getMessage()]
    assert told[0] == ("axis_1: ripple of order 0.5 fills 0 to 0.716 Hz, no line above 0.01 of its amplitude")
    assert told[1].startswith("axis_1: ripple of order 18 fills 0 to 25.8 Hz; ")
    assert "of the lines from 4.5 to" in told[1]
    assert len(told) == 2


def test_the_reach_of_a_ripple_is_that_of_the_motion(robot: Robot) -> None:
    # Without a multisine, and with lines on odd multiples of an odd sine: J_3 and J_5 of order times swing of 4 rad/s
    # at 1.5 Hz, root mean square over poses.
    line = np.array([9, 11, 15])
    sine_speed, still = np.array([4.0]), np.zeros((3, 1))
    (found,) = reaches(robot, (6.0,), line, still, 3, sine_speed, 2000, 0.01)
    swing = 6.0 * 4.0 / (2 * np.pi * 1.5)
    assert found.band_hz == pytest.approx(6 * 4 / (2 * np.pi))
    assert found.line.tolist() == [9, 15]
    assert found.strongest == pytest.approx(np.sqrt(2) * jv(3, swing))
    small = np.array([[1e-3], [0.0], [2e-3]])
    # Without a sine a small multisine shows each of its lines by the slope: amplitude n a cos, rms over poses.
    (found,) = reaches(robot, (6.0,), line, small, 0, 0 * sine_speed, 2000, 0.005)
    assert (found.band_hz, found.line.tolist()) == (0.0, [15])
    assert found.strongest == pytest.approx(6 * 2e-3 / np.sqrt(2), rel=1e-3)


def test_the_plan_tells_lines_on_harmonics() -> None:
    line = np.array([9, 15, 21, 23])
    assert planned_reach(line, 2.0, 0, 9.0, (1.0,)) == []
    assert planned_reach(line, 2.0, 3, 9.0, ()) == ["harmonics of the slow sine fall on 3 lines from 4.5 Hz"]
