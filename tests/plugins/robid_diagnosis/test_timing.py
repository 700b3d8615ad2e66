"""Delays are told where the data carry them: one axis whose torque is known in closed form, with something missing.

The motor's angle is a sum of sines, the torque what rotor, friction and a force that nobody told take of it, moved by a
delay and with white noise. The formal error knows only the noise.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from robid_core import Channel, DenseRun, Record, Robot, Timing
from robid_diagnosis.hypothesis import Case, Hypothesis
from robid_diagnosis.parts import cut_into_parts
from robid_diagnosis.timing import timing_lines, timing_of

STEP, SECONDS, BLOCKS = 0.002, 24.0, 8
INERTIA, VISCOUS, COULOMB, NOISE = 1.0, 2.0, 1.0, 0.01
FILE = f"""
robid_robot: 1
name: joint
gravity: [0, 0, 0]
sample_time_s: {STEP}
bodies:
  - {{joint: axis_1, axis: [0, 0, 1], mass: 1.0, inertia: [[0.001, 0, 0], [0, 0.001, 0], [0, 0, 0.001]]}}
axes:
  axis_1:
    rotor_inertia: {INERTIA}
    sensors: {{torque_noise: {NOISE}}}
    friction: {{coulomb: {COULOMB}, viscous: {VISCOUS}, speed: 0.05}}
"""

Missing = Callable[[np.ndarray, np.ndarray], np.ndarray]


def told(tmp_path: Path, late: float, missing: Missing, highest: float) -> tuple[Timing, str]:
    """Of such a plant, and in words; `late` in samples, `highest` the highest frequency of its motion, Hz."""
    path = tmp_path / "robot.yaml"
    path.write_text(FILE)
    robot = Robot.load(str(path))
    generator = np.random.default_rng(1)
    omega = 2 * np.pi * generator.uniform(0.1, highest, (20, 1))
    phase, size = generator.uniform(0, 2 * np.pi, omega.shape), 0.6 / omega

    def torque(time: np.ndarray) -> np.ndarray:
        angle, speed, acceleration = motion(time)
        own = INERTIA * acceleration + VISCOUS * speed + COULOMB * np.tanh(speed / 0.05)
        total: np.ndarray = own + missing(angle, speed)
        return total

    def motion(time: np.ndarray) -> tuple[np.ndarray, ...]:
        return tuple(
            (size * omega**k * np.sin(omega * time + phase + k * np.pi / 2)).sum(axis=0) for k in range(3)
        )

    time = STEP * np.arange(round(SECONDS / STEP), dtype=np.float64)
    held = torque(time + STEP / 2 - late * STEP)  # the mean over the time for which it is held
    shape = (1, 1, 1, 1, len(time), 1)
    channels = {
        "motor_position": Channel("motor", "rad", motion(time)[0].reshape(shape)),
        "motor_torque": Channel(
            "motor", "N m", (held + NOISE * generator.standard_normal(len(time))).reshape(shape)
        ),
    }
    run = DenseRun(STEP, channels, time, np.ones(shape[:5], dtype=bool))
    record = Record(("axis_1",), "test", "zero_order_hold", (run,), np.zeros((1, 1)))
    case = Case((cut_into_parts(record, BLOCKS, 0.0),), robot, {}, 20.0, 0, 5, 5e-4)
    fitted = case.fit(Hypothesis(), lambda *_: None, as_told=True)
    timing = timing_of(fitted)
    return timing, " ".join(timing_lines(timing, fitted.misfit))


def nothing(angle: np.ndarray, speed: np.ndarray) -> np.ndarray:
    """All is told."""
    return np.zeros_like(angle + speed)


def wave(angle: np.ndarray, speed: np.ndarray) -> np.ndarray:
    """Eleven periods a turn."""
    return np.asarray(0.3 * np.sin(11 * angle) + 0 * speed)


def curved(angle: np.ndarray, speed: np.ndarray) -> np.ndarray:
    """Friction that thins."""
    return np.asarray(-0.5 * speed * np.abs(speed) + 0 * angle)


def hardening(angle: np.ndarray, speed: np.ndarray) -> np.ndarray:
    """A spring."""
    return np.asarray(0.8 * angle**3 + 0 * speed)


def off(timing: Timing, late: float) -> float:
    """By how many standard errors the lag misses the truth."""
    return float(abs(timing.lag[0] - late) / timing.standard_error[0])


def test_a_delay_beside_noise_is_told(tmp_path: Path) -> None:
    timing, words = told(tmp_path, 0.4, nothing, 5.0)
    assert off(timing, 0.4) < 4
    assert abs(timing.lag[0] - 0.4) < 0.01
    assert "lags its angle by" in words
    assert f"takes it off: motor_torque: {{delay_s: [{timing.lag[0] * STEP:.4g}]}}." in words


@pytest.mark.parametrize("missing", [wave, curved, hardening])
def test_what_the_model_lacks_is_no_delay(tmp_path: Path, missing: Missing) -> None:
    """There is none; each moves the estimate by a tenth of a sample to a third, many times the error by noise."""
    timing, words = told(tmp_path, 0.0, missing, 1.0)
    by_noise, _ = told(tmp_path, 0.0, nothing, 1.0)
    assert abs(timing.lag[0]) > max(0.1, 10 * by_noise.standard_error[0])
    assert off(timing, 0.0) < 3
    assert "cannot be distinguished from what the model lacks: axis_1" in words
    assert "its angle by" not in words


@pytest.mark.parametrize("missing", [wave, hardening])
def test_a_delay_that_all_parts_agree_about_is_told_though_much_is_missing(
    tmp_path: Path, missing: Missing
) -> None:
    """Fast motions turn the phase by far more than what is missing does."""
    timing, words = told(tmp_path, 0.4, missing, 5.0)
    assert off(timing, 0.4) < 3
    assert abs(timing.lag[0] - 0.4) < 0.05
    assert "lags its angle by" in words
    assert "cannot be distinguished from" not in words


def test_lags_of_several_axes_are_one_line_and_a_hold_is_none() -> None:
    timing = Timing(("a", "b", "c"), 1e-3, np.array([-0.25, -0.26, 0.02]), np.full(3, 1e-3))
    line, advice = timing_lines(timing, 1.0)
    assert line == (
        "Timing: the torque of a leads its angle by 0.250 ± 0.001 samples, b leads its angle by 0.260 ± 0.001 samples."
    )
    assert "delay_s: [-0.00025, -0.00026, 0]" in advice
    assert timing_lines(timing.replace(lag=np.array([-0.25, -0.26, -0.25])), 1.0, 5e-4) == []
