"""Functions of lanes and of plain numbers: functions of the processor, and functions made of them."""

from math import factorial

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, overload

from cvt_hpc.lanes.kinds import Lanes, converted, vector_type


def _as(context, builder, value, kind, wanted):
    """A value of one type in another, be that lanes or a plain number."""
    if isinstance(wanted, Lanes):
        return converted(context, builder, value, kind, wanted)
    return context.cast(builder, value, kind, wanted)


def _common(*kinds):
    """The type of a result of numbers: lanes where any is, else a plain number."""
    return next((kind for kind in kinds if isinstance(kind, Lanes)), types.float64)


def _library(name: str, *kinds):
    """A function that the processor has, `llvm.<name>`, of numbers of these types."""
    kind = _common(*kinds)

    def build(context, builder, sig, arguments):
        values = [_as(context, builder, x, t, kind) for x, t in zip(arguments, sig.args, strict=True)]
        own, suffix = (
            (vector_type(kind), f"v{kind.count}f{kind.dtype.bitwidth}")
            if isinstance(kind, Lanes)
            else (ir.DoubleType(), "f64")
        )
        function_type = ir.FunctionType(own, [own] * len(values))
        function = cgutils.get_or_insert_function(builder.module, function_type, f"llvm.{name}.{suffix}")
        return builder.call(function, values)

    return kind(*kinds), build


@intrinsic
def sqrt(context, x):
    """Square root of each lane."""
    return _library("sqrt", x)


@intrinsic
def absolute(context, x):
    """Absolute value of each lane."""
    return _library("fabs", x)


@intrinsic
def nearest_integer(context, x):
    """Nearest whole number of each lane."""
    return _library("rint", x)


@intrinsic
def with_sign_of(context, size, sign):
    """`size` with the sign of `sign`, lane by lane."""
    return _library("copysign", size, sign)


@intrinsic
def fma(context, a, b, c):
    """A b + c in each lane, rounded once."""
    return _library("fma", a, b, c)


@intrinsic
def select(context, mask, yes, no):
    """`yes` in lanes where `mask` holds, `no` in the others."""
    kind = _common(yes, no)

    def build(context, builder, sig, arguments):
        a, b = (_as(context, builder, x, t, kind) for x, t in zip(arguments[1:], sig.args[1:], strict=True))
        return builder.select(arguments[0], a, b)

    return kind(mask, yes, no), build


def _chosen(a, b, comparison: str):
    """The type of one of two numbers, and how to choose `a` where the comparison holds, else `b`."""
    kind = _common(a, b)

    def build(context, builder, sig, arguments):
        one, other = (_as(context, builder, x, t, kind) for x, t in zip(arguments, sig.args, strict=True))
        return builder.select(builder.fcmp_ordered(comparison, one, other), one, other)

    return kind(a, b), build


@intrinsic
def minimum(context, a, b):
    """The lesser, lane by lane; b where one is not a number."""
    return _chosen(a, b, "<")


@intrinsic
def maximum(context, a, b):
    """The greater, lane by lane; b where one is not a number."""
    return _chosen(a, b, ">")


@intrinsic
def reciprocals(context, a, b):
    """1 / a and 1 / b by one division, the dearest of operations; a b must be within the exponent's range."""

    def build(context, builder, sig, arguments):
        one, other = arguments
        unit = _as(context, builder, ir.Constant(ir.DoubleType(), 1.0), types.float64, a)
        per_both = builder.fdiv(unit, builder.fmul(one, other))
        both = builder.fmul(other, per_both), builder.fmul(one, per_both)
        return context.make_tuple(builder, sig.return_type, both)

    return types.UniTuple(a, 2)(a, a), build


@intrinsic
def like(context, x, pattern):
    """A number, or lanes of another precision, in `pattern`'s type, which may be a plain number's."""

    def build(context, builder, sig, arguments):
        return _as(context, builder, arguments[0], sig.args[0], sig.return_type)

    return pattern(x, pattern), build


@intrinsic
def anywhere(context, mask):
    """Whether a mask holds in any lane; a plain truth value stays as it is."""

    def build(context, builder, sig, arguments):
        if sig.args[0] == types.boolean:
            return arguments[0]
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
        return builder.bitcast(builder.shl(shifted, constant(mantissa)), vector_type(kind))

    return n(n), build


def decay(x):
    """e^-x of each lane for x >= 0, to two units in the last place.

    x is held within the range of the exponent, at its upper end where it is not a number. Of a plain number
    it is the library's exponential.
    """
    raise NotImplementedError("for kernels")


# ln 2 in two parts, the first with bits to spare, so that n times it is exact; largest argument
_SINGLE = (0.693359375, -2.12194440e-4, 87.0)
_DOUBLE = (0.693145751953125, 1.42860682030941723212e-6, 708.0)
_PER_LN_2 = 1.4426950408889634


@overload(decay)
def _decay(x):
    if not isinstance(x, Lanes):
        return lambda x: np.exp(-x)
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


@intrinsic
def _over_two_to(context, x, shifted):
    """Quotient x / 2^n, with n + 1.5 2^m as `shifted`: m bits of a mantissa, n below the exponent of x."""

    def build(context, builder, sig, arguments):
        kind = sig.return_type
        bits, mantissa = _BITS[kind.dtype]
        whole = ir.VectorType(ir.IntType(bits), kind.count)
        one, other = (builder.bitcast(argument, whole) for argument in arguments)
        lower = builder.shl(other, ir.Constant(whole, [mantissa] * kind.count))
        return builder.bitcast(builder.sub(one, lower), vector_type(kind))

    return x(x, x), build


_BITS = {types.float32: (32, 23), types.float64: (64, 52)}  # of a number and of its mantissa


def halving(x):
    """2^-x of each lane for x >= 0, to two roundings: less work than `decay`.

    x is held within the range of the exponent. Of a plain number it is the library's.
    """
    raise NotImplementedError("for kernels")


@overload(halving)
def _halving(x):
    if not isinstance(x, Lanes):
        return lambda x: np.exp2(-x)
    # The series without its last Chebyshev polynomials is off by 2e-9 and 3e-18 between -1/2 and 1/2. A
    # number so large that its last bit is 1 rounds the number that is added to it.
    degree, largest = (6, 125.0) if x.dtype == types.float32 else (11, 1021.0)
    large = 1.5 * 2.0 ** _BITS[x.dtype][1]
    series = np.polynomial.Polynomial([np.log(2.0) ** k / factorial(k) for k in range(18)])
    short = series.convert(kind=np.polynomial.Chebyshev, domain=[-0.5, 0.5]).truncate(degree + 1)
    first, *rest = (float(factor) for factor in short.convert(kind=np.polynomial.Polynomial).coef[::-1])
    others = tuple(rest)

    def compute(x):
        x = minimum(x, largest)
        shifted = x + large
        r = (shifted - large) - x
        total = like(first, x)
        for factor in others:
            total = fma(total, r, factor)
        return _over_two_to(total, shifted)

    return compute
