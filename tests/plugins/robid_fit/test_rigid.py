"""Rigid-body fit: known robots are recovered from motion and torque that pinocchio computes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from robid_core import (
    Channel,
    ConfigurationError,
    DataRejected,
    DenseRun,
    Fit,
    NotIdentifiable,
    Record,
    Robot,
)
from robid_core.testing import check_stage
from robid_fit.mass_matrix import mass_matrix
from robid_fit.rigid import RigidBodyFit
from robid_fit.rigid_model import random_motion, torque_columns

STEP = 1e-3
DRIVE = {"torque_limit": 1e3, "speed_limit": 1e3, "controller": {"speed_gain": 0.1}}
TILT = [[1, 0, 0], [0, 0, -1], [0, 1, 0]]  # turns the z axis into the horizontal
# Two coupled revolute axes and a slide on top, all excited by gravity or motion.
ARM: dict[str, Any] = {
    "robid_robot": 1,
    "name": "arm",
    "bodies": [
        {"joint": "j1", "rotation": TILT, "mass": 8.0, "centre_of_mass": [0.2, 0.05, 0.0],
         "inertia": [[0.1, 0, 0], [0, 0.2, 0], [0, 0, 0.25]]},
        {"joint": "j2", "parent": "j1", "translation": [0.5, 0, 0], "mass": 5.0, "centre_of_mass": [0.15, 0, 0.02],
         "inertia": [[0.05, 0, 0], [0, 0.06, 0], [0, 0, 0.08]]},
        {"joint": "j3", "parent": "j2", "type": "prismatic", "axis": [1, 0, 0], "translation": [0.3, 0, 0], "mass": 2.0,
         "inertia": [[0.01, 0, 0], [0, 0.01, 0], [0, 0, 0.01]]},
    ],
    "axes": {
        f"j{i}": {**DRIVE, "rotor_inertia": j, "friction": {"coulomb": c, "viscous": v, "offset": o, "speed": 0.05}}
        for i, j, c, v, o in ((1, 2e-3, 0.4, 0.02, 0.05), (2, 1e-3, 0.3, 0.01, -0.04), (3, 0.5, 3.0, 5.0, 0.2))
    },
    "coupling": [[0.02, 0, 0], [0.004, -0.025, 0], [0, 0, 1.0]],
}  # fmt: skip


def loaded(folder: Path, data: dict[str, Any]) -> Robot:
    path = folder / f"{data['name']}.yaml"
    path.write_text(json.dumps(data))
    return Robot.load(path.name, folder)


def pinocchio_model(robot: Robot) -> pin.Model:
    chain, model = robot.chain, pin.Model()
    for j in range(chain.n_coordinate):
        axis = chain.axis[j]
        prismatic = chain.joint_type[j] == 1
        joint = pin.JointModelPrismaticUnaligned(axis) if prismatic else pin.JointModelRevoluteUnaligned(axis)
        placement = pin.SE3(chain.rotation[j], chain.translation[j])
        index = model.addJoint(int(chain.parent[j]) + 1, joint, placement, chain.names[j])
        model.appendBodyToJoint(
            index, pin.Inertia(chain.mass[j], chain.centre_of_mass[j], chain.inertia[j]), pin.SE3.Identity()
        )
    model.gravity.linear = chain.gravity
    return model


def waves(
    n_axis: int, size: np.ndarray, seconds: float, seed: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Joint motion as a sum of slow sines, with exact derivatives."""
    draw, time = np.random.default_rng(seed), np.arange(round(seconds / STEP)) * STEP
    omega = 2 * np.pi * draw.uniform(0.2, 1.2, (6, n_axis))
    phase, amplitude = draw.uniform(0, 2 * np.pi, (6, n_axis)), size * draw.uniform(0.2, 1, (6, n_axis))
    angle = omega[None] * time[:, None, None] + phase
    return (
        (amplitude * np.sin(angle)).sum(axis=1),
        (amplitude * omega * np.cos(angle)).sum(axis=1),
        -(amplitude * omega**2 * np.sin(angle)).sum(axis=1),
    )


