"""Mass matrix, gravity torque and gravity stiffness of a chain at many positions at once, in torch.

Kinematics go joint by joint and for all positions together; then everything is a sum over bodies with their
Jacobians: ``M = sum m Jv^T Jv + Jw^T I Jw``, ``g = -sum m gravity . Jv``. The slope of g has a closed form: a
joint above turns the momentum that a unit rate of the joint below gives to what hangs on it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import torch  # type: ignore[import-not-found, unused-ignore]

from robid_core.mechanics import REVOLUTE, Chain


class Tree(NamedTuple):
    """A chain as tensors on one device, float64."""

    parent: tuple[int, ...]
    revolute: tuple[bool, ...]
    axis: torch.Tensor  # (n, 3)
    rotation: torch.Tensor  # (n, 3, 3)
    translation: torch.Tensor  # (n, 3)
    mass: torch.Tensor  # (n,)
    centre: torch.Tensor  # (n, 3)
    inertia: torch.Tensor  # (n, 3, 3)
    gravity: torch.Tensor  # (3,)
    moves: torch.Tensor  # (n, n) [j, i] is 1 where joint i moves body j
    turns: torch.Tensor  # (n,) 1 where the joint is revolute


class Frames(NamedTuple):
    """Where the bodies are, in world axes."""

    rotation: torch.Tensor  # (n_config, n, 3, 3)
    origin: torch.Tensor  # (n_config, n, 3) of the joint frames
    axis: torch.Tensor  # (n_config, n, 3) of the joints


class Terms(NamedTuple):
    """What a robot at rest weighs and how its weight bends."""

    mass: torch.Tensor  # (n_config, n, n)
    gravity_torque: torch.Tensor  # (n_config, n)
    gravity_stiffness: torch.Tensor  # (n_config, n, n) dg/dq


def tree_of(chain: Chain, device: torch.device) -> Tree:
    """Copy a chain to a device."""
    moves = np.eye(chain.n_coordinate)
    for j, parent in enumerate(chain.parent):
        if parent >= 0:
            moves[j] += moves[parent]
    revolute = chain.joint_type == REVOLUTE
    numbers = (chain.axis, chain.rotation, chain.translation, chain.mass, chain.centre_of_mass, chain.inertia)
    return Tree(
        tuple(chain.parent.tolist()),
        tuple(revolute.tolist()),
        *(tensor(array, device) for array in (*numbers, chain.gravity, moves, revolute.astype(float))),
    )


def tensor(array: np.ndarray[tuple[int, ...], np.dtype[np.float64]], device: torch.device) -> torch.Tensor:
    """Copy an array to a device, in double precision."""
    return torch.tensor(np.ascontiguousarray(array), dtype=torch.float64, device=device)


def frames(tree: Tree, position: torch.Tensor) -> Frames:
    """Place every body at joint coordinates `position`, rad or m, shape (n_config, n)."""
    n_config = len(position)
    base = torch.eye(3, dtype=position.dtype, device=position.device).expand(n_config, 3, 3)
    start = torch.zeros(n_config, 3, dtype=position.dtype, device=position.device)
    rotations: list[torch.Tensor] = []
    origins: list[torch.Tensor] = []
    axes: list[torch.Tensor] = []
    for j, parent in enumerate(tree.parent):
        above, origin = (rotations[parent], origins[parent]) if parent >= 0 else (base, start)
        origin = origin + above @ tree.translation[j]
        joint = above @ tree.rotation[j]
        axis = joint @ tree.axis[j]
        if tree.revolute[j]:
            joint = joint @ _turn(tree.axis[j], position[:, j])
        else:
            origin = origin + axis * position[:, j, None]
        rotations.append(joint)
        origins.append(origin)
        axes.append(axis)
    return Frames(torch.stack(rotations, 1), torch.stack(origins, 1), torch.stack(axes, 1))


def terms_at(tree: Tree, position: torch.Tensor) -> Terms:
    """Mass matrix, gravity torque and its slope at joint coordinates `position`, shape (n_config, n)."""
    place = frames(tree, position)
    centre = place.origin + (place.rotation @ tree.centre[:, :, None])[..., 0]
    # velocity of each centre of mass for a unit rate of each joint: (n_config, body, joint, 3)
    lever = centre[:, :, None] - place.origin[:, None]
    turned = torch.linalg.cross(place.axis[:, None].expand_as(lever), lever)
    turns = tree.turns[:, None]
    moving = (turns * turned + (1 - turns) * place.axis[:, None]) * tree.moves[..., None]
    heavy = tree.mass[:, None, None] * moving
    n_config, n = position.shape
    rows = moving.transpose(2, 3).reshape(n_config, 3 * n, n)  # bodies and directions stacked
    weighed = heavy.transpose(2, 3).reshape(n_config, 3 * n, n)
    turning = place.axis * turns  # angular velocity for a unit rate
    spin = (turning[:, None] * tree.moves[..., None]).transpose(2, 3)  # (n_config, body, 3, joint)
    inertia = place.rotation @ tree.inertia @ place.rotation.transpose(-1, -2)
    mass = weighed.transpose(1, 2) @ rows
    mass = mass + (spin.transpose(-1, -2) @ (inertia @ spin)).sum(1)
    momentum = heavy.sum(1)  # (n_config, joint, 3)
    pulled = torch.linalg.cross(tree.gravity.expand_as(turning), turning)
    above = -(momentum @ pulled.transpose(1, 2)) * tree.moves  # [below, above]
    lower = torch.tril(above)
    stiffness = lower + torch.tril(above, -1).transpose(1, 2)
    return Terms((mass + mass.transpose(1, 2)) / 2, -(momentum @ tree.gravity), stiffness)


def bytes_per_position(tree: Tree) -> int:
    """Memory that `terms_at` takes for one position: about ten tables of (body, joint, 3) numbers."""
    return 10 * 3 * 8 * len(tree.parent) ** 2


def _turn(axis: torch.Tensor, angle: torch.Tensor) -> torch.Tensor:
    """Rotations by `angle` (n_config,) about one axis (Rodrigues), shape (n_config, 3, 3)."""
    x, y, z = axis
    zero = torch.zeros_like(x)
    cross = torch.stack((zero, -z, y, z, zero, -x, -y, x, zero)).reshape(3, 3)
    sine, cosine = torch.sin(angle)[:, None, None], torch.cos(angle)[:, None, None]
    one = torch.eye(3, dtype=axis.dtype, device=axis.device)
    return one + sine * cross + (1 - cosine) * (cross @ cross)
