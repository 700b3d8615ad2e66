"""Guyan's and Craig and Bampton's reductions: what is exact, what bounds what, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse

from robid_core.errors import ConfigurationError
from robid_core.mechanics.flexible import Structure, craig_bampton, guyan, hollow_square

BEAM = hollow_square(1.0, 0.04, 0.003)


def _clamped(mass: np.ndarray, stiffness: np.ndarray) -> np.ndarray:
    """Squared frequencies with the first six coordinates held."""
    return scipy.linalg.eigvalsh(stiffness[6:, 6:], mass[6:, 6:])


def test_guyan_on_the_ends_of_a_beam_gives_one_element() -> None:
    # without load inside, a uniform beam bends in cubics: static reduction of many elements is one element
    one, many = BEAM.structure(1), guyan(BEAM.structure(9), (0, 9))
    np.testing.assert_allclose(many.stiffness, one.stiffness, atol=1e-9 * abs(one.stiffness).max())
    np.testing.assert_allclose(many.mass, one.mass, atol=1e-9 * abs(one.mass).max())


def test_interface_nodes_come_in_the_order_asked_for() -> None:
    forward, back = guyan(BEAM.structure(3), (0, 3)), guyan(BEAM.structure(3), (3, 0))
    swapped = np.r_[6:12, :6]
    np.testing.assert_allclose(back.mass, forward.mass[np.ix_(swapped, swapped)], atol=1e-15)
    assert back.interface == (3, 0)


def test_keeping_every_node_or_every_mode_loses_nothing() -> None:
    structure = BEAM.structure(3)
    exact = _clamped(structure.mass, structure.stiffness)
    whole, modal = guyan(structure, range(4)), craig_bampton(structure, (0, 3), 12)
    np.testing.assert_array_equal(whole.mass, structure.mass)
    np.testing.assert_allclose(_clamped(modal.mass, modal.stiffness), exact, rtol=1e-7)


def test_reduced_frequencies_bound_the_full_ones_from_above_and_fall_with_every_mode() -> None:
    structure = BEAM.structure(8)
    exact = _clamped(structure.mass, structure.stiffness)
    before = np.full(6, np.inf)
    for n_mode in (0, 1, 2, 5, 11, 20):
        reduced = craig_bampton(structure, (0, 8), n_mode)
        found = _clamped(reduced.mass, reduced.stiffness)
        assert (found >= exact[: len(found)] * (1 - 1e-9)).all()
        assert (found[:6] <= before * (1 + 1e-9)).all()
        before = found[:6]


def test_matrices_are_those_of_the_shapes() -> None:
    structure = BEAM.structure(6)
    reduced = craig_bampton(structure, (0, 6), 7)
    shapes = reduced.transformation
    for small, large in ((reduced.mass, structure.mass), (reduced.stiffness, structure.stiffness)):
        np.testing.assert_allclose(small, shapes.T @ large @ shapes, atol=1e-9 * abs(small).max())
    np.testing.assert_allclose(reduced.mass[12:, 12:], np.eye(7), atol=1e-9)
    fixed = scipy.linalg.eigvalsh(structure.stiffness[6:-6, 6:-6], structure.mass[6:-6, 6:-6])[:7]
    np.testing.assert_allclose((2 * np.pi * reduced.fixed_frequency_hz) ** 2, fixed, rtol=1e-9)


def test_sparse_matrices_give_what_dense_ones_give() -> None:
    n = 120  # above the size up to which eigenvalues are computed densely
    dense = craig_bampton(BEAM.structure(n), (0, n), 5)
    sparse = craig_bampton(BEAM.structure(n, sparse=True), (0, n), 5)
    np.testing.assert_allclose(sparse.fixed_frequency_hz, dense.fixed_frequency_hz, rtol=1e-6)
    np.testing.assert_allclose(
        sparse.stiffness, dense.stiffness, rtol=1e-5, atol=1e-6 * dense.stiffness.max()
    )
    np.testing.assert_allclose(sparse.mass[:12, :12], dense.mass[:12, :12], atol=1e-8)


def test_the_same_structure_gives_the_same_bytes() -> None:
    first, second = (craig_bampton(BEAM.structure(120, sparse=True), (0, 120), 5) for _ in range(2))
    assert first.mass.tobytes() == second.mass.tobytes()
    assert first.transformation.tobytes() == second.transformation.tobytes()


def test_degrees_of_freedom_of_nothing_are_left_out() -> None:
    plain = BEAM.structure(2)
    nodes = np.insert(plain.nodes, 1, [9.0, 9.0, 9.0], axis=0)
    kept = np.r_[:6, 12:24]
    wide = []
    for matrix in (plain.mass, plain.stiffness):
        wide.append(np.zeros((24, 24)))
        wide[-1][np.ix_(kept, kept)] = matrix
    reduced = guyan(Structure(wide[0], wide[1], nodes), (0, 3))
    np.testing.assert_allclose(reduced.mass, guyan(plain, (0, 2)).mass, rtol=1e-12, atol=1e-15)


def _changed(letter: str, row: int, column: int, value: float, sparse: bool = False) -> None:
    plain = BEAM.structure(2)
    matrices = {"M": plain.mass.copy(), "K": plain.stiffness.copy()}
    matrices[letter][row, column] = value
    if sparse:
        matrices = {key: scipy.sparse.csr_array(matrix) for key, matrix in matrices.items()}
    Structure(matrices["M"], matrices["K"], plain.nodes, name="arm.npz")


@pytest.mark.parametrize("sparse", [False, True])
@pytest.mark.parametrize(
    ("change", "told"),
    [
        (("K", 7, 1, 0.0), r"stiffness matrix K is not symmetric: \[1, 7\] \(uy of node 0, uy of node 1\)"),
        (
            ("M", 3, 3, -1.0),
            r"mass matrix M is not positive semidefinite: -1 on the diagonal \(rx of node 0\)",
        ),
        (("M", 0, 0, 1e-3), "mass matrix M is not positive semidefinite: it has a negative eigenvalue"),
        (("K", 0, 0, 1e3), "stiffness matrix K is not positive semidefinite: it has a negative eigenvalue"),
        (("K", 0, 0, np.nan), "stiffness matrix K holds a number that is not finite"),
    ],
)
def test_an_unsymmetric_or_indefinite_matrix_is_refused(
    change: tuple[str, int, int, float], told: str, sparse: bool
) -> None:
    with pytest.raises(ConfigurationError, match=r"arm\.npz: " + told):
        _changed(*change, sparse=sparse)


@pytest.mark.parametrize(
    ("interface", "n_mode", "told"),
    [
        ((0, 4), 0, "interface node 4: there are nodes 0 to 3"),
        ((0, -1), 0, "interface node -1"),
        ((0, 0), 0, r"interface nodes \[0, 0\]"),
        ((), 0, r"interface nodes \[\]"),
        ((0, 3), 13, "13 fixed-interface modes; there are 12 inner"),
        ((0, 3), -1, "-1 fixed-interface modes"),
    ],
)
def test_unknown_nodes_and_too_many_modes_are_refused(
    interface: tuple[int, ...], n_mode: int, told: str
) -> None:
    with pytest.raises(ConfigurationError, match=told):
        craig_bampton(BEAM.structure(3), interface, n_mode)


@pytest.mark.parametrize("sparse", [False, True])
def test_a_part_that_hangs_on_no_interface_node_is_refused(sparse: bool) -> None:
    one = BEAM.structure(1)
    both = [np.kron(np.eye(2), matrix) for matrix in (one.mass, one.stiffness)]
    if sparse:
        both = [scipy.sparse.csr_array(matrix) for matrix in both]
    beside = one.nodes + np.array([0.0, 1.0, 0.0])
    apart = Structure(both[0], both[1], np.concatenate((one.nodes, beside)))
    with pytest.raises(ConfigurationError, match="still free to move"):
        guyan(apart, (0, 1))


def test_modes_without_mass_are_refused() -> None:
    plain = BEAM.structure(2)
    mass = plain.mass.copy()
    mass[6:12] = mass[:, 6:12] = 0.0
    mass[8, 8] = 1.0
    with pytest.raises(ConfigurationError, match="2 fixed-interface modes, but only 1 carry mass"):
        craig_bampton(Structure(mass, plain.stiffness, plain.nodes), (0, 2), 2)
