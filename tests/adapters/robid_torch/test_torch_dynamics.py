"""Batches in torch against the compiled kernels, automatic differentiation and pytorch-kinematics."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import robid_core.robots
from robid_core import ConfigurationError, NotTrustworthy, Robot
from robid_core.mechanics import Chain, dynamics

torch = pytest.importorskip("torch")

from robid_torch.batches import PROCESSOR, TorchDynamics  # noqa: E402
from robid_torch.trees import frames, tensor, terms_at, tree_of  # noqa: E402

CPU = torch.device("cpu")
FREQUENCY_HZ = np.geomspace(4, 80, 15)


def _angles(robot: Robot, n_config: int = 12) -> Any:
    d = robot.drives
    return np.random.default_rng(3).uniform(d.lower, d.upper, (n_config, robot.n_axis))


def _tree(seed: int, n: int = 7) -> Chain:
    """Draw a tree of revolute and prismatic joints in general position."""
    rng = np.random.default_rng(seed)
    rotation, inertia = [], []
    for _ in range(n):
        q, _unused = np.linalg.qr(rng.normal(size=(3, 3)))
        rotation.append(q * np.sign(np.linalg.det(q)))
        points = rng.normal(size=(6, 3))  # point masses: an inertia that some body has
        inertia.append(np.sum(points**2) * np.eye(3) - points.T @ points)
    axis = rng.normal(size=(n, 3))
    return Chain(
        parent=np.array([-1] + [int(rng.integers(-1, j)) for j in range(1, n)]),
        joint_type=rng.integers(0, 2, n),
        axis=axis / np.linalg.norm(axis, axis=1)[:, None],
        rotation=np.array(rotation),
        translation=rng.normal(size=(n, 3)),
        mass=rng.uniform(0.5, 3.0, n),
        centre_of_mass=rng.normal(size=(n, 3)),
        inertia=np.array(inertia),
        names=tuple(f"body_{j}" for j in range(n)),
        gravity=np.array([1.0, 2.0, -9.81]),
    )


@pytest.mark.parametrize("hold", ["zero_order_hold", "continuous"])
@pytest.mark.parametrize("name", ["six_axis", "one_axis"])
def test_responses_of_torch_and_of_the_kernel_agree(name: str, hold: str) -> None:
    kernel, batched = Robot.load(name), Robot.load(name, dynamics="torch")
    angle = _angles(kernel)
    damping = np.full((len(angle), kernel.n_axis), 0.02)
    expected = kernel.response_with_gradient(angle, FREQUENCY_HZ, damping, hold)
    got = batched.response_with_gradient(angle, FREQUENCY_HZ, damping, hold)
    for field in ("response", "spring_vectors", "motor_vectors"):
        ours, theirs = getattr(got, field), getattr(expected, field)
        assert ours.shape == theirs.shape
        # two eliminations, one of them without pivots: each loses three digits at a resonance, and four more in an
        # entry that is small beside the others of its matrix
        np.testing.assert_allclose(ours, theirs, rtol=1e-9, atol=1e-13 * abs(theirs).max())
    response = batched.response(angle, FREQUENCY_HZ, damping, hold)
    np.testing.assert_allclose(response, got.response, rtol=1e-13)


def test_linear_models_and_holding_torques_of_torch_and_of_the_kernel_agree() -> None:
    kernel, batched = Robot.load("six_axis"), Robot.load("six_axis", dynamics="torch")
    angle = _angles(kernel)
    expected, got = kernel.second_order(angle), batched.second_order(angle)
    for field in ("mass", "damping", "stiffness", "input_map", "spring_directions"):
        ours, theirs = getattr(got, field), getattr(expected, field)
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-13 * abs(theirs).max())
    assert not np.array_equal(got.mass, expected.mass), "torch was not asked"
    theirs = kernel.gravity_torque(angle)
    np.testing.assert_allclose(batched.gravity_torque(angle), theirs, rtol=0, atol=1e-11 * abs(theirs).max())


def test_one_configuration_needs_no_leading_axis() -> None:
    robot = Robot.load("six_axis", dynamics="torch")
    angle = _angles(robot, 2)
    motor, stiffness = robot.motor_angle(angle), robot.spring_arrays()[0]
    many = PROCESSOR.solve_equilibrium(robot.mechanism, stiffness, motor)
    one = PROCESSOR.solve_equilibrium(robot.mechanism, stiffness, motor[1])
    for field in ("position", "joint", "torque"):
        np.testing.assert_allclose(getattr(one, field), getattr(many, field)[1], rtol=1e-12, atol=1e-15)
    model = PROCESSOR.second_order_model(robot.mechanism, *robot.spring_arrays(), one.position)
    n = robot.mechanism.n_coordinate
    assert model.mass.shape == model.damping.shape == model.stiffness.shape == (n, n)
    response = PROCESSOR.response_with_gradient(model, 2 * np.pi * FREQUENCY_HZ)
    assert response.response.shape == (15, 6, 6)
    assert response.spring_vectors.shape == (15, 12, 6)


@pytest.mark.parametrize("seed", range(4))
def test_trees_with_sliding_joints_have_the_mass_and_weight_that_the_kernel_finds(seed: int) -> None:
    chain = _tree(seed)
    q = np.random.default_rng(seed + 100).uniform(-2, 2, (5, chain.n_coordinate))
    expected, got = dynamics(chain, q), terms_at(tree_of(chain, CPU), tensor(q, CPU))
    for ours, theirs in (
        (got.mass, expected.mass),
        (got.gravity_torque, expected.bias),
        (got.gravity_stiffness, expected.gravity_stiffness),
    ):
        np.testing.assert_allclose(ours.numpy(), theirs, rtol=0, atol=1e-12 * abs(theirs).max())


def test_weight_and_its_slope_are_the_derivatives_of_the_potential_energy() -> None:
    chain = _tree(11)
    tree = tree_of(chain, CPU)

    def energy(q: Any) -> Any:
        place = frames(tree, q[None])
        centre = place.origin + (place.rotation @ tree.centre[:, :, None])[..., 0]
        return -(tree.mass[:, None] * centre[0] * tree.gravity).sum()

    q = tensor(np.linspace(-1.5, 1.8, chain.n_coordinate), CPU)
    terms = terms_at(tree, q[None])
    slope, curvature = (
        torch.autograd.functional.jacobian(energy, q),
        torch.autograd.functional.hessian(energy, q),
    )
    torch.testing.assert_close(terms.gravity_torque[0], slope, rtol=1e-12, atol=1e-11)
    torch.testing.assert_close(terms.gravity_stiffness[0], curvature, rtol=1e-12, atol=1e-11)


@pytest.mark.filterwarnings("ignore::DeprecationWarning")  # of what pytorch-kinematics imports
def test_the_last_frame_and_its_jacobian_are_those_of_pytorch_kinematics() -> None:
    kinematics = pytest.importorskip("pytorch_kinematics")
    robot = Robot.load("six_axis")
    folder = Path(next(iter(robid_core.robots.__path__))) / "six_axis"
    theirs = kinematics.build_serial_chain_from_urdf((folder / "robot.urdf").read_bytes(), "tool")
    theirs = theirs.to(dtype=torch.float64, device="cpu")
    angle = tensor(_angles(robot), CPU)
    chain, names = robot.chain, [f"axis_{a + 1}" for a in range(6)]
    assert theirs.get_joint_parameter_names() == names
    arm = [chain.index(name) for name in names]
    joints = torch.zeros(len(angle), chain.n_coordinate, dtype=torch.float64)
    joints[:, arm] = angle
    # it rounds the lengths of the file to 24 bits, whatever it is asked to compute with
    chain = replace(chain, translation=chain.translation.astype(np.float32).astype(np.float64))
    place = frames(tree_of(chain, CPU), joints)
    expected = theirs.forward_kinematics(angle).get_matrix()
    torch.testing.assert_close(place.origin[:, arm[-1]], expected[:, :3, 3], rtol=0, atol=1e-12)
    torch.testing.assert_close(place.rotation[:, arm[-1]], expected[:, :3, :3], rtol=0, atol=1e-12)
    axes = place.axis[:, arm]
    lever = place.origin[:, arm[-1:]] - place.origin[:, arm]
    jacobian = torch.cat((torch.linalg.cross(axes, lever), axes), 2).transpose(1, 2)
    torch.testing.assert_close(jacobian, theirs.jacobian(angle), rtol=0, atol=1e-12)


def test_a_batch_cut_to_fit_a_small_memory_gives_the_same_numbers() -> None:
    robot = Robot.load("six_axis")
    small = TorchDynamics(memory_bytes=100_000)  # three positions, or two lines, at a time
    motor, (stiffness, damping) = robot.motor_angle(_angles(robot)), robot.spring_arrays()
    results = []
    for batches in (PROCESSOR, small):
        rest = batches.solve_equilibrium(robot.mechanism, stiffness, motor)
        model = batches.second_order_model(robot.mechanism, stiffness, damping, rest.position)
        results.append(batches.response(model, 2 * np.pi * FREQUENCY_HZ, 1e-3))
    np.testing.assert_allclose(results[1], results[0], rtol=1e-10, atol=1e-14 * abs(results[0]).max())


def test_the_same_batch_gives_the_same_bytes() -> None:
    robot = Robot.load("six_axis", dynamics="torch")
    first, second = (robot.response(_angles(robot), FREQUENCY_HZ) for _ in range(2))
    assert first.tobytes() == second.tobytes()


def test_springs_that_do_not_hold_the_arm_are_told_by_name() -> None:
    robot = Robot.load("six_axis", dynamics="torch")
    soft = robot.with_parameters({"gear_stiffness.axis_2": 1.0})
    with pytest.raises(NotTrustworthy, match=r"equilibrium: .*'.*axis_2"):
        soft.second_order(np.zeros((2, 6)))


@pytest.mark.parametrize("omega", [[0.0, 1.0], [np.nan], [[1.0]]])
def test_frequencies_that_are_none_are_refused(omega: Any) -> None:
    model = Robot.load("one_axis").second_order(np.zeros((1, 1)))
    with pytest.raises(ConfigurationError, match="frequencies must be finite and above zero"):
        PROCESSOR.response(model, np.array(omega))


def test_a_graphics_card_that_is_not_there_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    robot = replace(Robot.load("one_axis"), dynamics="torch.cuda")
    with pytest.raises(ConfigurationError, match=r"no graphics card here; write dynamics: torch"):
        robot.response(np.zeros((1, 1)), FREQUENCY_HZ)
