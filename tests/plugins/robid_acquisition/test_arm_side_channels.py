"""Sensors behind the gears of a simulated plant: what they show, and what a fit makes of them."""

from __future__ import annotations

import json
import logging
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from robid_acquisition.batch import SimulatedAcquisition
from robid_core import ConfigurationError, Configurations, Context, DataRejected, Fit, Record, Robot
from robid_core.mechanics.feedforward import derivative, joint_torque
from robid_core.stage import map_in_process
from robid_excitation.multisine import Multisine
from robid_fit.torque_residual import TorqueResidualFit

BOTH = ("joint_position", "joint_torque")
INERTIAL = ("link_acceleration", "link_turn_rate")
POSES = np.array([[0.2, -0.6], [0.7, 0.4], [-0.5, 1.1]])
TWO_AXES = """\
robid_robot: 1
name: {name}
bodies:
  - {{joint: shoulder, axis: [0, 1, 0], mass: 38, centre_of_mass: [0.03, 0, 0.32], inertia: [[2.4, 0, 0], [0, 2.2, 0], [0, 0, 0.25]]}}
  - {{joint: elbow, parent: shoulder, axis: [0, 1, 0], translation: [0, 0, 0.7], mass: 17, centre_of_mass: [0.02, 0, 0.28],
     inertia: [[0.7, 0, 0], [0, 0.65, 0], [0, 0, 0.08]]}}
axes:
  shoulder:
    {{gear_ratio: 110, rotor_inertia: 1.6e-3, torque_constant: 1.0, torque_limit: 26, speed_limit: 400, position_limits: [-2, 2],
     gear: {{stiffness: 1.6e+5, damping: 110}}, friction: {{coulomb: 0.6, viscous: 3.0e-3}},
     sensors: {{position_noise: {angle}, torque_noise: {torque}, joint_position_noise: {joint}, joint_torque_noise: {passed}}},
     controller: {{speed_gain: 0.12, integral_gain: 0.96}}}}
  elbow:
    {{gear_ratio: 90, rotor_inertia: 6.0e-4, torque_constant: 1.0, torque_limit: 12, speed_limit: 400, position_limits: [-2, 2],
     {gear}friction: {{coulomb: 0.3, viscous: 1.5e-3}},
     sensors: {{position_noise: {angle}, torque_noise: {torque}, joint_position_noise: {joint}, joint_torque_noise: {passed}}},
     controller: {{speed_gain: 0.045, integral_gain: 0.36}}}}
"""  # noqa: E501
GEAR = "gear: {stiffness: 4.0e+4, damping: 26}, "
NOISE = {"angle": 2e-5, "torque": 0.1, "joint": 5e-6, "passed": 0.5}
QUIET = dict.fromkeys(NOISE, 0.0)


def plant_file(folder: Path, name: str, noise: dict[str, float], gear: str = GEAR) -> Path:
    file = folder / f"{name}.yaml"
    file.write_text(TWO_AXES.format(name=name, gear=gear, **noise))
    return file


def measured(file: Path, **settings: Any) -> Record:
    """Three poses, two experiments each, two periods of two seconds in steady state."""
    robot = Robot.load(file)
    log = logging.getLogger("robid.acquire")
    context = Context(np.random.default_rng(3), map_in_process, lambda *a, **k: None, log)
    where = Configurations(robot.axis_names, POSES)
    multisine = Multisine(band_hz=(4, 60), lines=30, period_s=2.0, blocks=1, slow_sine_rad_s=9.0)
    excitation = multisine.run(where, robot, context)
    stage = SimulatedAcquisition(plant=str(file), periods=2, settle_periods=2, **settings)
    return stage.run(where, excitation, robot, replace(context, generator=np.random.default_rng(4)))


def fitted(record: Record, robot: Robot, **settings: Any) -> Fit:
    context = Context(
        np.random.default_rng(1), map_in_process, lambda *a, **k: None, logging.getLogger("fit")
    )
    return TorqueResidualFit(**settings).run((record,), robot, context)


