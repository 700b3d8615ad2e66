"""How chains lie in memory for the compiled loops: joint axes along local x, y or z; the last axis of work: lanes.

Lanes may be of robots that differ in numbers. Arrays of floats have a leading axis for sets of numbers, of which each
block of lanes takes one, and where the lanes of a block are of several robots a last axis for the lanes. Arrays of
whole numbers tell the structure, which all robots share.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from robid_core.arrays import FloatArray, IntArray
from robid_core.compiled.memory import aligned_arrays, in_lanes
from robid_core.mechanics.chain import MODAL, PRISMATIC, REVOLUTE, Chain


class ChainArrays(NamedTuple):
    """Chains as the kernels read them: structure, and numbers as `in_lanes` lays them."""

    tree: IntArray  # (n, 8) parent; 0, 1, 2: revolute about local x, y, z, 3: prismatic along z, 4: modal; is rotation
    # not 1; root of the flexible body whose mode this is, or -1; does a joint other than the next come back to
    # its frame;
    # is there a mass, or does a joint other than the next hang on it; 1 + 2 + 4: translation along x, y, z is not 0;
    # is there a mass
    body: FloatArray  # (n, 26) rotation by rows 0-8, translation 9, mass 12, mass times centre 13, inertia
    # about the joint frame's origin xx yy zz xy xz yz 16, slide 22 and turn 25 of a modal joint
    ancestor: IntArray  # (n, n) [j, i] is 1 where joint i moves body j, else 0
    modal: FloatArray  # (n, 12) of the flexible body, axes and origin of its root: momentum for a unit modal rate 0-5,
    # derivative of its inertia by the modal coordinate xx yy zz xy xz yz 6-11
    modal_mass: FloatArray  # (n, n)
    gravity: FloatArray  # (3,)


class ChainWork(NamedTuple):
    """Memory of one evaluation, owned by the caller so that inner loops allocate nothing; last axis: lanes."""

    record: FloatArray  # (n, 40) axes x y z of the joint frame in world 0-8, origin 9, velocity of the base
    # point 12 (angular, linear), its acceleration 18, composite inertia about the world's origin xx yy zz xy xz yz
    # 24, mass times centre 30, mass 33, moment 34 and force 37 on what hangs on the joint
    screw: FloatArray  # (9, n) joint axis and its moment 0-5; slide of a modal joint 6-8
    momentum: FloatArray  # (14, n) of what hangs on joint j, for a unit rate of joint j 0-5; of a flexible body 6-12;
    # mass of what hangs on joint j 13
    mass: FloatArray  # (n, n) lower triangle of the mass matrix
    bias: FloatArray  # (n,) c + g
    gravity_stiffness: FloatArray  # (n, n) lower triangle of dg/dq
    sine: FloatArray  # (n,) of the joint angles; whole cache lines, see `functions.sines_and_cosines`
    cosine: FloatArray  # (n,)


OF_STRUCTURE, OF_NUMBERS = (0, 1, 3, 4), (2, 5, 6, 7)
"""Columns of `ChainArrays.tree`: alike in all robots, and those that ask whether a number is not zero."""


def chain_arrays(chains: Sequence[Chain], robots: IntArray) -> ChainArrays:
    """Lay chains of one structure side by side; `robots` as of `in_lanes`."""
    alone = [numbers_of_chain(chain) for chain in chains]
    tree = alone[0].tree.copy()
    for other in alone[1:]:
        tree[:, OF_NUMBERS] |= other.tree[:, OF_NUMBERS]
    body, modal, mass, gravity = (
        in_lanes([getattr(one, name) for one in alone], robots)
        for name in ("body", "modal", "modal_mass", "gravity")
    )
    return ChainArrays(tree, body, alone[0].ancestor, modal, mass, gravity)


@functools.lru_cache(maxsize=128)
def numbers_of_chain(chain: Chain) -> ChainArrays:
    """Turn every joint frame so that its axis is a local one, and list who moves whom; no sets, no lanes."""
    n = chain.n_coordinate
    local, turns = zip(*map(_local_axis, chain.axis, chain.joint_type), strict=True)
    turn = np.array(turns)
    ancestor = np.eye(n, dtype=np.int64)
    for j, parent in enumerate(chain.parent):
        if parent >= 0:
            ancestor[j] |= ancestor[parent]
    parent_turn = np.where((chain.parent >= 0)[:, None, None], turn[chain.parent], np.eye(3))
    unturn, parent_unturn = turn.transpose(0, 2, 1), parent_turn.transpose(0, 2, 1)
    centre = (unturn @ chain.centre_of_mass[:, :, None])[:, :, 0]
    moved = (
        np.einsum("ni,ni->n", centre, centre)[:, None, None] * np.eye(3)
        - centre[:, :, None] * centre[:, None]
    )
    inertia = unturn @ chain.inertia @ turn + chain.mass[:, None, None] * moved
    rotation = parent_unturn @ chain.rotation @ turn
    modal = chain.joint_type == MODAL
    body = np.concatenate(
        (
            rotation.reshape(n, 9),
            (parent_unturn @ chain.translation[:, :, None])[:, :, 0],
            chain.mass[:, None],
            chain.mass[:, None] * centre,
            inertia[:, [0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]],
            (unturn @ chain.slide[:, :, None])[:, :, 0],
            np.where(modal, np.linalg.norm(chain.axis, axis=1), 0.0)[:, None],
        ),
        axis=1,
    )
    turned = (rotation != np.eye(3)).any(axis=(1, 2))
    joint = np.arange(n)
    branching = np.isin(joint, chain.parent[chain.parent != joint - 1])
    revisited = branching | np.isin(joint, chain.flexible_root)
    kept = branching | (chain.mass > 0)
    translated = (body[:, 9:12] != 0) @ [1, 2, 4]
    tree = np.column_stack(
        (chain.parent, local, turned, chain.flexible_root, revisited, kept, translated, chain.mass != 0)
    ).astype(np.int64)
    root_unturn = np.where((chain.flexible_root >= 0)[:, None, None], unturn[chain.flexible_root], np.eye(3))
    root_turn = root_unturn.transpose(0, 2, 1)
    change = root_unturn @ chain.modal_inertia @ root_turn
    mode = np.concatenate(
        (
            (root_unturn @ chain.modal_momentum[:, :3, None])[:, :, 0],
            (root_unturn @ chain.modal_momentum[:, 3:, None])[:, :, 0],
            change[:, [0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]],
        ),
        axis=1,
    )
    return ChainArrays(
        np.ascontiguousarray(tree),
        np.ascontiguousarray(body),
        ancestor,
        np.ascontiguousarray(mode),
        chain.modal_mass.copy(),
        chain.gravity.copy(),
    )


def chain_work(n: int, width: int) -> ChainWork:
    """Allocate the memory of one evaluation for n joints and `width` lanes."""
    shapes = ((n, 40), (9, n), (14, n), (n, n), (n,), (n, n), (n,), (n,))
    return ChainWork(*aligned_arrays(*((*shape, width) for shape in shapes)))


def _local_axis(axis: FloatArray, joint_type: int) -> tuple[int, FloatArray]:
    """Return how the kernel calls the joint, and the axes in which it is one of the local ones."""
    aligned = np.flatnonzero(axis == 1.0)
    length = np.linalg.norm(axis)
    if joint_type == REVOLUTE and len(aligned):
        return int(aligned[0]), np.eye(3)
    if length == 0:  # a mode that only slides
        return 4, np.eye(3)
    z = axis / length
    x = np.cross(np.eye(3)[np.argmin(abs(z))], z)
    x /= np.linalg.norm(x)
    kind = {REVOLUTE: 2, PRISMATIC: 3, MODAL: 4}[int(joint_type)]
    return kind, np.column_stack((x, np.cross(z, x), z))
