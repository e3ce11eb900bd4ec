"""The system of the fast step: stresses into its rows, elimination along the belt, and back substitution."""

from __future__ import annotations

from cvt_hpc.kernels import kernel, merged_kernel
from cvt_hpc.lanes import LaneArray, absolute, anywhere, fma, like, minimum, select
from cvt_hpc.models.elastic_belt.belt import V_ELEMENT, V_RING, U
from cvt_hpc.models.elastic_belt.imex_work import (
    AHEAD,
    D_00,
    D_01,
    D_11,
    DV_0,
    DV_1,
    G_00,
    G_01,
    G_10,
    G_11,
    I_00,
    I_01,
    I_11,
    LAG,
    LINK_0,
    LINK_1,
    MEETING,
    PUSH,
    REVERSING,
    RING_REVERSING,
    SLOPE,
    Y_0,
    Y_1,
    ImexWork,
)
from cvt_hpc.models.elastic_belt.lane_belt import (
    ELEMENT_DAMPING,
    ELEMENT_STIFFNESS,
    FRICTION_SPEED,
    REPEATS,
    RING_DAMPING,
    RING_FRICTION_SPEED,
    RING_OFFSET,
    RING_STIFFNESS,
    LaneBelt,
    LaneState,
)
from cvt_hpc.models.elastic_belt.lane_forces import (
    EPS_0,
    EPS_1,
    PER_CONTENT_0,
    PER_CONTENT_1,
    SADDLE,
    SHORT_0,
    SLIDING_R,
    SLIDING_T,
    lane_belt_speed,
)

# Share of the speeds' change in a step that the rings' stress feels. From 1/4 on it is stable for any step
# and damps nothing (Newmark); the rest keeps changing contact from exciting the shortest waves at long steps.
CENTRED = 0.35
# Overlap of elements, in strain, from which a cell that a step has taken as apart is closed in it: 500 N of
# the default belt, a tenth of its rings' tension.
LARGEST_OVERLAP = 1.25e-5
FADED = 0.1  # [N s/m]: couplings of stations are 1e3 and more


@merged_kernel
def _element_stress(stiffness, grip, eps, closing, ahead, per_length, last, meet):
    """-P in a cell [N] with the speeds that the step begins with, and its slope with their change.

    Parameters
    ----------
    stiffness, grip
        EA [N], damping over the cell's length [N s/m].
    eps, closing
        Strain and difference of the speeds at both ends [m/s].
    ahead, per_length
        Strain at the end of the step with these speeds, and its slope with the difference [s/m].
    last
        Slope of -P in the step before [N s/m]: 0 where the elements were apart.
    meet
        1 where the step was found to press elements together that it had taken as apart.
    """
    viscous = grip * closing
    # elements never pull: their damper ends where it would outweigh the push force
    pulls = viscous > -stiffness * eps
    viscous, grip = select(pulls, -stiffness * minimum(eps, 0.0), viscous), select(pulls, 0.0, grip)
    apart = (eps >= 0.0) & (ahead >= 0.0) & (pulls | (last <= 0.0)) & (meet < 0.5)
    stress = select(apart, 0.0, fma(stiffness, ahead, viscous))
    return stress, select(apart, 0.0, fma(stiffness, per_length, grip))


