"""One beam, five models: the first four bending frequencies of each against the closed form.

`pytest -s tests/robid_core/mechanics/flexible/test_flexible_comparison.py` prints the table.
"""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg

from robid_core.mechanics.chain import MODAL, Chain
from robid_core.mechanics.flexible import (
    assumed_modes,
    attach_flexible,
    attach_pseudo_joints,
    flexible_body,
    guyan,
    hollow_square,
    pseudo_joints,
)
from robid_core.mechanics.flexible.body import FlexibleBody
from robid_core.mechanics.flexible.closed_form import bending_frequencies_hz, cantilever_roots
from robid_core.mechanics.reference import dynamics_by_jacobians

BEAM = hollow_square(1.0, 0.04, 0.003, rotary_inertia=False)  # steel, 1 m, 40 x 40 x 3 mm
N_ELEMENT = 20
EXACT_HZ = bending_frequencies_hz(BEAM, cantilever_roots(4))


def _root() -> Chain:
    """One joint, to be held, with a body that the beam replaces."""
    return Chain(
        parent=np.array([-1]),
        joint_type=np.zeros(1),
        axis=np.array([[0.0, 0.0, 1.0]]),
        rotation=np.eye(3)[None],
        translation=np.zeros((1, 3)),
        mass=np.ones(1),
        centre_of_mass=np.zeros((1, 3)),
        inertia=np.zeros((1, 3, 3)),
        names=("axis_1",),
        gravity=np.zeros(3),
    )


def _in_plane(mass: np.ndarray, stiffness: np.ndarray, moves: np.ndarray) -> np.ndarray:
    """First four frequencies in Hz of the modes that move the tip along y; nan where there are fewer."""
    square, modes = scipy.linalg.eigh(stiffness, mass)
    tip = abs(moves @ modes)
    bending = np.flatnonzero(tip[1] > 1e-6 * tip.max())
    frequency = np.sqrt(square[bending][:4]) / (2 * np.pi)
    return np.append(frequency, np.full(4 - len(frequency), np.nan))


def _through_chain(body: FlexibleBody) -> np.ndarray:
    chain = attach_flexible(_root(), "axis_1", "link", body)
    modes = np.flatnonzero(chain.joint_type == MODAL)
    rest = np.zeros(chain.n_coordinate)
    mass = dynamics_by_jacobians(chain, rest, rest).mass[np.ix_(modes, modes)]
    return _in_plane(mass, body.modal_stiffness, body.tip_modes[3:])


def _of_pieces(placement: str, n: int) -> np.ndarray:
    pieces = pseudo_joints(BEAM, n, ("bending_z",), placement)
    chain = attach_pseudo_joints(_root(), "axis_1", "link", pieces)
    rest = np.zeros(chain.n_coordinate)
    mass = dynamics_by_jacobians(chain, rest, rest).mass[1:, 1:]
    lift = np.zeros((3, n))
    lift[1] = 1.0 - np.cumsum(pieces.translation[:, 0])
    return _in_plane(mass, np.diag(pieces.stiffness), lift)


def _of_inner_nodes() -> np.ndarray:
    reduced = guyan(BEAM.structure(N_ELEMENT), (0, 5, 10, 15, 20))
    plane = (6 * np.arange(1, 5)[:, None] + [1, 5]).ravel()  # uy and rz: what bends in y
    moves = np.zeros((3, 8))
    moves[1, -2] = 1.0
    return _in_plane(reduced.mass[np.ix_(plane, plane)], reduced.stiffness[np.ix_(plane, plane)], moves)


def compare() -> dict[str, np.ndarray]:
    """Return the first four bending frequencies of the clamped beam by each model, Hz, shape (4,)."""
    structure = BEAM.structure(N_ELEMENT)
    return {
        "Guyan, root and tip": _through_chain(flexible_body(structure, 0, N_ELEMENT)),
        "Guyan, 3 more nodes": _of_inner_nodes(),
        "Craig-Bampton, 10 modes": _through_chain(flexible_body(structure, 0, N_ELEMENT, 10)),
        "Craig-Bampton, 20 modes": _through_chain(flexible_body(structure, 0, N_ELEMENT, 20)),
        "assumed modes, cantilever": _through_chain(assumed_modes(BEAM, (4, 4), 1)),
        "assumed modes, polynomial": _through_chain(assumed_modes(BEAM, (6, 6), 1, shapes="polynomial")),
        "4 pseudo-joints, middle": _of_pieces("middle", 4),
        "8 pseudo-joints, middle": _of_pieces("middle", 8),
        "4 pseudo-joints, Gauss": _of_pieces("gauss", 4),
    }


