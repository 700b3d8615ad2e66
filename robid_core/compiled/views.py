"""Borrowed views of arrays inside compiled code, by number or by all lanes at once, and calls through an address.

Numba's arrays count references wherever they are passed; a view does not, so that tuples of views go into inner loops
for nothing. The owner of the memory must outlive every view of it.
"""

# mypy: disable-error-code="untyped-decorator"
from __future__ import annotations

import operator
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.datamodel.models import StructModel
from numba.core.typing.templates import (
    AbstractTemplate,
    AttributeTemplate,
    infer_getattr,
    infer_global,
    signature,
)
from numba.extending import intrinsic, lower_builtin, lower_getattr, overload, register_model

from robid_core.compiled.lanes import LANES, VECTOR, lanes, vector


class View(types.Type):  # type: ignore[misc]
    """A borrowed view of a C-contiguous array; its items are numbers, or all lanes at once."""

    def __init__(self, item: types.Type, ndim: int) -> None:
        self.item, self.ndim = item, ndim
        super().__init__(name=f"View({item}, {ndim}d)")


@register_model(View)
class _ViewModel(StructModel):  # type: ignore[misc]
    def __init__(self, manager: Any, kind: Any) -> None:
        number = types.float64 if kind.item == lanes else kind.item
        members = [("data", types.CPointer(number)), ("shape", types.UniTuple(types.intp, kind.ndim))]
        super().__init__(manager, kind, members)


def _view_of(array: Any, item: Any, ndim: int) -> Any:
    kind = View(item, ndim)

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        source = context.make_array(sig.args[0])(context, builder, args[0])
        view = cgutils.create_struct_proxy(kind)(context, builder)
        view.data = source.data
        view.shape = cgutils.pack_array(
            builder, cgutils.unpack_tuple(builder, source.shape, array.ndim)[:ndim]
        )
        return view._getvalue()

    return kind(array), emit


def _contiguous(array: Any, ndim: int) -> bool:
    return isinstance(array, types.Array) and array.layout == "C" and array.ndim >= ndim


@intrinsic
def view_of(typing: Any, array: Any) -> Any:
    """View of a C-contiguous array."""
    return _view_of(array, array.dtype, array.ndim) if _contiguous(array, 1) else None


@intrinsic
def lanes_of(typing: Any, array: Any) -> Any:
    """View of a C-contiguous float64 array (..., LANES) of one dimension less, each item all lanes."""
    return _view_of(array, lanes, array.ndim - 1) if _contiguous(array, 2) else None


@intrinsic
def _single(typing: Any, array: Any) -> Any:
    return _view_of(array, array.dtype, array.ndim - 1) if _contiguous(array, 2) else None


def lane_view(array: Any, single: Any) -> Any:
    """View of an array whose last axis holds the lanes: one where `single` is None, else LANES."""
    raise NotImplementedError("inside compiled code only")


@overload(lane_view)
def _lane_view(array, single):  # type: ignore[no-untyped-def]
    if single in (types.none, types.misc.NoneType("none")):
        return lambda array, single: _single(array)
    return lambda array, single: lanes_of(array)


def parameter_view(array: Any, own: Any) -> Any:
    """View of numbers that all lanes share where `own` is None; else the last axis of the array holds the lanes."""
    raise NotImplementedError("inside compiled code only")


@overload(parameter_view)
def _parameter_view(array, own):  # type: ignore[no-untyped-def]
    if own in (types.none, types.misc.NoneType("none")):
        return lambda array, own: view_of(array)
    return lambda array, own: lanes_of(array)


def _place(context: Any, builder: Any, kind: View, value: Any, indices: list[Any]) -> Any:
    view = cgutils.create_struct_proxy(kind)(context, builder, value)
    sizes = cgutils.unpack_tuple(builder, view.shape, kind.ndim)
    place = indices[0]
    for size, index in zip(sizes[1:], indices[1:], strict=True):
        place = builder.add(builder.mul(place, size, flags=["nsw"]), index, flags=["nsw"])
    if kind.item != lanes:
        return builder.gep(view.data, [place], inbounds=True)
    place = builder.mul(place, ir.Constant(place.type, LANES), flags=["nsw"])
    return builder.bitcast(builder.gep(view.data, [place], inbounds=True), VECTOR.as_pointer())


def _indices(context: Any, builder: Any, kind: Any, value: Any) -> list[Any]:
    if isinstance(kind, types.Integer):
        return [context.cast(builder, value, kind, types.intp)]
    values = cgutils.unpack_tuple(builder, value, kind.count)
    return [context.cast(builder, v, k, types.intp) for k, v in zip(kind.types, values, strict=True)]


