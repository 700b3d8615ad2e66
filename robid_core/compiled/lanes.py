"""Eight experiments at once: numba types for a vector of doubles, so that one source runs scalar or on all lanes.

`Lanes` is a value of LANES doubles in one vector register, `LaneMask` the outcome of a comparison; arithmetic,
comparison
and `where` on them become single vector instructions. A compiled function that is written with those alone
works on float64 and on lanes alike:
numba compiles it for the types it meets. Each lane is computed with the same operations as a scalar would be, whatever
its neighbours hold.

These types live inside compiled code only; arrays go in and out through `views`.
"""

# mypy: disable-error-code="untyped-decorator"
from __future__ import annotations

import math
import operator
from collections.abc import Callable
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.datamodel.models import PrimitiveModel
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import intrinsic, lower_builtin, overload, register_model

LANES = 8
"""Doubles in a vector: one AVX-512 register, two of AVX2; the compiler splits it where registers are shorter."""

VECTOR = ir.VectorType(ir.DoubleType(), LANES)
_BITS = ir.VectorType(ir.IntType(1), LANES)


class Lanes(types.Type):  # type: ignore[misc]
    """LANES doubles."""

    def __init__(self) -> None:
        super().__init__(name=f"Lanes({LANES})")


class LaneMask(types.Type):  # type: ignore[misc]
    """LANES truth values."""

    def __init__(self) -> None:
        super().__init__(name=f"LaneMask({LANES})")


lanes, mask = Lanes(), LaneMask()


@register_model(Lanes)
class _LanesModel(PrimitiveModel):  # type: ignore[misc]
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, VECTOR)


@register_model(LaneMask)
class _LaneMaskModel(PrimitiveModel):  # type: ignore[misc]
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, _BITS)


# Arithmetic and comparison -------------------------------------------------------------------------------


def spread(builder: Any, value: Any) -> Any:
    """Put one double into every lane."""
    empty = ir.Constant(VECTOR, ir.Undefined)
    first = builder.insert_element(empty, value, ir.Constant(ir.IntType(32), 0))
    return builder.shuffle_vector(
        first, empty, ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES)
    )


