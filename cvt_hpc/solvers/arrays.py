"""Copies of arrays in kernels: assigning a slice takes seconds to compile, for the message of its error."""

import numpy as np

from cvt_hpc.kernels import kernel


@kernel
def copy(values: np.ndarray, to: np.ndarray) -> None:
    """Copy the first n values of an array into one of shape (n,)."""
    for k in range(to.size):
        to[k] = values[k]
