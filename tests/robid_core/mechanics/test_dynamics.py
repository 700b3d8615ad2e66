"""The dynamics kernel against its numpy twin and against pinocchio."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio
import pytest

from robid_core.mechanics import Chain, dynamics
from robid_core.mechanics.reference import dynamics_by_jacobians


def _pinocchio_model(chain: Chain) -> pinocchio.Model:
    model = pinocchio.Model()
    model.gravity.linear = chain.gravity
    ids = {-1: 0}
    for j in _depth_first(chain):  # pinocchio wants the joints of a branch one behind the other
        kind = (
            pinocchio.JointModelPrismaticUnaligned
            if chain.joint_type[j]
            else pinocchio.JointModelRevoluteUnaligned
        )
        placement = pinocchio.SE3(chain.rotation[j], chain.translation[j])
        joint = ids[j] = model.addJoint(
            ids[int(chain.parent[j])], kind(chain.axis[j]), placement, chain.names[j]
        )
        inertia = pinocchio.Inertia(float(chain.mass[j]), chain.centre_of_mass[j], chain.inertia[j])
        model.appendBodyToJoint(joint, inertia, pinocchio.SE3.Identity())
    return model


def _depth_first(chain: Chain, parent: int = -1) -> list[int]:
    return [k for j in np.flatnonzero(chain.parent == parent) for k in (int(j), *_depth_first(chain, int(j)))]


@pytest.mark.parametrize("tree", [False, True])
@pytest.mark.parametrize("n", [1, 2, 7, 12])
def test_kernel_agrees_with_pinocchio_and_with_its_twin(
    draw_chain: Callable[..., Chain], n: int, tree: bool
) -> None:
    rng = np.random.default_rng(100 * n + tree)
    for _ in range(5):
        chain = draw_chain(rng, n, tree)
        model = _pinocchio_model(chain)
        place = [model.joints[model.getJointId(name)].idx_v for name in chain.names]
        position, speed = rng.normal(size=(2, n))
        q, v = np.empty(n), np.empty(n)
        q[place], v[place] = position, speed
        data = model.createData()
        upper = np.triu(pinocchio.crba(model, data, q))
        mass = (upper + np.triu(upper, 1).T)[np.ix_(place, place)]
        bias = pinocchio.rnea(model, data, q, v, np.zeros(n))[place]
        stiffness = pinocchio.computeGeneralizedGravityDerivatives(model, data, q)[np.ix_(place, place)]
        twin = dynamics_by_jacobians(chain, position, speed)
        ours = dynamics(chain, position, speed)
        for name, theirs in (("mass", mass), ("bias", bias), ("gravity_stiffness", stiffness)):
            tolerance = 1e-10 * max(abs(theirs).max(), 1.0)
            np.testing.assert_allclose(getattr(ours, name), theirs, rtol=0, atol=tolerance, err_msg=name)
            np.testing.assert_allclose(getattr(twin, name), theirs, rtol=0, atol=tolerance, err_msg=name)


def test_many_positions_at_once_are_each_computed_alone(draw_chain: Callable[..., Chain]) -> None:
    rng = np.random.default_rng(3)
    chain = draw_chain(rng, 6, True)
    position, speed = rng.normal(size=(2, 4, 3, 6))
    together = dynamics(chain, position, speed)
    assert together.mass.shape == (4, 3, 6, 6)
    alone = dynamics(chain, position[2, 1], speed[2, 1])
    np.testing.assert_array_equal(together.mass[2, 1], alone.mass)
    np.testing.assert_array_equal(together.bias[2, 1], alone.bias)
    np.testing.assert_array_equal(together.gravity_stiffness[2, 1], alone.gravity_stiffness)


def test_gravity_stiffness_is_the_slope_of_the_gravity_torque(draw_chain: Callable[..., Chain]) -> None:
    rng = np.random.default_rng(8)
    chain = draw_chain(rng, 6, True)
    position, step = rng.normal(size=6), 1e-5
    moved = position + step * np.concatenate((np.eye(6), -np.eye(6)))
    bias = dynamics(chain, moved).bias
    slope = (bias[:6] - bias[6:]).T / (2 * step)
    # central differences: step^2 / 6 of the third derivative, which is of the size of the torque itself, plus
    # rounding 1e-16 / step of it
    np.testing.assert_allclose(
        dynamics(chain, position).gravity_stiffness, slope, atol=1e-9 * abs(bias).max(), rtol=0
    )


def test_rows_do_not_depend_on_how_many_are_evaluated_at_once(draw_chain: Callable[..., Chain]) -> None:
    rng = np.random.default_rng(9)
    chain = draw_chain(rng, 7, True)
    position, speed = rng.normal(size=(2, 21, 7))
    together = dynamics(chain, position, speed)  # two blocks of lanes and a part
    for row in (0, 8, 20):
        alone = dynamics(chain, position[row], speed[row])
        np.testing.assert_array_equal(together.mass[row], alone.mass)
        np.testing.assert_array_equal(together.bias[row], alone.bias)
        np.testing.assert_array_equal(together.gravity_stiffness[row], alone.gravity_stiffness)
