"""Example artifacts for a robot that fit together: same axes, same configurations, a record that was simulated.

They are small (two configurations, half a second a period), deterministic, and only as good as that: enough
for a stage to run, too little for its result to be judged.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from robid_core.arrays import FloatArray
from robid_core.artifacts import (
    Artifact,
    Configurations,
    Design,
    Diagnosis,
    Excitation,
    Fit,
    Frf,
    ParameterTable,
    Record,
    Report,
    ResponseComparison,
    TimeComparison,
    Truth,
)
from robid_core.artifacts.dense_run import Channel, DenseRun
from robid_core.artifacts.record import MOTOR_POSITION, MOTOR_TORQUE, SPEED_REFERENCE
from robid_core.robot import Robot

N_SAMPLE = 500
N_SETTLE = 3  # periods before the record begins: the speed loop's slow pole has died down
SLOW_SINE_BIN = 2
LINES = np.arange(5, 42, 2, dtype=np.int64)  # odd bins of half a second: 10 to 82 Hz
SPEED_RMS = 2.0  # rad/s of a motor
SLOW_SPEED = 5.0  # rad/s amplitude: the motors do not stand still
MIDDLE = (1 / 3, 2 / 3)  # of each axis' range, where the configurations lie


def example_configurations(
    robot: Robot, n_config: int = 2, within: tuple[float, float] = MIDDLE
) -> Configurations:
    """Return configurations in a part of each axis' range, by default the middle third."""
    lower, upper = robot.drives.lower, robot.drives.upper
    share = np.random.default_rng(1).uniform(*within, (n_config, robot.n_axis))
    return Configurations(robot.axis_names, lower + share * (upper - lower))


