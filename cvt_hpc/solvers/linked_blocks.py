"""Cyclic block-tridiagonal systems of blocks of any size, in linked lanes.

    L_i x_{i-1} + A_i x_i + U_i x_{i+1} = f_i,    L_i = U_{i-1}',

for the nodes i of a ring with blocks of b x b numbers: what couples two nodes is symmetric, as a law between
both is, and A_i is any block. The ring is cut into W parts, one for each lane (`lanes.rings`), that are
eliminated at the same time. The last node of a part is its separator. Elimination runs forward through a part
(Golub and Van Loan 2013, sec. 4.5) and keeps two more blocks: S, the coupling of the node at hand to the
separator behind, and V, that of the separator behind to the node at hand. With [U^ S^ f^] = A^-1 [U S f],

    A -= L U^,  S = -L S^,  f -= L f^         of the next node, where L is the transpose of U,
    V = -V U^                                 of the next node,
    A -= V S^,  f -= V f^                     of the separator behind.

The small ring of separators, one in each lane, is halved by cyclic reduction until each is its own neighbour
(Golub and Van Loan 2013, sec. 4.5.4). Then every part is solved backward, x -= U^ x_ahead + S^ x_separator.
With r right-hand sides a node takes (6 + 1/3) b^3 + 5 b^2 r products and sums, and the separators as much as
log2(W) more nodes of a part.

There is no pivoting: the blocks have to be mass over step plus parts that are nearly symmetric and positive.
`solvers.cyclic_blocks` solves systems with any L, and exchanges rows within a block. It has the rows of one
block in registers, and goes around the ring one node after the other. Here a register holds the same number
of W nodes far apart, which is as kernels of a chain compute them.

A row of blocks holds [A | U | S | f], all by columns: b^2 numbers each of A, U and S, which only the solver
uses, and b for each right-hand side (`field_of_right`).

`solve_small` solves a dense system of a few equations, as the border of a chain has them.
"""

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.lanes import LaneArray, anywhere, behind, from_ahead, from_behind
from cvt_hpc.lanes.blocks import (
    add_product,
    divide,
    factor,
    set_negative_product,
    set_negative_transposed_product_and_divide,
    subtract_products,
    subtract_transposed_product,
    subtract_transposed_product_and_divide,
)

# Rows of the scratch, of the same fields as those of blocks:
# change of A and f by the separators behind; their couplings V to two nodes in U and S
_SEPARATOR = 0
# couplings U of two nodes as they were, in A and U; later, separators as those ahead of them see them
_BEHIND = 1
# the diagonal of A as it was given, in A; later, separators as those behind them see them
_AHEAD = 2
_ROWS = 3


def field_of_right(b: int) -> int:
    """Field of a row at which the right-hand sides begin."""
    return 3 * b * b


