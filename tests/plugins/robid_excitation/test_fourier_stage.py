"""excitation.fourier: rest at both ends, limits that the simulated robot keeps, and what it refuses."""

from __future__ import annotations

import logging

import numpy as np
import pytest
from pydantic import ValidationError

from robid_core import (
    ConfigurationError,
    Configurations,
    Context,
    Excitation,
    MotionRefused,
    Robot,
    clear_motion,
)
from robid_core.stage import map_in_process
from robid_core.testing import check_stage
from robid_core.testing.robots import example_robot
from robid_excitation.fourier import Fourier

QUICK = {"period_s": 4.0, "harmonics": 4, "draws": 5, "starts": 1, "evaluations": 60}


@pytest.fixture(scope="module")
def robot() -> Robot:
    return example_robot(2)


@pytest.fixture(scope="module")
def standing(robot: Robot) -> Configurations:
    return Configurations(robot.axis_names, np.array([[0.4, -0.9], [-0.3, 0.5]]))


@pytest.fixture(scope="module")
def excitation(robot: Robot, standing: Configurations) -> Excitation:
    return Fourier(**QUICK).run(standing, robot, context())


def context(steps: list[tuple[float, float, str]] | None = None, seed: int = 1) -> Context:
    def progress(done: float, total: float, note: str = "") -> None:
        if steps is not None:
            steps.append((done, total, note))

    return Context(np.random.default_rng(seed), map_in_process, progress, logging.getLogger("test.fourier"))


def test_speed_is_zero_at_both_ends_and_the_motion_comes_back(excitation: Excitation) -> None:
    reference = excitation.reference
    assert reference.shape == (2, 1, 1, 4000, 2)
    assert (reference[:, 0, 0, 0] == 0).all()  # the first sample of the next period is the end of this one
    # No acceleration there: the speed grows as t^2, at most by half the largest jerk w^2 v of the harmonics.
    jerk = sum((k * 2 * np.pi / 4) ** 2 for k in range(1, 5)) * np.abs(reference).max()
    assert np.abs(reference[:, 0, 0, [1, -1]]).max() < 0.5 * jerk * 1e-6
    assert np.abs(reference.mean(axis=3)).max() < 1e-12 * np.abs(reference).max()


def test_the_spectrum_ends_at_the_highest_harmonic_and_there_are_no_lines(excitation: Excitation) -> None:
    spectrum = np.abs(np.fft.rfft(excitation.reference, axis=3))
    assert spectrum[:, :, :, 5:].max() < 1e-9 * spectrum.max()
    assert spectrum[:, :, :, 1:5].max(axis=(0, 1, 2)).min() > 0.1
    assert excitation.line.shape == excitation.frequency_hz.shape == (0,)
    assert excitation.slow_sine_bin == 0


def test_the_simulated_robot_keeps_all_limits_where_acquisition_starts_it(
    excitation: Excitation, robot: Robot, standing: Configurations
) -> None:
    limits, d, step = robot.limits, robot.drives, robot.sample_time_s
    for number, middle in enumerate(robot.motor_angle(standing.angle)):
        reference = excitation.realization(number)[0, 0]
        start = middle - excitation.start_offset(number)[0, 0]
        assert clear_motion(start, reference, step, 3, limits).covers(start, reference, step, 3)
        repeated = np.tile(reference, (3, 1))[None]
        simulated = robot.simulate(repeated, robot.joint_angle(start)[None])
        assert (simulated.position[0].max(axis=0) <= limits.upper).all()
        assert (simulated.position[0].min(axis=0) >= limits.lower).all()
        assert (np.abs(simulated.torque[0]).max(axis=0) <= 0.9 * d.torque_limit).all()
        speed = np.gradient(simulated.position[0], step, axis=0)
        assert (np.abs(speed).max(axis=0) <= limits.speed).all()
        # The motion goes about its configuration but for what the integrating loop yields to the mean torque: the mean
        # of its law u = u0 + K (r - v) + Ki (q_r - q) over a period; 1 % and a hundredth rad for settling.
        yielded = (simulated.torque[0, 8000:].mean(axis=0) - simulated.torque[0, 0]) / d.integral_gain
        np.testing.assert_allclose(
            middle - simulated.position[0, 8000:].mean(axis=0), yielded, rtol=0.01, atol=0.01
        )
        # And it uses what there is: some limit to nine tenths at least.
        share = np.abs(speed).max() / (0.9 * limits.speed[0])
        reached = np.abs(robot.joint_angle(simulated.position[0])).max() / 2.0
        torque = (np.abs(simulated.torque[0]).max(axis=0) / (0.9 * d.torque_limit)).max()
        assert max(share, reached, torque) > 0.9


