"""Cyclic systems of 8 x 8 blocks in linked lanes, as `models.pushbelt.cyclic` has those of 4 x 4."""

from numba.extending import register_jitable

from cvt_hpc.kernels import kernel
from cvt_hpc.lanes import behind, fma, from_ahead

_V, _LOSS, _INV, _LINK = 0, 64, 128, 192


@register_jitable
def _times(m, j, f, x):
    return (
        fma(
            m[j, f + 0],
            x[0],
            fma(
                m[j, f + 8],
                x[1],
                fma(
                    m[j, f + 16],
                    x[2],
                    fma(
                        m[j, f + 24],
                        x[3],
                        fma(
                            m[j, f + 32],
                            x[4],
                            fma(m[j, f + 40], x[5], fma(m[j, f + 48], x[6], m[j, f + 56] * x[7])),
                        ),
                    ),
                ),
            ),
        ),
        fma(
            m[j, f + 1],
            x[0],
            fma(
                m[j, f + 9],
                x[1],
                fma(
                    m[j, f + 17],
                    x[2],
                    fma(
                        m[j, f + 25],
                        x[3],
                        fma(
                            m[j, f + 33],
                            x[4],
                            fma(m[j, f + 41], x[5], fma(m[j, f + 49], x[6], m[j, f + 57] * x[7])),
                        ),
                    ),
                ),
            ),
        ),
        fma(
            m[j, f + 2],
            x[0],
            fma(
                m[j, f + 10],
                x[1],
                fma(
                    m[j, f + 18],
                    x[2],
                    fma(
                        m[j, f + 26],
                        x[3],
                        fma(
                            m[j, f + 34],
                            x[4],
                            fma(m[j, f + 42], x[5], fma(m[j, f + 50], x[6], m[j, f + 58] * x[7])),
                        ),
                    ),
                ),
            ),
        ),
        fma(
            m[j, f + 3],
            x[0],
            fma(
                m[j, f + 11],
                x[1],
                fma(
                    m[j, f + 19],
                    x[2],
                    fma(
                        m[j, f + 27],
                        x[3],
                        fma(
                            m[j, f + 35],
                            x[4],
                            fma(m[j, f + 43], x[5], fma(m[j, f + 51], x[6], m[j, f + 59] * x[7])),
                        ),
                    ),
                ),
            ),
        ),
        fma(
            m[j, f + 4],
            x[0],
            fma(
                m[j, f + 12],
                x[1],
                fma(
                    m[j, f + 20],
                    x[2],
                    fma(
                        m[j, f + 28],
                        x[3],
                        fma(
                            m[j, f + 36],
                            x[4],
                            fma(m[j, f + 44], x[5], fma(m[j, f + 52], x[6], m[j, f + 60] * x[7])),
                        ),
                    ),
                ),
            ),
        ),
        fma(
            m[j, f + 5],
            x[0],
            fma(
                m[j, f + 13],
                x[1],
                fma(
                    m[j, f + 21],
                    x[2],
                    fma(
                        m[j, f + 29],
                        x[3],
                        fma(
                            m[j, f + 37],
                            x[4],
                            fma(m[j, f + 45], x[5], fma(m[j, f + 53], x[6], m[j, f + 61] * x[7])),
                        ),
                    ),
                ),
            ),
        ),
        fma(
            m[j, f + 6],
            x[0],
            fma(
                m[j, f + 14],
                x[1],
                fma(
                    m[j, f + 22],
                    x[2],
                    fma(
                        m[j, f + 30],
                        x[3],
                        fma(
                            m[j, f + 38],
                            x[4],
                            fma(m[j, f + 46], x[5], fma(m[j, f + 54], x[6], m[j, f + 62] * x[7])),
                        ),
                    ),
                ),
            ),
        ),
        fma(
            m[j, f + 7],
            x[0],
            fma(
                m[j, f + 15],
                x[1],
                fma(
                    m[j, f + 23],
                    x[2],
                    fma(
                        m[j, f + 31],
                        x[3],
                        fma(
                            m[j, f + 39],
                            x[4],
                            fma(m[j, f + 47], x[5], fma(m[j, f + 55], x[6], m[j, f + 63] * x[7])),
                        ),
                    ),
                ),
            ),
        ),
    )


