"""Rigid-body fit: known robots are recovered from motion and torque that pinocchio computes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from oracles.rigid_arm import ARM, DRIVE, STEP, loaded, record_of, recording, slide

from robid_core import ConfigurationError, DataRejected, Fit, FloatArray, NotIdentifiable, Robot
from robid_core.commands.show import artifact_lines
from robid_core.testing import check_stage
from robid_fit.rigid import RigidBodyFit


def relative_deviation(fit: Fit, robot: Robot) -> dict[str, float]:
    known = robot.parameters()
    return {n: v / known[n] - 1 for n, v in fit.parameters.as_mapping().items() if known[n]}


def test_a_coupled_arm_with_a_slide_is_recovered(tmp_path: Path) -> None:
    robot = loaded(tmp_path, ARM)
    fit = RigidBodyFit(cutoff_hz=50.0, decimation=20, drop_first=500, drop_last=500).run(
        (recording(robot, 1),), robot
    )
    assert fit.converged
    # The start values are the truth here. Errors left are those of central differences at 1.2 Hz, (w h)^2/3 = 2e-5, of
    # friction that is smoothed, and of the filters' ends.
    assert fit.base is not None
    for table in (fit.base, fit.parameters):
        scale = np.maximum(np.abs(table.start), 0.01 * np.abs(table.start).max())
        assert (np.abs(table.estimate - table.start) / scale).max() < 0.02
    assert fit.parameters.standard_error[fit.parameters.names.index("mass.j3")] < 0.01
    assert fit.time[0].relative_error < 2e-3


def test_a_torque_of_the_wrong_sign_gives_no_fit_and_still_a_robot_that_can_be(tmp_path: Path) -> None:
    robot = loaded(tmp_path, ARM)
    right = recording(robot, 1, noise=0.05)
    settings = RigidBodyFit(cutoff_hz=50.0, decimation=20, drop_first=500, drop_last=500)
    assert [doubt.kind for doubt in settings.run((right,), robot).doubts] == []
    flipped = record_of(
        robot, *(right.run.values(f"motor_{n}")[0, 0, 0, 0] * s for n, s in (("position", 1), ("torque", -1)))
    )
    fit = settings.run((flipped,), robot)
    assert not fit.converged
    assert "more than half of the torque unexplained" in fit.status
    assert {doubt.kind for doubt in fit.doubts} >= {"convergence", "tolerance"}
    assert fit.model is not None
    angle = np.random.default_rng(0).uniform(-3, 3, (200, 3)) * [1, 1, 0.1]
    assert (np.linalg.eigvalsh(Robot.of_model(fit.model).second_order(angle).mass) > 0).all()


def test_the_mass_matrix_is_positive_everywhere_however_little_a_motion_shows(tmp_path: Path) -> None:
    """Base parameters alone, by least squares, have a negative eigenvalue somewhere in 9 of 10 such records."""
    truth = loaded(tmp_path, ARM)
    wrong = json.loads(json.dumps(ARM))
    wrong["name"] = "nominal"
    for body in wrong["bodies"]:
        body["mass"] *= 1.5
        body["centre_of_mass"] = [0.6 * x for x in body.get("centre_of_mass", [0, 0, 0])]
    robot = loaded(tmp_path, wrong)
    offsets = (
        "friction.*.offset",
    )  # an axis that turns one way only does not tell them from Coulomb's level
    settings = RigidBodyFit(cutoff_hz=50.0, decimation=20, drop_first=100, drop_last=100, fixed=offsets)
    angle = np.random.default_rng(0).uniform(-3, 3, (300, 3)) * [1, 1, 0.1]
    for seed in range(5):
        fit = settings.run((recording(truth, seed, seconds=1.0, noise=0.3),), robot)
        assert fit.model is not None
        assert (np.linalg.eigvalsh(Robot.of_model(fit.model).second_order(angle).mass) > 0).all()


def test_what_was_fitted_predicts_another_motion(tmp_path: Path) -> None:
    truth = loaded(tmp_path, ARM)
    wrong = json.loads(json.dumps(ARM))
    wrong["name"] = "nominal"
    for body in wrong["bodies"]:
        body["mass"] *= 1.4
    robot = loaded(tmp_path, wrong)
    settings = RigidBodyFit(cutoff_hz=50.0, decimation=20, drop_first=500, drop_last=500)
    fitted = settings.run((recording(truth, 1),), robot).base
    again = settings.run((recording(truth, 2),), robot).base
    assert fitted is not None
    assert again is not None
    assert fitted.names == again.names
    scale = np.maximum(np.abs(fitted.estimate), 0.01 * np.abs(fitted.estimate).max())
    assert (np.abs(fitted.estimate - again.estimate) / scale).max() < 0.03
    # The mass of the slide stands alone; the wrong file does not reach it.
    assert fitted.value("mass.j3") == pytest.approx(2.0, rel=0.01)
    known = settings.run((recording(truth, 1),), truth).base
    assert known is not None
    assert (np.abs(fitted.estimate - known.start) / scale).max() < 0.03


def test_held_parameters_keep_the_robot_files_values(tmp_path: Path) -> None:
    robot = loaded(tmp_path, ARM)
    record = recording(robot, 3)
    fit = RigidBodyFit(unknowns=("viscous", "coulomb"), cutoff_hz=50.0, decimation=20).run((record,), robot)
    assert tuple(fit.parameters.as_mapping()) == tuple(
        f"friction.j{i}.{kind}" for kind in ("speed", "viscous", "coulomb") for i in (1, 2, 3)
    )
    for name, deviation in relative_deviation(fit, robot).items():
        assert abs(deviation) < 0.005, name


def test_rotor_inertia_of_a_slide_goes_with_its_mass_and_keeps_its_value(tmp_path: Path) -> None:
    robot = slide(tmp_path)
    fit = RigidBodyFit(cutoff_hz=50.0).run((recording(robot, 4),), robot)
    assert fit.base is not None
    assert fit.base.names == ("mass.x", "friction.x.viscous", "friction.x.coulomb", "friction.x.offset")
    assert fit.base.units == ("kg", "N s/m", "N", "N")
    assert fit.base.groups == ("inertia", "friction", "friction", "friction")
    # Of 95 kg in motion, 5 kg stand in the file as the rotor's; the sum is known, the shares to a tenth of the rotor's.
    assert fit.base.value("mass.x") == pytest.approx(95.0, rel=1e-3)
    assert fit.base.standard_error[0] < 0.01
    error = dict(zip(fit.parameters.names, fit.parameters.standard_error.tolist(), strict=True))
    assert error["mass.x"] == pytest.approx(error["rotor_inertia.x"], rel=0.05)
    assert error["rotor_inertia.x"] == pytest.approx(0.5, rel=0.05)
    assert fit.parameters.value("mass.x") == pytest.approx(90.0, rel=1e-3)


@pytest.mark.parametrize("repeats", [12, pytest.param(50, marks=pytest.mark.full)])
def test_standard_errors_cover_the_truth(tmp_path: Path, repeats: int) -> None:
    robot = slide(tmp_path)
    true = np.array([95.0, 200.0, 20.0, -3.0])
    clean = recording(robot, 5, seconds=5.0, smooth_friction=False)
    draw = np.random.default_rng(6)
    settings = RigidBodyFit(cutoff_hz=50.0, friction_speed=0.0)
    bias = settings.run((clean,), robot).base.estimate - true
    normalised = []
    for _ in range(repeats):
        values = clean.run.values("motor_torque")[0, 0, 0, 0]
        position = clean.run.values("motor_position")[0, 0, 0, 0]
        noisy = record_of(robot, position, values + draw.normal(size=values.shape))
        table = settings.run((noisy,), robot).base
        normalised.append((table.estimate - true - bias) / table.standard_error)
    # White torque noise, band-limited and decimated by ten, is white again but for the filter's edge: the mean of four
    # squares a record scatters by sqrt(2 / (4 repeats)) about 1: 0.1 of 50 records.
    assert np.mean(np.square(normalised)) == pytest.approx(1.0, abs=3.5 * np.sqrt(0.5 / repeats))


def test_smooth_friction_of_the_robot_file_is_the_default(tmp_path: Path) -> None:
    robot = slide(tmp_path, axes={"x": {**DRIVE, "rotor_inertia": 5.0, "friction": {
        "coulomb": 20.0, "viscous": 200.0, "offset": -3.0, "speed": 0.1}}})  # fmt: skip
    record = recording(robot, 7)
    smooth = RigidBodyFit(cutoff_hz=50.0).run((record,), robot)
    plain = RigidBodyFit(cutoff_hz=50.0, friction_speed=0.0).run((record,), robot)
    assert smooth.parameters.value("friction.x.coulomb") == pytest.approx(20.0, rel=1e-3)
    assert plain.time[0].relative_error > 10 * smooth.time[0].relative_error


def test_the_comparison_shows_measured_and_predicted_force_at_the_kept_samples(tmp_path: Path) -> None:
    robot = slide(tmp_path)
    record = recording(robot, 8, seconds=3.0, noise=1.0)
    (time,) = RigidBodyFit(cutoff_hz=50.0, drop_first=100, drop_last=200).run((record,), robot).time
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
        RigidBodyFit().run((record,), robot)


def test_torque_of_the_wrong_sign_does_not_pass_as_a_robot(tmp_path: Path) -> None:
    robot = slide(tmp_path)
    good = recording(robot, 9)
    values = good.run.values("motor_torque")[0, 0, 0, 0]
    record = record_of(robot, good.run.values("motor_position")[0, 0, 0, 0], -values)
    fit = RigidBodyFit(cutoff_hz=50.0).run((record,), robot)
    assert not fit.converged
    assert fit.parameters.value("mass.x") > 0
    at_bound = [n for n, own in zip(fit.parameters.names, fit.parameters.at_bound, strict=True) if own]
    assert at_bound[-2:] == ["friction.x.viscous", "friction.x.coulomb"]


def test_torque_that_has_nothing_to_do_with_the_motion_is_not_a_fit(tmp_path: Path) -> None:
    robot = slide(tmp_path)
    good = recording(robot, 10)
    position = good.run.values("motor_position")[0, 0, 0, 0]
    torque = 1e3 * np.sin(2 * np.pi * 7 * np.arange(len(position)) * STEP)[:, None]
    fit = RigidBodyFit(cutoff_hz=50.0).run((record_of(robot, position, torque),), robot)
    assert not fit.converged


def test_an_axis_of_which_a_third_is_left_is_doubted_by_name(tmp_path: Path) -> None:
    """A wave of 3 Hz, half of the axis' torque, that no body or friction of the robot makes."""
    robot = loaded(tmp_path, ARM)
    run = recording(robot, 3, seconds=10.0, noise=0.01).run
    position, torque = (run.values(name)[0, 0, 0, 0] for name in ("motor_position", "motor_torque"))
    fit = RigidBodyFit(cutoff_hz=20.0)
    assert not [
        one
        for one in fit.run((record_of(robot, position, torque),), robot).doubts
        if one.kind == "unexplained torque"
    ]
    wave = np.zeros_like(torque)
    wave[:, 1] = 0.5 * np.sqrt(2) * torque[:, 1].std() * np.sin(2 * np.pi * 3 * np.arange(len(torque)) * STEP)
    (doubt,) = [
        one
        for one in fit.run((record_of(robot, position, torque + wave),), robot).doubts
        if one.kind == "unexplained torque"
    ]
    assert not doubt.is_remark
    assert doubt.sentence.startswith("of some torques much is left: j2 ")


