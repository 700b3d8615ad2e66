"""What fits make of a robot: models given back, and robots made of models (`robid_core.artifacts.Model`).

A model counts from the robot file: whatever a fit began with, effects and numbers are those that differ from what was
loaded. Where a robot differs from its file by more than that (another body, another limit), it is its own base.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, cast

import numpy as np

from robid_core.arrays import FloatArray
from robid_core.artifacts import Fit, Model
from robid_core.errors import ConfigurationError
from robid_core.robot.file.changes import Changes, base_of, changes, place_of, with_effects
from robid_core.robot.file.description import RobotDescription
from robid_core.robot.file.named_parameters import named_parameters
from robid_core.robot.file.writing import robot_yaml, text_sha256

if TYPE_CHECKING:
    from robid_core.robot.robot import Robot

TAKE_ONE = "take the robot of one of them, or let the second begin at the first by `inputs: {robot: ...}`"


class Identified:
    """What a `Robot` has to do with models; a part of that class, in a file of its own."""

    description: RobotDescription
    dynamics: str
    base: RobotDescription | None

    def model(
        self,
        values: Mapping[str, float],
        free_names: Sequence[str] = (),
        covariance: FloatArray | None = None,
        left_out: Sequence[str] = (),
    ) -> Model:
        """Return what a fit of this robot gives back.

        Parameters
        ----------
        values
            Named parameters as they were found, held ones that shall be told among them.
        free_names, covariance
            Those of them that were estimated, and their covariance in their own units, (n_free, n_free); by default
            unknown.
        left_out
            Names of what was estimated and is no number of a robot file.

        Raises
        ------
        ConfigurationError
            For a name that this robot does not have, or a value it cannot have.

        Examples
        --------
        >>> import robid_core as robid
        >>> model = robid.Robot.load("one_axis").model({"gear_stiffness.axis_1": 9e4})
        >>> dict(zip(model.names, model.value.tolist()))
        {'gear_stiffness.axis_1': 90000.0}
        """
        robot = cast("Robot", self)
        found = robot.with_parameters(values).description
        change = changes(self.base or self.description, found) or Changes(self.description, {}, {})
        known = {**change.numbers, **values}
        numbers = {name: known[name] for name in robot.layout if name in known}
        free = tuple(free_names)
        text = robot_yaml(change.base)
        return Model(
            base=change.base.name,
            base_sha256=text_sha256(text),
            base_text=text,
            effects=json.dumps(change.effects),
            names=tuple(numbers),
            start=np.array([robot.parameter(name) for name in numbers], dtype=np.float64),
            value=np.array(list(numbers.values()), dtype=np.float64),
            covariance=np.full((len(free), len(free)), np.nan) if covariance is None else covariance,
            free_names=free,
            left_out=tuple(left_out),
        )

    @classmethod
    def of_model(cls, model: Model, dynamics: str = "kernel") -> Robot:
        """Return the robot that a model describes; its file need not be there any more.

        Raises ConfigurationError where this version of robid or its plugins make no robot of it.

        >>> import robid_core as robid
        >>> model = robid.Robot.load("one_axis").model({"gear_stiffness.axis_1": 9e4})
        >>> robid.Robot.of_model(model).parameter("gear_stiffness.axis_1")
        90000.0
        """
        base = base_of(model)
        robot = cast("type[Robot]", cls)(with_effects(base, json.loads(model.effects)), dynamics, base)
        return robot.with_parameters(dict(zip(model.names, model.value.tolist(), strict=True)))

    def fitted(self, fit: Fit) -> Robot:
        """Return the robot as a fit found it, what this one has besides from another fit included.

        A fit without a model has its parameters put into this robot.

        Raises
        ------
        ConfigurationError
            Where the fit is of another robot, or where this robot has another number or effect from another fit.

        Examples
        --------
        >>> import robid_core as robid
        >>> from robid_core.testing import example_fit
        >>> robot = robid.Robot.load("one_axis")
        >>> fit = example_fit(robot)
        >>> found = robot.fitted(fit)
        >>> found.parameter("gear_stiffness.axis_1") == fit.parameters.as_mapping()["gear_stiffness.axis_1"]
        True
        """
        robot = cast("Robot", self)
        if fit.model is None:
            table = fit.parameters
            began = dict(zip(table.names, table.start.tolist(), strict=True))
            return robot.with_parameters(_agreed(robot, table.as_mapping(), began))
        model = fit.model
        found = replace(type(robot).of_model(model, self.dynamics), file=robot.file)
        if self.description == found.base:
            return found
        base = found.base or found.description
        mine, theirs = changes(base, self.description), changes(base, found.description)
        if mine is None or theirs is None:
            raise ConfigurationError(
                f"the fit is of the robot {model.base} (sha256 {model.base_sha256[:12]}), which this one "
                f"({robot.name}, {robot.sha256[:12]}) does not come from; let both take the same robot"
            )
        began = dict(zip(model.names, model.start.tolist(), strict=True))
        values = _agreed(robot, dict(zip(model.names, model.value.tolist(), strict=True)), began)
        for label in mine.effects.keys() & theirs.effects.keys():
            if place_of(mine.effects[label]) != place_of(theirs.effects[label]):
                raise ConfigurationError(f"two fits disagree on the effect '{label}'; {TAKE_ONE}")
        whole = type(robot)(
            with_effects(base, {**theirs.effects, **mine.effects}), self.dynamics, base, robot.file
        )
        return whole.with_parameters({**mine.numbers, **values})


def _agreed(robot: Robot, values: Mapping[str, float], began: Mapping[str, float]) -> dict[str, float]:
    """Return a fit's values; ConfigurationError where the robot has others already, from another fit.

    It may have those that the fit began with: then the fit goes on from it.
    """
    base = robot.base or robot.description
    filed = {name: row.value for name, row in named_parameters(base).items()}
    rows = []
    for name, value in values.items():
        if name not in robot.layout:
            continue  # an effect's that the model adds, or told where it is put in
        here = robot.parameter(name)
        if not any(math.isclose(here, known) for known in (value, began[name], filed.get(name, here))):
            rows.append(f"{name} ({here:.6g} in the robot, {value:.6g} in the fit)")
    if rows:
        more = f" and {len(rows) - 1} more" if len(rows) > 1 else ""
        raise ConfigurationError(f"two fits disagree on {rows[0]}{more}; {TAKE_ONE}")
    return dict(values)
