"""Cyclic block-tridiagonal systems of 4 x 4 blocks, in linked lanes.

    L_i x_{i-1} + A_i x_i + U_i x_{i+1} = f_i,    L_i = U_{i-1}',

around a ring of n elements, which is cut into W parts, one for each lane, that are solved at the same time.
The last element of a part is its separator. Elimination runs forward through a part and keeps two more
blocks: the coupling to the separator behind, and that of the separator behind to the element at hand. This
leaves a small ring of W separators, which is solved densely. From its solution each part is solved backward.

There is no pivoting: the blocks are mass over step plus parts that are nearly symmetric and positive.

`solvers.cyclic_blocks` solves such systems, too, of blocks of any size with any L, and exchanges rows within
a block. It has the numbers of one block side by side in a register, and goes around the ring one node after
the other. Here a register holds the same number of nodes far apart, which is as the pushbelt's kernels
compute them: nothing is rearranged, and a product of blocks is written out for their one size, so that its 16
numbers stay in registers. Larger blocks would not, and need loops over memory as there.

A row of blocks has A in its fields 0-15, U in 16-31, and a place for the coupling behind in 32-47, all by
columns; right sides of four fields each follow from 48 on.
"""

from __future__ import annotations

from numba.extending import register_jitable

from cvt_hpc.kernels import kernel
from cvt_hpc.lanes import behind, fma, from_ahead

_A, _U, _S, _RIGHT = 0, 16, 32, 48
# blocks in the scratch: of the separator behind to the element at hand, what its own block loses, and the raw
# coupling to the element ahead
_V, _LOSS, _LINK = 0, 16, 32


@register_jitable
def _block(blocks, j, first):
    """A block, by columns."""
    return (
        blocks[j, first],
        blocks[j, first + 1],
        blocks[j, first + 2],
        blocks[j, first + 3],
        blocks[j, first + 4],
        blocks[j, first + 5],
        blocks[j, first + 6],
        blocks[j, first + 7],
        blocks[j, first + 8],
        blocks[j, first + 9],
        blocks[j, first + 10],
        blocks[j, first + 11],
        blocks[j, first + 12],
        blocks[j, first + 13],
        blocks[j, first + 14],
        blocks[j, first + 15],
    )


@register_jitable
def _product(m, a, b, c, d):
    """A block, by columns, times a column."""
    return (
        fma(m[0], a, fma(m[4], b, fma(m[8], c, m[12] * d))),
        fma(m[1], a, fma(m[5], b, fma(m[9], c, m[13] * d))),
        fma(m[2], a, fma(m[6], b, fma(m[10], c, m[14] * d))),
        fma(m[3], a, fma(m[7], b, fma(m[11], c, m[15] * d))),
    )


@register_jitable
def _transposed_product(m, a, b, c, d):
    return (
        fma(m[0], a, fma(m[1], b, fma(m[2], c, m[3] * d))),
        fma(m[4], a, fma(m[5], b, fma(m[6], c, m[7] * d))),
        fma(m[8], a, fma(m[9], b, fma(m[10], c, m[11] * d))),
        fma(m[12], a, fma(m[13], b, fma(m[14], c, m[15] * d))),
    )