def example_excitation(robot: Robot, configurations: Configurations, n_block: int = 2) -> Excitation:
    """Return a multisine with a slow sine, orthogonal over as many experiments as axes.

    Experiment e moves axis a with the phases of its block turned by 2 pi e a / n_axis at every line, so that
    the matrix of inputs is a scaled unitary one at each line (a Fourier matrix).
    """
    n_config, n_axis = configurations.n_config, robot.n_axis
    turn = np.exp(2j * np.pi * np.outer(np.arange(n_axis), np.arange(n_axis)) / n_axis)
    phase = np.random.default_rng(2).uniform(0, 2 * np.pi, (n_config, n_block, 1, len(LINES), 1))
    amplitude = SPEED_RMS * np.sqrt(2 / len(LINES))
    spectrum = np.zeros((n_config, n_block, n_axis, N_SAMPLE // 2 + 1, n_axis), dtype=complex)
    spectrum[:, :, :, LINES] = 0.5 * amplitude * np.exp(1j * phase) * turn[:, None, :]
    spectrum[:, :, :, SLOW_SINE_BIN] = 0.5 * SLOW_SPEED
    return Excitation(
        axis_names=robot.axis_names,
        sample_time_s=robot.sample_time_s,
        slow_sine_bin=SLOW_SINE_BIN,
        line=LINES,
        reference=np.fft.irfft(spectrum, N_SAMPLE, axis=3) * N_SAMPLE,
        slow_sine_speed=np.full(n_axis, SLOW_SPEED),
    )


def example_record(
    robot: Robot,
    n_config: int = 2,
    n_block: int = 2,
    n_period: int = 3,
    seed: int = 3,
    within: tuple[float, float] = MIDDLE,
) -> Record:
    """Return a measurement of the robot itself, simulated in closed loop with noise, once it has settled."""
    configurations = example_configurations(robot, n_config, within)
    reference = example_excitation(robot, configurations, n_block).reference
    shape = (*reference.shape[:3], n_period + N_SETTLE, N_SAMPLE, robot.n_axis)
    lanes = np.broadcast_to(reference[:, :, :, None], shape).reshape(
        -1, (n_period + N_SETTLE) * N_SAMPLE, robot.n_axis
    )
    angle = np.repeat(configurations.angle, n_block * robot.n_axis, axis=0)
    simulated = robot.simulate(np.ascontiguousarray(lanes), angle, seed=seed)

    def kept(values: FloatArray) -> FloatArray:
        return np.ascontiguousarray(values.reshape(shape)[:, :, :, N_SETTLE:])

    channels = {
        MOTOR_POSITION: Channel("motor", "rad", kept(simulated.position)),
        MOTOR_TORQUE: Channel("motor", "N m", kept(simulated.torque)),
        SPEED_REFERENCE: Channel("motor", "rad/s", kept(lanes)),
    }
    valid = np.ones(channels[MOTOR_POSITION].values.shape[:-1], dtype=bool)
    time_s = np.arange(N_SAMPLE, dtype=np.float64) * robot.sample_time_s
    run = DenseRun(robot.sample_time_s, channels, time_s, valid)
    names = robot.axis_names
    return Record(names, "example", "zero_order_hold", (run,), configurations.angle, LINES)


def example_frf(robot: Robot, n_config: int = 2, seed: int = 4) -> Frf:
    """Return the robot's own linear response with 1 % of noise and the covariance of that noise."""
    configurations = example_configurations(robot, n_config)
    frequency = LINES / (N_SAMPLE * robot.sample_time_s)
    n_freq, n_axis = len(LINES), robot.n_axis
    rms = np.full((n_config, n_axis), SPEED_RMS)
    slow = np.full((n_config, n_axis), SLOW_SPEED)
    damping = robot.equivalent_motor_damping(rms, slow, frequency)
    response = robot.response(configurations.angle, frequency, damping)
    size = 0.01 * np.abs(response).mean(axis=(1, 2, 3))[:, None, None, None]
    generator = np.random.default_rng(seed)
    parts = generator.normal(size=(2, n_config, 2, *response.shape[1:]))
    blocks = response[:, None] + size[:, None] * (parts[0] + 1j * parts[1]) / np.sqrt(2)
    identity = np.broadcast_to(np.eye(n_axis, dtype=complex), (n_config, n_freq, n_axis, n_axis)).copy()
    variance = size**2 / 2 * identity
    return Frf(
        axis_names=robot.axis_names,
        estimator="example",
        pooling="exact",
        sample_time_s=robot.sample_time_s,
        torque_hold="zero_order_hold",
        angle=configurations.angle,
        frequency_hz=frequency,
        response=blocks.mean(axis=1),
        block_response=blocks,
        input_gram_inverse=identity,
        output_covariance=variance,
        noise_covariance=variance,
        degrees_of_freedom=np.full((n_config, n_freq), 20.0),
        valid=np.ones((n_config, n_freq), dtype=bool),
        speed_rms=rms,
        slow_sine_speed=slow,
    )


def example_fit(robot: Robot) -> Fit:
    """Return the robot's own stiffness and damping as if they had been estimated to 3 %."""
    names = robot.stiffness_names + robot.damping_names
    values = robot.parameters()
    estimate = np.array([values[name] for name in names])
    table = ParameterTable(
        names=names,
        units=tuple(robot.parameter_unit(name) for name in names),
        groups=tuple(robot.parameter_kind(name) for name in names),
        start=1.2 * estimate,
        estimate=estimate,
        standard_error=0.03 * estimate,
        reported=np.array([name in robot.stiffness_names for name in names]),
        at_bound=np.zeros(len(names), dtype=bool),
    )
    frf = example_frf(robot)
    comparison = ResponseComparison(
        axis_names=frf.axis_names,
        frequency_hz=frf.frequency_hz,
        measured=frf.response,
        modelled=robot.response(frf.angle, frf.frequency_hz),
        start=robot.response(frf.angle, frf.frequency_hz),
        deviation=np.sqrt(frf.variance()),
    )
    covariance = np.diag((0.03 * estimate) ** 2)
    model = robot.model(table.as_mapping(), names, covariance)
    return Fit("example", "converged", True, 1.0, 3, 3, table, covariance, names, comparison, model=model)


def example_design(robot: Robot, n_config: int = 2) -> Design:
    """Return configurations with weights, as if they had been chosen."""
    configurations = example_configurations(robot, n_config)
    names = robot.stiffness_names
    return Design(
        axis_names=configurations.axis_names,
        angle=configurations.angle,
        criterion="D",
        parameter_names=names,
        gap=1e-6,
        efficiency=0.99,
        weight=np.full(n_config, 1 / n_config),
        experiments=np.full(n_config, 4, dtype=np.int64),
        candidate_index=np.arange(n_config),
        information=np.eye(len(names)) * 1e4,
        predicted_standard_error=np.full(len(names), 0.01),
    )


def example_diagnosis(robot: Robot) -> Diagnosis:
    """Return a comparison of two sines that differ by 2 %."""
    time_s = np.arange(N_SAMPLE, dtype=np.float64) * robot.sample_time_s
    measured = np.sin(2 * np.pi * 2 * time_s)[:, None] * np.ones(robot.n_axis)
    comparison = TimeComparison(
        axis_names=robot.axis_names,
        channel=MOTOR_POSITION,
        unit_symbol="rad",
        relative_error=0.02,
        time_s=time_s,
        measured=measured,
        modelled=0.98 * measured,
    )
    return Diagnosis("example", "the model is 2 % too small", (comparison,))


def example_truth(robot: Robot) -> Truth:
    """Return the robot's parameters as those of a simulated plant."""
    values = robot.parameters()
    return Truth(robot.name, tuple(values), np.array(list(values.values())))


def example_artifacts(robot: Robot) -> dict[type[Artifact], Artifact]:
    """Return one artifact of every type, by type."""
    return {kind: example_of(kind, robot) for kind in EXAMPLES}


def example_of(kind: type[Artifact], robot: Robot) -> Artifact:
    """Return an artifact of one of `EXAMPLES`."""
    return EXAMPLES[kind](robot)


EXAMPLES: dict[type[Artifact], Callable[[Robot], Artifact]] = {
    Configurations: example_configurations,
    Excitation: lambda robot: example_excitation(robot, example_configurations(robot)),
    Record: example_record,
    Frf: example_frf,
    Fit: example_fit,
    Design: example_design,
    Diagnosis: example_diagnosis,
    Report: lambda robot: Report(html="<!doctype html><title>example</title>"),
}
"""How to make an example of each type; the record is the only one that is simulated."""
