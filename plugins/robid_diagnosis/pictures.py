"""One picture of a cause: what it leaves together with what it does, over the variable in which its law lives.

Mean torques over parts of the variable that hold equally many samples (a component-plus-residual plot): where the law
is right, dots follow its line.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from robid_core import ComplexArray, FloatArray, ForceEffect, SignalEffect
from robid_core.residual import BoundEffect, EffectTorque
from robid_diagnosis.columns import Motion
from robid_diagnosis.hypothesis import Addition, Fitted

PARTS = 48
BY_DEFLECTION, BY_POSITION = "transmission.", "load."  # effects
BY_LOAD = "load_"  # parameters of laws that grow with the load


@dataclass(frozen=True, eq=False)
class Picture:
    """Mean torques, N m, (n_part,), over a variable: of one motor, or at the joint for a law that acts there."""

    variable: str
    abscissa: FloatArray
    residual: FloatArray
    explained: FloatArray


def picture_of(fitted: Fitted, addition: Addition) -> Picture:
    """Return the picture of an effect in a fitted robot."""
    motion = Motion(fitted.problem, fitted.point, fitted.about.weights)
    residuals = fitted.problem.counted_residuals(fitted.point)
    bound = next((one for one in motion.robot.effects if one.label == addition.label), None)
    if bound is None:
        return _over_frequency(motion, residuals, addition)
    abscissa, left, done = [], [], []
    for one, residual in zip(motion.along, residuals, strict=True):
        name, values, way = _variable(one, addition, bound)
        abscissa.append(values.ravel())
        rest, law = (
            _at_joint(one, residual, bound)
            if _is_felt_dynamically(bound)
            else _at_motor(one, residual, bound)
        )
        left.append((way * rest).ravel())
        done.append((way * law).ravel())
    x, law = np.concatenate(abscissa), np.concatenate(done)
    order = np.array_split(np.argsort(x), PARTS)
    means = (
        np.array([values[part].mean() for part in order]) for values in (x, np.concatenate(left) + law, law)
    )
    return Picture(name, *means)


def _is_felt_dynamically(bound: BoundEffect) -> bool:
    """Whether a law acts beyond the motor, which feels of it what the arm makes of it: nothing at low frequencies."""
    return issubclass(bound.effect, ForceEffect) and bound.place.side != "motor"


def _at_motor(one: EffectTorque, residual: ComplexArray, bound: BoundEffect) -> tuple[FloatArray, FloatArray]:
    """What is left and what a law does, as torques of the motor, N m, (n_config, n_exp, n_time) each."""
    spectra = residual, one.of_effect(bound)
    left, law = (one.motion.over_time(spectrum)[..., bound.place.axis] for spectrum in spectra)
    return left, law


def _at_joint(one: EffectTorque, residual: ComplexArray, bound: BoundEffect) -> tuple[FloatArray, FloatArray]:
    """Likewise where the law acts; what is left, of the bins in which the motor feels such a torque."""
    shape = one.motion.angle.shape[:3]
    (direction, force), *_ = one.forces_of(bound)
    finer = force.shape[1] // shape[2]
    left = one.motion.over_time(one.force_behind(residual, direction, bound.place.axis))[..., 0]
    return left, force[:, ::finer].reshape(shape)


def _of_one_length(spectra: Sequence[ComplexArray]) -> list[ComplexArray]:
    return [one for one in spectra if one.shape[2] == spectra[0].shape[2]]


def _over_frequency(motion: Motion, residuals: Sequence[ComplexArray], addition: Addition) -> Picture:
    """Amplitudes of a change of the robot itself, at the motor that feels it most; blocks of other lengths left out."""
    done = [-one.of_structure(one.robot.without_effect(addition.label)) for one in motion.along]
    law, left = (
        np.concatenate([one[:, :, 1:].reshape(-1, *one[0, 0, 1:].shape) for one in _of_one_length(spectra)])
        for spectra in (done, residuals)
    )
    axis = int((np.abs(law) ** 2).sum(axis=(0, 1)).argmax())
    frequency = motion.along[0].motion.frequency_hz[1:]
    edges = np.geomspace(frequency[0], frequency[-1] * 1.001, PARTS + 1)
    parts = [np.flatnonzero((frequency >= low) & (frequency < high)) for low, high in pairwise(edges)]
    parts = [part for part in parts if len(part)]
    return Picture(
        f"frequency, Hz (motor of {motion.robot.axis_names[axis]}, amplitudes)",
        np.array([frequency[part].mean() for part in parts]),
        *(
            np.array([np.sqrt(2 * (np.abs(some[:, part, axis]) ** 2).mean()) for part in parts])
            for some in (law + left, law)
        ),
    )


def _variable(
    along: EffectTorque, addition: Addition, bound: BoundEffect
) -> tuple[str, FloatArray, FloatArray | float]:
    """What a law is drawn over, at the samples: its name with the unit, its values, and the way that counts as up."""
    shape = along.motion.angle.shape[:3]
    finer = along.along.position.shape[1] // shape[2]
    place = bound.place
    motor, speed = along.seen(place.motor)
    names = [row.name for row in bound.effect.parameters]
    if "order" in names:
        turn = np.mod(motor[:, ::finer], 2 * np.pi)
        return "angle of the motor within a turn, rad", turn.reshape(shape), 1.0
    if any(name.startswith(BY_LOAD) for name in names):
        load = np.abs(along.load_of(place.load)[:, ::finer]).reshape(shape)
        return (
            "size of the load, N m (torque along the motion)",
            load,
            np.sign(speed[:, ::finer]).reshape(shape),
        )
    if addition.use.startswith(BY_DEFLECTION):
        bent, _ = along.seen(place.direction)
        return "deflection, rad", bent[:, ::finer].reshape(shape), 1.0
    if addition.use.startswith(BY_POSITION):
        where, _ = along.seen(place.direction)
        return "joint angle, rad", where[:, ::finer].reshape(shape), 1.0
    if issubclass(bound.effect, SignalEffect):
        return "motor torque, N m", along.motion.torque[..., place.axis], 1.0
    return "motor speed, rad/s", speed[:, ::finer].reshape(shape), 1.0
