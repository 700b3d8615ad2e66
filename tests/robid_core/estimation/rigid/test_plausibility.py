"""Slips in recordings of a six-axis arm that is not quite what its file says: which are found, and when nothing is."""

from __future__ import annotations

import functools

import numpy as np
import pytest

from robid_core import FloatArray, Robot
from robid_core.estimation.rigid.coupled_axes import coupling_in
from robid_core.estimation.rigid.encoder_counts import counts_in
from robid_core.estimation.rigid.plausibility import Recorded, Slip, slips_in
from robid_core.estimation.rigid.torque_offsets import offsets_in
from robid_core.estimation.rigid.zero_angles import zeros_in
from robid_core.residual import rigid_drives

CUTOFF_HZ = 5.0
NONE = np.eye(6)
DEGREE = np.pi / 180
Experiments = list[tuple[FloatArray, FloatArray]]


@functools.cache
def measured(off: float, payload: float = 0.0) -> Experiments:
    """Angle and torque of four experiments of a plant: springs a third off, masses by `off`."""
    robot = Robot.load("six_axis")
    generator = np.random.default_rng(7)
    values = {}
    for name in robot.layout:
        if robot.parameter_kind(name) in ("stiffness", "damping"):
            values[name] = robot.parameter(name) * np.exp(0.3 * generator.standard_normal())
        elif name.startswith(("mass.", "rotor_inertia.")):
            values[name] = robot.parameter(name) * np.exp(off * generator.standard_normal())
    values["mass.axis_6"] = values["mass.axis_6"] + payload
    plant = robot.with_parameters(values)
    n_sample, n_pose = 2000, 4
    time = robot.sample_time_s * np.arange(n_sample)
    poses = generator.uniform(-0.6, 0.6, (n_pose, 6))
    lines = np.arange(3.0, 60.0, 1.5)
    waves = np.cos(
        2 * np.pi * lines[:, None] * time + generator.uniform(0, 2 * np.pi, (n_pose, 6, len(lines), 1))
    ).sum(axis=2)
    slow = np.sin(2 * np.pi * time + generator.uniform(0, 2 * np.pi, (n_pose, 6, 1)))
    reference = np.swapaxes(4 * waves / waves.std() + 10 * slow, 1, 2)
    done = plant.simulate(reference, poses, seed=3)
    return list(zip(done.position, done.torque, strict=True))


@pytest.fixture(scope="module")
def robot() -> Robot:
    return Robot.load("six_axis")


@pytest.fixture(scope="module")
def sound() -> Experiments:
    return measured(0.01)


def slips(robot: Robot, experiments: Experiments, position: FloatArray, torque: FloatArray) -> list[Slip]:
    wrong = [(q @ position.T, u @ torque.T) for q, u in experiments]
    recorded = Recorded.of_experiments(rigid_drives(robot), wrong, robot.sample_time_s, CUTOFF_HZ)
    return slips_in(recorded, robot.axis_names)


def exchanged(a: int, b: int) -> FloatArray:
    order = list(range(6))
    order[a], order[b] = b, a
    return NONE[order]


def turned(a: int) -> FloatArray:
    return np.diag([-1.0 if k == a else 1.0 for k in range(6)])


GEAR = Robot.load("six_axis").drives.gear
CASES = {
    "torque's sign": (NONE, turned(2), ["the torque of axis_3 has the opposite sign"]),
    "angle's sign": (turned(1), NONE, ["the angle of axis_2 has the opposite sign"]),
    "axis counts the other way": (turned(3), turned(3), ["axis_4 counts the other way round than in the robot file"]),
    "torques exchanged": (NONE, exchanged(1, 2), ["the torques of axis_2 and axis_3 are exchanged"]),
    "axes exchanged": (exchanged(2, 4), exchanged(2, 4), ["axis_3 and axis_5 are exchanged"]),
    "degrees": (NONE / DEGREE, NONE, ["the angles look like degrees"]),
    "angles of joints": (GEAR, NONE, ["the angles look like those of the joints"]),
    "torques at joints": (NONE, np.linalg.inv(GEAR).T, ["the torques look like those at the joints"]),
    "degrees and a sign": (
        NONE / DEGREE, turned(2), ["the angles look like degrees", "the torque of axis_3 has the opposite sign"],
    ),
    "torques exchanged and a sign": (NONE, turned(2) @ exchanged(1, 2), [
        "the torques of axis_2 and axis_3 are exchanged, and the torque of axis_2 has the opposite sign"],
    ),
    "axes exchanged, one the other way": (turned(3) @ exchanged(3, 4), turned(3) @ exchanged(3, 4), [
        "axis_4 and axis_5 are exchanged, and axis_5 counts the other way round than in the robot file"],
    ),
}  # fmt: skip


FEW = (
    "torque's sign",
    "axes exchanged",
    "degrees",
    "angles of joints",
    "torques at joints",
    "degrees and a sign",
)


