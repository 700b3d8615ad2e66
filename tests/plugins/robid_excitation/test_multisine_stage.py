"""excitation.multisine: what it asks of the motors, and what it refuses before anything moves."""

from __future__ import annotations

import logging
import re
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from robid_core import (
    MILESTONE,
    ConfigurationError,
    Configurations,
    Context,
    MotionRefused,
    Robot,
    clear_motion,
)
from robid_core.stage import map_in_process
from robid_core.testing import check_stage
from robid_excitation.multisine import Multisine, missed_resonances
from robid_excitation.prediction import motor_speed, slow_part

SETTINGS: dict[str, Any] = {
    "band_hz": (4.0, 80.0),
    "lines": 30,
    "period_s": 2.0,
    "blocks": 2,
    "slow_sine_rad_s": 9.0,
}


@pytest.fixture(scope="module")
def robot() -> Robot:
    return Robot.load("one_axis")


@pytest.fixture(scope="module")
def standing(robot: Robot) -> Configurations:
    return Configurations(robot.axis_names, np.array([[0.3], [-0.8]]))


def context(seed: int = 1) -> Context:
    log = logging.getLogger("test.excitation")
    return Context(np.random.default_rng(seed), map_in_process, lambda done, total, note="": None, log)


def run(stage: Multisine, standing: Configurations, robot: Robot, seed: int = 1) -> Any:
    """Run the stage; the predictions are there."""
    return stage.run(standing, robot, context(seed))


def test_references_have_the_lines_and_the_sine_that_were_asked_for(
    robot: Robot, standing: Configurations
) -> None:
    excitation = run(Multisine(**SETTINGS), standing, robot)
    assert excitation.reference.shape == (2, 2, 1, 2000, 1)
    assert excitation.slow_sine_bin == 2
    assert excitation.slow_sine_speed.tolist() == [9.0]
    spectrum = np.abs(np.fft.rfft(excitation.reference, axis=3)) * 2 / 2000
    assert spectrum[..., 2, 0] == pytest.approx(9.0)
    assert (spectrum[..., excitation.line, 0] > 0.01).all()
    others = np.delete(spectrum, [2, *excitation.line], axis=3)
    assert others.max() < 1e-12
    # Phases of the multisine and of the sine are new for each configuration and block.
    phases = np.angle(np.fft.rfft(excitation.reference, axis=3)[..., [2, *excitation.line], 0]).reshape(4, -1)
    assert all(np.abs(phases[i] - phases[j]).min() > 1e-9 for i in range(4) for j in range(i))
    # A reference that closes: nothing walks away from period to period.
    assert np.abs(excitation.reference.sum(axis=3)).max() < 1e-9


def test_same_seed_gives_the_same_bytes(robot: Robot, standing: Configurations) -> None:
    first, again, other = (run(Multisine(**SETTINGS), standing, robot, seed) for seed in (1, 1, 2))
    assert first.reference.tobytes() == again.reference.tobytes()
    assert first.predicted_torque.tobytes() == again.predicted_torque.tobytes()
    assert first.reference.tobytes() != other.reference.tobytes()


def test_predicted_motion_is_within_the_limits_and_passes_the_gate(
    robot: Robot, standing: Configurations
) -> None:
    excitation = run(Multisine(**SETTINGS), standing, robot)
    assert (excitation.predicted_torque <= 0.9 * robot.drives.torque_limit).all()
    assert (excitation.predicted_torque > np.abs(robot.gravity_torque(standing.angle))).all()
    assert (excitation.predicted_speed > 9.0).all()
    for configuration in range(2):
        start = robot.motor_angle(standing.angle[configuration]) - excitation.start_offset(configuration)
        for block in range(2):
            reference = excitation.realization(configuration)[block, 0]
            clear_motion(start[block, 0], reference, robot.sample_time_s, 3, robot.limits)


def test_torque_of_the_simulated_robot_is_flat_and_as_large_as_asked(
    robot: Robot, standing: Configurations
) -> None:
    # Rigid below the first resonance at 18 Hz, the rotor alone far above: flat within the ratio of both
    # inertias (2.4) is what a formula without resonances can give.
    excitation = Multisine(**{**SETTINGS, "slow_sine_rad_s": 0.0}, torque_share=0.5).run(
        standing, robot, context()
    )
    reference = np.concatenate([excitation.reference[0, :, 0]] * 2, axis=1)
    torque = robot.simulate(reference, np.repeat(standing.angle[:1], 2, axis=0)).torque[:, 2000:]
    amplitude = np.abs(np.fft.rfft(torque, axis=1)[:, excitation.line, 0]).mean(axis=0)
    assert amplitude.max() / amplitude.min() < 4
    dynamic = np.abs(torque - torque.mean(axis=1, keepdims=True)).max()
    assert 0.3 * 20 < dynamic < 0.7 * 20


