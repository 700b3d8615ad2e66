"""The parameters of a robot by name, as arrays, and as the text of a file."""

from __future__ import annotations

import functools
import io
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from robid_core.robot.description import RobotDescription
from robid_core.robot.named_parameters import named_parameters

FloatArray = npt.NDArray[np.float64]


class NamedUnknowns:
    """What a `Robot` says of its parameters; a part of that class, in a file of its own."""

    description: RobotDescription
    if TYPE_CHECKING:

        @property
        def name(self) -> str: ...
        @property
        def structure(self) -> RobotDescription: ...

    def parameters(self) -> dict[str, float]:
        """Return every named parameter with its value."""
        return {name: parameter.value for name, parameter in named_parameters(self.description).items()}

    def parameter_unit(self, name: str) -> str:
        """Return the unit of a named parameter."""
        return named_parameters(self.description)[name].unit

    def parameter_group(self, name: str) -> str:
        """Return the group of a named parameter: stiffness, damping, modal, inertia, friction, drive or effect."""
        return named_parameters(self.description)[name].group

    @functools.cached_property
    def stiffness_names(self) -> tuple[str, ...]:
        """Names of the springs' stiffness: gears in the order of axes, then bearings."""
        return tuple(n for n, p in named_parameters(self.structure).items() if p.group == "stiffness")

    @functools.cached_property
    def damping_names(self) -> tuple[str, ...]:
        """Names of the dampers beside the springs, in the order of `stiffness_names`."""
        return tuple(n for n, p in named_parameters(self.structure).items() if p.group == "damping")

    @functools.cached_property
    def spring_names(self) -> tuple[str, ...]:
        """Names of all springs in the order of `spring_arrays`: `stiffness_names`, then the modes of flexible links."""
        modal = (n for n in named_parameters(self.structure) if n.startswith("modal_stiffness."))
        return (*self.stiffness_names, *modal)

    def spring_arrays(self) -> tuple[FloatArray, FloatArray]:
        """Return (stiffness, damping), each (n_spring,), in the order of `spring_names`."""
        known = named_parameters(self.structure)
        modal = self.spring_names[len(self.stiffness_names) :]
        dampers = (*self.damping_names, *(name.replace("stiffness", "damping", 1) for name in modal))
        return (
            np.array([known[name].value for name in self.spring_names]),
            np.array([known[name].value for name in dampers]),
        )

    def to_yaml(self) -> str:
        """Write the whole robot, bodies inline: equal robots give equal text."""
        from ruamel.yaml import YAML

        stream = io.StringIO()
        yaml = YAML(typ="safe", pure=True)
        yaml.default_flow_style = None
        yaml.width = 120
        yaml.sort_base_mapping_type_on_output = False  # type: ignore[assignment]
        yaml.dump(self.description.model_dump(mode="json"), stream)
        return stream.getvalue()
