"""Inertia and weight over generalised coordinates, against the chain's own and the map of its joints."""

from __future__ import annotations

import numpy as np
import pytest

from robid_core.mechanics.reference import dynamics_by_jacobians
from robid_core.mechanics.rest import terms_at_rest


@pytest.mark.parametrize("name", ["three_axis", "half_rigid", "carriage"])
def test_terms_are_those_of_the_chain_seen_through_the_gears(
    name: str, request: pytest.FixtureRequest
) -> None:
    mechanism = request.getfixturevalue(name).mechanism
    joints, n = mechanism.constraint_map, mechanism.n_coordinate
    position = np.random.default_rng(8).uniform(-1, 1, (2, 5, n))
    terms = terms_at_rest(mechanism, position)
    assert terms.mass.shape == terms.gravity_stiffness.shape == (2, 5, n, n)
    rotors = np.diag(np.concatenate((mechanism.rotor_inertia, np.zeros(n - mechanism.n_axis))))
    for i in np.ndindex(2, 5):
        q = joints @ position[i]
        chain = dynamics_by_jacobians(mechanism.chain, q, np.zeros_like(q))
        for got, expected in (
            (terms.mass[i], joints.T @ chain.mass @ joints + rotors),
            (terms.bias[i], joints.T @ chain.bias),
            (terms.gravity_stiffness[i], joints.T @ chain.gravity_stiffness @ joints),
        ):
            np.testing.assert_allclose(got, expected, rtol=0, atol=1e-12 * abs(expected).max(initial=1.0))