def test_motion_has_the_configuration_in_its_middle(robot: Robot, standing: Configurations) -> None:
    excitation = run(Multisine(**SETTINGS), standing, robot)
    start = robot.motor_angle(standing.angle[0]) - excitation.start_offset(0)[:, 0]
    reference = np.concatenate([excitation.realization(0)[:, 0]] * 2, axis=1)
    position = robot.simulate(reference, robot.joint_angle(start)).position[:, 2000:]
    # Travel is 2 x 9 / (2 pi) = 2.9 rad; friction in the first instants leaves a few percent of it.
    assert position.mean(axis=1) == pytest.approx(
        robot.motor_angle(standing.angle[:1]).repeat(2, axis=0), abs=0.15
    )
    assert np.ptp(position) > 2.5


@pytest.mark.parametrize(
    ("changes", "limit"),
    [
        ({"speed_rms_rad_s": 60.0}, "motor torque of 20 N m, 18 N m are allowed"),
        (
            {"speed_rms_rad_s": 2.0, "slow_sine_rad_s": 380.0},
            "motor speed of [0-9.]+ rad/s, 360 rad/s are allowed",
        ),
    ],
)
def test_what_breaks_a_limit_is_refused_with_an_amplitude_that_does_not(
    robot: Robot, changes: dict[str, Any], limit: str
) -> None:
    standing = Configurations(robot.axis_names, np.array([[0.0]]))
    settings = {**SETTINGS, **changes}
    with pytest.raises(MotionRefused, match=limit) as refusal:
        run(Multisine(**settings), standing, robot)
    message = str(refusal.value)
    assert "axis_1 would reach" in message
    assert "nothing has moved" in message
    advice = {
        name: float(value) for name, value in re.findall(r"(\w+): ([0-9.e-]+)", message.split("moved; ")[1])
    }
    assert "speed_rms_rad_s" in advice
    cleared = run(Multisine(**{**settings, **advice}), standing, robot)
    assert (cleared.predicted_torque <= 18).all()
    assert (cleared.predicted_speed <= 360).all()


@pytest.mark.parametrize(
    "changes", [{"speed_rms_rad_s": 60.0}, {"speed_rms_rad_s": 2.0, "slow_sine_rad_s": 380.0}]
)
def test_what_breaks_a_limit_is_made_as_small_as_it_needs_where_that_is_asked(
    robot: Robot, changes: dict[str, Any], caplog: pytest.LogCaptureFixture
) -> None:
    standing = Configurations(robot.axis_names, np.array([[0.0]]))
    with caplog.at_level(MILESTONE):
        made = run(Multisine(**{**SETTINGS, **changes}, beyond_limits="scale"), standing, robot)
    assert (made.predicted_torque <= 18).all()
    assert (made.predicted_speed <= 360).all()
    assert "times as large as asked for: in configuration 1 axis_1 would reach a motor" in caplog.text
    # No smaller than it needs: one of the limits is nearly reached.
    assert max(made.predicted_torque.max() / 18, made.predicted_speed.max() / 360) > 0.7


def test_what_breaks_no_limit_is_the_same_whether_it_may_be_scaled(robot: Robot) -> None:
    standing = Configurations(robot.axis_names, np.array([[0.0]]))
    made = [run(Multisine(**SETTINGS, beyond_limits=what), standing, robot) for what in ("refuse", "scale")]
    assert np.array_equal(made[0].reference, made[1].reference)


