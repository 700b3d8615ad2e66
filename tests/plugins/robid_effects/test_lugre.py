"""LuGre friction: Stribeck curve, spring at rest, break-away that falls with rate, lag, passivity, stiff steps."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import numpy.typing as npt
import pytest
from scipy.integrate import solve_ivp

from robid_core import ConfigurationError, Motion, Place
from robid_effects.lugre import LuGre

FloatArray = npt.NDArray[np.float64]

COULOMB, BREAKAWAY, SPEED, STIFFNESS, DAMPING, VISCOUS = PARAMETERS = np.array(
    [1.0, 1.5, 0.05, 200.0, 0.3, 0.4]
)


def level(velocity: FloatArray | float) -> FloatArray:
    return np.asarray(COULOMB + (BREAKAWAY - COULOMB) * np.exp(-((np.asarray(velocity) / SPEED) ** 2)))


def along(
    velocity: FloatArray, step: float, parameters: FloatArray = PARAMETERS, start: float = 0.0
) -> tuple[FloatArray, FloatArray]:
    """Torque in the middle of each step and the bristles' torque at its end."""
    state, following = np.array([start]), np.zeros(1)
    out = np.empty((2, len(velocity)))
    for k, v in enumerate(velocity):
        out[0, k] = LuGre.law(0.0, v, 0.0, state, following, parameters, step)[0]
        out[1, k] = following[0]
        state, following = following, state
    return out[0], out[1]


