"""Lumped parameters: a beam cut into rigid sublinks joined by pseudo-joints with springs.

T. Yoshikawa, K. Hosoda, Modeling of flexible manipulators using virtual rigid links and passive joints (IROS 1991;
Int. J. Robotics Research 15, 1996): springs are chosen so that the chain bends statically as the beam does. A
pseudo-joint that stands for the length l of the beam has stiffness E I / l (G J / l in torsion), so that the static
answer is a quadrature over the beam, and where the joints stand decides how exact it is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from robid_core.arrays import FloatArray
from robid_core.errors import ConfigurationError
from robid_core.mechanics.flexible.beam import Beam
from robid_core.mechanics.flexible.closed_form import (
    bending_frequencies_hz,
    cantilever_roots,
    torsion_frequencies_hz,
)

MOTIONS = ("torsion", "bending_y", "bending_z")  # about x, y, z


@dataclass(frozen=True, eq=False)
class PseudoJoints:
    """A beam as one rigid piece at the root and k revolute joints in series, all in axes of the beam.

    The first joint's frame is placed on the root, each other's on the joint before it, without a turn. Where several
    joints stand at one place, the last of them carries the sublink.
    """

    root_mass: float
    """kg, of the piece that moves with the root."""
    root_centre_of_mass: FloatArray
    """m, shape (3,)."""
    root_inertia: FloatArray
    """kg m^2 about its centre, shape (3, 3)."""
    names: tuple[str, ...]
    """`1_bending_y`...: number of the pseudo-joint from the root, and motion; length k."""
    axis: FloatArray
    """(k, 3)."""
    translation: FloatArray
    """m, (k, 3)."""
    mass: FloatArray
    """kg, (k,)."""
    centre_of_mass: FloatArray
    """m from the joint, (k, 3)."""
    inertia: FloatArray
    """kg m^2 about the centre, (k, 3, 3)."""
    stiffness: FloatArray
    """N m/rad, (k,)."""
    damping: FloatArray
    """N m s/rad, (k,)."""
    tip: FloatArray
    """m from the root, shape (3,)."""


def pseudo_joints(
    beam: Beam,
    n: int,
    motions: Sequence[str] = MOTIONS,
    placement: Literal["middle", "gauss"] = "middle",
    damping_ratio: float = 0.01,
) -> PseudoJoints:
    """Cut a beam at n places and join the pieces by springs.

    Parameters
    ----------
    beam
        Along x from the root.
    n
        Number of places.
    motions
        Of "torsion" (about x), "bending_y" (about y), "bending_z" (about z): one joint each at every place.
    placement
        "middle": in the middle of n equal lengths; under a load at the tip the beam bends too little by the fraction
        1 / (4 n^2), frequencies are of second order too. "gauss": at the points of Gauss and Legendre, each for the
        length that is its weight; from n = 2 on the tip answers exactly to force and moment at the tip, and the lower
        half of the frequencies is better.
    damping_ratio
        Of the first mode of the clamped beam in each motion; springs and dampers are in proportion.

    Raises
    ------
    ConfigurationError
        For no place, or a motion that is unknown or named twice.
    """
    if n < 1 or not motions or len(set(motions)) < len(motions) or not set(motions) <= set(MOTIONS):
        raise ConfigurationError(
            f"pseudo-joints: {n} places with motions {list(motions)}; give at least one place and one of each of "
            f"{', '.join(MOTIONS)} at most"
        )
    if placement == "gauss":
        points, weights = np.polynomial.legendre.leggauss(n)
        place, share = beam.length * (points + 1) / 2, beam.length * weights / 2
    else:
        place, share = beam.length * (np.arange(n) + 0.5) / n, np.full(n, beam.length / n)
    ends = np.append(place, beam.length)
    root = cantilever_roots(1)
    rigidity = dict(zip(MOTIONS, (beam.torsional_stiffness, *beam.bending_stiffness), strict=True))
    first = {
        "torsion": torsion_frequencies_hz(beam, 1),
        "bending_y": bending_frequencies_hz(beam, root, "y"),
        "bending_z": bending_frequencies_hz(beam, root, "z"),
    }
    m = len(motions)
    translation, mass = np.zeros((n, m, 3)), np.zeros((n, m))
    centre, inertia = np.zeros((n, m, 3)), np.zeros((n, m, 3, 3))
    translation[:, 0, 0] = np.diff(place, prepend=0.0)
    length = np.diff(ends)
    mass[:, -1], centre[:, -1, 0] = beam.mass_per_length * length, length / 2
    inertia[:, -1] = [beam.inertia(piece) for piece in length]
    stiffness = np.array([[rigidity[motion] / part for motion in motions] for part in share])
    damping = stiffness * [
        damping_ratio / (np.pi * float(first[motion][0])) for motion in motions
    ]  # 2 D k / w
    return PseudoJoints(
        root_mass=beam.mass_per_length * place[0],
        root_centre_of_mass=np.array([place[0] / 2, 0.0, 0.0]),
        root_inertia=beam.inertia(place[0]),
        names=tuple(f"{i + 1}_{motion}" for i in range(n) for motion in motions),
        axis=np.tile(np.eye(3)[[MOTIONS.index(motion) for motion in motions]], (n, 1)),
        translation=translation.reshape(-1, 3),
        mass=mass.ravel(),
        centre_of_mass=centre.reshape(-1, 3),
        inertia=inertia.reshape(-1, 3, 3),
        stiffness=stiffness.ravel(),
        damping=damping.ravel(),
        tip=np.array([beam.length, 0.0, 0.0]),
    )
