"""Several runs in one register: numbers that hold a value for each of W runs, for kernels.

A `LaneArray` of shape (rows, fields) holds W values of type double or single at each place, one for each run
("lane"). In kernels `a[j, k]` is a number of W lanes: + - * /, comparisons and the functions below act on
each lane for itself and become vector instructions of the processor; a plain number beside it counts for all
lanes. So a run's results do not depend on its neighbours. Nor do they depend on W: every operation is rounded
once, as IEEE 754 has it, and products are fused with sums only where `fma` says so.

A loop over lanes in plain arrays would be left to the compiler's vectoriser, which gives up where it cannot
rule out that two of many arrays overlap.
"""

from __future__ import annotations

import operator

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import (
    NativeValue,
    intrinsic,
    lower_builtin,
    models,
    overload,
    register_model,
    typeof_impl,
    unbox,
)

ALIGNMENT = 64  # bytes: the widest register, so that no access crosses a line of the cache


class LaneArray:
    """Array of W-lane numbers.

    Parameters
    ----------
    rows, fields, lanes : int
        Shape.
    dtype : type
        np.float64 or np.float32.

    Attributes
    ----------
    data : (rows, fields, lanes) array
        The values, in order of memory; zero at first.
    """

    def __init__(self, rows: int, fields: int, lanes: int, dtype: type = np.float64) -> None:
        size = rows * fields * lanes * np.dtype(dtype).itemsize
        memory = np.zeros(size + ALIGNMENT, dtype=np.uint8)
        first = -memory.ctypes.data % ALIGNMENT
        self.data = memory[first : first + size].view(dtype).reshape(rows, fields, lanes)


class _Lanes(types.Type):
    def __init__(self, dtype: types.Float, count: int) -> None:
        self.dtype, self.count = dtype, count
        super().__init__(name=f"Lanes({dtype} x {count})")


class _Mask(types.Type):
    def __init__(self, count: int) -> None:
        self.count = count
        super().__init__(name=f"Mask({count})")


class _LaneArray(types.Type):
    def __init__(self, dtype: types.Float, count: int) -> None:
        self.dtype, self.count = dtype, count
        self.array = types.Array(dtype, 3, "C")
        self.element = _Lanes(dtype, count)
        super().__init__(name=f"LaneArray({dtype} x {count})")


def _vector(kind: _Lanes) -> ir.VectorType:
    return ir.VectorType(ir.FloatType() if kind.dtype == types.float32 else ir.DoubleType(), kind.count)


@register_model(_Lanes)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, manager, kind):
        super().__init__(manager, kind, _vector(kind))


@register_model(_Mask)
class _MaskModel(models.PrimitiveModel):
    def __init__(self, manager, kind):
        super().__init__(manager, kind, ir.VectorType(ir.IntType(1), kind.count))


@register_model(_LaneArray)
class _LaneArrayModel(models.StructModel):
    def __init__(self, manager, kind):
        super().__init__(manager, kind, [("data", kind.array)])


@typeof_impl.register(LaneArray)
def _type_of_lane_array(value, context):
    dtype = types.float32 if value.data.dtype == np.float32 else types.float64
    return _LaneArray(dtype, value.data.shape[2])


@unbox(_LaneArray)
def _unbox_lane_array(kind, value, context):
    data = context.pyapi.object_getattr_string(value, "data")
    native = context.unbox(kind.array, data)
    context.pyapi.decref(data)
    box = cgutils.create_struct_proxy(kind)(context.context, context.builder)
    box.data = native.value
    return NativeValue(box._getvalue(), is_error=native.is_error)


# -- plain numbers and other precision, for all lanes -------------------------------------------------------


def _converted(context, builder, value, kind, wanted: _Lanes):
    """A value of any numeric type or precision as one of type `wanted`."""
    if isinstance(kind, _Lanes):
        if kind == wanted:
            return value
        narrows = wanted.dtype == types.float32
        return (builder.fptrunc if narrows else builder.fpext)(value, _vector(wanted))
    plain = context.cast(builder, value, kind, wanted.dtype)
    vector = _vector(wanted)
    first = builder.insert_element(ir.Constant(vector, ir.Undefined), plain, ir.Constant(ir.IntType(32), 0))
    zeros = ir.Constant(ir.VectorType(ir.IntType(32), wanted.count), [0] * wanted.count)
    return builder.shuffle_vector(first, ir.Constant(vector, ir.Undefined), zeros)


def _common(a, b):
    """The lanes' type of an operation, or None."""
    if isinstance(a, _Lanes) and isinstance(b, _Lanes):
        return a if a == b else None
    for one, other in ((a, b), (b, a)):
        if isinstance(one, _Lanes) and isinstance(other, types.Number):
            return one
    return None


