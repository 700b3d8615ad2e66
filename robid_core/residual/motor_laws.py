"""Effects that brake a motor by its own speed, along a measured motion: friction beside the functions of speed.

They do nothing to the arm where the motors' motion is prescribed, so that prescribed motions leave them out. What a
held torque and friction itself do to the speed between the samples, they feel as functions of speed do: a sign that
turns within a sample turns elsewhere.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from robid_core.arrays import ComplexArray, FloatArray
from robid_core.estimation.torque.periodic import PeriodicMotion
from robid_core.estimation.torque.spectra import FINER, MotionSpectra
from robid_core.mechanics import ForceTerm
from robid_core.mechanics.law_along import law_along
from robid_core.mechanics.static_laws import viscous_damping
from robid_core.robot import Robot
from robid_core.robot.forces_along import RobotMotion, forces_along

Terms = tuple[tuple[ForceTerm, int], ...]


@dataclass(frozen=True, eq=False)
class MotorLaws:
    """Effects of `motor_terms` along one configuration."""

    terms: Terms
    """Each with the axis of its motor."""
    position: FloatArray
    """Of the motors on the finer grid, rad, (1, n_exp, n_fine, n_axis)."""
    speed: FloatArray
    """rad/s, likewise."""
    load: tuple[FloatArray, ...]
    """Torque of the transmissions as each law weighs it, N m, (1, n_exp, n_fine)."""

    def at(self, speed: FloatArray) -> MotorLaws:
        """Return the same at other speeds, rad/s, on the finer grid or at the samples."""
        every = self.speed.shape[2] // speed.shape[2]
        loads = tuple(load[..., ::every] for load in self.load)
        return replace(
            self, position=self.position[:, :, ::every], speed=speed.astype(np.float64), load=loads
        )

    def of_robot(self, robot: Robot) -> MotorLaws:
        """Return the laws of a robot with other numbers along the same motion."""
        return replace(self, terms=motor_terms(robot))

    def braking(self) -> tuple[FloatArray, FloatArray]:
        """Torque, N m, and its slope by the speed, N m s/rad, shape of `speed`."""
        torque, slope = np.zeros(self.speed.shape), np.zeros(self.speed.shape)
        lanes, shape = (self.speed.shape[1], self.speed.shape[2]), self.speed.shape[:3]
        for (term, axis), load in zip(self.terms, self.load, strict=True):
            position, speed = self.position[..., axis].reshape(lanes), self.speed[..., axis].reshape(lanes)
            run = law_along(term, position, speed, load.reshape(lanes), 0.0)
            torque[..., axis] += run.force.reshape(shape)
            slope[..., axis] += run.slope_velocity.reshape(shape)
        return torque, slope

    def turning(self) -> tuple[FloatArray, FloatArray]:
        """Level of the torque, N m, and mean slope at speed zero, N m s/rad, (n_axis,) each."""
        torque, _ = self.braking()
        _, slope = self.at(np.zeros_like(self.speed)).braking()
        level: FloatArray = np.sqrt((torque**2).mean(axis=(0, 1, 2)))
        return level, slope.mean(axis=(0, 1, 2))


def motor_terms(robot: Robot) -> Terms:
    """Laws of the effects of `motor_effects`, and which motor each brakes."""
    labels, n_axis = motor_effects(robot), robot.n_axis
    return tuple((term, term.braked_motor(n_axis)) for term in robot.forces if term.label in labels)


def motor_effects(robot: Robot) -> tuple[str, ...]:
    """Labels of effects without a memory that brake motors alone, and see no other motion than that of their motor."""
    of_motors: dict[str, bool] = {}
    for term in robot.forces:
        if term.label in robot.structure.effects:
            axis = term.braked_motor(robot.n_axis)
            own = axis >= 0 and np.flatnonzero(term.coordinate).tolist() == [axis] and term.n_state == 0
            of_motors[term.label] = own and of_motors.get(term.label, True)
    return tuple(label for label, own in of_motors.items() if own)


def motor_laws(
    robot: Robot, motion: MotionSpectra, coordinates: Callable[[Robot], FloatArray]
) -> tuple[MotorLaws, ...]:
    """Return the laws of a robot along each configuration, at band-limited speeds; none where there are none.

    `coordinates`: those of the robot in the prescribed motion, at the samples, (n_lane, n_sample, n_coordinate).
    """
    terms = motor_terms(robot)
    if not terms:
        return ()
    n_config, n_exp, n_sample, _ = motion.angle.shape
    loaded = any(term.load.any() for term, _ in terms)
    moved = coordinates(robot).reshape(n_config, n_exp, n_sample, -1) if loaded else None
    found = []
    for c in range(n_config):
        own = motion.of_configuration(c)
        position, speed = own.rate(0, FINER), own.fine_speed()
        loads = np.zeros(position.shape[1:])
        if moved is not None:
            loads = forces_along(robot, motion_between(own, moved[c], FINER), ()).load
        weighed = tuple((np.where(term.load == 0, 0.0, loads) @ term.load)[None] for term, _ in terms)
        found.append(MotorLaws(terms, position, speed, weighed))
    return tuple(found)


def renewed(
    laws: tuple[MotorLaws, ...],
    robot: Robot,
    motion: MotionSpectra,
    coordinates: Callable[[Robot], FloatArray],
) -> tuple[MotorLaws, ...]:
    """Return the laws of a robot at the speeds that others were at; as `motor_laws` does where there are none."""
    return tuple(own.of_robot(robot) for own in laws) or motor_laws(robot, motion, coordinates)


def braking_torque(laws: Sequence[MotorLaws], motion: MotionSpectra) -> ComplexArray:
    """Spectra of the laws' torque, (n_config, n_exp, n_bin, n_axis)."""
    if not laws:
        return np.zeros_like(motion.torque_spectrum)
    parts = (motion.of_configuration(c).held_spectrum(own.braking()[0]) for c, own in enumerate(laws))
    return np.concatenate(list(parts))