@kernel
def eliminate(belt: LaneBelt, state: LaneState, work: ImexWork, step: float) -> None:
    """Stresses into the rows, and forward elimination; the last station, that closes the cycle, is solved."""
    fields, stations, c = state.fields, work.stations, belt.constants
    n = belt.cell.size
    last = n - 1
    belt_speed = lane_belt_speed(belt, state.time[0])
    element_stiffness, ring_stiffness = c[0, ELEMENT_STIFFNESS], c[0, RING_STIFFNESS]
    element_damping, ring_damping = c[0, ELEMENT_DAMPING], c[0, RING_DAMPING]
    zero = like(0.0, belt_speed)
    p = q = r = f0 = f1 = c00 = c01 = c10 = c11 = t00 = t01 = t11 = s0 = s1 = zero
    for k in range(-1, last):
        # the last cell first, which is behind station 0
        j = k if k >= 0 else last
        a, b = j - 1 if j > 0 else last, j + 1 if j < last else 0
        per_cell = belt.per_cell[j]
        v0, v1 = fields[j, V_ELEMENT], fields[j, V_RING]
        closing_0, closing_1 = fields[b, V_ELEMENT] - v0, fields[b, V_RING] - v1
        eps = stations[j, EPS_0]
        # what leaves ahead less what enters behind, per (1 + eps): v[b] - v[j] (1 + eps) / (1 + eps_a)
        outflow = fma(-(belt_speed + v0), (eps - stations[a, EPS_0]) * stations[a, SHORT_0], closing_0)
        kappa = belt.curvature[j]
        if kappa > 0.0:
            lifts = fields[j, U] + stations[j, PUSH] + fields[b, U] + stations[b, PUSH]
            outflow = fma(0.5 * kappa * belt.cell[j], lifts, outflow)
        per_length = (step * per_cell) * stations[j, PER_CONTENT_0]
        ahead = fma(per_length, outflow, eps)
        stations[j, AHEAD] = ahead
        stress_0, e0 = _element_stress(
            element_stiffness,
            element_damping * per_cell,
            eps,
            closing_0,
            ahead,
            per_length,
            stations[j, LINK_0],
            stations[j, MEETING],
        )
        grip = ring_damping * per_cell
        stress_1 = fma(ring_stiffness, stations[j, EPS_1], grip * closing_1)
        e1 = fma(CENTRED * ring_stiffness, (step * per_cell) * stations[j, PER_CONTENT_1], grip)
        stations[j, LINK_0], stations[j, LINK_1] = e0, e1
        if k < 0:
            # Schur complement of the last station; coupling of the present row to it (00, 01, 10, 11); what
            # the row before leaves to the present one
            p, q, r = stations[last, D_00] + e0, stations[last, D_01], stations[last, D_11] + e1
            f0, f1 = stations[last, Y_0] + stress_0, stations[last, Y_1] + stress_1
            c00, c11 = -e0, -e1
            t00, t11, s0, s1 = e0, e1, -stress_0, -stress_1
            continue
        d00, d01 = stations[j, D_00] + (e0 + t00), stations[j, D_01] + t01
        d11 = stations[j, D_11] + (e1 + t11)
        y0, y1 = stations[j, Y_0] + (stress_0 + s0), stations[j, Y_1] + (stress_1 + s1)
        if j == last - 1:
            c00 -= e0
            c11 -= e1
            # the last row holds its own link behind
            p += e0
            r += e1
            f0 -= stress_0
            f1 -= stress_1
        per_determinant = 1.0 / fma(d00, d11, -d01 * d01)
        i00, i01, i11 = d11 * per_determinant, -d01 * per_determinant, d00 * per_determinant
        z0, z1 = fma(i00, y0, i01 * y1), fma(i01, y0, i11 * y1)
        g00, g01 = fma(i00, c00, i01 * c10), fma(i00, c01, i01 * c11)
        g10, g11 = fma(i01, c00, i11 * c10), fma(i01, c01, i11 * c11)
        p = fma(-c00, g00, fma(-c10, g10, p))
        q = fma(-c00, g01, fma(-c10, g11, q))
        r = fma(-c01, g01, fma(-c11, g11, r))
        f0 = fma(-c00, z0, fma(-c10, z1, f0))
        f1 = fma(-c01, z0, fma(-c11, z1, f1))
        stations[j, I_00], stations[j, I_01], stations[j, I_11] = i00, i01, i11
        stations[j, DV_0], stations[j, DV_1] = z0, z1
        stations[j, G_00], stations[j, G_01], stations[j, G_10], stations[j, G_11] = g00, g01, g10, g11
        t00, t01, t11 = fma(-e0 * e0, i00, e0), -e0 * e1 * i01, fma(-e1 * e1, i11, e1)
        s0, s1 = fma(e0, z0, -stress_0), fma(e1, z1, -stress_1)
        # it fades along the belt, beyond all need: kept from numbers so small that the processor slows down
        c00, c01 = (e0 * g00 + FADED) - FADED, (e0 * g01 + FADED) - FADED
        c10, c11 = (e1 * g10 + FADED) - FADED, (e1 * g11 + FADED) - FADED
    per_determinant = 1.0 / fma(p, r, -q * q)
    stations[last, DV_0] = fma(r, f0, -q * f1) * per_determinant
    stations[last, DV_1] = fma(p, f1, -q * f0) * per_determinant


