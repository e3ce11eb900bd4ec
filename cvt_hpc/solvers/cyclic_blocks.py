"""Cyclic block-tridiagonal systems, with a border of a few unknowns that all nodes share.

For the nodes i = 0..n-1 of a closed chain, n at least 2, with blocks of b x b numbers,

    L_i x_{i-1} + A_i x_i + U_i x_{i+1} + B_i g = r_i,    sum_i C_i x_i + D g = s,

where x_{-1} is x_{n-1} and x_n is x_0; an open chain has L_0 = U_{n-1} = 0. The last node separates the
others, which block elimination takes in turn (Golub and Van Loan 2013, sec. 4.5), so that
x_i = y_i - W_i x_{i+1} - S_i x_{n-1}. Rows are exchanged within a block, never between blocks: this is safe
for definite or block diagonally dominant matrices, and may lose digits on others. The border costs one
right-hand side for each of its columns, and the Schur complement D - C M^-1 B.

Rows of blocks and rows of right-hand sides lie in lanes, which makes products of blocks vector instructions.
Blocks are a (n + 1, 5 b) LaneArray, right-hand sides, the `columns`, a (n + 1, b) one, of which the last row
is for the elimination; kernels take `block_size(b)` beside them as `size`.
"""

import numpy as np

from cvt_hpc.kernels import kernel, merged_kernel
from cvt_hpc.lanes import LaneArray, absolute, anywhere, fma, like, maximum

# Blocks of a node: A_i, L_i, U_i, and two of the elimination
DIAGONAL, LOWER, UPPER, _SPIKE, _FILL = range(5)
SMALLEST_PIVOT = 1e-13  # of the largest entry of its column: rounding leaves as much of a singular block


def empty_blocks(n: int, b: int) -> LaneArray:
    """Blocks of size b of a chain of n nodes, at least 2, all zero.

    Entry (j, k) of A_i is `data[i, DIAGONAL * b + j, k]`, likewise LOWER of L_i and UPPER of U_i. Those
    of _SPIKE and _FILL are for the elimination; lanes from b on stay zero.
    """
    return LaneArray(n + 1, 5 * b, _lanes(b))


def empty_columns(n: int, b: int, columns: int) -> LaneArray:
    """Right-hand sides of such a chain, all zero: number j of node i in column c is `data[i, j, c]`."""
    return LaneArray(n + 1, b, _lanes(columns))


def empty_corner(border: int, columns: int) -> LaneArray:
    """[D | s] of a border, all zero: a (1, border) LaneArray, of `columns` numbers a row as `data[0, j, c]`.

    `columns` counts both border and right-hand sides, as that of `empty_columns`.
    """
    return LaneArray(1, border, _lanes(columns))


def block_size(b: int) -> tuple[float, ...]:
    """A tuple of b numbers: kernels take the size of blocks as its length, which the compiler knows."""
    return (0.0,) * b


def _lanes(count: int) -> int:
    return 1 << (count - 1).bit_length()


@kernel
def factor(blocks: LaneArray, size: tuple[float, ...]) -> bool:
    """Factor a matrix in the place of its blocks DIAGONAL, LOWER and UPPER; whether this could be done.

    If not, the matrix is singular up to rounding, needs exchanges between blocks, or has entries that are not
    finite; the content of `blocks` is then of no use.
    """
    b = len(size)
    spare = blocks.rows - 1
    last = spare - 1
    for k in range(b):
        blocks[spare, k] = 0.0
        blocks.data[spare, k, k] = 1.0
    scale_of_last = like(0.0, blocks[0, 0])
    for r in range(b):
        scale_of_last = maximum(scale_of_last, absolute(blocks[last, r]))
    for i in range(last):
        scale = like(0.0, blocks[0, 0])
        for r in range(b):
            scale = maximum(scale, absolute(blocks[i, r]))
        if i == 0:
            for r in range(b):
                blocks[i, _SPIKE * b + r] = blocks[i, LOWER * b + r]
                blocks[i, _FILL * b + r] = blocks[last, UPPER * b + r]
        else:
            for r in range(b):
                blocks[i, _SPIKE * b + r] = 0.0
                blocks[i, _FILL * b + r] = 0.0
            _subtract_product(blocks, i, DIAGONAL * b, i, LOWER * b, i - 1, UPPER * b, size)
            _subtract_product(blocks, i, _SPIKE * b, i, LOWER * b, i - 1, _SPIKE * b, size)
            _subtract_product(blocks, i, _FILL * b, i - 1, _FILL * b, i - 1, UPPER * b, size)
        if i == last - 1:  # whose neighbours on both sides are the last node
            for r in range(b):
                blocks[i, _SPIKE * b + r] = blocks[i, _SPIKE * b + r] + blocks[i, UPPER * b + r]
                blocks[i, UPPER * b + r] = 0.0
                blocks[i, _FILL * b + r] = blocks[i, _FILL * b + r] + blocks[last, LOWER * b + r]
        regular = _invert(blocks, i, scale, size)
        if not regular:
            return False
        _premultiply(blocks, i, UPPER * b, size)
        _premultiply(blocks, i, _SPIKE * b, size)
        _subtract_product(blocks, last, DIAGONAL * b, i, _FILL * b, i, _SPIKE * b, size)
    regular = _invert(blocks, last, scale_of_last, size)
    return regular


