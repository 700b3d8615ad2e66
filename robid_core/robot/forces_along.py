"""What all laws of a robot do along a motion, recorded or predicted: force, load and state of each.

The laws run one after the other as in the simulator: what acts along a gear first, so that the others see the torque
that the whole transmission passes.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from robid_core.arrays import FloatArray
from robid_core.errors import ConfigurationError
from robid_core.mechanics.law_along import LawRun, law_along
from robid_core.mechanics.terms import ForceTerm

if TYPE_CHECKING:
    from robid_core.robot.robot import Robot


@dataclass(frozen=True, eq=False)
class RobotMotion:
    """How everything of a robot moves, sampled in the middle of steps."""

    position: FloatArray
    """Generalised coordinates, shape (n_lane, n_sample, n_coordinate)."""
    speed: FloatArray
    """Their rates, same shape."""
    step: float
    """Between two samples, s."""
    settle: int = 0
    """How many samples, from the end of a periodic motion, laws with a memory are run through before its first one."""
    torque: FloatArray | None = None
    """Of the motors, N m, (n_lane, n_sample, n_axis); needed for the load of rigid gears, and for laws on signals."""

    @classmethod
    def periodic(cls, coordinates: FloatArray, sample_time: float, finer: int) -> RobotMotion:
        """Return one period of a band-limited motion, `finer` steps a sample, laws with a memory settled over a period.

        Parameters
        ----------
        coordinates
            One period of generalised coordinates, (n_lane, n_sample, n_coordinate).
        sample_time
            Of these, s.
        finer
            How many steps a sample has; the first is about the first instant.
        """
        n_sample, fine = coordinates.shape[1], finer * coordinates.shape[1]
        spectrum = finer * np.fft.rfft(coordinates, axis=1)
        omega = 2 * np.pi * np.fft.rfftfreq(n_sample, sample_time)[:, None]
        position, speed = (np.fft.irfft(s, n=fine, axis=1) for s in (spectrum, 1j * omega * spectrum))
        return cls(position, speed, sample_time / finer, settle=fine)


@dataclass(frozen=True, eq=False)
class ForceAlong:
    """One law along a motion; arrays (n_lane, n_sample)."""

    term: ForceTerm
    position: FloatArray
    """Of the coordinate that the law sees."""
    velocity: FloatArray
    load: FloatArray
    """Torque of the transmissions as the law sees it, N m."""
    run: LawRun
    """Force, slopes and state."""


@dataclass(frozen=True, eq=False)
class ForcesAlong:
    """All laws along a motion."""

    load: FloatArray
    """Torque that the transmissions pass, joint side, N m, (n_lane, n_sample, n_axis); NaN where a rigid gear's is not
    known."""
    forces: tuple[ForceAlong, ...]
    """Of those that were asked for, and along gears, in the order of `Robot.forces`."""

    def of(self, label: str) -> tuple[ForceAlong, ...]:
        """Return the laws of one effect."""
        return tuple(force for force in self.forces if force.term.label == label)


def forces_along(robot: Robot, motion: RobotMotion, labels: Collection[str] | None = None) -> ForcesAlong:
    """Run the laws that exert forces along a motion of the robot.

    Parameters
    ----------
    robot, motion
        The robot, and how it moves.
    labels
        Effects whose laws are asked for; None: all. Laws along gears are run all the same: others see their torque.

    Raises
    ------
    ConfigurationError
        Where a law asks for the load of a rigid gear and the motion has no torques.
    """
    gears = np.flatnonzero(robot.mechanism.elastic_gear)
    rows = robot.mechanism.spring_directions[: len(gears)]
    stiffness, damping = (values[: len(gears)] for values in robot.spring_arrays())
    load = _of_rigid_gears(robot, motion)
    load[..., gears] = stiffness * (motion.position @ rows.T) + damping * (motion.speed @ rows.T)
    found = []
    for term in robot.forces:
        along_gear = [g for g, row in zip(gears, rows, strict=True) if np.array_equal(term.direction, row)]
        if not along_gear and labels is not None and term.label not in labels:
            continue
        known = np.where(term.load == 0, 0.0, load) @ term.load
        if np.isnan(known).any():
            raise ConfigurationError(
                f"effect '{term.label}' asks for the load of a rigid gear: give the motion the torque of the motors"
            )
        seen = motion.position @ term.coordinate, motion.speed @ term.coordinate
        run = law_along(term, *seen, known, motion.step, settle=motion.settle)
        load[..., along_gear] += run.force[..., None]
        found.append(ForceAlong(term, *seen, known, run))
    return ForcesAlong(load, tuple(found))


def _of_rigid_gears(robot: Robot, motion: RobotMotion) -> FloatArray:
    """Torque that rigid gears would pass, joint side, (n_lane, n_sample, n_axis)."""
    if motion.torque is None:
        return np.full((*motion.position.shape[:2], robot.n_axis), np.nan)
    acceleration = np.gradient(motion.speed[..., : robot.n_axis], motion.step, axis=1)
    shaft = motion.torque - robot.drives.rotor_inertia * acceleration
    passed: FloatArray = shaft @ np.linalg.inv(robot.drives.gear)
    return passed
