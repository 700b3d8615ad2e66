"""Encoders at the links and torque sensors in the joints, as rows of the torque residual beside the motors' torques."""

from __future__ import annotations

import dataclasses
import logging
from typing import Any

import numpy as np
import pytest

from robid_core import Channel, ConfigurationError, Context, DataRejected, DenseRun, Fit, Record, Robot
from robid_core.estimation.torque.weights import whitener
from robid_core.mechanics import pose_of
from robid_core.residual.derivatives import derivatives
from robid_core.robot.file.axis import InertialSensorEntry
from robid_core.stage import map_in_process
from robid_fit.torque_residual import TorqueResidualFit
from studies.arm_side_sensors.sensors import Experiment, Sensor, Study, errors

T, N, N_PERIOD = 1e-3, 1000, 3
LINES = np.arange(5, 80, 3)  # of one second
NOISE = {"motor_position": 2e-6, "joint_position": 1e-7, "joint_torque": 0.01}  # rad, rad, N m
TORQUE_NOISE = 1e-3  # of the limit
ACCELERATION_NOISE = 0.02  # m/s^2
BOTH = ("joint_position", "joint_torque")
FREE = ("gear_stiffness.*", "gear_damping.*", "friction.*.viscous", "rotor_inertia.*", "mass.*")


def quiet(name: str) -> Robot:
    """A packaged robot that rubs in proportion to the speed, without weight: beside lines it moves nothing."""
    robot = Robot.load(name)
    bare = robot.description.model_copy(update={"gravity": (0.0, 0.0, 0.0)})
    robot = dataclasses.replace(robot, description=bare)
    levels = [n for n in robot.layout if n.startswith("friction.") and n.endswith((".coulomb", ".offset"))]
    return robot.with_parameters(dict.fromkeys(levels, 0.0))


def with_units(robot: Robot, axes: tuple[str, ...]) -> Robot:
    """A robot with an inertial unit at the origin of some links, turned as its joint's frame is."""
    description = robot.description
    told = {
        name: axis.model_copy(
            update={"sensors": axis.sensors.model_copy(update={"inertial": InertialSensorEntry()})}
        )
        if name in axes
        else axis
        for name, axis in description.axes.items()
    }
    return dataclasses.replace(robot, description=description.model_copy(update={"axes": told}))


def accelerations(robot: Robot, pose: np.ndarray, torque: np.ndarray, axis: int) -> np.ndarray:
    """Spectra of the acceleration of a link's origin in its own axes, without gravity, (n_exp, n_line, 3)."""
    model = robot.linearize(pose, (f"frame_acceleration.{robot.axis_names[axis]}",))
    shift = 2j * np.pi * LINES[:, None, None] / (N * T)
    state = np.linalg.solve(shift * np.eye(len(model.a)) - model.a, model.b[None].astype(complex))
    joints = robot.equilibrium(pose[None]).position @ robot.mechanism.constraint_map.T
    rotation = pose_of(robot.chain, joints[0], robot.axis_names[axis]).rotation
    return np.einsum("ji,fjk,xfk->xfi", rotation, model.c @ state + model.d, torque)


