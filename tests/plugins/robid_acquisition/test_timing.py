"""Torques recorded late, holds and scales told wrong, of a six-axis arm that is not quite what its file says."""

from __future__ import annotations

import json
import logging
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from robid_acquisition.lags import _doubts, doubts_of_timing
from robid_acquisition.plausible import doubts_of_scale
from robid_acquisition.recorded import RecordedAcquisition
from robid_core import Channel, Context, DenseRun, FloatArray, Record, Robot
from robid_core.estimation.response.torque_lag import lag_beside_friction
from robid_core.stage import map_in_process

ROBOT = Robot.load("six_axis")
STEP = ROBOT.sample_time_s


def measured(
    masses: float = 0.01, payload: float = 0.0, ripple: float = 0.0
) -> tuple[FloatArray, FloatArray]:
    """Angles and torques of four experiments of a plant: springs a third off, masses by `masses`, ripple in N m."""
    draw = np.random.default_rng(11)
    values = {}
    for name in ROBOT.layout:
        if ROBOT.parameter_kind(name) in ("stiffness", "damping"):
            values[name] = ROBOT.parameter(name) * np.exp(0.3 * draw.standard_normal())
        elif name.startswith(("mass.", "rotor_inertia.")):
            values[name] = ROBOT.parameter(name) * np.exp(masses * draw.standard_normal())
    values["mass.axis_6"] += payload
    plant = ROBOT.with_parameters(values)
    if ripple:
        for axis in ROBOT.axis_names:
            plant = plant.with_effect(
                f"ripple_{axis}", "drive.torque_ripple", axis, values={"amplitude": ripple}
            )
    time = STEP * np.arange(2000)
    lines = np.arange(3.0, 60.0, 1.5)[:, None]
    waves = np.cos(2 * np.pi * lines * time + draw.uniform(0, 2 * np.pi, (4, 6, len(lines), 1))).sum(axis=2)
    slow = np.sin(2 * np.pi * time + draw.uniform(0, 2 * np.pi, (4, 6, 1)))
    reference = np.swapaxes(4 * waves / waves.std() + 10 * slow, 1, 2)
    done = plant.simulate(reference, draw.uniform(-0.6, 0.6, (4, 6)), seed=3)
    return done.position, done.torque


@pytest.fixture(scope="module")
def sound() -> tuple[FloatArray, FloatArray]:
    return measured()


def late(torque: FloatArray, samples: FloatArray | float) -> FloatArray:
    """Torques `samples` later, by their Fourier series about the line from their first to their last value."""
    n = torque.shape[1]
    line = torque[:, :1] + np.linspace(0, 1, n)[:, None] * (torque[:, -1:] - torque[:, :1])
    turn = np.exp(-2j * np.pi * np.fft.rfftfreq(n)[:, None] * samples)
    return np.fft.irfft(np.fft.rfft(torque - line, axis=1) * turn, n, axis=1) + line


def record(
    position: FloatArray, torque: FloatArray, hold: str = "zero_order_hold", robot: Robot = ROBOT
) -> Record:
    def channel(unit: str, values: FloatArray) -> Channel:
        return Channel("motor", unit, values[:, None, None, None])

    run = DenseRun(
        STEP,
        {"motor_position": channel("rad", position), "motor_torque": channel("N m", torque)},
        np.arange(position.shape[1]) * STEP,
        np.ones((len(position), 1, 1, 1, position.shape[1]), dtype=bool),
    )
    return Record(robot.axis_names, "", hold, (run,), robot.joint_angle(position.mean(axis=1)))


def told(words: str) -> float:
    """Number of samples in a sentence."""
    return float(words.split(" samples")[0].rsplit(" ", 1)[1])


@pytest.mark.parametrize("samples", [-0.9, 0.9, 4.6])
def test_torques_that_lag_or_lead_are_told_to_a_fifth_of_a_sample(
    sound: tuple[FloatArray, FloatArray], samples: float
) -> None:
    """A fifth: twice the 0.1 samples by which springs, bodies and friction of the plant turn the phase at an axis."""
    position, torque = sound
    (words,) = doubts_of_timing(record(position, late(torque, samples)), ROBOT)
    assert words.startswith(
        f"all torques from which it can be estimated {'lag' if samples > 0 else 'lead'} the angles"
    )
    assert told(words) == pytest.approx(abs(samples), abs=0.2)
    advice = float(words.split("motor_torque: delay_s: ")[1].split(",")[0])
    assert advice == pytest.approx(samples * STEP, abs=0.2 * STEP)  # a lead is a negative delay of the torque