def recording(
    robot: Robot, seed: int, seconds: float = 20.0, noise: float = 0.0, smooth_friction: bool = True
) -> Record:
    """What a drive would record: the torque comes from pinocchio and from friction written out here."""
    size = np.where(robot.chain.joint_type == 1, 0.05, 0.4)
    q, v, a = waves(robot.n_axis, size, seconds, seed)
    model = pinocchio_model(robot)
    data = model.createData()
    joint_torque = np.array([pin.rnea(model, data, *row) for row in zip(q, v, a, strict=True)])
    motor = [np.linalg.solve(robot.drives.gear, part.T).T for part in (q, v, a)]
    d = robot.drives
    direction = np.tanh(motor[1] / d.friction_speed) if smooth_friction else np.sign(motor[1])
    torque = joint_torque @ d.gear + d.rotor_inertia * motor[2] + d.viscous * motor[1]
    torque = torque + d.coulomb * direction + d.friction_offset
    torque += noise * np.random.default_rng(seed + 1000).normal(size=torque.shape)
    return record_of(robot, motor[0], torque)


def record_of(robot: Robot, position: np.ndarray, torque: np.ndarray, valid: bool = True) -> Record:
    def channel(values: np.ndarray, unit: str) -> Channel:
        return Channel("motor", unit, values[None, None, None, None])

    n = len(position)
    run = DenseRun(
        sample_time_s=STEP,
        channels={"motor_position": channel(position, "rad"), "motor_torque": channel(torque, "N m")},
        time_s=np.arange(n) * STEP,
        valid=np.full((1, 1, 1, 1, n), valid),
    )
    return Record(robot.axis_names, "computed", "continuous", (run,), np.zeros((1, robot.n_axis)))


def relative_deviation(fit: Fit, robot: Robot) -> dict[str, float]:
    known = robot.parameters()
    return {n: v / known[n] - 1 for n, v in fit.parameters.as_mapping().items() if n in known}


def test_a_coupled_arm_with_a_slide_is_recovered(tmp_path: Path) -> None:
    robot = loaded(tmp_path, ARM)
    fit = RigidBodyFit(cutoff_hz=50.0, decimation=20, drop_first=500, drop_last=500).run(
        recording(robot, 1), robot
    )
    assert fit.converged
    # The start values are the truth here: what the file says of dependent parameters is right. Errors left are those
    # of central differences at 1.2 Hz, (w h)^2/3 = 2e-5, of friction that is smoothed, and of the filters' ends.
    table = fit.parameters
    scale = np.maximum(np.abs(table.start), 0.01 * np.abs(table.start).max())
    assert (np.abs(table.estimate - table.start) / scale).max() < 0.02
    for name, deviation in relative_deviation(fit, robot).items():
        assert abs(deviation) < 0.005, name
    assert fit.time[0].relative_error < 2e-3


def test_the_mass_matrix_of_the_estimates_is_pinocchios(tmp_path: Path) -> None:
    robot = loaded(tmp_path, ARM)
    columns = torque_columns(robot, random_motion(robot, 2), robot.drives.friction_speed)
    model, drives = pinocchio_model(robot), robot.drives
    angle = np.random.default_rng(0).uniform(-1, 1, (4, 3))
    found = mass_matrix(robot, columns.value, robot.motor_angle(angle))
    for pose, own in zip(angle, found, strict=True):
        joints = pin.crba(model, model.createData(), pose)
        joints = np.triu(joints) + np.triu(joints, 1).T
        expected = drives.gear.T @ joints @ drives.gear + np.diag(drives.rotor_inertia)
        np.testing.assert_allclose(own, expected, rtol=1e-10, atol=1e-12)


