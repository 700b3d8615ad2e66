"""Computed torque: the motor motion and torque that a model asks for, given how the tool shall move (figure 2.1).

The wanted motion is that of the arm joints of a rigid robot. What a model adds, rung by rung:

- rigid: ``tau = J q_m'' + tau_f(q_m') + r_g^T (M q'' + c + g)``, ``q = r_g q_m``;
- elastic gears (A. De Luca, ICRA 2000; thesis eq. 2.2): with tau_g the torque that the arm needs, the motors run ahead
  by the gears' deflection, ``q_m = r_g^-1 (q_a + delta)``, ``k_g delta + d_g delta' = tau_g``, and rotors are
  accelerated by the second derivative of that: the fourth of the wanted motion;
- elastic coordinates without a motor (bearings, modes of links): they bend under gravity and inertia, ``k_e q_e +
  d_e q_e' = -(M q'' + c + g)_e``, and the arm joints move the tool back to where it is wanted. Solved by iteration
  from the straight robot: quasi-static first, then with the inertia of bending and putting back. That is a series in
  (frequency of the motion / resonance)^2; an exact inverse there is none in general, its zeros may be unstable
  (S. Moberg, Modeling and Control of Flexible Manipulators, Linkoeping 2010).

Derivatives are taken of the samples. The wanted motion must be smooth to the fourth order, with elastic coordinates to
the sixth and two more for every iteration, and stand at both ends or be one period.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from robid_core.arrays import FloatArray
from robid_core.errors import ConfigurationError
from robid_core.mechanics.chain import Chain
from robid_core.mechanics.dynamics import dynamics
from robid_core.mechanics.friction import friction_torque
from robid_core.mechanics.mechanism import Mechanism
from robid_core.mechanics.tool import pose_of, turned_by

BAND_HZ = 100.0  # a robot's motion has little above 20 Hz, and nobody asks its elastic arm to follow
_DEGREE = 8
_ROWS = 256  # samples whose mass matrices are held at a time
_RADIAN = 0.3  # m that one radian of the tool counts, where it cannot be put back in all six directions
_SINGULAR = 0.01  # of all singular values together: a direction of the tool that is weaker is followed slowly


@dataclass(frozen=True)
class Tool:
    """Tool centre point: the point of the robot that follows the wanted path."""

    body: str
    """Joint that carries it."""
    point: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """In the body's frame, m."""


@dataclass(frozen=True)
class MotorFriction:
    """Friction at the motor shafts, (n_axis,) each: see `friction_torque`."""

    coulomb: FloatArray
    """N m."""
    viscous: FloatArray
    """N m s/rad."""
    speed: FloatArray
    """rad/s."""
    offset: FloatArray
    """N m."""


@dataclass(frozen=True)
class Feedforward:
    """What the motors shall do, at the samples of the wanted motion."""

    motor_angle: FloatArray
    """rad, (n_sample, n_axis)."""
    motor_speed: FloatArray
    """rad/s, (n_sample, n_axis)."""
    torque: FloatArray
    """N m at the motors, (n_sample, n_axis)."""
    joint: FloatArray
    """What the model expects of arm and elastic joints, (n_sample, n_joint)."""