@register_jitable
def _transposed(m, j, f, x):
    return (
        fma(
            m[j, f + 0],
            x[0],
            fma(
                m[j, f + 1],
                x[1],
                fma(
                    m[j, f + 2],
                    x[2],
                    fma(
                        m[j, f + 3],
                        x[3],
                        fma(
                            m[j, f + 4],
                            x[4],
                            fma(m[j, f + 5], x[5], fma(m[j, f + 6], x[6], m[j, f + 7] * x[7])),
                        ),
                    ),
                ),
            ),
        ),
        fma(
            m[j, f + 8],
            x[0],
            fma(
                m[j, f + 9],
                x[1],
                fma(
                    m[j, f + 10],
                    x[2],
                    fma(
                        m[j, f + 11],
                        x[3],
                        fma(
                            m[j, f + 12],
                            x[4],
                            fma(m[j, f + 13], x[5], fma(m[j, f + 14], x[6], m[j, f + 15] * x[7])),
                        ),
                    ),
                ),
            ),
        ),
        fma(
            m[j, f + 16],
            x[0],
            fma(
                m[j, f + 17],
                x[1],
                fma(
                    m[j, f + 18],
                    x[2],
                    fma(
                        m[j, f + 19],
                        x[3],
                        fma(
                            m[j, f + 20],
                            x[4],
                            fma(m[j, f + 21], x[5], fma(m[j, f + 22], x[6], m[j, f + 23] * x[7])),
                        ),
                    ),
                ),
            ),
        ),
        fma(
            m[j, f + 24],
            x[0],
            fma(
                m[j, f + 25],
                x[1],
                fma(
                    m[j, f + 26],
                    x[2],
                    fma(
                        m[j, f + 27],
                        x[3],
                        fma(
                            m[j, f + 28],
                            x[4],
                            fma(m[j, f + 29], x[5], fma(m[j, f + 30], x[6], m[j, f + 31] * x[7])),
                        ),
                    ),
                ),
            ),
        ),
        fma(
            m[j, f + 32],
            x[0],
            fma(
                m[j, f + 33],
                x[1],
                fma(
                    m[j, f + 34],
                    x[2],
                    fma(
                        m[j, f + 35],
                        x[3],
                        fma(
                            m[j, f + 36],
                            x[4],
                            fma(m[j, f + 37], x[5], fma(m[j, f + 38], x[6], m[j, f + 39] * x[7])),
                        ),
                    ),
                ),
            ),
        ),
        fma(
            m[j, f + 40],
            x[0],
            fma(
                m[j, f + 41],
                x[1],
                fma(
                    m[j, f + 42],
                    x[2],
                    fma(
                        m[j, f + 43],
                        x[3],
                        fma(
                            m[j, f + 44],
                            x[4],
                            fma(m[j, f + 45], x[5], fma(m[j, f + 46], x[6], m[j, f + 47] * x[7])),
                        ),
                    ),
                ),
            ),
        ),
        fma(
            m[j, f + 48],
            x[0],
            fma(
                m[j, f + 49],
                x[1],
                fma(
                    m[j, f + 50],
                    x[2],
                    fma(
                        m[j, f + 51],
                        x[3],
                        fma(
                            m[j, f + 52],
                            x[4],
                            fma(m[j, f + 53], x[5], fma(m[j, f + 54], x[6], m[j, f + 55] * x[7])),
                        ),
                    ),
                ),
            ),
        ),
        fma(
            m[j, f + 56],
            x[0],
            fma(
                m[j, f + 57],
                x[1],
                fma(
                    m[j, f + 58],
                    x[2],
                    fma(
                        m[j, f + 59],
                        x[3],
                        fma(
                            m[j, f + 60],
                            x[4],
                            fma(m[j, f + 61], x[5], fma(m[j, f + 62], x[6], m[j, f + 63] * x[7])),
                        ),
                    ),
                ),
            ),
        ),
    )


@register_jitable
def _column(a, j, f):
    return (
        a[j, f],
        a[j, f + 1],
        a[j, f + 2],
        a[j, f + 3],
        a[j, f + 4],
        a[j, f + 5],
        a[j, f + 6],
        a[j, f + 7],
    )


@register_jitable
def _set(a, j, f, x):
    a[j, f], a[j, f + 1], a[j, f + 2], a[j, f + 3] = x[0], x[1], x[2], x[3]
    a[j, f + 4], a[j, f + 5], a[j, f + 6], a[j, f + 7] = x[4], x[5], x[6], x[7]


@register_jitable
def _add(a, j, f, x):
    a[j, f] += x[0]
    a[j, f + 1] += x[1]
    a[j, f + 2] += x[2]
    a[j, f + 3] += x[3]
    a[j, f + 4] += x[4]
    a[j, f + 5] += x[5]
    a[j, f + 6] += x[6]
    a[j, f + 7] += x[7]


@register_jitable
def _minus(x):
    return (-x[0], -x[1], -x[2], -x[3], -x[4], -x[5], -x[6], -x[7])


