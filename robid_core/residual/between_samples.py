"""Friction between the samples: what a held torque does to the speed there, and what samples do not resolve of it.

Motion through the samples is band-limited. A held torque, which jumps at them, and friction that jumps where the speed
turns put on it what lies above half the sampling rate. Motors move alone there: acceleration is torque over inertia.
One step of that from the band-limited speed is enough where a motor follows its friction slowly (``J / F'``: samples).
Where friction is sharp and the motor light, it follows within one: an explicit step then overshoots, an implicit one
hardly moves, and by how much their friction torques differ is what these samples do not resolve.

What brakes the motors there is taken at a speed without the noise of the angles: what stands above it is motion. So
are laws of one shape. Free functions of the speed take the noisy one of a motion that repeats, whose periods take noise
off; of one that does not an axis that is slow, or about to rest, would rattle within the speed at which friction turns.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robid_core.arrays import ComplexArray, FloatArray
from robid_core.estimation.torque.spectra import (
    SMALLEST,
    SPEED_BAND,
    MotionSpectra,
    friction_spectra,
    speed_between_samples,
    speed_without_noise,
)
from robid_core.estimation.torque.speed_functions import SpeedFunctions
from robid_core.residual.motor_laws import MotorLaws
from robid_core.robot import Robot

SPARSE = 25  # every so many speeds tell what friction brakes
HARMFUL = 0.2  # of the speed within which friction turns: noise of a speed that widens it
FOLLOWED = 0.5  # of a sample, over J / F': below one a step is nearly explicit, above nearly implicit


def friction_between_samples(
    robot: Robot,
    motion: MotionSpectra,
    laws: SpeedFunctions,
    angle: FloatArray,
    coefficient: FloatArray,
    on_motors: Sequence[MotorLaws] = (),
) -> tuple[ComplexArray, ComplexArray, tuple[MotorLaws, ...]]:
    """Spectra of the functions of speed, what samples do not resolve of friction, and effects on motors there.

    Shapes (n_law + 1, n_config, n_exp, n_bin, n_axis) and (n_config, n_exp, n_bin, n_axis), N m.

    Parameters
    ----------
    robot
        Whose motors move alone above half the sampling rate.
    motion, laws
        The measured motion and functions of its speed.
    angle
        Of the joints, about which motors weigh what they do, rad, (n_config, n_axis).
    coefficient
        Of the functions and of a constant, N m, (n_law + 1, n_axis).
    on_motors
        Effects that brake motors besides, of each configuration; none: there are none.
    """
    n = robot.n_axis
    mobility = np.linalg.inv(robot.second_order(angle).mass)[:, :n, :n]
    few = motion.rate(1)[:, :, ::SPARSE].reshape(-1, n)
    size = laws.braking(coefficient[: len(laws.odd)], few)
    noise = _harmful(motion, laws, size, on_motors)
    friction, unresolved, between = [], [], []
    for c in range(len(angle)):
        own = motion.of_configuration(c)
        speed, repeats = own.fine_speed(), own.settling > 0
        quiet = speed_without_noise(speed, motion.angle_noise if repeats else noise, own.sample_time_s)
        seen = speed if repeats else quiet
        pushing = own.fine_torque() - coefficient[-1]
        braking, slope = laws.total_and_slope(quiet.astype(np.float32), size)
        if on_motors:
            more, steeper = on_motors[c].at(quiet).braking()
            braking, slope = braking + more, slope + steeper
        acceleration = np.matmul(pushing - braking, mobility[c])
        follows = FOLLOWED * own.sample_time_s * mobility[c].diagonal() * slope
        explicit = speed_between_samples(
            speed, acceleration, noise, own.sample_time_s, None if repeats else quiet
        )
        implicit = _follow(seen, explicit, follows)
        functions = friction_spectra(own, laws, implicit)
        overshot = own.held_spectrum(laws.total(explicit.astype(np.float32), size))
        friction.append(functions)
        unresolved.append(overshot - np.einsum("kceba,ka->ceba", functions[: len(size)], size))
        if on_motors:
            between.append(on_motors[c].at(_of_laws(own, quiet, acceleration, follows) if repeats else quiet))
            at_end, at_once = (on_motors[c].at(one).braking()[0] for one in (implicit, explicit))
            unresolved[-1] += own.held_spectrum(at_once - at_end)
    return np.concatenate(friction, axis=1), np.concatenate(unresolved), tuple(between)


def _follow(seen: FloatArray, explicit: FloatArray, follows: FloatArray) -> FloatArray:
    """Speed at the end of an implicit step, from where an explicit one ends, rad/s; `follows`: in such steps."""
    speed: FloatArray = seen + (explicit - seen) / (1.0 + follows**2 / (1.0 + follows))
    return speed


def _of_laws(
    motion: MotionSpectra, quiet: FloatArray, acceleration: FloatArray, follows: FloatArray
) -> FloatArray:
    """Speed that laws of one shape see in a motion that repeats, rad/s: without any noise of its angles.

    Noise widens what is sharp. Free functions of other widths make up for that; a law takes a wrong width and size.
    """
    speed = motion.fine_speed()
    explicit = speed_between_samples(speed, acceleration, motion.angle_noise, motion.sample_time_s, quiet)
    return _follow(quiet, explicit, follows)


def _harmful(
    motion: MotionSpectra, laws: SpeedFunctions, size: FloatArray, on_motors: Sequence[MotorLaws]
) -> FloatArray:
    """Variance of the angles, rad^2, (n_axis,), as far as it matters: less where friction turns slowly.

    What replaces a noisy speed errs where friction does; noise alone widens what is sharp, with the square of their
    ratio, and else errs by chance.
    """
    _, steepest = laws.total_and_slope(np.zeros((1, size.shape[1])), size)
    sharpness = steepest[0] / np.maximum(size.sum(axis=0), SMALLEST)
    for own in on_motors:
        level, slope = own.turning()
        sharpness = np.maximum(sharpness, slope / np.maximum(level, SMALLEST))
    band = 2 * np.pi * SPEED_BAND / motion.sample_time_s
    speed_noise = motion.angle_noise * band**2 * 2 * SPEED_BAND / 3
    ratio = speed_noise * sharpness**2
    harmful: FloatArray = motion.angle_noise * ratio / (ratio + HARMFUL**2)
    return harmful