def test_one_torque_that_lags_is_told_by_its_axis(sound: tuple[FloatArray, FloatArray]) -> None:
    position, torque = sound
    (words,) = doubts_of_timing(record(position, late(torque, np.array([0, 1.6, 0, 0, 0, 0]))), ROBOT)
    assert words.startswith("the torque of axis_2 lags the angles")
    assert told(words) == pytest.approx(1.6, abs=0.3)


def test_a_hold_that_is_told_wrong_looks_like_half_a_sample(sound: tuple[FloatArray, FloatArray]) -> None:
    """The simulated drives hold the torque; half a sample later it looks as a continuous one does."""
    position, torque = sound
    (words,) = doubts_of_timing(record(position, torque, "continuous"), ROBOT)
    assert "torque_hold: continuous is stated" in words
    assert "as with zero_order_hold" in words
    (words,) = doubts_of_timing(record(position, late(torque, 0.5)), ROBOT)
    assert "torque_hold: zero_order_hold is stated" in words
    assert "as with continuous" in words


def of_one_axis(seed: int, highest_hz: float, hold: str) -> Record:
    """Four experiments of one axis with friction; its drive holds the torque."""
    robot, draw = Robot.load("one_axis"), np.random.default_rng(seed)
    time = STEP * np.arange(2000)
    lines = np.arange(3.0, highest_hz, 1.5)[:, None]
    waves = np.cos(2 * np.pi * lines * time + draw.uniform(0, 2 * np.pi, (4, 1, len(lines), 1))).sum(axis=2)
    slow = np.sin(2 * np.pi * time + draw.uniform(0, 2 * np.pi, (4, 1, 1)))
    reference = np.swapaxes(8 * waves / waves.std() + 10 * slow, 1, 2)
    done = robot.simulate(reference, draw.uniform(-0.6, 0.6, (4, 1)), seed=seed)
    return Record.from_arrays(
        motor_position=done.position,
        motor_torque=done.torque,
        axes="n_exp n_sample n_axis",
        sample_time_s=STEP,
        robot=robot,
        torque_hold=hold,  # type: ignore[arg-type]
    )


@pytest.mark.parametrize("seed", [0, 1, *(pytest.param(k, marks=pytest.mark.full) for k in range(2, 20))])
def test_the_hold_of_a_single_axis_is_doubted_where_friction_cannot_explain_it(seed: int) -> None:
    """Half a sample turns the phase at 150 Hz by 0.5 rad; friction does the less, the higher the frequency."""
    robot = Robot.load("one_axis")
    (words,) = doubts_of_timing(of_one_axis(seed, 150.0, "continuous"), robot)
    assert "torque_hold: continuous is stated" in words
    assert doubts_of_timing(of_one_axis(seed, 150.0, "zero_order_hold"), robot) == []