def vector(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    if kind == lanes:
        return value
    return spread(builder, context.cast(builder, value, kind, types.float64))


def _mixes(arguments: Any) -> bool:
    return lanes in arguments and all(kind == lanes or isinstance(kind, types.Number) for kind in arguments)


def _binary(operation: Callable[..., Any], result: Any, emit: Callable[[Any, Any, Any], Any]) -> None:
    @infer_global(operation)
    class _Template(AbstractTemplate):  # type: ignore[misc]
        def generic(self, args: Any, kws: Any) -> Any:
            return signature(result, *args) if not kws and len(args) == 2 and _mixes(args) else None

    def lower(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        left, right = (vector(context, builder, k, v) for k, v in zip(sig.args, args, strict=True))
        return emit(builder, left, right)

    for left, right in ((lanes, lanes), (lanes, types.Number), (types.Number, lanes)):
        lower_builtin(operation, left, right)(lower)


def _emitter(method: str, *first: str) -> Callable[[Any, Any, Any], Any]:
    return lambda builder, left, right: getattr(builder, method)(*first, left, right)


for _operations, _name in (
    ((operator.add, operator.iadd), "fadd"),
    ((operator.sub, operator.isub), "fsub"),
    ((operator.mul, operator.imul), "fmul"),
    ((operator.truediv, operator.itruediv), "fdiv"),
):
    for _operation in _operations:
        _binary(_operation, lanes, _emitter(_name))
for _operation, _sign in (
    (operator.lt, "<"),
    (operator.le, "<="),
    (operator.gt, ">"),
    (operator.ge, ">="),
    (operator.eq, "=="),
):
    _binary(_operation, mask, _emitter("fcmp_ordered", _sign))
_binary(operator.ne, mask, _emitter("fcmp_unordered", "!="))


@infer_global(operator.neg)
class _Negative(AbstractTemplate):  # type: ignore[misc]
    def generic(self, args: Any, kws: Any) -> Any:
        return signature(lanes, lanes) if args == (lanes,) else None


@lower_builtin(operator.neg, lanes)
def _negative(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    return builder.fneg(args[0])


def _logical(operation: Callable[..., Any], name: str) -> None:
    @infer_global(operation)
    class _Template(AbstractTemplate):  # type: ignore[misc]
        def generic(self, args: Any, kws: Any) -> Any:
            return signature(mask, *args) if args == (mask, mask) else None

    def lower(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return getattr(builder, name)(*args)

    lower_builtin(operation, mask, mask)(lower)


_logical(operator.and_, "and_")
_logical(operator.or_, "or_")


# Functions of one value ------------------------------------------------------------------------------------


def _unary(function: Callable[..., Any], llvm_name: str) -> None:
    """Give `function` of lanes as an LLVM vector intrinsic."""

    @intrinsic
    def _call(typing: Any, value: Any) -> Any:
        def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            kind = ir.FunctionType(VECTOR, [VECTOR])
            callee = cgutils.get_or_insert_function(builder.module, kind, f"llvm.{llvm_name}.v{LANES}f64")
            return builder.call(callee, args)

        return lanes(lanes), emit

    @overload(function)
    def _overload(value):  # type: ignore[no-untyped-def]
        return (lambda value: _call(value)) if value == lanes else None


for _function, _llvm in (
    (abs, "fabs"),
    (math.sqrt, "sqrt"),
    (np.sqrt, "sqrt"),
    (np.floor, "floor"),
    (np.rint, "rint"),
):
    _unary(_function, _llvm)


@intrinsic
def _select(typing: Any, condition: Any, left: Any, right: Any) -> Any:
    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        values = [vector(context, builder, k, v) for k, v in zip(sig.args[1:], args[1:], strict=True)]
        return builder.select(args[0], *values)

    return lanes(mask, left, right), emit


def where(condition: Any, left: Any, right: Any) -> Any:
    """`left` where the condition holds, else `right`: the branch that also works lane by lane."""
    return left if condition else right


@overload(where)
def _where(condition, left, right):  # type: ignore[no-untyped-def]
    if condition == mask:
        return lambda condition, left, right: _select(condition, left, right)
    return lambda condition, left, right: left if condition else right


def like(example: Any, number: float) -> Any:
    """`number` in the type of `example`: itself, or in every lane."""
    return number


@intrinsic
def _spread_over(typing: Any, number: Any) -> Any:
    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return spread(builder, args[0])

    return lanes(types.float64), emit


@overload(like)
def _like(example, number):  # type: ignore[no-untyped-def]
    if example == lanes:
        return lambda example, number: _spread_over(number)
    return lambda example, number: number


@overload(max)
def _maximum(left, right):  # type: ignore[no-untyped-def]
    return (lambda left, right: where(left > right, left, right)) if _mixes((left, right)) else None


@overload(min)
def _minimum(left, right):  # type: ignore[no-untyped-def]
    return (lambda left, right: where(left < right, left, right)) if _mixes((left, right)) else None


@intrinsic
def power_of_two(typing: Any, shifted: Any) -> Any:
    """2^k of ``k + 1.5 * 2^52`` (so that the integer k stands in the low bits), for -1022 <= k <= 1023."""

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        whole: Any = ir.IntType(64)
        real: Any = ir.DoubleType()
        if sig.args[0] == lanes:
            whole, real = ir.VectorType(whole, LANES), VECTOR
            bias, shift = ir.Constant(whole, [1023] * LANES), ir.Constant(whole, [52] * LANES)
        else:
            bias, shift = ir.Constant(whole, 1023), ir.Constant(whole, 52)
        return builder.bitcast(builder.shl(builder.add(builder.bitcast(args[0], whole), bias), shift), real)

    return shifted(shifted), emit