def _define_arithmetic(op, instruction: str) -> None:
    @infer_global(op)
    class Arithmetic(AbstractTemplate):
        def generic(self, arguments, keywords):
            if len(arguments) == 2 and (kind := _common(*arguments)):
                return signature(kind, *arguments)

    def build(context, builder, sig, arguments):
        kind = sig.return_type
        a, b = (_converted(context, builder, x, t, kind) for x, t in zip(arguments, sig.args, strict=True))
        return getattr(builder, instruction)(a, b)

    for pair in ((_Lanes, _Lanes), (_Lanes, types.Number), (types.Number, _Lanes)):
        lower_builtin(op, *pair)(build)


def _define_comparison(op, symbol: str) -> None:
    @infer_global(op)
    class Comparison(AbstractTemplate):
        def generic(self, arguments, keywords):
            if len(arguments) == 2 and (kind := _common(*arguments)):
                return signature(_Mask(kind.count), *arguments)

    def build(context, builder, sig, arguments):
        kind = _common(*sig.args)
        a, b = (_converted(context, builder, x, t, kind) for x, t in zip(arguments, sig.args, strict=True))
        return builder.fcmp_ordered(symbol, a, b)

    for pair in ((_Lanes, _Lanes), (_Lanes, types.Number), (types.Number, _Lanes)):
        lower_builtin(op, *pair)(build)


def _define_logic(op, instruction: str) -> None:
    @infer_global(op)
    class Logic(AbstractTemplate):
        def generic(self, arguments, keywords):
            if len(arguments) == 2 and isinstance(arguments[0], _Mask) and arguments[0] == arguments[1]:
                return signature(arguments[0], *arguments)

    @lower_builtin(op, _Mask, _Mask)
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
class _Negation(AbstractTemplate):
    def generic(self, arguments, keywords):
        if isinstance(arguments[0], _Lanes):
            return signature(arguments[0], *arguments)


@lower_builtin(operator.neg, _Lanes)
def _negate(context, builder, sig, arguments):
    return builder.fneg(arguments[0])


@infer_global(operator.invert)
class _Inversion(AbstractTemplate):
    def generic(self, arguments, keywords):
        if isinstance(arguments[0], _Mask):
            return signature(arguments[0], *arguments)


@lower_builtin(operator.invert, _Mask)
def _invert(context, builder, sig, arguments):
    return builder.not_(arguments[0])


# -- places of an array -------------------------------------------------------------------------------------


@infer_global(operator.getitem)
class _Load(AbstractTemplate):
    def generic(self, arguments, keywords):
        if isinstance(arguments[0], _LaneArray):
            return signature(arguments[0].element, arguments[0], types.UniTuple(types.intp, 2))


@infer_global(operator.setitem)
class _Store(AbstractTemplate):
    def generic(self, arguments, keywords):
        array, _, value = arguments
        if isinstance(array, _LaneArray) and isinstance(value, _Lanes | types.Number):
            return signature(types.none, array, types.UniTuple(types.intp, 2), value)


def _place(context, builder, kind, array, index):
    """Pointer to the lanes at a place."""
    box = cgutils.create_struct_proxy(kind)(context, builder, value=array)
    data = cgutils.create_struct_proxy(kind.array)(context, builder, value=box.data)
    row, field = cgutils.unpack_tuple(builder, index)
    fields = cgutils.unpack_tuple(builder, data.shape)[1]
    flat = builder.add(builder.mul(row, fields), field)
    flat = builder.mul(flat, ir.Constant(flat.type, kind.count))
    return builder.bitcast(builder.gep(data.data, [flat]), _vector(kind.element).as_pointer())


