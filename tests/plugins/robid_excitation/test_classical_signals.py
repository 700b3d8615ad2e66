"""excitation.chirp, .binary_sequence and .filtered_noise: what they ask of the motors, and what comes of it."""

from __future__ import annotations

import logging
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from robid_core import (
    Channel,
    ConfigurationError,
    Configurations,
    Context,
    DenseRun,
    Excitation,
    MotionRefused,
    Record,
    Robot,
    clear_motion,
)
from robid_core.estimation.response.covariance import confidence_radius
from robid_core.stage import map_in_process
from robid_core.testing import check_stage
from robid_core.testing.robots import example_robot
from robid_excitation.binary_sequence import BinarySequence
from robid_excitation.chirp import Chirp
from robid_excitation.classical import at_rest
from robid_excitation.filtered_noise import FilteredNoise
from robid_frf.spectral import Spectral

CHIRP = Chirp(band_hz=(6, 60), period_s=4.0, torque_share=0.3)
BINARY = BinarySequence(band_hz=(6, 60), register_bits=10, clock_hz=250, torque_share=0.3)
NOISE = FilteredNoise(band_hz=(6, 60), duration_s=4.0, torque_share=0.3)
STAGES = [
    CHIRP,
    CHIRP.model_copy(update={"sweep": "logarithmic"}),
    BINARY,
    BINARY.model_copy(update={"arrangement": "hadamard", "inverse_repeat": True}),
    BINARY.model_copy(update={"arrangement": "shifts"}),
    NOISE,
    NOISE.model_copy(update={"periodic": False}),
]
NAMES = ["linear", "logarithmic", "t_matrix", "hadamard", "shifts", "periodic", "once"]


def context(seed: int = 1) -> Context:
    log = logging.getLogger("test.classical")
    return Context(np.random.default_rng(seed), map_in_process, lambda done, total, note="": None, log)


def run(stage: Any, robot: Robot, angle: Any) -> Excitation:
    result = stage.run(Configurations(robot.axis_names, np.array(angle)), robot, context())
    assert isinstance(result, Excitation)
    return result


@pytest.fixture(scope="module")
def three() -> Robot:
    return example_robot(3)


@pytest.mark.parametrize("stage", [STAGES[0], STAGES[2], STAGES[6]], ids=["chirp", "binary", "noise"])
def test_classical_excitations_keep_the_contract(stage: Any) -> None:
    check_stage(type(stage), for_axes=(1, 2), **stage.model_dump(exclude_defaults=True))


@pytest.mark.parametrize("stage", STAGES, ids=NAMES)
def test_references_close_and_pass_the_gate(stage: Any, three: Robot) -> None:
    excitation = run(stage, three, np.zeros((1, 3)))
    reference = excitation.reference
    assert np.abs(reference.sum(axis=3)).max() < 1e-9 * np.abs(reference).max() * excitation.n_sample
    assert excitation.predicted_torque is not None
    assert (excitation.predicted_torque <= 0.9 * three.drives.torque_limit).all()
    start = three.motor_angle(np.zeros(3)) - excitation.start_offset(0)
    for m, e in np.ndindex(*reference.shape[1:3]):
        periods = 3 if len(excitation.line) else 1
        clear_motion(
            start[m, e],
            np.ascontiguousarray(reference[0, m, e]),
            excitation.sample_time_s,
            periods,
            three.limits,
        )
    # Each configuration and block has phases, shifts or noise of its own.
    assert np.abs(reference[0, 0, 0] - reference[0, 1, 0]).max() > 0.01 * np.abs(reference).max()


