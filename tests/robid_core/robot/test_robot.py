"""The robot: its file, its names, its equilibrium and its linear model against independent mechanics."""

import re
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from robid_core import ConfigurationError, Robot


@pytest.fixture(scope="module")
def six() -> Robot:
    return Robot.load("six_axis")


def test_packaged_robots_come_in_pairs_that_differ_by_a_quarter_to_two_fifths() -> None:
    for name in ("six_axis", "one_axis"):
        nominal, truth = Robot.load(name).parameters(), Robot.load(f"{name}_true").parameters()
        assert nominal.keys() == truth.keys()
        ratios = [truth[n] / nominal[n] for n in nominal if "stiffness" in n]
        assert all(0.25 <= abs(r - 1) <= 0.40 for r in ratios), ratios


def test_six_axis_has_six_gears_and_six_bearings_and_the_stated_mass(six: Robot) -> None:
    assert six.n_axis == 6
    assert len(six.stiffness_names) == 12
    assert six.chain.n_coordinate == 12
    assert six.chain.mass.sum() == pytest.approx(200.0)


def test_first_resonances_of_the_outstretched_arm_lie_between_8_and_30_hz(six: Robot) -> None:
    """Poles of the linear model: the first three elastic modes (a table of plausible numbers is in robots/six_axis)."""
    poles = np.linalg.eigvals(six.linearize(np.zeros(6)).a)
    # Without a controller the motors drift or swing under gravity below 2 Hz; elastic modes are above.
    frequency = np.sort(np.abs(poles[poles.imag > 2 * np.pi * 2])) / (2 * np.pi)
    assert (frequency[:3] > 8).all()
    assert (frequency[:3] < 30).all()


def test_the_file_that_is_written_loads_equal(six: Robot, tmp_path: Path) -> None:
    (tmp_path / "robot.yaml").write_text(six.to_yaml(), encoding="utf-8")
    back = Robot.load("robot.yaml", tmp_path)
    assert back == six
    assert back.to_yaml() == six.to_yaml()


def test_a_named_parameter_reaches_the_model_and_nothing_else(six: Robot) -> None:
    softer = six.with_parameters({"gear_stiffness.axis_2": 1.0e5})
    assert softer.parameters()["gear_stiffness.axis_2"] == 1.0e5
    changed = {n for n, v in softer.parameters().items() if v != six.parameters()[n]}
    assert changed == {"gear_stiffness.axis_2"}


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"gear_stiffness.axis_9": 1.0}, "has no parameter gear_stiffness.axis_9"),
        ({"gear_stiffness.axis_1": -1.0}, r"gear.stiffness: -1.0 must be greater than 0"),
        ({"rotor_inertia.axis_1": float("nan")}, "rotor_inertia"),
    ],
)
def test_a_value_a_robot_cannot_have_is_refused_by_name(
    six: Robot, values: dict[str, float], message: str
) -> None:
    with pytest.raises(ConfigurationError, match=message):
        six.with_parameters(values)


def test_the_motors_hold_the_gravity_torque_of_the_deflected_chain(six: Robot) -> None:
    """pinocchio's gravity torque of the rigid URDF, geared to the motors; sag is below 2 mrad, its effect below 1 %."""
    pinocchio = pytest.importorskip("pinocchio")
    model = pinocchio.buildModelFromUrdf(
        str(Path(__file__).parents[3] / "robid_core/robots/six_axis/robot.urdf")
    )
    rng = np.random.default_rng(4)
    angle = rng.uniform(-1, 1, (5, 6))
    rigid = np.stack([pinocchio.computeGeneralizedGravity(model, model.createData(), q) for q in angle])
    geared = rigid @ six.drives.gear
    held = six.gravity_torque(angle)
    assert np.abs(held - geared).max() < 0.01 * np.abs(geared).max()


def test_response_is_the_state_space_response_without_hold(six: Robot) -> None:
    angle = np.array([0.2, 0.4, -0.3, 0.5, 0.7, -0.2])
    f = np.array([4.0, 11.0, 37.0])
    model = six.linearize(angle)
    s = 2j * np.pi * f
    expected = np.stack(
        [model.c @ np.linalg.solve(si * np.eye(len(model.a)) - model.a, model.b) + model.d for si in s]
    )
    got = six.response(angle[None], f, hold="continuous")[0]
    np.testing.assert_allclose(got, expected, rtol=1e-8, atol=1e-10 * np.abs(expected).max())


