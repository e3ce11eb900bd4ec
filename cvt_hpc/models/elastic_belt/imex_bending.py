"""Bending in the fast step: increments of u are spread along the belt, so that short waves limit no step.

Explicit bending is stable up to dt = 2 / w of the shortest waves, w^2 = 16 EI / (m h^4): steps would fall with
the square of the cells. In the place of a mass m the increments of a step have

    (m + IMPLICIT dt^2 EI d^4/ds^4) du = dt F,

by which no wave of bending turns by more than 1 / sqrt(IMPLICIT) rad in a step. States at rest stay what they
are, nothing is damped, and waves of a frequency w are slower by the share IMPLICIT (w dt)^2 / 2 of what bending
has in their stiffness: 2e-5 at 600 Hz and 8 us, if all of it were bending.

With g = dt (IMPLICIT EI / m)^1/2 and the second difference D of the mesh it is 1 + g^2 D^2 = (1 + i g D)(1 - i g D), so
that du is the real part of (1 + i g D)^-1 dt F / m: one complex system with three diagonals, whose factors are
those of the step's length alone. Pressed elements that bear a moment count into EI.
"""

from __future__ import annotations

from cvt_hpc.kernels import kernel, merged_kernel
from cvt_hpc.lanes import fma, from_ahead, from_behind, like, ring_solution, sqrt
from cvt_hpc.models.elastic_belt import lane_fields as lf
from cvt_hpc.models.elastic_belt.lane_belt import LaneBelt, Work

IMPLICIT = 0.5  # from 1/4 on no step is too long for bending; here it takes half of what a step allows


@merged_kernel
def _reach(belt: LaneBelt, step: float):
    """g [m^2]."""
    c = belt.constants
    stiffness = c[0, lf.BENDING_STIFFNESS]
    if belt.has_column:
        stiffness = stiffness + c[0, lf.COLUMN_STIFFNESS]
    return step * sqrt(IMPLICIT * stiffness / c[0, lf.MASS])


@kernel
def factorise_bending(belt: LaneBelt, work: Work, step: float) -> None:
    """Factors of dual (1 + i g D), symmetric, for `spread`: of a row without those before, and of their rest.

    PIVOT is 1 / pivot, CORNER the coupling to the last row of the part behind; of the last row both are those
    of the system of last rows that `ring_solution` solves.
    """
    stations, reach = work.stations, _reach(belt, step)
    last = stations.rows - 1
    zero = like(0.0, reach)
    link = from_behind(reach * belt.per_cell[last])  # of the cell behind a row
    corner_r, corner_i, rest_r, rest_i, own_r, own_i = zero, link, zero, zero, zero, zero
    for j in range(last + 1):
        ahead = reach * belt.per_cell[j]
        pivot_r, pivot_i = like(belt.dual[j], reach) + rest_r, rest_i - (link + ahead)
        if j == last:
            pivot_r, pivot_i = pivot_r + from_ahead(own_r), pivot_i + from_ahead(own_i)
        else:
            per_square = 1.0 / fma(pivot_r, pivot_r, pivot_i * pivot_i)
            pivot_r, pivot_i = pivot_r * per_square, -pivot_i * per_square
        stations[j, lf.PIVOT_R], stations[j, lf.PIVOT_I] = pivot_r, pivot_i
        stations[j, lf.CORNER_R], stations[j, lf.CORNER_I] = corner_r, corner_i
        # what a row leaves: -corner^2 / pivot to the row behind the part, ahead^2 / pivot to the next one
        moved_r = fma(pivot_r, corner_r, -pivot_i * corner_i)
        moved_i = fma(pivot_r, corner_i, pivot_i * corner_r)
        own_r = fma(-corner_r, moved_r, fma(corner_i, moved_i, own_r))
        own_i = fma(-corner_r, moved_i, fma(-corner_i, moved_r, own_i))
        rest_r, rest_i = ahead * ahead * pivot_r, ahead * ahead * pivot_i
        faded = belt.faded
        corner_r, corner_i = (ahead * moved_i + faded) - faded, (-ahead * moved_r + faded) - faded
        link = ahead


@kernel
def spread(belt: LaneBelt, work: Work, step: float) -> None:
    """Spread the increments PUSH along the belt, and take their share into the right sides Y_0."""
    stations, reach = work.stations, _reach(belt, step)
    last, zero = stations.rows - 1, like(0.0, reach)
    rest_r = rest_i = own_r = own_i = zero
    for j in range(last):
        right_r = fma(belt.dual[j], stations[j, lf.PUSH], rest_r)
        pivot_r, pivot_i = stations[j, lf.PIVOT_R], stations[j, lf.PIVOT_I]
        z_r = fma(pivot_r, right_r, -pivot_i * rest_i)
        z_i = fma(pivot_r, rest_i, pivot_i * right_r)
        corner_r, corner_i = stations[j, lf.CORNER_R], stations[j, lf.CORNER_I]
        own_r = fma(-corner_r, z_r, fma(corner_i, z_i, own_r))
        own_i = fma(-corner_r, z_i, fma(-corner_i, z_r, own_i))
        stations[j, lf.SPREAD_R], stations[j, lf.SPREAD_I] = z_r, z_i
        ahead = reach * belt.per_cell[j]
        rest_r, rest_i = ahead * z_i, -ahead * z_r
    right_r = fma(belt.dual[last], stations[last, lf.PUSH], rest_r) + from_ahead(own_r)
    right_i = rest_i + from_ahead(own_i)
    # real and negative imaginary part of a row: symmetric as the complex one is
    pivot_r, pivot_i = stations[last, lf.PIVOT_R], stations[last, lf.PIVOT_I]
    corner_r, corner_i = stations[last, lf.CORNER_R], stations[last, lf.CORNER_I]
    x_r, x_i = ring_solution(
        pivot_r,
        -pivot_i,
        -pivot_r,
        right_r,
        -right_i,
        corner_r,
        -corner_i,
        -corner_i,
        -corner_r,
        belt.faded,
    )
    behind_r, behind_i = from_behind(x_r), from_behind(x_i)
    _put_increment(work, last, x_r)
    for j in range(last - 1, -1, -1):
        ahead = reach * belt.per_cell[j]
        corner_r, corner_i = stations[j, lf.CORNER_R], stations[j, lf.CORNER_I]
        t_r = fma(corner_r, behind_r, fma(-corner_i, behind_i, -ahead * x_i))
        t_i = fma(corner_r, behind_i, fma(corner_i, behind_r, ahead * x_r))
        pivot_r, pivot_i = stations[j, lf.PIVOT_R], stations[j, lf.PIVOT_I]
        x_r = fma(-pivot_r, t_r, fma(pivot_i, t_i, stations[j, lf.SPREAD_R]))
        x_i = fma(-pivot_r, t_i, fma(-pivot_i, t_r, stations[j, lf.SPREAD_I]))
        _put_increment(work, j, x_r)


@merged_kernel
def _put_increment(work: Work, j: int, push):
    stations = work.stations
    stations[j, lf.PUSH] = push
    stations[j, lf.Y_0] = fma(-stations[j, lf.CROSS], push, stations[j, lf.Y_0])
