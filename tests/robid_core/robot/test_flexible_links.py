"""Flexible links of robot files: what finite elements say of a link is what the robot does."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import eigh

from robid_core import ConfigurationError, Plugin, Robot, chosen_names
from robid_core.mechanics.flexible import craig_bampton, hollow_square
from robid_core.mechanics.flexible.closed_form import bending_frequencies_hz, cantilever_roots
from robid_core.mechanics.tool import pose_of
from robid_core.robot.file.finite_elements import read_structure, write_structure
from robid_core.robots.six_axis_flex.links import write_links

LENGTH, N = 0.9, 6
BEAM = hollow_square(LENGTH, 0.06, 0.004)
GEAR, ROTOR, RATIO, BEARING = 4e4, 1.5e-3, 100.0, 9e4
FLEX = Path(__file__).parents[3] / "robid_core" / "robots" / "six_axis_flex"

ARM = f"""
robid_robot: 1
name: arm
bodies:
  - joint: shoulder
    axis: [0, 1, 0]
    flexible: {{file: link.npz, root: 0, tip: {N}, modes: 3}}
  - {{joint: elbow, parent: shoulder, axis: [0, 1, 0], translation: [{LENGTH}, 0, 0], mass: 5,
     centre_of_mass: [0.2, 0, 0.01], inertia: [[0.05, 0, 0], [0, 0.06, 0], [0, 0, 0.07]]}}
axes:
  shoulder:
    gear_ratio: {RATIO}
    rotor_inertia: {ROTOR}
    torque_limit: 20
    speed_limit: 300
    gear: {{stiffness: {GEAR}, damping: 10}}
    controller: {{speed_gain: 0.1}}
  elbow: {{gear_ratio: 80, rotor_inertia: 5.0e-4, torque_limit: 10, speed_limit: 300, controller: {{speed_gain: 0.05}}}}