def test_N11_a_torque_of_the_wrong_sign_gives_inertias_that_no_robot_has(tmp_path: Path) -> None:
    robot = loaded(tmp_path, ARM)
    right = recording(robot, 1)
    settings = RigidBodyFit(cutoff_hz=50.0, decimation=20, drop_first=500, drop_last=500)
    assert settings.run(right, robot).doubts == ()
    flipped = record_of(
        robot, *(right.run.values(f"motor_{n}")[0, 0, 0, 0] * s for n, s in (("position", 1), ("torque", -1)))
    )
    (doubt,) = settings.run(flipped, robot).stated_doubts
    assert doubt.kind == "mass matrix"
    assert "not positive in 50 of 50 poses" in doubt.sentence
    assert "sign of torque" in doubt.remedy


def test_what_was_fitted_predicts_another_motion(tmp_path: Path) -> None:
    truth = loaded(tmp_path, ARM)
    wrong = json.loads(json.dumps(ARM))
    wrong["name"] = "nominal"
    for body in wrong["bodies"]:
        body["mass"] *= 1.4
    robot = loaded(tmp_path, wrong)
    settings = RigidBodyFit(cutoff_hz=50.0, decimation=20, drop_first=500, drop_last=500)
    fitted = settings.run(recording(truth, 1), robot).parameters
    # Refit on another motion: base parameters, conditional on the same held ones, must come out alike.
    again = settings.run(recording(truth, 2), robot).parameters
    assert fitted.names == again.names
    scale = np.maximum(np.abs(fitted.estimate), 0.01 * np.abs(fitted.estimate).max())
    assert (np.abs(fitted.estimate - again.estimate) / scale).max() < 0.03
    # The mass of the slide stands alone; the wrong file does not reach it.
    assert fitted.value("mass.j3") == pytest.approx(2.0, rel=0.01)


def test_held_parameters_keep_the_robot_files_values(tmp_path: Path) -> None:
    robot = loaded(tmp_path, ARM)
    record = recording(robot, 3)
    fit = RigidBodyFit(unknowns=("viscous", "coulomb"), cutoff_hz=50.0, decimation=20).run(record, robot)
    assert fit.parameters.names == tuple(
        f"friction.j{i}.{kind}" for kind in ("viscous", "coulomb") for i in (1, 2, 3)
    )
    for name, deviation in relative_deviation(fit, robot).items():
        assert abs(deviation) < 0.005, name


def slide(folder: Path, **changes: Any) -> Robot:
    data = {
        "robid_robot": 1,
        "name": "slide",
        "bodies": [{"joint": "x", "type": "prismatic", "axis": [1, 0, 0], "mass": 90.0}],
        "axes": {"x": {**DRIVE, "rotor_inertia": 5.0, "friction": {"coulomb": 20.0, "viscous": 200.0, "offset": -3.0,
                                                                 "speed": 1e-3}}},
        **changes,
    }  # fmt: skip
    return loaded(folder, data)


def test_rotor_inertia_of_a_slide_goes_with_its_mass_and_keeps_its_value(tmp_path: Path) -> None:
    robot = slide(tmp_path)
    fit = RigidBodyFit(cutoff_hz=50.0).run(recording(robot, 4), robot)
    assert fit.parameters.names == ("mass.x", "friction.x.viscous", "friction.x.coulomb", "friction.x.offset")
    assert fit.parameters.units == ("kg", "N s/m", "N", "N")
    assert fit.parameters.groups == ("inertia", "friction", "friction", "friction")
    # Of 95 kg in motion, 5 kg stand in the file as the rotor's.
    assert fit.parameters.value("mass.x") == pytest.approx(90.0, rel=1e-3)
    assert robot.with_parameters(fit.parameters.as_mapping()).parameters()["mass.x"] == fit.parameters.value(
        "mass.x"
    )


