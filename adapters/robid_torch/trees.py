"""Mass matrix, gravity torque and gravity stiffness of a chain at many positions at once, in torch.

Kinematics go joint by joint and for all positions together; then everything is a sum over bodies with their
Jacobians: ``M = sum m Jv^T Jv + Jw^T I Jw``, ``g = -sum m gravity . Jv``. The slope of g has a closed form: a
joint above turns the momentum that a unit rate of the joint below gives to what hangs on it. A flexible body is a
rigid one of another centre and inertia for every deflection, and its modes add momentum of their own (see `Chain`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import torch  # type: ignore[import-not-found, unused-ignore]

from robid_core.mechanics import Chain
from robid_core.mechanics.chain import spatial_inertia


class Tree(NamedTuple):
    """A chain as tensors on one device, float64."""

    parent: tuple[int, ...]
    turning: torch.Tensor  # (n, 3) rotation per unit coordinate, in the joint frame
    sliding: torch.Tensor  # (n, 3) translation per unit coordinate
    rotation: torch.Tensor  # (n, 3, 3)
    translation: torch.Tensor  # (n, 3)
    mass: torch.Tensor  # (n,)
    centre: torch.Tensor  # (n, 3)
    inertia: torch.Tensor  # (n, 3, 3)
    gravity: torch.Tensor  # (3,)
    moves: torch.Tensor  # (n, n) [j, i] is 1 where joint i moves body j
    modes: tuple[int, ...]  # modal joints
    roots: tuple[int, ...]  # of the flexible body of each of them
    angular: torch.Tensor  # (n_mode, 3) momentum of the flexible body about its origin per modal rate
    linear: torch.Tensor  # (n_mode, 3)
    modal_mass: torch.Tensor  # (n, n)
    moment_slope: torch.Tensor  # (n, n, 3) [root, mode] change of mass times centre of mass
    inertia_slope: torch.Tensor  # (n, n, 3, 3) [root, mode] change of the inertia about the origin
    about_origin: torch.Tensor  # (n, 3, 3) inertia about the joint frame's origin, undeformed


class Frames(NamedTuple):
    """Positions and axes of all bodies, in world axes."""

    rotation: torch.Tensor  # (n_config, n, 3, 3)
    origin: torch.Tensor  # (n_config, n, 3) of the joint frames
    axis: torch.Tensor  # (n_config, n, 3) rotation per unit coordinate
    slide: torch.Tensor  # (n_config, n, 3) translation per unit coordinate


class Terms(NamedTuple):
    """Mass matrix and gravity torque of a robot, and the derivative of that torque."""

    mass: torch.Tensor  # (n_config, n, n)
    gravity_torque: torch.Tensor  # (n_config, n)
    gravity_stiffness: torch.Tensor  # (n_config, n, n) dg/dq


def tree_of(chain: Chain, device: torch.device) -> Tree:
    """Copy a chain to a device."""
    n = chain.n_coordinate
    moves = np.eye(n)
    for j, parent in enumerate(chain.parent):
        if parent >= 0:
            moves[j] += moves[parent]
    modes = np.flatnonzero(chain.flexible_root >= 0)
    roots = chain.flexible_root[modes]
    moment_slope, inertia_slope = np.zeros((n, n, 3)), np.zeros((n, n, 3, 3))
    moment_slope[roots, modes] = chain.modal_momentum[modes, 3:]
    inertia_slope[roots, modes] = chain.modal_inertia[modes]
    bodies = zip(chain.mass, chain.centre_of_mass, chain.inertia, strict=True)
    about_origin = np.array([spatial_inertia(float(m), c, inertia)[:3, :3] for m, c, inertia in bodies])
    arrays = {
        "turning": chain.turning_axis,
        "sliding": chain.sliding_axis,
        "rotation": chain.rotation,
        "translation": chain.translation,
        "mass": chain.mass,
        "centre": chain.centre_of_mass,
        "inertia": chain.inertia,
        "gravity": chain.gravity,
        "moves": moves,
        "angular": chain.modal_momentum[modes, :3],
        "linear": chain.modal_momentum[modes, 3:],
        "modal_mass": chain.modal_mass,
        "moment_slope": moment_slope,
        "inertia_slope": inertia_slope,
        "about_origin": about_origin,
    }
    whole = {name: tensor(array, device) for name, array in arrays.items()}
    return Tree(
        parent=tuple(chain.parent.tolist()), modes=tuple(modes.tolist()), roots=tuple(roots.tolist()), **whole
    )


def with_bodies(tree: Tree, mass: torch.Tensor, centre: torch.Tensor, inertia: torch.Tensor) -> Tree:
    """Return the tree with other bodies, of which it is a differentiable function; shapes as of its fields."""
    square = (centre * centre).sum(-1)[:, None, None] * torch.eye(3, dtype=mass.dtype, device=mass.device)
    moved = mass[:, None, None] * (square - centre[:, :, None] * centre[:, None])
    return tree._replace(mass=mass, centre=centre, inertia=inertia, about_origin=inertia + moved)


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
    slides: list[torch.Tensor] = []
    turns = _turns(tree.turning, position)
    for j, parent in enumerate(tree.parent):
        above, origin = (rotations[parent], origins[parent]) if parent >= 0 else (base, start)
        joint = above @ tree.rotation[j]
        slide = joint @ tree.sliding[j]
        origins.append(origin + above @ tree.translation[j] + slide * position[:, j, None])
        axes.append(joint @ tree.turning[j])
        slides.append(slide)
        rotations.append(joint @ turns[:, j])
    return Frames(*(torch.stack(part, 1) for part in (rotations, origins, axes, slides)))


def terms_at(tree: Tree, position: torch.Tensor) -> Terms:
    """Mass matrix, gravity torque and its slope at joint coordinates `position`, shape (n_config, n)."""
    place = frames(tree, position)
    from_origin, inertia = _bent(tree, position)
    centre = place.origin + (place.rotation @ from_origin[..., None])[..., 0]
    moving = _velocity(tree, place, centre)  # (n_config, body, joint, 3)
    heavy = tree.mass[:, None, None] * moving
    n_config, n = position.shape
    rows = moving.transpose(2, 3).reshape(n_config, 3 * n, n)  # bodies and directions stacked
    weighed = heavy.transpose(2, 3).reshape(n_config, 3 * n, n)
    turns = place.axis[:, None] * tree.moves[..., None]  # angular velocity of each body for a unit rate
    spin = turns.transpose(2, 3)  # (n_config, body, 3, joint)
    inertia = place.rotation @ inertia @ place.rotation.transpose(-1, -2)
    mass = weighed.transpose(1, 2) @ rows
    mass = mass + (spin.transpose(-1, -2) @ (inertia @ spin)).sum(1)
    momentum = heavy.sum(1)  # (n_config, joint, 3)
    pulled = torch.linalg.cross(tree.gravity.expand_as(place.axis), place.axis)
    above = -(momentum @ pulled.transpose(1, 2)) * tree.moves  # [below, above]
    carried = (tree.mass @ tree.moves)[:, None] * place.slide  # a joint's own sliding turns nothing
    above = above + torch.diag_embed((carried * pulled).sum(-1))
    if tree.modes:
        modes, roots = list(tree.modes), list(tree.roots)
        axes = place.rotation[:, roots]
        angular, linear = axes @ tree.angular[..., None], axes @ tree.linear[..., None]
        velocity = _velocity(tree, place, place.origin)[:, roots]
        added = torch.zeros_like(mass)
        added[:, modes] = (velocity @ linear + turns[:, roots] @ angular)[..., 0]
        linear = linear[..., 0]
        mass = mass + added + added.transpose(1, 2) + tree.modal_mass
        momentum = momentum.index_add(1, torch.tensor(modes, device=mass.device), linear)
        leaning = torch.zeros_like(above)
        leaning[:, modes] = -(linear @ pulled.transpose(1, 2)) * tree.moves[roots]
        above = above + leaning
    lower = torch.tril(above)
    stiffness = lower + torch.tril(above, -1).transpose(1, 2)
    return Terms((mass + mass.transpose(1, 2)) / 2, -(momentum @ tree.gravity), stiffness)


def _velocity(tree: Tree, place: Frames, point: torch.Tensor) -> torch.Tensor:
    """Velocity of a point of each body (n_config, n, 3) for a unit rate of each joint, (n_config, body, joint, 3)."""
    lever = point[:, :, None] - place.origin[:, None]
    turned = torch.linalg.cross(place.axis[:, None].expand_as(lever), lever)
    velocity: torch.Tensor = (turned + place.slide[:, None]) * tree.moves[..., None]
    return velocity


def _bent(tree: Tree, position: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """Centre of mass of each body and inertia about it, body axes; of flexible ones for their deflection."""
    if not tree.modes:
        return tree.centre.expand(len(position), -1, -1), tree.inertia.expand(len(position), -1, -1, -1)
    roots = sorted(set(tree.roots))
    mass = tree.mass[roots][:, None]
    moment = mass * tree.centre[roots] + torch.einsum("cm,rma->cra", position, tree.moment_slope[roots])
    tensor = tree.about_origin[roots] + torch.einsum("cm,rmab->crab", position, tree.inertia_slope[roots])
    middle = moment / mass
    square = (middle * moment).sum(-1)[..., None, None] * torch.eye(3, dtype=mass.dtype, device=mass.device)
    about = tensor - square + middle[..., :, None] * moment[..., None, :]
    centre = tree.centre.expand(len(position), -1, -1).clone()
    inertia = tree.inertia.expand(len(position), -1, -1, -1).clone()
    centre[:, roots], inertia[:, roots] = middle, about
    return centre, inertia


def bytes_per_position(tree: Tree) -> int:
    """Memory that `terms_at` takes for one position: about ten tables of (body, joint, 3) numbers."""
    return 10 * 3 * 8 * len(tree.parent) ** 2


def _turns(vector: torch.Tensor, amount: torch.Tensor) -> torch.Tensor:
    """Rotations exp([vector] amount) for vectors (n, 3) and amounts (n_config, n), shape (n_config, n, 3, 3)."""
    x, y, z = vector.T
    length = torch.sqrt(x * x + y * y + z * z)
    zero = torch.zeros_like(x)
    cross = torch.stack((zero, -z, y, z, zero, -x, -y, x, zero), 1).reshape(-1, 3, 3)
    cross = cross / torch.where(length > 0, length, 1.0)[:, None, None]
    angle = (length * amount)[..., None, None]
    one = torch.eye(3, dtype=vector.dtype, device=vector.device)
    return one + torch.sin(angle) * cross + (1 - torch.cos(angle)) * (cross @ cross)
