"""Plain numpy twins of the kernels: slow, written from the definitions, the oracle of the tests."""

from __future__ import annotations

import numpy as np

from robid_core.mechanics.chain import REVOLUTE, Chain, FloatArray, rotation_about
from robid_core.mechanics.dynamics import Dynamics
from robid_core.mechanics.friction import friction_torque
from robid_core.mechanics.linearize import SecondOrderModel
from robid_core.mechanics.mechanism import Mechanism
from robid_core.mechanics.response import ResponseGradient, hold_factor


def dynamics_by_jacobians(chain: Chain, position: FloatArray, speed: FloatArray) -> Dynamics:
    """Mass matrix, bias and gravity stiffness at one position, summed over bodies with their Jacobians.

    M = sum over bodies of m Jv^T Jv + Jw^T I Jw; the bias is the force at zero joint acceleration.

    Parameters
    ----------
    chain
        The mechanism.
    position, speed
        Joint coordinates and rates, shape (n,).
    """
    n = chain.n_coordinate
    origin, axes = np.zeros((n, 3)), np.zeros((n, 3, 3))
    rate, rate_change = np.zeros((n, 3)), np.zeros((n, 3))  # angular velocity, and acceleration at qdd = 0
    change = np.zeros((n, 3))  # acceleration of the origin at qdd = 0, gravity as a moving base
    lineage: list[list[int]] = []
    mass, bias, stiffness = np.zeros((n, n)), np.zeros(n), np.zeros((n, n))
    for j, parent in enumerate(chain.parent):
        if parent >= 0:
            base, base_origin = axes[parent], origin[parent]
            w, dw, a0 = rate[parent], rate_change[parent], change[parent]
            lineage.append([*lineage[parent], j])
        else:
            base, base_origin = np.eye(3), np.zeros(3)
            w, dw, a0 = np.zeros(3), np.zeros(3), -chain.gravity
            lineage.append([j])
        arm = base @ chain.translation[j]
        joint_frame = base @ chain.rotation[j]
        axis = joint_frame @ chain.axis[j]
        if chain.joint_type[j] == REVOLUTE:
            axes[j] = joint_frame @ rotation_about(chain.axis[j], position[j])
            origin[j] = base_origin + arm
            rate[j], rate_change[j] = w + axis * speed[j], dw + np.cross(w, axis) * speed[j]
            change[j] = a0 + np.cross(dw, arm) + np.cross(w, np.cross(w, arm))
        else:
            arm = arm + axis * position[j]
            axes[j], origin[j], rate[j], rate_change[j] = joint_frame, base_origin + arm, w, dw
            change[j] = (
                a0 + np.cross(dw, arm) + np.cross(w, np.cross(w, arm)) + 2 * np.cross(w, axis) * speed[j]
            )
        lever = axes[j] @ chain.centre_of_mass[j]
        centre, inertia = origin[j] + lever, axes[j] @ chain.inertia[j] @ axes[j].T
        turning, moving = np.zeros((3, n)), np.zeros((3, n))
        for i in lineage[j]:
            world_axis = axes[i] @ chain.axis[i]
            if chain.joint_type[i] == REVOLUTE:
                turning[:, i], moving[:, i] = world_axis, np.cross(world_axis, centre - origin[i])
            else:
                moving[:, i] = world_axis
        acceleration = (
            change[j] + np.cross(rate_change[j], lever) + np.cross(rate[j], np.cross(rate[j], lever))
        )
        moment = inertia @ rate_change[j] + np.cross(rate[j], inertia @ rate[j])
        mass += chain.mass[j] * moving.T @ moving + turning.T @ inertia @ turning
        bias += chain.mass[j] * moving.T @ acceleration + turning.T @ moment
        for above in lineage[j]:
            for below in lineage[j]:
                first, second = min(above, below), max(above, below)
                # a joint above turns the column of the joint below; potential energy is -m gravity . centre
                bent = np.cross(turning[:, first], moving[:, second])
                stiffness[above, below] -= chain.mass[j] * chain.gravity @ bent
    return Dynamics(mass, bias, stiffness)


def response_by_solving(
    model: SecondOrderModel, omega: FloatArray, hold_sample_time: float | None = None
) -> ResponseGradient:
    """Response and gradient vectors with one dense solve a line; arguments as `response_with_gradient`."""
    w = omega[:, None, None]
    impedance = (
        model.stiffness[..., None, :, :]
        - w**2 * model.mass[..., None, :, :]
        + 1j * w * model.damping[..., None, :, :]
    )
    position = np.linalg.solve(impedance, model.input_map.astype(np.complex128))
    hold, image = (factor[:, None, None] for factor in hold_factor(omega, hold_sample_time))
    inertial = model.input_map.T @ np.linalg.solve(model.mass, model.input_map)
    vectors = 1j * w * np.sqrt(hold) * position
    sampled = -(w**2) * hold * (model.input_map.T @ position) + image * inertial[..., None, :, :]
    return ResponseGradient(sampled, model.spring_directions @ vectors, model.input_map.T @ vectors)


def acceleration_by_solving(
    mechanism: Mechanism,
    stiffness: FloatArray,
    damping: FloatArray,
    friction: tuple[FloatArray, FloatArray, FloatArray, FloatArray],
    position: FloatArray,
    speed: FloatArray,
    torque: FloatArray,
) -> FloatArray:
    """Acceleration of the generalised coordinates: the nonlinear model (2.3) with one dense solve.

    Parameters
    ----------
    mechanism, stiffness, damping
        The robot, see `simulate`.
    friction
        Coulomb torque, viscous gain, friction speed and constant offset of the motors, each of shape (n_axis,).
    position, speed
        Generalised coordinates and their rates, shape (n_coordinate,).
    torque
        Motor torque, shape (n_axis,).
    """
    joints, springs, n_axis = mechanism.constraint_map, mechanism.spring_directions, mechanism.n_axis
    terms = dynamics_by_jacobians(mechanism.chain, joints @ position, joints @ speed)
    mass = joints.T @ terms.mass @ joints
    mass[:n_axis, :n_axis] += np.diag(mechanism.rotor_inertia)
    force = -joints.T @ terms.bias
    force -= springs.T @ (stiffness * (springs @ position) + damping * (springs @ speed))
    force[:n_axis] += torque - friction_torque(speed[:n_axis], *friction[:3]) - friction[3]
    return np.asarray(np.linalg.solve(mass, force), dtype=np.float64)