def test_standard_errors_cover_the_truth(tmp_path: Path) -> None:
    robot = slide(tmp_path)
    true = np.array([90.0, 200.0, 20.0, -3.0])
    clean = recording(robot, 5, seconds=5.0, smooth_friction=False)
    draw = np.random.default_rng(6)
    settings = RigidBodyFit(cutoff_hz=50.0, friction_speed=0.0)
    bias = settings.run(clean, robot).parameters.estimate - true
    normalised = []
    for _ in range(50):
        values = clean.run.values("motor_torque")[0, 0, 0, 0]
        position = clean.run.values("motor_position")[0, 0, 0, 0]
        noisy = record_of(robot, position, values + draw.normal(size=values.shape))
        table = settings.run(noisy, robot).parameters
        normalised.append((table.estimate - true - bias) / table.standard_error)
    # White torque noise, band-limited and decimated by ten, is white again but for the filter's edge: the mean of 200
    # squares scatters by 0.1 about 1.
    assert np.mean(np.square(normalised)) == pytest.approx(1.0, abs=0.35)


def test_smooth_friction_of_the_robot_file_is_the_default(tmp_path: Path) -> None:
    robot = slide(tmp_path, axes={"x": {**DRIVE, "rotor_inertia": 5.0, "friction": {
        "coulomb": 20.0, "viscous": 200.0, "offset": -3.0, "speed": 0.1}}})  # fmt: skip
    record = recording(robot, 7)
    smooth = RigidBodyFit(cutoff_hz=50.0).run(record, robot)
    plain = RigidBodyFit(cutoff_hz=50.0, friction_speed=0.0).run(record, robot)
    assert smooth.parameters.value("friction.x.coulomb") == pytest.approx(20.0, rel=1e-3)
    assert plain.time[0].relative_error > 10 * smooth.time[0].relative_error


def test_the_comparison_shows_measured_and_predicted_force_at_the_kept_samples(tmp_path: Path) -> None:
    robot = slide(tmp_path)
    record = recording(robot, 8, seconds=3.0, noise=1.0)
    (time,) = RigidBodyFit(cutoff_hz=50.0, drop_first=100, drop_last=200).run(record, robot).time
    # Samples 100 to 2799 are kept, and of these the last of every ten.
    np.testing.assert_allclose(time.time_s, np.arange(109, 2800, 10) * STEP)
    error = np.linalg.norm(time.measured - time.modelled) / np.linalg.norm(time.measured)
    assert time.relative_error == pytest.approx(error)
    # Noise of 1 N in a tenth of the band.
    assert (time.measured - time.modelled).std() == pytest.approx(np.sqrt(0.08), rel=0.2)


def test_an_axis_that_stands_still_cannot_be_identified(tmp_path: Path) -> None:
    robot = slide(tmp_path)
    n = 4000
    record = record_of(robot, np.zeros((n, 1)), np.ones((n, 1)))
    with pytest.raises(
        NotIdentifiable, match=r"does not excite mass\.x, friction\.x\.viscous, friction\.x\.coulomb"
    ):
        RigidBodyFit().run(record, robot)


def test_torque_of_the_wrong_sign_does_not_pass_as_a_robot(tmp_path: Path) -> None:
    robot = slide(tmp_path)
    good = recording(robot, 9)
    values = good.run.values("motor_torque")[0, 0, 0, 0]
    record = record_of(robot, good.run.values("motor_position")[0, 0, 0, 0], -values)
    fit = RigidBodyFit(cutoff_hz=50.0).run(record, robot)
    assert not fit.converged
    assert fit.status.startswith("not physical: mass.x, friction.x.viscous, friction.x.coulomb negative")


def test_torque_that_has_nothing_to_do_with_the_motion_is_not_a_fit(tmp_path: Path) -> None:
    robot = slide(tmp_path)
    good = recording(robot, 10)
    position = good.run.values("motor_position")[0, 0, 0, 0]
    torque = 1e3 * np.sin(2 * np.pi * 7 * np.arange(len(position)) * STEP)[:, None]
    fit = RigidBodyFit(cutoff_hz=50.0).run(record_of(robot, position, torque), robot)
    assert not fit.converged


