"""Rotor inertia that is off: brake, coupling or gear input weigh more or less than the data sheet has it.

Theory: J = (1 + error) J_nominal at the motor shaft. It scales the torque of acceleration at high frequency, as an
error of the torque constant scales every torque: slow runs under gravity separate the two.
"""

from __future__ import annotations

import dataclasses

from robid_core import ConfigurationError, FloatArray, Parameter, Robot, StructureEffect


class RotorInertiaError(StructureEffect):
    """Relative error of one rotor's inertia."""

    source = "Definition"
    places = ("axis",)
    parameters = (Parameter("error", "1", 0.1, -0.99, 100.0, "true / nominal - 1"),)

    @classmethod
    def apply(cls, robot: Robot, parameters: FloatArray, on: str | None, label: str) -> Robot:
        """Return the robot with the rotor changed; raises ConfigurationError where there is no such axis."""
        axes = dict(robot.description.axes)
        name = next(iter(axes)) if on is None and len(axes) == 1 else on
        if name is None or name not in axes:
            raise ConfigurationError(f"effects.{label}: there is no axis '{on}'; there are {', '.join(axes)}")
        inertia = (1 + float(parameters[0])) * axes[name].rotor_inertia
        axes[name] = axes[name].model_copy(update={"rotor_inertia": inertia})
        description = robot.description.model_copy(update={"axes": axes})
        return dataclasses.replace(robot, description=description)
