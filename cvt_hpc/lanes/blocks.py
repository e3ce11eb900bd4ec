"""Products and triangular factors of small blocks in lanes, for kernels.

A block of b x b numbers lies in a row of a `LaneArray` by columns: entry (r, c) in field first + r + b c, so
that each lane has a block of its own. Columns of b numbers lie one after the other likewise. The size b is
the length of a tuple that kernels are given, so that the compiler knows it.

Some columns at a time stay in registers from the first product to the last, and each number of a block that
is read serves all of them. The instructions of such a tile are handed to the compiler one by one, without the
loops around them, which saves it most of its time.

Factors P D Q = A are found without exchanges of rows; P and Q have a unit diagonal. They stand in the place
of A: P below the diagonal, 1 / D on it, and Q above.
"""

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from cvt_hpc.lanes.arithmetic import place
from cvt_hpc.lanes.kinds import ALIGNMENT, Mask, vector_type

_TILE = 16  # numbers in registers at a time: half of those that the processor has
SMALLEST_PIVOT = 1e-13  # of the number on the diagonal as it was given: rounding leaves as much of nothing


class _Lanes:
    """Instructions for lanes, and places of an array of them."""

    def __init__(self, context: Any, builder: Any, kind: Any) -> None:
        self._context, self.builder = context, builder
        self._register = vector_type(kind.element)
        self._alignment = min(kind.dtype.bitwidth // 8 * kind.count, ALIGNMENT)
        self._suffix = f"v{kind.count}f{kind.dtype.bitwidth}"

    def constant(self, value: float) -> Any:
        return ir.Constant(self._register, [value] * self._register.count)

    def call(self, name: str, *values: Any) -> Any:
        function = ir.FunctionType(self._register, [self._register] * len(values))
        name = f"llvm.{name}.{self._suffix}"
        return self.builder.call(cgutils.get_or_insert_function(self.builder.module, function, name), values)

    def at(self, kind: Any, array: Any, row: Any, field: Any) -> Any:
        return place(self._context, self.builder, kind, array, row, field)

    def load(self, first: Any, field: int) -> Any:
        return self.builder.load(self._moved(first, field), align=self._alignment)

    def store(self, value: Any, first: Any, field: int) -> None:
        self.builder.store(value, self._moved(first, field), align=self._alignment)

    def _moved(self, first: Any, field: int) -> Any:
        return self.builder.gep(first, [ir.Constant(ir.IntType(64), field)])


def _tile(lanes: _Lanes, b: int, width: int, to: Any, starts: bool, factors: Any, terms: tuple) -> None:
    """Write the instructions for columns: their old values (or zero), plus products, divided by factors.

    A term is a sign, whether the block is transposed, the block and the columns that it multiplies.
    """
    total = [[lanes.load(to, r + b * c) if starts else None for r in range(b)] for c in range(width)]
    for sign, transposed, block, columns in terms:
        for k in range(b):
            ys = [lanes.load(columns, k + b * c) for c in range(width)]
            if sign < 0:
                ys = [lanes.builder.fneg(y) for y in ys]
            for r in range(b):
                m = lanes.load(block, k + b * r if transposed else r + b * k)
                for c, y in enumerate(ys):
                    so_far = total[c][r]
                    total[c][r] = (
                        lanes.builder.fmul(m, y) if so_far is None else lanes.call("fma", m, y, so_far)
                    )
    if factors is not None:
        for k in range(b):
            _sweep(lanes, b, factors, total, k, range(k + 1, b))
        for k in range(b):
            per_pivot = lanes.load(factors, k + b * k)
            for column in total:
                column[k] = lanes.builder.fmul(per_pivot, column[k])
        for k in range(b - 1, 0, -1):
            _sweep(lanes, b, factors, total, k, range(k))
    for c, column in enumerate(total):
        for r, value in enumerate(column):
            lanes.store(value, to, r + b * c)


def _sweep(lanes: _Lanes, b: int, factors: Any, total: list, k: int, others: range) -> None:
    """Write the instructions that take the k-th numbers of columns out of others."""
    ys = [lanes.builder.fneg(column[k]) for column in total]
    for r in others:
        m = lanes.load(factors, r + b * k)
        for column, y in zip(total, ys, strict=True):
            column[r] = lanes.call("fma", m, y, column[r])


def _on_columns(starts: bool, divides: bool, *signs: tuple[int, bool]) -> Any:
    """A function for kernels that replaces columns by their old values (or zero) and products.

    It may divide them by factors (multiply by the inverse of their product). Of each product it takes a sign
    and whether the block is transposed. Its arguments are the size, the number of columns and a tuple with
    array, row and first field of these columns, of the factors if it divides, and of block and columns of
    each product. Columns that are read must differ from columns that are written.
    """

    @intrinsic
    def act(context, size, columns, places):
        def build(context, builder, sig, arguments):
            kinds, values = sig.args[2], cgutils.unpack_tuple(builder, arguments[2])
            lanes, b = _Lanes(context, builder, kinds[0]), size.count
            whole = [
                context.cast(builder, v, t, types.intp) if isinstance(t, types.Integer) else v
                for v, t in zip(values, kinds, strict=True)
            ]
            firsts = [lanes.at(kinds[k], *whole[k : k + 3]) for k in range(0, len(kinds), 3)]
            count = context.cast(builder, arguments[1], columns, types.intp)
            factors = firsts[1] if divides else None
            rest = firsts[1 + divides :]

            def loop(start, stop, width):
                step = ir.Constant(count.type, width)
                with cgutils.for_range_slice(builder, start, stop, step, inc=True) as (column, _):
                    numbers = builder.mul(column, ir.Constant(count.type, b))
                    to, *sources = (builder.gep(first, [numbers]) for first in (firsts[0], *rest[1::2]))
                    terms = tuple(
                        (*sign, block, source)
                        for sign, block, source in zip(signs, rest[::2], sources, strict=True)
                    )
                    _tile(lanes, b, width, to, starts, factors, terms)

            width = max(1, _TILE // b)
            tiled = builder.sub(count, builder.srem(count, ir.Constant(count.type, width)))
            loop(ir.Constant(count.type, 0), tiled, width)
            if width > 1:
                loop(tiled, count, 1)
            return context.get_dummy_value()

        return types.none(size, columns, places), build

    return act


# Each takes the size, the number of columns, and places as `_on_columns` has them; x are the columns written.
divide = _on_columns(True, True)  # A^-1 x
add_product = _on_columns(True, False, (1, False))  # x + M y
set_negative_product = _on_columns(False, False, (-1, False))  # -M y
subtract_products = _on_columns(True, False, (-1, False), (-1, False))  # x - M y - N z
subtract_transposed_product = _on_columns(True, False, (-1, True))  # x - M' y
subtract_transposed_product_and_divide = _on_columns(True, True, (-1, True))  # A^-1 (x - M' y)
set_negative_transposed_product_and_divide = _on_columns(False, True, (-1, True))  # -A^-1 M' y


@intrinsic
def factor(context, size, array, row, field, given, given_row, given_field):
    """Replace a block by its factors; a mask of the lanes in which this could be done.

    A pivot is nothing, or no number, if it is not above `SMALLEST_PIVOT` of the k-th of the b numbers given.
    """

    def build(context, builder, sig, arguments):
        lanes, b = _Lanes(context, builder, array), size.count
        row, field, given_row, given_field = (
            context.cast(builder, arguments[k], sig.args[k], types.intp) for k in (2, 3, 5, 6)
        )
        first = lanes.at(array, arguments[1], row, field)
        scale = lanes.at(given, arguments[4], given_row, given_field)
        a = [[lanes.load(first, r + b * c) for r in range(b)] for c in range(b)]
        found = ir.Constant(ir.VectorType(ir.IntType(1), array.count), [1] * array.count)
        for k in range(b):
            pivot = a[k][k]
            least = builder.fmul(lanes.constant(SMALLEST_PIVOT), lanes.call("fabs", lanes.load(scale, k)))
            found = builder.and_(found, builder.fcmp_ordered(">", lanes.call("fabs", pivot), least))
            a[k][k] = per_pivot = builder.fdiv(lanes.constant(1.0), pivot)
            for c in range(k + 1, b):
                a[c][k] = builder.fmul(per_pivot, a[c][k])
                less = builder.fneg(a[c][k])
                for r in range(k + 1, b):
                    a[c][r] = lanes.call("fma", a[k][r], less, a[c][r])
            for r in range(k + 1, b):
                a[k][r] = builder.fmul(per_pivot, a[k][r])
        for c in range(b):
            for r in range(b):
                lanes.store(a[c][r], first, r + b * c)
        return found

    mask = Mask(array.count, array.element.linked)
    return mask(size, array, row, field, given, given_row, given_field), build