bearings:
  shoulder_x: {{joint: shoulder, axis: [1, 0, 0], stiffness: {BEARING}, damping: 20}}
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with the matrices of one beam."""
    write_structure(tmp_path / "link.npz", BEAM.structure(N))
    return tmp_path


def robot_of(text: str, folder: Path) -> Robot:
    (folder / "robot.yaml").write_text(text, encoding="utf-8")
    return Robot.load("robot.yaml", folder)


def frequencies_hz(robot: Robot, angle: list[float]) -> np.ndarray:
    model = robot.second_order(np.array([angle]))
    return np.sqrt(abs(eigh(model.stiffness[0], model.mass[0], eigvals_only=True))) / (2 * np.pi)


def test_resonances_are_those_of_the_finite_elements_on_gear_and_bearing(folder: Path) -> None:
    """The oracle has every degree of freedom of the beam, the load on its tip and the springs at its root."""
    text = ARM.replace("name: arm", "name: arm\ngravity: [0, 0, 0]").replace(
        "rotor_inertia: 5.0e-4", "rotor_inertia: 1.0e+3"
    )
    # all modes there are: nothing is lost by the reduction
    text = text.replace("modes: 3", f"modes: {6 * (N - 1)}")
    robot = robot_of(text, folder)
    structure = BEAM.structure(N)
    mass, stiffness = structure.mass, structure.stiffness
    load, centre = 5.0, np.array([0.2, 0.0, 0.01])
    tip = np.zeros((6, 6))
    tip[:3, :3] = load * np.eye(3)
    tip[:3, 3:] = load * np.array([np.cross(axis, centre) for axis in np.eye(3)]).T
    tip[3:, :3] = tip[:3, 3:].T
    tip[3:, 3:] = np.diag([0.05, 0.06, 0.07]) + load * (
        centre @ centre * np.eye(3) - np.outer(centre, centre)
    )
    mass[-6:, -6:] += tip
    # root: free to turn about x (bearing) and y (gear to a rotor); everything else held
    kept = np.r_[3, 4, 6 : 6 * N + 6]
    m, k = np.zeros((len(kept) + 1,) * 2), np.zeros((len(kept) + 1,) * 2)
    m[:-1, :-1], k[:-1, :-1] = mass[np.ix_(kept, kept)], stiffness[np.ix_(kept, kept)]
    m[-1, -1] = ROTOR * RATIO**2  # rotor angle seen at the joint
    k[0, 0] += BEARING
    k[np.ix_([1, -1], [1, -1])] += GEAR * np.array([[1, -1], [-1, 1]])
    expected = np.sqrt(abs(eigh(k, m, eigvals_only=True))) / (2 * np.pi)
    found = frequencies_hz(robot, [0.0, 0.0])
    # the robot has one coordinate more that does not move: a heavy rotor holds the elbow
    assert found[0] < 1e-3 * found[2]
    assert expected[0] < 1e-3 * expected[1]
    # low modes beside stiff ones: rounding is 1e-16 times the square of the ratio of frequencies
    np.testing.assert_allclose(found[2:12], expected[1:11], rtol=1e-7)


def test_a_link_sags_under_gravity_as_the_beam_in_the_book(folder: Path) -> None:
    """Cantilever under its own weight and that of a load with a lever: to first order in the slope of 0.4 mrad."""
    text = ARM
    for stiffness in (GEAR, BEARING):
        text = text.replace(f"stiffness: {stiffness}", "stiffness: 1.0e+12")
    robot = robot_of(text, folder)
    joint = robot.equilibrium(np.zeros((1, 2))).joint[0]
    elbow = pose_of(robot.chain, joint, "elbow")
    rigidity, weight, load, lever = BEAM.bending_stiffness[0], 9.81 * BEAM.mass_per_length, 5 * 9.81, 0.2
    sag = weight * LENGTH**4 / 8 + load * LENGTH**3 / 3 + load * lever * LENGTH**2 / 2
    slope = weight * LENGTH**3 / 6 + load * LENGTH**2 / 2 + load * lever * LENGTH
    assert elbow.position[2] == pytest.approx(-sag / rigidity, rel=1e-4)
    assert elbow.rotation[2, 0] == pytest.approx(-slope / rigidity, rel=1e-4)
    assert slope / rigidity > 3e-4  # it is no zero that is compared


def test_modal_springs_are_squares_of_frequencies_behind_gears_and_bearings(folder: Path) -> None:
    robot = robot_of(ARM, folder)
    stiffness, damping = robot.spring_arrays()
    names = robot.spring_names
    assert names[:2] == robot.stiffness_names == ("gear_stiffness.shoulder", "bearing_stiffness.shoulder_x")
    n_mode = len(names) - 2
    assert n_mode == 6 + 3
    assert robot.mechanism.n_spring == len(names)
    omega = np.sqrt(stiffness[2:])
    roots = cantilever_roots(1)
    np.testing.assert_allclose(omega[:2] / (2 * np.pi), bending_frequencies_hz(BEAM, roots)[0], rtol=2e-3)
    np.testing.assert_allclose(damping[2:], 2 * 0.01 * omega, rtol=1e-12)
    for row, name in zip(robot.mechanism.spring_directions[2:], names[2:], strict=True):
        seen = [robot.mechanism.coordinate_names[i] for i in np.flatnonzero(row)]
        assert seen == [name.removeprefix("modal_stiffness.")]


def test_modes_have_names_units_and_a_group_of_their_own(folder: Path) -> None:
    robot = robot_of(ARM, folder)
    name, damper = "modal_stiffness.shoulder_mode_3", "modal_damping.shoulder_mode_3"
    assert (robot.parameter_unit(name), robot.parameter_unit(damper)) == ("1/s^2", "1/s")
    assert robot.parameter_kind(name) == robot.parameter_kind(damper) == "modal"
    changed = robot.with_parameters({name: 1e6, damper: 7.0, "gear_stiffness.shoulder": 3e4})
    index = robot.spring_names.index(name)
    assert changed.spring_arrays()[0][[0, index]].tolist() == [3e4, 1e6]
    assert changed.spring_arrays()[1][index] == 7.0
    others = np.delete(np.arange(robot.mechanism.n_spring), [0, index])
    np.testing.assert_array_equal(changed.spring_arrays()[0][others], robot.spring_arrays()[0][others])
    with pytest.raises(ConfigurationError, match=r"modes\.2\.stiffness: -1"):
        robot.with_parameters({name: -1.0})


def test_a_fit_and_a_design_leave_the_modes_alone(folder: Path) -> None:
    from robid_design.information import information_matrices
    from robid_fit.log_response import default_patterns

    elastic = "rotor_inertia: 5.0e-4, gear: {stiffness: 2.0e+4, damping: 3}"
    robot = robot_of(ARM.replace("rotor_inertia: 5.0e-4", elastic), folder)
    assert set(chosen_names(list(robot.layout), default_patterns(robot))) == {
        *robot.stiffness_names,
        *robot.damping_names,
    }
    assert len(robot.stiffness_names) == 3
    frequency = np.array([5.0, 12.0])
    found = information_matrices(
        robot,
        np.zeros((1, 2)),
        frequency,
        np.ones((2, 2)),
        np.broadcast_to(np.eye(2), (2, 2, 2)),
        np.full(2, 1e-3),
    )
    assert found.shape == (1, 3, 3)


def test_a_robot_is_written_whole_and_loads_again_without_the_matrices(folder: Path, tmp_path: Path) -> None:
    robot = robot_of(ARM, folder)
    link = robot.description.bodies[0].flexible
    assert link is not None
    assert link.reduced is not None
    assert link.reduced.sha256 == hashlib.sha256((folder / "link.npz").read_bytes()).hexdigest()
    text = robot.to_yaml()
    (folder / "link.npz").unlink()
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    again = robot_of(text, elsewhere)
    assert again == robot
    assert again.to_yaml() == text
    np.testing.assert_array_equal(again.chain.modal_momentum, robot.chain.modal_momentum)


def test_a_derived_robot_inherits_the_links_and_changes_a_mode(folder: Path) -> None:
    base = robot_of(ARM, folder)
    other = folder / "other"
    other.mkdir()
    text = "robid_robot: 1\nname: soft\nbase: ../robot.yaml\nparameters: {modal_stiffness.shoulder_mode_1: 1000.0}\n"
    derived = robot_of(text, other)
    assert derived.spring_arrays()[0][2] == 1000.0
    np.testing.assert_array_equal(derived.spring_arrays()[0][3:], base.spring_arrays()[0][3:])


def test_the_frame_of_the_file_may_lie_anywhere_in_the_joints_frame(folder: Path) -> None:
    """The same arm drawn along z, its matrices in their own frame, the root away from the file's origin."""
    structure = BEAM.structure(N)
    object.__setattr__(structure, "nodes", structure.nodes + np.array([0.3, -0.1, 0.2]))
    write_structure(folder / "moved.npz", structure)
    upright = ARM.replace(f"translation: [{LENGTH}, 0, 0]", f"translation: [0, 0, {LENGTH}]").replace(
        f"{{file: link.npz, root: 0, tip: {N}, modes: 3}}",
        f"{{file: moved.npz, root: 0, tip: {N}, modes: 3, rotation: [[0, 0, -1], [0, 1, 0], [1, 0, 0]], "
        "translation: [0.2, 0.1, -0.3]}",
    )
    upright = upright.replace("centre_of_mass: [0.2, 0, 0.01]", "centre_of_mass: [-0.01, 0, 0.2]")
    upright = upright.replace("[[0.05, 0, 0]", "[[0.07, 0, 0]").replace("[0, 0, 0.07]]", "[0, 0, 0.05]]")
    upright = upright.replace("axis: [1, 0, 0], stiffness", "axis: [0, 0, 1], stiffness")
    upright = upright.replace("name: arm", "name: arm\ngravity: [9.81, 0, 0]")
    lying, standing = robot_of(ARM, folder), robot_of(upright, folder)
    assert np.allclose(standing.description.bodies[0].centre_of_mass, [0, 0, LENGTH / 2])
    np.testing.assert_allclose(
        frequencies_hz(standing, [0.1, 0.3])[2:], frequencies_hz(lying, [0.1, 0.3])[2:], rtol=1e-8
    )


