"""Payload: a load that the model does not know of hangs on a body, by default on the last.

Theory: a rigid body of mass m, centre of mass c in the frame of the joint, and inertia m r^2 about every axis
through it (r its radius of gyration). Two bodies joined have the mass m0 + m, their common centre of mass, and
about it the inertia I0 + m r^2 + m0 m / (m0 + m) (d^2 1 - d d^T) with d the way between the two (parallel axes).
Mass matrix, bias and gravity torque are linear in m for given c and r; a negative m is a body that is lighter than
the model has it. Its torque changes with the pose and not with the sign of speed, which distinguishes it from friction.
"""

from __future__ import annotations

import numpy as np

from robid_core import ConfigurationError, FloatArray, Parameter, Robot, StructureEffect
from robid_effects.bodies import body_index, with_body


def joined(
    mass: float,
    centre: FloatArray,
    inertia: FloatArray,
    added_mass: float,
    added_centre: FloatArray,
    added_inertia: FloatArray,
) -> tuple[float, FloatArray, FloatArray]:
    """Mass, centre of mass (3,) and inertia about it (3, 3) of two rigid bodies joined, all in one frame."""
    total = mass + added_mass
    way = added_centre - centre
    common = centre + added_mass / total * way
    steiner = mass * added_mass / total * (way @ way * np.eye(3) - np.outer(way, way))
    return total, common, inertia + added_inertia + steiner


class Payload(StructureEffect):
    """Payload: a load fixed to a body."""

    source = "Parallel axis theorem; Swevers, Verdonck and De Schutter 2007 for payload identification"
    places = ("body", "axis")
    parameters = (
        Parameter("mass", "kg", 5.0, -1e4, 1e4, "of the load"),
        Parameter("x", "m", 0.0, -10.0, 10.0, "of its centre of mass in the frame of the body's joint"),
        Parameter("y", "m", 0.0, -10.0, 10.0, "likewise"),
        Parameter("z", "m", 0.0, -10.0, 10.0, "likewise"),
        Parameter("radius_of_gyration", "m", 0.0, 0.0, 10.0, "about every axis; 0: a point"),
    )

    @classmethod
    def apply(cls, robot: Robot, parameters: FloatArray, on: str | None, label: str) -> Robot:
        """Return the robot with the load on a body.

        Raises ConfigurationError where there is no such body, or what is left of it is none.
        """
        mass, x, y, z, radius = (float(value) for value in parameters)
        index = body_index(robot, on, label)
        body = robot.description.bodies[index]
        if mass == 0:
            return robot
        if body.mass + mass <= 0:
            raise ConfigurationError(
                f"effects.{label}: body '{body.joint}' has {body.mass:g} kg, with {mass:g} kg nothing is left; "
                "give a larger mass"
            )
        total, centre, inertia = joined(
            body.mass,
            np.array(body.centre_of_mass),
            np.array(body.inertia),
            mass,
            np.array([x, y, z]),
            mass * radius**2 * np.eye(3),
        )
        return with_body(
            robot,
            index,
            label,
            mass=total,
            centre_of_mass=tuple(centre.tolist()),
            inertia=tuple(tuple(row) for row in inertia.tolist()),
        )
