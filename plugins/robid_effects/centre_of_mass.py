"""Centre of mass that is off: a body balances elsewhere than the model says.

Theory: the centre of mass moves by (x, y, z) in the frame of the joint; mass, and inertia about the centre of
mass, stay. Gravity torque is linear in the shift; inertia about the joint changes with m (2 c d + d^2): models
from drawings leave out cables, oil and screws (Armstrong, Khatib and Burdick 1986 weighed the links of a PUMA).
"""

from __future__ import annotations

import numpy as np

from robid_core import ConfigurationError, FloatArray, Parameter, Robot, StructureEffect
from robid_effects.bodies import body_index, with_body


class CentreOfMassError(StructureEffect):
    """A shift of one body's centre of mass."""

    source = "Armstrong, Khatib and Burdick 1986, The explicit dynamic model and inertial parameters of the PUMA 560"
    places = ("body", "axis")
    parameters = (
        Parameter("x", "m", 0.0, -10.0, 10.0, "shift in the frame of the body's joint"),
        Parameter("y", "m", 0.0, -10.0, 10.0, "likewise"),
        Parameter("z", "m", 0.01, -10.0, 10.0, "likewise"),
    )

    @classmethod
    def apply(cls, robot: Robot, parameters: FloatArray, on: str | None, label: str) -> Robot:
        """Return the robot with the centre of mass moved; raises ConfigurationError where there is no body."""
        index = body_index(robot, on, label)
        body = robot.description.bodies[index]
        if body.mass == 0:
            raise ConfigurationError(
                f"effects.{label}: body '{body.joint}' has no mass; put the shift on another"
            )
        moved = np.array(body.centre_of_mass) + parameters
        return with_body(robot, index, label, centre_of_mass=tuple(moved.tolist()))
