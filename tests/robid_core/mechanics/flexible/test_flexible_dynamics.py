"""Equations of motion of flexible links against Lagrange's, against point masses, and in a free flight."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from robid_core.mechanics.chain import MODAL, Chain
from robid_core.mechanics.flexible import FlexibleBody, attach_flexible, flexible_body, hollow_square
from robid_core.mechanics.reference import dynamics_by_jacobians, potential_energy

BEAM = hollow_square(1.0, 0.06, 0.003)
_STEP = 1e-5


def _chain(rng: np.random.Generator, n: int, tree: bool = False) -> Chain:
    rotation = Rotation.random(n, random_state=rng).as_matrix()
    axis = rng.normal(size=(n, 3))
    joint_type = np.zeros(n, dtype=np.int64)
    if n > 3:
        joint_type[-2] = 1
    return Chain(
        parent=np.array([-1, *(max(0, j - 2) if tree else j - 1 for j in range(1, n))]),
        joint_type=joint_type,
        axis=axis / np.linalg.norm(axis, axis=1)[:, None],
        rotation=rotation,
        translation=rng.normal(size=(n, 3)),
        mass=rng.uniform(1.0, 3.0, n),
        centre_of_mass=0.3 * rng.normal(size=(n, 3)),
        inertia=np.tile(np.diag([0.3, 0.4, 0.5]), (n, 1, 1)),
        names=tuple(f"axis_{j + 1}" for j in range(n)),
        gravity=np.array([1.0, 2.0, -9.81]),
    )


def _flexible_chain(rng: np.random.Generator, tree: bool = False) -> Chain:
    link = flexible_body(BEAM.structure(8), 0, 8, 2)
    place = Rotation.random(2, random_state=rng).as_matrix()
    chain = _chain(rng, 4, tree)
    chain = attach_flexible(chain, "axis_2", "lower", link.truncated(4).placed(place[0], rng.normal(size=3)))
    return attach_flexible(chain, "axis_3", "upper", link.truncated(3).placed(place[1], rng.normal(size=3)))


def _drawn(chain: Chain, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    position, speed = rng.normal(size=(2, chain.n_coordinate))
    position[chain.joint_type == MODAL] *= 0.02
    return position, speed


@pytest.mark.parametrize("tree", [False, True])
def test_bias_follows_from_mass_matrix_and_potential_by_lagrange(tree: bool) -> None:
    rng = np.random.default_rng(7)
    chain = _flexible_chain(rng, tree)
    position, speed = _drawn(chain, rng)
    terms = dynamics_by_jacobians(chain, position, speed)
    unit = np.eye(chain.n_coordinate) * _STEP
    rest = np.zeros_like(speed)

    def slope(function: object) -> np.ndarray:
        return np.array([(function(position + e) - function(position - e)) / (2 * _STEP) for e in unit])  # type: ignore[operator]

    change = slope(lambda q: dynamics_by_jacobians(chain, q, rest).mass)  # [k] by coordinate k
    weight = slope(lambda q: potential_energy(chain, q))
    expected = (
        np.einsum("kij,k,j->i", change, speed, speed) - np.einsum("ijk,j,k->i", change, speed, speed) / 2
    )
    # central differences: step^2 of third derivatives of the order of the terms, and rounding / step
    np.testing.assert_allclose(terms.bias, expected + weight, atol=1e-7 * abs(terms.bias).max())
    at_rest = dynamics_by_jacobians(chain, position, rest)
    np.testing.assert_allclose(at_rest.bias, weight, atol=1e-8 * abs(weight).max())
    stiffness = slope(lambda q: dynamics_by_jacobians(chain, q, rest).bias)
    np.testing.assert_allclose(terms.gravity_stiffness, stiffness.T, atol=1e-8 * abs(weight).max())


def test_mass_matrix_is_symmetric_and_positive_definite_and_gravity_stiffness_symmetric() -> None:
    rng = np.random.default_rng(8)
    for tree in (False, True):
        chain = _flexible_chain(rng, tree)
        terms = dynamics_by_jacobians(chain, *_drawn(chain, rng))
        np.testing.assert_allclose(terms.mass, terms.mass.T, atol=1e-12 * abs(terms.mass).max())
        np.testing.assert_allclose(
            terms.gravity_stiffness,
            terms.gravity_stiffness.T,
            atol=1e-12 * abs(terms.gravity_stiffness).max(),
        )
        assert np.linalg.eigvalsh(terms.mass)[0] > 0


def test_a_steady_translation_of_the_base_is_not_felt() -> None:
    # Galilei: a slide at constant speed before the whole chain changes no force
    rng = np.random.default_rng(9)
    chain = _flexible_chain(rng)
    n = chain.n_coordinate
    wagon = Chain(
        parent=np.r_[-1, chain.parent + 1],
        joint_type=np.r_[1, chain.joint_type],
        axis=np.r_[[[1.0, 0.0, 0.0]], chain.axis],
        rotation=np.r_[np.eye(3)[None], chain.rotation],
        translation=np.r_[np.zeros((1, 3)), chain.translation],
        mass=np.r_[0.0, chain.mass],
        centre_of_mass=np.r_[np.zeros((1, 3)), chain.centre_of_mass],
        inertia=np.r_[np.zeros((1, 3, 3)), chain.inertia],
        names=("wagon", *chain.names),
        gravity=chain.gravity,
        slide=np.r_[np.zeros((1, 3)), chain.slide],
        flexible_root=np.r_[-1, np.where(chain.flexible_root >= 0, chain.flexible_root + 1, -1)],
        modal_momentum=np.r_[np.zeros((1, 6)), chain.modal_momentum],
        modal_mass=np.pad(chain.modal_mass, ((1, 0), (1, 0))),
        modal_inertia=np.r_[np.zeros((1, 3, 3)), chain.modal_inertia],
    )
    position, speed = _drawn(chain, rng)
    standing = dynamics_by_jacobians(chain, position, speed).bias
    moving = dynamics_by_jacobians(wagon, np.r_[3.0, position], np.r_[7.0, speed]).bias
    assert len(moving) == n + 1
    np.testing.assert_allclose(moving[1:], standing, atol=1e-10 * abs(standing).max())


def _points_on_a_body(rng: np.random.Generator) -> tuple[FlexibleBody, np.ndarray, np.ndarray, np.ndarray]:
    """Six point masses, each moved by three modes; masses, places, shapes (n_mode, n_point, 3)."""
    masses, places, shapes = (
        rng.uniform(0.5, 1.5, 6),
        rng.normal(size=(6, 3)),
        0.3 * rng.normal(size=(3, 6, 3)),
    )
    centre = masses @ places / masses.sum()
    arms = places - centre
    inner = np.einsum("n,na,kna->k", masses, places, shapes)
    outer = np.einsum("n,na,knb->kab", masses, places, shapes)
    body = FlexibleBody(
        mass=masses.sum(),
        centre_of_mass=centre,
        inertia=np.einsum("n,na,na->", masses, arms, arms) * np.eye(3)
        - np.einsum("n,na,nb->ab", masses, arms, arms),
        tip=places[-1],
        tip_modes=np.concatenate((np.zeros((3, 3)), shapes[:, -1].T)),
        momentum=np.concatenate(
            (np.einsum("n,kna->ak", masses, np.cross(places, shapes)), np.einsum("n,kna->ak", masses, shapes))
        ),
        modal_mass=np.einsum("n,kna,lna->kl", masses, shapes, shapes),
        modal_stiffness=np.eye(3),
        modal_damping=np.zeros((3, 3)),
        inertia_slope=2 * inner[:, None, None] * np.eye(3) - outer - outer.transpose(0, 2, 1),
    )
    return body, masses, places, shapes


def _mass_of_points(
    chain: Chain, masses: np.ndarray, places: np.ndarray, shapes: np.ndarray, q: np.ndarray
) -> np.ndarray:
    """Mass matrix of two turning joints, the second with the points: sum of m J^T J, J by differences."""

    def where(q: np.ndarray) -> np.ndarray:
        axes, origin = np.eye(3), np.zeros(3)
        for j in range(2):
            origin = origin + axes @ chain.translation[j]
            axes = axes @ chain.rotation[j] @ Rotation.from_rotvec(chain.axis[j] * q[j]).as_matrix()
        return origin + (places + np.einsum("k,kna->na", q[2:], shapes)) @ axes.T

    step = 1e-4
    unit = np.eye(len(q)) * step
    # fourth order: error step^4 / 30 of fifth derivatives, 1e-17, and rounding 1e-16 / step
    moved = np.array(
        [
            (8 * (where(q + e) - where(q - e)) - where(q + 2 * e) + where(q - 2 * e)) / (12 * step)
            for e in unit
        ]
    )
    return np.einsum("n,ina,jna->ij", masses, moved, moved)


def test_a_body_of_point_masses_has_their_kinetic_energy_to_first_order() -> None:
    rng = np.random.default_rng(10)
    body, masses, places, shapes = _points_on_a_body(rng)
    chain = _chain(rng, 2)
    hollow = {"mass": np.zeros(2), "centre_of_mass": np.zeros((2, 3)), "inertia": np.zeros((2, 3, 3))}
    rigid = Chain(**{**{f: getattr(chain, f) for f in chain.__dataclass_fields__}, **hollow})
    flexible = attach_flexible(rigid, "axis_2", "cloud", body)
    turned, bent = rng.normal(size=2), rng.normal(size=3)
    gaps = []
    for size in (0.0, 1e-3, 2e-3):
        q = np.r_[turned, size * bent]
        exact = _mass_of_points(flexible, masses, places, shapes, q)
        ours = dynamics_by_jacobians(flexible, q, np.zeros(5)).mass
        gaps.append(ours - exact)
    scale = abs(exact).max()
    np.testing.assert_allclose(gaps[0], 0, atol=1e-10 * scale)
    # rigid motion: what is left out is of second order, so it grows fourfold
    np.testing.assert_allclose(gaps[2][:2, :2], 4 * gaps[1][:2, :2], atol=1e-3 * abs(gaps[2][:2, :2]).max())
    assert 0 < abs(gaps[2][:2, :2]).max() < (2e-3 * np.linalg.norm(bent)) ** 2 * scale
    # modes among themselves: nothing is left out
    np.testing.assert_allclose(gaps[2][2:, 2:], 0, atol=1e-10 * scale)


def test_point_masses_at_rest_in_the_body_pull_on_the_modes_exactly() -> None:
    rng = np.random.default_rng(11)
    body, masses, places, shapes = _points_on_a_body(rng)
    chain = _chain(rng, 2)
    hollow = {"mass": np.zeros(2), "centre_of_mass": np.zeros((2, 3)), "inertia": np.zeros((2, 3, 3))}
    rigid = Chain(
        **{**{f: getattr(chain, f) for f in chain.__dataclass_fields__}, **hollow, "gravity": np.zeros(3)}
    )
    flexible = attach_flexible(rigid, "axis_2", "cloud", body)
    q, speed = np.r_[rng.normal(size=2), np.zeros(3)], np.r_[rng.normal(size=2), np.zeros(3)]
    step = 1e-3
    change = np.array(
        [
            (
                _mass_of_points(flexible, masses, places, shapes, q + e)
                - _mass_of_points(flexible, masses, places, shapes, q - e)
            )
            / (2 * step)
            for e in np.eye(5) * step
        ]
    )
    expected = (
        np.einsum("kij,k,j->i", change, speed, speed) - np.einsum("ijk,j,k->i", change, speed, speed) / 2
    )
    ours = dynamics_by_jacobians(flexible, q, speed).bias
    np.testing.assert_allclose(ours, expected, atol=1e-5 * abs(expected).max())


def test_a_falling_flexible_arm_keeps_its_energy() -> None:
    soft = hollow_square(1.0, 0.02, 0.001)
    body = flexible_body(soft.structure(8), 0, 8).truncated(2)
    rng = np.random.default_rng(12)
    chain = attach_flexible(_chain(rng, 3), "axis_2", "link", body)
    modes = np.flatnonzero(chain.joint_type == MODAL)
    spring = np.zeros((5, 5))
    spring[np.ix_(modes, modes)] = body.modal_stiffness

    def rates(_t: float, state: np.ndarray) -> np.ndarray:
        terms = dynamics_by_jacobians(chain, state[:5], state[5:])
        return np.r_[state[5:], np.linalg.solve(terms.mass, -terms.bias - spring @ state[:5])]

    def energies(state: np.ndarray) -> np.ndarray:
        q, v = state[:5], state[5:]
        kinetic = v @ dynamics_by_jacobians(chain, q, v).mass @ v / 2
        return np.array([kinetic, potential_energy(chain, q), q @ spring @ q / 2])

    start = np.r_[0.3, -0.5, 0.0, 0.0, 0.4, 2.0, -3.0, 0.0, 0.0, 4.0]
    way = solve_ivp(rates, (0.0, 0.15), start, method="DOP853", rtol=1e-9, atol=1e-10)
    history = np.array([energies(state) for state in way.y.T[::10]])
    exchanged = np.ptp(history, axis=0)
    assert (exchanged > [1.0, 1.0, 0.05]).all()  # J: every store takes part
    np.testing.assert_allclose(history.sum(axis=1), history[0].sum(), atol=1e-6 * exchanged.max())
