"""Periodic trajectories from rest to rest about a configuration: how they are made up, and how they keep the limits.

Each motor's speed is a sum of sines and cosines of a base frequency (Swevers et al. 1997), in a basis whose members
all have zero speed and zero acceleration at the period's ends and no mean, so that rest there needs no constraint.
Limits of position, speed, acceleration and torque are kept by shrinking a motion towards its configuration. What is
best of them is found by `trajectory_search`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid_core.arrays import FloatArray, IntArray
from robid_core.estimation.excitation.criteria import Criterion, cost
from robid_core.estimation.rigid.rigid_torque import RigidDrives, motor_torque_regressor

FINE_GRID = 60  # instants per period and harmonic at which a motion is held against its limits


@dataclass(frozen=True)
class Basis:
    """Motions that all trajectories are made of: position (rad), speed, acceleration, (n_time, n_motion) each."""

    position: FloatArray
    speed: FloatArray
    acceleration: FloatArray

    def motion(self, coefficient: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Position, speed and acceleration of coefficients (n_axis, n_motion), (n_time, n_axis) each."""
        return self.position @ coefficient.T, self.speed @ coefficient.T, self.acceleration @ coefficient.T


def rest_to_rest_basis(harmonics: int, period_s: float, n_time: int) -> Basis:
    """Speeds ``cos k w t - cos w t`` and ``sin k w t - k sin w t``, k = 2 to `harmonics`, made orthonormal.

    They span all speeds of that bandwidth without mean that are zero with their derivative at t = 0, and with it at
    the period's end: two linear conditions on 2 `harmonics` coefficients, solved by elimination. At t = 0 every
    product is one with 0 or 1, so that rest is exact and not to rounding. The position has no mean: the motion goes
    about its configuration.

    Parameters
    ----------
    harmonics
        Highest multiple of the base frequency, at least 2.
    period_s
        Length of the period.
    n_time
        Equidistant instants of the period, the first at its start.

    Returns
    -------
    ``2 (harmonics - 1)`` motions, their speeds of root mean square 1 and orthogonal over the period.
    """
    order, omega = np.arange(2, harmonics + 1), 2 * np.pi / period_s
    # Reduced to one turn first, so that the period closes to an ulp.
    turn = 2 * np.pi * (np.arange(n_time)[:, None] * np.arange(1, harmonics + 1) % n_time) / n_time
    cosine, sine = np.cos(turn), np.sin(turn)
    slow_cosine, slow_sine = cosine[:, :1], sine[:, :1]
    speed = np.hstack([cosine[:, 1:] - slow_cosine, sine[:, 1:] - order * slow_sine])
    position = (
        np.hstack([sine[:, 1:] / order - slow_sine, order * slow_cosine - cosine[:, 1:] / order]) / omega
    )
    acceleration = np.hstack([slow_sine - order * sine[:, 1:], order * (cosine[:, 1:] - slow_cosine)]) * omega
    # Gram matrix of the speeds over the period, in closed form: 1/2 each, and the shared first harmonic.
    count = len(order)
    gram = np.zeros((2 * count, 2 * count))
    gram[:count, :count] = 0.5 * (np.eye(count) + 1.0)
    gram[count:, count:] = 0.5 * (np.eye(count) + np.outer(order, order))
    mix = np.linalg.inv(np.linalg.cholesky(gram)).T
    return Basis(position @ mix, speed @ mix, acceleration @ mix)


@dataclass(frozen=True)
class Limits:
    """What a trajectory may use, motor side, (n_axis,) each; joint angles as well. Infinite where there is none."""

    lower: FloatArray
    upper: FloatArray
    joint_lower: FloatArray
    joint_upper: FloatArray
    speed: FloatArray
    acceleration: FloatArray
    torque: FloatArray


@dataclass(frozen=True)
class TrajectoryProblem:
    """One configuration's search: the robot, its limits, what is to be told apart, and what is known already."""

    drives: RigidDrives
    limits: Limits
    centre: FloatArray
    """The configuration, motor side, rad, (n_axis,)."""
    harmonics: int
    period_s: float
    criterion: Criterion
    noise: FloatArray
    """Standard deviation of each motor's torque, or its limit where none is known, N m, (n_axis,)."""
    column: IntArray
    """Columns of `motor_torque_regressor` that are estimated."""
    column_scale: FloatArray
    """Size of these columns: one over the unit in which each parameter is counted, (len(column),)."""
    before: FloatArray | None = None
    """Gram matrix of the trajectories there are already; None: the first."""

    @property
    def shape(self) -> tuple[int, int]:
        """Shape of the coefficients, (n_axis, n_motion)."""
        return self.drives.n_axis, 2 * (self.harmonics - 1)

    def basis(self, n_time: int) -> Basis:
        """The motions at `n_time` instants of the period."""
        return rest_to_rest_basis(self.harmonics, self.period_s, n_time)

    def gram(self, coefficient: FloatArray) -> FloatArray:
        """Gram matrix of the scaled regressor along a trajectory, on the fine grid, without `before`."""
        position, speed, acceleration = self.basis(FINE_GRID * self.harmonics).motion(coefficient)
        regressor = motor_torque_regressor(self.drives, self.centre + position, speed, acceleration)
        return gram_of(regressor[:, :, self.column], self.noise, self.column_scale)

    def cost(self, coefficient: FloatArray) -> float:
        """Criterion of the trajectory together with those before it; small is good."""
        gram = self.gram(coefficient)
        return cost(gram if self.before is None else gram + self.before, self.criterion)[0]


