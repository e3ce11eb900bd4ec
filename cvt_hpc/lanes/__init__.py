"""Several runs, or parts of one, in a register: numbers that hold W values, for kernels.

A `LaneArray` of shape (rows, fields) holds W values of type double or single at each place, one for each run
("lane"), or for each part of a ring (`rings`). In kernels `a[j, k]` is a number of W lanes: + - * /,
comparisons and the functions below act on each lane for itself and become vector instructions of the
processor; a plain number beside it counts for all lanes. So a run's results do not depend on its neighbours.
Nor do they depend on W: every operation is rounded once, as IEEE 754 has it, and products are fused with sums
only where `fma` says so.

The functions take plain numbers too, so that a formula of both stands once. Products of small blocks of lanes
are in `lanes.blocks`.

A loop over lanes in plain arrays would be left to the compiler's vectoriser, which gives up where it cannot
rule out that two of many arrays overlap.
"""

from cvt_hpc.lanes import arithmetic, blocks  # noqa: F401  they teach the compiler what + and [] mean
from cvt_hpc.lanes.functions import (
    absolute,
    anywhere,
    decay,
    fma,
    halving,
    like,
    maximum,
    minimum,
    nearest_integer,
    reciprocals,
    select,
    sqrt,
    with_sign_of,
)
from cvt_hpc.lanes.kinds import ALIGNMENT, LaneArray
from cvt_hpc.lanes.rings import (
    ahead,
    around,
    at_station,
    behind,
    from_ahead,
    from_behind,
    merge_parts,
    ring_solution,
    set_station,
    split,
)

__all__ = [
    "ALIGNMENT",
    "LaneArray",
    "absolute",
    "ahead",
    "anywhere",
    "around",
    "at_station",
    "behind",
    "decay",
    "fma",
    "halving",
    "from_ahead",
    "from_behind",
    "like",
    "maximum",
    "merge_parts",
    "minimum",
    "nearest_integer",
    "reciprocals",
    "ring_solution",
    "select",
    "set_station",
    "split",
    "sqrt",
    "with_sign_of",
]
