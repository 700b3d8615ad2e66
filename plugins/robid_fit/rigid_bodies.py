"""Bodies of a robot file from base parameters: mass, centre of mass and inertia about it, with their covariance.

Base parameters are first moments ``h = m c`` and inertias about the joint, ``J = I + m (|c|^2 1 - c c^T)``. What no
motion shows (the first moments of a slide) leaves the file's centre and moments as they are.
"""

from __future__ import annotations

import numpy as np

from robid_core import BoolArray, ConfigurationError, FloatArray, IntArray, Model, Robot
from robid_core.estimation.rigid.regression import LinearFit
from robid_core.estimation.rigid.rigid_body import PARAMETERS
from robid_fit.rigid_model import Columns

STEP = 1e-6  # of derivatives by central differences, relative
MOMENTS = [
    (noun.partition(".")[2], i, j) for noun, i, j in zip(PARAMETERS[4:], *np.triu_indices(3), strict=True)
]


def model_of(robot: Robot, columns: Columns, named: IntArray, fit: LinearFit) -> Model:
    """What a rigid fit gives back; what the estimates make no possible body, or rotor, stays as it was.

    Parameters
    ----------
    robot
        The robot that the fit was given, with its bearings.
    columns
        All parameters, and their columns at random states.
    named
        Which of them were estimated, shape (n_estimate,).
    fit
        Their estimates and covariance.
    """
    seen: BoolArray = np.asarray(columns.regressor.any(axis=(0, 1)))
    start = {name: robot.parameter(name) for name in robot.layout}

    def numbers(index: int, estimate: FloatArray) -> dict[str, float]:
        """What one estimated parameter, or the body that it is of, comes to in the robot file."""
        value = columns.value.copy()
        value[named] = estimate
        if columns.kinds[index] != "inertia":
            return {columns.names[index]: float(value[index])}
        ten = slice(index - index % len(PARAMETERS), index - index % len(PARAMETERS) + len(PARAMETERS))
        joint = columns.names[ten.start].removeprefix("mass.")
        return body_numbers(joint, value[ten], seen[ten], start)

    groups, left_out = [], []
    for index in named.tolist():
        if is_possible(robot, not_negative(numbers(index, fit.estimate))):
            groups.append(index)
        else:
            left_out.append(columns.names[index])

    def found(estimate: FloatArray) -> dict[str, float]:
        return {name: value for index in groups for name, value in numbers(index, estimate).items()}

    values = found(fit.estimate)
    slopes = np.zeros((len(values), len(named)))
    sizes: FloatArray = np.maximum(np.abs(fit.estimate), fit.standard_error)
    for k, size in enumerate(sizes.tolist()):
        step = np.zeros(len(named))
        step[k] = STEP * size if size > 0 else STEP
        ends = [np.array(list(found(fit.estimate + sign * step).values())) for sign in (1.0, -1.0)]
        slopes[:, k] = (ends[0] - ends[1]) / (2 * step[k])
    moved = np.flatnonzero(slopes.any(axis=1))
    free = [list(values)[index] for index in moved]
    covariance: FloatArray = slopes[moved] @ fit.covariance @ slopes[moved].T
    return robot.model(not_negative({name: values[name] for name in free}), free, covariance, left_out)


def not_negative(values: dict[str, float]) -> dict[str, float]:
    """Levels of friction that scatter below zero are none."""
    kinds = (".coulomb", ".viscous")
    return {name: max(value, 0.0) if name.endswith(kinds) else value for name, value in values.items()}


def body_numbers(joint: str, ten: FloatArray, seen: BoolArray, start: dict[str, float]) -> dict[str, float]:
    """Numbers of a robot file for one body.

    Parameters
    ----------
    joint
        That carries it.
    ten
        Its parameters in the order of `PARAMETERS`.
    seen
        Which of them show in some motion.
    start
        Numbers of the robot file by name: for the others.
    """
    mass = float(ten[0])
    centre = np.array(
        [
            ten[1 + k] / mass if seen[1 + k] and mass else start.get(f"centre_of_mass.{joint}.{axis}", 0.0)
            for k, axis in enumerate("xyz")
        ]
    )
    steiner = mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
    found = {f"mass.{joint}": mass}
    found |= {f"centre_of_mass.{joint}.{axis}": float(centre[k]) for k, axis in enumerate("xyz")}
    for k, (name, i, j) in enumerate(MOMENTS):
        held = start.get(f"inertia.{joint}.{name}", 0.0)
        found[f"inertia.{joint}.{name}"] = float(ten[4 + k] - steiner[i, j]) if seen[4 + k] else held
    return found


def is_possible(robot: Robot, values: dict[str, float]) -> bool:
    """Tell whether the robot can have these numbers."""
    try:
        robot.with_parameters(values)
    except ConfigurationError:
        return False
    return True
