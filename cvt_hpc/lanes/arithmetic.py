"""Sums, products, comparisons and logic of lanes; reading and writing of places of an array of lanes."""

import operator

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import lower_builtin

from cvt_hpc.lanes.kinds import ALIGNMENT, LaneArrayKind, Lanes, Mask, converted, vector_type


class _OfLanes(AbstractTemplate):
    """Types of an operation of lanes, asked before those of every target, some dozens, which refuse lanes."""

    metadata = {"target": "cpu"}


def _common(a, b):
    """The lanes' type of an operation, or None."""
    if isinstance(a, Lanes) and isinstance(b, Lanes):
        return a if a == b else None
    for one, other in ((a, b), (b, a)):
        if isinstance(one, Lanes) and isinstance(other, types.Number):
            return one
    return None


def _define_arithmetic(op, instruction: str) -> None:
    @infer_global(op)
    class Arithmetic(_OfLanes):
        def generic(self, arguments, keywords):
            if len(arguments) == 2 and (kind := _common(*arguments)):
                return signature(kind, *arguments)

    def build(context, builder, sig, arguments):
        kind = sig.return_type
        a, b = (converted(context, builder, x, t, kind) for x, t in zip(arguments, sig.args, strict=True))
        return getattr(builder, instruction)(a, b)

    for pair in ((Lanes, Lanes), (Lanes, types.Number), (types.Number, Lanes)):
        lower_builtin(op, *pair)(build)


def _define_comparison(op, symbol: str) -> None:
    @infer_global(op)
    class Comparison(_OfLanes):
        def generic(self, arguments, keywords):
            if len(arguments) == 2 and (kind := _common(*arguments)):
                return signature(Mask(kind.count, kind.linked), *arguments)

    def build(context, builder, sig, arguments):
        kind = _common(*sig.args)
        a, b = (converted(context, builder, x, t, kind) for x, t in zip(arguments, sig.args, strict=True))
        return builder.fcmp_ordered(symbol, a, b)

    for pair in ((Lanes, Lanes), (Lanes, types.Number), (types.Number, Lanes)):
        lower_builtin(op, *pair)(build)


def _define_logic(op, instruction: str) -> None:
    @infer_global(op)
    class Logic(_OfLanes):
        def generic(self, arguments, keywords):
            if len(arguments) == 2 and isinstance(arguments[0], Mask) and arguments[0] == arguments[1]:
                return signature(arguments[0], *arguments)

    @lower_builtin(op, Mask, Mask)
    def build(context, builder, sig, arguments):
        return getattr(builder, instruction)(*arguments)


for _op, _instruction in (
    (operator.add, "fadd"),
    (operator.sub, "fsub"),
    (operator.mul, "fmul"),
    (operator.truediv, "fdiv"),
    (operator.iadd, "fadd"),
    (operator.isub, "fsub"),
    (operator.imul, "fmul"),
):
    _define_arithmetic(_op, _instruction)
for _op, _symbol in ((operator.lt, "<"), (operator.le, "<="), (operator.gt, ">"), (operator.ge, ">=")):
    _define_comparison(_op, _symbol)
for _op, _instruction in (
    (operator.and_, "and_"),
    (operator.or_, "or_"),
    (operator.iand, "and_"),
    (operator.ior, "or_"),
):
    _define_logic(_op, _instruction)


@infer_global(operator.neg)
class _Negation(_OfLanes):
    def generic(self, arguments, keywords):
        if isinstance(arguments[0], Lanes):
            return signature(arguments[0], *arguments)


@lower_builtin(operator.neg, Lanes)
def _negate(context, builder, sig, arguments):
    return builder.fneg(arguments[0])


@infer_global(operator.invert)
class _Inversion(_OfLanes):
    def generic(self, arguments, keywords):
        if isinstance(arguments[0], Mask):
            return signature(arguments[0], *arguments)


@lower_builtin(operator.invert, Mask)
def _invert(context, builder, sig, arguments):
    return builder.not_(arguments[0])


@infer_global(operator.getitem)
class _Load(_OfLanes):
    def generic(self, arguments, keywords):
        array, index = arguments
        if isinstance(array, LaneArrayKind):
            place = types.intp if isinstance(index, types.Integer) else types.UniTuple(types.intp, 2)
            return signature(array.element, array, place)


@infer_global(operator.setitem)
class _Store(_OfLanes):
    def generic(self, arguments, keywords):
        array, _, value = arguments
        if isinstance(array, LaneArrayKind) and isinstance(value, Lanes | types.Number):
            return signature(types.none, array, types.UniTuple(types.intp, 2), value)


def place(context, builder, kind, array, row, field):
    """Pointer to the lanes at a place."""
    lanes = cgutils.create_struct_proxy(kind)(context, builder, value=array)
    flat = builder.add(builder.mul(row, lanes.fields), field)
    flat = builder.mul(flat, ir.Constant(flat.type, kind.count))
    return builder.bitcast(builder.gep(lanes.first, [flat]), vector_type(kind.element).as_pointer())


def _alignment(kind: LaneArrayKind) -> int:
    return min(kind.dtype.bitwidth // 8 * kind.count, ALIGNMENT)


def rows_of(context, builder, kind, array):
    """Number of rows of a LaneArray or a plain array."""
    if isinstance(kind, types.Array):
        return cgutils.unpack_tuple(builder, context.make_array(kind)(context, builder, array).shape)[0]
    return cgutils.create_struct_proxy(kind)(context, builder, value=array).rows


def load(context, builder, kind, array, row, field):
    """A field of a row; of a plain array of one number a row, that number."""
    if isinstance(kind, types.Array):
        values = context.make_array(kind)(context, builder, array)
        return builder.load(builder.gep(values.data, [row]))
    return builder.load(place(context, builder, kind, array, row, field), align=_alignment(kind))


@lower_builtin(operator.getitem, LaneArrayKind, types.UniTuple)
def _load(context, builder, sig, arguments):
    row, field = cgutils.unpack_tuple(builder, arguments[1])
    return load(context, builder, sig.args[0], arguments[0], row, field)


@lower_builtin(operator.getitem, LaneArrayKind, types.intp)
def _load_first(context, builder, sig, arguments):
    row = arguments[1]
    return load(context, builder, sig.args[0], arguments[0], row, ir.Constant(row.type, 0))


@lower_builtin(operator.setitem, LaneArrayKind, types.UniTuple, Lanes)
@lower_builtin(operator.setitem, LaneArrayKind, types.UniTuple, types.Number)
def _store(context, builder, sig, arguments):
    kind = sig.args[0]
    value = converted(context, builder, arguments[2], sig.args[2], kind.element)
    row, field = cgutils.unpack_tuple(builder, arguments[1])
    where = place(context, builder, kind, arguments[0], row, field)
    builder.store(value, where, align=_alignment(kind))
    return context.get_dummy_value()
