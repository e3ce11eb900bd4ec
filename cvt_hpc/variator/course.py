"""Course of a run's load, speed, thrust and start-up damping over time; of plain numbers and of lanes."""

import numpy as np

from cvt_hpc.kernels import kernel, merged_kernel
from cvt_hpc.lanes import like
from cvt_hpc.parameters import Parameters
from cvt_hpc.variator import profiles

PROFILED = ("load", "driving_speed", "thrust")  # columns of a table of multiples, after that of times
LOAD, SPEED, THRUST = 1, 2, 3


def profile_table(parameters: Parameters) -> np.ndarray:
    """Times [s] and multiples of a run's profiles, (K, 4), from its parameters; one line without any.

    A model without profiles has no key of theirs.
    """
    times = parameters.get(profiles.TIME, ()) or (0.0,)
    columns = [
        np.broadcast_to(profiles.multiple(parameters, name, np.array(times)), len(times)) for name in PROFILED
    ]
    return np.column_stack([times, *columns]).astype(float)


@kernel
def _before(profile: np.ndarray, time: float) -> int:
    """Line of a profile from which it is linear to the next; -1 where it is constant."""
    low, high = 0, profile.shape[0] - 1
    if time < profile[low, 0] or time >= profile[high, 0]:
        return -1
    while high - low > 1:
        middle = (low + high) // 2
        if profile[middle, 0] <= time:
            low = middle
        else:
            high = middle
    return low


@kernel
def multiple_at(profile: np.ndarray, column: int, time: float) -> float:
    """Multiple at a time [s] by a `profile_table`: linear between its times, constant before and after."""
    k = _before(profile, time)
    if k < 0:
        return profile[0 if time < profile[0, 0] else profile.shape[0] - 1, column]
    share = (time - profile[k, 0]) / (profile[k + 1, 0] - profile[k, 0])
    return profile[k, column] + share * (profile[k + 1, column] - profile[k, column])


@kernel
def slope_at(profile: np.ndarray, column: int, time: float) -> float:
    """Rate of the multiple at a time [1/s], that of what follows where lines meet."""
    k = _before(profile, time)
    if k < 0:
        return 0.0
    return (profile[k + 1, column] - profile[k, column]) / (profile[k + 1, 0] - profile[k, 0])


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