def test_the_spread_over_runs_stands_beside_stated_errors(tmp_path: Path) -> None:
    """Friction that is another one in each of eight runs: its stated error does not know, the spread does."""
    robot, draw = loaded(tmp_path, ARM), np.random.default_rng(5)
    runs, levels = list[tuple[FloatArray, FloatArray]](), draw.normal(0.0, 0.1, 8)
    for seed, more in enumerate(levels):
        run = recording(robot, seed, seconds=6.0, noise=0.01).run
        position, torque = (run.values(name)[0, 0, 0, 0] for name in ("motor_position", "motor_torque"))
        torque = torque.copy()
        torque[:, 0] += more * np.tanh(np.gradient(position[:, 0], STEP) / 0.05)
        runs.append((position, torque))
    fit = RigidBodyFit(cutoff_hz=20.0).run(tuple(record_of(robot, *one) for one in runs), robot)
    table = fit.parameters
    assert table.spread is not None
    stated = dict(zip(table.names, zip(table.standard_error, table.spread, strict=True), strict=True))
    error, spread = stated["friction.j1.coulomb"]
    assert spread > 3 * error
    # Eight levels: their standard error, which scatters by a quarter of itself.
    assert spread == pytest.approx(levels.std(ddof=1) / np.sqrt(8), rel=0.3)
    error, spread = stated["friction.j3.coulomb"]
    assert 0.3 < spread / error < 2.0
    assert "by experiments" in "\n".join(artifact_lines(fit))