@pytest.mark.parametrize(
    "case", [pytest.param(case, marks=[pytest.mark.full] * (case not in FEW)) for case in CASES]
)
def test_a_slip_is_named_and_its_maps_undo_it(robot: Robot, sound: Experiments, case: str) -> None:
    """Alone, or both of two; what is left is then what the sound record leaves."""
    position, torque, expected = CASES[case]
    found = slips(robot, sound, position, torque)
    assert [one.what for one in found] == expected
    for one in found:
        position, torque = one.position @ position, one.torque @ torque
    assert np.abs(position - NONE).max() < 1e-9
    assert np.abs(torque - NONE).max() < 1e-9
    assert found[-1].after < 0.5 < found[-1].before


TOLD_WRONG = pytest.mark.parametrize(
    "off, payload", [(0.01, 0.0), (0.1, 0.0), pytest.param(0.01, 20.0, marks=pytest.mark.full)]
)


@TOLD_WRONG
def test_a_robot_that_is_told_wrong_is_no_slip(robot: Robot, off: float, payload: float) -> None:
    """Masses a tenth off, or a load that nobody told: values, which a fit finds."""
    assert slips(robot, measured(off, payload), NONE, NONE) == []


@TOLD_WRONG
def test_a_robot_that_is_told_wrong_has_its_zeros_and_counts(
    robot: Robot, off: float, payload: float
) -> None:
    experiments = measured(off, payload)
    recorded = Recorded.of_experiments(rigid_drives(robot), experiments, robot.sample_time_s, CUTOFF_HZ)
    assert zeros_in(recorded) == []
    assert counts_in(recorded) is None
    assert coupling_in(recorded) is None


@pytest.mark.parametrize(
    ("axis", "factor"),
    [(1, 2.0), *(pytest.param(*case, marks=pytest.mark.full) for case in ((0, 0.25), (3, 0.5), (4, 4.0)))],
)
def test_counts_are_found_in_a_robot_that_is_not_quite_the_told_one(
    robot: Robot, sound: Experiments, axis: int, factor: float
) -> None:
    """Where they change a torque by a fifth: of the others nothing is said."""
    scale = np.diag(np.where(np.arange(6) == axis, factor, 1.0))
    wrong = [(position @ scale, torque) for position, torque in sound]
    recorded = Recorded.of_experiments(rigid_drives(robot), wrong, robot.sample_time_s, CUTOFF_HZ)
    found = counts_in(recorded)
    assert found is not None
    assert (found.axis, found.factor) == (axis, 1 / factor)


@pytest.mark.parametrize(
    ("axis", "off"),
    [(1, 0.3), *(pytest.param(*case, marks=pytest.mark.full) for case in ((2, -0.8), (3, 0.6)))],
)
def test_a_zero_is_found_in_a_robot_that_is_not_quite_the_told_one(
    robot: Robot, sound: Experiments, axis: int, off: float
) -> None:
    """Masses a hundredth off, springs a third: a torque of weight that is a hundredth off turns by about as much."""
    shift = np.linalg.solve(robot.drives.gear, off * np.eye(6)[axis])
    wrong = [(position + shift, torque) for position, torque in sound]
    recorded = Recorded.of_experiments(rigid_drives(robot), wrong, robot.sample_time_s, CUTOFF_HZ)
    first = zeros_in(recorded)[0]
    assert first.axis == axis
    assert first.angle == pytest.approx(off, abs=0.03)
    assert first.after < 0.3 * first.before


def test_an_exchange_of_the_first_axis_sign_shows_nothing(robot: Robot, sound: Experiments) -> None:
    """About a vertical axis a robot is the same mirrored: no torque below the resonances tells, and none is refused."""
    assert slips(robot, sound, turned(0), turned(0)) == []


@pytest.mark.parametrize("axis", range(6))
@pytest.mark.parametrize("sign", [1, -1])
def test_a_constant_in_a_torque_is_found_with_its_size(
    robot: Robot, sound: Experiments, axis: int, sign: int
) -> None:
    """Twice the torque's rms, at its axis only, to five hundredths of that: masses of the plant are 1 % off."""
    size = 2 * sign * float(np.sqrt(np.mean([(torque[:, axis] ** 2).mean() for _, torque in sound])))
    wrong = [(angle, torque + size * NONE[axis]) for angle, torque in sound]
    (found,) = offsets_in(Recorded.of_experiments(rigid_drives(robot), wrong, robot.sample_time_s, CUTOFF_HZ))
    assert found.axis == axis
    assert abs(found.torque - size) < 0.05 * abs(size)
    assert found.after < 0.2 * found.before


def test_a_load_is_off_by_constants_of_several_torques_and_a_sound_one_by_none(
    robot: Robot, sound: Experiments
) -> None:
    """20 kg at the flange, about poses that are near one another: not a constant of one torque."""
    found = [
        offsets_in(Recorded.of_experiments(rigid_drives(robot), one, robot.sample_time_s, CUTOFF_HZ))
        for one in (sound, measured(0.01, 20.0))
    ]
    assert found[0] == []
    assert len(found[1]) > 1