def gram_of(regressor: FloatArray, noise: FloatArray, column_scale: FloatArray) -> FloatArray:
    """Gram matrix ``W^T W / n_sample`` of rows over the noise and columns over their scale.

    Takes shapes (n_sample, n_axis, n_parameter), (n_axis,) and (n_parameter,); gives (n_parameter, n_parameter).
    """
    rows = (regressor / noise[:, None] / column_scale).reshape(-1, len(column_scale))
    gram: FloatArray = rows.T @ rows / len(regressor)
    return gram


def usual_column_scale(
    drives: RigidDrives, limits: Limits, noise: FloatArray, column: IntArray, omega: float
) -> FloatArray:
    """Root mean square of each column over random states as far and fast as a trajectory could go, (len(column),).

    With it a condition number compares parameters by what they can do to the torque, and does not hang on units.
    Joints are drawn uniformly within their limits (one turn where there are none), speeds and accelerations as those
    of a wave of `omega` (rad/s) over that range within the limits. The same at every call.
    """
    generator = np.random.Generator(np.random.PCG64(0))
    draw = generator.uniform(-1.0, 1.0, (3, 400, drives.n_axis))
    low = np.where(np.isfinite(limits.joint_lower), limits.joint_lower, -np.pi)
    high = np.where(np.isfinite(limits.joint_upper), limits.joint_upper, np.pi)
    joint = 0.5 * (low + high) + 0.5 * (high - low) * draw[0]
    position = np.linalg.solve(drives.gear, joint.T).T
    reach = np.abs(np.linalg.solve(drives.gear, 0.5 * (high - low)))
    speed = np.minimum(limits.speed, omega * reach)
    acceleration = np.minimum(limits.acceleration, omega * speed)
    regressor = motor_torque_regressor(drives, position, speed * draw[1], acceleration * draw[2])
    mean_square = ((regressor[:, :, column] / noise[:, None]) ** 2).sum(axis=1).mean(axis=0)
    scale: FloatArray = np.sqrt(mean_square)
    return np.where(scale > 0, scale, 1.0)


def kinematic_share(problem: TrajectoryProblem, coefficient: FloatArray) -> FloatArray:
    """Largest use that each axis makes of its limits of position, speed and acceleration, (n_axis,); 1 is all of it."""
    limits, centre, gear = problem.limits, problem.centre, problem.drives.gear
    position, speed, acceleration = problem.basis(FINE_GRID * problem.harmonics).motion(coefficient)
    shares = [
        _two_sided(position, limits.lower - centre, limits.upper - centre),
        _two_sided(position @ gear.T, limits.joint_lower - gear @ centre, limits.joint_upper - gear @ centre),
        np.abs(speed).max(axis=0) / limits.speed,
        np.abs(acceleration).max(axis=0) / limits.acceleration,
    ]
    largest: FloatArray = np.max(shares, axis=0)
    return largest


def _two_sided(value: FloatArray, lower: FloatArray, upper: FloatArray) -> FloatArray:
    """Largest of ``value / upper`` and ``value / lower`` about zero, which lies between them."""
    share: FloatArray = np.maximum((value / upper).max(axis=0), (value / lower).max(axis=0))
    return share


def torque_share(problem: TrajectoryProblem, coefficient: FloatArray) -> float:
    """Largest use that any motor makes of its torque limit, by inverse dynamics with friction; 1 is all of it."""
    position, speed, acceleration = problem.basis(FINE_GRID * problem.harmonics).motion(coefficient)
    regressor = motor_torque_regressor(problem.drives, problem.centre + position, speed, acceleration)
    return float((np.abs(regressor @ problem.drives.parameters) / problem.limits.torque).max())


def fitted(problem: TrajectoryProblem, coefficient: FloatArray, stretch: bool = False) -> FloatArray:
    """Coefficients scaled towards the configuration until all limits hold on the fine grid.

    Each axis by its own limits of position, speed and acceleration, then all of them by the torque. With `stretch`
    an axis that leaves room is scaled up to its limits first. Zero where not even a small motion is possible, because
    the configuration itself takes more torque than there is.
    """
    share = kinematic_share(problem, coefficient)
    share = np.where(share > 0, share, 1.0)
    scaled = coefficient / (share if stretch else np.maximum(share, 1.0))[:, None]
    if torque_share(problem, scaled) <= 1.0:
        return scaled
    inside, beyond = 0.0, 1.0
    for _ in range(14):  # to 1e-4 of the amplitude
        middle = 0.5 * (inside + beyond)
        inside, beyond = (
            (middle, beyond) if torque_share(problem, middle * scaled) <= 1.0 else (inside, middle)
        )
    return inside * scaled


def random_coefficients(problem: TrajectoryProblem, generator: np.random.Generator) -> FloatArray:
    """A random trajectory as large as the limits let it be, (n_axis, n_motion)."""
    return fitted(problem, generator.normal(size=problem.shape), stretch=True)
