"""Two-state friction against its equations, its hysteresis branch, its limits (Dahl, LuGre) and its energy."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import numpy.typing as npt
import pytest
from scipy.integrate import solve_ivp

from robid_core import ConfigurationError, Motion, Place
from robid_effects.dahl import Dahl
from robid_effects.elasto_plastic import ElastoPlastic
from robid_effects.lugre import LuGre

FloatArray = npt.NDArray[np.float64]

COULOMB, BREAKAWAY, SPEED, STIFFNESS, LAG, VISCOUS = PARAMETERS = np.array([1.0, 1.8, 0.05, 150.0, 0.03, 0.2])


def level(velocity: FloatArray | float) -> FloatArray:
    return np.asarray(COULOMB + (BREAKAWAY - COULOMB) * np.exp(-((np.asarray(velocity) / SPEED) ** 2)))


def along(
    velocity: FloatArray,
    step: float,
    parameters: FloatArray = PARAMETERS,
    start: tuple[float, float] = (0.0, 0.0),
) -> tuple[FloatArray, FloatArray]:
    """Torque in the middle of each step, shape (n,), and both states at its end, shape (n, 2)."""
    state, following = np.array(start), np.zeros(2)
    force, end = np.empty(len(velocity)), np.empty((len(velocity), 2))
    for k, v in enumerate(velocity):
        force[k] = ElastoPlastic.law(0.0, v, 0.0, state, following, parameters, step)[0]
        end[k] = following
        state, following = following, state
    return force, end


@pytest.mark.parametrize("speed", [1e-3, 0.02, -0.05, 2.0])
def test_steady_sliding_gives_the_stribeck_curve(speed: float) -> None:
    force, end = along(np.full(40, speed), max(LAG, BREAKAWAY / STIFFNESS / abs(speed)))
    assert force[-1] == pytest.approx(np.sign(speed) * level(speed) + VISCOUS * speed, rel=1e-12)
    assert end[-1, 1] == pytest.approx(BREAKAWAY - level(speed), rel=1e-12)


@pytest.mark.parametrize("omega", [0.1, 10.0, 3000.0])
def test_small_motions_meet_the_same_spring_at_any_frequency(omega: float) -> None:
    """Flow takes |v| z / w from v: relative to the spring at most sigma x / F_s over each reversal."""
    reach, n = 1e-6, 100
    t = (np.arange(n) + 0.5) * 2 * np.pi / omega / n
    force, _ = along(
        reach * omega * np.cos(omega * t), 2 * np.pi / omega / n, PARAMETERS * [1, 1, 1, 1, 1, 0]
    )
    spring = STIFFNESS * reach * np.sin(omega * t)
    # and the sum of velocities is off the sine by (omega step)^2 / 24
    assert np.abs(force - spring).max() < STIFFNESS * reach * (4 * STIFFNESS * reach / BREAKAWAY + 2e-4)


def test_from_a_reversal_on_the_hysteresis_follows_one_exponential_branch() -> None:
    """dz/dx = |W| K exp(-K |x - x_r|), W = w sign(v) - z_r, K = sigma / w; far below the Stribeck speed w is F_s."""
    speed, step = 1e-6, 1.0  # the level is off F_s by (v / v_s)^2 = 4e-10
    _, out = along(np.full(12_000, speed), step)
    reversal = out[-1, 0]
    force, _ = along(np.full(9_000, -speed), step, start=tuple(out[-1]))
    path, rate = speed * step * (np.arange(9_000) + 0.5), STIFFNESS / BREAKAWAY
    expected = reversal - (BREAKAWAY + reversal) * -np.expm1(-rate * path)
    np.testing.assert_allclose(force, expected - VISCOUS * speed, atol=2e-8)


def test_refining_the_step_four_times_reduces_the_error_sixteenfold() -> None:
    """Against the two equations of the file, integrated by LSODA."""

    def exact(t: float, y: FloatArray) -> list[float]:
        v = 0.1 * np.cos(5 * t)
        return [STIFFNESS * (v - np.abs(v) * y[0] / y[1]), (float(level(v)) - y[1]) / LAG]

    errors, pieces = [], [0.0, np.pi / 10, 3 * np.pi / 10, 2 * np.pi / 5]
    for n in (400, 1600):
        step = 2 * np.pi / 5 / n
        t = (np.arange(n) + 0.5) * step
        v, z, start = 0.1 * np.cos(5 * t), np.empty(n), np.array([0.0, BREAKAWAY])
        for a, b in pairwise(pieces):
            part = solve_ivp(exact, (a, b), start, method="LSODA", rtol=1e-11, atol=1e-12, dense_output=True)
            inside = (t > a) & (t < b)
            z[inside], start = part.sol(t[inside])[0], part.y[:, -1]
        errors.append(np.abs(along(v, step)[0] - z - VISCOUS * v).max())
    assert 12 < errors[0] / errors[1] < 20
    assert errors[1] < 1e-3


def test_without_a_lag_it_is_lugre_without_damper_and_without_stribeck_curve_dahl() -> None:
    rng = np.random.default_rng(7)
    velocity = rng.standard_normal(200) * 0.1
    limits = (
        (LuGre.law, PARAMETERS * [1, 1, 1, 1, 1e-6, 1], [COULOMB, BREAKAWAY, SPEED, STIFFNESS, 0.0, VISCOUS]),
        (Dahl.law, np.array([COULOMB, COULOMB, SPEED, STIFFNESS, LAG, 0.0]), [COULOMB, STIFFNESS]),
    )
    for law, parameters, others in limits:
        force, _ = along(velocity, 2e-3, parameters)
        state, following = np.zeros(1), np.zeros(1)
        for k, v in enumerate(velocity):
            assert force[k] == pytest.approx(
                law(0.0, v, 0.0, state, following, np.array(others), 2e-3)[0], rel=1e-10
            )
            state, following = following, state


def test_break_away_grows_with_the_rest_before_it() -> None:
    """After fast sliding the level recovers as F_s - (F_s - F_c) exp(-t / lag), and a quick pull meets it."""
    _, sliding = along(np.full(400, 1.0), 1e-3)
    assert sliding[-1, 1] == pytest.approx(BREAKAWAY - COULOMB, rel=1e-3)
    for rest in (0.2 * LAG, LAG, 5 * LAG):
        _, rested = along(np.zeros(1), rest, start=(0.0, sliding[-1, 1]))
        recovered = BREAKAWAY - sliding[-1, 1] * np.exp(-rest / LAG)
        assert BREAKAWAY - rested[0, 1] == pytest.approx(recovered, rel=1e-12)
        # pulled at 100 rad/s the path of relaxation, 0.01 rad, takes 1e-4 s: 3e-3 of the lag
        pulled = along(np.full(1000, 100.0), 1e-6, PARAMETERS * [1, 1, 1, 1, 1, 0], start=tuple(rested[0]))[0]
        assert pulled.max() == pytest.approx(recovered, rel=0.02)


def test_friction_lags_behind_a_changing_speed() -> None:
    """While the speed grows the torque is above, while it falls below the Stribeck curve."""
    n, step = 4000, 2.5e-4
    phase = 2 * np.pi * (np.arange(2 * n) + 0.5) / n
    velocity = SPEED * (1.5 + 0.8 * np.sin(phase))
    excess = (along(velocity, step)[0] - level(velocity) - VISCOUS * velocity)[n:]
    assert excess[0] > 0.02
    assert excess[n // 2] < -0.02


def test_no_motion_gains_more_than_was_stored() -> None:
    """Work of any motion >= z^2 / (2 sigma).

    The midpoint rule misses |dx|^3 / 24 |d2F/dx2| a step, the last at most sigma^2 2 F_s / F_c^2.
    """
    rng = np.random.default_rng(8)
    for reach, step in ((2e-3, 1e-3), (0.05, 1e-3), (0.3, 1e-4)):
        velocity = reach / step / 100 * np.repeat(rng.standard_normal(60), 50) * np.tile(np.hanning(50), 60)
        force, end = along(velocity, step, PARAMETERS * [1, 1, 1, 1, 1, 0])
        work = np.cumsum(force * velocity * step)
        allowed = np.cumsum(np.abs(velocity * step) ** 3) / 24 * STIFFNESS**2 * 2 * BREAKAWAY / COULOMB**2
        assert np.all(work >= end[:, 0] ** 2 / (2 * STIFFNESS) - allowed)
        assert allowed[-1] < 0.2 * work[-1]


def test_a_stiff_bristle_stays_within_the_break_away_level_whatever_the_step() -> None:
    rng = np.random.default_rng(9)
    velocity = rng.standard_normal(3000) * 10 ** rng.uniform(-7, 3, 3000)
    force, end = along(velocity, 1e-3, PARAMETERS * [1, 1, 1, 1e6 / STIFFNESS, 1e-4 / LAG, 0])
    assert max(np.abs(force).max(), np.abs(end[:, 0]).max()) <= BREAKAWAY * (1 + 1e-14)
    assert np.all((end[:, 1] >= 0) & (end[:, 1] <= (BREAKAWAY - COULOMB) * (1 + 1e-14)))


@pytest.mark.parametrize("state", [(-1.2, 0.0), (0.0, 0.3), (0.9, 0.8)])
@pytest.mark.parametrize("velocity", [-0.4, -0.03, 1e-3, 0.06])
def test_the_slope_is_the_central_difference_of_the_torque(
    velocity: float, state: tuple[float, float]
) -> None:
    h, step = 1e-4 * abs(velocity), 0.02
    forces = [along(np.array([velocity + d]), step, start=state)[0][0] for d in (h, -h)]
    slope = ElastoPlastic.law(0.0, velocity, 0.0, np.array(state), np.zeros(2), PARAMETERS, step)[2]
    # curves of width at least 0.7 |v|, torque at most 2: error h^2 / 6 * 2 * 6 / (0.7 |v|)^3 < 2e-7 / |v|
    assert slope == pytest.approx((forces[0] - forces[1]) / (2 * h), abs=2e-7 / abs(velocity))


def test_a_breakaway_below_coulomb_is_refused(at: Callable[..., Place]) -> None:
    with pytest.raises(
        ConfigurationError, match=r"effect tried: breakaway is 0.9 N m, below coulomb 1 N m; give"
    ):
        ElastoPlastic.arguments(PARAMETERS * [1, 0.5, 1, 1, 1, 1], at("motor"))


def test_linearisation_ends_in_the_spring_and_in_sliding_friction(at: Callable[..., Place]) -> None:
    """Small: sigma. Large: 2 w times the density of v at 0, with w = F_c; about 2 % as the core states."""
    omega = 60.0
    small = ElastoPlastic.linearize(
        PARAMETERS, at("arm"), Motion(position_rms=1e-6, velocity_rms=6e-5, omega=omega)
    )
    assert float(small.stiffness) == pytest.approx(STIFFNESS, rel=0.02)
    assert float(small.damping) == pytest.approx(VISCOUS, abs=0.02 * STIFFNESS / omega)
    large = ElastoPlastic.linearize(
        PARAMETERS, at("arm"), Motion(position_rms=5.0, velocity_rms=300.0, omega=omega)
    )
    assert float(large.damping) == pytest.approx(
        2 * COULOMB / (np.sqrt(2 * np.pi) * 300.0) + VISCOUS, rel=0.02
    )