@kernel
def _invert(blocks, j, scratch):
    """Inverse of A into the scratch, by Gauss-Jordan in place."""
    for f in range(64):
        scratch[0, _INV + f] = blocks[j, f]
    for p in range(8):
        per = 1.0 / scratch[0, _INV + 9 * p]
        scratch[0, _INV + 9 * p] = 1.0
        for c in range(8):
            scratch[0, _INV + 8 * c + p] *= per
        for c in range(8):
            x = scratch[0, _INV + 8 * c + p]
            if c != p:
                for r in range(8):
                    if r != p:
                        scratch[0, _INV + 8 * c + r] -= scratch[0, _INV + 8 * p + r] * x
        x = scratch[0, _INV + 9 * p]
        for r in range(8):
            if r != p:
                scratch[0, _INV + 8 * p + r] = -scratch[0, _INV + 8 * p + r] * x


@kernel
def _eliminate(blocks, scratch):
    rows, width = blocks.rows, blocks.data.shape[1] // 8
    last = rows - 1
    for r in range(8):
        for c in range(8):
            blocks[0, 128 + 8 * c + r] = behind(blocks, 0, 64 + 8 * r + c)
            scratch[0, _V + 8 * c + r] = behind(blocks, 0, 64 + 8 * c + r)
            scratch[0, _LOSS + 8 * c + r] = 0.0
    for f in range(8 * (width - 24)):
        scratch[0, _LINK + f] = 0.0
    for j in range(rows):
        if j > 0:
            for c in range(8):
                _add(
                    blocks,
                    j,
                    8 * c,
                    _minus(_transposed(blocks, j - 1, 0, _column(blocks, j - 1, 64 + 8 * c))),
                )
            for c in range(16, width):
                x = _minus(_transposed(blocks, j - 1, 0, _column(blocks, j - 1, 8 * c)))
                if c < 24:
                    _set(blocks, j, 8 * c, x)
                else:
                    _add(blocks, j, 8 * c, x)
        if j < last:
            _invert(blocks, j, scratch)
            for f in range(64):
                blocks[j, f] = blocks[j, 64 + f]  # U, of which the next row's L is the transpose
            # V changes only after all products with it
            for c in range(16, width):
                x = _times(scratch, 0, _INV, _column(blocks, j, 8 * c))
                _set(blocks, j, 8 * c, x)
                y = _times(scratch, 0, _V, x)
                if c < 24:
                    _add(scratch, 0, _LOSS + 8 * (c - 16), y)
                else:
                    _add(scratch, 0, _LINK + 8 * (c - 24), y)
            for c in range(8, 16):
                _set(blocks, j, 8 * c, _times(scratch, 0, _INV, _column(blocks, j, 8 * c)))
            for c in range(8):
                _set(scratch, 0, _INV + 8 * c, _minus(_times(scratch, 0, _V, _column(blocks, j, 64 + 8 * c))))
            for f in range(64):
                scratch[0, _V + f] = scratch[0, _INV + f]
    for f in range(64):
        blocks[last, f] -= from_ahead(scratch[0, _LOSS + f])
        blocks[last, 64 + f] = from_ahead(scratch[0, _V + f])
    for f in range(8 * (width - 24)):
        blocks[last, 192 + f] -= from_ahead(scratch[0, _LINK + f])


@kernel
def _solve_separators(blocks, reduced):
    data, last = blocks.data, blocks.rows - 1
    parts = data.shape[2]
    size, columns = reduced.shape[0], reduced.shape[1]
    reduced[:] = 0.0
    for part in range(parts):
        before, after = 8 * ((part - 1) % parts), 8 * ((part + 1) % parts)
        for r in range(8):
            row = 8 * part + r
            for c in range(8):
                reduced[row, 8 * part + c] += data[last, 8 * c + r, part]
                reduced[row, before + c] += data[last, 128 + 8 * c + r, part]
                reduced[row, after + c] += data[last, 64 + 8 * c + r, part]
            for c in range(columns - size):
                reduced[row, size + c] = data[last, 192 + 8 * c + r, part]
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
            data[last, 192 + 8 * (c - size) + p % 8, p // 8] = total


@kernel
def _substitute(blocks):
    rows, width = blocks.rows, blocks.data.shape[1] // 8
    for j in range(rows - 2, -1, -1):
        for c in range(24, width):
            f = 8 * c
            x = (
                behind(blocks, 0, f),
                behind(blocks, 0, f + 1),
                behind(blocks, 0, f + 2),
                behind(blocks, 0, f + 3),
                behind(blocks, 0, f + 4),
                behind(blocks, 0, f + 5),
                behind(blocks, 0, f + 6),
                behind(blocks, 0, f + 7),
            )
            _add(blocks, j, f, _minus(_times(blocks, j, 64, _column(blocks, j + 1, f))))
            _add(blocks, j, f, _minus(_times(blocks, j, 128, x)))


@kernel
def solve(blocks, scratch, reduced, size):
    """Solve for all right sides in place; A and U are lost."""
    _eliminate(blocks, scratch)
    _solve_separators(blocks, reduced)
    _substitute(blocks)
