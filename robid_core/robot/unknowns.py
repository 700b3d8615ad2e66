"""The parameters of a robot by name and as arrays, and the robot as the text of a file."""

from __future__ import annotations

import functools
from html import escape
from typing import TYPE_CHECKING

import numpy as np

from robid_core.arrays import FloatArray
from robid_core.artifacts import Table
from robid_core.robot.file.description import RobotDescription
from robid_core.robot.file.named_parameters import layout_of, number_at
from robid_core.robot.file.parameter_places import ParameterPlace, places_of_structure
from robid_core.robot.file.writing import robot_sha256, robot_yaml


class NamedUnknowns:
    """What a `Robot` says of its parameters; a part of that class, in a file of its own."""

    description: RobotDescription
    if TYPE_CHECKING:

        @property
        def name(self) -> str: ...
        @property
        def structure(self) -> RobotDescription: ...

    @functools.cached_property
    def layout(self) -> dict[str, ParameterPlace]:
        """The place of every number of the file that has a name, in the order of the file."""
        return layout_of(self.description)

    def parameters(self) -> dict[str, float]:
        """Return every named parameter with its value."""
        return {name: number_at(self.description, place) for name, place in self.layout.items()}

    def table(self) -> Table:
        """Return a row for each named parameter: its value, its unit and what it is of.

        Examples
        --------
        >>> import robid_core as robid
        >>> row = next(robid.Robot.load("one_axis").table().rows())
        >>> list(row)
        ['parameter', 'value', 'unit', 'kind']
        """
        found = self.parameters()
        return Table(
            parameter=list(found),
            value=list(found.values()),
            unit=[self.parameter_unit(name) for name in found],
            kind=[self.parameter_kind(name) for name in found],
        )

    def _repr_html_(self) -> str:
        """Return what a notebook shows of it."""
        axes = ", ".join(self.description.axes)
        parameters = self.table()._repr_html_()
        head = f"<b>Robot</b> {escape(self.name)}: {escape(axes)}"
        return f"<div>{head}<details><summary>parameters</summary>{parameters}</details></div>"

    def parameter(self, name: str) -> float:
        """Return the value of a named parameter."""
        return number_at(self.description, self.layout[name])

    def parameter_unit(self, name: str) -> str:
        """Return the unit of a named parameter.

        >>> import robid_core as robid
        >>> robid.Robot.load("one_axis").parameter_unit("gear_stiffness.axis_1")
        'N m/rad'
        """
        return self.layout[name].unit

    def parameter_kind(self, name: str) -> str:
        """Return what a named parameter is of: stiffness, damping, inertia, friction, drive, effect...

        >>> import robid_core as robid
        >>> robid.Robot.load("one_axis").parameter_kind("gear_stiffness.axis_1")
        'stiffness'
        """
        return self.layout[name].kind

    def parameter_group(self, name: str) -> str:
        """Return the group of the thesis that a named parameter belongs to: static, separate or dynamic.

        >>> import robid_core as robid
        >>> robid.Robot.load("one_axis").parameter_group("mass.axis_1")
        'static'
        """
        return self.layout[name].group

    @functools.cached_property
    def stiffness_names(self) -> tuple[str, ...]:
        """Names of the springs' stiffness: gears in the order of axes, then bearings."""
        return tuple(n for n, p in places_of_structure(self.structure).items() if p.kind == "stiffness")

    @functools.cached_property
    def damping_names(self) -> tuple[str, ...]:
        """Names of the dampers beside the springs, in the order of `stiffness_names`."""
        return tuple(name.replace("stiffness", "damping", 1) for name in self.stiffness_names)

    @functools.cached_property
    def spring_names(self) -> tuple[str, ...]:
        """Names of all springs in the order of `spring_arrays`: `stiffness_names`, then the modes of flexible links."""
        modal = (n for n in places_of_structure(self.structure) if n.startswith("modal_stiffness."))
        return (*self.stiffness_names, *modal)

    @functools.cached_property
    def spring_places(self) -> tuple[tuple[ParameterPlace, ParameterPlace], ...]:
        """Where stiffness and damping of each spring stand in `structure`, in the order of `spring_names`."""
        places = places_of_structure(self.structure)
        return tuple(
            (places[name], places[name.replace("stiffness", "damping", 1)]) for name in self.spring_names
        )

    def spring_arrays(self) -> tuple[FloatArray, FloatArray]:
        """Return (stiffness, damping), each (n_spring,), in the order of `spring_names`.

        >>> import robid_core as robid
        >>> stiffness, damping = robid.Robot.load("one_axis").spring_arrays()
        >>> stiffness.tolist(), damping.tolist()
        ([80000.0], [60.0])
        """
        structure = self.structure
        rows = [
            (number_at(structure, spring), number_at(structure, damper))
            for spring, damper in self.spring_places
        ]
        stiffness, damping = np.array(rows).reshape(-1, 2).T.copy()
        return stiffness, damping

    def to_yaml(self) -> str:
        """Write the whole robot, bodies inline: equal robots give equal text."""
        return robot_yaml(self.description)

    @property
    def sha256(self) -> str:
        """Hash of `to_yaml`, wherever the robot was read from."""
        return robot_sha256(self.description)