def test_a_torque_sensor_shows_what_the_arm_needs_for_the_motion_of_the_encoders(tmp_path: Path) -> None:
    """Without noise: ``M q'' + c + g`` of the arm alone, of angles differentiated in steady motion.

    The integrator's implicit midpoint changes inertia torques by (w h)^2 / 12, 7e-4 at 60 Hz, and what the rate of the
    deflection lacks there is 2e-3 of a damper's torque, a tenth of the spring's.
    """
    file = plant_file(tmp_path, "quiet", QUIET)
    robot, record = Robot.load(file), measured(file, arm_side=BOTH)
    assert (record.run.channel("joint_position").side, record.run.channel("joint_torque").unit_symbol) == (
        "joint",
        "N m",
    )
    for c in range(len(POSES)):
        angle = record.run.values("joint_position")[c, 0, 0, -1]
        speed = derivative(angle, robot.sample_time_s, 450.0, periodic=True)
        acceleration = derivative(speed, robot.sample_time_s, 450.0, periodic=True)
        wanted = joint_torque(robot.chain, angle, speed, acceleration)
        shown = record.run.values("joint_torque")[c, 0, 0, -1]
        error = np.sqrt(((shown - wanted) ** 2).mean(axis=0) / (wanted**2).mean(axis=0))
        assert (error < 2e-3).all(), error


def test_motors_measure_the_same_beside_them_and_their_noise_is_that_of_the_file(tmp_path: Path) -> None:
    loud, quiet = (plant_file(tmp_path, name, noise) for name, noise in (("loud", NOISE), ("quiet", QUIET)))
    alone, beside = measured(loud), measured(loud, arm_side=BOTH)
    for name in ("motor_position", "motor_torque"):
        np.testing.assert_array_equal(beside.run.values(name), alone.run.values(name))
    only = measured(loud, arm_side=("joint_torque",))
    np.testing.assert_array_equal(only.run.values("joint_torque"), beside.run.values("joint_torque"))
    assert "joint_position" not in only.run.channels
    without = measured(quiet, arm_side=BOTH)
    # Noise of the motors' encoders moves the joints, too: by less than 1e-6 rad and 0.05 N m here.
    for name, size in (("joint_position", 5e-6), ("joint_torque", 0.5)):
        noise = beside.run.values(name) - without.run.values(name)
        assert noise.std() == pytest.approx(size, rel=0.05), name


def test_a_fit_finds_springs_by_them_with_a_smaller_error(tmp_path: Path) -> None:
    """Residuals of all rows are noise: what the plant shows is what the fit predicts."""
    file = plant_file(tmp_path, "loud", NOISE)
    plant, record = Robot.load(file), measured(file, arm_side=BOTH)
    start = plant.with_parameters({"gear_stiffness.shoulder": 1.3e5, "gear_stiffness.elbow": 4.8e4})
    alone, beside = (fitted(record, start, arm_side=arm_side) for arm_side in ((), BOTH))
    for name in ("gear_stiffness.shoulder", "gear_stiffness.elbow"):
        row = beside.parameters.names.index(name)
        error = beside.parameters.standard_error[row]
        assert abs(beside.parameters.estimate[row] - plant.parameter(name)) < 4 * error
        assert error < 0.9 * alone.parameters.standard_error[alone.parameters.names.index(name)]
    assert beside.misfit == pytest.approx(1.0, abs=0.05)


