"""A beam in rigid pieces: exact where a quadrature is, of second order elsewhere."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg

from robid_core.errors import ConfigurationError
from robid_core.mechanics.chain import Chain
from robid_core.mechanics.flexible import attach_pseudo_joints, hollow_square, pseudo_joints
from robid_core.mechanics.flexible.closed_form import (
    bending_frequencies_hz,
    cantilever_roots,
    torsion_frequencies_hz,
)
from robid_core.mechanics.reference import dynamics_by_jacobians

SLENDER = hollow_square(1.0, 0.02, 0.002, rotary_inertia=False)
BEAM = hollow_square(1.0, 0.06, 0.004)


def _arm(payload: float = 0.0) -> Chain:
    """A joint about x with a body to be replaced, and a joint at 1 m that carries a point mass."""
    return Chain(
        parent=np.array([-1, 0]),
        joint_type=np.zeros(2),
        axis=np.tile([1.0, 0.0, 0.0], (2, 1)),
        rotation=np.tile(np.eye(3), (2, 1, 1)),
        translation=np.array([[0.0, 0.0, 0.5], [1.0, 0.0, 0.0]]),
        mass=np.array([1.0, payload]),
        centre_of_mass=np.zeros((2, 3)),
        inertia=np.zeros((2, 3, 3)),
        names=("axis_1", "axis_2"),
        gravity=np.array([0.0, 0.0, -9.81]),
    )


def test_pieces_together_are_the_beam() -> None:
    for placement in ("middle", "gauss"):
        pieces = pseudo_joints(BEAM, 5, placement=placement)
        chain = attach_pseudo_joints(_arm(), "axis_1", "link", pieces)
        rest = np.zeros(chain.n_coordinate)
        whole = dynamics_by_jacobians(chain, rest, rest)
        assert pieces.root_mass + pieces.mass.sum() == pytest.approx(BEAM.mass)
        assert whole.mass[0, 0] == pytest.approx(BEAM.inertia(1.0)[0, 0])  # about x, all pieces turn
        lift = dynamics_by_jacobians(
            Chain(**{**{f: getattr(chain, f) for f in chain.__dataclass_fields__}, "axis": _turned(chain)}),
            rest,
            rest,
        )
        across = BEAM.inertia(1.0)[1, 1] + BEAM.mass / 4
        assert lift.mass[0, 0] == pytest.approx(across)
        assert abs(lift.bias[0]) == pytest.approx(BEAM.mass * 9.81 / 2)


def _turned(chain: Chain) -> np.ndarray:
    axis = chain.axis.copy()
    axis[0] = [0.0, 1.0, 0.0]
    return axis


def test_names_and_order_tell_place_and_motion() -> None:
    chain = attach_pseudo_joints(_arm(), "axis_1", "link", pseudo_joints(BEAM, 2, ("bending_y", "torsion")))
    assert chain.names == (
        "axis_1", "link_1_bending_y", "link_1_torsion", "link_2_bending_y", "link_2_torsion", "axis_2",
    )  # fmt: skip
    np.testing.assert_array_equal(chain.parent, np.arange(6) - 1)
    np.testing.assert_array_equal(chain.axis[1:3], [[0, 1, 0], [1, 0, 0]])
    np.testing.assert_allclose(np.cumsum(chain.translation[:, 0])[[1, 3, 5]], [0.25, 0.75, 1.0])


@pytest.mark.parametrize(
    ("placement", "n", "lack"),
    [("middle", 1, 1 / 4), ("middle", 3, 1 / 36), ("gauss", 1, 1 / 4), ("gauss", 2, 0.0)],
)
def test_a_load_at_the_tip_bends_the_pieces_as_much_as_a_quadrature_says(
    placement: str, n: int, lack: float
) -> None:
    payload = 2.0
    pieces = pseudo_joints(BEAM, n, ("bending_y",), placement)
    chain = attach_pseudo_joints(_arm(payload), "axis_1", "link", pieces)
    light = attach_pseudo_joints(_arm(0.0), "axis_1", "link", pieces)
    rest = np.zeros(chain.n_coordinate)
    torque = dynamics_by_jacobians(chain, rest, rest).bias - dynamics_by_jacobians(light, rest, rest).bias
    angle = -torque[1:-1] / pieces.stiffness
    place = np.cumsum(pieces.translation[:, 0])
    exact = payload * 9.81 / BEAM.bending_stiffness[0]
    assert angle @ (1.0 - place) == pytest.approx(exact / 3 * (1 - lack), rel=1e-9)
    assert angle.sum() == pytest.approx(exact / 2, rel=1e-9)  # the slope is the integral of a line: exact


def _frequencies_hz(n: int, motion: str) -> np.ndarray:
    pieces = pseudo_joints(SLENDER, n, (motion,))
    chain = attach_pseudo_joints(_arm(), "axis_1", "link", pieces)
    rest = np.zeros(chain.n_coordinate)
    mass = dynamics_by_jacobians(chain, rest, rest).mass[1:-1, 1:-1]
    return np.sqrt(scipy.linalg.eigvalsh(np.diag(pieces.stiffness), mass)) / (2 * np.pi)


@pytest.mark.parametrize("motion", ["bending_y", "bending_z", "torsion"])
def test_frequencies_approach_the_closed_form_with_the_square_of_the_piece(motion: str) -> None:
    exact = (
        torsion_frequencies_hz(SLENDER, 2)
        if motion == "torsion"
        else bending_frequencies_hz(SLENDER, cantilever_roots(2))
    )
    coarse, fine = (_frequencies_hz(n, motion)[:2] / exact - 1 for n in (8, 16))
    assert (abs(fine) < 0.02).all()
    np.testing.assert_allclose(coarse / fine, 4.0, rtol=0.15)


def test_dampers_give_the_first_mode_the_ratio_asked_for() -> None:
    pieces = pseudo_joints(SLENDER, 12, ("bending_z",), damping_ratio=0.02)
    chain = attach_pseudo_joints(_arm(), "axis_1", "link", pieces)
    rest = np.zeros(chain.n_coordinate)
    mass = dynamics_by_jacobians(chain, rest, rest).mass[1:-1, 1:-1]
    square, modes = scipy.linalg.eigh(np.diag(pieces.stiffness), mass)
    damping = modes[:, 0] @ np.diag(pieces.damping) @ modes[:, 0]
    # of twelve pieces the first frequency is low by (1.875 / 12)^2 / 8 at most, in which damping is proportional
    assert damping / (2 * np.sqrt(square[0])) == pytest.approx(0.02, rel=0.01)


def test_pieces_too_short_and_unknown_motions_are_refused() -> None:
    with pytest.raises(ConfigurationError, match="principal moments"):
        attach_pseudo_joints(
            _arm(), "axis_1", "link", pseudo_joints(hollow_square(1.0, 0.06, 0.004, rotary_inertia=False), 20)
        )
    for n, motions in ((0, ("torsion",)), (2, ("shear",)), (2, ("torsion", "torsion")), (2, ())):
        with pytest.raises(ConfigurationError, match="pseudo-joints: "):
            pseudo_joints(BEAM, n, motions)
