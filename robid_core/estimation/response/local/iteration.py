"""Against the bias of the linearised equations: weights from the pass before.

Least squares of ``D y - N u`` weighs the output error v by D, which is small where the local function has its poles.
Dividing the equations by the D of the pass before (Sanathanan and Koerner 1963) makes their error that of the
output. A pass is kept at a line where it brings the window's true output error down. What bias noise among the
regressors brings stays; instruments, outputs that the pass before gives to the inputs, take it away, but scatter
more than they gain (CONTRIBUTING, Decisions).
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from robid_core.arrays import ComplexArray, FloatArray, IntArray
from robid_core.estimation.response.local.model import LocalModel
from robid_core.estimation.response.local.rational import Solution, solve
from robid_core.estimation.response.local.regressors import WindowData, regressors
from robid_core.estimation.response.local.result import polynomial, rational_response

SMALLEST = 0.03
"""Part of the largest |D| in a window below which weights grow no further."""
SETTLED = 1e-4
"""Relative change of G below which a line needs no further pass."""


@dataclass(frozen=True)
class Pass:
    """A solution with the weights (n, w, n_out) of its equations and the output error (n,) it leaves."""

    solution: Solution
    weight: FloatArray
    output_error: FloatArray


def first_pass(data: WindowData, model: LocalModel, loop_freedom: FloatArray | None = None) -> Pass:
    """Plain least squares; of signals in a loop with what is free of noise left out (see `rational.solve`).

    `loop_freedom` (n,) are the degrees of freedom of windows whose signals are in a loop.
    """
    solution = solve(regressors(data, model), model, loop_freedom)
    weight = np.ones((*data.offset.shape, data.y.shape[-1]))
    return Pass(solution, weight, output_error(data, solution))


def output_error(data: WindowData, solution: Solution) -> FloatArray:
    """Mean square of ``y - D^-1 N u`` over a window, each output relative to its size."""
    error = data.y - modelled(data, solution)
    level = np.mean(np.abs(data.y) ** 2, axis=(1, 2))
    square = np.mean(np.abs(error) ** 2, axis=(1, 2)) / np.where(level > 0, level, 1.0)
    result: FloatArray = np.where(np.isfinite(square), square, np.inf).sum(axis=1)
    return result


def modelled(data: WindowData, solution: Solution) -> ComplexArray:
    """Outputs (n, w, n_exp, n_out) that the local functions give to the inputs; NaN where D is singular."""
    response = rational_response(solution.numerator, solution.denominator, data.offset)
    result: ComplexArray = np.einsum("nwij,nwej->nwei", response, data.u)
    return result


def iterate(
    data: WindowData,
    model: LocalModel,
    iterations: int,
    loop_freedom: FloatArray | None = None,
) -> tuple[Pass, IntArray]:
    """Best of `iterations` further passes and the first, line by line; and which pass each line kept, (n,)."""
    best = last = first_pass(data, model, loop_freedom)
    kept = np.zeros(len(data.offset), dtype=np.int64)
    if model.denominator_order == 0:
        return best, kept
    for number in range(1, iterations + 1):
        before = last.solution.numerator[:, 0]
        last = next_pass(data, model, last, loop_freedom)
        better = last.output_error < best.output_error
        best, kept = _choose(better, last, best), np.where(better, number, kept)
        change = np.abs(last.solution.numerator[:, 0] - before).max(axis=(1, 2))
        if (change <= SETTLED * np.abs(before).max(axis=(1, 2))).all():
            break
    return best, kept


def next_pass(
    data: WindowData, model: LocalModel, last: Pass, loop_freedom: FloatArray | None = None
) -> Pass:
    """Solve anew with weights from the pass before; see `iterate`."""
    d = polynomial(last.solution.denominator, data.offset)
    size = np.abs(np.einsum("nwii->nwi", d))
    if model.parametrization == "mimo":
        # Of a full matrix one number for all outputs, since weights that mix them would couple all unknowns.
        size = np.broadcast_to(np.abs(np.linalg.det(d))[..., None] ** (1 / d.shape[-1]), size.shape)
    weight = 1.0 / np.maximum(size, SMALLEST * size.max(axis=1, keepdims=True))
    if model.parametrization == "miso":
        outputs = [slice(i, i + 1) for i in range(data.y.shape[-1])]
        parts = [_solve(data, model, weight[..., i], i) for i in outputs]
        solution = _side_by_side(parts)
    else:
        solution = _solve(data, model, weight[..., :1], slice(None), loop_freedom)
    return Pass(solution, weight, output_error(data, solution))


def _solve(
    data: WindowData,
    model: LocalModel,
    weight: FloatArray,
    outputs: slice,
    loop_freedom: FloatArray | None = None,
) -> Solution:
    some = replace(data, y=data.y[..., outputs])
    return solve(regressors(some, model, weight[..., 0].astype(np.complex128)), model, loop_freedom)


def _side_by_side(parts: list[Solution]) -> Solution:
    """Solutions of single outputs as one of all."""
    denominator = np.zeros((*parts[0].denominator.shape[:2], len(parts), len(parts)), dtype=np.complex128)
    for i, part in enumerate(parts):
        denominator[:, :, i, i] = part.denominator[:, :, 0, 0]
    return Solution(
        numerator=np.concatenate([part.numerator for part in parts], axis=2),
        denominator=denominator,
        error=np.concatenate([part.error for part in parts], axis=2),
        condition=np.max([part.condition for part in parts], axis=0),
        influence=np.concatenate([part.influence for part in parts], axis=1),
        leverage=np.concatenate([part.leverage for part in parts], axis=2),
    )


def _choose(first: npt.NDArray[np.bool_], one: Pass, other: Pass) -> Pass:
    """`one` on lines where `first` holds, `other` elsewhere."""

    def pick(a: Any, b: Any) -> Any:
        return np.where(first.reshape(-1, *[1] * (a.ndim - 1)), a, b)

    mixed: dict[str, Any] = {}
    for field in fields(Solution):
        a, b = getattr(one.solution, field.name), getattr(other.solution, field.name)
        mixed[field.name] = None if a is None else pick(*np.broadcast_arrays(a, b))
    return Pass(Solution(**mixed), pick(one.weight, other.weight), pick(one.output_error, other.output_error))
