"""Maxwell-slip hysteresis: virgin curve, Masing's rule, return-point memory, loop area - all exact, at any step."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import pytest

from robid_core import Motion, Place
from robid_effects.maxwell_slip import MaxwellSlip, sliders

FloatArray = npt.NDArray[np.float64]

STIFFNESS, TORQUE, SPREAD = PARAMETERS = np.array([4e3, 6.0, 20.0])
SPRINGS, LEVELS = sliders(STIFFNESS, TORQUE, SPREAD)
BREAK_AWAY = LEVELS / SPRINGS  # deflections, smallest first


def virgin(x: FloatArray) -> FloatArray:
    """Torque after a single deflection x from rest."""
    return np.clip(SPRINGS * np.asarray(x)[..., None], -LEVELS, LEVELS).sum(axis=-1)


def along(
    path: FloatArray, step: float = 1e-3, start: FloatArray | None = None
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Torque in the middle of the steps between the points of a path, torque at their ends, and the last state."""
    arguments = np.concatenate((SPRINGS, LEVELS))
    state, following = np.zeros(4) if start is None else start.copy(), np.zeros(4)
    out = np.empty((2, len(path) - 1))
    for k, dx in enumerate(np.diff(path)):
        out[0, k] = MaxwellSlip.law(0.0, dx / step, 0.0, state, following, arguments, step)[0]
        out[1, k] = following.sum()
        state, following = following, state
    return out[0], out[1], state


def test_the_sliders_add_up_to_the_table(at: Callable[..., Place]) -> None:
    assert (SPRINGS.sum(), LEVELS.sum()) == pytest.approx((STIFFNESS, TORQUE), rel=1e-14)
    assert BREAK_AWAY[-1] / BREAK_AWAY[0] == pytest.approx(SPREAD, rel=1e-14)
    np.testing.assert_allclose(BREAK_AWAY[1:] / BREAK_AWAY[:-1], SPREAD ** (1 / 3), rtol=1e-14)
    np.testing.assert_array_equal(
        MaxwellSlip.arguments(PARAMETERS, at("gear")), np.concatenate((SPRINGS, LEVELS))
    )


@pytest.mark.parametrize("step", [1e-6, 1e-3, 1.0])
def test_the_virgin_curve_is_exact_at_any_step(step: float) -> None:
    path = np.linspace(0.0, 1.2 * BREAK_AWAY[-1], 101)
    middle, end, _ = along(path, step)
    np.testing.assert_allclose(middle, virgin(0.5 * (path[1:] + path[:-1])), rtol=1e-12)
    np.testing.assert_allclose(end, virgin(path[1:]), rtol=1e-12)
    assert end[-1] == pytest.approx(TORQUE, rel=1e-14)
    np.testing.assert_allclose(along(-path, step)[1], -end, rtol=1e-14)


def test_one_long_step_ends_where_many_short_ones_do() -> None:
    many, one = (along(np.linspace(0, 0.7 * BREAK_AWAY[-1], n))[2] for n in (1000, 2))
    np.testing.assert_allclose(many, one, rtol=1e-12)


@pytest.mark.parametrize("share", [0.3, 0.9, 2.0])
def test_every_branch_is_the_virgin_curve_doubled(share: float) -> None:
    """Masing: from a reversal at x_r, F = F_r -+ 2 virgin(|x - x_r| / 2), on the way down and up again."""
    top = share * BREAK_AWAY[-1]
    down = np.linspace(top, -top, 201)
    _, _, at_top = along(np.array([0.0, top]))
    _, falling, at_bottom = along(down, start=at_top)
    np.testing.assert_allclose(
        falling, virgin(np.array(top)) - 2 * virgin((top - down[1:]) / 2), atol=1e-12 * TORQUE
    )
    _, rising, back = along(-down, start=at_bottom)
    np.testing.assert_allclose(
        rising, -virgin(np.array(top)) + 2 * virgin((top - down[1:]) / 2), atol=1e-12 * TORQUE
    )
    np.testing.assert_allclose(back, at_top, atol=1e-12 * TORQUE)


