"""Mass matrix, bias torque and gravity stiffness of a chain at many positions."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np

from robid_core.arrays import FloatArray
from robid_core.compiled.kernel import kernel
from robid_core.compiled.lanes import LANES
from robid_core.compiled.views import lanes_of
from robid_core.mechanics.chain import Chain
from robid_core.mechanics.chain_arrays import ChainArrays, chain_arrays, chain_work
from robid_core.mechanics.recursion import chain_views, evaluate, project_gravity, work_views


@dataclass(frozen=True)
class Dynamics:
    """Result of `dynamics`; leading axes are those of the position."""

    mass: FloatArray
    """(..., n, n) kg m^2 (kg for a prismatic pair)."""
    bias: FloatArray
    """(..., n) velocity dependent and gravity torque c + g of (2.1), N m or N."""
    gravity_stiffness: FloatArray
    """(..., n, n) dg/dq, symmetric."""


def dynamics(chain: Chain, position: FloatArray, speed: FloatArray | None = None) -> Dynamics:
    """Mass matrix, bias and gravity stiffness at many positions.

    Parameters
    ----------
    chain
        The mechanism.
    position
        Joint coordinates, rad or m, shape (..., n).
    speed
        Their rates, same shape; rest if left out.
    """
    q = np.array(position, dtype=np.float64, order="C")
    v = np.zeros_like(q) if speed is None else np.array(speed, dtype=np.float64, order="C")
    n = chain.n_coordinate
    rows, rates = q.reshape(-1, n), v.reshape(-1, n)
    mass, bias = np.zeros((len(rows), n, n)), np.zeros((len(rows), n))
    stiffness = np.zeros((len(rows), n, n))
    dynamics_rows(_arrays_of(chain), chain_work(n, LANES), rows, rates, mass, bias, stiffness)
    return Dynamics(mass.reshape(*q.shape, n), bias.reshape(q.shape), stiffness.reshape(*q.shape, n))


@functools.lru_cache(maxsize=32)
def _arrays_of(chain: Chain) -> ChainArrays:
    return chain_arrays([chain], np.zeros((1, 1), dtype=np.int64))


@kernel
def dynamics_rows(chain, work, position, speed, masses, biases, stiffnesses):  # type: ignore[no-untyped-def]
    """Evaluate every row of position and speed into full symmetric matrices."""
    n_row, n = position.shape
    views, memory = chain_views(chain, 0, None), work_views(work, LANES)
    q, v = np.zeros((n, LANES)), np.zeros((n, LANES))
    for first in range(0, n_row, LANES):
        for i in range(n):
            for lane in range(LANES):
                row = min(first + lane, n_row - 1)
                q[i, lane], v[i, lane] = position[row, i], speed[row, i]
        evaluate(views, memory, lanes_of(q), lanes_of(v))
        project_gravity(views, memory.screw, memory.momentum, memory.gravity_stiffness)
        for lane in range(min(LANES, n_row - first)):
            row = first + lane
            for i in range(n):
                biases[row, i] = work.bias[i, lane]
                for j in range(i + 1):
                    masses[row, i, j] = masses[row, j, i] = work.mass[i, j, lane]
                    stiffnesses[row, i, j] = stiffnesses[row, j, i] = work.gravity_stiffness[i, j, lane]