def test_holes_and_short_recordings_are_rejected(tmp_path: Path) -> None:
    robot = slide(tmp_path)
    values = np.random.default_rng(0).normal(size=(105, 1))
    with pytest.raises(DataRejected, match="105 samples only"):
        RigidBodyFit().run((record_of(robot, values, values),), robot)
    values = np.random.default_rng(0).normal(size=(1000, 1))
    missing = record_of(robot, values, values, valid=False)
    with pytest.raises(
        DataRejected, match="fit.rigid: no piece of computed between its gaps .*; lower drop_first"
    ):
        RigidBodyFit().run((missing,), robot)
    with pytest.raises(DataRejected, match="fit.rigid: position has holes; .*gaps: split"):
        RigidBodyFit().run((missing.replace(line=np.array([3])),), robot)


def test_a_record_with_masked_samples_is_fitted_as_its_pieces_are(tmp_path: Path) -> None:
    """Pieces of 7.9 and 11 s; one of 0.05 s is too short to count."""
    robot = slide(tmp_path)
    whole = recording(robot, 11, seconds=20.0, noise=1.0)
    known = np.ones(len(whole.run.time_s), dtype=bool)
    known[7900:8900] = False
    known[8400:8450] = True
    values = [
        np.where(known[:, None], whole.run.values(f"motor_{name}")[0, 0, 0, 0], np.nan)
        for name in ("position", "torque")
    ]
    masked = record_of(robot, *values)
    masked = masked.replace(runs=(masked.run.replace(valid=known[None, None, None, None]),))
    parts = tuple(
        record_of(robot, *(one[cut] for one in values)) for cut in (slice(0, 7900), slice(8900, None))
    )
    settings = RigidBodyFit(cutoff_hz=50.0)
    found, by_hand = settings.run((masked,), robot), settings.run(parts, robot)
    np.testing.assert_array_equal(found.parameters.estimate, by_hand.parameters.estimate)
    np.testing.assert_array_equal(found.covariance, by_hand.covariance)
    assert found.parameters.as_mapping()["mass.x"] == pytest.approx(90.0, rel=0.01)


