"""The friction laws of `friction` for several runs at once: one kind of law, coefficients of each lane."""

from __future__ import annotations

import numpy as np

from cvt_hpc.kernels import lane_kernel, merged_lane_kernel
from cvt_hpc.lanes import absolute, exp, like, maximum, minimum, select, with_sign_of


@merged_lane_kernel
def lane_saturation(speed, width):
    """tanh(speed / width) and its slope [s/m]."""
    decay = exp(absolute(speed) * (-2.0 / width))
    factor = (1.0 - decay) / (1.0 + decay)
    return with_sign_of(factor, speed), (1.0 - factor * factor) / width


@merged_lane_kernel
def lane_coefficient(kind: int, kinetic, gradient, scale, speed):
    """Coefficient of steady sliding by a law that is a formula; `kind` is one of `friction.Law`.

    Parameters
    ----------
    kind : int
        The law, the same in all lanes.
    kinetic, gradient, scale, speed
        mu_k [1], slope at rest [s/m], v_s [m/s], sliding speed >= 0 [m/s], of each lane.
    """
    if kind == 2:
        return kinetic - scale * gradient * exp(speed * (-1.0 / scale))
    if kind == 0:
        return kinetic
    if kind == 1:
        return kinetic + gradient * minimum(speed - scale, 0.0)
    if kind == 3:
        return kinetic / (1.0 - gradient / kinetic * speed)
    x = speed / scale
    span = gradient * scale * (-2.0 / 3.0)
    inside = kinetic + span * (1.0 - 1.5 * (x - x * x * x * (1.0 / 3.0)))
    return select(x * x < 3.0, inside, kinetic + span)


@lane_kernel
def lane_table(table_force: np.ndarray, table_speed: np.ndarray, table_mu: np.ndarray, speed, force):
    """Coefficient by a table that all lanes share: bilinear, held constant outside.

    Written as a sum over the table's intervals, of which each lane fills those below its place.
    """
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
