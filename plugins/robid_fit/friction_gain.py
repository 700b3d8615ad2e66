"""What motor friction is to a response: a gain from speed to torque that friction itself makes complex.

Coulomb friction shapes the speed that it acts on. To first order in that, its best linear approximation has beside the
equivalent damping D = E[df/dv] a part ``-(c D^2 / J) int_0^inf rho(t)^2 exp(-i w t) dt``, J the rotor's inertia and rho
the correlation of the speed (third-order Hermite terms of friction, and the rotor's answer 1 / J to it): an inertia
at low frequencies that fades above, and a damping that grows. With T = 1 / (median angular frequency of the lines),
``x = w T`` and ``r = D T / J``, the share of its speed that friction takes from the rotor in T::

    K(w) = D (1 + r (i inertia x + growth x^2) / (1 + (x / 5)^2)),    D = factor * nominal

so that `inertia` and `growth` are numbers without units that hardly differ between motors; the apparent inertia is
``inertia * D^2 T^2 / J``. Viscous friction is linear and shapes nothing: r takes the square of Coulomb friction's share
in D.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid_core import ComplexArray, FloatArray, Frf, Robot

KNEE = 5.0
"""x at which the apparent inertia has fallen to a half."""
FAST = 1e6
"""Speed in rad/s at which only viscous friction is left."""
KINDS = ("friction_factor", "friction_inertia", "friction_growth")
EXPECTED = (1.0, 0.7, 0.1)
"""Before data: what a simulated motor shows with once and twice its Coulomb friction (`test_friction_gain`)."""
PRIOR = (1.0, 0.5, 0.1)
"""Standard deviations of a factor's logarithm, and of the numbers."""
LARGEST_CHANGE = 3.0
"""Of a factor's logarithm: a factor of 20."""


@dataclass(frozen=True, eq=False)
class FrictionGain:
    """Friction of the nominal robot under the speeds that were measured, and how unknowns change it."""

    names: tuple[str, ...]
    """By kinds, each of all motors."""
    nominal: FloatArray
    """Equivalent damping in each configuration, N m s/rad, (n_config, n_axis)."""
    share: FloatArray
    """r of the nominal damping, (n_config, n_axis)."""
    course: ComplexArray
    """What `inertia` and `growth` stand before, (2, n_freq)."""

    @classmethod
    def of_response(cls, robot: Robot, frf: Frf) -> FrictionGain:
        """Linearise the nominal friction."""
        omega = 2 * np.pi * frf.frequency_hz
        time = 1 / np.median(omega)
        x = omega * time
        knee = 1 + (x / KNEE) ** 2
        nominal = nominal_motor_damping(robot, frf)
        viscous = robot.equivalent_motor_damping(
            np.full_like(nominal, FAST), np.zeros_like(nominal), frf.frequency_hz
        )
        coulomb = np.maximum(1 - viscous / nominal, 0.0)
        return cls(
            tuple(f"{kind}.{axis}" for kind in KINDS for axis in robot.axis_names),
            nominal,
            coulomb**2 * nominal * time / robot.drives.rotor_inertia,
            np.stack((1j * x / knee, x**2 / knee)),
        )

    @property
    def expected(self) -> FloatArray:
        """Coordinates before data: factors by their logarithm, shape (3 n_axis,)."""
        n = self.nominal.shape[1]
        return np.repeat((np.log(EXPECTED[0]), *EXPECTED[1:]), n)

    @property
    def prior(self) -> FloatArray:
        """Standard deviations of the coordinates, shape (3 n_axis,)."""
        return np.repeat(PRIOR, self.nominal.shape[1])

    @property
    def reach(self) -> FloatArray:
        """How far coordinates may go from what is expected, shape (3 n_axis,)."""
        return np.minimum(LARGEST_CHANGE, 10 * self.prior)

    def values(self, point: FloatArray) -> FloatArray:
        """Factors and numbers that coordinates mean, shape (3 n_axis,)."""
        n = self.nominal.shape[1]
        return np.concatenate((np.exp(point[:n]), point[n:]))

    def slopes(self, point: FloatArray) -> FloatArray:
        """Derivative of each of `values` for its coordinate, shape (3 n_axis,)."""
        n = self.nominal.shape[1]
        return np.concatenate((np.exp(point[:n]), np.ones(len(point) - n)))

    def damping(self, point: FloatArray) -> FloatArray:
        """D, shape (n_config, n_axis)."""
        return self.nominal * np.exp(point[: self.nominal.shape[1]])

    def at(self, point: FloatArray) -> tuple[ComplexArray, ComplexArray]:
        """Return ``K - D`` (n_config, n_freq, n_axis), and the derivatives of K: (n_config, n_freq, 3, n_axis)."""
        factor, parts = np.exp(point[: self.nominal.shape[1]]), point.reshape(3, -1)[1:]
        damping, share = self.nominal * factor, self.share * factor
        unit = (damping * share)[:, None, None] * self.course.T[:, :, None]
        excess = (unit * parts).sum(axis=2)
        whole = damping[:, None] + 2 * excess
        return excess, np.concatenate((whole[:, :, None], unit), axis=2)


def nominal_motor_damping(robot: Robot, frf: Frf) -> FloatArray:
    """Friction of the nominal robot as an equivalent damping in each configuration, (n_config, n_axis).

    Viscous friction alone where the speeds are not known.
    """
    rms = np.full(frf.angle.shape, FAST) if frf.speed_rms is None else frf.speed_rms
    sine = np.zeros_like(rms) if frf.slow_sine_speed is None else frf.slow_sine_speed
    # A frictionless nominal robot still gets a factor to move: a thousandth of what the rotor's inertia
    # takes at the lowest line.
    floor = 1e-3 * robot.drives.rotor_inertia * 2 * np.pi * frf.frequency_hz[0]
    floored: FloatArray = np.maximum(robot.equivalent_motor_damping(rms, sine, frf.frequency_hz), floor)
    return floored