def braking_beside(
    laws: Sequence[MotorLaws],
    robot: Robot,
    motion: MotionSpectra,
    linear_torque: Callable[[Robot], ComplexArray],
) -> ComplexArray:
    """Likewise, less what a robot's linear model has of them: `linear_torque` gives that of a robot."""
    torque = braking_torque(laws, motion)
    if laws and viscous_of_motors(robot).any():
        torque += linear_torque(robot.without_effect(*motor_effects(robot))) - linear_torque(robot)
    return torque


def viscous_of_motors(robot: Robot) -> FloatArray:
    """What of these effects is viscous, and therefore in the linear model, N m s/rad, (n_axis,)."""
    rest = np.zeros((1, robot.mechanism.n_coordinate))
    terms = [term for term, _ in motor_terms(robot)]
    found: FloatArray = viscous_damping(terms, rest)[0].diagonal()[: robot.n_axis]
    return found


def motion_between(motion: MotionSpectra, coordinates: FloatArray, finer: int) -> RobotMotion:
    """Return all coordinates between the samples, and the torques of the motors, one lane an experiment.

    `coordinates`: at the samples, (n_lane, n_sample, n_coordinate).
    """
    torque = motion.torque_between(finer)
    torque = torque.reshape(-1, *torque.shape[2:])
    step = motion.sample_time_s
    if isinstance(motion, PeriodicMotion):
        moved = RobotMotion.periodic(coordinates, step, finer)
        return RobotMotion(moved.position, moved.speed, moved.step, moved.settle, torque)
    spline = scipy.interpolate.CubicSpline(np.arange(coordinates.shape[1]), coordinates, axis=1)
    between = np.arange(finer * coordinates.shape[1]) / finer
    return RobotMotion(spline(between), spline(between, 1) / step, step / finer, 0, torque)
