"""Motor torque of a rigid robot as a linear function of its parameters, in the motors' own coordinates.

    tau = r_g^T Y(q, q', q'') pi + J q_m'' + F_v q_m' + F_c tanh(q_m' / v_s) + offset,      q = r_g q_m

with Y the regressor of the bodies (`rigid_body`). This is what a rigid-body identification fits, so the same columns
say beforehand how well a motion would tell the parameters (`fourier_trajectory`), and what torque it takes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid_core.arrays import FloatArray, IntArray
from robid_core.estimation.rigid.friction_direction import direction
from robid_core.estimation.rigid.regression import BaseParameters, base_parameters
from robid_core.estimation.rigid.rigid_body import RigidTree, inertial_parameters, inverse_dynamics_regressor

RANDOM_STATES = 40  # random states per axis: many more equations than the ten unknowns of a body


@dataclass(frozen=True)
class RigidDrives:
    """A rigid arm with its motors; what hangs on the motors' side has shape (n_axis,)."""

    tree: RigidTree
    """Bodies on their joints, without elastic coordinates."""
    arm: IntArray
    """Which joint each axis moves."""
    gear: FloatArray
    """Joint angle per motor angle r_g, (n_axis, n_axis)."""
    rotor_inertia: FloatArray
    viscous: FloatArray
    coulomb: FloatArray
    offset: FloatArray
    friction_speed: FloatArray
    """v_s of tanh(v / v_s); 0: plain sign(v)."""

    @property
    def n_axis(self) -> int:
        """Number of motors."""
        return len(self.arm)

    @property
    def parameters(self) -> FloatArray:
        """Values of the parameters in the order of the regressor's columns."""
        bodies = inertial_parameters(self.tree).ravel()
        return np.concatenate([bodies, self.rotor_inertia, self.viscous, self.coulomb, self.offset])


def motor_torque_regressor(
    drives: RigidDrives, position: FloatArray, velocity: FloatArray, acceleration: FloatArray
) -> FloatArray:
    """Motor torque per unit of each parameter.

    Columns: the ten of each body (`rigid_body.PARAMETERS`), then rotor inertia, viscous friction, Coulomb friction
    and offset of every motor.

    Parameters
    ----------
    drives
        The robot.
    position, velocity, acceleration
        Of the motors, rad, rad/s, rad/s^2, each (n_sample, n_axis).

    Returns
    -------
    Shape (n_sample, n_axis, n_parameter), N m at the motor per unit; times `RigidDrives.parameters` it is the torque.
    """
    n_joint, n_axis = len(drives.tree.parent), drives.n_axis
    state = []
    for values in (position, velocity, acceleration):
        joints = np.zeros((len(values), n_joint))
        joints[:, drives.arm] = values @ drives.gear.T
        state.append(joints)
    bodies = np.einsum(
        "ja,sjp->sap", drives.gear, inverse_dynamics_regressor(drives.tree, *state)[:, drives.arm]
    )
    turned = direction(velocity, drives.friction_speed)
    signals = (acceleration, velocity, turned, np.ones_like(velocity))
    own = np.zeros((len(position), n_axis, 4, n_axis))
    for kind, signal in enumerate(signals):
        own[:, np.arange(n_axis), kind, np.arange(n_axis)] = signal
    return np.concatenate([bodies, own.reshape(len(position), n_axis, -1)], axis=2)


def base_of(drives: RigidDrives) -> BaseParameters:
    """Which columns every motion can tell apart: from random states, the same at every call."""
    draws = np.random.Generator(np.random.PCG64(0)).uniform(
        -np.pi, np.pi, (3, RANDOM_STATES * drives.n_axis, drives.n_axis)
    )
    states = np.linalg.solve(drives.gear, draws.reshape(-1, drives.n_axis).T).T.reshape(draws.shape)
    regressor = motor_torque_regressor(drives, *states)
    return base_parameters(regressor.reshape(-1, regressor.shape[2]))


def motor_torque(
    drives: RigidDrives, position: FloatArray, velocity: FloatArray, acceleration: FloatArray
) -> FloatArray:
    """Torque of the motors by inverse dynamics, friction included, N m, shape (n_sample, n_axis)."""
    torque: FloatArray = motor_torque_regressor(drives, position, velocity, acceleration) @ drives.parameters
    return torque


def motor_inertia(drives: RigidDrives, position: FloatArray) -> FloatArray:
    """Inertia that each motor feels at standstill, arm and rotor, kg m^2, shape (n_sample, n_axis).

    The diagonal of the mass matrix at the motors: torque for a unit acceleration of that motor alone, less that of
    gravity.
    """
    still, result = np.zeros_like(position), np.empty_like(position)
    held = motor_torque(drives, position, still, still)
    for axis in range(drives.n_axis):
        unit = still.copy()
        unit[:, axis] = 1.0
        result[:, axis] = (motor_torque(drives, position, still, unit) - held)[:, axis]
    return result