def test_keep_leaves_out_the_highest_modes(folder: Path) -> None:
    whole = robot_of(ARM, folder)
    cut = robot_of(ARM.replace("modes: 3}", "modes: 3, keep: 4}"), folder)
    assert len(cut.spring_names) == 2 + 4
    np.testing.assert_allclose(cut.spring_arrays()[0], whole.spring_arrays()[0][:6], rtol=1e-9)


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("link.npz", "other.npz", r":7:16: bodies\[0\].flexible.file: joint 'shoulder': finite elements: .*is no file"),
        (f"tip: {N}", "tip: 77", r"joint 'shoulder': link.npz: tip node 77: there are nodes 0 to 6"),
        ("modes: 3", "modes: 3, keep: 50", "50 modes to keep of 9"),
        ("modes: 3", "modes: 999", "999 fixed-interface modes"),
        ("1, 0]\n    flex", "1, 0]\n    mass: 3\n    flex", r":7:5: bodies\[0\].mass: .*matrices of a flexible link"),
        (f"[{LENGTH}, 0, 0]", f"[0, 0, {LENGTH}]", r"node 6 stands at \[0.9, 0, 0\] m .*1.27 m from joint 'elbow'"),
        ("modes: 3", "modes: 3, units: mm_t_s", "no link is like that"),
        ("modes: 3", "modes: 3, rotation: [[1, 0, 0], [0, 1, 0], [0, 0, -1]]", "mirrors"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_a_link_is_told_once_at_its_place(
    folder: Path, old: str, new: str, told: str
) -> None:
    assert old in ARM
    with pytest.raises(ConfigurationError, match=told) as refused:
        robot_of(ARM.replace(old, new), folder)
    assert str(refused.value).count("\n") == 0


def test_a_link_whose_file_was_never_read_is_refused(folder: Path) -> None:
    robot = robot_of(ARM, folder)
    body = robot.description.bodies[0]
    assert body.flexible is not None
    unread = body.model_copy(update={"flexible": body.flexible.model_copy(update={"reduced": None})})
    bodies = (unread, *robot.description.bodies[1:])
    with pytest.raises(ConfigurationError, match="joint 'shoulder': a flexible link without its modes"):
        _ = Robot(robot.description.model_copy(update={"bodies": bodies})).chain


def test_pictures_place_the_joints_behind_a_straight_link(folder: Path) -> None:
    from robid_report.stick_figure import skeleton

    robot = robot_of(ARM, folder)
    drawn = skeleton(robot, np.array([[0.4, -0.3]]))
    expected = LENGTH * np.array([np.cos(0.4), 0.0, -np.sin(0.4)])
    np.testing.assert_allclose(drawn.points[0, robot.chain.index("elbow")], expected, atol=1e-12)


def test_ten_numbers_a_body_do_not_describe_a_flexible_link(folder: Path) -> None:
    from robid_core.estimation.rigid.rigid_body import inverse_dynamics_regressor
    from robid_fit.rigid_effects import rigid_robot

    robot = robot_of(ARM, folder)
    still = np.zeros((2, robot.chain.n_coordinate))
    with pytest.raises(ConfigurationError, match="joint 2 .* is a mode of a flexible link"):
        inverse_dynamics_regressor(robot.chain, still, still, still)
    stiff = rigid_robot(robot)
    assert stiff.chain.names == ("shoulder", "elbow")
    assert stiff.chain.mass[0] == pytest.approx(BEAM.mass)


def test_a_flexible_link_goes_into_no_urdf_and_comes_from_none(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from robid_core.robot.file import model_file

    robot = robot_of(ARM, folder)
    with pytest.raises(ConfigurationError, match="URDF has no flexible links, joint 'shoulder' carries one"):
        robot.to_urdf()
    read = model_file.RobotModel(robot.chain)
    monkeypatch.setattr(Plugin, "load", lambda plugin: lambda path, locked: read)
    (folder / "arm.urdf").touch()
    with pytest.raises(ConfigurationError, match="'shoulder_mode_1' is a mode of a flexible link"):
        model_file.read_model(folder / "arm.urdf", {})


def test_six_axis_flex_has_the_masses_of_six_axis_and_resonances_like_it() -> None:
    flex, plain = Robot.load("six_axis_flex"), Robot.load("six_axis")
    for ours, theirs in zip(flex.description.bodies, plain.description.bodies, strict=True):
        assert ours.mass == pytest.approx(theirs.mass, rel=1e-9)
        np.testing.assert_allclose(ours.centre_of_mass, theirs.centre_of_mass, atol=1e-6)
        np.testing.assert_allclose(ours.inertia, theirs.inertia, atol=1e-6)
    stretched = [0.0, 0.9, -0.7, 0.0, 0.3, 0.0]
    linear = flex.without_effect(*flex.description.effects)
    first = frequencies_hz(linear, stretched)[6:10]
    assert ((first > 8) & (first < 30)).all()  # what six_axis promises of its own first resonances


def test_the_packaged_finite_elements_are_small_and_made_by_their_script(tmp_path: Path) -> None:
    write_links(tmp_path)
    files = sorted(FLEX.glob("*.npz"))
    assert [file.name for file in files] == ["elbow.npz", "lower_arm.npz", "upper_arm.npz"]
    for file in files:
        assert file.stat().st_size < 200_000
        packaged, made = read_structure(file), read_structure(tmp_path / file.name)
        for one, other in ((packaged.mass, made.mass), (packaged.stiffness, made.stiffness)):
            scale = abs(other).max()
            np.testing.assert_allclose(one.toarray(), other.toarray(), rtol=0, atol=1e-12 * scale)


def test_the_packaged_links_are_reduced_without_loss_below_a_kilohertz() -> None:
    """Frequencies of each link, clamped at its root, against twelve fixed-interface modes more."""
    bodies = {body.joint: body for body in Robot.load("six_axis_flex").description.bodies}
    for joint, name in (("axis_2", "lower_arm"), ("axis_3", "elbow"), ("axis_4", "upper_arm")):
        link = bodies[joint].flexible
        assert link is not None
        assert link.reduced is not None
        own = np.sqrt([mode.stiffness for mode in link.reduced.modes]) / (2 * np.pi)
        fine = craig_bampton(read_structure(FLEX / f"{name}.npz"), (0, 8), 14)
        exact = np.sqrt(eigh(fine.stiffness[6:, 6:], fine.mass[6:, 6:], eigvals_only=True)) / (2 * np.pi)
        low = exact < 1000
        np.testing.assert_allclose(own[: low.sum()], exact[low], rtol=0.01)


def test_the_packaged_reductions_are_fine_enough_for_the_whole_robot(tmp_path: Path) -> None:
    """First twelve resonances against twelve fixed-interface modes in every link; fewer modes would not do."""
    text = (FLEX / "robot.yaml").read_text(encoding="utf-8")
    text = text[: text.index("effects:")]
    for file in FLEX.glob("*.npz"):
        (tmp_path / file.name).write_bytes(file.read_bytes())
    fine = text.replace("modes: 2", "modes: 12")
    fine = fine.replace("method: guyan\n", "method: craig_bampton\n      modes: 12\n")
    fine = fine.replace("method: guyan,", "method: craig_bampton, modes: 12,")
    assert fine.count("modes: 12") == 3
    coarse = text.replace("modes: 2", "modes: 2\n      keep: 4").replace(
        "method: guyan\n", "method: guyan\n      keep: 4\n"
    )
    pose = [0.0, 0.9, -0.7, 0.0, 0.3, 0.0]
    exact, own, few = (frequencies_hz(robot_of(t, tmp_path), pose)[6:18] for t in (fine, text, coarse))
    np.testing.assert_allclose(own, exact, rtol=1e-4)
    assert abs(few / exact - 1).max() > 5e-3


def test_six_axis_flex_stands_still_with_all_its_effects() -> None:
    robot = Robot.load("six_axis_flex")
    angle = np.array([[0.3, 0.4, -0.2, 0.5, -0.6, 0.1]])
    held = robot.simulate(np.zeros((1, 100, 6)), angle, keep_coordinates=True)
    assert held.coordinates is not None
    assert abs(held.coordinates[0] - held.coordinates[0, 0]).max() < 1e-9
