"""Coupled axes: a motor that also moves another axis, as the motors of a wrist do.

Theory: the joint angles are q = R q_m with a full matrix R (thesis eq. 2.2, "matrix of inverse gear ratios");
concentric shafts through a wrist put entries beside its diagonal. The effect adds one: axis `on` turns `ratio`
times with motor `from_motor`. By virtual work the motor then carries a part of that axis' torque, which is the
same matrix transposed; the simulator and the linear model take both from R. Two entries are two effects.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

import numpy as np

from robid_core import ConfigurationError, FloatArray, Parameter, Place, Robot, StructureEffect

MOST_AXES = 9  # of robots whose couplings a diagnosis searches
SLIGHT = 1e-6


class CoupledAxes(StructureEffect):
    """Coupling of two axes: one more entry of the matrix from motor angles to joint angles."""

    source = "Zimmermann, thesis eq. (2.2); Sciavicco and Siciliano, Modelling and Control of Robot Manipulators, 2000"
    places = ("axis",)
    parameters = (
        Parameter("ratio", "1", 0.01, -10.0, 10.0, "joint turns of the axis per turn of the other motor"),
        Parameter(
            "from_motor", "1", 1.0, 1.0, 99.0, "number of the other motor, the robot's first axis is 1"
        ),
    )

    @classmethod
    def starts(cls, place: Place | None) -> tuple[Mapping[str, float], ...]:
        """From each motor that there may be, slightly: then the torque is linear in the ratio."""
        del place
        return tuple({"from_motor": float(motor), "ratio": SLIGHT} for motor in range(1, MOST_AXES + 1))

    @classmethod
    def apply(cls, robot: Robot, parameters: FloatArray, on: str | None, label: str) -> Robot:
        """Return the robot whose axis `on` turns with motor `from_motor` too.

        Raises
        ------
        ConfigurationError
            Where there is no such axis or motor, or the motor is the axis' own.
        """
        ratio, from_motor = (float(value) for value in parameters)
        names = robot.axis_names
        if on not in names:
            raise ConfigurationError(
                f"effects: {label}: there is no axis '{on}' to couple; there are {list(names)}"
            )
        motor, joint = int(from_motor) - 1, names.index(on)
        if from_motor != int(from_motor) or not 0 <= motor < robot.n_axis:
            raise ConfigurationError(
                f"effects: {label}: from_motor is {from_motor:g}; give a whole number from 1 to {robot.n_axis}"
            )
        if motor == joint:
            raise ConfigurationError(
                f"effects: {label}: motor {motor + 1} drives {on} itself; change its gear_ratio, or give another motor"
            )
        gear = np.diag([1.0 / axis.gear_ratio for axis in robot.description.axes.values()])
        if robot.description.coupling is not None:
            gear = np.array(robot.description.coupling)
        gear[joint, motor] += ratio
        coupling = tuple(tuple(float(entry) for entry in row) for row in gear)
        description = robot.description.model_copy(update={"coupling": coupling})
        return dataclasses.replace(robot, description=description)
