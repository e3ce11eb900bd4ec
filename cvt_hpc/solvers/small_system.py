"""A dense system of a few equations, as the border of a chain has them."""

import numpy as np

from cvt_hpc.kernels import kernel


@kernel
def solve_small(system: np.ndarray) -> None:
    """Solve the equations [A | f] in place, by elimination without pivoting.

    Parameters
    ----------
    system : (size, size + 1) array
        A, which has to be nearly symmetric and positive, and f; afterwards the solution is its last column.
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
