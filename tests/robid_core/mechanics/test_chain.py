"""The chain refuses what is no mechanism, and an elastic coordinate changes nothing while it is straight."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from robid_core.errors import ConfigurationError
from robid_core.mechanics import Chain, Mechanism, dynamics


@pytest.mark.parametrize(
    ("field", "row", "value", "told"),
    [
        ("axis", 2, [0.0, 0.0, 2.0], "body 'body_2': the joint axis has length 2"),
        ("mass", 3, -1.0, "body 'body_3': mass -1 kg"),
        ("mass", 2, np.nan, "body 'body_2': mass holds nan"),
        ("parent", 2, 2, "body 'body_2': its parent has index 2"),
        ("joint_type", 0, 7, "body 'body_0': joint type 7"),
        ("rotation", 3, np.diag([1.0, 1.0, -1.0]), "body 'body_3': its rotation is not orthogonal"),
        ("inertia", 2, np.diag([1.0, 1.0, 3.0]), "body 'body_2': principal moments 1, 1, 3"),
        ("inertia", 2, np.diag([-1.0, 1.0, 1.0]), "body 'body_2': a principal moment of inertia is -1"),
        ("inertia", 1, np.eye(3), "body 'body_1': mass 0 kg; a body with inertia needs"),
    ],
)
def test_a_wrong_number_is_refused_and_its_body_named(
    draw_chain: Callable[..., Chain], field: str, row: int, value: Any, told: str
) -> None:
    chain = draw_chain(np.random.default_rng(1), 4, False)
    changed = getattr(chain, field).copy()
    changed[row] = value
    with pytest.raises(ConfigurationError) as refused:
        replace(chain, **{field: changed})
    assert told in str(refused.value)


def test_names_that_repeat_and_arrays_of_the_wrong_shape_are_refused(
    draw_chain: Callable[..., Chain],
) -> None:
    chain = draw_chain(np.random.default_rng(1), 2, False)
    with pytest.raises(ConfigurationError, match="'a': the name is used twice"):
        replace(chain, names=("a", "a"))
    with pytest.raises(ConfigurationError, match=r"mass has shape \(3,\), expected \(2,\)"):
        replace(chain, mass=np.ones(3))
    with pytest.raises(ConfigurationError, match="no body 'tool'"):
        chain.index("tool")


def test_a_straight_elastic_coordinate_leaves_the_dynamics_alone(draw_chain: Callable[..., Chain]) -> None:
    rng = np.random.default_rng(4)
    chain = draw_chain(rng, 5, True)
    bent = chain.with_elastic("body_2", "bearing", [0.0, 1.0, 0.0])
    assert bent.names == ("body_0", "body_1", "body_2", "bearing", "body_3", "body_4")
    kept = [bent.index(name) for name in chain.names]
    position, speed = rng.normal(size=(2, 5))
    wide_position, wide_speed = np.zeros(6), np.zeros(6)
    wide_position[kept], wide_speed[kept] = position, speed
    before, after = dynamics(chain, position, speed), dynamics(bent, wide_position, wide_speed)
    np.testing.assert_allclose(
        after.mass[np.ix_(kept, kept)], before.mass, rtol=0, atol=1e-12 * before.mass.max()
    )
    np.testing.assert_allclose(after.bias[kept], before.bias, rtol=0, atol=1e-12 * abs(before.bias).max())


def test_the_body_behind_an_elastic_coordinate_turns_with_it(draw_chain: Callable[..., Chain]) -> None:
    # About its own axis an elastic coordinate is the same as the joint it stands behind.
    rng = np.random.default_rng(5)
    chain = replace(draw_chain(rng, 5, True), joint_type=np.zeros(5, dtype=np.int64))
    bent = chain.with_elastic("body_2", "bearing", chain.axis[2])
    position = rng.normal(size=5)
    split = np.insert(position, 3, 0.4)
    split[2] -= 0.4
    joined, parted = dynamics(chain, position), dynamics(bent, split)
    assert parted.bias[3] == pytest.approx(joined.bias[2], rel=1e-11)
    assert parted.mass[3, 3] == pytest.approx(joined.mass[2, 2], rel=1e-11)


def test_a_mechanism_with_a_joint_that_nothing_holds_is_refused(draw_chain: Callable[..., Chain]) -> None:
    chain = draw_chain(np.random.default_rng(1), 3, False)
    one, free = np.ones(1), np.zeros(0, dtype=np.int64)
    with pytest.raises(ConfigurationError, match=r"joints \[0, 1\] are driven or elastic"):
        Mechanism(chain, np.eye(1), one, np.array([0]), np.array([1]), np.ones(1, dtype=np.bool_))
    pair = replace(chain, **_first(chain, 1))
    with pytest.raises(ConfigurationError, match="body_0: rotor inertia 0"):
        Mechanism(pair, np.eye(1), 0 * one, np.array([0]), free, np.ones(1, dtype=np.bool_))
    with pytest.raises(ConfigurationError, match="gear matrix is singular"):
        Mechanism(pair, 0 * np.eye(1), one, np.array([0]), free, np.ones(1, dtype=np.bool_))


def _first(chain: Chain, n: int) -> dict[str, Any]:
    fields = (
        "parent",
        "joint_type",
        "axis",
        "rotation",
        "translation",
        "mass",
        "centre_of_mass",
        "inertia",
        "names",
    )
    return {name: getattr(chain, name)[:n] for name in fields}
