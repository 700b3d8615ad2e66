"""Elastic coordinate that the model lacks: a body turns against its joint, about any axis.

Theory: the extended flexible joint model (thesis section 2.2; Moberg 2010) has elastic coordinates across the
direction of transmission, where bearings and links bend; one that is missing leaves a resonance unexplained, and
pushes others off their place. The new one stands behind the joint and what bends there already. About the joint's
own axis it would be in series with the gear: there the gear's stiffness is the parameter, and this one is refused.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from robid_core import ConfigurationError, FloatArray, Parameter, Place, Robot, StructureEffect
from robid_effects.bodies import body_index, with_sections


class ElasticCoordinate(StructureEffect):
    """Additional elastic coordinate: one more spring and damper behind a joint."""

    source = "Zimmermann, thesis section 2.2; Moberg 2010, Modeling and Control of Flexible Manipulators"
    places = ("axis", "body")
    parameters = (
        Parameter("axis_x", "1", 1.0, -1.0, 1.0, "direction of the turn in the joint's frame, of any length"),
        Parameter("axis_y", "1", 0.0, -1.0, 1.0, "likewise"),
        Parameter("axis_z", "1", 0.0, -1.0, 1.0, "likewise"),
        Parameter("stiffness", "N m/rad", 1e5, 1e-3, 1e12, "of the spring"),
        Parameter("damping", "N m s/rad", 50.0, 0.0, 1e9, "of the damper beside it"),
    )

    @classmethod
    def starts(cls, place: Place | None) -> tuple[Mapping[str, float], ...]:
        """About each axis of the joint's frame."""
        del place
        return tuple(dict(zip(("axis_x", "axis_y", "axis_z"), axis, strict=True)) for axis in np.eye(3))

    @classmethod
    def apply(cls, robot: Robot, parameters: FloatArray, on: str | None, label: str) -> Robot:
        """Return the robot with the elastic coordinate `label`.

        Raises ConfigurationError where there is no such joint, the direction is none or taken, or the name is.
        """
        length = float(np.linalg.norm(parameters[:3]))
        if length < 1e-6:
            raise ConfigurationError(
                f"effects.{label}: the axis (axis_x, axis_y, axis_z) is zero; give a direction"
            )
        bearings = robot.description.model_dump()["bearings"]
        if label in bearings:
            raise ConfigurationError(
                f"effects.{label}: there is a bearing '{label}' already; give another label"
            )
        bearings[label] = {
            "joint": robot.description.bodies[body_index(robot, on, label)].joint,
            "axis": tuple((parameters[:3] / length).tolist()),
            "stiffness": float(parameters[3]),
            "damping": float(parameters[4]),
        }
        return with_sections(robot, label, bearings=bearings)