@register_jitable
def _inverse(m):
    """Inverse of a block, both by columns, by its four parts of 2 x 2."""
    a, b, c, d = m[0], m[4], m[1], m[5]  # upper left
    per = 1.0 / (a * d - b * c)
    i, k, o, n = d * per, -b * per, -c * per, a * per
    # lower left times that, and that times upper right
    p, q = fma(m[2], i, m[6] * o), fma(m[2], k, m[6] * n)
    r, s = fma(m[3], i, m[7] * o), fma(m[3], k, m[7] * n)
    t, u = fma(i, m[8], k * m[9]), fma(i, m[12], k * m[13])
    v, w = fma(o, m[8], n * m[9]), fma(o, m[12], n * m[13])
    # what is left of the lower right, and its inverse
    a, b = m[10] - fma(p, m[8], q * m[9]), m[14] - fma(p, m[12], q * m[13])
    c, d = m[11] - fma(r, m[8], s * m[9]), m[15] - fma(r, m[12], s * m[13])
    per = 1.0 / (a * d - b * c)
    a, b, c, d = d * per, -b * per, -c * per, a * per
    e, f = -fma(t, a, u * c), -fma(t, b, u * d)
    g, h = -fma(v, a, w * c), -fma(v, b, w * d)
    return (
        i - fma(e, p, f * r),
        o - fma(g, p, h * r),
        -fma(a, p, b * r),
        -fma(c, p, d * r),
        k - fma(e, q, f * s),
        n - fma(g, q, h * s),
        -fma(a, q, b * s),
        -fma(c, q, d * s),
        e,
        g,
        a,
        c,
        f,
        h,
        b,
        d,
    )


@kernel
def _eliminate(blocks, scratch):
    """Eliminate the elements of all parts but the last ones.

    Rows then have the identity in place of A. The separators' rows have the coupling to the separators behind
    in place of S and that to the ones ahead in place of U.
    """
    rows, width = blocks.rows, blocks.data.shape[1] // 4
    last = rows - 1
    for r in range(4):
        for c in range(4):
            blocks[0, _S + 4 * c + r] = behind(blocks, 0, _U + 4 * r + c)
            scratch[0, _V + 4 * c + r] = behind(blocks, 0, _U + 4 * c + r)
            scratch[0, _LOSS + 4 * c + r] = 0.0
    for column in range(width - 12):
        for r in range(4):
            scratch[0, _LINK + 16 + 4 * column + r] = 0.0
    for j in range(rows):
        if j > 0:
            up = _block(scratch, 0, _LINK)  # L is its transpose
            for c in range(4):
                a, b, e, d = _transposed_product(
                    up,
                    blocks[j - 1, _U + 4 * c],
                    blocks[j - 1, _U + 4 * c + 1],
                    blocks[j - 1, _U + 4 * c + 2],
                    blocks[j - 1, _U + 4 * c + 3],
                )
                blocks[j, 4 * c] -= a
                blocks[j, 4 * c + 1] -= b
                blocks[j, 4 * c + 2] -= e
                blocks[j, 4 * c + 3] -= d
            for c in range(8, width):
                a, b, e, d = _transposed_product(
                    up,
                    blocks[j - 1, 4 * c],
                    blocks[j - 1, 4 * c + 1],
                    blocks[j - 1, 4 * c + 2],
                    blocks[j - 1, 4 * c + 3],
                )
                if c < 12:
                    blocks[j, 4 * c], blocks[j, 4 * c + 1] = -a, -b
                    blocks[j, 4 * c + 2], blocks[j, 4 * c + 3] = -e, -d
                else:
                    blocks[j, 4 * c] -= a
                    blocks[j, 4 * c + 1] -= b
                    blocks[j, 4 * c + 2] -= e
                    blocks[j, 4 * c + 3] -= d
        if j < last:
            for field in range(16):
                scratch[0, _LINK + field] = blocks[j, _U + field]
            inverse = _inverse(_block(blocks, j, _A))
            v = _block(scratch, 0, _V)
            for c in range(4, width):
                a, b, e, d = _product(
                    inverse,
                    blocks[j, 4 * c],
                    blocks[j, 4 * c + 1],
                    blocks[j, 4 * c + 2],
                    blocks[j, 4 * c + 3],
                )
                blocks[j, 4 * c], blocks[j, 4 * c + 1], blocks[j, 4 * c + 2], blocks[j, 4 * c + 3] = (
                    a,
                    b,
                    e,
                    d,
                )
                a, b, e, d = _product(v, a, b, e, d)
                if c < 8:
                    first = _V + 4 * (c - 4)
                    scratch[0, first], scratch[0, first + 1] = -a, -b
                    scratch[0, first + 2], scratch[0, first + 3] = -e, -d
                elif c < 12:
                    first = _LOSS + 4 * (c - 8)
                    scratch[0, first] += a
                    scratch[0, first + 1] += b
                    scratch[0, first + 2] += e
                    scratch[0, first + 3] += d
                else:
                    first = _LINK + 16 + 4 * (c - 12)
                    scratch[0, first] += a
                    scratch[0, first + 1] += b
                    scratch[0, first + 2] += e
                    scratch[0, first + 3] += d
    # the separator behind now couples to this part's separator
    for field in range(16):
        blocks[last, field] -= from_ahead(scratch[0, _LOSS + field])
        blocks[last, _U + field] = from_ahead(scratch[0, _V + field])
    for column in range(width - 12):
        for r in range(4):
            blocks[last, _RIGHT + 4 * column + r] -= from_ahead(scratch[0, _LINK + 16 + 4 * column + r])


