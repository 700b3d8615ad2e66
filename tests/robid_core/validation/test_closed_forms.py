"""Simulator and linear model against formulas of the textbook, robots written as robot files."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from oracles.robots import STANDARD_GRAVITY, motor_alone, motor_on_a_wall, pendulum, two_masses
from oracles.runs import Method, at_rest, free_motion, moving, run
from scipy.integrate import quad
from scipy.special import ellipj, ellipk

FloatArray = npt.NDArray[np.float64]

SAMPLE_TIME = 1e-3
ROTOR, LOAD, RATIO, STIFFNESS = 2e-3, 0.3, 10.0, 3e3
ANTIRESONANCE = np.sqrt(STIFFNESS / LOAD)
RESONANCE = np.sqrt(STIFFNESS * (1 / LOAD + 1 / (ROTOR * RATIO**2)))


def test_poles_and_zeros_of_two_masses_are_resonance_and_antiresonance() -> None:
    model = two_masses(ROTOR, LOAD, RATIO, STIFFNESS).linearize(np.zeros(1))
    poles = np.linalg.eigvals(model.a)
    zeros = np.linalg.eigvals(model.a - model.b @ np.linalg.solve(model.d, model.c))
    # eigenvalues of a double pole at zero are known to the root of the rounding only: largest ones are
    # compared
    assert abs(poles.imag).max() == pytest.approx(RESONANCE, rel=1e-12)
    assert abs(zeros.imag).max() == pytest.approx(ANTIRESONANCE, rel=1e-12)
    assert abs(poles.real).max() < 1e-6 * RESONANCE


def test_the_motor_stands_still_at_the_antiresonance_and_swings_most_at_the_resonance() -> None:
    robot = two_masses(ROTOR, LOAD, RATIO, STIFFNESS, damping=0.5)
    f = np.array([0.9, 1.0, 1.1])
    g = [
        abs(robot.response(np.zeros((1, 1)), w / (2 * np.pi) * f, hold="continuous")[0, :, 0, 0])
        for w in (ANTIRESONANCE, RESONANCE)
    ]
    assert (g[0][1] < 0.1 * g[0][[0, 2]]).all()
    assert (g[1][1] > 3 * g[1][[0, 2]]).all()


@pytest.mark.parametrize(
    ("method", "n_step"), [("implicit_midpoint", 4), ("implicit_midpoint", 1), ("runge_kutta", 8)]
)
def test_record_of_two_masses_fulfils_the_difference_equation_of_the_textbook(
    method: Method, n_step: int
) -> None:
    # Motor angle over held motor torque is 1 / (J s^2) + c / (s^2 + w^2), J the whole inertia at the motor
    # and c = load / (rotor J); sampled with a zero-order hold, T^2 (z + 1) / (2 J (z - 1)^2) + c (1 - cos p)
    # (z + 1) / (w^2 (z^2 - 2 z cos p + 1)), p = w T. Any record fulfils it. A method whose angles are those of an
    # oscillator turned too little fulfils the same equation with its own p: it is found from the record.
    robot = two_masses(ROTOR, LOAD, RATIO, STIFFNESS)
    load = LOAD / RATIO**2
    whole = ROTOR + load
    torque = np.random.default_rng(0).normal(size=(1, 400, 1))
    start, still = at_rest(robot, [[0.0]]), np.zeros_like(torque)
    done = run(robot, start, still, method=method, n_step=n_step, torque_feedforward=torque)
    rigid, plus = np.array([1.0, -2.0, 1.0]), np.array([1.0, 1.0])
    through = load / (ROTOR * whole) / RESONANCE**2 * np.convolve(plus, rigid)
    stiffly = SAMPLE_TIME**2 / (2 * whole)

    def sides(cosine: float) -> FloatArray:
        """Left side minus right side of the equation at every sample: linear in cos p."""
        swing = np.array([1.0, -2 * cosine, 1.0])
        of_torque = stiffly * np.convolve(plus, swing) + (1 - cosine) * through
        left = np.convolve(done.position[0, :, 0], np.convolve(rigid, swing), "valid")
        return np.asarray(left - np.convolve(done.torque[0, :, 0], of_torque, "valid")[:-1])

    constant, slope = sides(0.0), sides(1.0) - sides(0.0)
    cosine = float(-(slope @ constant) / (slope @ slope))
    # what is left: rounding of angles of 10 rad in a fourth difference; of Runge-Kutta (w h)^5 / 120 a step
    limit = 1e-6 if method == "runge_kutta" else 1e-9
    assert abs(sides(cosine)).max() < limit * abs(constant).max()
    small = RESONANCE * SAMPLE_TIME / n_step
    late = small**4 / 120 if method == "runge_kutta" else small**2 / 12  # the midpoint rule's
    assert np.arccos(cosine) == pytest.approx(RESONANCE * SAMPLE_TIME, rel=1.1 * late + 1e-9)


def test_a_pendulum_swings_on_the_elliptic_functions_of_jacobi() -> None:
    mass, length, inertia, rotor, ratio, start = 4.0, 0.5, 0.2, 1e-3, 20.0, 2.4
    robot = pendulum(mass, length, inertia, rotor, ratio)
    whole = inertia + mass * length**2 + rotor * ratio**2
    omega = np.sqrt(mass * STANDARD_GRAVITY * length / whole)
    k2 = np.sin(start / 2) ** 2
    period = 4 * ellipk(k2) / omega
    n_sample = int(2.5 * period / SAMPLE_TIME)
    t = SAMPLE_TIME * np.arange(n_sample)
    _, cn, dn, _ = ellipj(omega * t, k2)
    exact = 2 * np.arcsin(np.sqrt(k2) * cn / dn)
    at_start = -np.array([ratio * mass * STANDARD_GRAVITY * length * np.sin(start) / whole])

    def error(method: Method, n_step: int) -> float:
        swing, _ = free_motion(
            robot, np.array([ratio * start]), np.zeros(1), np.zeros(1), n_sample, at_start, method, n_step
        )
        return float(abs(swing[:, 0] / ratio - exact).max())

    coarse, fine = error("implicit_midpoint", 4), error("implicit_midpoint", 8)
    assert coarse / fine == pytest.approx(4.0, rel=0.05)
    # (w h)^2 / 24 a radian of phase with the speed of the fall, w t below 20, slopes up to 2 w
    assert coarse < 1e-5
    assert error("runge_kutta", 4) < 1e-10


def test_gravity_moves_the_poles_of_a_pendulum() -> None:
    mass, length, inertia, rotor, ratio = 4.0, 0.5, 0.2, 1e-3, 20.0
    robot = pendulum(mass, length, inertia, rotor, ratio)
    whole = inertia + mass * length**2 + rotor * ratio**2
    for angle in (
        0.0,
        0.7,
        -1.2,
    ):  # about a held angle the pendulum swings with the component of gravity along it
        poles = np.linalg.eigvals(robot.linearize(np.array([angle])).a)
        expected = np.sqrt(mass * STANDARD_GRAVITY * length * np.cos(angle) / whole)
        np.testing.assert_allclose(np.sort(poles.imag), [-expected, expected], rtol=1e-10)
    rising = np.linalg.eigvals(robot.linearize(np.array([np.pi])).a)
    assert rising.real.max() == pytest.approx(np.sqrt(mass * STANDARD_GRAVITY * length / whole), rel=1e-10)


@pytest.mark.parametrize(("n_step", "tolerance"), [(4, 0.02), (32, 1e-3)])
def test_coulomb_friction_takes_the_same_amplitude_from_every_swing(n_step: int, tolerance: float) -> None:
    # Sharp friction shifts the centre of each half swing by fc / k: peaks lie on a line, 4 fc / k lower a
    # period, half a period apart whatever the friction.
    rotor, stiffness, coulomb, start, friction_speed = 1e-3, 2.5, 2e-2, 0.15, 0.01
    omega = np.sqrt(stiffness / rotor * (1 + 1e-6))
    robot = motor_on_a_wall(rotor, stiffness, coulomb, friction_speed)
    n_half = 6
    n_sample = round(n_half * np.pi / omega / SAMPLE_TIME) + 40
    begin = np.array([start, 0.0])
    moved, _ = free_motion(
        robot,
        begin,
        np.zeros(2),
        np.zeros(1),
        n_sample,
        np.array([-stiffness * start / rotor, 0.0]),
        n_step=n_step,
    )
    swing = moved[:, 0]
    t = SAMPLE_TIME * np.arange(n_sample)
    lost = 2 * coulomb / stiffness
    peaks = start - lost * np.arange(n_half + 1)
    assert peaks[-1] > lost  # it has not stuck
    half = np.minimum((t * omega / np.pi).astype(int), n_half)
    sign = np.where(half % 2 == 0, 1.0, -1.0)
    exact = sign * ((peaks[half] - lost / 2) * np.cos(omega * t - half * np.pi) + lost / 2)
    during = t < n_half * np.pi / omega
    # The smooth sign gives back (pi^2 / 24) (v_s / (w A))^2 of each loss, 1e-3 of it at the smallest swing; a
    # step that does not resolve the reversal, v_s / (w^2 A) = 0.1 ms, misplaces it by a fraction of itself.
    smoothing = np.pi**2 / 24 * (friction_speed / (omega * peaks[-1])) ** 2
    assert smoothing < 1e-3
    np.testing.assert_allclose(swing[during], exact[during], rtol=0, atol=tolerance * lost * n_half)


def test_friction_under_a_sine_is_its_describing_function() -> None:
    # Torque over speed of a rotor that swings: i w J + N(V), N = 4 fc / (pi V) for a sharp sign. The speed's
    # own third harmonic, N / (9 w J), changes N by its square; the smooth sign by quadrature.
    inertia, coulomb, friction_speed, frequency, n_period = 2e-3, 0.05, 0.2, 4.0, 6
    omega = 2 * np.pi * frequency
    n_sample = round(1 / frequency / SAMPLE_TIME)
    robot = motor_alone(inertia, coulomb, friction_speed, speed_gain=0.5)
    t = SAMPLE_TIME * np.arange(n_period * n_sample)
    reference = 12.0 * np.sin(omega * t)[None, :, None]
    done = run(robot, at_rest(robot, [[0.0]]), reference, n_step=8)
    last = slice((n_period - 1) * n_sample, None)
    angle, torque = (np.fft.fft(x[0, last, 0])[1] * 2 / n_sample for x in (done.position, done.torque))
    speed = 1j * omega * angle
    x = omega * SAMPLE_TIME / 2
    held = np.exp(-1j * x) * np.sin(x) / x  # the drive's torque is a staircase
    impedance = held * torque / speed
    amplitude = abs(speed)

    def friction(phase: float) -> float:
        return float(coulomb * np.tanh(amplitude * np.cos(phase) / friction_speed) * np.cos(phase))

    expected = 4 / (np.pi * amplitude) * quad(friction, 0, np.pi / 2, epsabs=1e-12)[0]
    sharp = 4 * coulomb / (np.pi * amplitude)
    assert expected == pytest.approx(sharp, rel=1e-3)
    third = expected / (9 * omega * inertia)
    assert impedance.real == pytest.approx(expected, rel=5 * third**2 + 1e-3)
    assert impedance.imag == pytest.approx(omega * inertia, rel=third + 1e-3)
    # and a small signal on top of that sine meets half of it
    small = robot.equivalent_motor_damping(np.zeros(1), np.array([amplitude]))
    assert small[0] == pytest.approx(sharp / 2, rel=1e-3)


def test_a_rotor_that_coasts_stops_after_its_speed_over_its_deceleration() -> None:
    inertia, coulomb, first = 2e-3, 0.2, 20.0
    robot = motor_alone(inertia, coulomb, 0.01, speed_gain=0.0)
    state = moving(robot, np.zeros(1), np.array([first]), np.zeros(1), np.array([-coulomb / inertia]))
    stop = inertia * first / coulomb
    n_sample = round(1.5 * stop / SAMPLE_TIME)
    done = run(robot, state, np.zeros((1, n_sample, 1)))
    t = np.minimum(SAMPLE_TIME * np.arange(n_sample), stop)
    exact = first * t - coulomb / inertia * t**2 / 2
    # what is left when the smooth sign lets go, v_s J / fc of creep at v_s
    np.testing.assert_allclose(
        done.position[0, :, 0], exact, rtol=0, atol=5 * 0.01**2 * inertia / coulomb + 1e-6
    )