def test_gradient_factors_are_the_central_differences_at_fixed_equilibrium() -> None:
    """Without gravity the equilibrium is the same for every stiffness: the factors are the whole derivative."""
    six = Robot.load("six_axis")
    weightless = Robot(six.description.model_copy(update={"gravity": (0.0, 0.0, 0.0)}))
    angle, f = np.array([[0.2, 0.4, -0.3, 0.5, 0.7, -0.2]]), np.array([6.0, 21.0, 60.0])
    g = weightless.response_with_gradient(angle, f)
    names = list(zip(weightless.stiffness_names, weightless.damping_names, strict=True))
    values = weightless.parameters()
    s = 2j * np.pi * f[:, None, None]
    for index, (spring, damper) in enumerate(names):
        x = g.spring_vectors[0, :, index]
        square = -x[:, :, None] * x[:, None, :]
        for name, expected in ((spring, square), (damper, s * square)):
            h = 1e-4 * values[name]
            up = weightless.with_parameters({name: values[name] + h}).response(angle, f)[0]
            down = weightless.with_parameters({name: values[name] - h}).response(angle, f)[0]
            difference = (up - down) / (2 * h)
            # Central differences: relative error h^2 (1e-8) plus rounding eps / 1e-4 of the response.
            tolerance = 1e-6 * np.abs(difference).max() + 1e-11 * np.abs(up).max() / values[name]
            np.testing.assert_allclose(expected, difference, rtol=0, atol=tolerance, err_msg=name)


def test_sag_moves_the_gradient_by_less_than_two_percent(six: Robot) -> None:
    """The bound that the fit states for leaving out how the equilibrium moves with stiffness."""
    angle, f = np.array([[0.2, 0.6, -0.3, 0.5, 0.7, -0.2]]), np.geomspace(4, 80, 25)
    g = six.response_with_gradient(angle, f)
    values = six.parameters()
    for index, name in enumerate(six.stiffness_names):
        h = 1e-3 * values[name]
        up = six.with_parameters({name: values[name] + h}).response(angle, f)[0]
        down = six.with_parameters({name: values[name] - h}).response(angle, f)[0]
        whole = (up - down) / (2 * h)
        x = g.spring_vectors[0, :, index]
        fixed = -x[:, :, None] * x[:, None, :]
        assert np.linalg.norm(whole - fixed) < 0.02 * np.linalg.norm(whole), name


def test_an_unknown_robot_names_the_packaged_ones() -> None:
    with pytest.raises(
        ConfigurationError, match="packaged robots: six_axis, six_axis_true, one_axis, one_axis_true"
    ):
        Robot.load("eight_axis")


def test_a_robot_whose_name_is_misspelt_is_asked_after() -> None:
    with pytest.raises(ConfigurationError, match="did you mean 'six_axis_true'"):
        Robot.load("six_axes_true")


def test_threads_that_ask_for_other_poses_get_their_own_rest() -> None:
    """A robot keeps its last rest; who asks meanwhile for another one must not take it, and none may be changed."""
    robot = Robot.load("six_axis")
    poses = np.random.default_rng(1).uniform(-0.5, 0.5, (8, 1, 6))
    alone = [Robot.load("six_axis").equilibrium(pose).torque for pose in poses]
    with ThreadPoolExecutor(8) as pool:
        found = list(pool.map(lambda k: robot.equilibrium(poses[k % 8]).torque, range(400)))
    for k, torque in enumerate(found):
        np.testing.assert_array_equal(torque, alone[k % 8])
    with pytest.raises(ValueError, match="read-only"):
        found[0][0, 0] = 0.0


def test_angles_that_are_not_one_for_each_axis_are_told_in_a_sentence(six: Robot) -> None:
    """Whatever takes angles asks `motor_angle` or `joint_angle` first."""
    frequency = np.array([10.0, 20.0])
    calls = {
        (1, 1): (
            lambda: six.response([[0.4]], frequency),
            lambda: six.response_with_gradient([[0.4]], frequency),
            lambda: six.second_order([[0.4]]),
            lambda: six.equilibrium([[0.4]]),
            lambda: six.gravity_torque([[0.4]]),
            lambda: six.joint_angle([[0.4]]),
            lambda: six.standing([[0.4]]),
            lambda: six.drive(np.zeros((1, 5, 6)), [[0.4]]),
            lambda: six.simulate(np.zeros((1, 5, 6)), [[0.4]]),
        ),
        (1,): (lambda: six.linearize([0.4]),),
        (): (lambda: six.motor_angle(0.4),),
    }
    for shape, those in calls.items():
        for call in those:
            with pytest.raises(ConfigurationError) as error:
                call()
            assert re.fullmatch(
                rf"six_axis: angles of shape \({', '.join(map(str, shape))},?\), expected \(\.\.\., 6\): one angle for "
                "each of its 6 axes",
                str(error.value),
            )


def test_a_robot_is_one_line_as_text(six: Robot) -> None:
    n = len(six.parameters())
    shown = repr(six.with_effect("grease", "friction.stribeck", "axis_1"))
    assert shown.startswith("<Robot six_axis: axis_1, axis_2, axis_3, axis_4, axis_5, axis_6, ")
    assert shown.endswith(" parameters, effects: grease>")
    assert repr(six) == shown.partition(" axis_6, ")[0] + f" axis_6, {n} parameters, effects: none>"
