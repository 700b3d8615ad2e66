"""What all laws of a robot do along a motion, recorded or predicted: force, load and state of each.

The laws run one after the other as in the simulator: what acts along a gear first, so that the others see the torque
that the whole transmission passes.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from robid_core.arrays import FloatArray, IntArray
from robid_core.errors import ConfigurationError
from robid_core.mechanics.law_along import LawRun, law_along
from robid_core.mechanics.terms import ForceTerm

if TYPE_CHECKING:
    from robid_core.robot.robot import Robot

TURNS = 60  # half of the load as friction: 1e-18
EXACT = 1e-12


@dataclass(frozen=True, eq=False)
class RobotMotion:
    """Motion of all coordinates of a robot, sampled in the middle of steps."""

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
    passed: FloatArray | None = None
    """Torque that rigid gears pass, at the motors, N m, same shape, where it is known better than from `torque`."""

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

    Examples
    --------
    >>> import numpy as np, robid_core as robid
    >>> sizes = {"coulomb": 0.2, "breakaway": 0.3}
    >>> robot = robid.Robot.load("one_axis").with_effect("rub", "friction.stribeck", "axis_1", "motor", sizes)
    >>> speed = np.linspace(-10.0, 10.0, 5)[None, :, None] * np.ones(len(robot.mechanism.coordinate_names))
    >>> motion = robid.RobotMotion(np.zeros_like(speed), speed, step=0.001)
    >>> [force.velocity.tolist() for force in robid.forces_along(robot, motion).of("rub")]
    [[[-10.0, -5.0, 0.0, 5.0, 10.0]]]
    """
    gears = np.flatnonzero(robot.mechanism.elastic_gear)
    rows = robot.mechanism.spring_directions[: len(gears)]
    stiffness, damping = (values[: len(gears)] for values in robot.spring_arrays())
    of_springs = stiffness * (motion.position @ rows.T) + damping * (motion.speed @ rows.T)
    load = _transmitted(robot, motion, gears, of_springs)
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


def _transmitted(robot: Robot, motion: RobotMotion, gears: IntArray, of_springs: FloatArray) -> FloatArray:
    """Torque that gears pass, joint side, (n_lane, n_sample, n_axis): springs theirs, rigid ones what motors leave.

    A motor leaves its torque, less what its rotor takes and what brakes it before the gear. Where that grows with the
    torque passed, both are found by turns: each turn leaves such a share of the error as the friction has of the load.
    """
    n_axis = robot.n_axis
    to_joints = np.linalg.inv(robot.drives.gear)
    rigid = np.setdiff1d(np.arange(n_axis), gears)

    def load_of(shaft: FloatArray) -> FloatArray:
        load: FloatArray = shaft @ to_joints
        load[..., gears] = of_springs
        return load

    if motion.passed is not None:
        return load_of(motion.passed)
    if motion.torque is None or not len(rigid):
        return load_of(np.full((*motion.position.shape[:2], n_axis), np.nan))
    acceleration = np.gradient(motion.speed[..., :n_axis], motion.step, axis=1)
    shaft = motion.torque - robot.drives.rotor_inertia * acceleration
    braked = [(term, term.braked_motor(n_axis)) for term in robot.forces]
    brakes = [(term, axis) for term, axis in braked if axis in rigid]
    steady = [pair for pair in brakes if not pair[0].load.any()]
    shaft -= _taken(motion, steady, load_of(shaft))
    loaded = [pair for pair in brakes if pair[0].load.any()]
    left = shaft
    for _ in range(TURNS if loaded else 0):
        before, left = left, shaft - _taken(motion, loaded, load_of(left))
        if np.abs(left - before).max() <= EXACT * np.abs(left).max():
            break
    return load_of(left)


def _taken(motion: RobotMotion, brakes: Sequence[tuple[ForceTerm, int]], load: FloatArray) -> FloatArray:
    """Torque of laws on motors, (n_lane, n_sample, n_axis)."""
    total = np.zeros_like(load)
    for term, axis in brakes:
        seen = motion.position @ term.coordinate, motion.speed @ term.coordinate
        known = np.where(term.load == 0, 0.0, load) @ term.load
        total[..., axis] += law_along(term, *seen, known, motion.step, settle=motion.settle).force
    return total