def test_advice_holds_for_the_default_amplitude_too(robot: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    standing = Configurations(robot.axis_names, np.array([[0.0]]))
    monkeypatch.setattr("robid_excitation.amplitudes.CREST", 1.0)  # as if peaks came out three times as high
    with pytest.raises(
        MotionRefused, match="motor torque of .* allowed.*torque_share: [0-9.]+ would fit"
    ) as refusal:
        run(Multisine(**SETTINGS), standing, robot)
    share = float(str(refusal.value).split("torque_share: ")[1].split()[0])
    assert share < 0.5
    assert (run(Multisine(**SETTINGS, torque_share=share), standing, robot).predicted_torque <= 18).all()


def test_a_pose_at_its_limit_is_refused_by_name(robot: Robot) -> None:
    edge = Configurations(robot.axis_names, np.array([[1.999]]))
    with pytest.raises(
        MotionRefused, match="axis_1 would reach a motor angle of .* beyond its upper limit of 200 rad"
    ):
        run(Multisine(**SETTINGS), edge, robot)


def test_torque_that_gravity_needs_is_left_free(robot: Robot) -> None:
    # The arm held level needs 1.97 N m of 20; with a tenth of the limit as margin nothing may move.
    level = Configurations(robot.axis_names, np.array([[np.pi / 2]]))
    with pytest.raises(MotionRefused, match="no amplitude fits: move the configuration"):
        run(Multisine(**SETTINGS, margin=0.09), level, robot)
    # The default amplitude yields to it instead of being refused.
    assert (
        run(Multisine(**SETTINGS, margin=0.35, torque_share=0.9), level, robot).predicted_torque <= 7
    ).all()


def test_resonances_between_the_lines_are_told(
    robot: Robot, standing: Configurations, caplog: pytest.LogCaptureFixture
) -> None:
    few = {**SETTINGS, "lines": 12}
    line = Multisine(**few).line()
    (missed, *_) = missed_resonances(robot, standing.angle, line, 2.0)
    # The pole from the second-order model by hand: motor and arm on one spring.
    model = robot.second_order(standing.angle[:1])
    mass, stiffness = model.mass[0], model.stiffness[0]
    omega = np.sqrt(np.linalg.eigvals(np.linalg.solve(mass, stiffness)).real.max())
    assert missed[0] == pytest.approx(omega / (2 * np.pi), rel=0.01)
    assert missed[1] < 0.5 * missed[2]
    run(Multisine(**few), standing, robot)
    assert "may fall between the lines" in caplog.text
    caplog.clear()
    run(Multisine(**{**SETTINGS, "period_s": 8.0, "lines": 100}), standing, robot)
    assert "between the lines" not in caplog.text


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"band_hz": (80.0, 4.0)}, "80 Hz is not below 4 Hz"),
        ({"lines": 300}, "at most 76 lines"),
        ({"slow_sine_hz": 1.5}, "1.5 Hz is not an even bin of 2 s.* 2 Hz is"),
        ({"slow_sine_hz": 5.0}, "slow sine at 5 Hz is not below the lowest line"),
        ({"slow_sine_hz": 0.2}, "0.2 Hz is not an even bin of 2 s.* 1 Hz is"),
        ({"lines": 0}, "greater than 0"),
        ({"lines": None}, "grid: logarithmic needs lines: how many"),
        ({"grid": "full"}, "grid: full is every odd bin: leave lines out"),
        ({"detection_group": 3, "lines": 52}, "at most 51 lines"),
        ({"detection_group": 1}, "greater than or equal to 2"),
        (
            {"slow_sine_parity": "odd", "slow_sine_hz": 1.0},
            "1 Hz is not an odd bin of 2 s from 3 on.* 1.5 Hz is",
        ),
        (
            {"slow_sine_parity": "odd", "slow_sine_hz": 0.5},
            "0.5 Hz is not an odd bin of 2 s from 3 on.* 1.5 Hz is",
        ),
        ({"slow_sine_parity": "odd", "lines": 52}, "leaves 50 odd bins .* at most 50 lines"),
        ({"weights": {"axis_1": ()}}, r"weights.axis_1: a table of \(Hz, factor\)"),
        ({"weights": {"axis_1": ((4.0, 1.0), (4.0, 2.0))}}, "every frequency once"),
        ({"axis_scales": (1.0,)}, "Extra inputs"),
    ],
)
def test_settings_that_cannot_be_are_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        Multisine(**{**SETTINGS, **changes})


def test_settings_that_do_not_suit_the_robot_are_refused(robot: Robot, standing: Configurations) -> None:
    cases: list[tuple[dict[str, Any], str]] = [
        ({"period_s": 2.0003}, "period_s: 2.0003 s is not an even number .* 2 s is"),
        ({"band_hz": (4.0, 600.0)}, "600 Hz is not below half the sampling rate of one_axis, 500 Hz"),
        ({"axis_scale": (1.0, 2.0)}, "axis_scale: 2 factors for the 1 axes of one_axis"),
        ({"exponents": (1.0, 2.0)}, "exponents: 2 factors for the 1 axes of one_axis"),
        ({"weights": {"axis_9": ((4.0, 1.0),)}}, "one_axis has no axis 'axis_9'; it has axis_1"),
    ]
    for changes, message in cases:
        with pytest.raises(ConfigurationError, match=message):
            run(Multisine(**{**SETTINGS, **changes}), standing, robot)
    loose = robot.description.model_copy(deep=True)
    axis = loose.axes["axis_1"].model_copy(
        update={"controller": loose.axes["axis_1"].controller.model_copy(update={"speed_gain": 0.0})}
    )
    with pytest.raises(ConfigurationError, match="axis_1 of one_axis has speed_gain 0"):
        Multisine(**SETTINGS).run(
            standing, Robot(loose.model_copy(update={"axes": {"axis_1": axis}})), context()
        )