def empty_system(nodes: int, parts: int, b: int, columns: int) -> LaneArray:
    """The system of a ring, (nodes / parts, b (3 b + columns)), all zero.

    The nodes are cut into `parts`, a power of 2 that divides `nodes`. Entry (r, c) of A_i is field r + b c,
    and that of U_i is b^2 + r + b c; number r of right-hand side c is `field_of_right(b)` + r + b c.
    """
    return LaneArray(nodes // parts, b * (3 * b + columns), parts, linked=parts > 1)


def empty_scratch(parts: int, b: int, columns: int) -> LaneArray:
    """Work space of `solve` for such a system."""
    return LaneArray(_ROWS, b * (3 * b + columns), parts, linked=parts > 1)


@kernel
def solve(blocks: LaneArray, scratch: LaneArray, size: tuple[float, ...]) -> bool:
    """Solve an `empty_system` with A, U and f, in the place of f; whether this could be done.

    A and U are lost. All pivots have to be numbers above `lanes.blocks.SMALLEST_PIVOT` of the diagonal as it
    was given. Else the matrix is singular up to rounding or needs exchanges of rows, and what `blocks` hold
    then is of no use. `scratch` is of `empty_scratch`, `size` of `cyclic_blocks.block_size(b)`.
    """
    is_regular = _eliminate(blocks, scratch, size)
    is_regular = _solve_separators(blocks, scratch, size) and is_regular
    _substitute(blocks, scratch, size)
    return is_regular


@kernel
def _eliminate(blocks, scratch, size):
    """Eliminate the nodes of all parts but the last ones, the separators.

    Their rows then have the coupling to the separators behind in place of S and to those ahead in place of U.
    """
    b = len(size)
    u, s, right = b * b, 2 * b * b, 3 * b * b
    fields = blocks.data.shape[1]
    columns, last = (fields - right) // b, blocks.rows - 1
    for c in range(b):
        for r in range(b):
            blocks[0, s + r + b * c] = behind(blocks, 0, u + c + b * r)
            scratch[_SEPARATOR, u + r + b * c] = behind(blocks, 0, u + r + b * c)
            scratch[_SEPARATOR, r + b * c] = 0.0
    for field in range(right, fields):
        scratch[_SEPARATOR, field] = 0.0
    v, next_v = u, s
    up, next_up = 0, u
    is_regular = True
    for j in range(last):
        _keep_diagonal(blocks, j, scratch, size)
        for field in range(b * b):
            scratch[_BEHIND, next_up + field] = blocks[j, u + field]
        if j > 0:
            subtract_transposed_product(size, b, (blocks, j, 0, scratch, _BEHIND, up, blocks, j - 1, u))
        is_regular = _factor(blocks, j, scratch, size) and is_regular
        if j > 0:
            divide(size, b, (blocks, j, u, blocks, j, 0))
            set_negative_transposed_product_and_divide(
                size, b, (blocks, j, s, blocks, j, 0, scratch, _BEHIND, up, blocks, j - 1, s)
            )
            subtract_transposed_product_and_divide(
                size, columns, (blocks, j, right, blocks, j, 0, scratch, _BEHIND, up, blocks, j - 1, right)
            )
        else:
            divide(size, 2 * b + columns, (blocks, j, u, blocks, j, 0))
        add_product(size, b, (scratch, _SEPARATOR, 0, scratch, _SEPARATOR, v, blocks, j, s))
        add_product(size, columns, (scratch, _SEPARATOR, right, scratch, _SEPARATOR, v, blocks, j, right))
        set_negative_product(size, b, (scratch, _SEPARATOR, next_v, scratch, _SEPARATOR, v, blocks, j, u))
        v, next_v = next_v, v
        up, next_up = next_up, up
    _keep_diagonal(blocks, last, scratch, size)
    if last > 0:
        for field in range(s, right):
            blocks[last, field] = 0.0
        subtract_transposed_product(size, b, (blocks, last, 0, scratch, _BEHIND, up, blocks, last - 1, u))
        subtract_transposed_product(
            size, b + columns, (blocks, last, s, scratch, _BEHIND, up, blocks, last - 1, s)
        )
    for field in range(b * b):
        blocks[last, field] -= from_ahead(scratch[_SEPARATOR, field])
        blocks[last, u + field] = from_ahead(scratch[_SEPARATOR, v + field])
    for field in range(right, fields):
        blocks[last, field] -= from_ahead(scratch[_SEPARATOR, field])
    return is_regular


@kernel
def _solve_separators(blocks, scratch, size):
    """Solve the ring of separators, in the place of their right-hand sides."""
    b = len(size)
    u, s, right = b * b, 2 * b * b, 3 * b * b
    fields = blocks.data.shape[1]
    columns, last, parts = (fields - right) // b, blocks.rows - 1, blocks.data.shape[2]
    is_regular = True
    distance = 1  # to the neighbours, which are taken out
    while distance < parts:
        for field in range(fields):
            scratch[_BEHIND, field] = blocks[last, field]
        is_regular = _factor(scratch, _BEHIND, scratch, size) and is_regular
        divide(size, 2 * b + columns, (scratch, _BEHIND, u, scratch, _BEHIND, 0))
        for field in range(u, fields):
            back = fore = scratch[_BEHIND, field]
            for _ in range(distance):
                back, fore = from_behind(back), from_ahead(fore)
            scratch[_BEHIND, field], scratch[_AHEAD, field] = back, fore
            scratch[_SEPARATOR, field] = blocks[last, field]
        low, up = (scratch, _SEPARATOR, s), (scratch, _SEPARATOR, u)
        to = (blocks, last, 0)
        subtract_products(size, b, (*to, *low, scratch, _BEHIND, u, *up, scratch, _AHEAD, s))
        to = (blocks, last, right)
        subtract_products(size, columns, (*to, *low, scratch, _BEHIND, right, *up, scratch, _AHEAD, right))
        set_negative_product(size, b, (blocks, last, s, *low, scratch, _BEHIND, s))
        set_negative_product(size, b, (blocks, last, u, *up, scratch, _AHEAD, u))
        distance *= 2
    for field in range(b * b):
        blocks[last, field] += blocks[last, u + field] + blocks[last, s + field]
    is_regular = _factor(blocks, last, scratch, size) and is_regular
    divide(size, columns, (blocks, last, right, blocks, last, 0))
    return is_regular


@kernel
def _substitute(blocks, scratch, size):
    """Solve the nodes of all parts from the separators backward."""
    b = len(size)
    u, s, right = b * b, 2 * b * b, 3 * b * b
    fields = blocks.data.shape[1]
    columns, last = (fields - right) // b, blocks.rows - 1
    for field in range(right, fields):
        scratch[_BEHIND, field] = behind(blocks, 0, field)
    for j in range(last - 1, -1, -1):
        to, ahead = (blocks, j, right), (blocks, j + 1, right)
        subtract_products(size, columns, (*to, blocks, j, u, *ahead, blocks, j, s, scratch, _BEHIND, right))


@kernel
def _keep_diagonal(blocks, j, scratch, size):
    for r in range(len(size)):
        scratch[_AHEAD, r] = blocks[j, r + len(size) * r]


@kernel
def _factor(blocks, j, scratch, size):
    """Replace A of a row by its factors; whether this could be done in all lanes."""
    return not anywhere(~factor(size, blocks, j, 0, scratch, _AHEAD, 0))


@kernel
def solve_small(system: np.ndarray) -> None:
    """Solve [A | f], (size, size + 1), by elimination without pivoting, into the last column.

    A has to be nearly symmetric and positive.
    """
    size = system.shape[0]
    for p in range(size):
        per_pivot = 1.0 / system[p, p]
        for c in range(p, size + 1):
            system[p, c] *= per_pivot
        for r in range(size):
            if r != p:
                factor = system[r, p]
                for c in range(p, size + 1):
                    system[r, c] -= factor * system[p, c]
