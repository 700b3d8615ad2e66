"""Laws on signals in a measured motion: what the motors did, what acted on them, and how a parameter changes either.

A law on angles or on reported torques is taken off the record, ``x = L^-1(measured)``, by steps of Newton's method with
the law's gain as the derivative; a law on the commanded torque is evaluated along the motion, between the samples.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from robid_core.arrays import ComplexArray, FloatArray
from robid_core.effect import SignalEffect
from robid_core.errors import DataRejected
from robid_core.estimation.torque.spectra import MotionSpectra
from robid_core.mechanics.law_along import signal_along
from robid_core.mechanics.terms import SignalTerm
from robid_core.parameters import FreeParameters
from robid_core.robot import Robot
from robid_core.robot.effect_columns import effect_columns
from robid_core.robot.effects import channel_gain
from robid_core.robot.forces_along import RobotMotion

M = TypeVar("M", bound=MotionSpectra)

SMALL = 1e-3  # of the unit of a coordinate: steps along which the torque that a motor adds is linear
ROUNDS = 8  # of Newton's method at most
EXACT = 1e-12  # of a signal's range: what is left of it when a law counts as taken off
STUCK = 0.5  # of what a round began with: laws with steps (quantisation) leave that much in the end


@dataclass(frozen=True, eq=False)
class SignalColumn:
    """Derivative of the predicted torque for a parameter of a law on signals."""

    index: int
    """Number of the parameter among the free ones."""
    torque: ComplexArray
    """Shape (n_config, n_exp, n_bin, n_axis)."""


def true_motion(robot: Robot, recorded: M) -> M:
    """Return a record without what laws on measured angles and reported torques make of it.

    Raises DataRejected where a law cannot be taken off.
    """
    channels = {term.channel for term in robot.signals}
    motion = recorded
    if "position" in channels:
        motion = motion.with_signals(_taken_off(robot, "position", motion, recorded.angle), motion.torque)
    if "torque_measurement" in channels:
        torque = _taken_off(robot, "torque_measurement", motion, recorded.torque)
        motion = motion.with_signals(motion.angle, torque)
    return motion


def added_torque(robot: Robot, motion: MotionSpectra) -> ComplexArray:
    """Spectra of what laws on the motor torque add to the commanded one, (n_config, n_exp, n_bin, n_axis)."""
    if all(term.channel != "torque" for term in robot.signals):
        return np.zeros_like(motion.torque_spectrum)
    angle, speed, torque = _within_steps(robot, motion)
    acting = _heard(robot, "torque", torque, angle, speed, robot.step_s, _steps(robot) * motion.settling)
    return _of_steps(robot, motion, acting - torque)


def commanded_torque(robot: Robot, motion: MotionSpectra) -> FloatArray:
    """Return the held torques of which the laws on motor torques make those that act, `motion.torque`; same shape.

    Where a law cannot be undone (a limit) what comes nearest.
    """
    acting = commanded = motion.torque
    if all(term.channel != "torque" for term in robot.signals):
        return acting
    angle, speed, _ = _within_steps(robot, motion)
    n, before = _steps(robot), np.inf
    for _ in range(ROUNDS):
        given = replace(motion, torque=commanded).torque_between(n, 0.5 * robot.step_s)
        heard = _heard(robot, "torque", given, angle, speed, robot.step_s, n * motion.settling)
        off = acting - _at_samples(heard, n, motion)
        left = float(np.sqrt((off**2).mean()))
        if left <= EXACT * np.ptp(acting) or left > STUCK * before:
            break
        commanded, before = commanded + off, left
    return commanded


def reported_torque(robot: Robot, motion: MotionSpectra) -> FloatArray:
    """Return what the drives report of the commanded torques, `motion.torque`; same shape."""
    signals = motion.torque, motion.angle, motion.rate(1)
    return _heard(robot, "torque_measurement", *signals, motion.sample_time_s, motion.settling)


def signal_columns(
    free: FreeParameters,
    coordinates: FloatArray,
    robot: Robot,
    motion: MotionSpectra,
    impedance: ComplexArray,
) -> tuple[SignalColumn, ...]:
    """Return the columns of all free parameters of laws on signals.

    Parameters
    ----------
    free, coordinates
        The parameters, and where they are.
    robot
        There.
    motion
        From `true_motion`.
    impedance
        Motor torque per acceleration, shape (n_config, n_bin, n_axis, n_axis).
    """
    slopes, found = free.slopes(coordinates), list[SignalColumn]()
    for bound in robot.effects:
        if not issubclass(bound.effect, SignalEffect):
            continue
        own = [i for i, name in enumerate(free.names) if name.startswith(f"effect.{bound.label}.")]
        names, side = [free.names[i] for i in own], bound.place.side
        along = [_along(robot, names, side, motion, c) for c in range(len(motion.angle) if own else 0)]
        for i, changes in zip(own, zip(*along, strict=True), strict=True):
            where = (bound.label, bound.place.axis, side)
            torque = torque_of_change(robot, *where, slopes[i] * np.stack(changes), motion, impedance)
            found.append(SignalColumn(i, torque))
    return tuple(sorted(found, key=lambda column: column.index))


def signal_change(
    robot: Robot,
    term: SignalTerm,
    motion: MotionSpectra,
    given: tuple[FloatArray, FloatArray, FloatArray],
) -> FloatArray:
    """What one law makes of its channel in a motion, less what it was given, as `torque_of_change` takes it.

    Shape (n_config, n_exp, n_time); `given`: from `channel_signals`.
    """
    within = term.channel == "torque"
    step = robot.step_s if within else motion.sample_time_s
    settle = motion.settling * (_steps(robot) if within else 1)
    signal, angle, speed = (values.reshape(-1, values.shape[2]) for values in given)
    heard = signal_along(term, signal, angle, speed, step, settle=settle)
    change: FloatArray = heard.reshape(given[0].shape) - given[0]
    return change


def channel_signals(
    robot: Robot, motion: MotionSpectra, axis: int, side: str
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Signal of a channel, angle and speed of its motor, where its laws run, each (n_config, n_exp, n_time).

    In the middle of the steps of integration for the motor torque, at the samples else.
    """
    finer = _steps(robot) if side == "torque" else 1
    shift = 0.5 * robot.step_s if side == "torque" else 0.0
    angle, speed = (np.ascontiguousarray(motion.rate(order, finer, shift)[..., axis]) for order in (0, 1))
    signal = (
        angle if side == "position" else np.ascontiguousarray(motion.torque_between(finer, shift)[..., axis])
    )
    return signal, angle, speed


