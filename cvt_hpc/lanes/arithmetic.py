"""Sums, products, comparisons and logic of lanes."""

import operator

from numba import types
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import lower_builtin

from cvt_hpc.lanes.kinds import Lanes, Mask, converted


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
    class Arithmetic(AbstractTemplate):
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
    class Comparison(AbstractTemplate):
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
    class Logic(AbstractTemplate):
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
class _Negation(AbstractTemplate):
    def generic(self, arguments, keywords):
        if isinstance(arguments[0], Lanes):
            return signature(arguments[0], *arguments)


@lower_builtin(operator.neg, Lanes)
def _negate(context, builder, sig, arguments):
    return builder.fneg(arguments[0])


@infer_global(operator.invert)
class _Inversion(AbstractTemplate):
    def generic(self, arguments, keywords):
        if isinstance(arguments[0], Mask):
            return signature(arguments[0], *arguments)


@lower_builtin(operator.invert, Mask)
def _invert(context, builder, sig, arguments):
    return builder.not_(arguments[0])
