"""Eigenvalues of the running elastic belt about its steady state, friction memory included.

It answers *does the steady state lose its stability, at what load, in which strand and at what frequency?* by
the full right-hand side's Jacobian, and shows along the belt where friction feeds a vibration and where it
takes energy. It cannot answer how large the vibration becomes and at what frequency it settles; whether a
larger disturbance starts one where small ones die; and anything where friction has no memory (see README.md).
Importing this package is cheap.
"""

from cvt_hpc.models.linear_stability.parameters import PARAMETERS, check, inert

DEFAULT_STEPPER = None
STEPPERS: dict[str, str] = {}

__all__ = ["DEFAULT_STEPPER", "PARAMETERS", "STEPPERS", "check", "inert"]