def test_the_same_record_gives_the_same_bytes(tmp_path: Path) -> None:
    robot = slide(tmp_path)
    record = recording(robot, 11, seconds=3.0, noise=1.0)
    first, second = (RigidBodyFit(cutoff_hz=50.0).run((record,), robot) for _ in range(2))
    assert first.parameters.estimate.tobytes() == second.parameters.estimate.tobytes()
    assert first.covariance.tobytes() == second.covariance.tobytes()


@pytest.mark.parametrize("for_axes", [(1, 2), pytest.param((6,), marks=pytest.mark.full)])
def test_the_stage_keeps_the_contract(for_axes: tuple[int, ...]) -> None:
    # The example record moves too little to tell all inertias of six axes apart; friction it shows.
    settings: dict[str, Any] = {"unknowns": ("viscous", "coulomb"), "cutoff_hz": 80.0, "decimation": 5}
    check_stage(RigidBodyFit, for_axes=for_axes, recovery=False, **settings)


def test_elastic_coordinates_do_not_take_the_mass_away_from_its_joint(tmp_path: Path) -> None:
    stiff = loaded(tmp_path, ARM)
    bearing = {"joint": "j1", "axis": [1.0, 0.0, 0.0], "stiffness": 1e5, "damping": 10.0}
    elastic = loaded(tmp_path, {**ARM, "name": "elastic", "bearings": {"j1_x": bearing}})
    record = recording(stiff, 1, seconds=5.0)
    first, second = (
        RigidBodyFit(cutoff_hz=50.0).run((record,), robot).parameters for robot in (stiff, elastic)
    )
    assert first.names == second.names
    np.testing.assert_allclose(first.estimate, second.estimate, rtol=1e-9)
    np.testing.assert_array_equal(first.start, second.start)


