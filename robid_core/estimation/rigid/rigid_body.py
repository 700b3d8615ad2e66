"""Regressor of a rigid robot: joint forces as a linear function of inertial parameters, many samples at once.

Newton's and Euler's equations of each body, written about the origin of its joint frame, are linear in its
mass, first moments and inertia about that origin (Atkeson, An and Hollerbach 1986; Khalil and Dombre 2002,
chapter 12). Accelerations go from the base to the tip, the ten columns of each body back to the base.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from robid_core.arrays import FloatArray, IntArray
from robid_core.errors import ConfigurationError

# Order of the ten parameters of a body: mass, mass times centre of mass, inertia about the joint frame's origin.
PARAMETERS = (
    "mass", "first_moment.x", "first_moment.y", "first_moment.z", "joint_inertia.xx", "joint_inertia.xy",
    "joint_inertia.xz", "joint_inertia.yy", "joint_inertia.yz", "joint_inertia.zz",
)  # fmt: skip
UNITS = ("kg", "kg m", "kg m", "kg m", "kg m^2", "kg m^2", "kg m^2", "kg m^2", "kg m^2", "kg m^2")


class RigidTree(Protocol):
    """What the regressor needs to know of a chain of bodies (`mechanics.Chain` is one)."""

    @property
    def parent(self) -> IntArray:
        """Index of the parent body, -1 for the base, shape (n,)."""

    @property
    def joint_type(self) -> IntArray:
        """0 revolute, 1 prismatic, 2 mode of a flexible link, shape (n,)."""

    @property
    def axis(self) -> FloatArray:
        """Unit vector of motion in the joint frame, shape (n, 3)."""

    @property
    def rotation(self) -> FloatArray:
        """From the joint frame to the parent's frame at coordinate 0, shape (n, 3, 3)."""

    @property
    def translation(self) -> FloatArray:
        """Origin of the joint frame in the parent's frame, m, shape (n, 3)."""

    @property
    def mass(self) -> FloatArray:
        """Mass of each body, kg, shape (n,)."""

    @property
    def centre_of_mass(self) -> FloatArray:
        """Centre of mass in the joint frame, m, shape (n, 3)."""

    @property
    def inertia(self) -> FloatArray:
        """Inertia about the centre of mass, kg m^2, shape (n, 3, 3)."""

    @property
    def gravity(self) -> FloatArray:
        """Gravity in the base frame, m/s^2, shape (3,)."""


def inertial_parameters(tree: RigidTree) -> FloatArray:
    """Return the ten parameters of each body in the order of `PARAMETERS`, shape (n, 10)."""
    mass, centre = tree.mass[:, None], tree.centre_of_mass
    steiner = (centre**2).sum(axis=1)[:, None, None] * np.eye(3) - centre[:, :, None] * centre[:, None, :]
    about_origin = tree.inertia + mass[:, :, None] * steiner
    upper = np.triu_indices(3)
    result: FloatArray = np.concatenate([mass, mass * centre, about_origin[:, upper[0], upper[1]]], axis=1)
    return result


def inverse_dynamics_regressor(
    tree: RigidTree, position: FloatArray, velocity: FloatArray, acceleration: FloatArray
) -> FloatArray:
    """Force of every joint per unit of every inertial parameter.

    Parameters
    ----------
    tree
        Geometry and gravity; its own masses do not matter here.
    position, velocity, acceleration
        Joint coordinates and their derivatives (rad or m), each (n_sample, n).

    Returns
    -------
    Shape (n_sample, n, 10 n): joint force (N m or N) = regressor @ `inertial_parameters`.ravel().

    Raises
    ------
    ConfigurationError
        For a tree with modes of flexible links, which ten numbers a body do not describe.
    """
    n_sample, n = position.shape
    if (tree.joint_type > 1).any():
        mode = int(np.argmax(tree.joint_type > 1))
        raise ConfigurationError(
            f"rigid bodies: joint {mode} (counted from 0) is a mode of a flexible link; take the robot with rigid links"
        )
    orientation, offset = _placement(tree, position)
    spin, spin_rate, pull = _motion(tree, orientation, offset, velocity, acceleration)
    result = np.zeros((n_sample, n, n, 10))
    for body in range(n):
        force, moment = _body_columns(spin[body], spin_rate[body], pull[body])
        joint = body
        while joint >= 0:
            seen = moment if tree.joint_type[joint] == 0 else force
            result[:, joint, body] = np.einsum("i,sip->sp", tree.axis[joint], seen)
            force = orientation[joint] @ force
            moment = orientation[joint] @ moment + _cross_matrix(offset[joint]) @ force
            joint = int(tree.parent[joint])
    return result.reshape(n_sample, n, 10 * n)