def test_a_reach_is_kept_by_every_joint(robot: Robot, standing: Configurations) -> None:
    excitation = Fourier(**QUICK, reach_rad=0.3).run(standing, robot, context())
    travel = np.cumsum(excitation.reference, axis=3) * robot.sample_time_s
    travel = travel - travel.mean(axis=3, keepdims=True)
    # From the configuration, on the samples; 0.2 % for what a wave does between the instants of the search.
    reached = np.abs(robot.joint_angle(travel)).max(axis=(0, 1, 2, 3))
    assert (reached <= 0.3 * 1.002).all()
    assert reached.max() > 0.25


def test_progress_is_shown_and_grows(robot: Robot, standing: Configurations) -> None:
    steps: list[tuple[float, float, str]] = []
    Fourier(**QUICK).run(standing, robot, context(steps))
    done = [step[0] for step in steps]
    assert done[-1] == steps[-1][1] == 120
    assert len(steps) > 10
    assert done[5] < done[len(done) // 2] < done[-1]
    assert {step[2] for step in steps} >= {"trajectory 1 of 2", "trajectory 2 of 2"}


def test_other_chance_gives_another_trajectory(
    excitation: Excitation, robot: Robot, standing: Configurations
) -> None:
    other = Fourier(**QUICK).run(standing, robot, context(seed=2))
    assert not np.array_equal(other.reference, excitation.reference)


def test_configurations_without_room_or_torque_are_refused(robot: Robot) -> None:
    at_limit = Configurations(robot.axis_names, np.array([[0.0, 2.0]]))
    with pytest.raises(
        MotionRefused, match=r"configuration 1: axis_2 stands at 2 rad and may go from -2 to 2 rad"
    ):
        Fourier(**QUICK).run(at_limit, robot, context())
    axes = {
        name: axis.model_copy(update={"torque_limit": 0.3}) for name, axis in robot.description.axes.items()
    }
    weak = Robot(robot.description.model_copy(update={"axes": axes}))
    leaning = Configurations(robot.axis_names, np.array([[1.5, 0.0]]))
    with pytest.raises(MotionRefused, match=r"axis_1 needs 0\.\d+ N m at its motor to stand still"):
        Fourier(**QUICK).run(leaning, weak, context())


def test_periods_and_harmonics_that_the_samples_do_not_carry_are_refused(
    robot: Robot, standing: Configurations
) -> None:
    with pytest.raises(ConfigurationError, match="period_s: 4.0005 s is not a whole number"):
        Fourier(**{**QUICK, "period_s": 4.0005}).run(standing, robot, context())
    with pytest.raises(ConfigurationError, match="harmonics: 66.6667 Hz is not below a tenth"):
        Fourier(**{**QUICK, "period_s": 0.3, "harmonics": 20}).run(standing, robot, context())
    with pytest.raises(ValidationError, match="5 are fewer than the 30 draws"):
        Fourier(evaluations=5)


def test_the_plan_tells_what_is_coming() -> None:
    first, second = Fourier(reach_rad=0.5).plan_lines({})
    assert (
        first
        == "one trajectory for each configuration of 10 s, from rest to rest, 5 harmonics up to 0.5 Hz, "
        "up to 0.5 rad away"
    )
    assert "criterion log_det, 400 evaluations each" in second


def test_the_stage_keeps_the_contract() -> None:
    check_stage(Fourier, period_s=4.0, harmonics=3, draws=2, starts=1, evaluations=12)