@pytest.mark.parametrize("stage", STAGES[:4], ids=NAMES[:4])
def test_a_block_is_orthogonal_at_every_line(stage: Any, three: Robot) -> None:
    # R R^H = n_exp diag(|R_a|^2) with the same waveform behind every axis; 1e-12 of it is rounding of the transforms.
    excitation = run(stage, three, np.zeros((1, 3)))
    spectrum = np.fft.rfft(excitation.reference[0], axis=2)[:, :, excitation.line] / excitation.n_sample
    gram = np.einsum("mefa,mefb->mfab", spectrum, spectrum.conj())
    size = np.sqrt(np.einsum("mfaa->mfa", gram).real)
    normal = gram / (size[..., :, None] * size[..., None, :])
    np.testing.assert_allclose(normal, np.broadcast_to(np.eye(3), normal.shape), atol=1e-10)
    # Axes differ by their motors, not by their waveform: below the loops' crossover the ratio is one of sizes.
    magnitude = np.abs(spectrum)
    np.testing.assert_allclose(magnitude, np.broadcast_to(magnitude[:1, :1], magnitude.shape), rtol=1e-9)


@pytest.mark.parametrize("stage", STAGES[2:6], ids=NAMES[2:6])
def test_periodic_signals_have_power_in_the_band_and_nowhere_else(stage: Any, three: Robot) -> None:
    excitation = run(stage, three, np.zeros((1, 3)))
    spectrum = np.abs(np.fft.rfft(excitation.reference, axis=3)).max(axis=(0, 1, 2, 4))
    band = excitation.frequency_hz
    assert band.min() >= 6.0
    assert band.max() <= 60.0
    others = np.delete(spectrum, excitation.line)
    assert others.max() < 1e-9 * spectrum.max()
    assert len(excitation.line) > 0.9 * (54 * excitation.period_s) / (
        2 if excitation.line[0] % 2 and stage is STAGES[3] else 1
    )


def test_the_reference_asks_a_free_motor_for_a_flat_torque() -> None:
    # t = i w J v and v = r / (1 + i f / f_c): a reference times w / |1 + i f / f_c| is flat where the torque is, for a
    # sequence up to its sinc.
    robot = Robot.load("one_axis")
    excitation = run(BINARY, robot, [[0.3]])
    f = excitation.frequency_hz
    mobility = np.abs(robot.response([[0.3]], np.array([6.0]))[0, 0, 0, 0])
    crossover = robot.drives.speed_gain[0] * mobility / (2 * np.pi)
    spectrum = np.abs(np.fft.rfft(excitation.reference[0, 0, 0, :, 0])[excitation.line])
    torque = spectrum * f / np.hypot(1, f / crossover) / np.sinc(f / 250.0)
    # A held sign is a sum of four samples, not an integral: sin(x) / sin(x / 4) against sin(x) / (x / 4), 1 % at 60 Hz.
    assert np.ptp(torque) < 0.02 * torque.mean()