def torque_of_change(
    robot: Robot,
    label: str,
    axis: int,
    side: str,
    change: FloatArray,
    motion: MotionSpectra,
    impedance: ComplexArray,
) -> ComplexArray:
    """Derivative of the predicted torque where a law on a channel gives so much more, (n_config, n_exp, n_bin, n_axis).

    A record that shows more of what does not act counts as if the model had said so.

    Parameters
    ----------
    robot, label, axis, side
        The robot with the law, what the law is called, its axis, and its channel.
    change
        Of the signal, (n_config, n_exp, n_time): in the middle of the steps of integration where the law is on the
        motor torque, at the samples else.
    motion, impedance
        From `true_motion`; motor torque per acceleration, shape (n_config, n_bin, n_axis, n_axis).
    """
    if side == "torque":
        torque: ComplexArray = np.zeros_like(motion.torque_spectrum)
        torque[..., axis] = -_of_steps(robot, motion, change[..., None])[..., 0]
        return torque
    own = change[..., None]
    if any(term.channel == side for term in robot.signals):
        every = np.zeros_like(motion.angle)
        every[..., axis] = change
        own = motion.divided(every, lambda omega: channel_gain(robot, side, omega, label))[
            ..., axis : axis + 1
        ]
    column: ComplexArray
    if side == "position":
        column = -impedance[:, None, :, :, axis] * motion.acceleration_of(own)
    else:
        column = np.zeros_like(motion.torque_spectrum)
        column[..., axis] = motion.spectrum_of(own)[..., 0]
    if any(term.channel == "torque" for term in robot.signals):
        column -= _added_more(robot, axis, side, own[..., 0], motion)
    return column


def _added_more(
    robot: Robot, axis: int, side: str, change: FloatArray, motion: MotionSpectra
) -> ComplexArray:
    """How much more laws on the motor torque add where angles, or torques, are less by a change, per unit of it."""
    less = np.zeros_like(motion.angle)
    less[..., axis] = SMALL * change
    angle, torque = motion.angle, motion.torque
    moved = (
        motion.with_signals(angle - less, torque)
        if side == "position"
        else motion.with_signals(angle, torque - less)
    )
    more: ComplexArray = (added_torque(robot, moved) - added_torque(robot, motion)) / SMALL
    return more


