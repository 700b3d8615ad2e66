"""Motor torque as a linear function of its parameters: against the compiled dynamics, and the columns of fit.rigid."""

from __future__ import annotations

import numpy as np

from robid_core import Robot
from robid_core.estimation.rigid.rigid_torque import (
    RigidDrives,
    base_of,
    motor_inertia,
    motor_torque,
    motor_torque_regressor,
)
from robid_core.mechanics import dynamics
from robid_core.residual import rigid_drives
from robid_fit.rigid import structure
from robid_fit.rigid_effects import rigid_robot
from robid_fit.rigid_model import KINDS, RigidMotion, torque_columns

ROBOT = Robot.load("six_axis")


def drives() -> RigidDrives:
    return rigid_drives(ROBOT)


def states(n_sample: int = 5) -> np.ndarray:
    """Motor positions, speeds and accelerations; speeds well above the smooth sign's."""
    draw = np.random.default_rng(1).uniform(-1.0, 1.0, (3, n_sample, 6))
    return draw * np.array([100.0, 200.0, 2000.0])[:, None, None]


def test_torque_is_that_of_mass_matrix_gravity_rotors_and_friction() -> None:
    q, v, a = states()
    rigid = rigid_robot(ROBOT)
    gear, d = ROBOT.drives.gear, ROBOT.drives
    # The compiled recursion (composite bodies, world frame) against Newton and Euler's regressor.
    terms = dynamics(rigid.chain, q @ gear.T, v @ gear.T)
    joint = np.einsum("sij,sj->si", terms.mass, a @ gear.T) + terms.bias
    friction = d.viscous * v + d.coulomb * np.tanh(v / d.friction_speed) + d.friction_offset
    expected = joint @ gear + d.rotor_inertia * a + friction
    np.testing.assert_allclose(motor_torque(drives(), q, v, a), expected, rtol=1e-9, atol=1e-9)


def test_inertia_at_the_motor_is_the_diagonal_of_the_mass_matrix() -> None:
    q = states()[0]
    rigid, gear = rigid_robot(ROBOT), ROBOT.drives.gear
    mass = dynamics(rigid.chain, q @ gear.T).mass
    expected = np.einsum("ja,sjk,ka->sa", gear, mass, gear) + ROBOT.drives.rotor_inertia
    np.testing.assert_allclose(motor_inertia(drives(), q), expected, rtol=1e-9)


def test_columns_and_base_parameters_are_those_that_the_rigid_body_fit_estimates() -> None:
    q, v, a = states()
    rigid = rigid_robot(ROBOT)
    speed = ROBOT.drives.friction_speed
    theirs = torque_columns(rigid, RigidMotion(q, v, a), speed)
    ours = motor_torque_regressor(drives(), q, v, a)
    np.testing.assert_allclose(ours, theirs.regressor, rtol=1e-12, atol=1e-12)
    np.testing.assert_array_equal(drives().parameters, theirs.value)
    assert base_of(drives()).independent.tolist() == structure(rigid, KINDS, speed)[2].independent.tolist()