def computed_torque(
    mechanism: Mechanism,
    stiffness: FloatArray,
    damping: FloatArray,
    angle: FloatArray,
    sample_time: float,
    *,
    friction: MotorFriction | None = None,
    tool: Tool | None = None,
    band_hz: float = BAND_HZ,
    periodic: bool = False,
    iterations: int = 3,
) -> Feedforward:
    """Motor angles, speeds and torques for a wanted motion of the arm joints.

    Parameters
    ----------
    mechanism
        The model: gears without a spring are rigid, joints under `elastic` have no motor.
    stiffness, damping
        Of its springs, N m/rad and N m s/rad, shape (n_spring,).
    angle
        Wanted arm joint angles of the rigid robot, rad, shape (n_sample, n_axis).
    sample_time
        s.
    friction
        Of the motors; none if left out.
    tool
        Point that is put back to where the rigid robot would have it; left out, elastic coordinates bend and nothing
        is done about it. Robots of fewer than six axes put back what they can, 1 rad weighing as much as 0.3 m.
    band_hz
        Of the derivatives, see `derivative`; well above what the motion holds.
    periodic
        Whether the motion is one period: derivatives are then spectral.
    iterations
        Rounds of bending and putting back. The first is quasi-static, each further one adds a power of (frequency of
        the motion / resonance)^2; three leave micrometres on the packaged robots.

    Raises
    ------
    ConfigurationError
        Where sizes do not fit, the motion is too short for its derivatives, or elastic joints have no stiffness.
    """
    mechanism.check_springs(stiffness=stiffness, damping=damping)
    wanted = np.asarray(angle, dtype=np.float64)
    if wanted.ndim != 2 or wanted.shape[1] != mechanism.n_axis or not np.isfinite(wanted).all():
        raise ConfigurationError(
            f"feedforward: wanted motion of shape {wanted.shape}; give finite angles (n_sample, {mechanism.n_axis})"
        )

    def rate(values: FloatArray) -> FloatArray:
        return derivative(values, sample_time, band_hz, periodic)

    chain, arm, elastic = mechanism.chain, mechanism.arm, mechanism.elastic
    joint = np.zeros((len(wanted), chain.n_coordinate))
    joint[:, arm] = wanted
    if len(elastic):
        spring, damper = stiffness[-len(elastic) :], np.zeros(chain.n_coordinate)
        damper[elastic] = damping[-len(elastic) :]
        if not (spring > 0).all():
            name = chain.names[elastic[int(np.argmin(spring))]]
            raise ConfigurationError(
                f"feedforward: elastic joint '{name}' has no stiffness; it cannot bear a load"
            )
        aim = joint.copy()
        for _ in range(iterations):
            speed = rate(joint)
            load = joint_torque(chain, joint, speed, rate(speed))
            joint[:, elastic] = -(load + damper * speed)[:, elastic] / spring
            if tool is not None:
                joint[:, arm] += _put_back(mechanism, joint, aim, tool)
    speed = rate(joint)
    load = joint_torque(chain, joint, speed, rate(speed))[:, arm]
    driven = joint[:, arm].copy()
    gears = np.flatnonzero(mechanism.elastic_gear)
    if len(gears):
        k, d, torque = stiffness[: len(gears)], damping[: len(gears)], load[:, gears]
        lag = d / k
        # k x + d x' = tau to second order in d / k
        driven[:, gears] += (torque - lag * rate(torque - lag * rate(torque))) / k
    motor = np.asarray(np.linalg.solve(mechanism.gear, driven.T).T, dtype=np.float64)
    motor_speed = rate(motor)
    demand = mechanism.rotor_inertia * rate(motor_speed) + load @ mechanism.gear
    if friction is not None:
        f = friction
        demand = demand + friction_torque(motor_speed, f.coulomb, f.viscous, f.speed) + f.offset
    return Feedforward(motor, motor_speed, demand, joint)


def drive_signals(wanted: Feedforward, sample_time: float) -> tuple[FloatArray, FloatArray]:
    """Speed reference and torque as a sampled drive takes them, (n_sample, n_axis) each.

    The drive compares the reference with the angle gained over the last sample, and holds torque over the next: the
    speed is the difference to the sample before, the torque the mean of this instant and the next. Given as they are,
    both would come half a sample late.
    """
    speed = np.diff(wanted.motor_angle, axis=0, prepend=wanted.motor_angle[:1]) / sample_time
    following = np.concatenate((wanted.torque[1:], wanted.torque[-1:]))
    return speed, (wanted.torque + following) / 2


def joint_torque(
    chain: Chain, position: FloatArray, speed: FloatArray, acceleration: FloatArray
) -> FloatArray:
    """Torque at every joint that gives a motion: ``M q'' + c + g`` (2.1), N m or N, shape (n_sample, n_joint)."""
    torque = np.empty_like(position)
    for first in range(0, len(position), _ROWS):
        rows = slice(first, first + _ROWS)
        terms = dynamics(chain, position[rows], speed[rows])
        torque[rows] = np.einsum("sij,sj->si", terms.mass, acceleration[rows]) + terms.bias
    return torque


