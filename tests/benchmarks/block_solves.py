"""What a cyclic block-tridiagonal system costs in linked lanes, and with rows of one block in registers.

    python tests/benchmarks/block_solves.py [table.csv]

Times are the best of repeated calls of this thread's own processor time, so that other work counts little;
copying the system anew for each solve is subtracted. `peak` is the share of the processor's fused products
and sums, as a loop in registers finds them. Systems are assembled in linked lanes; `arranged` is what it
takes to bring them to `solvers.cyclic_blocks`, and solutions back. Takes some minutes.
"""

from __future__ import annotations

import csv
import sys
import time

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.lanes import LaneArray, fma
from cvt_hpc.solvers import cyclic_blocks, linked_blocks
from cvt_hpc.solvers.cyclic_blocks import DIAGONAL, LOWER, UPPER, block_size
from cvt_hpc.storage.provenance import origin_lines

NODES, PARTS = 432, 8
CASES = ((4, 1), (4, 4), (4, 12), (8, 1), (8, 8), (8, 12), (9, 8), (10, 8))  # size, right-hand sides
_factor, _solve_rows, _solve_linked = cyclic_blocks.factor, cyclic_blocks.solve, linked_blocks.solve


def system(nodes: int, b: int, columns: int) -> tuple[LaneArray, LaneArray]:
    """A random system that is diagonally dominant, twice."""
    draw = np.random.default_rng(b)
    blocks, spare = (linked_blocks.empty_system(nodes, PARTS, b, columns) for _ in range(2))
    blocks.data[:] = draw.normal(size=blocks.data.shape)
    blocks.data[:, : b * b : b + 1] += 3.0 * b
    spare.data[:] = blocks.data
    return blocks, spare


@kernel
def _copy(to, source):
    for j in range(to.rows):
        for field in range(to.data.shape[1]):
            to[j, field] = source[j, field]


@kernel
def _copies(blocks, source, repeats):
    for _ in range(repeats):
        _copy(blocks, source)


@kernel
def _linked(blocks, source, scratch, size, repeats):
    for _ in range(repeats):
        _copy(blocks, source)
        _solve_linked(blocks, scratch, size)


@kernel
def _arrange(source, rows, columns, size):
    b = len(size)
    given, sides = source.data, columns.data
    count, parts = given.shape[0], given.shape[2]
    for j in range(count):
        for part in range(parts):
            i = part * count + j
            ahead = (i + 1) % (count * parts)
            for c in range(b):
                for r in range(b):
                    rows.data[i, DIAGONAL * b + r, c] = given[j, r + b * c, part]
                    coupling = given[j, b * b + r + b * c, part]
                    rows.data[i, UPPER * b + r, c] = rows.data[ahead, LOWER * b + c, r] = coupling
            for c in range(given.shape[1] // b - 3 * b):
                for r in range(b):
                    sides[i, r, c] = given[j, 3 * b * b + r + b * c, part]


@kernel
def _arrange_back(source, columns, size):
    b = len(size)
    given, sides = source.data, columns.data
    count, parts = given.shape[0], given.shape[2]
    for j in range(count):
        for part in range(parts):
            for c in range(given.shape[1] // b - 3 * b):
                for r in range(b):
                    given[j, 3 * b * b + r + b * c, part] = sides[part * count + j, r, c]


@kernel
def _arrangements(source, rows, columns, size, repeats):
    for _ in range(repeats):
        _arrange(source, rows, columns, size)
        _arrange_back(source, columns, size)


@kernel
def _in_rows(source, rows, columns, size, repeats):
    for _ in range(repeats):
        _arrange(source, rows, columns, size)
        _factor(rows, size)
        _solve_rows(rows, columns, size)
        _arrange_back(source, columns, size)


@kernel
def _fused(x, repeats):
    """Ten independent chains, as one has to wait for its last sum."""
    a, b, c, d, e = x[0, 0], x[0, 1], x[0, 2], x[0, 3], x[0, 4]
    f, g, h, i, k = x[0, 5], x[0, 6], x[0, 7], x[0, 8], x[0, 9]
    m, s = x[0, 10], x[0, 11]
    for _ in range(repeats):
        a, b, c, d, e = fma(a, m, s), fma(b, m, s), fma(c, m, s), fma(d, m, s), fma(e, m, s)
        f, g, h, i, k = fma(f, m, s), fma(g, m, s), fma(h, m, s), fma(i, m, s), fma(k, m, s)
    x[0, 0] = a + b + c + d + e + f + g + h + i + k


def best(run, repeats: int, calls: int) -> float:
    """Processor time of one of `repeats` repeats within a call [s], the best of some calls."""
    run(1)
    found = np.inf
    for _ in range(calls):
        begun = time.thread_time()
        run(repeats)
        found = min(found, (time.thread_time() - begun) / repeats)
    return found


def needed(nodes: int, b: int, columns: int) -> float:
    """Fused products and sums of a solve, of all lanes."""
    of_separators = PARTS * (PARTS.bit_length() - 1)
    return (nodes + of_separators) * ((6.0 + 1.0 / 3.0) * b**3 + 5.0 * b**2 * columns)


def measure(nodes: int, b: int, columns: int, peak: float, repeats: int = 16, calls: int = 400) -> dict:
    """A line of the table; `peak` in fused products and sums of a second."""
    blocks, source = system(nodes, b, columns)
    scratch, size = linked_blocks.empty_scratch(PARTS, b, columns), block_size(b)
    rows = cyclic_blocks.empty_blocks(nodes, b)
    sides = cyclic_blocks.empty_columns(nodes, b, columns)
    copying = best(lambda n: _copies(blocks, source, n), repeats, calls)
    linked = best(lambda n: _linked(blocks, source, scratch, size, n), repeats, calls) - copying
    arranging = best(lambda n: _arrangements(blocks, rows, sides, size, n), repeats, calls)
    # the right-hand sides are its last solutions: any will do
    in_rows = best(lambda n: _in_rows(source, rows, sides, size, n), repeats, calls) - arranging
    return {
        "size": b,
        "right_sides": columns,
        "linked_us": round(1e6 * linked, 1),
        "peak": round(needed(nodes, b, columns) / peak / linked, 2),
        "rows_us": round(1e6 * in_rows, 1),
        "arranged_us": round(1e6 * arranging, 1),
    }


def main() -> None:
    """Measure, print and maybe write the table."""
    x = LaneArray(1, 12, PARTS)
    peak = 10.0 * PARTS / best(lambda n: _fused(x, n), 100_000, 30)
    print(f"{NODES} nodes, {peak * 1e-9:.1f} fused products and sums of a nanosecond")
    lines = [measure(NODES, b, columns, peak) for b, columns in CASES]
    for line in lines:
        print("  ".join(f"{key} {value}" for key, value in line.items()))
    if len(sys.argv) > 1:
        with open(sys.argv[1], "w", newline="") as file:
            file.writelines(origin_lines())
            table = csv.DictWriter(file, lines[0], lineterminator="\n")
            table.writeheader()
            table.writerows(lines)


if __name__ == "__main__":
    main()
