"""Finite elements of a beam against closed forms: rigid motion, static answers, frequencies."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg

from robid_core.errors import ConfigurationError
from robid_core.mechanics.flexible import Beam, hollow_square
from robid_core.mechanics.flexible.closed_form import (
    axial_frequencies_hz,
    bending_frequencies_hz,
    cantilever_roots,
    free_roots,
    torsion_frequencies_hz,
)

EULER = hollow_square(1.0, 0.04, 0.003, rotary_inertia=False)
RECTANGLE = replace(EULER, bending_stiffness=(3e3, 9e3))


def _frequencies_hz(beam: Beam, n_element: int, clamped: bool, load: float = 0.0) -> np.ndarray:
    structure = beam.structure(n_element)
    mass = structure.mass.copy()
    mass[range(-6, -3), range(-6, -3)] += load
    free = slice(6 if clamped else 0, None)
    square = scipy.linalg.eigvalsh(structure.stiffness[free, free], mass[free, free])
    return np.sqrt(np.maximum(square, 0)) / (2 * np.pi)


def test_roots_are_those_of_the_handbook() -> None:
    # Weaver, Timoshenko, Young, tables of chapter 5
    np.testing.assert_allclose(
        cantilever_roots(4), [1.87510407, 4.69409113, 7.85475744, 10.99554073], rtol=1e-8
    )
    np.testing.assert_allclose(free_roots(3), [4.73004074, 7.85320462, 10.99560784], rtol=1e-8)
    # a heavy load: the beam is a spring, w^2 = 3 E I / ((m + 33/140 of the beam) L^3), so z^4 = 3 / (ratio + 33 / 140)
    assert cantilever_roots(1, 100.0)[0] == pytest.approx((3 / (100 + 33 / 140)) ** 0.25, rel=1e-5)
    assert cantilever_roots(2, 1e9)[1] == pytest.approx(3.92660231, rel=1e-8)  # clamped and pinned


def test_rigid_motion_strains_nothing_and_carries_the_mass_of_the_beam() -> None:
    beam = hollow_square(0.7, 0.05, 0.004)
    structure = beam.structure(3)
    motion = structure.rigid_motion([0.35, 0.0, 0.0])
    assert abs(structure.stiffness @ motion).max() < 1e-12 * abs(structure.stiffness).max()
    expected = np.zeros((6, 6))
    expected[:3, :3], expected[3:, 3:] = beam.inertia(0.7), beam.mass * np.eye(3)
    np.testing.assert_allclose(motion.T @ structure.mass @ motion, expected, atol=1e-14 * beam.mass)


@pytest.mark.parametrize("n_element", [1, 4])
def test_a_load_at_the_tip_bends_twists_and_stretches_as_in_the_handbook(n_element: int) -> None:
    beam = replace(RECTANGLE, length=1.3)
    compliance = np.linalg.inv(beam.structure(n_element).stiffness[6:, 6:])[-6:, -6:]
    length, (about_y, about_z) = 1.3, beam.bending_stiffness
    expected = np.diag(
        [
            length / beam.axial_stiffness,
            length**3 / 3 / about_z,
            length**3 / 3 / about_y,
            length / beam.torsional_stiffness,
            length / about_y,
            length / about_z,
        ]
    )
    expected[1, 5] = expected[5, 1] = length**2 / 2 / about_z
    expected[2, 4] = expected[4, 2] = -(length**2) / 2 / about_y  # lifting the tip turns it about minus y
    np.testing.assert_allclose(compliance, expected, rtol=1e-9, atol=1e-15)


@pytest.mark.parametrize("clamped", [True, False])
def test_frequencies_are_high_by_what_theory_says(clamped: bool) -> None:
    n_element = 12
    roots = cantilever_roots(4) if clamped else free_roots(4)
    found = _frequencies_hz(RECTANGLE, n_element, clamped)
    for about in "yz":
        exact = bending_frequencies_hz(RECTANGLE, roots, about)
        nearest = found[np.argmin(abs(found[:, None] - exact), axis=0)]
        # cubic elements: w^2 high by (beta l)^4 / 720, to leading order; the next one is (beta l)^2 smaller
        theory = (roots / n_element) ** 4 / 1440
        np.testing.assert_allclose(
            nearest / exact - 1, theory, rtol=0.5 * (roots[-1] / n_element) ** 2, atol=1e-9
        )


def test_torsion_and_extension_are_high_by_what_theory_says() -> None:
    n_element = 10
    found = _frequencies_hz(EULER, n_element, clamped=True)
    for exact in (torsion_frequencies_hz(EULER, 2), axial_frequencies_hz(EULER, 2)):
        nearest = found[np.argmin(abs(found[:, None] - exact), axis=0)]
        theory = ((np.arange(2) + 0.5) * np.pi / n_element) ** 2 / 24  # linear elements, consistent mass
        np.testing.assert_allclose(nearest / exact - 1, theory, rtol=0.05)


def test_a_mass_at_the_tip_lowers_the_frequencies_as_the_transcendental_equation_says() -> None:
    ratio = 0.8
    found = _frequencies_hz(RECTANGLE, 20, clamped=True, load=ratio * RECTANGLE.mass)
    exact = bending_frequencies_hz(RECTANGLE, cantilever_roots(3, ratio), "y")
    nearest = found[np.argmin(abs(found[:, None] - exact), axis=0)]
    np.testing.assert_allclose(nearest, exact, rtol=(10 / 20) ** 4 / 1440)


def test_rotary_inertia_lowers_the_first_frequency_by_half_its_share_of_the_kinetic_energy() -> None:
    heavy = hollow_square(1.0, 0.04, 0.003)
    slow, fast = (_frequencies_hz(beam, 10, clamped=True)[0] for beam in (heavy, EULER))
    radius = heavy.section_inertia[2] / heavy.mass_per_length
    share = (
        radius * 4.6478
    )  # integral of phi'^2 over that of phi^2, first clamped mode (Blevins 1979, table 8-1)
    assert 1 - slow / fast == pytest.approx(share / 2, rel=0.01)


@pytest.mark.parametrize(
    ("field", "value", "told"),
    [
        ("length", 0.0, "length is 0.0"),
        ("bending_stiffness", (1.0, -1.0), r"bending_stiffness is \[1.0, -1.0\]"),
        ("section_inertia", (0.0, 0.0, 0.0), "section_inertia"),
    ],
)
def test_a_beam_without_stiffness_mass_or_length_is_refused(field: str, value: object, told: str) -> None:
    with pytest.raises(ConfigurationError, match=told):
        replace(EULER, **{field: value})


def test_no_element_and_a_wall_thicker_than_the_tube_are_refused() -> None:
    with pytest.raises(ConfigurationError, match="0 elements"):
        EULER.structure(0)
    with pytest.raises(ConfigurationError, match=r"wall 0\.03 m of a square of 0\.04 m"):
        hollow_square(1.0, 0.04, 0.03)
