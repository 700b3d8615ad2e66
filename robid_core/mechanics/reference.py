"""Plain numpy twins of the kernels: slow, written from the definitions, the oracle of the tests."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid_core.arrays import FloatArray, IntArray
from robid_core.mechanics.chain import Chain, rotation_by, spatial_inertia
from robid_core.mechanics.dynamics import Dynamics
from robid_core.mechanics.friction import friction_torque
from robid_core.mechanics.linearize import SecondOrderModel
from robid_core.mechanics.mechanism import Mechanism
from robid_core.mechanics.response import ResponseGradient, hold_factor


def dynamics_by_jacobians(chain: Chain, position: FloatArray, speed: FloatArray) -> Dynamics:
    """Mass matrix, bias and gravity stiffness at one position, summed over bodies with their Jacobians.

    Each body moves as [w; v], w = Jw q' its angular velocity, v = Jv q' the velocity of its joint frame's origin, world
    axes. The bias is the force at zero joint acceleration; gravity is a base that accelerates upwards. With the first
    moment of mass h and the inertia J about the origin, both with their modal part (see `Chain`), a the acceleration of
    the origin (the classical one, not the spatial one) and primes for rates that the modes cause in body
    axes, [h_k; p_k] the rows of `modal_momentum` and J_k `modal_inertia` of its modes::

        force  F = m a + w' x h + w x (w x h) + 2 w x h'
        moment N = h x a + J w' + w x J w + J' w + w x sum_k h_k eta_k'
        mode k   Q = p_k . a + h_k . w' - 1/2 w . J_k w
        bias = Jv^T F + Jw^T N + sum_k e_k Q_k

    Parameters
    ----------
    chain
        The mechanism.
    position, speed
        Joint coordinates and rates, shape (n,).
    """
    n = chain.n_coordinate
    frames = _frames(chain, position)
    origin, turn, slide = frames.origin, frames.turning, frames.sliding
    rate, rate_change = np.zeros((n, 3)), np.zeros((n, 3))  # angular velocity, and acceleration at qdd = 0
    change = np.zeros((n, 3))  # acceleration of the origin at qdd = 0, gravity as a moving base
    mass, bias, stiffness = chain.modal_mass.copy(), np.zeros(n), np.zeros((n, n))
    for j, parent in enumerate(chain.parent):
        w, dw, a0, base = np.zeros(3), np.zeros(3), -chain.gravity, np.zeros(3)
        if parent >= 0:
            w, dw, a0, base = rate[parent], rate_change[parent], change[parent], origin[parent]
        arm = origin[j] - base
        rate[j], rate_change[j] = w + turn[j] * speed[j], dw + np.cross(w, turn[j]) * speed[j]
        change[j] = (
            a0 + np.cross(dw, arm) + np.cross(w, np.cross(w, arm)) + 2 * np.cross(w, slide[j]) * speed[j]
        )
        lineage = _lineage(chain, j)
        levers = origin[j] - origin[lineage]
        turning, moving = np.zeros((3, n)), np.zeros((3, n))  # Jw, Jv
        turning[:, lineage], moving[:, lineage] = (
            turn[lineage].T,
            (slide[lineage] + np.cross(turn[lineage], levers)).T,
        )
        m, body = chain.mass[j], _bent_body(chain, frames, j, position)
        mass += m * moving.T @ moving + turning.T @ body.inertia @ turning
        coupling = moving.T @ np.cross(turning, body.moment, axis=0)  # v . (w x h)
        mass += coupling + coupling.T
        w, dw, a = rate[j], rate_change[j], change[j]
        flow = body.linear @ speed[body.modes]  # h'
        swelling = np.einsum("k,kab->ab", speed[body.modes], body.slope)  # J'
        force = (
            m * a + np.cross(dw, body.moment) + np.cross(w, np.cross(w, body.moment)) + 2 * np.cross(w, flow)
        )
        moment = np.cross(body.moment, a) + body.inertia @ dw + np.cross(w, body.inertia @ w)
        moment += swelling @ w + np.cross(w, body.angular @ speed[body.modes])
        bias += moving.T @ force + turning.T @ moment
        # gravity . (turn x column): a joint turns the columns of all joints below, and its own but for the slide
        pull = np.cross(chain.gravity, turn[lineage])
        column = np.cross(turn[lineage], m * levers + body.moment)
        above = -np.triu(pull @ (column + m * slide[lineage]).T, 1)
        stiffness[np.ix_(lineage, lineage)] += above + above.T - np.diag(np.sum(pull * column, axis=1))
        for k, p, h, tensor in zip(body.modes, body.linear.T, body.angular.T, body.slope, strict=True):
            row = p @ moving + h @ turning
            mass[k] += row
            mass[:, k] += row
            bias[k] += p @ a + h @ dw - w @ tensor @ w / 2
            stiffness[lineage, k] -= pull @ p  # the column of a mode is p_k
            stiffness[k, lineage] -= pull @ p
    return Dynamics(mass, bias, stiffness)


def potential_energy(chain: Chain, position: FloatArray) -> float:
    """Energy of gravity, ``- sum gravity . (m origin + h)``, zero for mass at the base origin, J."""
    frames = _frames(chain, position)
    moments = [
        chain.mass[j] * frames.origin[j] + _bent_body(chain, frames, j, position).moment
        for j in range(chain.n_coordinate)
    ]
    return float(-chain.gravity @ np.sum(moments, axis=0))


@dataclass(frozen=True)
class _Frames:
    axes: FloatArray  # (n, 3, 3) of the bodies in the world
    origin: FloatArray  # (n, 3)
    turning: FloatArray  # (n, 3) angular velocity per unit rate of each joint, world axes
    sliding: FloatArray  # (n, 3) velocity of the joint frame's origin per unit rate, world axes


@dataclass(frozen=True)
class _BentBody:
    moment: FloatArray  # (3,) first moment of mass h about the origin, world axes
    inertia: FloatArray  # (3, 3) about the origin, world axes
    modes: IntArray  # (k,) modal coordinates of the body
    linear: FloatArray  # (3, k) p_k, world axes
    angular: FloatArray  # (3, k) h_k, world axes
    slope: FloatArray  # (k, 3, 3) J_k, world axes


def _frames(chain: Chain, position: FloatArray) -> _Frames:
    n = chain.n_coordinate
    frames = _Frames(*(np.zeros(shape) for shape in ((n, 3, 3), (n, 3), (n, 3), (n, 3))))
    turning, sliding = chain.turning_axis, chain.sliding_axis
    for j, parent in enumerate(chain.parent):
        base, start = (
            (frames.axes[parent], frames.origin[parent]) if parent >= 0 else (np.eye(3), np.zeros(3))
        )
        frame = base @ chain.rotation[j]
        frames.turning[j], frames.sliding[j] = frame @ turning[j], frame @ sliding[j]
        frames.origin[j] = start + base @ chain.translation[j] + frames.sliding[j] * position[j]
        frames.axes[j] = frame @ rotation_by(turning[j] * position[j])
    return frames


def _bent_body(chain: Chain, frames: _Frames, j: int, position: FloatArray) -> _BentBody:
    axes, modes = frames.axes[j], np.flatnonzero(chain.flexible_root == j)
    rigid = spatial_inertia(float(chain.mass[j]), chain.centre_of_mass[j], chain.inertia[j])[:3, :3]
    linear, angular = axes @ chain.modal_momentum[modes, 3:].T, axes @ chain.modal_momentum[modes, :3].T
    slope = axes @ chain.modal_inertia[modes] @ axes.T
    moment = chain.mass[j] * axes @ chain.centre_of_mass[j] + linear @ position[modes]
    inertia = axes @ rigid @ axes.T + np.einsum("k,kab->ab", position[modes], slope)
    return _BentBody(moment, inertia, modes, linear, angular, slope)


def _lineage(chain: Chain, joint: int) -> list[int]:
    """Joints from the base to this one."""
    parent = int(chain.parent[joint])
    return [*(_lineage(chain, parent) if parent >= 0 else []), joint]


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
