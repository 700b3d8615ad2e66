"""Closed-form natural frequencies of a uniform Euler-Bernoulli beam: the oracle of every discrete model of it.

W. Weaver, S. P. Timoshenko, D. H. Young, Vibration Problems in Engineering, 5th ed. 1990, chapter 5. Roots are
``beta L``; a bending frequency is ``(beta L)^2 / (2 pi L^2) sqrt(E I / mass per length)``. Hyperbolic functions are
divided by cosh, so that high roots do not overflow.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq

from robid_core.arrays import FloatArray
from robid_core.mechanics.flexible.beam import Beam


def cantilever_roots(n: int, mass_ratio: float = 0.0) -> FloatArray:
    """First roots of a clamped beam with a point mass at its free end.

    ``1 + cos z cosh z + mass_ratio z (cos z sinh z - sin z cosh z) = 0``, one root in each ((k - 1) pi, k pi).

    Parameters
    ----------
    n
        How many.
    mass_ratio
        Mass of the load over mass of the beam.
    """

    def equation(z: float) -> float:
        return float(1 / np.cosh(z) + np.cos(z) + mass_ratio * z * (np.cos(z) * np.tanh(z) - np.sin(z)))

    return np.array([brentq(equation, k * np.pi, (k + 1) * np.pi, xtol=1e-14, rtol=1e-14) for k in range(n)])


def free_roots(n: int) -> FloatArray:
    """First roots of a beam free at both ends, rigid motion left out: ``cos z cosh z = 1``."""
    return np.array(
        [
            brentq(lambda z: np.cos(z) - 1 / np.cosh(z), k * np.pi, (k + 1) * np.pi, xtol=1e-14, rtol=1e-14)
            for k in range(1, n + 1)
        ]
    )


def bending_frequencies_hz(beam: Beam, roots: FloatArray, about: str = "z") -> FloatArray:
    """Frequencies that belong to roots ``beta L``, for bending about y (motion in z) or about z (motion in y)."""
    rigidity = beam.bending_stiffness["yz".index(about)]
    scale: float = np.sqrt(rigidity / beam.mass_per_length) / (2 * np.pi * beam.length**2)
    return scale * roots**2


def torsion_frequencies_hz(beam: Beam, n: int) -> FloatArray:
    """First torsional frequencies of the clamped beam, ``(2 k - 1) / (4 L) sqrt(G J / inertia per length)``."""
    return _rod_frequencies_hz(beam.torsional_stiffness / beam.section_inertia[0], beam.length, n)


def axial_frequencies_hz(beam: Beam, n: int) -> FloatArray:
    """First axial frequencies of the clamped beam, ``(2 k - 1) / (4 L) sqrt(E A / mass per length)``."""
    return _rod_frequencies_hz(beam.axial_stiffness / beam.mass_per_length, beam.length, n)


def _rod_frequencies_hz(square_of_speed: float, length: float, n: int) -> FloatArray:
    speed: float = np.sqrt(square_of_speed)
    return speed / (4 * length) * (2 * np.arange(n, dtype=np.float64) + 1)