@pytest.mark.parametrize(
    ("effect", "told"),
    [
        ({"use": "transmission.backlash", "on": "j1"}, r"grease \(transmission.backlash\)"),
        ({"use": "sensing.resolver_ripple", "on": "j1"}, "sensing.resolver_ripple"),
        ({"use": "drive.torque_ripple", "on": "j1", "with": {"relative": 0.1}}, "in proportion to the torque"),
        ({"use": "structure.foundation"}, "structure.foundation"),
        ({"use": "structure.elastic_coordinate", "on": "j1", "with": {"axis_x": 1, "axis_z": 0}},
         "structure.elastic_coordinate"),
    ],
)  # fmt: skip
def test_effects_that_mean_nothing_in_a_rigid_robot_are_refused_by_name(
    tmp_path: Path, effect: dict[str, Any], told: str
) -> None:
    axes = {name: {**axis, "gear": {"stiffness": 1e5, "damping": 1.0}} for name, axis in ARM["axes"].items()}
    bare = loaded(tmp_path, ARM)
    robot = loaded(tmp_path, {**ARM, "name": "elastic", "axes": axes, "effects": {"grease": effect}})
    with pytest.raises(ConfigurationError, match=told):
        RigidBodyFit().run((recording(bare, 1, seconds=1.0),), robot)


@pytest.mark.parametrize("unknowns", [("viscous", "coulomb"), ("inertia", "viscous", "coulomb")])
def test_a_payload_is_known(tmp_path: Path, unknowns: Any) -> None:
    bare = loaded(tmp_path, ARM)
    tool = {"use": "load.payload", "on": "j2", "with": {"mass": 4, "x": 0.3}}
    robot = loaded(tmp_path, {**ARM, "name": "loaded", "effects": {"tool": tool}})
    record = recording(robot, 3)
    settings = RigidBodyFit(unknowns=unknowns, cutoff_hz=50.0, decimation=20, drop_first=200, drop_last=200)
    told, untold = settings.run((record,), robot), settings.run((record,), bare)
    for name, deviation in relative_deviation(told, robot).items():
        assert abs(deviation) < 0.005, name
    if "inertia" in unknowns:
        # The body of the fourth kilogram more is found where nobody told of it.
        assert untold.parameters.value("mass.j2") > 1.2 * robot.parameter("mass.j2")
    else:
        assert untold.time[0].relative_error > 20 * told.time[0].relative_error


def test_a_payload_that_the_record_states_is_known(tmp_path: Path) -> None:
    """The robot file says one kilogram and the table four: as good as a file that says four, to the last digit."""
    tool = {"use": "load.payload", "on": "j2", "with": {"mass": 4, "x": 0.3}}
    truth = loaded(tmp_path, {**ARM, "name": "loaded", "effects": {"tool": tool}})
    nominal = truth.with_parameters({"effect.tool.mass": 1.0})
    record = recording(truth, 3, seconds=5.0)
    run = record.run.replace(constant_names=("payload_kg",), constants=np.full((1, 1, 1, 1), 4.0))
    settings = RigidBodyFit(unknowns=("viscous", "coulomb"), cutoff_hz=50.0, decimation=20)
    stated = settings.model_copy(update={"constants": {"payload_kg": "effect.tool.mass"}})
    fit = stated.run((record.replace(runs=(run,)),), nominal)
    assert fit.parameters.estimate.tolist() == settings.run((record,), truth).parameters.estimate.tolist()
    assert fit.model is not None
    assert Robot.of_model(fit.model).parameter("effect.tool.mass") == 4.0
    with pytest.raises(DataRejected, match="payload_kg"):
        stated.run((record,), nominal)


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
    model = settings.run((recording(truth, 1, noise=0.02),), robot).model
    assert model is not None
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
    fit = RigidBodyFit(cutoff_hz=50.0).run((record_of(robot, position, values - push),), robot)
    assert fit.parameters.value("friction.x.coulomb") == 0
    assert fit.parameters.at_bound[fit.parameters.names.index("friction.x.coulomb")]
    assert fit.model is not None
    assert Robot.of_model(fit.model).parameter("friction.x.coulomb") == 0.0
    assert fit.model.standard_errors()["friction.x.coulomb"] > 0


