"""Mass matrix, velocity and gravity forces and their slopes against pinocchio, whole robots included."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from oracles.pinocchio_robot import PinocchioChain
from oracles.robots import drawn_robot

from robid_core import Robot
from robid_core.mechanics import Chain, dynamics

# Both sum the same few hundred products in another order: 1e-16 times their number.
RELATIVE = 1e-10


def _chain(name: str) -> Chain:
    if name == "six_axis":
        return Robot.load("six_axis").chain
    generator = np.random.default_rng(sum(map(ord, name)))
    robots = {
        "arm of revolute joints": drawn_robot(generator, 6, n_bearing=8),
        "tree": drawn_robot(generator, 8, tree=True, n_bearing=5),
        "tree with sliding joints": drawn_robot(generator, 9, tree=True, prismatic=True, n_bearing=6),
        "twelve axes": drawn_robot(generator, 12, prismatic=True, n_bearing=14),
    }
    return robots[name].chain


CHAINS = ("six_axis", "arm of revolute joints", "tree", "tree with sliding joints", "twelve axes")


def _close(ours: Any, theirs: Any) -> None:
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=RELATIVE * abs(theirs).max())


@pytest.mark.parametrize("name", CHAINS)
def test_mass_matrix_and_forces_are_pinocchios(name: str) -> None:
    chain = _chain(name)
    oracle = PinocchioChain(chain)
    generator = np.random.default_rng(1)
    for _ in range(10):
        q, v = generator.normal(size=(2, chain.n_coordinate)) * [[1.0], [3.0]]
        moving, still = dynamics(chain, q, v), dynamics(chain, q)
        _close(moving.mass, oracle.mass(q))
        _close(still.bias, oracle.gravity(q))
        _close(moving.bias, oracle.force(q, v, np.zeros_like(q)))
        # the velocities' part alone, through another of pinocchio's algorithms; a difference of forces of the
        # size of both
        coriolis = oracle.coriolis(q, v)
        size = abs(coriolis).max() + abs(still.bias).max()
        np.testing.assert_allclose(moving.bias - still.bias, coriolis, rtol=0, atol=RELATIVE * size)


@pytest.mark.parametrize("name", CHAINS)
def test_gravity_stiffness_is_pinocchios_derivative_of_inverse_dynamics(name: str) -> None:
    chain = _chain(name)
    oracle = PinocchioChain(chain)
    generator = np.random.default_rng(2)
    still = np.zeros(chain.n_coordinate)
    for _ in range(10):
        q = generator.normal(size=chain.n_coordinate)
        _close(dynamics(chain, q).gravity_stiffness, oracle.force_slope(q, still, still))


def test_the_comparison_sees_a_centre_of_mass_a_micrometre_off() -> None:
    from dataclasses import replace

    chain = _chain("six_axis")
    centre = chain.centre_of_mass.copy()
    centre[-1, 0] += 1e-6
    q = np.random.default_rng(3).normal(size=chain.n_coordinate)
    ours = dynamics(replace(chain, centre_of_mass=centre), q).bias
    with pytest.raises(AssertionError):
        _close(ours, PinocchioChain(chain).gravity(q))