def test_holes_and_short_recordings_are_rejected(tmp_path: Path) -> None:
    robot = slide(tmp_path)
    values = np.random.default_rng(0).normal(size=(105, 1))
    with pytest.raises(DataRejected, match="105 samples only"):
        RigidBodyFit().run(record_of(robot, values, values), robot)
    values = np.random.default_rng(0).normal(size=(1000, 1))
    with pytest.raises(DataRejected, match="holes"):
        RigidBodyFit().run(record_of(robot, values, values, valid=False), robot)


def test_the_same_record_gives_the_same_bytes(tmp_path: Path) -> None:
    robot = slide(tmp_path)
    record = recording(robot, 11, seconds=3.0, noise=1.0)
    first, second = (RigidBodyFit(cutoff_hz=50.0).run(record, robot) for _ in range(2))
    assert first.parameters.estimate.tobytes() == second.parameters.estimate.tobytes()
    assert first.covariance.tobytes() == second.covariance.tobytes()


def test_the_stage_keeps_the_contract() -> None:
    # The example record moves too little to tell all inertias of six axes apart; friction it shows.
    check_stage(RigidBodyFit, unknowns=("viscous", "coulomb"), cutoff_hz=80.0, decimation=5)


def test_elastic_coordinates_do_not_take_the_mass_away_from_its_joint(tmp_path: Path) -> None:
    stiff = loaded(tmp_path, ARM)
    bearing = {"joint": "j1", "axis": [1.0, 0.0, 0.0], "stiffness": 1e5, "damping": 10.0}
    elastic = loaded(tmp_path, {**ARM, "name": "elastic", "bearings": {"j1_x": bearing}})
    record = recording(stiff, 1, seconds=5.0)
    first, second = (RigidBodyFit(cutoff_hz=50.0).run(record, robot).parameters for robot in (stiff, elastic))
    assert first.names == second.names
    np.testing.assert_allclose(first.estimate, second.estimate, rtol=1e-9)
    np.testing.assert_array_equal(first.start, second.start)


@pytest.mark.parametrize(
    ("effect", "unknowns", "told"),
    [
        ({"use": "friction.stribeck", "on": "j2"}, ("inertia",), r"grease \(friction.stribeck\)"),
        ({"use": "load.cable_spring", "on": "j1"}, ("inertia",), "load.cable_spring"),
        ({"use": "drive.torque_ripple", "on": "j1"}, ("coulomb",), "drive.torque_ripple"),
        ({"use": "structure.foundation"}, ("viscous",), "structure.foundation"),
        ({"use": "structure.elastic_coordinate", "on": "j1", "with": {"axis_x": 1, "axis_z": 0}}, ("viscous",),
         "structure.elastic_coordinate"),
        ({"use": "load.payload", "on": "j2"}, ("inertia", "coulomb"), "a payload into the bodies"),
        ({"use": "drive.rotor_inertia", "on": "j1"}, ("rotor_inertia",), "drive.rotor_inertia"),
    ],
)  # fmt: skip
def test_effects_that_the_fit_would_ignore_or_count_twice_are_refused_by_name(
    tmp_path: Path, effect: dict[str, Any], unknowns: Any, told: str
) -> None:
    bare, robot = loaded(tmp_path, ARM), loaded(tmp_path, {**ARM, "effects": {"grease": effect}})
    with pytest.raises(ConfigurationError, match=told):
        RigidBodyFit(unknowns=unknowns).run(recording(bare, 1, seconds=1.0), robot)


