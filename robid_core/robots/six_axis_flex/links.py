"""Finite elements of the links of six_axis_flex, made of this repository's beams: `python links.py` writes the files.

Each link is a tapered hollow box of cast aluminium from joint to joint, along x of its file, with two rigid parts on
its ends: what rides on the tip (motor, gear and bearing of the next joint), chosen by hand, and the casting around the
root, which is all that is missing to the mass, centre of mass and inertia that robots/six_axis has for the link.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy.sparse

from robid_core.arrays import FloatArray
from robid_core.mechanics.chain import spatial_inertia
from robid_core.mechanics.flexible import Structure, hollow_square
from robid_core.mechanics.flexible.beam import element_matrices
from robid_core.mechanics.flexible.modal import rigid_properties

MODULUS, POISSON, DENSITY = 7.2e10, 0.33, 2700.0  # Pa, 1, kg/m^3: cast aluminium
N_ELEMENT = 8
Row = tuple[float, float, float]


@dataclass(frozen=True)
class Link:
    """A box between two joints and what rides on its tip; lengths in m, in axes of the file."""

    length: float
    """Between the joints."""
    rotation: tuple[Row, Row, Row]
    """From the file's frame to the joint's, by rows; its first column points to the tip. As in robot.yaml."""
    sides: tuple[float, float]
    """Outer side of the square section at root and tip."""
    wall: float
    """Thickness of the wall."""
    tip_mass: float
    """Of what rides on the tip, kg."""
    tip_centre: Row
    """Its centre of mass from the tip node."""
    tip_radius: float
    """Its radius of gyration about every axis."""


LINKS = {
    "lower_arm": Link(
        length=0.70,
        rotation=((0.0, 0.0, -1.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0)),
        sides=(0.155, 0.115),
        wall=0.010,
        tip_mass=7.0,
        tip_centre=(0.02, -0.10, 0.0),
        tip_radius=0.10,
    ),
    "elbow": Link(
        length=float(np.hypot(0.22, 0.12)),
        rotation=((0.877895566, 0.0, -0.478852127), (0.0, 1.0, 0.0), (0.478852127, 0.0, 0.877895566)),
        sides=(0.150, 0.125),
        wall=0.009,
        tip_mass=6.0,
        tip_centre=(0.0, 0.0, 0.0),
        tip_radius=0.07,
    ),
    "upper_arm": Link(
        length=0.48,
        rotation=((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
        sides=(0.105, 0.080),
        wall=0.007,
        tip_mass=4.0,
        tip_centre=(0.0, 0.0, 0.0),
        tip_radius=0.05,
    ),
}


def structure_of(link: Link, mass: float, centre_of_mass: FloatArray, inertia: FloatArray) -> Structure:
    """Finite elements of a link with the given rigid body.

    Parameters
    ----------
    link
        Box and tip.
    mass, centre_of_mass, inertia
        Of the whole link in the joint's frame: kg, m (3,), kg m^2 about the centre of mass (3, 3).
    """
    length = link.length
    n = 6 * (N_ELEMENT + 1)
    whole_mass, stiffness = np.zeros((n, n)), np.zeros((n, n))
    for element in range(N_ELEMENT):
        share = (element + 0.5) / N_ELEMENT
        side = (1 - share) * link.sides[0] + share * link.sides[1]
        beam = hollow_square(length / N_ELEMENT, side, link.wall, MODULUS, POISSON, DENSITY)
        rows = slice(6 * element, 6 * element + 12)
        m, k = element_matrices(beam, length / N_ELEMENT)
        whole_mass[rows, rows] += m
        stiffness[rows, rows] += k
    nodes = np.zeros((N_ELEMENT + 1, 3))
    nodes[:, 0] = np.linspace(0.0, length, N_ELEMENT + 1)
    tip = spatial_inertia(
        link.tip_mass, np.array(link.tip_centre), link.tip_mass * link.tip_radius**2 * np.eye(3)
    )
    displacement_first = np.array([3, 4, 5, 0, 1, 2])
    whole_mass[-6:, -6:] += tip[np.ix_(displacement_first, displacement_first)]
    turn = np.array(link.rotation).T
    target = spatial_inertia(mass, turn @ centre_of_mass, turn @ inertia @ turn.T)
    rigid = Structure(whole_mass, stiffness, nodes).rigid_motion(np.zeros(3))
    root = target - rigid.T @ whole_mass @ rigid
    rigid_properties(root, "the casting around the root")
    whole_mass[:6, :6] += root[np.ix_(displacement_first, displacement_first)]
    return Structure(scipy.sparse.csr_array(whole_mass), scipy.sparse.csr_array(stiffness), nodes)


def write_links(folder: Path) -> None:
    """Write `<link>.npz` of every link, for the bodies that robots/six_axis has."""
    from robid_core.robot import Robot
    from robid_core.robot.file.finite_elements import write_structure

    bodies = {body.joint: body for body in Robot.load("six_axis").description.bodies}
    for joint, (name, link) in zip(("axis_2", "axis_3", "axis_4"), LINKS.items(), strict=True):
        body = bodies[joint]
        rigid = body.mass, np.array(body.centre_of_mass), np.array(body.inertia)
        write_structure(folder / f"{name}.npz", structure_of(link, *rigid))


if __name__ == "__main__":
    write_links(Path(__file__).parent)
