"""Configurations drawn at random: where to stand when nothing is known yet, or what an optimal design picks from.

Latin hypercube (M. D. McKay, R. J. Beckman and W. J. Conover, 1979): each joint's range is cut into as many
strips as there are configurations and every strip is used once, so that a handful of poses is spread better
than independent draws. Poses that gravity loads too much are drawn again.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from pydantic import Field

from robid_core import (
    AxisKey,
    BoolArray,
    CandidateDesign,
    ConfigurationError,
    Configurations,
    Context,
    FloatArray,
    Robot,
)
from robid_design.room import Room, below_base

MOST_ROUNDS = 200
AT_ONCE = 100  # of a trial: many poses that fall are followed down in hardly more time than one


def latin_hypercube(
    count: int, lower: FloatArray, upper: FloatArray, generator: np.random.Generator
) -> FloatArray:
    """Points of which every joint has one in each of `count` strips, shape (count, n_axis)."""
    strip = np.stack([generator.permutation(count) for _ in lower], axis=1)
    share = (strip + generator.random(strip.shape)) / count
    result: FloatArray = lower + share * (upper - lower)
    return result


def draw_configurations(
    count: int,
    lower: FloatArray,
    upper: FloatArray,
    acceptable: Callable[[FloatArray], BoolArray],
    generator: np.random.Generator,
    most_rounds: int = MOST_ROUNDS,
    at_once: int = 1,
) -> FloatArray:
    """Draw configurations that are acceptable, in rounds of Latin hypercubes.

    Parameters
    ----------
    count
        How many.
    lower, upper
        Range of each joint, rad, shape (n_axis,).
    acceptable
        Tells which of (n, n_axis) configurations will do.
    generator
        Draws them.
    most_rounds
        Before it is given up.
    at_once
        Configurations of a round, at least; `count` where that is more.

    Returns
    -------
    Shape (count, n_axis), in the order of drawing.

    Raises
    ------
    ConfigurationError
        If hardly any configuration is acceptable.
    """
    found: list[FloatArray] = []
    missing, drawn, size = count, 0, max(count, at_once)
    for _ in range(most_rounds):
        points = latin_hypercube(size, lower, upper, generator)
        good = points[acceptable(points)][:missing]
        found.append(good)
        missing, drawn = missing - len(good), drawn + size
        if missing == 0:
            return np.concatenate(found)
    few = "none is" if missing == count else f"only {count - missing} are"
    asked = "" if count == 1 else f", {count} were asked for"
    raise ConfigurationError(
        f"of {drawn} configurations drawn within the limits {few} acceptable{asked}; raise gravity_share, lower the "
        "margin, or ask for less room"
    )


def random_configurations(
    robot: Robot,
    count: int,
    generator: np.random.Generator,
    margin: float = 0.05,
    gravity_share: float = 0.5,
    room: Room | None = None,
    most_rounds: int = MOST_ROUNDS,
    at_once: int = 1,
) -> FloatArray:
    """Configurations of a robot within its limits, shape (count, n_axis); see `RandomCandidates` for the rest."""
    # A joint without limits turns freely: one turn holds all of its poses.
    lower = np.where(np.isfinite(robot.drives.lower), robot.drives.lower, -np.pi)
    upper = np.where(np.isfinite(robot.drives.upper), robot.drives.upper, np.pi)
    inset = margin * (upper - lower)
    allowed = gravity_share * robot.drives.torque_limit

    def acceptable(angle: FloatArray) -> BoolArray:
        rest = robot.equilibrium(angle, partial=True)  # NaN where the arm has no stable rest
        light: BoolArray = np.all(np.abs(rest.torque) <= allowed, axis=1)
        return light if room is None else light & room.is_kept(robot, rest.joint)

    return draw_configurations(
        count, lower + inset, upper - inset, acceptable, generator, most_rounds, at_once
    )


class RandomCandidates(CandidateDesign):
    """Random configurations within the joint limits with a margin, in which the motors can hold the arm.

    where: {use: design.candidates, with: {count: 4}}
    """

    count: int = Field(gt=0, le=100_000)
    """Number of configurations."""
    margin: float = Field(default=0.05, ge=0, lt=0.5)
    """Share of each joint's range that is left free at either end, for the motion about the configuration."""
    gravity_share: float = Field(default=0.5, gt=0, le=1)
    """Largest share of a motor's torque limit that holding the arm may take."""
    room: Room | None = None
    """Floor and links that are kept clear of; null: none is looked at."""

    def problems_with(self, robot: Robot) -> dict[tuple[str | int, ...], str]:
        """A room, or a share of the torque, that leaves hardly any configuration.

        A run gives up where less than one of `MOST_ROUNDS` is acceptable; that none of ten times as many is, has a
        chance of 5e-5 then.
        """
        if robot.left_out(self.needs_of_axes()):
            return {}  # told as such
        trial, told = np.random.default_rng(0), (self.margin, self.gravity_share, self.room)
        try:
            random_configurations(robot, 1, trial, *told, 10 * MOST_ROUNDS // AT_ONCE, AT_ONCE)
        except ConfigurationError as error:
            return {("room",) if self.room is not None else ("gravity_share",): str(error)}
        return {}

    def needs_of_axes(self) -> tuple[AxisKey, ...]:
        """Torque limits: what is heavy is measured against them."""
        return ("torque_limit",)

    def run(self, robot: Robot, context: Context) -> Configurations:
        """Draw the configurations."""
        told = self.margin, self.gravity_share, self.room
        angle = random_configurations(robot, self.count, context.generator, *told)
        if (self.room is None or self.room.floor_m is None) and (low := below_base(robot, angle)):
            context.log.warning("%s", low)
        return Configurations(robot.axis_names, angle)