def test_settings_come_from_json_as_strictly_as_from_yaml() -> None:
    text = '{"band_hz": [4, 80], "lines": 100, "period_s": 8, "blocks": 2, "slow_sine_rad_s": 9}'
    stage = Multisine.model_validate_json(text)
    assert stage.band_hz == (4.0, 80.0)
    assert stage.sine_bin == 2
    assert Multisine.model_validate_json(stage.model_dump_json()) == stage


def test_plan_tells_lines_experiments_and_level() -> None:
    class Where:
        count = 4

    lines = Multisine(**SETTINGS).plan_lines({"where": Where()})
    assert lines == [
        "30 odd lines from 4.5 to 79.5 Hz, 1 to 7 Hz apart",
        "4 configurations x 2 blocks x one experiment per axis, period 2 s",
        "multisine at 50% of the torque limits, slow sine 9 rad/s at 1 Hz",
        "harmonics of the slow sine fall on even bins, where no line stands",
        "ripple spread by the multisine can reach: order 1 to 1.43 Hz (no lines), order 2 to 2.86 Hz (no lines), "
        "order 6 to 8.59 Hz (5 lines), order 12 to 17.2 Hz (12 lines)",
    ]
    special = {
        "detection_group": 4,
        "experiments_per_block": "n_plus_1",
        "slow_sine_parity": "odd",
        "ripple_orders": (),
        "speed_rms_rad_s": 2.0,
    }
    lines = Multisine(**{**SETTINGS, **special, "period_s": 4.0}).plan_lines({})
    # Thirty lines and ten to be left out of them; odd multiples of bin 3 are no lines.
    assert lines[0].startswith("40 odd lines from 4.25 to 79.75 Hz")
    assert lines[0].endswith("apart, one of every 4 left out at random")
    assert lines[1:] == [
        "2 blocks x one experiment per axis and one more, period 4 s",
        "multisine at 2 rad/s rms of motor speed, slow sine 9 rad/s at 0.75 Hz",
        "harmonics of the slow sine fall on even bins and on odd ones that are left out of the lines",
    ]
    assert len(Multisine(**{**SETTINGS, "slow_sine_rad_s": 0.0}).plan_lines({})) == 3


def test_slow_and_fast_parts_are_told_apart() -> None:
    time = np.arange(200) / 200
    slow, fast = 3 + 2 * np.cos(2 * np.pi * 2 * time), np.sin(2 * np.pi * 9 * time)
    assert slow_part((slow + fast)[:, None], np.array([9, 15]))[:, 0] == pytest.approx(slow)
    speed = motor_speed((slow + fast)[:, None], np.array([9, 15]), 0.01)  # period 2 s
    expected = -np.pi * 2 * 2 * np.sin(2 * np.pi * 2 * time) + np.pi * 9 * np.cos(2 * np.pi * 9 * time)
    assert speed[:, 0] == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(
    ("axes", "changes"),
    [
        ((1, 2, 6), {}),
        (
            (1, 2),
            {
                "grid": "linear",
                "detection_group": 3,
                "experiments_per_block": "n_plus_1",
                "crest": "minimise",
                "spectrum": "flat_speed",
                "slow_sine_parity": "odd",
            },
        ),
    ],
)
def test_the_contract_of_stages_is_kept(axes: tuple[int, ...], changes: dict[str, Any]) -> None:
    settings = {"band_hz": (4.0, 40.0), "lines": 12, "period_s": 2.0, "blocks": 2, "slow_sine_rad_s": 9.0}
    check_stage(Multisine, for_axes=axes, **{**settings, **changes})


def test_six_axes_are_asked_for_orthogonal_torques_within_their_limits() -> None:
    robot = Robot.load("six_axis")
    standing = Configurations(robot.axis_names, np.array([[0.3, 0.2, -0.4, 0.5, 0.7, 0.1]]))
    excitation = run(Multisine(**SETTINGS), standing, robot)
    assert excitation.reference.shape == (1, 2, 6, 2000, 6)
    u = np.moveaxis(np.fft.rfft(excitation.reference[0], axis=2)[:, :, excitation.line], 1, -1)
    gram = u @ u.conj().swapaxes(-1, -2)
    size = np.sqrt(np.einsum("mkii->mki", gram).real)
    assert np.abs(gram / (size[..., :, None] * size[..., None, :]) - np.eye(6)).max() < 1e-9
    # Half of the limit for the multisine, gravity and friction beside it.
    share = excitation.predicted_torque[0] / robot.drives.torque_limit
    assert (share > 0.35).all()
    assert (share <= 0.9).all()
    # The slow sine's phases differ between blocks and axes, not between the experiments of a block.
    slow = np.angle(np.fft.rfft(excitation.reference[0], axis=2)[:, :, 2])
    assert np.abs(slow - slow[:, :1]).max() < 1e-9
    assert np.diff(np.sort(slow[:, 0].ravel())).min() > 1e-6