def test_a_payload_is_known_where_inertia_is_not_estimated(tmp_path: Path) -> None:
    bare = loaded(tmp_path, ARM)
    tool = {"use": "load.payload", "on": "j2", "with": {"mass": 4, "x": 0.3}}
    robot = loaded(tmp_path, {**ARM, "name": "loaded", "effects": {"tool": tool}})
    record = recording(robot, 3)
    settings = RigidBodyFit(unknowns=("viscous", "coulomb"), cutoff_hz=50.0, decimation=20)
    told, untold = settings.run(record, robot), settings.run(record, bare)
    for deviation in relative_deviation(told, robot).values():
        assert abs(deviation) < 0.005
    assert untold.time[0].relative_error > 20 * told.time[0].relative_error


def test_the_model_has_the_bodies_that_were_measured(tmp_path: Path) -> None:
    """First moments and inertias about the joints are no numbers of a robot file: masses, centres and moments are."""
    truth = loaded(tmp_path, ARM)
    wrong = json.loads(json.dumps(ARM))
    wrong["name"] = "nominal"
    for body in wrong["bodies"]:
        body["mass"] *= 1.2
        body["centre_of_mass"] = [1.1 * x for x in body.get("centre_of_mass", [0, 0, 0])]
    robot = loaded(tmp_path, wrong)
    settings = RigidBodyFit(cutoff_hz=50.0, decimation=20, drop_first=500, drop_last=500)
    model = settings.run(recording(truth, 1, noise=0.02), robot).model
    assert model is not None
    assert model.left_out == ()
    found = Robot.of_model(model)
    angle = np.random.default_rng(3).uniform(-0.5, 0.5, (20, 3)) * [1, 1, 0.05]
    (right, heavy), (ours, moved) = (
        (each.gravity_torque(angle), each.second_order(angle).mass) for each in (truth, found)
    )
    # The motion shows every base parameter to better than a percent; told were 20 % more.
    np.testing.assert_allclose(ours, right, atol=0.01 * np.abs(right).max())
    np.testing.assert_allclose(moved, heavy, atol=0.01 * np.abs(heavy).max())
    told = robot.gravity_torque(angle)
    assert np.abs(told - right).max() > 0.1 * np.abs(right).max()
    errors = model.standard_errors()
    assert errors["mass.j3"] > 0
    assert abs(found.parameter("mass.j3") - 2.0) < 5 * errors["mass.j3"]


def test_friction_that_scatters_below_zero_is_none_in_the_model(tmp_path: Path) -> None:
    told = {"coulomb": 0.0, "viscous": 200.0, "offset": -3.0, "speed": 1e-3}
    robot = slide(tmp_path, axes={"x": {**DRIVE, "rotor_inertia": 5.0, "friction": told}})
    record = recording(robot, 12, seconds=5.0, noise=1.0)
    values = record.run.values("motor_torque")[0, 0, 0, 0]
    position = record.run.values("motor_position")[0, 0, 0, 0]
    push = 0.05 * np.sign(np.gradient(position, axis=0))  # the other way: a level of -0.05 N
    fit = RigidBodyFit(cutoff_hz=50.0).run(record_of(robot, position, values - push), robot)
    assert fit.parameters.value("friction.x.coulomb") < 0
    assert fit.model is not None
    assert Robot.of_model(fit.model).parameter("friction.x.coulomb") == 0.0
    assert fit.model.standard_errors()["friction.x.coulomb"] > 0
    assert fit.model.left_out == ()


def test_a_body_that_cannot_be_stays_as_it_was_and_is_named(tmp_path: Path) -> None:
    robot = slide(tmp_path)
    good = recording(robot, 9)
    values = good.run.values("motor_torque")[0, 0, 0, 0]
    fit = RigidBodyFit(cutoff_hz=50.0).run(
        record_of(robot, good.run.values("motor_position")[0, 0, 0, 0], -values), robot
    )
    assert fit.model is not None
    assert fit.model.left_out == ("mass.x",)
    assert Robot.of_model(fit.model).parameter("mass.x") == 90.0
