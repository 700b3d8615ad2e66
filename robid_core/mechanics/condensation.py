"""Transfer between a few places of a symmetric system, by eliminating everything else: dynamic condensation.

With ``Z(w) = K - w^2 M + i w D`` and the places as rows of E, ``- E Z^-1 E^T`` is what eliminating all coordinates
leaves of the border in ``[[Z, E^T], [E, 0]]``. Elimination touches the same entries in every configuration and at
every frequency; along the lists of a `Plan` it is ``entry[target] -= entry * factor`` and nothing else, for eight
frequencies at once in vector registers. No pivoting: damping keeps the pivots off zero, growth is bounded by one
over the damping ratio.
"""

from __future__ import annotations

from typing import NamedTuple

from robid_core.arrays import FloatArray
from robid_core.compiled.kernel import fused_kernel
from robid_core.compiled.lanes import LANES
from robid_core.compiled.memory import aligned_arrays
from robid_core.compiled.views import lanes_of, view_of
from robid_core.mechanics.elimination import Plan


class Memory(NamedTuple):
    """Memory of one batch of lines."""

    value: FloatArray  # (entries of the coordinates, 4) what they take of K, M, D and E
    entry: FloatArray  # (n_entry and the response between motors, 2, LANES) real and imaginary parts


def memory_of(plan: Plan) -> Memory:
    """Allocate the memory of one batch."""
    n_entry = len(plan.row)
    return Memory(*aligned_arrays((n_entry, 4), (n_entry + len(plan.motor), 2, LANES)))


@fused_kernel
def condense(  # type: ignore[no-untyped-def]
    plan, mass, damping, stiffness, border, lines, memory, inertial, response, spring_vectors, motor_vectors
):
    """Fill response and vectors (see `ResponseGradient`) for every configuration and line.

    Matrices (n_config, n, n), border (n_axis + n_spring, n), results (n_config, n_line, ...) with their last axes in
    one row, none of them for what is not wanted. `lines` (n_batch, 9, LANES) holds what a line takes of K, M and D,
    then complex factors: of E; of the result in the response; of the result of lane 0 in the response. Lane 0 of the
    first batch is no line but what all lines share; its results (n_config, n_axis (n_axis + 1) / 2) go to `inertial`.
    """
    plan, factor, entry = plan_views(plan), lanes_of(lines), lanes_of(memory.entry)
    value, number = view_of(memory.value), view_of(memory.entry)
    n, n_entry = mass.shape[1], plan.row.shape[0]
    n_line, n_response, n_spring = response.shape[1], response.shape[2], spring_vectors.shape[2]
    for config in range(mass.shape[0]):
        pick(plan, mass[config], damping[config], stiffness[config], border, value)
        for batch in range(lines.shape[0]):
            assemble(plan, n, value, factor, batch, entry)
            eliminate(plan, n, entry)
            scale_re, scale_im = factor[batch, 5], factor[batch, 6]
            shared_re, shared_im = factor[batch, 7], factor[batch, 8]
            for r in range(plan.motor.shape[0]):
                e = plan.motor[r]
                if batch == 0:
                    inertial[config, r] = number[e, 0, 0]
                re, im, shared = entry[e, 0], entry[e, 1], inertial[config, r]
                entry[n_entry + r, 0] = scale_re * re - scale_im * im + shared_re * shared
                entry[n_entry + r, 1] = scale_re * im + scale_im * re + shared_im * shared
            first = batch * LANES - 1
            for lane in range(1 if batch == 0 else 0, min(LANES, n_line - first)):
                deliver(plan.source, 0, number, lane, response, config, first + lane)
                deliver(plan.source, n_response, number, lane, spring_vectors, config, first + lane)
                deliver(plan.source, n_response + n_spring, number, lane, motor_vectors, config, first + lane)


@fused_kernel
def plan_views(plan):  # type: ignore[no-untyped-def]
    """Views of the lists of a plan."""
    return Plan(
        view_of(plan.row), view_of(plan.column), view_of(plan.start), view_of(plan.stop), view_of(plan.target),
        view_of(plan.motor), view_of(plan.source),
    )  # fmt: skip


@fused_kernel
def pick(plan, mass, damping, stiffness, border, value):  # type: ignore[no-untyped-def]
    """Take what the coordinates' columns are made of from the matrices (n, n) of one configuration."""
    n = mass.shape[0]
    for e in range(plan.start[n]):
        i, j = plan.row[e], plan.column[e]
        if i < n:
            value[e, 0], value[e, 1], value[e, 2], value[e, 3] = (
                stiffness[i, j],
                mass[i, j],
                damping[i, j],
                0.0,
            )
        else:
            value[e, 0], value[e, 1], value[e, 2], value[e, 3] = 0.0, 0.0, 0.0, border[i - n, j]


@fused_kernel
def assemble(plan, n, value, factor, batch, entry):  # type: ignore[no-untyped-def]
    """Bordered matrix of one batch of lines; nothing stands between the places themselves."""
    of_stiffness, of_mass, of_damping = factor[batch, 0], factor[batch, 1], factor[batch, 2]
    border_re, border_im = factor[batch, 3], factor[batch, 4]
    for e in range(plan.start[n]):
        entry[e, 0] = of_stiffness * value[e, 0] + of_mass * value[e, 1] + border_re * value[e, 3]
        entry[e, 1] = of_damping * value[e, 2] + border_im * value[e, 3]
    for e in range(plan.start[n], plan.row.shape[0]):
        entry[e, 0] = 0.0
        entry[e, 1] = 0.0


@fused_kernel
def eliminate(plan, n, entry):  # type: ignore[no-untyped-def]
    """Take the coordinates out one after the other, in place."""
    at = 0
    for k in range(n):
        first, last = plan.start[k], plan.start[k + 1]
        re, im = entry[first, 0], entry[first, 1]
        square = 1.0 / (re * re + im * im)
        inverse_re, inverse_im = re * square, -im * square
        for f in range(first + 1, plan.stop[k]):
            re, im = entry[f, 0], entry[f, 1]
            factor_re, factor_im = re * inverse_re - im * inverse_im, re * inverse_im + im * inverse_re
            for e in range(f, last):
                target = plan.target[at]
                at += 1
                re, im = entry[e, 0], entry[e, 1]
                entry[target, 0] = (entry[target, 0] - re * factor_re) + im * factor_im
                entry[target, 1] = (entry[target, 1] - re * factor_im) - im * factor_re


@fused_kernel
def deliver(source, first, number, lane, result, config, line):  # type: ignore[no-untyped-def]
    """Write the results of one lane into a row."""
    for r in range(result.shape[2]):
        e = source[first + r]
        result[config, line, r] = complex(number[e, 0, lane], number[e, 1, lane])
