"""A gap that is passed within a step of the integrator: the torque of a motion depends on it smoothly, and is right."""

from __future__ import annotations

import numpy as np
import pytest

from robid_core import ComplexArray, Robot
from robid_core.mechanics import MechanicalModel, periodic_motion, prescribe

T, N, PERIODS, BINS = 1e-3, 1000, 8, 100
LINES = np.arange(3, 60, 4)
FINER = 16  # steps in one, where the gap is passed in many
SHARES = np.linspace(0.92, 1.08, 17)


@pytest.fixture(scope="module")
def angle() -> np.ndarray:
    """Of a motor that goes both ways, (1, N, 1): its gear bends at up to 0.6 rad/s, 1.5e-4 rad in a step."""
    generator, turn = np.random.default_rng(3), 2 * np.pi * np.arange(N) / N
    waves = (3.0 / k**1.5 * np.sin(k * turn + generator.uniform(0, 6)) for k in LINES)
    return (2.0 * np.sin(turn) + sum(waves))[None, :, None]


def spectrum(angle: np.ndarray, gap: float, finer: int = 1) -> ComplexArray:
    """Torque of the last period, N m, (BINS,)."""
    robot = Robot.load("one_axis").with_effect("play", "transmission.backlash", "axis_1", values={"gap": gap})
    step = robot.step_s / finer
    motion = periodic_motion(angle, T, step, 480.0)
    state = robot.standing(robot.joint_angle(motion.angle)).moving(robot.mechanism, motion.speed)
    model = MechanicalModel(robot.mechanism, *robot.spring_arrays(), robot.forces)
    (run,) = prescribe([model], [state], motion, sample_time=T, step=step, periods=PERIODS)
    found: ComplexArray = np.fft.rfft(run.torque[0, -N:, 0])[:BINS] / N
    return found


@pytest.mark.parametrize("gap", [5e-6, 2e-5, 1e-4])
def test_the_torque_of_a_motion_is_smooth_in_a_narrow_gap(angle: np.ndarray, gap: float) -> None:
    """Within 8 % of the gap it is a parabola, to a thousandth of its change; a value at each sample left 2 to 6 %."""
    torque = np.array([spectrum(angle, gap * share) for share in SHARES])
    basis = np.stack([np.ones_like(SHARES), SHARES - 1, (SHARES - 1) ** 2], axis=1)
    fit = np.linalg.lstsq(basis, torque, rcond=None)[0]
    left = np.sqrt((np.abs(torque - basis @ fit) ** 2).sum(axis=1).mean())
    assert left < 1e-3 * np.linalg.norm(fit[1]) * (SHARES[-1] - 1)


@pytest.mark.parametrize("gap", [2e-5, 1e-4])
def test_a_narrow_gap_takes_the_torque_that_it_takes_in_shorter_steps(angle: np.ndarray, gap: float) -> None:
    """What it adds to a robot without one, beside what shorter steps change of that."""
    coarse, fine = (spectrum(angle, gap, finer) - spectrum(angle, 0.0, finer) for finer in (1, FINER))
    assert np.linalg.norm(coarse - fine) < 0.01 * np.linalg.norm(fine)
