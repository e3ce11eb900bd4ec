"""Reading and writing places of an array of lanes."""

from __future__ import annotations

import operator

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import lower_builtin

from cvt_hpc.lanes.kinds import ALIGNMENT, LaneArrayKind, Lanes, converted, vector_type


@infer_global(operator.getitem)
class _Load(AbstractTemplate):
    def generic(self, arguments, keywords):
        if isinstance(arguments[0], LaneArrayKind):
            return signature(arguments[0].element, arguments[0], types.UniTuple(types.intp, 2))


@infer_global(operator.setitem)
class _Store(AbstractTemplate):
    def generic(self, arguments, keywords):
        array, _, value = arguments
        if isinstance(array, LaneArrayKind) and isinstance(value, Lanes | types.Number):
            return signature(types.none, array, types.UniTuple(types.intp, 2), value)


def _place(context, builder, kind, array, index):
    """Pointer to the lanes at a place."""
    box = cgutils.create_struct_proxy(kind)(context, builder, value=array)
    data = cgutils.create_struct_proxy(kind.array)(context, builder, value=box.data)
    row, field = cgutils.unpack_tuple(builder, index)
    fields = cgutils.unpack_tuple(builder, data.shape)[1]
    flat = builder.add(builder.mul(row, fields), field)
    flat = builder.mul(flat, ir.Constant(flat.type, kind.count))
    return builder.bitcast(builder.gep(data.data, [flat]), vector_type(kind.element).as_pointer())


def _alignment(kind: LaneArrayKind) -> int:
    return min(kind.dtype.bitwidth // 8 * kind.count, ALIGNMENT)


@lower_builtin(operator.getitem, LaneArrayKind, types.UniTuple)
def _load(context, builder, sig, arguments):
    kind = sig.args[0]
    return builder.load(_place(context, builder, kind, *arguments), align=_alignment(kind))


@lower_builtin(operator.setitem, LaneArrayKind, types.UniTuple, Lanes)
@lower_builtin(operator.setitem, LaneArrayKind, types.UniTuple, types.Number)
def _store(context, builder, sig, arguments):
    kind = sig.args[0]
    value = converted(context, builder, arguments[2], sig.args[2], kind.element)
    place = _place(context, builder, kind, *arguments[:2])
    builder.store(value, place, align=_alignment(kind))
    return context.get_dummy_value()
