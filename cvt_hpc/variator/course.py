"""Course of a run's load, speed and start-up damping over time; of plain numbers and of lanes."""

import numpy as np

from cvt_hpc.kernels import merged_kernel
from cvt_hpc.lanes import like


@merged_kernel
def load_course(time: float, rise_time: float, ramp_end: float, start, load):
    """Torque at the driving pulley [N m]: a smooth rise to `start` in `rise_time`, then linear to `load`."""
    if time < rise_time:
        torque = start * (0.5 * (1.0 - np.cos(np.pi * time / rise_time)))
    elif time < ramp_end:
        torque = start + (load - start) * ((time - rise_time) / (ramp_end - rise_time))
    else:
        torque = load
    return torque


@merged_kernel
def speed_course(time: float, rise_time: float, ramp_end: float, start):
    """Speed of the driving pulley over its last one [1]: `start` until `rise_time`, then linear to 1."""
    share = like(1.0, start)
    if time < ramp_end:
        share = start + (1.0 - start) * max((time - rise_time) / (ramp_end - rise_time), 0.0)
    return share


@merged_kernel
def faded_damping(time: float, rise_time: float, start_damping: float) -> float:
    """Transverse damping that is left of the start-up's [N s/m^2]: it fades out over `rise_time`."""
    left = max(1.0 - time / rise_time, 0.0)
    return start_damping * left * left
