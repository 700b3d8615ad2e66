"""Mechanisms for the tests of mechanics and of what compiles it: drawn at random, and small arms with known numbers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
import pytest

from robid_core.mechanics import Chain, Mechanism

FloatArray = npt.NDArray[np.float64]
DrawChain = Callable[[np.random.Generator, int, bool], Chain]


@dataclass(frozen=True)
class Arm:
    """A mechanism with its springs."""

    mechanism: Mechanism
    stiffness: FloatArray
    damping: FloatArray

    def without_gravity(self) -> Arm:
        """Return the same arm in free fall."""
        chain = replace(self.mechanism.chain, gravity=np.zeros(3))
        m = self.mechanism
        weightless = Mechanism(chain, m.gear, m.rotor_inertia, m.arm, m.elastic, m.elastic_gear)
        return replace(self, mechanism=weightless)


def _draw_chain(rng: np.random.Generator, n: int, tree: bool) -> Chain:
    axis = rng.normal(size=(n, 3))
    rotation, inertia = [], []
    for _ in range(n):
        q, _unused = np.linalg.qr(rng.normal(size=(3, 3)))
        rotation.append(q * np.sign(np.linalg.det(q)))
        points = rng.normal(size=(6, 3))  # point masses: an inertia that some body has
        inertia.append(np.sum(points**2) * np.eye(3) - points.T @ points)
    mass = rng.uniform(0.5, 3.0, n)
    if n > 3:  # bodies without mass stand before elastic coordinates
        mass[1], inertia[1] = 0.0, np.zeros((3, 3))
    axis /= np.linalg.norm(axis, axis=1)[:, None]
    for j in range(
        0, n, 2
    ):  # every other joint turns or slides along an axis of its frame, as most robots' do
        axis[j] = np.eye(3)[rng.integers(3)]
        if rng.random() < 0.5:
            rotation[j] = np.eye(3)
    return Chain(
        parent=np.array([-1] + [int(rng.integers(-1 if tree else j - 1, j)) for j in range(1, n)]),
        joint_type=rng.integers(0, 2, n),
        axis=axis,
        rotation=np.array(rotation),
        translation=rng.normal(size=(n, 3)),
        mass=mass,
        centre_of_mass=rng.normal(size=(n, 3)),
        inertia=np.array(inertia),
        names=tuple(f"body_{j}" for j in range(n)),
        gravity=np.array([1.0, 2.0, -9.81]),
    )


@pytest.fixture
def draw_chain() -> DrawChain:
    """Draw a chain (or tree) with revolute and prismatic joints in general position."""
    return _draw_chain


def _links(lengths: list[float], masses: list[float], axes: list[list[float]]) -> Chain:
    """Build slender links one behind the other along x, the first joint 0.4 m above the base."""
    n = len(lengths)
    translation = np.zeros((n, 3))
    translation[0, 2] = 0.4
    translation[1:, 0] = lengths[:-1]
    centre = np.zeros((n, 3))
    centre[:, 0] = np.array(lengths) / 2
    moment = np.array(masses) * np.array(lengths) ** 2 / 12
    return Chain(
        parent=np.arange(n) - 1,
        joint_type=np.zeros(n, dtype=np.int64),
        axis=np.array(axes),
        rotation=np.tile(np.eye(3), (n, 1, 1)),
        translation=translation,
        mass=np.array(masses),
        centre_of_mass=centre,
        inertia=moment[:, None, None] * np.diag([0.05, 1.0, 1.0]),
        names=tuple(f"axis_{j + 1}" for j in range(n)),
        gravity=np.array([0.0, 0.0, -9.81]),
    )


@pytest.fixture
def three_axis() -> Arm:
    """Build an arm with a bearing that bends, and axes 2 and 3 coupled like a wrist."""
    chain = _links([0.5, 0.6, 0.3], [30.0, 20.0, 8.0], [[0, 0, 1], [0, 1, 0], [0, 1, 0]])
    chain = chain.with_elastic("axis_1", "axis_1_x", [1.0, 0.0, 0.0])
    gear = np.array([[1 / 80, 0.0, 0.0], [0.0, 1 / 100, 0.0], [0.0, -1 / 200, 1 / 60]])
    mechanism = Mechanism(
        chain,
        gear,
        np.array([1.5e-3, 1e-3, 4e-4]),
        np.array([0, 2, 3]),
        np.array([1]),
        np.ones(3, dtype=np.bool_),
    )
    return Arm(mechanism, np.array([4e4, 3e4, 6e3, 5e4]), np.array([80.0, 60.0, 12.0, 60.0]))


@pytest.fixture
def half_rigid() -> Arm:
    """Build an arm whose second axis has a rigid gear, coupled to the first motor."""
    chain = _links([0.5, 0.4], [10.0, 4.0], [[0, 1, 0], [0, 1, 0]])
    gear = np.array([[1 / 50, 0.0], [1 / 300, 1 / 40]])
    mechanism = Mechanism(
        chain,
        gear,
        np.array([8e-4, 5e-4]),
        np.array([0, 1]),
        np.zeros(0, dtype=np.int64),
        np.array([True, False]),
    )
    return Arm(mechanism, np.array([9e3]), np.array([15.0]))


@pytest.fixture
def carriage() -> Arm:
    """Build one rigid prismatic axis: 95 kg on a spindle, the motor counted in metres of the carriage."""
    chain = Chain(
        parent=np.array([-1]),
        joint_type=np.array([1]),
        axis=np.array([[1.0, 0.0, 0.0]]),
        rotation=np.eye(3)[None],
        translation=np.zeros((1, 3)),
        mass=np.array([95.0]),
        centre_of_mass=np.zeros((1, 3)),
        inertia=np.zeros((1, 3, 3)),
        names=("carriage",),
        gravity=np.array([0.0, 0.0, -9.81]),
    )
    mechanism = Mechanism(
        chain,
        np.eye(1),
        np.zeros(1),
        np.zeros(1, dtype=np.int64),
        np.zeros(0, dtype=np.int64),
        np.zeros(1, dtype=np.bool_),
    )
    return Arm(mechanism, np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64))


@pytest.fixture
def two_mass() -> Arm:
    """Build a motor and a flywheel joined by a spring, ratio 1/10, no gravity torque."""
    chain = Chain(
        parent=np.array([-1]),
        joint_type=np.array([0]),
        axis=np.array([[0.0, 0.0, 1.0]]),
        rotation=np.eye(3)[None],
        translation=np.zeros((1, 3)),
        mass=np.array([5.0]),
        centre_of_mass=np.zeros((1, 3)),
        inertia=np.diag([0.2, 0.2, 0.3])[None],
        names=("axis_1",),
        gravity=np.array([0.0, 0.0, -9.81]),
    )
    mechanism = Mechanism(
        chain,
        np.eye(1) / 10,
        np.array([2e-3]),
        np.zeros(1, dtype=np.int64),
        np.zeros(0, dtype=np.int64),
        np.ones(1, dtype=np.bool_),
    )
    return Arm(mechanism, np.array([3e3]), np.array([0.0]))