def test_a_lag_beside_friction_has_the_error_that_is_stated() -> None:
    """The phase turns by a half sample and by friction at random: the first is found, and its error holds."""
    draw, omega = np.random.default_rng(2), 2 * np.pi * np.repeat(np.arange(70.0, 140.0, 1.5), 4)
    off = []
    for friction in np.linspace(-20, 20, 100):
        noise = np.repeat(draw.normal(0, 0.05, len(omega) // 4), 4)  # of bins that share it
        lag = lag_beside_friction(omega, 0.5 * STEP * omega + friction / omega + noise, STEP)
        off.append((lag.samples - 0.5) / lag.error)
    assert np.std(off) == pytest.approx(1.0, abs=0.25)  # 3.5 standard errors of a deviation of 100
    assert abs(np.mean(off)) < 0.4


@pytest.mark.parametrize("plant", [{}, {"masses": 0.1}, {"payload": 15.0}, {"ripple": 0.05}])
def test_a_robot_that_is_told_wrong_is_no_doubt_of_timing_or_scale(plant: dict[str, float]) -> None:
    """Masses a tenth off, an untold load, ripple; and a lag of 0.3 samples, which a drive may have of its own."""
    position, torque = measured(**plant)
    for samples in (-0.3, 0.0, 0.3):
        assert doubts_of_timing(record(position, late(torque, samples)), ROBOT) == []
    assert doubts_of_scale(record(position, torque), ROBOT) == []


@pytest.mark.parametrize("factor", [0.6, 1.6])
def test_a_torque_constant_that_is_far_off_is_told(
    sound: tuple[FloatArray, FloatArray], factor: float
) -> None:
    position, torque = sound
    scale = np.array([1, factor, 1, 1, 1, 1])
    (words,) = doubts_of_scale(record(position, torque * scale), ROBOT)
    assert words.startswith("the torque of axis_2 is ")
    assert float(words.split(" is ")[1].split(" times")[0]) == pytest.approx(factor, rel=0.1)
    (words,) = doubts_of_scale(record(position, torque * factor), ROBOT)
    assert words.startswith("the torques are ")
    assert float(words.split(" are ")[1].split(" times")[0]) == pytest.approx(factor, rel=0.1)


@pytest.mark.parametrize(
    "factor", [[2.3, 4.8, 3.0, 2.5, 7.0, 5.5], [0.3, 0.2, 0.4, 0.1, 0.3, 0.2], [80, 150, 90, 120, 100, 80]]
)
def test_torques_in_another_unit_on_all_axes_are_told(
    sound: tuple[FloatArray, FloatArray], factor: list[float]
) -> None:
    """Currents by motors of unlike constants, percents of unlike ratings: no load does that to all axes."""
    position, torque = sound
    (words,) = doubts_of_scale(record(position, torque * np.array(factor)), ROBOT)
    told = [float(one) for one in words.split(" are ")[1].split(" times")[0].split(", ")]
    assert told == pytest.approx(factor, rel=0.15)
    assert "currents, or percents of a rating, in place of N m?" in words


@pytest.mark.parametrize(
    "samples",
    [np.full(6, 1.4), np.array([0, -1.6, 0, 0, 0, 0])],
    ids=["all lag", "one of coupled axes leads"],
)
def test_what_the_warning_says_to_write_mends_the_record(
    tmp_path: Path,
    sound: tuple[FloatArray, FloatArray],
    caplog: pytest.LogCaptureFixture,
    samples: FloatArray,
) -> None:
    """Moved by one number, or at the angle, torques of the other axes would be late by as much."""
    position, torque = (one.reshape(-1, 6) for one in (sound[0], late(sound[1], samples)))
    np.savez(tmp_path / "run.npz", q=position, tau=torque)

    def read(**more: Any) -> Record:
        channels = {
            "motor_position": {"column": "q", "unit": "rad"},
            "motor_torque": {"column": "tau", "unit": "N m", **more},
        }
        words = {
            "path": "run.npz",
            "sample_time_s": STEP,
            "torque_hold": "zero_order_hold",
            "channels": channels,
        }
        words |= {"starts_s": [0.0, 2.0, 4.0, 6.0], "duration_s": 2.0, "layout": [4, 1, 1]}
        stage = RecordedAcquisition.model_validate_json(json.dumps(words), strict=True)
        context = Context(
            np.random.default_rng(0),
            map_in_process,
            lambda *_, **__: None,
            logging.getLogger("test"),
            tmp_path,
        )
        return stage.run(ROBOT, context)

    read()
    (words,) = [one for one in caplog.messages if re.search("lag|lead", one) and "the angles" in one]
    delay_s = json.loads(words.split("motor_torque: delay_s: ")[1].split(", more")[0])
    caplog.clear()
    mended = read(delay_s=delay_s).run.values("motor_torque")[1, 0, 0, 0]
    assert not [one for one in caplog.messages if "the angles" in one]
    inner = slice(40, 1900)  # all are cut to the shortest, which lost an end of the file
    as_it_was = np.sqrt(np.mean((late(sound[1], samples) - sound[1])[1, inner] ** 2))
    assert np.sqrt(np.mean((mended[inner] - sound[1][1, inner]) ** 2)) < 0.3 * as_it_was


def test_a_wrong_spring_is_no_lag() -> None:
    """A SCARA of soft gears, in whose file springs are a quarter too soft and a third too stiff.

    About a resonance that is elsewhere phases are as of a torque that leads by 1.1 samples.
    """
    arm = Robot.load("scara")
    springs = [f"gear_stiffness.axis_{i}" for i in (1, 2)]
    soft = {name: 0.25 * arm.parameter(name) for name in springs}
    nominal = arm.with_parameters({springs[0]: 0.75 * soft[springs[0]], springs[1]: 1.3 * soft[springs[1]]})
    draw, time = np.random.default_rng(5), STEP * np.arange(4000)
    lines = np.arange(1.25, 60.0, 1.5)[:, None]
    waves = np.cos(2 * np.pi * lines * time + draw.uniform(0, 2 * np.pi, (4, 4, len(lines), 1))).sum(axis=2)
    slow = np.sin(np.pi * time + draw.uniform(0, 2 * np.pi, (4, 4, 1)))
    poses = draw.uniform(-0.6, 0.6, (4, 4)) * np.array([1, 1, 0.05, 1])
    plant = arm.with_parameters(soft)
    run = plant.simulate(np.swapaxes(4 * waves / waves.std() + 10 * slow, 1, 2), poses, seed=3)
    one = record(run.position, run.torque, robot=arm)
    assert "the torque of axis_2 leads the angles" in _doubts(one, nominal)
    assert not doubts_of_timing(one, nominal)