@kernel
def solve(blocks: LaneArray, columns: LaneArray, size: tuple[float, ...]) -> None:
    """Solve for all columns in their place, with blocks after `factor`."""
    b = len(size)
    last = blocks.rows - 2
    for i in range(last):
        if i > 0:
            _subtract_from_column(blocks, i, LOWER * b, columns, i - 1, i, size)
        _premultiply_column(blocks, i, columns, size)
        _subtract_from_column(blocks, i, _FILL * b, columns, i, last, size)
    _premultiply_column(blocks, last, columns, size)
    for i in range(last - 1, -1, -1):
        _subtract_from_column(blocks, i, UPPER * b, columns, i + 1, i, size)
        _subtract_from_column(blocks, i, _SPIKE * b, columns, last, i, size)


@kernel
def solve_bordered(
    blocks: LaneArray, columns: LaneArray, rows: np.ndarray, corner: LaneArray, size: tuple[float, ...]
) -> bool:
    """Solve for all columns with a border of g unknowns; whether the Schur complement is regular.

    `blocks` come from a `factor` that has succeeded: without its border the matrix has to be regular.
    `columns` hold [B | r], the g columns of the border first, `rows` (n, g, b) C, and `corner` [D | s] is a
    (1, g) LaneArray with as many lanes as `columns`. The solutions x are in the place of r then, the border's
    unknowns in that of s. If the complement is not regular, the content of the arrays is of no use.
    """
    n, g, b = rows.shape
    solve(blocks, columns, size)
    for i in range(n):
        for j in range(g):
            total = corner[0, j]
            for k in range(b):
                total = fma(-rows[i, j, k], columns[i, k], total)
            corner[0, j] = total
    if not _solve_corner(corner.data[0]):
        return False
    for i in range(n):
        for k in range(b):
            total = columns[i, k]
            for j in range(g):
                total = fma(-columns.data[i, k, j], corner[0, j], total)
            columns[i, k] = total
    return True


@merged_kernel
def _subtract_product(blocks, i, to, j, left, k, right, size):
    for r in range(len(size)):
        total = blocks[i, to + r]
        for c in range(len(size)):
            total = fma(-blocks.data[j, left + r, c], blocks[k, right + c], total)
        blocks[i, to + r] = total


@merged_kernel
def _premultiply(blocks, i, block, size):
    """Multiply a block of node i by the inverse of its pivot."""
    b, spare = len(size), blocks.rows - 1
    for r in range(b):
        total = like(0.0, blocks[i, block])
        for c in range(b):
            total = fma(blocks.data[i, r, c], blocks[i, block + c], total)
        blocks[spare, b + r] = total
    for r in range(b):
        blocks[i, block + r] = blocks[spare, b + r]


@merged_kernel
def _invert(blocks, i, scale, size):
    """Replace A of node i by its inverse (Gauss-Jordan); False where a pivot is nothing beside its column.

    Only whole rows are written: a row read soon after one number of it was written would wait for memory.
    """
    b, spare = len(size), blocks.rows - 1
    regular = True
    for r in range(b):
        blocks[spare, b + r] = blocks[i, r]
        blocks[i, r] = blocks[spare, r]
    for k in range(b):
        largest = k
        for r in range(k + 1, b):
            if abs(blocks.data[spare, b + r, k]) > abs(blocks.data[spare, b + largest, k]):
                largest = r
        row, inverse = blocks[spare, b + largest], blocks[i, largest]
        regular = regular and anywhere(blocks[spare, k] * (absolute(row) - SMALLEST_PIVOT * scale) > 0.0)
        factor = 1.0 / blocks.data[spare, b + largest, k]
        if largest != k:
            blocks[spare, b + largest], blocks[i, largest] = blocks[spare, b + k], blocks[i, k]
        row, inverse = factor * row, factor * inverse
        blocks[spare, b + k], blocks[i, k] = row, inverse
        for r in range(b):
            if r != k:
                factor = -blocks.data[spare, b + r, k]
                blocks[spare, b + r] = fma(factor, row, blocks[spare, b + r])
                blocks[i, r] = fma(factor, inverse, blocks[i, r])
    return regular


@merged_kernel
def _subtract_from_column(blocks, i, block, columns, source, to, size):
    for r in range(len(size)):
        total = columns[to, r]
        for c in range(len(size)):
            total = fma(-blocks.data[i, block + r, c], columns[source, c], total)
        columns[to, r] = total


@merged_kernel
def _premultiply_column(blocks, i, columns, size):
    b, spare = len(size), columns.rows - 1
    for r in range(b):
        total = like(0.0, columns[i, 0])
        for c in range(b):
            total = fma(blocks.data[i, r, c], columns[i, c], total)
        columns[spare, r] = total
    for r in range(b):
        columns[i, r] = columns[spare, r]


@kernel
def _solve_corner(rows):
    """Solve [D | s] in its place (Gauss-Jordan); False where a pivot is nothing beside its column."""
    g, width = rows.shape[0], rows.shape[1]
    for k in range(g):
        largest, scale = k, 0.0
        for r in range(g):
            scale = max(scale, abs(rows[r, k]))
            if r > k and abs(rows[r, k]) > abs(rows[largest, k]):
                largest = r
        if not abs(rows[largest, k]) > SMALLEST_PIVOT * scale:
            return False
        for c in range(width):
            rows[k, c], rows[largest, c] = rows[largest, c], rows[k, c]
        pivot = rows[k, k]
        for c in range(width):
            rows[k, c] /= pivot
        for r in range(g):
            if r != k:
                multiple = rows[r, k]
                for c in range(width):
                    rows[r, c] -= multiple * rows[k, c]
    return True
