"""Variants in a diagnosis: robots that share springs, friction and whatever is found, and carry other loads.

What a variant carries was told as an effect on a body (`load.payload`), and may be told wrong: its mass and place are
unknowns of that variant alone, believed as far as scales and rulers go. So a small error bends nothing else, and a
large one is told as a wrong value.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from robid_core import ConfigurationError, FreeParameters, Robot, StructureEffect
from robid_core.residual import effect_class

MASS = 0.01  # of itself: what a scale promises
PLACE_M = 0.005  # likewise, a ruler


@dataclass(frozen=True, eq=False)
class Variants:
    """The nominal robot, and the robots of the other variants by name."""

    nominal: Robot
    told: Mapping[str, Robot]

    @cached_property
    def robots(self) -> Mapping[str, Robot]:
        """The others, with labels that mean one thing in all robots."""
        found = dict[str, Robot]()
        meant = dict(self.nominal.description.effects)
        for variant, robot in self.told.items():
            self._check(variant, robot)
            for label, entry in robot.description.effects.items():
                name = label if meant.get(label, entry) == entry else f"{label}_{_word(variant)}"
                meant[name] = entry
                if name != label:
                    robot = robot.without_effect(label).with_effect(
                        name, entry.use, entry.on, entry.side, entry.with_
                    )
            found[variant] = robot
        return found

    @cached_property
    def whole(self) -> Robot:
        """The nominal robot with the loads of all: no robot that was measured, but it has every unknown."""
        robot = self.nominal
        for other in self.robots.values():
            for label, entry in other.description.effects.items():
                if _is_load(entry.use) and label not in robot.description.effects:
                    robot = robot.with_effect(label, entry.use, entry.on, entry.side, entry.with_)
        return robot

    @cached_property
    def loads(self) -> tuple[str, ...]:
        """Labels of what hangs on bodies of some of the robots only."""
        every = (self.nominal, *self.robots.values())
        return tuple(
            label
            for label, entry in self.whole.description.effects.items()
            if _is_load(entry.use) and any(label not in robot.description.effects for robot in every)
        )

    @cached_property
    def priors(self) -> Mapping[str, float]:
        """Unknowns of the loads, `effect.<label>.<name>`, with what is believed of them, in natural scales."""
        believed = dict[str, float]()
        for label in self.loads:
            for row in effect_class(self.whole.description.effects[label].use).parameters:
                name = f"effect.{label}.{row.name}"
                value = self.whole.parameter(name)
                if row.unit == "kg" and value:
                    believed[name] = MASS * abs(value)
                elif row.unit == "m" and row.lower < value < row.upper:
                    believed[name] = PLACE_M
        free = FreeParameters.of_robot(self.whole, tuple(believed))
        natural = np.array(list(believed.values())) / np.abs(free.slopes(np.zeros(len(believed))))
        return dict(zip(believed, natural.tolist(), strict=True))

    def robot_of(self, variant: str) -> Robot:
        """The robot under which a variant was measured."""
        return self.robots.get(variant, self.nominal)

    def _check(self, variant: str, robot: Robot) -> None:
        """Refuse a robot that has other axes, or moves otherwise."""
        nominal = self.nominal
        if robot.axis_names != nominal.axis_names:
            raise ConfigurationError(
                f"robots: {variant}: {robot.name} has other axes than {nominal.name}; give it `base: {nominal.name}`"
            )
        if robot.mechanism.n_coordinate != nominal.mechanism.n_coordinate:
            raise ConfigurationError(
                f"robots: {variant}: {robot.name} has other elastic coordinates than {nominal.name}; "
                "diagnose it separately"
            )


def _is_load(use: str) -> bool:
    """Whether an effect hangs something on a body."""
    effect = effect_class(use)
    return issubclass(effect, StructureEffect) and effect.places[0] == "body"


def _word(variant: str) -> str:
    """A variant's name as a label may have it."""
    return "".join(letter if letter.isalnum() else "_" for letter in variant)