def _alignment(kind: _LaneArray) -> int:
    return min(kind.dtype.bitwidth // 8 * kind.count, ALIGNMENT)


@lower_builtin(operator.getitem, _LaneArray, types.UniTuple)
def _load(context, builder, sig, arguments):
    kind = sig.args[0]
    return builder.load(_place(context, builder, kind, *arguments), align=_alignment(kind))


@lower_builtin(operator.setitem, _LaneArray, types.UniTuple, _Lanes)
@lower_builtin(operator.setitem, _LaneArray, types.UniTuple, types.Number)
def _store(context, builder, sig, arguments):
    kind = sig.args[0]
    value = _converted(context, builder, arguments[2], sig.args[2], kind.element)
    place = _place(context, builder, kind, *arguments[:2])
    builder.store(value, place, align=_alignment(kind))
    return context.get_dummy_value()


# -- functions ----------------------------------------------------------------------------------------------


def _library(name: str):
    """A function of lanes that the processor has: `llvm.<name>`."""

    def build(context, builder, sig, arguments):
        kind = sig.return_type
        values = [_converted(context, builder, x, t, kind) for x, t in zip(arguments, sig.args, strict=True)]
        vector = _vector(kind)
        suffix = f"v{kind.count}f{kind.dtype.bitwidth}"
        function_type = ir.FunctionType(vector, [vector] * len(values))
        function = cgutils.get_or_insert_function(builder.module, function_type, f"llvm.{name}.{suffix}")
        return builder.call(function, values)

    return build


@intrinsic
def sqrt(context, x):
    """Square root of each lane."""
    return x(x), _library("sqrt")


@intrinsic
def absolute(context, x):
    """Absolute value of each lane."""
    return x(x), _library("fabs")


@intrinsic
def nearest_integer(context, x):
    """Nearest whole number of each lane."""
    return x(x), _library("rint")


@intrinsic
def with_sign_of(context, size, sign):
    """`size` with the sign of `sign`, lane by lane."""
    return size(size, sign), _library("copysign")


@intrinsic
def fma(context, a, b, c):
    """A b + c in each lane, rounded once."""
    kind = next(t for t in (a, b, c) if isinstance(t, _Lanes))
    return kind(a, b, c), _library("fma")


@intrinsic
def select(context, mask, yes, no):
    """`yes` in lanes where `mask` holds, `no` in the others."""
    kind = yes if isinstance(yes, _Lanes) else no

    def build(context, builder, sig, arguments):
        a, b = (
            _converted(context, builder, x, t, sig.return_type)
            for x, t in zip(arguments[1:], sig.args[1:], strict=True)
        )
        return builder.select(arguments[0], a, b)

    return kind(mask, yes, no), build


@intrinsic
def like(context, x, pattern):
    """A number, or lanes of another precision, as lanes of `pattern`'s type."""

    def build(context, builder, sig, arguments):
        return _converted(context, builder, arguments[0], sig.args[0], sig.return_type)

    return pattern(x, pattern), build


@intrinsic
def anywhere(context, mask):
    """Whether a mask holds in any lane."""

    def build(context, builder, sig, arguments):
        bits = builder.bitcast(arguments[0], ir.IntType(sig.args[0].count))
        return builder.icmp_unsigned("!=", bits, ir.Constant(bits.type, 0))

    return types.boolean(mask), build


@intrinsic
def _two_to(context, n):
    """2^n of whole numbers n within the range of the exponent."""

    def build(context, builder, sig, arguments):
        kind = sig.return_type
        bits, mantissa, bias = (32, 23, 127) if kind.dtype == types.float32 else (64, 52, 1023)
        whole = ir.VectorType(ir.IntType(bits), kind.count)

        def constant(value):
            return ir.Constant(whole, [value] * kind.count)

        shifted = builder.add(builder.fptosi(arguments[0], whole), constant(bias))
        return builder.bitcast(builder.shl(shifted, constant(mantissa)), _vector(kind))

    return n(n), build


def minimum(a, b):
    """The lesser, lane by lane; b where one is not a number."""
    raise NotImplementedError("for kernels")


def maximum(a, b):
    """The greater, lane by lane; b where one is not a number."""
    raise NotImplementedError("for kernels")


def decay(x):
    """e^-x of each lane for x >= 0, to two units in the last place.

    x is held within the range of the exponent, at its upper end where it is not a number.
    """
    raise NotImplementedError("for kernels")


def reciprocals(a, b):
    """1 / a and 1 / b by one division, the dearest of operations; a b must be within the exponent's range."""
    raise NotImplementedError("for kernels")


@overload(minimum, inline="always")
def _minimum(a, b):
    return lambda a, b: select(a < b, a, b)


@overload(maximum, inline="always")
def _maximum(a, b):
    return lambda a, b: select(a > b, a, b)


@overload(reciprocals, inline="always")
def _reciprocals(a, b):
    def both(a, b):
        per_both = 1.0 / (a * b)
        return b * per_both, a * per_both

    return both


# ln 2 in two parts, the first with bits to spare, so that n times it is exact; largest argument
_SINGLE = (0.693359375, -2.12194440e-4, 87.0)
_DOUBLE = (0.693145751953125, 1.42860682030941723212e-6, 708.0)
_PER_LN_2 = 1.4426950408889634


@overload(decay)
def _decay(x):
    if not isinstance(x, _Lanes):
        return None
    high, low, largest = _SINGLE if x.dtype == types.float32 else _DOUBLE
    # Taylor's terms are as good as any on |r| < ln 2 / 2: the first one left out is below the round-off
    terms = 7 if x.dtype == types.float32 else 13
    factors = tuple(1.0 / float(np.prod(np.arange(1.0, k + 1.0))) for k in range(terms, -1, -1))
    first, others = factors[0], factors[1:]

    def compute(x):
        x = minimum(x, largest)
        n = nearest_integer(x * -_PER_LN_2)
        r = fma(n, -low, fma(n, -high, -x))
        total = like(first, x)
        for factor in others:
            total = fma(total, r, factor)
        return total * _two_to(n)

    return compute
