"""An arm on its springs in one pose, without the compiled kernels of its dynamics: for what looks at a record first.

The mass matrix comes from the regressor of rigid bodies, torque by torque for unit accelerations. Gravity's stiffness
and the deflection of the springs under gravity are left out: they move a resonance by a percent at most.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
import scipy

from robid_core.arrays import ComplexArray, FloatArray, IntArray
from robid_core.estimation.rigid.rigid_body import RigidTree, inertial_parameters, inverse_dynamics_regressor
from robid_core.mechanics.response import hold_factor


class SprungArm(Protocol):
    """What is needed of an arm with springs (`mechanics.Mechanism` is one)."""

    @property
    def chain(self) -> RigidTree:
        """Bodies on all joints, those of springs included."""

    @property
    def arm(self) -> IntArray:
        """Joint of each axis, (n_axis,)."""

    @property
    def rotor_inertia(self) -> FloatArray:
        """Of the motors, kg m^2, (n_axis,)."""

    @property
    def constraint_map(self) -> FloatArray:
        """Joint positions per generalised coordinate, motors first, (n_joint, n_coordinate)."""

    @property
    def spring_directions(self) -> FloatArray:
        """Deflection of each spring per generalised coordinate, (n_spring, n_coordinate)."""


def spring_model(
    mechanism: SprungArm,
    stiffness: FloatArray,
    damping: FloatArray,
    angle: FloatArray,
    motor_damping: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return mass, damping and stiffness matrices in a pose, (n_coordinate, n_coordinate) each.

    Parameters
    ----------
    mechanism
        The arm, without modes of flexible links.
    stiffness, damping
        Of its springs, N m/rad and N m s/rad, or N/m and N s/m, (n_spring,).
    angle
        Joint-side pose, rad or m, (n_axis,).
    motor_damping
        At the motors' shafts, N m s/rad, (n_axis,).

    Raises
    ------
    ConfigurationError
        For an arm with modes of flexible links.
    """
    n_axis, joints, directions = len(angle), mechanism.constraint_map, mechanism.spring_directions
    mass = joints.T @ _joint_mass(mechanism.chain, mechanism.arm, angle) @ joints
    mass[range(n_axis), range(n_axis)] += mechanism.rotor_inertia
    damper = directions.T @ (damping[:, None] * directions)
    damper[range(n_axis), range(n_axis)] += motor_damping
    return mass, damper, directions.T @ (stiffness[:, None] * directions)


def spring_response(
    mechanism: SprungArm,
    stiffness: FloatArray,
    damping: FloatArray,
    angle: FloatArray,
    motor_damping: FloatArray,
    omega: FloatArray,
    hold_sample_time: float | None = None,
) -> ComplexArray:
    """Return the response from motor torques to motor accelerations, (n_freq, n_axis, n_axis), (rad/s^2)/(N m).

    As `mechanics.response.response` defines it, at angular frequencies omega, rad/s, > 0, (n_freq,); other arguments
    and errors as of `spring_model`.
    """
    mass, damper, spring = spring_model(mechanism, stiffness, damping, angle, motor_damping)
    inputs = np.eye(len(mass), len(angle))
    dynamic = spring - omega[:, None, None] ** 2 * mass + 1j * omega[:, None, None] * damper
    plain = -(omega[:, None, None] ** 2) * np.linalg.solve(dynamic, inputs)[:, : len(angle)]
    held, images = hold_factor(omega, hold_sample_time)
    inertial = np.linalg.solve(mass, inputs)[: len(angle)]
    response: ComplexArray = held[:, None, None] * plain + images[:, None, None] * inertial
    return response


def spring_resonances(mechanism: SprungArm, stiffness: FloatArray, angle: FloatArray) -> FloatArray:
    """Return the undamped natural frequencies in a pose, Hz, ascending; those of free motion are zero.

    Arguments and errors as of `spring_model`.
    """
    none = np.zeros(len(angle))
    mass, _, spring = spring_model(mechanism, stiffness, 0 * stiffness, angle, none)
    frequencies: FloatArray = np.sqrt(np.maximum(scipy.linalg.eigvalsh(spring, mass), 0.0)) / (2 * np.pi)
    return frequencies


def _joint_mass(chain: RigidTree, arm: IntArray, angle: FloatArray) -> FloatArray:
    """Mass matrix of all joints, (n_joint, n_joint): torques of unit accelerations less those of gravity."""
    n_joint = len(chain.parent)
    position = np.zeros((n_joint + 1, n_joint))
    position[:, arm] = angle
    acceleration = np.concatenate((np.eye(n_joint), np.zeros((1, n_joint))))
    regressor = inverse_dynamics_regressor(chain, position, np.zeros_like(position), acceleration)
    force = regressor @ inertial_parameters(chain).ravel()
    mass: FloatArray = force[:-1] - force[-1]
    return 0.5 * (mass + mass.T)