def derivative(
    values: npt.ArrayLike, sample_time: float, band_hz: float = BAND_HZ, periodic: bool = False
) -> FloatArray:
    """Rate of sampled signals along their first axis, without what lies above a band.

    Taking derivatives again and again multiplies rounding by the sampling rate each time; the band bounds that. Where
    the samples are one period, lines in the band are differentiated exactly and the others dropped. Else the slope is
    that of a polynomial of degree 8 fitted to the samples around (A. Savitzky, M. J. E. Golay, Analytical Chemistry 36,
    1964; half width by R. W. Schafer, IEEE Signal Processing Magazine 28(4), 2011), one-sided at the ends: relative
    error 1e-5 at a sixth of the band, 2e-3 at a third.

    Raises ConfigurationError where the signal is shorter than one such window.
    """
    signal = np.asarray(values, dtype=np.float64)
    n = len(signal)
    if periodic:
        frequency = np.fft.rfftfreq(n, sample_time)
        turn = 2j * np.pi * np.where(frequency <= min(band_hz, 0.499 / sample_time), frequency, 0.0)
        along = turn.reshape(-1, *(1,) * (signal.ndim - 1))
        return np.asarray(np.fft.irfft(along * np.fft.rfft(signal, axis=0), n, axis=0))
    half = max(math.ceil(((_DEGREE + 1) / (2 * band_hz * sample_time) + 4.6) / 3.2), _DEGREE // 2 + 1)
    if n < 2 * half + 1:
        raise ConfigurationError(
            f"feedforward: {n} samples; derivatives up to {band_hz:g} Hz need {2 * half + 1}; let the motion stand "
            "longer at its ends"
        )
    window = 2 * half + 1
    weights = _slope_weights(half) / sample_time
    moved = signal - signal[:1]  # what stands has no rate, to the last bit
    rate = np.empty_like(signal)
    rate[:half] = np.tensordot(weights[:half], moved[:window], 1)
    rate[-half:] = np.tensordot(weights[-half:], moved[-window:], 1)
    rate[half:-half] = sum(weight * moved[k : n - window + 1 + k] for k, weight in enumerate(weights[half]))
    return rate


def _slope_weights(half: int) -> FloatArray:
    """Slope, per sample, of the polynomial fitted to 2 half + 1 samples, at each of them, (at, sample)."""
    place = np.arange(-half, half + 1) / half
    shapes = np.polynomial.legendre.legvander(place, _DEGREE)
    slopes = np.stack([np.polynomial.Legendre.basis(k).deriv()(place) for k in range(_DEGREE + 1)], axis=1)
    return np.asarray(slopes @ np.linalg.pinv(shapes) / half)


def _put_back(mechanism: Mechanism, joint: FloatArray, aim: FloatArray, tool: Tool) -> FloatArray:
    """Motion of the arm joints that takes the tool to where it is at the joints `aim`, (n_sample, n_axis)."""
    actual = pose_of(mechanism.chain, joint, tool.body, tool.point)
    wanted = pose_of(mechanism.chain, aim, tool.body, tool.point)
    error = np.concatenate(
        (_RADIAN * turned_by(actual.rotation, wanted.rotation), actual.position - wanted.position), axis=1
    )
    jacobian = actual.jacobian[:, :, mechanism.arm] * np.repeat([_RADIAN, 1.0], 3)[:, None]
    # Damped, so that the step stays smooth in time through a singular pose; the next round makes up for it.
    gram = np.swapaxes(jacobian, 1, 2) @ jacobian
    size = np.trace(gram, axis1=1, axis2=2)[:, None, None]
    gram += _SINGULAR**2 * size * np.eye(mechanism.n_axis)
    right = np.swapaxes(jacobian, 1, 2) @ error[:, :, None]
    return -np.asarray(np.linalg.solve(gram, right)[:, :, 0])