def with_unit(file: Path, turned: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Path:
    """The same plant with an inertial unit on the forearm, turned by small angles."""
    rotation = Rotation.from_rotvec(turned).as_matrix().tolist()
    unit = {"translation": [0.05, 0.02, 0.4], "rotation": rotation}
    unit |= {"acceleration_noise": 0.02, "turn_rate_noise": 2e-3}
    text = file.read_text()
    at = text.rindex("sensors: {") + len("sensors: {")
    target = file.with_stem(f"{file.stem}_unit_{turned[0]}")
    target.write_text(text[:at] + f"inertial: {json.dumps(unit)}, " + text[at:])
    return target


@pytest.mark.parametrize(
    "repeats", [True, pytest.param(False, marks=pytest.mark.full)], ids=["periods", "cuts"]
)
def test_an_inertial_unit_makes_springs_surer_and_is_found_turned(tmp_path: Path, repeats: bool) -> None:
    """With gravity, friction, a control loop and a slow sine; it is turned by 1 to 2 degrees, unknown to the fit.

    In cuts nobody says that the motion repeats, and the noise is that of the robot file.
    """
    turned = (0.02, -0.03, 0.015)
    file = with_unit(plant_file(tmp_path, "loud", NOISE), turned)
    plant, record = Robot.load(file), measured(file, arm_side=INERTIAL)
    assert record.run.channel("link_acceleration_x").unit_symbol == "m/s^2"
    assert np.isnan(record.run.values("link_turn_rate_z")[..., 0]).all()
    if not repeats:
        record = record.replace(line=None)
    straight = Robot.load(with_unit(plant_file(tmp_path, "told", NOISE)))
    start = straight.with_parameters({"gear_stiffness.shoulder": 1.3e5, "gear_stiffness.elbow": 4.8e4})
    alone, beside = (fitted(record, start, arm_side=arm_side) for arm_side in ((), INERTIAL))
    error_of = {name: beside.parameters.standard_error[i] for i, name in enumerate(beside.parameters.names)}
    for name, most in (("gear_stiffness.shoulder", 0.9), ("gear_stiffness.elbow", 0.5)):
        assert abs(beside.parameters.value(name) - plant.parameter(name)) < 4 * error_of[name]
        assert error_of[name] < most * alone.parameters.standard_error[alone.parameters.names.index(name)]
    seen = 0
    for kind in INERTIAL:
        for direction, angle in zip("xyz", turned, strict=True):
            name = f"mounting.{kind}_{direction}.elbow"
            assert abs(beside.parameters.value(name) - angle) < 4 * error_of[name], name
            seen += error_of[name] < 0.001
    assert (
        seen == 5
    )  # the arm turns in a plane: a gyroscope does not show by how much it is turned about that axis
    assert beside.misfit == pytest.approx(1.0, abs=0.05)


def test_units_that_nobody_stated_and_missing_components_are_refused(tmp_path: Path) -> None:
    file = plant_file(tmp_path, "loud", NOISE)
    stage = SimulatedAcquisition(plant=str(file), arm_side=INERTIAL)
    (problem,) = stage.problems_with(Robot.load(file)).values()
    assert problem.startswith(
        "link_acceleration: no axis of loud has an inertial unit on its link; give one sensors:"
    )
    mounted = with_unit(file)
    record = measured(mounted, arm_side=INERTIAL[:1])
    with pytest.raises(ConfigurationError, match="does not say where the inertial unit on the link of elbow"):
        fitted(record, Robot.load(file), arm_side=INERTIAL[:1])
    (run,) = record.runs
    channels = {name: one for name, one in run.channels.items() if name != "link_acceleration_y"}
    with pytest.raises(DataRejected, match="no channel link_acceleration_y"):
        fitted(
            record.replace(runs=(run.replace(channels=channels),)), Robot.load(mounted), arm_side=INERTIAL[:1]
        )
    half = run.channels["link_acceleration_y"]
    none = half.replace(values=np.full_like(half.values, np.nan))
    channels = {**run.channels, "link_acceleration_y": none}
    with pytest.raises(DataRejected, match="has no link_acceleration_y: units are turned"):
        fitted(
            record.replace(runs=(run.replace(channels=channels),)), Robot.load(mounted), arm_side=INERTIAL[:1]
        )


def test_what_no_spring_passes_on_is_not_shown(tmp_path: Path) -> None:
    stiff = plant_file(tmp_path, "stiff", NOISE, gear="")
    record = measured(stiff, arm_side=BOTH)
    assert np.isnan(record.run.values("joint_torque")[..., 1]).all()
    assert np.isfinite(record.run.values("joint_torque")[..., 0]).all()
    assert np.isfinite(record.run.values("joint_position")).all()
    play = tmp_path / "play.yaml"
    play.write_text(
        plant_file(tmp_path, "loud", NOISE).read_text()
        + "effects:\n  play: {use: transmission.backlash, on: elbow, with: {gap: 1.0e-4}}\n"
    )
    stage = SimulatedAcquisition(plant=str(play), arm_side=BOTH)
    (problem,) = stage.problems_with(Robot.load(play)).values()
    assert problem == (
        "joint_torque is that of springs and dampers of gears, and effects act beside them in loud; leave joint_torque "
        "out"
    )
    with pytest.raises(ConfigurationError, match="leave joint_torque out"):
        measured(play, arm_side=("joint_torque",))
    assert "joint_position" in measured(play, arm_side=("joint_position",)).run.channels