def _along(
    robot: Robot, names: Sequence[str], side: str, motion: MotionSpectra, config: int
) -> list[FloatArray]:
    """Change of a signal per unit of each parameter, of one configuration, (n_exp, n_time)."""
    one = motion.of_configuration(config)
    if side == "torque":
        angle, speed, torque = _within_steps(robot, one)
        finer = _steps(robot)
    else:
        angle, speed, torque = one.angle, one.rate(1), one.torque
        finer = 1
    n, n_axis = robot.mechanism.n_coordinate, robot.n_axis
    rows = np.zeros((2, *angle.shape[1:3], n))
    rows[0, ..., :n_axis], rows[1, ..., :n_axis] = angle[0], speed[0]
    along = RobotMotion(
        rows[0], rows[1], motion.sample_time_s / finer, settle=finer * motion.settling, torque=torque[0]
    )
    return [column.values for column in effect_columns(robot, names, along)]


def _taken_off(robot: Robot, channel: str, motion: MotionSpectra, measured: FloatArray) -> FloatArray:
    """Return the signal of which the laws of a channel make the measured one."""
    step, true, before = motion.sample_time_s, measured, np.inf
    speed = motion.rate(1)
    for _ in range(ROUNDS):
        angle = true if channel == "position" else motion.angle
        off = measured - _heard(robot, channel, true, angle, speed, step, motion.settling)
        left = float(np.sqrt((off**2).mean()))
        if left <= EXACT * np.ptp(measured) or STUCK * before < left <= before:
            return true
        if left > before:
            break
        true, before = true + motion.divided(off, lambda omega: channel_gain(robot, channel, omega)), left
    else:
        return true
    labels = ", ".join(dict.fromkeys(term.label for term in robot.signals if term.channel == channel))
    raise DataRejected(
        f"effect {labels}: what was measured cannot be turned back into what was ({channel}); the law as the robot "
        "file states it is too strong for these data"
    )


def _heard(
    robot: Robot,
    channel: str,
    signal: FloatArray,
    angle: FloatArray,
    speed: FloatArray,
    step: float,
    settle: int,
) -> FloatArray:
    """What the laws of a channel make of a signal, one after another; arrays (n_config, n_exp, n_time, n_axis)."""
    result = signal.copy()
    for term in robot.signals:
        if term.channel != channel:
            continue
        result[..., term.axis] = _of_term(term, result, angle, speed, step, settle)
    return result


def _of_term(
    term: SignalTerm, signal: FloatArray, angle: FloatArray, speed: FloatArray, step: float, settle: int
) -> FloatArray:
    """What one law makes of the signal of its axis, (n_config, n_exp, n_time)."""
    heard, seen, moving = (
        np.ascontiguousarray(v[..., term.axis]).reshape(-1, v.shape[2]) for v in (signal, angle, speed)
    )
    result = signal_along(term, heard, seen, moving, step, settle=settle)
    return result.reshape(signal.shape[:3])


def _steps(robot: Robot) -> int:
    """How many steps of integration a sample has: laws on motor torques run once in each."""
    return round(robot.sample_time_s / robot.step_s)


def _within_steps(robot: Robot, motion: MotionSpectra) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Angles and speeds in the middle of the steps of integration, and the torques there."""
    n = _steps(robot)
    middle = 0.5 * robot.step_s
    angle, speed = (motion.rate(order, n, middle) for order in (0, 1))
    return angle, speed, motion.torque_between(n, middle)


def _at_samples(torque: FloatArray, n: int, motion: MotionSpectra) -> FloatArray:
    """Torques in the middle of the steps, n a sample, as those of the samples: of held ones their mean."""
    if motion.torque_hold == "zero_order_hold":
        mean: FloatArray = torque.reshape(*torque.shape[:2], -1, n, torque.shape[3]).mean(axis=3)
        return mean
    before = np.concatenate((2 * torque[:, :, :1] - torque[:, :, 1:2], torque[:, :, :-1]), axis=2)
    at_steps: FloatArray = 0.5 * (before + torque)
    return at_steps[:, :, ::n]


def _of_steps(robot: Robot, motion: MotionSpectra, torque: FloatArray) -> ComplexArray:
    """Spectrum of a torque that is constant within each step, as that of one that is held for a sample.

    What images of either do to the samples differs by 3e-4 at most (lag of a sample, bins to a tenth of the rate; by
    hand). Of a continuous torque these are the values in the middle of the steps.
    """
    within = 0.5 * motion.omega * robot.step_s
    step = np.exp(-1j * within)
    if motion.torque_hold == "zero_order_hold":
        step *= np.sinc(within / np.pi)
    spectrum: ComplexArray = step[:, None] * motion.held_spectrum(torque)
    return spectrum
