"""The regressor of a rigid robot against pinocchio, and the numbers of base parameters that textbooks state."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from robid_core.estimation.rigid.regression import base_parameters
from robid_core.estimation.rigid.rigid_body import inertial_parameters, inverse_dynamics_regressor
from robid_core.mechanics import Chain

PARENTS = (-1, 0, 1, 1, 3, 4)
TYPES = (0, 1, 0, 0, 0, 1)


def rotation(draw: np.random.Generator) -> np.ndarray:
    q = np.linalg.qr(draw.normal(size=(3, 3)))[0]
    return q * np.sign(np.linalg.det(q))


def random_tree(seed: int) -> tuple[Chain, pin.Model]:
    """The same tree for us and for pinocchio: branches, revolute and prismatic joints, skew axes."""
    draw = np.random.default_rng(seed)
    model, rows = pin.Model(), []
    for j, (parent, kind) in enumerate(zip(PARENTS, TYPES, strict=True)):
        turn, shift, axis = rotation(draw), draw.normal(size=3), draw.normal(size=3)
        axis /= np.linalg.norm(axis)
        joint = pin.JointModelPrismaticUnaligned(axis) if kind else pin.JointModelRevoluteUnaligned(axis)
        index = model.addJoint(parent + 1, joint, pin.SE3(turn, shift), f"joint_{j}")
        square = draw.normal(size=(3, 3))
        spread = square @ square.T
        inertia = np.trace(spread) * np.eye(3) - spread  # of a body that can exist
        mass, centre = draw.uniform(0.5, 5), draw.normal(size=3)
        model.appendBodyToJoint(index, pin.Inertia(mass, centre, inertia), pin.SE3.Identity())
        rows.append((axis, turn, shift, mass, centre, inertia))
    model.gravity.linear = np.array([1.0, -2.0, -9.81])
    axis, turn, shift, mass, centre, inertia = (np.array(column) for column in zip(*rows, strict=True))
    chain = Chain(
        parent=np.array(PARENTS),
        joint_type=np.array(TYPES),
        axis=axis,
        rotation=turn,
        translation=shift,
        mass=mass,
        centre_of_mass=centre,
        inertia=inertia,
        names=tuple(f"joint_{j}" for j in range(6)),
        gravity=np.array([1.0, -2.0, -9.81]),
    )
    return chain, model


@pytest.mark.parametrize("seed", range(3))
def test_regressor_times_parameters_is_the_inverse_dynamics_of_pinocchio(seed: int) -> None:
    chain, model = random_tree(seed)
    motion = np.random.default_rng(100 + seed).normal(size=(3, 4, 6))
    ours = inverse_dynamics_regressor(chain, *motion) @ inertial_parameters(chain).ravel()
    data = model.createData()
    for k in range(4):
        theirs = pin.rnea(model, data, *motion[:, k])
        np.testing.assert_allclose(ours[k], theirs, rtol=1e-10, atol=1e-10 * np.abs(theirs).max())


def test_each_column_is_that_of_pinocchio() -> None:
    chain, model = random_tree(7)
    q, v, a = np.random.default_rng(8).normal(size=(3, 6))
    ours = inverse_dynamics_regressor(chain, q[None], v[None], a[None])[0].reshape(6, 6, 10)
    theirs = pin.computeJointTorqueRegressor(model, model.createData(), q, v, a).reshape(6, 6, 10)
    # pinocchio orders the inertia xx, xy, yy, xz, yz, zz.
    order = [0, 1, 2, 3, 4, 5, 7, 6, 8, 9]
    np.testing.assert_allclose(ours, theirs[:, :, order], atol=1e-10 * np.abs(theirs).max())


def planar_arm(gravity: tuple[float, float, float]) -> Chain:
    return Chain(
        parent=np.array([-1, 0]),
        joint_type=np.array([0, 0]),
        axis=np.array([[0.0, 0.0, 1.0]] * 2),
        rotation=np.array([np.eye(3)] * 2),
        translation=np.array([[0.0, 0.0, 0.0], [0.7, 0.0, 0.0]]),
        mass=np.ones(2),
        centre_of_mass=np.full((2, 3), 0.1),
        inertia=np.array([np.eye(3)] * 2),
        names=("first", "second"),
        gravity=np.array(gravity),
    )


@pytest.mark.parametrize(
    ("gravity", "n_base"),
    [((0.0, 0.0, -9.81), 4), ((0.0, -9.81, 0.0), 6)],
    ids=["horizontal: ZZ1R MX2 MY2 ZZ2", "vertical: and MX1R MY1"],
)
def test_a_planar_arm_has_the_base_parameters_of_the_textbook(
    gravity: tuple[float, float, float], n_base: int
) -> None:
    # Khalil and Dombre (2002), section 9.4: m2 l^2 joins ZZ1, and with gravity in the plane m2 l joins MX1.
    chain = planar_arm(gravity)
    motion = np.random.default_rng(0).normal(size=(3, 100, 2))
    regressor = inverse_dynamics_regressor(chain, *motion).reshape(-1, 20)
    base = base_parameters(regressor)
    assert len(base.independent) == n_base
    # The combinations carry the whole torque.
    parameters = inertial_parameters(chain).ravel()
    np.testing.assert_allclose(
        regressor[:, base.independent] @ base.values(parameters), regressor @ parameters, atol=1e-10
    )
