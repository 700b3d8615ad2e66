"""Flexible links in a chain: closed-form frequencies and sags through it, and what it refuses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from robid_core.errors import ConfigurationError
from robid_core.mechanics.chain import MODAL, Chain
from robid_core.mechanics.dynamics import Dynamics
from robid_core.mechanics.flexible import (
    FlexibleBody,
    assumed_modes,
    attach_flexible,
    flexible_body,
    hollow_square,
)
from robid_core.mechanics.flexible.closed_form import bending_frequencies_hz, cantilever_roots
from robid_core.mechanics.reference import dynamics_by_jacobians

BEAM = hollow_square(1.0, 0.04, 0.003, rotary_inertia=False)
STIFF = BEAM.bending_stiffness[0]


def _beam(n_fixed_mode: int = 20) -> FlexibleBody:
    return flexible_body(BEAM.structure(20), 0, 20, n_fixed_mode)


def _arm(n: int = 2, payload: float = 2.0) -> Chain:
    """Links of 1 m along x, joints about y, the last with a payload in its origin; the first carries a rigid beam."""
    return Chain(
        parent=np.arange(n) - 1,
        joint_type=np.zeros(n),
        axis=np.tile([0.0, 1.0, 0.0], (n, 1)),
        rotation=np.tile(np.eye(3), (n, 1, 1)),
        translation=np.array([[0.0, 0.0, 0.5]] + [[1.0, 0.0, 0.0]] * (n - 1)),
        mass=np.array([BEAM.mass] * (n - 1) + [payload]),
        centre_of_mass=np.array([[0.5, 0.0, 0.0]] * (n - 1) + [[0.0, 0.0, 0.0]]),
        inertia=np.array([BEAM.inertia(1.0)] * (n - 1) + [np.zeros((3, 3))]),
        names=tuple(f"axis_{j + 1}" for j in range(n)),
        gravity=np.array([0.0, 0.0, -9.81]),
    )


def _terms(chain: Chain, position: np.ndarray | None = None, speed: np.ndarray | None = None) -> Dynamics:
    rest = np.zeros(chain.n_coordinate)
    return dynamics_by_jacobians(
        chain, rest if position is None else position, rest if speed is None else speed
    )


def _frequencies_hz(chain: Chain, body: FlexibleBody, free: list[str]) -> np.ndarray:
    """Natural frequencies without gravity; joints that are neither modes nor free are held."""
    modes = np.flatnonzero(chain.joint_type == MODAL)
    spring = np.zeros((chain.n_coordinate,) * 2)
    spring[np.ix_(modes, modes)] = body.modal_stiffness
    kept = np.sort(np.r_[modes, [chain.index(name) for name in free]]).astype(int)
    square = scipy.linalg.eigvalsh(spring[np.ix_(kept, kept)], _terms(chain).mass[np.ix_(kept, kept)])
    return np.sqrt(np.maximum(square, 0)) / (2 * np.pi)


def _nearest(found: np.ndarray, exact: np.ndarray) -> np.ndarray:
    return found[np.argmin(abs(found[:, None] - exact), axis=0)]


def test_a_clamped_link_with_a_payload_has_the_frequencies_of_the_closed_form() -> None:
    body = _beam()
    chain = attach_flexible(_arm(payload=2.0), "axis_1", "link", body)
    exact = bending_frequencies_hz(BEAM, cantilever_roots(4, 2.0 / BEAM.mass))
    found = _nearest(_frequencies_hz(chain, body, []), exact)
    assert (found >= exact).all()
    np.testing.assert_allclose(found, exact, rtol=1e-3)


def test_a_link_on_a_free_joint_has_the_frequencies_of_a_pinned_beam() -> None:
    body = _beam()
    chain = attach_flexible(_arm(payload=0.0), "axis_1", "link", body)
    found = _frequencies_hz(chain, body, ["axis_1"])
    roots = np.array(
        [brentq(lambda z: np.tan(z) - np.tanh(z), k * np.pi, (k + 0.49) * np.pi) for k in (1, 2, 3)]
    )
    exact = bending_frequencies_hz(BEAM, roots)  # pinned and free: tan z = tanh z
    assert found[0] < 1e-3
    np.testing.assert_allclose(_nearest(found, exact), exact, rtol=1e-3)


def test_gravity_bends_the_link_as_in_the_handbook() -> None:
    body = _beam(0)
    for payload in (0.0, 3.0):
        chain = attach_flexible(_arm(payload=payload), "axis_1", "link", body)
        modes = np.flatnonzero(chain.joint_type == MODAL)
        modal = -np.linalg.solve(body.modal_stiffness, _terms(chain).bias[modes])
        own = BEAM.mass_per_length * 9.81 / 8 / STIFF
        sag, turn = body.tip_modes[5] @ modal, body.tip_modes[1] @ modal
        assert sag == pytest.approx(-own - payload * 9.81 / 3 / STIFF, rel=1e-9)
        # lowered, the tip turns about y: slope m g L^2 / 2 E I, and w L^3 / 6 E I
        slope = BEAM.mass_per_length * 9.81 / 6 / STIFF + payload * 9.81 / 2 / STIFF
        assert turn == pytest.approx(slope, rel=1e-9)


def test_a_spinning_beam_stretches_under_its_own_mass() -> None:
    body = assumed_modes(BEAM, (0, 0), 0, 3, shapes="polynomial")  # the exact answer is a cubic
    chain = attach_flexible(
        replace(_arm(payload=0.0), axis=np.tile([0.0, 0.0, 1.0], (2, 1))), "axis_1", "link", body
    )
    speed = np.zeros(chain.n_coordinate)
    speed[0] = 50.0
    modes = np.flatnonzero(chain.joint_type == MODAL)
    modal = -np.linalg.solve(body.modal_stiffness, _terms(chain, speed=speed).bias[modes])
    # u(L) = mass per length w^2 L^3 / (3 E A)
    assert body.tip_modes[3] @ modal == pytest.approx(
        BEAM.mass_per_length * 50.0**2 / 3 / BEAM.axial_stiffness, rel=1e-9
    )


def test_an_undeformed_flexible_link_leaves_the_rigid_motion_alone() -> None:
    rigid, chain = _arm(3), attach_flexible(_arm(3), "axis_2", "link", _beam(2))
    rng = np.random.default_rng(2)
    position, speed = rng.normal(size=(2, 3))
    kept = [chain.index(name) for name in rigid.names]
    wide = np.zeros((2, chain.n_coordinate))
    wide[:, kept] = position, speed
    plain, flexible = _terms(rigid, position, speed), _terms(chain, *wide)
    np.testing.assert_allclose(flexible.mass[np.ix_(kept, kept)], plain.mass, atol=1e-9)
    np.testing.assert_allclose(flexible.bias[kept], plain.bias, atol=1e-9)
    np.testing.assert_allclose(
        flexible.gravity_stiffness[np.ix_(kept, kept)], plain.gravity_stiffness, atol=1e-9
    )


def test_where_the_root_frame_is_put_in_the_link_does_not_matter() -> None:
    # the same link by another joint frame: turned, and 0.2 m beside the root
    rng = np.random.default_rng(3)
    turn = Rotation.from_rotvec([0.4, -0.3, 0.9]).as_matrix()
    along = np.array([0.0, 0.2, 0.0])  # along the joint axis, so that the coordinate stays the same
    body, arm = _beam(2), _arm(3)
    arm = replace(arm, axis=np.array([[1.0, 2.0, 3.0] / np.sqrt(14.0), *arm.axis[1:]]))
    plain = attach_flexible(arm, "axis_2", "link", body)
    axis, rotation, translation = arm.axis.copy(), arm.rotation.copy(), arm.translation.copy()
    axis[1], rotation[1] = turn @ axis[1], turn.T
    translation[1] -= along
    rotation[2], translation[2] = turn, turn @ (translation[2] + along)
    other = replace(arm, axis=axis, rotation=rotation, translation=translation)
    other = attach_flexible(other, "axis_2", "link", body.placed(turn, turn @ along))
    n = plain.n_coordinate
    position, speed = rng.normal(size=(2, n))
    position[2:-1] *= 0.01
    one, two = _terms(plain, position, speed), _terms(other, position, speed)
    np.testing.assert_allclose(two.mass, one.mass, atol=1e-9)
    np.testing.assert_allclose(two.bias, one.bias, atol=1e-8 * abs(one.bias).max())
    np.testing.assert_allclose(two.gravity_stiffness, one.gravity_stiffness, atol=1e-8)


def test_a_bearing_before_a_flexible_link_carries_it_with_its_modes() -> None:
    body = _beam(0).truncated(2)
    first = attach_flexible(
        _arm(3).with_elastic("axis_2", "bearing", [1.0, 0.0, 0.0]), "bearing", "link", body
    )
    second = attach_flexible(_arm(3), "axis_2", "link", body).with_elastic(
        "axis_2", "bearing", [1.0, 0.0, 0.0]
    )
    assert (
        first.names == ("axis_1", "axis_2", "bearing", "link_mode_1", "link_mode_2", "axis_3") == second.names
    )
    np.testing.assert_array_equal(second.flexible_root, [-1, -1, -1, 2, 2, -1])
    np.testing.assert_array_equal(second.parent, [-1, 0, 1, 2, 3, 4])
    rng = np.random.default_rng(4)
    position, speed = rng.normal(size=(2, 6))
    for name in ("mass", "bias", "gravity_stiffness"):
        one, two = (getattr(_terms(chain, position, speed), name) for chain in (first, second))
        np.testing.assert_array_equal(one, two)


def test_two_flexible_links_and_a_joint_at_the_tip_count_their_roots_right() -> None:
    body = _beam(0).truncated(2)
    chain = attach_flexible(attach_flexible(_arm(3), "axis_1", "lower", body), "axis_2", "upper", body)
    chain = chain.with_elastic("lower_mode_2", "flange", [0.0, 0.0, 1.0])
    assert chain.names[:5] == ("axis_1", "lower_mode_1", "lower_mode_2", "flange", "axis_2")
    np.testing.assert_array_equal(chain.flexible_root, [-1, 0, 0, -1, -1, 4, 4, -1])
    np.testing.assert_array_equal(chain.parent, [-1, 0, 1, 2, 3, 4, 5, 6])
    np.testing.assert_array_equal(np.flatnonzero(np.diag(chain.modal_mass)), [1, 2, 5, 6])


def test_branches_of_the_root_body_all_move_to_the_tip() -> None:
    chain = attach_flexible(
        replace(_arm(3), parent=np.array([-1, 0, 0])), "axis_1", "link", _beam(0).truncated(2)
    )
    np.testing.assert_array_equal(chain.parent, [-1, 0, 1, 2, 2])
    np.testing.assert_allclose(chain.translation[3:], 0, atol=1e-15)


def _altered(field: str, row: object, value: object) -> Chain:
    chain = attach_flexible(_arm(2), "axis_1", "link", _beam(0).truncated(2))
    changed = getattr(chain, field).copy()
    changed[row] = value
    return replace(chain, **{field: changed})


@pytest.mark.parametrize(
    ("field", "row", "value", "told"),
    [
        ("joint_type", 1, 0, "body 'link_mode_1': the joint axis has length"),
        ("flexible_root", 1, -1, "body 'link_mode_1': the root of its flexible body has index -1"),
        ("flexible_root", 2, 1, "body 'link_mode_2': the root of its flexible body has index 1"),
        ("flexible_root", 3, 0, "body 'axis_2': it has modal fields"),
        ("slide", 0, 1.0, "body 'axis_1': it has modal fields"),
        ("modal_momentum", 3, 1.0, "body 'axis_2': it has modal fields"),
        ("modal_mass", (1, 3), 1.0, "body 'link_mode_1': modal mass to 'axis_2'"),
        ("modal_mass", (1, 2), 0.5, "body 'axis_1': its modal mass is not symmetric"),
        ("modal_mass", (1, 1), 0.1, "body 'axis_1': its modes carry more momentum than its mass allows"),
        ("modal_momentum", (1, 5), 5.0, "body 'axis_1': its modes carry more momentum"),
        ("modal_inertia", (1, 0, 1), 5.0, "body 'link_mode_1': its modal inertia is not symmetric"),
        ("modal_inertia", (1, 0, 1), np.inf, "body 'link_mode_1': modal_inertia holds inf"),
        ("mass", 1, 1.0, "body 'link_mode_1': mass 1 kg on a modal joint"),
        ("parent", 2, 0, "body 'axis_1': two of its modes stand on one joint"),
    ],
)
def test_modes_that_make_no_flexible_body_are_refused(
    field: str, row: object, value: object, told: str
) -> None:
    with pytest.raises(ConfigurationError) as refused:
        _altered(field, row, value)
    assert told in str(refused.value)


def test_a_link_is_made_flexible_only_once_and_stays_whole() -> None:
    body = _beam(0).truncated(2)
    chain = attach_flexible(_arm(2), "axis_1", "link", body)
    for joint in ("axis_1", "link_mode_1"):
        with pytest.raises(
            ConfigurationError, match=f"body '{joint}': it is part of a flexible body already"
        ):
            attach_flexible(chain, joint, "again", body)
    with pytest.raises(ConfigurationError, match="in series behind its root 'axis_1', with nothing between"):
        chain.with_elastic("link_mode_1", "between", [0.0, 0.0, 1.0])
    with pytest.raises(ConfigurationError, match="no body 'tool'"):
        attach_flexible(chain, "tool", "link", body)