def test_friction_that_one_speed_in_one_direction_cannot_tell_apart_is_refused(tmp_path: Path) -> None:
    robot = slide(tmp_path)
    n = 4000
    time = np.arange(n) * STEP
    still = 1e-3 * np.sin(2 * np.pi * 5 * time)[:, None]  # enough to show the mass, too little to turn round
    position = 0.2 * time[:, None] + still
    speed, acceleration = (
        np.gradient(position, STEP, axis=0),
        np.gradient(np.gradient(position, STEP, axis=0), STEP, axis=0),
    )
    force = 95.0 * acceleration + 200.0 * speed + 20.0 - 3.0
    force = force + 0.1 * np.random.default_rng(1).standard_normal(force.shape)
    with pytest.raises(NotIdentifiable, match=r"friction\.x\.coulomb, friction\.x\.offset"):
        RigidBodyFit(cutoff_hz=50.0).run((record_of(robot, position, force),), robot)
    held = RigidBodyFit(cutoff_hz=50.0, fixed=("friction.x.offset",)).run(
        (record_of(robot, position, force),), robot
    )
    assert held.parameters.value("friction.x.coulomb") == pytest.approx(20.0, abs=1.0)


@pytest.mark.parametrize("fixed", ["rotor_inertia.*", "centre_of_mass.*"])
def test_what_is_held_needs_no_tolerance(tmp_path: Path, fixed: str) -> None:
    robot = loaded(tmp_path, ARM)
    settings = RigidBodyFit(cutoff_hz=50.0, decimation=20, drop_first=500, drop_last=500, fixed=(fixed,))
    fit = settings.run((recording(robot, 1),), robot)
    assert fit.converged
    assert not [name for name in fit.parameters.names if name.startswith(fixed[:-1])]


def test_one_block_left_out_is_nothing_to_fit_to() -> None:
    with pytest.raises(ValueError, match="greater than or equal to 2"):
        RigidBodyFit(blocks=1)


def test_essential_parameters_predict_as_well_with_fewer(tmp_path: Path) -> None:
    robot = loaded(tmp_path, ARM)
    record = recording(robot, 1, seconds=6.0, noise=0.3)
    fit = RigidBodyFit(cutoff_hz=50.0, decimation=20, drop_first=200, drop_last=200).run((record,), robot)
    found, base = fit.essential, fit.base
    assert found is not None
    assert base is not None
    assert sorted(found.names + found.removed) == sorted(base.names)
    assert found.removed
    assert (found.probability >= 0.05).all()
    assert (found.increase < 0.05).all()
    known = dict(zip(base.names, base.start.tolist(), strict=True))  # the told robot is the true one
    heavy = "rotor_inertia.j1", "friction.j3.viscous", "mass.j3"
    for name, value, error in zip(found.names, found.estimate, found.standard_error, strict=True):
        if name in heavy:
            assert abs(value - known[name]) < 4 * error
    text = "\n".join(artifact_lines(fit))
    assert f"{found.removed[0]} " in text.partition("left out")[2]


def test_recordings_of_different_lengths_are_fitted_together(tmp_path: Path) -> None:
    """Equations of all count: the errors are those of as many equations, and a copy of a recording is refused."""
    truth = loaded(tmp_path, ARM)
    settings = RigidBodyFit(cutoff_hz=50.0, decimation=20)
    records = [
        recording(truth, seed, seconds=own, noise=0.05) for seed, own in ((1, 5.0), (2, 8.0), (3, 14.0))
    ]
    together = settings.run(tuple(records), truth)
    alone = [settings.run((one,), truth) for one in records]
    assert len(together.time[0].measured) == sum(len(one.time[0].measured) for one in alone)
    assert together.base is not None
    error, known = together.base.standard_error, truth.parameters()
    # What three independent recordings tell of a number adds up, but for what was known before any.
    separate = [1 / one.base.standard_error**2 for one in alone if one.base is not None]
    np.testing.assert_allclose(error, np.sum(separate, axis=0) ** -0.5, rtol=0.35)
    table = together.parameters
    off = [
        (table.value(name) - known[name]) / table.standard_error[table.names.index(name)]
        for name in (
            "friction.j1.coulomb",
            "friction.j2.coulomb",
            "friction.j1.viscous",
            "friction.j2.viscous",
        )
    ]
    assert np.abs(off).max() < 4
    with pytest.raises(DataRejected, match="holds the samples of experiment 1 of block 1, configuration 1"):
        settings.run((records[0], records[0].replace(source="again")), truth)
