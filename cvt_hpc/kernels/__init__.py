"""Kernels: functions that numba compiles, and whose machine code is kept between processes."""

from cvt_hpc.kernels.compiling import called_alike, kernel, merged_kernel

__all__ = ["called_alike", "kernel", "merged_kernel"]
