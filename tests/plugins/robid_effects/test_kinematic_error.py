"""The kinematic error: two terms that belong together by virtual work."""

import numpy as np
import pytest

from robid_core.compiled.laws import entries_of
from robid_effects.kinematic_error import KinematicError

SPRING, DAMPER, RATIO = 9e4, 60.0, 0.01
PARAMETERS = np.array([1e-4, 2.0, 0.7])
TRANSMISSION, MOTOR, LOAD = np.array([RATIO, -1.0]), np.array([1.0, 0.0]), np.array([1.0])


@pytest.fixture
def place(at):
    rows = {"direction": TRANSMISSION, "transmission": TRANSMISSION, "motor": MOTOR, "load": LOAD}
    return at("gear", stiffness=SPRING, damping=DAMPER, motor_load=LOAD * RATIO, **rows)


def error(angle: float) -> float:
    amplitude, order, phase = PARAMETERS
    return amplitude * np.sin(order * angle + phase)


def rate(angle: float) -> float:
    amplitude, order, phase = PARAMETERS
    return amplitude * order * np.cos(order * angle + phase)


def call(term, z: np.ndarray, z_dot: np.ndarray, transmitted: float) -> tuple[float, float, float]:
    x, v = term.coordinate @ z, term.coordinate @ z_dot
    load = term.load @ np.array([transmitted])
    return term.law(x, v, load, np.zeros(1), np.zeros(1), term.arguments, 2.5e-4)


def forces(place, z: np.ndarray, z_dot: np.ndarray) -> tuple[np.ndarray, float]:
    """Generalised forces of spring, damper and both terms, and the torque of the transmission."""
    along, reaction = KinematicError.bind(PARAMETERS, place)
    transmitted = SPRING * (TRANSMISSION @ z) + DAMPER * (TRANSMISSION @ z_dot)
    transmitted += call(along, z, z_dot, 0.0)[0]
    linear = -TRANSMISSION * (SPRING * (TRANSMISSION @ z) + DAMPER * (TRANSMISSION @ z_dot))
    terms = sum(-term.direction * call(term, z, z_dot, transmitted)[0] for term in (along, reaction))
    return linear + terms, transmitted


def test_power_in_is_power_stored_and_damped(place) -> None:
    """F . z' = -d/dt (k s^2 / 2) - d s'^2 with s = x + e(q_m), to rounding."""
    rng = np.random.default_rng(4)
    for _ in range(200):
        z, z_dot = rng.normal(0, [30.0, 0.0]), rng.normal(0, [20.0, 0.3])
        z[1] = RATIO * z[0] - rng.normal(0, 1e-3)
        force, transmitted = forces(place, z, z_dot)
        s = TRANSMISSION @ z + error(z[0])
        s_dot = TRANSMISSION @ z_dot + rate(z[0]) * z_dot[0]
        assert transmitted == pytest.approx(SPRING * s + DAMPER * s_dot, rel=1e-10)
        power = -(SPRING * s * s_dot + DAMPER * s_dot**2)
        largest = np.abs(force * z_dot).sum()
        assert force @ z_dot == pytest.approx(power, abs=1e-12 * max(largest, 1.0))


def test_forces_without_damping_are_the_gradient_of_the_stored_energy(at) -> None:
    rows = {"direction": TRANSMISSION, "transmission": TRANSMISSION, "motor": MOTOR, "load": LOAD}
    undamped = at("gear", stiffness=SPRING, damping=0.0, **rows)
    z, rest, h = np.array([3.3, 0.0325]), np.zeros(2), 1e-6
    along, reaction = KinematicError.bind(PARAMETERS, undamped)
    transmitted = SPRING * (TRANSMISSION @ z + error(z[0]))
    force = -TRANSMISSION * SPRING * (TRANSMISSION @ z)
    for term in (along, reaction):
        force = force - term.direction * call(term, z, rest, transmitted)[0]

    def energy(at: np.ndarray) -> float:
        return 0.5 * SPRING * (TRANSMISSION @ at + error(at[0])) ** 2

    for i, unit in enumerate(np.eye(2)):
        by_difference = -(energy(z + h * unit) - energy(z - h * unit)) / (2 * h)
        assert force[i] == pytest.approx(by_difference, rel=1e-6)


def test_slopes_are_derivatives(place) -> None:
    h = 1e-6
    for term in KinematicError.bind(PARAMETERS, place):
        for angle, speed in ((0.3, 4.0), (-7.1, 0.2), (55.0, -30.0)):
            law = lambda q, v, term=term: term.law(  # noqa: E731
                q, v, 40.0, np.zeros(1), np.zeros(1), term.arguments, 2.5e-4
            )
            _, in_position, in_velocity = law(angle, speed)
            by_position = (law(angle + h, speed)[0] - law(angle - h, speed)[0]) / (2 * h)
            by_velocity = (law(angle, speed + h)[0] - law(angle, speed - h)[0]) / (2 * h)
            assert in_position == pytest.approx(by_position, rel=1e-6, abs=1e-7)
            assert in_velocity == pytest.approx(by_velocity, rel=1e-6, abs=1e-7)


def test_both_laws_run_on_all_lanes(place) -> None:
    for term in KinematicError.bind(PARAMETERS, place):
        assert entries_of(term.law, "force", term.n_state, term.label).vectorized