def record_of(
    plant: Robot, poses: np.ndarray, n_exp: int, seed: int, *, noise: float = 1.0, units: tuple[int, ...] = ()
) -> Record:
    """What the linear state space of a plant answers to lines of a continuous torque, in all sensors.

    `units` are the axes whose links have an accelerometer.
    """
    generator, frequency = np.random.default_rng(seed), LINES / (N * T)
    limit, n_axis = plant.drives.torque_limit, plant.n_axis
    shape = (len(poses), 1, n_exp, N_PERIOD, N, n_axis)
    channels = {name: np.empty(shape) for name in (*NOISE, "motor_torque")}
    shaking = np.full((3, *shape), np.nan)
    shift = 2j * np.pi * frequency[:, None, None]
    for c, pose in enumerate(poses):
        model = plant.linearize(pose, ("motor_angle", "arm_angle", "joint_torque"))
        state = np.linalg.solve(shift * np.eye(len(model.a)) - model.a, model.b[None].astype(complex))
        response = model.c @ state + model.d
        phase = generator.uniform(0, 2 * np.pi, (n_exp, len(LINES), n_axis))
        torque = 0.1 * limit / np.sqrt(2 * len(LINES)) * np.exp(1j * phase)
        shown = (
            np.einsum("fij,xfj->ixf", response, torque).reshape(3, n_axis, n_exp, -1).transpose(0, 2, 3, 1)
        )
        still = plant.motor_angle(pose), pose, np.zeros(n_axis), plant.gravity_torque(pose[None])[0]
        sizes = (*(np.full(n_axis, one) for one in NOISE.values()), TORQUE_NOISE * limit)
        for name, lines, middle, size in zip(channels, (*shown, torque), still, sizes, strict=True):
            spectrum = np.zeros((n_exp, N // 2 + 1, n_axis), dtype=complex)
            spectrum[:, LINES] = lines
            values = middle + np.fft.irfft(spectrum, N, axis=1)[:, None] * N
            channels[name][c, 0] = values + noise * size * generator.standard_normal(shape[2:])
        for axis in units:
            spectrum = np.zeros((n_exp, N // 2 + 1, 3), dtype=complex)
            spectrum[:, LINES] = accelerations(plant, pose, torque, axis)
            values = np.fft.irfft(spectrum, N, axis=1)[:, None] * N
            values = values + noise * ACCELERATION_NOISE * generator.standard_normal((*shape[2:5], 3))
            shaking[:, c, 0, ..., axis] = np.moveaxis(values, -1, 0)
    units = {"motor_position": "rad", "joint_position": "rad", "joint_torque": "N m", "motor_torque": "N m"}
    made = {name: Channel(name.partition("_")[0], units[name], values) for name, values in channels.items()}
    if units:
        made |= {
            f"link_acceleration_{d}": Channel("joint", "m/s^2", v)
            for d, v in zip("xyz", shaking, strict=True)
        }
    run = DenseRun(T, made, T * np.arange(N), np.ones(shape[:-1], dtype=bool))
    return Record(plant.axis_names, "closed form", "continuous", (run,), poses, LINES)


def fit_of(record: Record, robot: Robot, arm_side: tuple[str, ...], **settings: Any) -> Fit:
    context = Context(
        np.random.default_rng(1), map_in_process, lambda *a, **k: None, logging.getLogger("test")
    )
    stage = TorqueResidualFit(free=FREE, arm_side=arm_side, highest_hz=90.0, **settings)
    return stage.run((record,), robot, context)


POSES = np.array([[0.3, 0.4, -0.3, 0.5, 0.6, 0.2], [-0.7, -0.2, 0.5, -0.9, -0.5, 1.0]])


def test_derivatives_of_all_rows_are_differences() -> None:
    """Six axes with bearings: springs, dampers, bodies, rotors, gains and delays of sensors, and of torques."""
    robot = quiet("six_axis")
    record = record_of(robot, POSES, 1, 1)
    problem = TorqueResidualFit(arm_side=BOTH, highest_hz=90.0).problem((record,), robot)
    assert len(problem.sensors) == 12
    generator, n_robot = np.random.default_rng(3), problem.n_unknown - problem.n_delay - 24
    point = np.zeros(problem.n_unknown)
    point[n_robot:] = np.concatenate(
        (0.01 * generator.standard_normal(12), 1e-4 * generator.standard_normal(13))
    )
    (block,), coordinates = problem.blocks, point[: problem.n_free]
    (predicted,) = problem.predicted(point)
    at = coordinates, predicted, False, problem.sensing(point)
    of_configurations = derivatives(block, problem.free, *at)
    columns = np.stack([np.concatenate(list(runs)) for runs in of_configurations])
    kinds = ("gear_stiffness", "gear_damping", "bearing_stiffness", "mass", "rotor_inertia", "inertia")
    chosen = [next(i for i, n in enumerate(problem.free.names) if n.startswith(f"{kind}.")) for kind in kinds]
    for i in (*chosen, *range(n_robot, problem.n_unknown)):
        step = 1e-7 if problem.prior[i] < 0.005 else 1e-4
        ends = []
        for way in (-step, step):
            moved = point.copy()
            moved[i] += way
            ends.append(problem.residuals(moved)[0])
        numeric = (ends[0] - ends[1]).transpose(0, 2, 1, 3) / (2 * step)
        numeric[:, 0], exact = 0.0, columns[..., i]
        exact[:, 0] = 0.0
        for rows in (slice(0, 6), slice(6, 12), slice(12, 18)):
            # What moves a row by a millionth of itself only is lost in the rounding of differences.
            size = max(abs(exact[..., rows]).max(), 1e-3 * abs(block.measured[..., rows]).max())
            # A delay's column is that of predicted spectra, from which measured ones are turned by up to 0.14 rad here.
            error = abs(numeric[..., rows] - exact[..., rows])[:, LINES].max()
            assert error < (0.2 if i >= n_robot + 12 else 1e-3) * size, (i, rows)


def test_a_right_robot_leaves_nothing_in_any_row() -> None:
    """Of state space, a solution of its own: encoder and torque sensor at every axis follow the motors' angles."""
    robot = quiet("six_axis")
    problem = TorqueResidualFit(arm_side=BOTH, highest_hz=90.0).problem(
        (record_of(robot, POSES, 1, 2, noise=0.0),), robot
    )
    (residual,) = problem.residuals(np.zeros(problem.n_unknown))
    rows = problem.blocks[0].measured[:, :, LINES]
    left = np.sqrt(
        (abs(residual[:, :, LINES]) ** 2).sum(axis=(0, 1, 2)) / (abs(rows) ** 2).sum(axis=(0, 1, 2))
    )
    assert left[6:].max() < 1e-9
    assert left.max() < 1e-6


@pytest.mark.parametrize(
    ("arm_side", "most"),
    [((), 1.02), pytest.param(BOTH[:1], 1.02, marks=pytest.mark.full), (BOTH, 1.5)],
    ids=["none", "encoders", "both"],
)
def test_errors_of_springs_are_those_that_the_study_of_sensors_says(
    arm_side: tuple[str, ...], most: float
) -> None:
    """The study goes from torques to all sensors, the fit from motor angles to torques and sensors: one information.

    The fit does not know the delays of sensors, and where both sides of a spring are seen that costs up to 40 %.
    """
    robot = quiet("six_axis")
    record = record_of(robot, POSES, 6, 4)
    torque = np.fft.rfft(record.run.values("motor_torque")[:, 0].mean(axis=2), axis=2)[:, :, LINES] / N
    seen = {"joint_position": "arm_angle", "joint_torque": "joint_torque"}
    sensors = [Sensor(("motor_angle",), NOISE["motor_position"])]
    sensors += [Sensor((seen[name],), NOISE[name]) for name in arm_side]
    experiment = Experiment(POSES, LINES / (N * T), torque, N * N_PERIOD, TORQUE_NOISE)
    expected = errors(Study(robot, experiment, tuple(sensors)))
    problem = TorqueResidualFit(arm_side=arm_side, highest_hz=90.0, arm_side_gain=1e-9).problem(
        (record,), robot
    )
    point, (block,) = np.zeros(problem.n_unknown), problem.blocks
    weights = problem.weightings(point, [whitener(block.noise(robot, problem.friction_size(point)))])
    covariance = np.linalg.inv(problem.linearise(point, weights).whole)
    index = [problem.free.names.index(name) for name in robot.stiffness_names]
    ratio = np.sqrt(np.diag(covariance))[index] / expected
    assert ratio.min() > 0.97  # noise is estimated from 136 differences a bin and more
    assert ratio.max() < most


@pytest.mark.parametrize("axis", [2, 5])
def test_an_accelerometer_is_worth_what_the_study_of_sensors_says(axis: int) -> None:
    """One on a link, without gravity: nothing is left of a right robot, and errors of springs are those of the study.

    Where the unit is turned and how late it is are unknown here and known there: that costs up to a tenth.
    """
    robot = with_units(quiet("six_axis"), (f"axis_{axis + 1}",))
    settings = {"arm_side": ("link_acceleration",), "highest_hz": 90.0}
    exact = record_of(robot, POSES, 1, 2, noise=0.0, units=(axis,))
    problem = TorqueResidualFit(**settings).problem((exact,), robot)
    assert [one.channel[-1] for one in problem.sensors] == ["x", "y", "z"]
    (residual,) = problem.residuals(np.zeros(problem.n_unknown))
    rows = problem.blocks[0].measured[:, :, LINES]
    left = (abs(residual[:, :, LINES]) ** 2).sum(axis=(0, 1, 2)) / (abs(rows) ** 2).sum(axis=(0, 1, 2))
    assert np.sqrt(left[6:].max()) < 1e-8

    record = record_of(robot, POSES, 6, 4, units=(axis,))
    torque = np.fft.rfft(record.run.values("motor_torque")[:, 0].mean(axis=2), axis=2)[:, :, LINES] / N
    sensors = (
        Sensor(("motor_angle",), NOISE["motor_position"]),
        Sensor((f"frame_acceleration.axis_{axis + 1}",), ACCELERATION_NOISE),
    )
    experiment = Experiment(POSES, LINES / (N * T), torque, N * N_PERIOD, TORQUE_NOISE)
    expected = errors(Study(robot, experiment, sensors))
    problem = TorqueResidualFit(**settings, arm_side_gain=1e-9, arm_side_mounting_rad=1e-9).problem(
        (record,), robot
    )
    point, (block,) = np.zeros(problem.n_unknown), problem.blocks
    weights = problem.weightings(point, [whitener(block.noise(robot, problem.friction_size(point)))])
    covariance = np.linalg.inv(problem.linearise(point, weights).whole)
    index = [problem.free.names.index(name) for name in robot.stiffness_names]
    ratio = np.sqrt(np.diag(covariance))[index] / expected
    assert ratio.min() > 0.97
    assert ratio.max() < 1.1


def test_derivatives_of_inertial_rows_are_differences() -> None:
    """With gains, delays and a unit that is turned; beside gravity, where sagging a little more is left out."""
    robot = with_units(quiet("six_axis"), ("axis_3", "axis_6"))
    record = record_of(robot, POSES, 1, 1, units=(2, 5))
    problem = TorqueResidualFit(arm_side=("joint_position", "link_acceleration"), highest_hz=90.0).problem(
        (record,), robot
    )
    generator, point = np.random.default_rng(3), np.zeros(problem.n_unknown)
    n_robot, n_sensor = problem.n_unknown - problem.n_delay - 2 * 12 - 6, 12
    point[n_robot : n_robot + n_sensor] = 0.01 * generator.standard_normal(n_sensor)
    point[-7:-1] = 0.02 * generator.standard_normal(6)
    assert problem.nuisance_names()[-7:] == (
        *(f"mounting.link_acceleration_{d}.axis_{a}" for d in "xyz" for a in (3, 6)), "torque_delay",
    )  # fmt: skip
    (block,), coordinates = problem.blocks, point[: problem.n_free]
    (predicted,) = problem.predicted(point)
    at = coordinates, predicted, False, problem.sensing(point)
    columns = np.stack([np.concatenate(list(runs)) for runs in derivatives(block, problem.free, *at)])
    kinds = ("gear_stiffness", "gear_damping", "bearing_stiffness", "mass", "rotor_inertia", "inertia")
    chosen = [next(i for i, n in enumerate(problem.free.names) if n.startswith(f"{kind}.")) for kind in kinds]
    for i in (
        *chosen,
        *range(n_robot, n_robot + n_sensor),
        *range(problem.n_unknown - 7, problem.n_unknown - 1),
    ):
        step, ends = 1e-4, []
        for way in (-step, step):
            moved = point.copy()
            moved[i] += way
            ends.append(problem.residuals(moved)[0])
        numeric = (ends[0] - ends[1]).transpose(0, 2, 1, 3)[:, LINES] / (2 * step)
        exact = columns[:, LINES][..., i]
        for rows in (slice(6, 12), slice(12, 18)):
            size = max(abs(exact[..., rows]).max(), 1e-3 * abs(block.measured[..., rows]).max())
            assert abs(numeric[..., rows] - exact[..., rows]).max() < 1e-3 * size, (i, rows)


@pytest.mark.parametrize(
    ("sensors", "gain", "most"), [(BOTH[:1], 0.01, 0.85), (BOTH[1:], 1e-6, 0.3)], ids=["encoder", "torque"]
)
def test_sensors_make_the_stiffness_surer(sensors: tuple[str, ...], gain: float, most: float) -> None:
    """A torque sensor whose gain is known also tells the scale of all torques, which an encoder cannot."""
    plant, nominal = quiet("one_axis_true"), quiet("one_axis")
    record = record_of(plant, np.array([[0.3], [-0.8]]), 4, 5)
    alone, beside = fit_of(record, nominal, ()), fit_of(record, nominal, sensors, arm_side_gain=gain)
    (name,) = nominal.stiffness_names
    errors = [fit.parameters.standard_error[fit.parameters.names.index(name)] for fit in (alone, beside)]
    assert errors[1] < most * errors[0]
    assert abs(beside.parameters.value(name) - plant.parameter(name)) < 3 * errors[1]
    assert beside.misfit == pytest.approx(1.0, abs=0.1)
    assert beside.misfit_table is not None
    assert beside.misfit_table.axis_names == ("axis_1", f"{sensors[0]}.axis_1")
    assert abs(beside.parameters.value(f"delay.{sensors[0]}.axis_1")) < 0.01 * T


def test_a_gain_and_a_delay_of_a_sensor_are_found() -> None:
    plant, nominal = quiet("one_axis_true"), quiet("one_axis")
    record = record_of(plant, np.array([[0.3], [-0.8]]), 4, 6)
    (run,) = record.runs
    link = run.channels["joint_position"]
    moved = link.replace(values=1.005 * np.roll(link.values, 1, axis=4))
    record = record.replace(runs=(run.replace(channels={**run.channels, "joint_position": moved}),))
    table = fit_of(record, nominal, ("joint_position",)).parameters
    gain, late = table.value("gain_error.joint_position.axis_1"), table.value("delay.joint_position.axis_1")
    assert abs(gain - 0.005) < 4 * table.standard_error[table.names.index("gain_error.joint_position.axis_1")]
    assert late == pytest.approx(T, abs=0.02 * T)


def test_axes_without_a_sensor_and_one_that_is_late_are_known() -> None:
    """Of two configurations each sensor is asked for once; a channel four samples late is doubted."""
    robot = quiet("six_axis")
    record = record_of(robot, POSES, 1, 2)
    (run,) = record.runs
    some = run.channels["joint_position"].values.copy()
    some[..., 3:] = np.nan
    fewer = {**run.channels, "joint_position": run.channels["joint_position"].replace(values=some)}
    problem = TorqueResidualFit(arm_side=BOTH, highest_hz=90.0).problem(
        (record.replace(runs=(run.replace(channels=fewer),)),), robot
    )
    assert [(one.channel, one.axis) for one in problem.sensors] == [
        *(("joint_position", axis) for axis in range(3)), *(("joint_torque", axis) for axis in range(6)),
    ]  # fmt: skip
    plant = quiet("one_axis")
    record = record_of(plant, np.array([[0.3]]), 2, 1)
    (run,) = record.runs
    link = run.channels["joint_position"]
    late = {**run.channels, "joint_position": link.replace(values=np.roll(link.values, 4, axis=4))}
    fit = fit_of(record.replace(runs=(run.replace(channels=late),)), plant, BOTH[:1])
    (doubt,) = [str(one) for one in fit.doubts if one.kind == "timing"]
    assert "joint_position of axis_1 lags the angles by" in doubt


def test_what_cannot_be_predicted_is_refused() -> None:
    robot = quiet("one_axis")
    record = record_of(robot, np.array([[0.3]]), 2, 1)
    with pytest.raises(DataRejected, match="sensors: {joint_position_noise"):
        fit_of(record.replace(line=None), robot, BOTH)
    (run,) = record.runs
    bare = record.replace(
        runs=(run.replace(channels={n: c for n, c in run.channels.items() if not n.startswith("joint")}),)
    )
    with pytest.raises(DataRejected, match="no channel joint_torque"):
        fit_of(bare, robot, ("joint_torque",))
    play = robot.with_effect("play", "transmission.backlash", "axis_1")
    with pytest.raises(ConfigurationError, match="leave joint_torque out"):
        fit_of(record, play, ("joint_torque",))


@pytest.mark.full
def test_intervals_of_forty_plants_hold_the_truth() -> None:
    """Stiffness, damping and mass off by what was known of them: squares of errors over stated ones average one."""
    nominal, off = quiet("one_axis"), []
    (name,) = nominal.stiffness_names
    for seed in range(40):
        generator = np.random.default_rng(1000 + seed)
        damping = name.replace("stiffness", "damping")
        moved = {n: nominal.parameter(n) * np.exp(0.2 * generator.standard_normal()) for n in (name, damping)}
        for body in ("mass.axis_1", "rotor_inertia.axis_1"):
            moved[body] = nominal.parameter(body) * np.exp(0.01 * generator.standard_normal())
        plant = nominal.with_parameters(moved)
        record = record_of(plant, np.array([[0.3], [-0.8]]), 2, seed)
        table = fit_of(record, nominal, BOTH).parameters
        error = table.standard_error[table.names.index(name)]
        off.append((table.value(name) - plant.parameter(name)) / error)
    # Chi-square of forty: 0.61 to 1.48 of its mean holds 95 %; intervals that are a little wide are no fault.
    assert 0.4 < np.mean(np.square(off)) < 1.6
    assert (np.abs(off) < 2).sum() >= 34