def _counts(view: Any, index: Any) -> bool:
    if not isinstance(view, View):
        return False
    if isinstance(index, types.Integer):
        return view.ndim == 1
    whole = isinstance(index, types.BaseTuple) and all(
        isinstance(kind, types.Integer) for kind in index.types
    )
    return bool(whole and index.count == view.ndim)


@infer_global(operator.getitem)
class _GetItem(AbstractTemplate):  # type: ignore[misc]
    def generic(self, args: Any, kws: Any) -> Any:
        return signature(args[0].item, *args) if len(args) == 2 and _counts(*args) else None


@infer_global(operator.setitem)
class _SetItem(AbstractTemplate):  # type: ignore[misc]
    def generic(self, args: Any, kws: Any) -> Any:
        if (
            len(args) == 3
            and _counts(*args[:2])
            and (args[2] == args[0].item or isinstance(args[2], types.Number))
        ):
            return signature(types.none, *args)
        return None


def _load(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    place = _place(context, builder, sig.args[0], args[0], _indices(context, builder, sig.args[1], args[1]))
    value = builder.load(place)
    value.align = 8  # arrays of numpy promise no more
    return value


def _store(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    place = _place(context, builder, sig.args[0], args[0], _indices(context, builder, sig.args[1], args[1]))
    if sig.args[0].item == lanes:
        value = vector(context, builder, sig.args[2], args[2])
    else:
        value = context.cast(builder, args[2], sig.args[2], sig.args[0].item)
    builder.store(value, place).align = 8


for _index in (types.Integer, types.BaseTuple):
    lower_builtin(operator.getitem, View, _index)(_load)
    lower_builtin(operator.setitem, View, _index, types.Any)(_store)


@infer_getattr
class _Attributes(AttributeTemplate):  # type: ignore[misc]
    key = View

    def resolve_shape(self, view: View) -> Any:
        return types.UniTuple(types.intp, view.ndim)


@lower_getattr(View, "shape")
def _shape(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    return cgutils.create_struct_proxy(kind)(context, builder, value).shape


@intrinsic
def row_of(typing: Any, view: Any, index: Any) -> Any:
    """Row of a two-dimensional view."""
    kind = View(view.item, 1)

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        source = cgutils.create_struct_proxy(sig.args[0])(context, builder, args[0])
        start = context.cast(builder, args[1], sig.args[1], types.intp)
        place = _place(context, builder, sig.args[0], args[0], [start, ir.Constant(start.type, 0)])
        row = cgutils.create_struct_proxy(kind)(context, builder)
        row.data = builder.bitcast(place, row.data.type)
        row.shape = cgutils.pack_array(builder, cgutils.unpack_tuple(builder, source.shape, 2)[1:])
        return row._getvalue()

    return kind(view, index), emit


# Addresses -------------------------------------------------------------------------------------------------------


def _view_at(item: Any) -> Any:
    kind = View(item, 1)

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        view = cgutils.create_struct_proxy(kind)(context, builder)
        view.data = builder.inttoptr(args[0], ir.DoubleType().as_pointer())
        view.shape = cgutils.pack_array(builder, [ir.Constant(args[0].type, 0)])  # nobody asks
        return view._getvalue()

    return kind(types.intp), emit


@intrinsic
def numbers_at(typing: Any, address: Any) -> Any:
    """View of doubles at an address."""
    return _view_at(types.float64)


@intrinsic
def lanes_at(typing: Any, address: Any) -> Any:
    """View of lanes at an address."""
    return _view_at(lanes)


@intrinsic
def address_of(typing: Any, view: Any, index: Any) -> Any:
    """Address of one item of a one-dimensional view, or of a row of a two-dimensional one."""

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        indices = [context.cast(builder, args[1], sig.args[1], types.intp)]
        if sig.args[0].ndim == 2:
            indices.append(ir.Constant(indices[0].type, 0))
        return builder.ptrtoint(_place(context, builder, sig.args[0], args[0], indices), indices[0].type)

    return types.intp(view, index), emit


@intrinsic
def call_law(
    typing: Any, function: Any, place: Any, state: Any, next_state: Any, arguments: Any, step: Any
) -> Any:
    """Call the compiled entry of a law (see `laws`) at its address; all but the step are addresses."""

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        whole = args[0].type
        kind = ir.FunctionType(ir.VoidType(), [whole] * 4 + [ir.DoubleType()])
        builder.call(builder.inttoptr(args[0], kind.as_pointer()), args[1:])
        return context.get_dummy_value()

    return types.none(*[types.intp] * 5, types.float64), emit