@kernel
def substitute(belt: LaneBelt, work: ImexWork, scalars: LaneArray, step: float) -> bool:
    """Back substitution: DV become the increments of v_element and v_ring. Whether the step has to be redone.

    It has for two reasons, and marks the places:

    - Flanks or saddles that slid in the saturated range would now slide back. There the tangent of friction
      is flat, the step all but explicit, and a large friction force turns the sliding about within a step: it
      chatters from step to step, and takes energy out of nothing.
    - Elements that the step has taken as apart would be pressed together. Their push would set in a step
      late, go on by one cell a step instead of at the speed of waves, and pile up.
    """
    stations, c = work.stations, belt.constants
    last = belt.cell.size - 1
    x0, x1 = stations[last, DV_0], stations[last, DV_1]
    width, ring_width, offset = c[0, FRICTION_SPEED], c[0, RING_FRICTION_SPEED], c[0, RING_OFFSET]
    saturated = width * width
    n0, n1 = x0, x1
    found = width < 0.0
    for j in range(last, -1, -1):
        if j < last:
            z0 = fma(-stations[j, G_01], x1, fma(-stations[j, G_00], x0, stations[j, DV_0]))
            z1 = fma(-stations[j, G_11], x1, fma(-stations[j, G_10], x0, stations[j, DV_1]))
            if j < last - 1:
                # behind the last but one comes the border, whose share is in G
                e0, e1 = stations[j, LINK_0] * n0, stations[j, LINK_1] * n1
                i01 = stations[j, I_01]
                z0 = fma(stations[j, I_00], e0, fma(i01, e1, z0))
                z1 = fma(i01, e0, fma(stations[j, I_11], e1, z1))
            found |= _meeting(belt, stations, j, n0 - z0, step)
            n0, n1 = z0, z1
            stations[j, DV_0], stations[j, DV_1] = n0, n1
        if belt.arc_share[j] > 0.0:
            v_radial, v_tangential = stations[j, SLIDING_R], stations[j, SLIDING_T]
            rise = fma(stations[j, SLOPE] - stations[j, LAG], n0, stations[j, PUSH])
            turn = fma(v_radial, rise, v_tangential * n0)
            speed_squared = fma(v_radial, v_radial, v_tangential * v_tangential)
            back = (speed_squared > saturated) & (turn < -speed_squared)
            back &= stations[j, REVERSING] < 0.5
            found |= back
            stations[j, REVERSING] = select(back, 1.0, stations[j, REVERSING])
            saddle = stations[j, SADDLE]
            change = fma(fma(offset, belt.arc_curvature[j], 1.0), n0, -n1)
            back = (absolute(saddle) > ring_width) & (saddle * (saddle + change) < 0.0)
            back &= stations[j, RING_REVERSING] < 0.5
            found |= back
            stations[j, RING_REVERSING] = select(back, 1.0, stations[j, RING_REVERSING])
    found |= _meeting(belt, stations, last, n0 - x0, step)
    scalars[0, REPEATS] = scalars[0, REPEATS] + select(found, like(1.0, scalars[0, REPEATS]), 0.0)
    return anywhere(found)


@merged_kernel
def _meeting(belt: LaneBelt, stations: LaneArray, j: int, opening, step: float):
    """Whether elements of cell j that the step has taken as apart overlap, as `opening` [m/s] changes."""
    per_length = (step * belt.per_cell[j]) * stations[j, PER_CONTENT_0]
    overlap = fma(per_length, opening, stations[j, AHEAD]) < -LARGEST_OVERLAP
    overlap &= (stations[j, LINK_0] <= 0.0) & (stations[j, MEETING] < 0.5)
    stations[j, MEETING] = select(overlap, 1.0, stations[j, MEETING])
    return overlap