def test_a_loop_inside_a_loop_closes_at_once_and_is_forgotten() -> None:
    """Return-point memory: after an inner loop every slider is where it was (Dahl's would have drifted)."""
    outer = np.array([0.0, 1.0, -0.4]) * BREAK_AWAY[-1]
    _, _, before = along(outer)
    inner = outer[-1] + np.array([0.0, 0.5, -0.0, 0.3, 0.1, 0.3, 0.0]) * BREAK_AWAY[-1]
    _, _, after = along(inner, start=before)
    np.testing.assert_allclose(after, before, atol=1e-12 * TORQUE)


@pytest.mark.parametrize("share", [0.02, 0.5, 3.0])
def test_the_work_of_a_loop_is_that_of_the_sliding_ones(share: float) -> None:
    """Each slider slips 2 (A - delta) on either way: W = sum 4 f_i max(A - delta_i, 0)."""
    top = share * BREAK_AWAY[-1]
    _, _, state = along(np.array([0.0, top]))
    path = np.concatenate((np.linspace(top, -top, 4001), np.linspace(-top, top, 4001)[1:]))
    middle, _, _ = along(path, start=state)
    expected = np.sum(4 * LEVELS * np.maximum(top - BREAK_AWAY, 0.0))
    # a knee costs the midpoint rule at most k dx^2 / 8, four springs on two branches
    assert np.sum(middle * np.diff(path)) == pytest.approx(
        expected, abs=2 * STIFFNESS * (top / 2000) ** 2 / 8 + 1e-15
    )


def test_no_motion_gains_more_than_was_stored() -> None:
    rng = np.random.default_rng(14)
    path = np.concatenate(([0.0], np.cumsum(rng.standard_normal(3000)))) * BREAK_AWAY[0] / 5
    middle, _, state = along(path)
    knees = 0.125 * STIFFNESS * np.sum(np.diff(path) ** 2)  # of all steps; few have one
    assert np.sum(middle * np.diff(path)) >= np.sum(state**2 / (2 * SPRINGS)) - knees


def test_the_slope_is_the_spring_of_the_sliders_that_stick() -> None:
    arguments, step = np.concatenate((SPRINGS, LEVELS)), 1e-3
    edges = np.concatenate(([0.0], BREAK_AWAY, [2 * BREAK_AWAY[-1]]))
    for slipping, x in enumerate(0.5 * (edges[1:] + edges[:-1])):
        for velocity in (2 * x / step, -2 * x / step):
            h = 1e-3 * velocity
            force, up, down = (
                MaxwellSlip.law(0.0, velocity + d, 0.0, np.zeros(4), np.zeros(4), arguments, step)
                for d in (0.0, h, -h)
            )
            assert force[2] == pytest.approx(SPRINGS[slipping:].sum() * step / 2, rel=1e-14)
            assert force[2] == pytest.approx((up[0] - down[0]) / (2 * h), rel=1e-9, abs=1e-12)


def test_linearisation_ends_in_the_springs_and_in_coulomb_friction(at: Callable[..., Place]) -> None:
    """Small: all springs, no loss. Large: 2 T times the density of the speed at 0; the core states 2 %."""
    omega = 60.0
    small = MaxwellSlip.linearize(
        PARAMETERS, at("gear"), Motion(position_rms=1e-7, velocity_rms=6e-6, omega=omega)
    )
    assert float(small.stiffness) == pytest.approx(STIFFNESS, rel=0.02)
    assert abs(float(small.damping)) * omega < 0.02 * STIFFNESS
    large = MaxwellSlip.linearize(
        PARAMETERS, at("gear"), Motion(position_rms=5.0, velocity_rms=300.0, omega=omega)
    )
    assert float(large.damping) == pytest.approx(2 * TORQUE / (np.sqrt(2 * np.pi) * 300.0), rel=0.02)
