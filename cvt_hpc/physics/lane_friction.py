"""The friction laws of `friction` for several runs at once: one kind of law, coefficients of each lane."""

from __future__ import annotations

import numpy as np

from cvt_hpc.kernels import kernel, merged_kernel
from cvt_hpc.lanes import decay, fma, like, maximum, minimum


@merged_kernel
def lane_saturation(speed, per_width):
    """tanh(speed / width) of speeds >= 0 [m/s], from 1 / width [s/m]."""
    left = decay(speed * (2.0 * per_width))
    return (1.0 - left) / (1.0 + left)


@merged_kernel
def lane_law(kind: int, kinetic, gradient, scale):
    """Three coefficients by which `lane_coefficient` computes a law of formula without a division by them.

    Parameters
    ----------
    kind : int
        One of `friction.Law`, the same in all lanes.
    kinetic, gradient, scale
        mu_k [1], slope at rest [s/m] and v_s [m/s] of each lane.
    """
    if kind == 3:
        # mu_k / (1 + d v): mu_k and d
        return kinetic, -gradient / kinetic, scale
    return kinetic, gradient * scale, 1.0 / scale


@merged_kernel
def lane_coefficient(kind: int, kinetic, fall, per_scale, speed):
    """Coefficient of steady sliding by a law that is a formula.

    Parameters
    ----------
    kind : int
        One of `friction.Law`, the same in all lanes.
    kinetic, fall, per_scale
        What `lane_law` made of its numbers.
    speed
        Sliding speed, >= 0 [m/s].
    """
    if kind == 2:
        mu = fma(-fall, decay(speed * per_scale), kinetic)
    elif kind == 0:
        mu = kinetic
    elif kind == 1:
        mu = fma(fall, minimum(speed * per_scale - 1.0, 0.0), kinetic)
    elif kind == 3:
        mu = kinetic / fma(fall, speed, 1.0)
    else:
        x = minimum(speed * per_scale, 1.7320508075688772)
        mu = kinetic - fall * (2.0 / 3.0) * (1.0 - 1.5 * (x - x * x * x * (1.0 / 3.0)))
    return mu


@kernel
def lane_table(table: tuple[np.ndarray, np.ndarray, np.ndarray], speed, force):
    """Coefficient by a table that all lanes share: bilinear, held constant outside.

    `table` holds forces (nf,) [N/m], speeds (nv,) [m/s] and coefficients (nf, nv). Written as a sum over its
    intervals, of which each lane fills those below its place.
    """
    table_force, table_speed, table_mu = table
    mu = mu_below = like(0.0, speed)
    for i in range(table_force.size):
        row = like(table_mu[i, 0], speed)
        for j in range(table_speed.size - 1):
            width = table_speed[j + 1] - table_speed[j]
            filled = minimum(maximum(speed - table_speed[j], 0.0), width)
            row += filled * ((table_mu[i, j + 1] - table_mu[i, j]) / width)
        if i == 0:
            mu = row
        else:
            span = table_force[i] - table_force[i - 1]
            mu += (row - mu_below) * minimum(maximum((force - table_force[i - 1]) / span, 0.0), 1.0)
        mu_below = row
    return mu