def test_levels_are_those_that_were_asked_for(three: Robot) -> None:
    # A motor that follows as an inertia under its loop has the speed r / (1 + i f / f_c); its root mean square is the
    # one asked for, times the axis' factor, in the mean over blocks and experiments.
    scale = (1.0, 0.5, 0.25)
    stage = NOISE.model_copy(update={"speed_rms_rad_s": 2.0, "axis_scale": scale, "slow_sine_rad_s": 4.0})
    excitation = run(stage, three, np.zeros((1, 3)))
    assert excitation.slow_sine_bin == 2
    np.testing.assert_allclose(excitation.slow_sine_speed, 4.0 * np.array(scale))
    spectrum = np.fft.rfft(excitation.reference[0], axis=2) / excitation.n_sample
    np.testing.assert_allclose(
        2 * np.abs(spectrum[:, :, 2]), np.broadcast_to(4.0 * np.array(scale), (2, 3, 3))
    )
    f = excitation.frequency_hz[:, None]
    mobility = np.abs(np.diagonal(three.response(np.zeros((1, 3)), np.array([6.0]))[0, 0]))
    speed = spectrum[:, :, excitation.line] / np.hypot(
        1, f * 2 * np.pi / (three.drives.speed_gain * mobility)
    )
    rms = np.sqrt(2 * np.mean(np.sum(np.abs(speed) ** 2, axis=2), axis=(0, 1)))
    np.testing.assert_allclose(rms, 2.0 * np.array(scale), rtol=1e-6)
    # Half the share of the torque is half of everything.
    whole, half = (
        run(CHIRP.model_copy(update={"torque_share": s}), three, np.zeros((1, 3))) for s in (0.2, 0.1)
    )
    np.testing.assert_allclose(half.reference, 0.5 * whole.reference, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("law", ["linear", "logarithmic"])
def test_a_sweep_begins_and_ends_smoothly(law: str) -> None:
    robot = Robot.load("one_axis")
    stage = Chirp(band_hz=(4, 80), period_s=8.0, sweep=law, blocks=8)  # type: ignore[arg-type]
    reference = run(stage, robot, [[0.3]]).reference[0, :, 0, :, 0]
    ends = np.abs(reference[:, [0, -1]]).max(axis=1)
    assert (ends < 0.04 * np.abs(reference).max(axis=1)).all()


def test_noise_that_is_not_periodic_goes_from_rest_to_rest_and_has_no_lines(three: Robot) -> None:
    excitation = run(STAGES[6].model_copy(update={"slow_sine_rad_s": 5.0}), three, np.zeros((1, 3)))
    assert len(excitation.line) == 0
    assert (excitation.reference[..., [0, -1], :] == 0).all()
    # Every axis and experiment has noise of its own: correlations of 4 s x 54 Hz x 2 numbers, five sigma.
    fast = run(STAGES[6], three, np.zeros((1, 3))).reference.transpose(0, 1, 2, 4, 3).reshape(-1, 4000)
    torque = np.gradient(fast, axis=1)
    correlation = np.corrcoef(torque) - np.eye(len(torque))
    assert np.abs(correlation).max() < 5 / np.sqrt(430)


def test_a_taper_keeps_the_ends_at_rest_and_the_motion_closed() -> None:
    generator = np.random.default_rng(0)
    taper = np.hanning(50)
    result = at_rest(generator.standard_normal((2, 50, 3)), taper)
    assert np.abs(result[:, [0, -1]]).max() < 1e-12
    np.testing.assert_allclose(result.sum(axis=1), 0, atol=1e-12)


def test_what_cannot_be_is_refused() -> None:
    robot = Robot.load("one_axis")
    with pytest.raises(ValidationError, match="60 Hz is not below 6 Hz"):
        Chirp(band_hz=(60, 6), period_s=4.0)
    with pytest.raises(ValidationError, match="no power; end the band below 90 Hz"):
        BinarySequence(band_hz=(6, 95), register_bits=9, clock_hz=100)
    with pytest.raises(ValidationError, match="hadamard has its own number"):
        BinarySequence(band_hz=(6, 60), clock_hz=250, arrangement="hadamard", experiments=3)
    with pytest.raises(ConfigurationError, match="clock_hz: 240 Hz does not hold .* 250 Hz does"):
        run(BinarySequence(band_hz=(6, 60), clock_hz=240), robot, [[0.3]])
    with pytest.raises(ConfigurationError, match="not a whole number"):
        run(Chirp(band_hz=(6, 60), period_s=4.00051), robot, [[0.3]])
    with pytest.raises(ConfigurationError, match="two turns at 6 Hz"):
        run(Chirp(band_hz=(6, 60), period_s=0.3), robot, [[0.3]])
    with pytest.raises(ConfigurationError, match="slow sine at 5 Hz is not below the signal from 3 Hz"):
        run(Chirp(band_hz=(6, 60), period_s=0.4, slow_sine_rad_s=3.0), robot, [[0.3]])
    with pytest.raises(MotionRefused, match="speed_rms_rad_s: .* would fit"):
        run(NOISE.model_copy(update={"speed_rms_rad_s": 300.0}), robot, [[0.3]])
    with pytest.raises(ConfigurationError, match="axis_scale: 2 factors for the 1 axes"):
        run(NOISE.model_copy(update={"axis_scale": (1.0, 2.0)}), robot, [[0.3]])


def measured(robot: Robot, excitation: Excitation, angle: float, periods: int, kept: int) -> Record:
    """A recording of the robot itself, in closed loop with the noise of its sensors."""
    reference = excitation.reference[0]
    n_block, n_exp, n_sample, n_axis = reference.shape
    lanes = np.tile(reference[:, :, None], (1, 1, periods, 1, 1)).reshape(n_block * n_exp, -1, n_axis)
    start = robot.motor_angle(np.array([angle])) - excitation.start_offset(0).reshape(-1, n_axis)
    simulated = robot.simulate(np.ascontiguousarray(lanes), robot.joint_angle(start), seed=3)
    shape = (1, n_block, n_exp, periods, n_sample, n_axis)

    def of(values: Any, unit: str) -> Channel:
        return Channel("motor", unit, np.ascontiguousarray(values.reshape(shape)[:, :, :, -kept:]))

    channels = {
        "motor_position": of(simulated.position, "rad"),
        "motor_torque": of(simulated.torque, "N m"),
        "speed_reference": of(lanes, "rad/s"),
    }
    valid = np.ones(channels["motor_torque"].values.shape[:-1], dtype=bool)
    run_ = DenseRun(robot.sample_time_s, channels, np.arange(n_sample) * robot.sample_time_s, valid)
    line = excitation.line if len(excitation.line) else None
    return Record(robot.axis_names, "test", "zero_order_hold", (run_,), np.array([[angle]]), line)


@pytest.fixture(scope="module")
def frictionless() -> Robot:
    return Robot.load("one_axis").without_friction([0.0])


@pytest.mark.parametrize("stage", STAGES[:6], ids=NAMES[:6])
def test_periodic_signals_give_the_response_of_a_linear_robot(stage: Any, frictionless: Robot) -> None:
    # Regions of the noise between two periods (a single experiment a block leaves the total few degrees of freedom);
    # 1e-3 of the response for what gravity bends over the swing, and for the sampled controller's settling.
    excitation = run(stage, frictionless, [[0.3]])
    frf = Spectral(approach="jio").run(measured(frictionless, excitation, 0.3, 3, 2), context())
    truth = frictionless.response([[0.3]], frf.frequency_hz)[0, :, 0, 0]
    assert len(truth) > 50
    assert frf.noise_covariance is not None
    assert frf.noise_degrees_of_freedom is not None
    assert frf.input_gram_inverse is not None
    variance = (frf.noise_covariance[0, :, 0, 0] * frf.input_gram_inverse[0, :, 0, 0]).real
    error = np.abs(frf.response[0, :, 0, 0] - truth)
    radius = confidence_radius(variance, frf.noise_degrees_of_freedom[0], 0.99)
    # 99 % of 70 to 300 lines that share their noise by fives: less than 95 % inside has a chance below 1e-3.
    assert np.mean(error <= radius + 1e-3 * np.abs(truth)) > 0.95
    assert np.median(error / np.abs(truth)) < 2e-3


def test_one_run_of_noise_gives_the_response_of_a_linear_robot(frictionless: Robot) -> None:
    stage = NOISE.model_copy(update={"periodic": False, "duration_s": 120.0, "blocks": 1})
    excitation = run(stage, frictionless, [[0.3]])
    record = measured(frictionless, excitation, 0.3, 1, 1)
    frf = Spectral(approach="jio", segment_s=4.0, band_hz=(8, 50)).run(record, context())
    truth = frictionless.response([[0.3]], frf.frequency_hz)[0, :, 0, 0]
    # Hann's smoothing, G'' / (6 * 4^2) under a flat spectrum of torque; twice that for the torque's own colour.
    curvature = np.abs(np.gradient(np.gradient(truth, 0.25), 0.25))
    error = np.abs(frf.response[0, :, 0, 0] - truth)
    radius = confidence_radius(frf.variance()[0, :, 0, 0], frf.degrees_of_freedom[0], 0.99)
    assert np.mean(error <= radius + 2 * curvature / 96) > 0.95
    assert np.median(error / np.abs(truth)) < 2e-3