def pull(mass: float, rate: float, step: float, end: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Force on a mass raised at a rate from zero: time, friction, speed; implicit midpoint by Newton."""
    state, following, v = np.zeros(1), np.zeros(1), 0.0
    out = np.empty((3, round(end / step)))
    for k in range(out.shape[1]):
        middle = v
        for _ in range(3):
            force, _, slope = LuGre.law(0.0, middle, 0.0, state, following, PARAMETERS, step)
            residual = mass * (middle - v) * 2 / step + force - rate * step * (k + 0.5)
            out[:, k] = step * (k + 0.5), force, middle
            middle -= residual / (mass * 2 / step + slope)
        state, following = following, state
        v = 2 * out[2, k] - v
    return out[0], out[1], out[2]


@pytest.mark.parametrize("speed", [1e-3, 0.02, 0.05, -0.07, 2.0])
def test_steady_sliding_gives_the_stribeck_curve(speed: float) -> None:
    force, end = along(np.full(3, speed), 50 * BREAKAWAY / STIFFNESS / abs(speed))
    assert end[-1] == pytest.approx(np.sign(speed) * level(speed), rel=1e-13)
    assert force[-1] == pytest.approx(np.sign(speed) * level(speed) + VISCOUS * speed, rel=1e-13)


def test_small_motions_meet_a_spring_and_two_dampers() -> None:
    """Flow takes |v| z / g from v: relative to spring and dampers at most sigma0 x / F_s at reach x."""
    omega, reach, n = 300.0, 1e-6, 4000
    t = (np.arange(n) + 0.5) * 2 * np.pi / omega / 200
    force, _ = along(reach * omega * np.cos(omega * t), 2 * np.pi / omega / 200)
    linear = STIFFNESS * reach * np.sin(omega * t) + (DAMPING + VISCOUS) * reach * omega * np.cos(omega * t)
    scale = (STIFFNESS + (DAMPING + VISCOUS) * omega) * reach
    # the sum of velocities, each over its step, is off the sine by (omega step)^2 / 24
    assert np.abs(force - linear).max() < scale * (
        STIFFNESS * reach / BREAKAWAY * 20 + (2 * np.pi / 200) ** 2 / 24
    )


def test_break_away_falls_when_the_force_is_raised_faster() -> None:
    """Mass on which a force grows at a rate; against the same equations integrated by LSODA.

    It lies between the two levels of the table, which slow and fast raising reach.
    """
    mass, peaks = 0.05, []
    for rate in (0.1, 1.0, 5.0):
        end = 2.0 / rate + 0.02
        t, friction, _ = pull(mass, rate, end / 10_000, end)

        def motion(t: float, y: FloatArray, rate: float = rate) -> list[float]:
            stretching = y[0] - abs(y[0]) * y[1] / level(y[0])
            friction = y[1] + DAMPING * stretching + VISCOUS * y[0]
            return [(rate * t - friction) / mass, STIFFNESS * stretching]

        exact = solve_ivp(
            motion, (0, end), [0.0, 0.0], method="LSODA", rtol=1e-9, atol=1e-11, dense_output=True
        )
        v, z = exact.sol(t)
        torque = z + DAMPING * (v - np.abs(v) * z / level(v)) + VISCOUS * v
        # second order: 1.1e-3 with half the steps, 2.8e-4 here, both at the slowest
        assert np.abs(friction - torque).max() < 5e-4
        peaks.append((friction - VISCOUS * v).max())
    assert BREAKAWAY > peaks[0] > peaks[1] + 0.1 > peaks[2] + 0.2 > COULOMB


def test_friction_lags_behind_a_changing_speed() -> None:
    """At the same speed the torque is higher while the speed grows: a loop about the Stribeck curve."""
    n = 2000
    phase = 2 * np.pi * (np.arange(2 * n) + 0.5) / n
    velocity = SPEED * (1.0 + 0.5 * np.sin(phase))
    force = along(velocity, 1.0 / n)[0][n:]  # period 1 s, path of relaxation 0.1 s
    rising, falling = force[n // 8], force[3 * n // 8 - 1]
    assert velocity[n // 8] == pytest.approx(velocity[3 * n // 8 - 1])
    assert rising > falling + 0.02


@pytest.mark.parametrize("parameters", [PARAMETERS, PARAMETERS * [1, 1, 1, 1, 0, 0]])
def test_every_motion_costs_energy_where_the_theory_says_so(parameters: FloatArray) -> None:
    """sigma2 > sigma1 (F_s - F_c) / F_c, or no damper: work over motions that end where they began."""
    assert parameters[5] > parameters[4] * 0.5 or parameters[4] == 0
    rng = np.random.default_rng(5)
    n, step = 4000, 1e-3
    for reach in (1e-3, 1e-2, 0.2):
        t = np.arange(n)[:, None] * 2 * np.pi / n
        velocity = reach * np.cos(np.arange(1, 12) * t + 2 * np.pi * rng.random(11)).sum(axis=1)
        force, _ = along(np.tile(velocity, 2), step, parameters)
        assert np.sum(force[n:] * velocity) * step > 0
        assert np.sum(force[:n] * velocity) * step > 0


def test_a_stiff_bristle_is_stable_in_a_long_step() -> None:
    """sigma0 = 1e6, step 1e-3, speeds over nine decades: bristles and friction stay within the break-away level."""
    parameters = PARAMETERS * [1, 1, 1, 5e3, 0, 1]
    rng = np.random.default_rng(6)
    velocity = rng.standard_normal(3000) * 10 ** rng.uniform(-7, 2, 3000)
    force, end = along(velocity, 1e-3, parameters)
    assert np.abs(end).max() <= BREAKAWAY * (1 + 1e-14)
    assert np.all(np.abs(force - VISCOUS * velocity) <= BREAKAWAY * (1 + 1e-14))


def test_refining_the_step_four_times_reduces_the_error_sixteenfold() -> None:
    def exact(t: float, z: FloatArray) -> FloatArray:
        v = 0.1 * np.cos(t)
        return STIFFNESS * (v - np.abs(v) * z / level(v))

    errors, pieces = [], [0.0, np.pi / 2, 3 * np.pi / 2, 2 * np.pi]
    for n in (800, 3200):
        t = (np.arange(n) + 0.5) * 2 * np.pi / n
        v, z, start = 0.1 * np.cos(t), np.empty(n), np.zeros(1)
        for a, b in pairwise(pieces):
            part = solve_ivp(exact, (a, b), start, rtol=1e-11, atol=1e-13, dense_output=True, max_step=0.05)
            inside = (t > a) & (t < b)
            z[inside], start = part.sol(t[inside])[0], part.y[:, -1]
        force = z + DAMPING * (v - np.abs(v) * z / level(v)) + VISCOUS * v
        errors.append(np.abs(along(v, 2 * np.pi / n)[0] - force).max())
    assert 12 < errors[0] / errors[1] < 20
    assert errors[1] < 1e-3


@pytest.mark.parametrize("torque", [-1.2, 0.0, 0.9])
@pytest.mark.parametrize("velocity", [-0.4, -0.03, 1e-3, 0.06])
def test_the_slope_is_the_central_difference_of_the_torque(velocity: float, torque: float) -> None:
    h, step = 1e-4 * abs(velocity), 0.02
    forces = [along(np.array([velocity + d]), step, start=torque)[0][0] for d in (h, -h)]
    slope = LuGre.law(0.0, velocity, 0.0, np.array([torque]), np.zeros(1), PARAMETERS, step)[2]
    # curves of width at least 0.7 |v|, torque at most 2: error h^2 / 6 * 2 * 6 / (0.7 |v|)^3 < 2e-7 / |v|
    assert slope == pytest.approx((forces[0] - forces[1]) / (2 * h), abs=2e-7 / abs(velocity))


def test_a_breakaway_below_coulomb_is_refused(at: Callable[..., Place]) -> None:
    assert list(LuGre.arguments(PARAMETERS, at("arm"))) == list(PARAMETERS)
    with pytest.raises(
        ConfigurationError, match=r"effect tried: breakaway is 0.5 N m, below coulomb 1 N m; give"
    ):
        LuGre.arguments(PARAMETERS * [1, 1 / 3, 1, 1, 1, 1], at("motor"))


def test_linearisation_ends_in_the_bristles_and_in_sliding_friction(at: Callable[..., Place]) -> None:
    """Small: sigma0 and sigma1 + sigma2. Large: 2 F_c times the density of v at 0, plus sigma2. The core states 2 %."""
    omega = 60.0
    small = LuGre.linearize(
        PARAMETERS, at("motor"), Motion(position_rms=1e-6, velocity_rms=6e-5, omega=omega)
    )
    assert float(small.stiffness) == pytest.approx(STIFFNESS, rel=0.02)
    assert float(small.damping) == pytest.approx(DAMPING + VISCOUS, rel=0.02)
    large = LuGre.linearize(
        PARAMETERS, at("motor"), Motion(position_rms=5.0, velocity_rms=300.0, omega=omega)
    )
    assert float(large.damping) == pytest.approx(
        2 * COULOMB / (np.sqrt(2 * np.pi) * 300.0) + VISCOUS, rel=0.02
    )