def _placement(tree: RigidTree, position: FloatArray) -> tuple[list[FloatArray], list[FloatArray]]:
    """Return, per joint, rotations to the parent (n_sample, 3, 3) and origins in the parent (n_sample, 3)."""
    orientation, offset = [], []
    for j in range(position.shape[1]):
        q = position[:, j]
        if tree.joint_type[j] == 0:
            cross = _cross_matrix(tree.axis[j][None])[0]
            turn = (
                np.eye(3)
                + np.sin(q)[:, None, None] * cross
                + (1 - np.cos(q))[:, None, None] * (cross @ cross)
            )
            orientation.append(tree.rotation[j] @ turn)
            offset.append(np.broadcast_to(tree.translation[j], (len(q), 3)))
        else:
            orientation.append(np.broadcast_to(tree.rotation[j], (len(q), 3, 3)))
            offset.append(tree.translation[j] + q[:, None] * (tree.rotation[j] @ tree.axis[j]))
    return orientation, offset


def _motion(
    tree: RigidTree,
    orientation: list[FloatArray],
    offset: list[FloatArray],
    velocity: FloatArray,
    acceleration: FloatArray,
) -> tuple[list[FloatArray], list[FloatArray], list[FloatArray]]:
    """Return, per body in its own frame, angular velocity, angular acceleration, acceleration minus gravity."""
    n_sample = velocity.shape[0]
    still = np.zeros((n_sample, 3))
    lift = np.broadcast_to(-tree.gravity, (n_sample, 3))
    spin: list[FloatArray] = []
    spin_rate: list[FloatArray] = []
    pull: list[FloatArray] = []
    for j in range(velocity.shape[1]):
        parent = int(tree.parent[j])
        w, alpha, a = (spin[parent], spin_rate[parent], pull[parent]) if parent >= 0 else (still, still, lift)
        a = a + _cross(alpha, offset[j]) + _cross(w, _cross(w, offset[j]))
        w, alpha, a = (np.einsum("sji,sj->si", orientation[j], vector) for vector in (w, alpha, a))
        rate, change = velocity[:, j, None] * tree.axis[j], acceleration[:, j, None] * tree.axis[j]
        if tree.joint_type[j] == 0:
            alpha = alpha + change + _cross(w, rate)
            w = w + rate
        else:
            a = a + change + 2 * _cross(w, rate)
        spin.append(w)
        spin_rate.append(alpha)
        pull.append(a)
    return spin, spin_rate, pull


def _body_columns(w: FloatArray, alpha: FloatArray, a: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Force and moment about the frame's origin per unit of the ten parameters, each (n_sample, 3, 10).

    ``f = m a + (alpha x + w x w x) mc`` and ``n = mc x a + I alpha + w x I w``.
    """
    n_sample = len(w)
    cross_w = _cross_matrix(w)
    force, moment = np.zeros((n_sample, 3, 10)), np.zeros((n_sample, 3, 10))
    force[:, :, 0] = a
    force[:, :, 1:4] = _cross_matrix(alpha) + cross_w @ cross_w
    moment[:, :, 1:4] = -_cross_matrix(a)
    moment[:, :, 4:] = _inertia_times(alpha) + cross_w @ _inertia_times(w)
    return force, moment


def _cross(one: FloatArray, other: FloatArray) -> FloatArray:
    """Return one x other of every row, shape (n_sample, 3); numpy's takes twice as long for some hundred rows."""
    a, b, c = one.T
    x, y, z = other.T
    return np.stack((b * z - c * y, c * x - a * z, a * y - b * x), axis=-1)


def _cross_matrix(vector: FloatArray) -> FloatArray:
    """Return S with S b = vector x b, shape (n_sample, 3, 3)."""
    x, y, z = vector.T
    zero = np.zeros_like(x)
    result: FloatArray = np.moveaxis(np.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]]), 2, 0)
    return result


def _inertia_times(vector: FloatArray) -> FloatArray:
    """Return L with L (xx, xy, xz, yy, yz, zz) = I vector, shape (n_sample, 3, 6)."""
    x, y, z = vector.T
    zero = np.zeros_like(x)
    rows = [[x, y, z, zero, zero, zero], [zero, x, zero, y, z, zero], [zero, zero, x, zero, y, z]]
    result: FloatArray = np.moveaxis(np.array(rows), 2, 0)
    return result