@kernel
def _solve_separators(blocks, reduced):
    """Solve the ring of separators, and put the solutions in their rows."""
    data, last = blocks.data, blocks.rows - 1
    parts = data.shape[2]
    size, columns = reduced.shape[0], reduced.shape[1]
    reduced[:] = 0.0
    for part in range(parts):
        before, after = 4 * ((part - 1) % parts), 4 * ((part + 1) % parts)
        for r in range(4):
            row = 4 * part + r
            for c in range(4):
                reduced[row, 4 * part + c] += data[last, _A + 4 * c + r, part]
                reduced[row, before + c] += data[last, _S + 4 * c + r, part]
                reduced[row, after + c] += data[last, _U + 4 * c + r, part]
            for c in range(columns - size):
                reduced[row, size + c] = data[last, _RIGHT + 4 * c + r, part]
    for p in range(size):
        per_pivot = 1.0 / reduced[p, p]
        for c in range(p, columns):
            reduced[p, c] *= per_pivot
        for r in range(p + 1, size):
            factor = reduced[r, p]
            if factor != 0.0:
                for c in range(p, columns):
                    reduced[r, c] -= factor * reduced[p, c]
    for p in range(size - 1, -1, -1):
        for c in range(size, columns):
            total = reduced[p, c]
            for k in range(p + 1, size):
                total -= reduced[p, k] * reduced[k, c]
            reduced[p, c] = total
            data[last, _RIGHT + 4 * (c - size) + p % 4, p // 4] = total


@kernel
def _substitute(blocks):
    """Solve the elements of all parts from the separators backward."""
    rows, width = blocks.rows, blocks.data.shape[1] // 4
    last = rows - 1
    for j in range(last - 1, -1, -1):
        up, back = _block(blocks, j, _U), _block(blocks, j, _S)
        for c in range(12, width):
            f = 4 * c
            a, b, e, d = _product(
                up, blocks[j + 1, f], blocks[j + 1, f + 1], blocks[j + 1, f + 2], blocks[j + 1, f + 3]
            )
            p, q, r, s = _product(
                back,
                _separator(blocks, f),
                _separator(blocks, f + 1),
                _separator(blocks, f + 2),
                _separator(blocks, f + 3),
            )
            blocks[j, f] -= a + p
            blocks[j, f + 1] -= b + q
            blocks[j, f + 2] -= e + r
            blocks[j, f + 3] -= d + s


@register_jitable
def _separator(blocks, field):
    """A field of the separator behind each part."""
    return behind(blocks, 0, field)


@kernel
def solve(blocks, scratch, reduced):
    """Solve for all right sides in place.

    Parameters
    ----------
    blocks : (rows, 48 + 4 c) LaneArray
        The system, with c right sides; afterwards their solutions stand in their place, and A, U are lost.
    scratch : (1, 48 + 4 c or more) LaneArray
        Work space.
    reduced : (4 W, 4 W + c) array
        Work space.
    """
    _eliminate(blocks, scratch)
    _solve_separators(blocks, reduced)
    _substitute(blocks)
