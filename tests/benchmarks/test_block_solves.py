"""The benchmark of cyclic block-tridiagonal systems: both solvers solve the same one, and a line has all numbers."""

import numpy as np
from block_solves import PARTS, _in_rows, _linked, measure, system

from cvt_hpc.solvers.cyclic_blocks import block_size, empty_blocks, empty_columns
from cvt_hpc.solvers.linked_blocks import empty_scratch, field_of_right


def test_both_solvers_solve_the_same_system():
    nodes, b, columns = 2 * PARTS, 4, 4
    blocks, source = system(nodes, b, columns)
    _linked(blocks, source, empty_scratch(PARTS, b, columns), block_size(b), 1)
    _in_rows(source, empty_blocks(nodes, b), empty_columns(nodes, b, columns), block_size(b), 1)
    right = field_of_right(b)
    # both are solutions to some roundings of numbers below 1
    np.testing.assert_allclose(source.data[:, right:], blocks.data[:, right:], rtol=0, atol=1e-13)


def test_a_line_of_the_table():
    line = measure(2 * PARTS, 4, 4, peak=1e10, repeats=4, calls=3)
    assert line["size"] == line["right_sides"] == 4
    # of so short runs the clock tells no difference, which may be below zero
    assert line["arranged_us"] >= 0.0 and np.isfinite(list(line.values())).all()
