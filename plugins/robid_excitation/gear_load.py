"""Torque that the transmissions pass in a simulated motion, joint side: what loads the gears.

An elastic gear passes what its spring, its damper and the laws beside them exert at the deflection that the
simulation went through. A rigid one passes what of the motor's torque neither the rotor's acceleration nor friction
takes: ``tau = r_g^-T (u - J a - f)``.
"""

from __future__ import annotations

import numpy as np

from robid_core import FloatArray, Robot, RobotMotion, forces_along
from robid_core.mechanics import friction_torque


def gear_load(robot: Robot, coordinates: FloatArray, torque: FloatArray) -> FloatArray:
    """Torque that each transmission passes, N m (N on a prismatic axis), joint side, shape (n_lane, n_sample, n_axis).

    Friction that an effect puts on the motor of a rigid gear is not taken off: the load is overstated by it.

    Parameters
    ----------
    robot
        What was simulated, from rest.
    coordinates
        True generalised coordinates, shape (n_lane, n_sample, n_coordinate).
    torque
        Motor torques, held from each sample to the next, N m, shape (n_lane, n_sample, n_axis).
    """
    step, elastic = robot.sample_time_s, robot.mechanism.elastic_gear
    speed = np.gradient(coordinates, step, axis=1)
    load = forces_along(robot, RobotMotion(coordinates, speed, step, torque=torque), ()).load
    if not elastic.all():
        load[..., ~elastic] = rigid_load(robot, coordinates[..., : robot.n_axis], torque)[..., ~elastic]
    return load


def rigid_load(robot: Robot, motor_angle: FloatArray, torque: FloatArray) -> FloatArray:
    """What is left of motor torques for the arm, at the joints, shape (n_lane, n_sample, n_axis).

    The second difference of the angles is the acceleration averaged over the two samples around each instant, and
    so is the torque that goes with it. The first and the last instant take the load of their neighbours.
    """
    d, step = robot.drives, robot.sample_time_s
    acceleration = np.diff(motor_angle, n=2, axis=1) / step**2
    speed = (motor_angle[:, 2:] - motor_angle[:, :-2]) / (2 * step)
    friction = friction_torque(speed, d.coulomb, d.viscous, d.friction_speed) + d.friction_offset
    acting = 0.5 * (torque[:, :-2] + torque[:, 1:-1])
    passed = acting - d.rotor_inertia * acceleration - friction
    load: FloatArray = np.pad(passed @ np.linalg.inv(d.gear), ((0, 0), (1, 1), (0, 0)), mode="edge")
    return load


def load_of_motor(robot: Robot) -> FloatArray:
    """Load of each transmission where the motors together give their torque limits at rest, shape (n_axis,)."""
    limit: FloatArray = robot.drives.torque_limit @ np.abs(np.linalg.inv(robot.drives.gear))
    return limit
