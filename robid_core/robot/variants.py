"""A robot with one thing more or less: an effect, or friction."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, cast

import numpy as np
import numpy.typing as npt
from pydantic import TypeAdapter, ValidationError

from robid_core.errors import ConfigurationError
from robid_core.robot.file.description import EffectEntry
from robid_core.robot.file.part import Identifier
from robid_core.robot.file.wording import reason
from robid_core.robot.inheritance import inherited_beside
from robid_core.yaml_file.problems import suggestion

if TYPE_CHECKING:
    from robid_core.robot.robot import Robot

FRICTION = "friction."  # how the names of effects begin that are friction

_ENTRIES = TypeAdapter(dict[Identifier, EffectEntry])


class Variants:
    """Robots that differ from a `Robot`; a part of that class, in a file of its own."""

    @property
    def _robot(self) -> Robot:
        return cast("Robot", self)

    def with_effect(
        self,
        label: str,
        use: str,
        on: str | None = None,
        side: str | None = None,
        values: Mapping[str, float] | None = None,
    ) -> Robot:
        """Return the robot with an effect more, as a robot file says it.

        Parameters
        ----------
        label
            What it is called: its parameters are `effect.<label>.<name>`.
        use
            Name of the effect's plugin.
        on
            Axis, bearing or body on which it acts, or base; None: where the effect has only one place.
        side
            Side or channel; None: the effect's own.
        values
            Of its parameters; what is not named has the effect's default.

        Raises
        ------
        ConfigurationError
            Where the label is taken, or the effect cannot be there or have these values; the message says why.
        """
        robot = self._robot
        given = robot.description.effects
        if label in given:
            raise ConfigurationError(
                f"{robot.name} has an effect '{label}' ({given[label].use}) already; choose another label"
            )
        entry = {"use": use, "on": on, "side": side, "with": dict(values or {})}
        try:
            added = _ENTRIES.validate_python({label: entry})
        except ValidationError as error:
            first = error.errors()[0]
            place = ".".join(str(part) for part in first["loc"])
            raise ConfigurationError(f"{robot.name}: effects.{place}: {reason(first)}") from error
        changed = _with_effects(robot, {**given, **added})
        _ = changed.effects  # what cannot be is told now
        return changed

    def without_effect(self, *labels: str) -> Robot:
        """Return the robot without some of its effects.

        Raises ConfigurationError for a label that this robot does not have.
        """
        robot = self._robot
        given = robot.description.effects
        for label in labels:
            if label not in given:
                raise ConfigurationError(
                    f"{robot.name} has no effect '{label}'; {suggestion(label, given, 'it has')}"
                )
        return _with_effects(robot, {name: entry for name, entry in given.items() if name not in labels})

    def without_friction(self, damping: npt.ArrayLike | None = None) -> Robot:
        """Return the robot with viscous damping of its motors in place of all friction, effects of it included.

        Parameters
        ----------
        damping
            N m s/rad, shape (n_axis,); None: the viscous friction under `axes`.
        """
        robot = self._robot
        rubbing = [
            label for label, entry in robot.description.effects.items() if entry.use.startswith(FRICTION)
        ]
        viscous = np.asarray(robot.drives.viscous if damping is None else damping, dtype=np.float64)
        values: dict[str, float] = {}
        for name, coefficient in zip(robot.axis_names, viscous.tolist(), strict=True):
            values |= {f"friction.{name}.coulomb": 0.0, f"friction.{name}.offset": 0.0}
            values[f"friction.{name}.viscous"] = coefficient
        return self.without_effect(*rubbing).with_parameters(values)


def _with_effects(robot: Robot, effects: dict[str, EffectEntry]) -> Robot:
    changed = replace(robot, description=robot.description.model_copy(update={"effects": effects}))
    changed.__dict__.update(inherited_beside(robot, changed.description))
    return changed
