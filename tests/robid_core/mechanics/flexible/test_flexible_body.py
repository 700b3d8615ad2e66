"""The flexible body: rigid properties, two constructors that share no formula, placement, truncation."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from robid_core.errors import ConfigurationError
from robid_core.mechanics.flexible import FlexibleBody, Structure, assumed_modes, flexible_body, hollow_square
from robid_core.mechanics.flexible.assumed_modes import cantilever_shapes, polynomial_shapes

BEAM = hollow_square(0.8, 0.05, 0.004)
SECTIONS_APART = replace(BEAM, bending_stiffness=(4e4, 9e4))  # no two frequencies alike
FIELDS = ("centre_of_mass", "inertia", "tip", "tip_modes", "momentum", "modal_stiffness", "inertia_slope")


def _body(n_fixed_mode: int = 12) -> FlexibleBody:
    return flexible_body(SECTIONS_APART.structure(30), 0, 30, n_fixed_mode)


def test_rigid_properties_come_out_of_the_mass_matrix() -> None:
    body = _body(0)
    assert body.mass == pytest.approx(BEAM.mass, rel=1e-12)
    np.testing.assert_allclose(body.centre_of_mass, [0.4, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(body.inertia, BEAM.inertia(0.8), atol=1e-12)
    np.testing.assert_allclose(body.tip, [0.8, 0.0, 0.0], atol=1e-15)


def test_root_and_tip_may_stand_anywhere_in_the_structure() -> None:
    # seen from its tip the beam is the same beam along -x
    back = flexible_body(SECTIONS_APART.structure(30), 30, 0, 12)
    turned = _body().placed(np.diag([-1.0, -1.0, 1.0]))
    for field in FIELDS[:3]:
        np.testing.assert_allclose(getattr(back, field), getattr(turned, field), atol=1e-12, err_msg=field)
    np.testing.assert_allclose(abs(back.tip_modes[:, :4]), abs(turned.tip_modes[:, :4]), rtol=1e-5, atol=1e-7)
    np.testing.assert_allclose(abs(back.momentum[:, :4]), abs(turned.momentum[:, :4]), rtol=1e-5, atol=1e-7)


@pytest.mark.parametrize("shapes", ["cantilever", "polynomial"])
def test_finite_elements_and_assumed_modes_are_one_body(shapes: str) -> None:
    beam = replace(SECTIONS_APART, section_inertia=(SECTIONS_APART.section_inertia[0], 0.0, 0.0))
    elements = flexible_body(beam.structure(30), 0, 30, 60)
    assumed = assumed_modes(beam, (6, 6), 6, 6, shapes=shapes)
    n = 6  # bendings, torsion
    np.testing.assert_allclose(elements.frequency_hz[:n], assumed.frequency_hz[:n], rtol=1e-3)
    for field in ("tip_modes", "momentum"):
        one, other = getattr(elements, field)[:, :n], getattr(assumed, field)[:, :n]
        np.testing.assert_allclose(one, other, atol=1e-3 * abs(other).max(), err_msg=field)
    # the slope of the inertia comes from nodes: an element's own share is short by its length squared / 60, which is
    # 2e-5 of the sum; the root of the third bending is 7.85 and makes it 8 times as much
    slope = assumed.inertia_slope[:n]
    np.testing.assert_allclose(elements.inertia_slope[:n], slope, atol=2e-4 * abs(slope).max())


def test_shapes_satisfy_the_beam_equation_and_the_clamped_end() -> None:
    s = np.linspace(0, 1, 2001)
    for shapes in (cantilever_shapes(9, s), polynomial_shapes(5, s)):
        value, slope, curve = shapes
        np.testing.assert_allclose(value[:, 0], 0, atol=1e-12)
        np.testing.assert_allclose(slope[:, 0], 0, atol=1e-11)
        for function, derivative in ((value, slope), (slope, curve)):
            middle = (function[:, 2:] - function[:, :-2]) / (2 * s[1])
            # central difference: error step^2 / 6 times the third derivative, which is below (9 pi)^2 times the first
            limit = s[1] ** 2 / 6 * (9 * np.pi) ** 2 * abs(derivative).max(axis=1, keepdims=True) * 1.5
            assert (abs(middle - derivative[:, 1:-1]) < limit).all()
    value, _slope, curve = cantilever_shapes(9, s)
    np.testing.assert_allclose(abs(value[:, -1]), 2, rtol=1e-9)
    np.testing.assert_allclose(curve[:, -1], 0, atol=1e-8 * abs(curve).max())


def test_momentum_slope_and_energy_of_a_lumped_structure_are_sums_over_its_points() -> None:
    rng = np.random.default_rng(5)
    nodes = rng.normal(size=(5, 3))
    masses = rng.uniform(0.5, 2.0, 5)
    free = Structure(np.eye(30), np.zeros((30, 30)), nodes).rigid_motion(np.zeros(3))
    # a stiffness that rigid motion does not feel, else arbitrary
    other = np.linalg.qr(np.column_stack((free, rng.normal(size=(30, 24)))))[0][:, 6:]
    stiffness = other @ np.diag(rng.uniform(1e3, 1e4, 24)) @ other.T
    mass = np.kron(np.diag(masses), np.diag([1.0, 1.0, 1.0, 0.0, 0.0, 0.0]))
    body = flexible_body(Structure(mass, stiffness, nodes), 1, 3, n_fixed_mode=9)
    arms = nodes - nodes[1]
    # six of the tip, of which three turn no mass, and nine fixed modes: 12 with mass
    assert body.n_mode == 12
    # displacement of every point per modal coordinate: it solves K u = w^2 M u with the root held
    root = np.r_[6:12]
    loose = np.setdiff1d(np.arange(30), root)
    points = np.zeros((body.n_mode, 5, 3))
    for k, square in enumerate(np.diag(body.modal_stiffness)):
        dynamic = stiffness - square * mass
        tip = np.array([18, 19, 20])
        rest = np.setdiff1d(loose, tip)
        u = np.zeros(30)
        u[tip] = body.tip_modes[3:, k]
        u[rest] = np.linalg.solve(dynamic[np.ix_(rest, rest)], -dynamic[np.ix_(rest, tip)] @ u[tip])
        points[k] = u.reshape(5, 6)[:, :3]
    np.testing.assert_allclose(body.mass, masses.sum())
    np.testing.assert_allclose(
        body.momentum[3:].T, np.einsum("n,kna->ka", masses, points), rtol=1e-6, atol=1e-8
    )
    turning = np.einsum("n,kna->ka", masses, np.cross(arms, points))
    np.testing.assert_allclose(body.momentum[:3].T, turning, rtol=1e-6, atol=1e-8)
    inner = np.einsum("n,na,kna->k", masses, arms, points)
    outer = np.einsum("n,na,knb->kab", masses, arms, points)
    slope = 2 * inner[:, None, None] * np.eye(3) - outer - outer.transpose(0, 2, 1)
    np.testing.assert_allclose(body.inertia_slope, slope, rtol=1e-6, atol=1e-7)
    energy = np.einsum("n,kna,lna->kl", masses, points, points)
    np.testing.assert_allclose(energy, np.eye(body.n_mode), atol=1e-7)


def test_a_structure_in_other_axes_gives_the_placed_body() -> None:
    rotation = Rotation.from_rotvec([0.3, -0.5, 0.8]).as_matrix()
    plain = SECTIONS_APART.structure(30)
    turn = np.kron(np.eye(62), rotation)
    there = Structure(
        turn @ plain.mass @ turn.T,
        turn @ plain.stiffness @ turn.T,
        plain.nodes @ rotation.T + [1.0, 2.0, 3.0],
    )
    moved, expected = flexible_body(there, 0, 30, 6), _body(6).placed(rotation)
    for field in FIELDS[:3]:
        np.testing.assert_allclose(getattr(moved, field), getattr(expected, field), atol=1e-9, err_msg=field)
    for k in range(4):  # signs of modes are told by the tip's motion along x, y, z of the frame
        sign = np.sign(moved.tip_modes[:, k] @ expected.tip_modes[:, k])
        np.testing.assert_allclose(sign * moved.tip_modes[:, k], expected.tip_modes[:, k], atol=1e-5)
        np.testing.assert_allclose(sign * moved.momentum[:, k], expected.momentum[:, k], atol=1e-5)
        np.testing.assert_allclose(sign * moved.inertia_slope[k], expected.inertia_slope[k], atol=1e-5)


def test_placing_there_and_back_changes_nothing() -> None:
    rotation, shift = Rotation.from_rotvec([1.0, 0.2, -0.4]).as_matrix(), np.array([0.3, -0.2, 0.5])
    body = _body()
    again = body.placed(rotation, shift).placed(rotation.T, -rotation.T @ shift)
    for field in FIELDS:
        np.testing.assert_allclose(
            getattr(again, field), getattr(body, field), atol=1e-9, rtol=1e-9, err_msg=field
        )
    with pytest.raises(ConfigurationError, match="no rotation matrix"):
        body.placed(np.diag([1.0, 1.0, -1.0]))


def test_modes_of_one_frequency_point_along_the_axes() -> None:
    square = flexible_body(BEAM.structure(10), 0, 10)
    in_y, in_z = square.tip_modes[3:, 0], square.tip_modes[3:, 1]
    assert square.frequency_hz[0] == pytest.approx(square.frequency_hz[1], rel=1e-9)
    assert in_y[1] > 0.5
    assert in_z[2] > 0.5
    np.testing.assert_allclose([in_y[0], in_y[2], in_z[0], in_z[1]], 0, atol=1e-7)


def test_truncation_keeps_the_lowest_modes_and_with_loads_the_static_answer() -> None:
    body = _body()
    few = body.truncated(3)
    np.testing.assert_allclose(few.frequency_hz, body.frequency_hz[:3], rtol=1e-9)
    np.testing.assert_allclose(abs(few.momentum), abs(body.momentum[:, :3]), rtol=1e-6, atol=1e-8)
    load = np.array([0.0, 0.0, 0.0, 0.0, 1.0, 0.0])
    exact = 3 * SECTIONS_APART.bending_stiffness[1] / 0.8**3
    assert body.tip_stiffness(load) == pytest.approx(exact, rel=1e-9)
    # the first mode alone has 97.07 % of the tip's compliance: 4 / root^4 against 1 / 3; the second 2.47 % more
    assert exact / few.truncated(2).tip_stiffness(load) == pytest.approx(12 / 1.87510407**4, rel=2e-3)
    corrected = body.truncated(2, loads=load[:, None])
    assert corrected.n_mode == 3
    assert corrected.tip_stiffness(load) == pytest.approx(exact, rel=1e-9)
    np.testing.assert_allclose(corrected.frequency_hz[:2], body.frequency_hz[:2], rtol=1e-9)
    every = body.truncated(2, loads=np.eye(6))
    assert every.n_mode == 8
    flexibility = every.tip_modes @ np.linalg.inv(every.modal_stiffness) @ every.tip_modes.T
    whole = body.tip_modes @ np.linalg.inv(body.modal_stiffness) @ body.tip_modes.T
    np.testing.assert_allclose(flexibility, whole, atol=1e-9 * abs(whole).max())


def test_damping_is_the_ratio_asked_for_in_every_mode() -> None:
    body = assumed_modes(BEAM, (2, 2), 1, 1, damping_ratio=0.03)
    np.testing.assert_allclose(
        np.diag(body.modal_damping) / (2 * np.sqrt(np.diag(body.modal_stiffness))), 0.03
    )
    kept = body.truncated(3, np.eye(6))
    np.testing.assert_allclose(np.diag(kept.modal_damping)[:3] / (4 * np.pi * kept.frequency_hz[:3]), 0.03)


def test_a_clamped_structure_and_one_in_mixed_units_are_refused() -> None:
    plain = BEAM.structure(3)
    held = plain.stiffness.copy()
    held[0, 0] += 1e6
    with pytest.raises(ConfigurationError, match="rigid motion along x causes a force at ux of node 0"):
        flexible_body(replace(plain, stiffness=held), 0, 3)
    with pytest.raises(ConfigurationError, match="rigid rotation about .* another unit"):
        flexible_body(replace(plain, nodes=1e3 * plain.nodes), 0, 3)
    by_direction = np.arange(24).reshape(6, 4).T.ravel()  # all ux, then all uy...
    mixed = Structure(
        *(m[np.ix_(by_direction, by_direction)] for m in (plain.mass, plain.stiffness)), plain.nodes
    )
    with pytest.raises(ConfigurationError, match="node by node"):
        flexible_body(mixed, 0, 3)
    heavy = plain.mass.copy()
    heavy[0, 0] += 1.0
    with pytest.raises(
        ConfigurationError, match=r"its mass is 5\.\d+, 4\.\d+, 4\.\d+ kg; it must be the same"
    ):
        flexible_body(replace(plain, mass=heavy), 0, 3)


def test_impossible_requests_are_refused() -> None:
    plain, body = BEAM.structure(3), _body(0)
    with pytest.raises(ConfigurationError, match="root and tip are both node 3"):
        flexible_body(plain, 3, 3)
    with pytest.raises(ConfigurationError, match="tip node 4"):
        flexible_body(plain, 0, 4)
    with pytest.raises(ConfigurationError, match=r"damping ratio 1\.5"):
        flexible_body(plain, 0, 3, damping_ratio=1.5)
    with pytest.raises(ConfigurationError, match="7 modes to keep of 6"):
        body.truncated(7)
    with pytest.raises(ConfigurationError, match="at least one"):
        assumed_modes(BEAM, (0, 0), 0, 0)
    with pytest.raises(ConfigurationError, match="at most 12"):
        assumed_modes(BEAM, (13, 0), 0, 0, shapes="polynomial")
    with pytest.raises(ConfigurationError, match=r"momentum has shape \(6, 5\), expected \(6, 6\)"):
        replace(body, momentum=body.momentum[:, :5])
