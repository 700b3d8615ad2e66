"""Poses and Jacobians by pytorch-kinematics against those of the kernel and of pinocchio's chains."""

from __future__ import annotations

import numpy as np
import pytest

from robid_core import Robot
from robid_core.mechanics import Chain, pose_of

torch = pytest.importorskip("torch")
pytest.importorskip("pytorch_kinematics")

from robid_torch.batches import PROCESSOR, TorchDynamics  # noqa: E402
from robid_torch.kinematics import expressible  # noqa: E402

POINT = (0.05, -0.1, 0.2)
CLOSE = 1e-12  # m and 1: a dozen products of rotations; lengths of a metre


def tree(seed: int, n: int = 7) -> Chain:
    """Draw a tree of revolute and prismatic joints in general position."""
    rng = np.random.default_rng(seed)
    turned = [np.linalg.qr(rng.normal(size=(3, 3)))[0] for _ in range(n)]
    axis = rng.normal(size=(n, 3))
    return Chain(
        parent=np.array([-1] + [int(rng.integers(-1, j)) for j in range(1, n)]),
        joint_type=rng.integers(0, 2, n),
        axis=axis / np.linalg.norm(axis, axis=1)[:, None],
        rotation=np.array([q * np.sign(np.linalg.det(q)) for q in turned]),
        translation=rng.normal(size=(n, 3)),
        mass=np.ones(n),
        centre_of_mass=np.zeros((n, 3)),
        inertia=np.tile(np.eye(3), (n, 1, 1)),
        names=tuple(f"body_{j}" for j in range(n)),
        gravity=np.array([0.0, 0.0, -9.81]),
    )


def assert_alike(chain: Chain, position: np.ndarray, body: str, batches: TorchDynamics = PROCESSOR) -> None:
    got, wanted = batches.pose_of(chain, position, body, POINT), pose_of(chain, position, body, POINT)
    for field in ("rotation", "position", "jacobian"):
        ours, theirs = getattr(got, field), getattr(wanted, field)
        assert ours.shape == theirs.shape
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=CLOSE * max(1.0, abs(theirs).max()))


@pytest.mark.parametrize("seed", range(4))
def test_trees_of_turning_and_sliding_joints_stand_alike(seed: int) -> None:
    chain = tree(seed)
    q = np.random.default_rng(seed + 50).uniform(-3, 3, (6, chain.n_coordinate))
    for body in chain.names:
        assert expressible(chain, body)
        assert_alike(chain, q, body)


def test_elastic_coordinates_of_six_axes_are_joints_like_others() -> None:
    chain = Robot.load("six_axis").chain
    assert len(chain.names) == 12
    q = np.random.default_rng(1).uniform(-2, 2, (3, 4, 12))
    for body in (chain.names[0], chain.names[-1]):
        assert_alike(chain, q, body)
        assert_alike(chain, q[0, 0], body)


def test_a_batch_cut_to_fit_a_small_memory_stands_alike() -> None:
    chain = Robot.load("six_axis").chain
    q = np.random.default_rng(2).uniform(-2, 2, (9, 12))
    assert_alike(chain, q, chain.names[-1], TorchDynamics(memory_bytes=30_000))


def test_links_that_bend_are_left_to_the_kernel() -> None:
    """A mode turns and slides at once: the same bytes, since the same function computes them."""
    chain = Robot.load("six_axis_flex").chain
    q = np.random.default_rng(3).normal(size=(2, chain.n_coordinate))
    assert not expressible(chain, chain.names[-1])
    got, wanted = PROCESSOR.pose_of(chain, q, chain.names[-1]), pose_of(chain, q, chain.names[-1])
    assert got.jacobian.tobytes() == wanted.jacobian.tobytes()


def test_accelerations_of_a_frame_come_from_the_jacobian() -> None:
    """An output of the linear model: what either backend says of the last frame, within rounding."""
    angle, outputs = np.array([0.3, 0.4, -0.3, 0.5, 0.6, 0.2]), ("frame_acceleration.axis_6",)
    models = [Robot.load("six_axis", dynamics=name).linearize(angle, outputs) for name in ("kernel", "torch")]
    for field in ("c", "d"):
        ours, theirs = getattr(models[1], field), getattr(models[0], field)
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-9 * abs(theirs).max())