def table(found: dict[str, np.ndarray]) -> str:
    """Lay out frequencies in Hz and their errors in per cent."""
    rows = [f"{'closed form':28s}" + "".join(f"{f:9.2f}          " for f in EXACT_HZ)]
    for name, frequency in found.items():
        cells = (
            " " * 8 + "-" + " " * 10 if np.isnan(f) else f"{f:9.2f} {100 * (f / exact - 1):+7.3f} %"
            for f, exact in zip(frequency, EXACT_HZ, strict=True)
        )
        rows.append(f"{name:28s}" + "".join(cells))
    return "\n".join(rows)


@pytest.fixture(scope="module")
def errors() -> dict[str, np.ndarray]:
    """Return relative errors by model."""
    found = compare()
    print("\n" + table(found))
    return {name: frequency / EXACT_HZ - 1 for name, frequency in found.items()}


def test_shape_functions_bound_the_frequencies_from_above(errors: dict[str, np.ndarray]) -> None:
    for name, error in errors.items():
        if "pseudo" not in name:
            assert (error[np.isfinite(error)] > -1e-9).all(), name


def test_guyan_between_the_ends_has_two_frequencies_those_of_one_element(
    errors: dict[str, np.ndarray],
) -> None:
    # one cubic element, clamped: det([156 -22; -22 4] L / 420 w^2 - [12 -6; -6 4]) = 0, w in units of the beam
    square = scipy.linalg.eigvalsh(
        [[12.0, -6.0], [-6.0, 4.0]], np.array([[156.0, -22.0], [-22.0, 4.0]]) / 420
    )
    element = np.sqrt(square) / cantilever_roots(2) ** 2 - 1
    np.testing.assert_allclose(errors["Guyan, root and tip"][:2], element, rtol=1e-6)
    assert np.isnan(errors["Guyan, root and tip"][2:]).all()
    # four elements: (beta L / 4)^4 / 1440, to leading order
    theory = (cantilever_roots(4) / 4) ** 4 / 1440
    np.testing.assert_allclose(errors["Guyan, 3 more nodes"][:2], theory[:2], rtol=0.5)
    assert errors["Guyan, 3 more nodes"][3] < 3 * theory[3]


def test_craig_bampton_is_within_a_thousandth_and_better_with_more_modes(
    errors: dict[str, np.ndarray],
) -> None:
    few, many = errors["Craig-Bampton, 10 modes"], errors["Craig-Bampton, 20 modes"]
    assert (many < 1e-3).all()
    assert (few[1:] > many[1:]).all()
    assert (few < 2e-3).all()
    assert (few < 0.02 * errors["Guyan, root and tip"])[:2].all()


def test_assumed_modes_of_the_beam_itself_are_exact_and_polynomials_nearly(
    errors: dict[str, np.ndarray],
) -> None:
    np.testing.assert_allclose(errors["assumed modes, cantilever"], 0, atol=1e-9)
    assert (errors["assumed modes, polynomial"][:3] < 1e-3).all()
    assert (np.diff(errors["assumed modes, polynomial"]) > 0).all()


def test_pseudo_joints_are_of_second_order(errors: dict[str, np.ndarray]) -> None:
    coarse = _of_pieces("middle", 6) / EXACT_HZ - 1
    order = np.log(coarse[:3] / errors["8 pseudo-joints, middle"][:3]) / np.log(8 / 6)
    np.testing.assert_allclose(order, 2.0, atol=0.3)
    assert (abs(errors["8 pseudo-joints, middle"]) > abs(errors["Craig-Bampton, 10 modes"])).all()
