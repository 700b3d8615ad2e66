"""What a user gets of a model: how well a plant follows with its torque fed forward, and where it says the tool is.

Motions are periodic, there and back with rests, so that nothing has a beginning: everything is run for some periods and
the last one counts. A model's torque is that of the wanted motor motion prescribed to it, elastic joints and laws
included, as a drive would have to be commanded for it; where the tool is follows from the measured motor motion
prescribed to it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from robid_core import ComplexArray, FloatArray, Robot
from robid_core.estimation.torque.periodic import PeriodicMotion, periodic_motion_of
from robid_core.estimation.torque.spectra import MOTION_BAND_HZ
from robid_core.mechanics import Simulation, periodic_motion
from robid_core.mechanics.tool import pose_of
from robid_core.residual.signals import commanded_torque, true_motion

PERIODS = 3  # the first two settle
SMOOTH = (0.0,) * 6 + (462.0, -1980.0, 3465.0, -3080.0, 1386.0, -252.0)
"""Coefficients of a polynomial from 0 to 1 whose first five derivatives vanish at both ends."""


@dataclass(frozen=True)
class Move:
    """From one pose to another and back."""

    start: tuple[float, ...]
    """Joint-side motor angles, rad."""
    end: tuple[float, ...]
    duration_s: float
    """Of one way."""
    dwell_s: float = 0.5
    """At either end."""

    def motor_angle(self, robot: Robot) -> FloatArray:
        """One period at the sampling instants, rad, (n_sample, n_axis)."""
        way, dwell = (round(one / robot.sample_time_s) for one in (self.duration_s, self.dwell_s))
        sample = np.arange(2 * (way + dwell))
        there, back = (
            np.polynomial.polynomial.polyval(np.clip((sample - first) / way, 0, 1), SMOOTH)
            for first in (dwell // 2, dwell // 2 + way + dwell)
        )
        return robot.motor_angle(self.start + np.subtract(self.end, self.start) * (there - back)[:, None])


@dataclass(frozen=True, eq=False)
class Followed:
    """One period of a plant that follows a motion."""

    measured: FloatArray
    """Motor angles as the sensors show them, rad, (n_sample, n_axis)."""
    motor: FloatArray
    """As they are, likewise."""
    tool: FloatArray
    """World axes, m, (n_sample, 3)."""


def computed_torque(model: Robot, wanted: FloatArray) -> FloatArray:
    """Torques to be commanded, N m, so that the motors of a model move as wanted, rad, (n_sample, n_axis) both.

    Each is held from its sample to the next; laws on the motor torque are undone.
    """
    motion = _measured_motion(model, wanted)

    def held(omega: FloatArray) -> ComplexArray:
        return motion.mean_share(omega, model.step_s)[:, None]

    acting = motion.divided(_prescribed(model, motion).torque[None, :, -len(wanted) :], held)
    commanded: FloatArray = commanded_torque(model, replace(motion, torque=acting))[0, 0]
    return commanded


def followed(
    plant: Robot, wanted: FloatArray, torque: FloatArray | None, point: Sequence[float], seed: int
) -> Followed:
    """Motion of a plant under its own controller.

    Parameters
    ----------
    plant
        With the noise of its sensors.
    wanted
        Motor angles, one period, rad, (n_sample, n_axis).
    torque
        That is fed forward, N m, likewise; None: what holds the arm at the start, and no more.
    point
        Of the last body that is the tool, in its frame, m, (3,).
    seed
        Of the noise.
    """
    reference = np.tile(wanted, (PERIODS, 1))
    start = plant.joint_angle(wanted[:1])
    held = plant.gravity_torque(start)  # by the simulated drive, from the start
    forward = np.zeros_like(reference) if torque is None else np.tile(torque - held, (PERIODS, 1))
    run = plant.simulate(
        (np.diff(reference, axis=0, prepend=reference[:1]) / plant.sample_time_s)[None],
        start,
        seed,
        position_reference=reference[None],
        torque_feedforward=forward[None],
        keep_coordinates=True,
    )
    assert run.coordinates is not None
    last = slice(-len(wanted), None)
    motor = run.coordinates[0, last, : plant.n_axis]
    return Followed(run.position[0, last], motor, _tool(plant, run, point)[last])


def tool_along(model: Robot, measured: FloatArray, point: Sequence[float]) -> FloatArray:
    """Where a model says that the tool is while motors move as measured, world axes, m, (n_sample, 3).

    Parameters
    ----------
    model
        Of the robot.
    measured
        Motor angles, one period, rad, (n_sample, n_axis).
    point
        Of the last body, in its frame, m, (3,).
    """
    run = _prescribed(model, _measured_motion(model, measured))
    return _tool(model, run, point)[-len(measured) :]


def _measured_motion(model: Robot, angle: FloatArray) -> PeriodicMotion:
    """One period, without what laws on measured angles make of it."""
    position = angle[None, None, None, None]
    none = np.zeros(0, dtype=np.int64)
    motion = periodic_motion_of(position, np.zeros_like(position), model.sample_time_s, none, MOTION_BAND_HZ)
    return true_motion(model, motion)


def _prescribed(model: Robot, motion: PeriodicMotion) -> Simulation:
    """All periods of a motion of the motors, prescribed to a model."""
    one = periodic_motion(motion.angle[0], model.sample_time_s, model.step_s, MOTION_BAND_HZ)
    several = replace(one, acceleration=np.tile(one.acceleration, (1, PERIODS, 1)))
    return model.prescribe(several, keep_coordinates=True)


def _tool(robot: Robot, run: Simulation, point: Sequence[float]) -> FloatArray:
    """Place of the tool at all samples of the first lane, m, (n_sample, 3)."""
    assert run.coordinates is not None
    joint = run.coordinates[0] @ robot.mechanism.constraint_map.T
    return pose_of(robot.chain, joint, robot.description.bodies[-1].joint, point).position
