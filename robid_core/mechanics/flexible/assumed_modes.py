"""Flexible beam by assumed modes: shapes chosen beforehand, mass and stiffness by integration over the beam.

Motion of the sections ``u(x) = sum phi_k(x) eta_k`` (A. A. Shabana, Dynamics of Multibody Systems, 4th ed. 2013,
chapter 5; A. De Luca, B. Siciliano, IEEE Trans. SMC 21, 1991). Bending shapes are the modes of the clamped-free beam,
whose frequencies come out exact, or polynomials, which also bend exactly under a load at the tip.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from robid_core.arrays import FloatArray
from robid_core.errors import ConfigurationError
from robid_core.mechanics.flexible.beam import Beam
from robid_core.mechanics.flexible.body import FlexibleBody, body_of_shapes
from robid_core.mechanics.flexible.closed_form import cantilever_roots
from robid_core.mechanics.flexible.modal import inertia_of_moments

Shapes = tuple[
    FloatArray, FloatArray, FloatArray
]  # value, first and second derivative, (n_shape, n_point) each


def assumed_modes(
    beam: Beam,
    n_bending: tuple[int, int] = (2, 2),
    n_torsion: int = 1,
    n_axial: int = 0,
    shapes: Literal["cantilever", "polynomial"] = "cantilever",
    damping_ratio: float = 0.01,
) -> FlexibleBody:
    """Flexible body of a beam along x, clamped at x = 0, its tip at x = length.

    Parameters
    ----------
    beam
        Stiffness and mass per length.
    n_bending
        Shapes that move the beam in y and in z.
    n_torsion, n_axial
        Shapes ``sin((2 k - 1) pi x / 2 L)`` of torsion and extension (polynomials x, x^2.. if asked for).
    shapes
        Kind of shape. Above 12 a motion polynomials lose digits and are refused.
    damping_ratio
        Of every mode.

    Raises
    ------
    ConfigurationError
        For no shape at all, a negative number of them, or too many polynomials.
    """
    counts = (n_axial, *n_bending, n_torsion)
    if min(counts) < 0 or sum(counts) == 0 or (shapes == "polynomial" and max(counts) > 12):
        raise ConfigurationError(
            f"assumed modes: {counts} shapes of extension, bending in y, in z, torsion; give at least one, and of "
            "polynomials at most 12 a motion"
        )
    points, weights = np.polynomial.legendre.leggauss(24 + 4 * max(counts))
    s, weight = (points + 1) / 2, weights / 2 * beam.length
    clamped, line = (_BENDING[shapes], _LINE[shapes])
    n, length = sum(counts), beam.length
    moved, turned = (
        np.zeros((n, 3, len(s))),
        np.zeros((n, 3, len(s))),
    )  # displacement and rotation of sections
    strain = np.zeros((n, 4, len(s)))  # extension, twist, bending about y and z
    tip = np.zeros((6, n))
    ends = np.append(s, 1.0)
    start = 0
    for motion, count in enumerate(counts):  # extension, bending in y, bending in z, torsion
        value, slope, curve = (line if motion in (0, 3) else clamped)(count, ends)
        slope, curve = slope / length, curve / length**2
        rows = slice(start, start + count)
        start += count
        if motion == 0:
            moved[rows, 0], strain[rows, 0], tip[3, rows] = value[:, :-1], slope[:, :-1], value[:, -1]
        elif motion == 3:
            turned[rows, 0], strain[rows, 1], tip[0, rows] = value[:, :-1], slope[:, :-1], value[:, -1]
        else:
            about, sign = (
                (2, 1) if motion == 1 else (1, -1)
            )  # z as a function of x turns sections about minus y
            moved[rows, motion], turned[rows, about] = value[:, :-1], sign * slope[:, :-1]
            strain[rows, 1 + about] = sign * curve[:, :-1]
            tip[3 + motion, rows], tip[about, rows] = value[:, -1], sign * slope[:, -1]
    rigidity = np.array([beam.axial_stiffness, beam.torsional_stiffness, *beam.bending_stiffness])
    line_mass, section = beam.mass_per_length, np.array(beam.section_inertia)
    x = length * s
    first = line_mass * np.einsum("kap,p->ak", moved, weight)
    second = line_mass * np.einsum("kap,p->ak", moved, weight * x)  # sum of x u_a
    angular = np.einsum("kap,p,a->ak", turned, weight, section)
    angular[1] -= second[2]
    angular[2] += second[1]
    zero = np.zeros(n)
    return body_of_shapes(
        beam.mass,
        np.array([length / 2, 0.0, 0.0]),
        beam.inertia(length),
        tip=np.array([length, 0.0, 0.0]),
        tip_shapes=tip,
        momentum=np.concatenate((angular, first)),
        shape_mass=line_mass * np.einsum("kap,lap,p->kl", moved, moved, weight)
        + np.einsum("kap,lap,p,a->kl", turned, turned, weight, section),
        shape_stiffness=np.einsum("kap,lap,p,a->kl", strain, strain, weight, rigidity),
        inertia_slope=inertia_of_moments(np.array([2 * second[0], zero, zero, second[1], second[2], zero])),
        damping_ratio=damping_ratio,
    )


def cantilever_shapes(n: int, s: FloatArray) -> Shapes:
    """Modes of the clamped-free beam over s = x / L, with first and second derivative over s.

    ``cosh z - cos z - c (sinh z - sin z)``, z = root s; the growing part ``(1 - c) sinh z`` is kept apart, else nothing
    of it is left from the fifth mode on. At s = 1 the value is 2 or -2.
    """
    root = cantilever_roots(n)[:, None]
    z = root * s
    # 1 - c = growing * exp(-root), with c = (cosh + cos) / (sinh + sin) at the tip
    growing = (2 * (np.sin(root) - np.cos(root)) - 2 * np.exp(-root)) / (
        1 - np.exp(-2 * root) + 2 * np.exp(-root) * np.sin(root)
    )
    ratio = 1 - growing * np.exp(-root)
    rising, falling = growing / 2 * np.exp(z - root), np.exp(-z) - growing / 2 * np.exp(-z - root)
    value = falling + rising - np.cos(z) + ratio * np.sin(z)
    slope = root * (-falling + rising + np.sin(z) + ratio * np.cos(z))
    curve = root**2 * (falling + rising + np.cos(z) - ratio * np.sin(z))
    return value, slope, curve


def polynomial_shapes(n: int, s: FloatArray, clamped: int = 2) -> Shapes:
    """Polynomials ``s^clamped P_k(2 s - 1)``, P_k of Legendre, with first and second derivative over s."""
    value, slope, curve = np.zeros((3, n, len(s)))
    for k in range(n):
        legendre = np.polynomial.Legendre.basis(k, domain=[0, 1]).convert(kind=np.polynomial.Polynomial)
        shape = np.polynomial.Polynomial([0.0] * clamped + [1.0]) * legendre
        value[k], slope[k], curve[k] = shape(s), shape.deriv()(s), shape.deriv(2)(s)
    return value, slope, curve


def sine_shapes(n: int, s: FloatArray) -> Shapes:
    """Modes of the clamped-free rod ``sin((2 k - 1) pi s / 2)``, with first and second derivative over s."""
    root: FloatArray = (np.arange(n, dtype=np.float64)[:, None] + 0.5) * np.pi
    return np.sin(root * s), root * np.cos(root * s), -(root**2) * np.sin(root * s)


def _line_polynomials(n: int, s: FloatArray) -> Shapes:
    return polynomial_shapes(n, s, clamped=1)


_BENDING = {"cantilever": cantilever_shapes, "polynomial": polynomial_shapes}
_LINE = {"cantilever": sine_shapes, "polynomial": _line_polynomials}
