"""Ring layers in lanes: constants, strains, friction of their surfaces, and their part of a sample.

The equations are those of `rings.py`. Surfaces and layers are counted from 0: layer k lies between surface k
and surface k + 1; surface 0 is the saddle, surface n that of the ears.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import DTypeLike

from cvt_hpc.kernels import kernel, merged_kernel
from cvt_hpc.lanes import LaneArray, absolute, ahead, behind, fma, like, maximum, select
from cvt_hpc.models.elastic_belt import fields as f
from cvt_hpc.models.elastic_belt import lane_fields as lf
from cvt_hpc.models.elastic_belt.belt import Belt
from cvt_hpc.models.elastic_belt.lane_belt import LaneBelt, LaneState, alike
from cvt_hpc.models.elastic_belt.lane_forces import LEAST_SHARE_OF_WIDTH, lane_speed_share
from cvt_hpc.models.elastic_belt.moments import SADDLE_FRICTION, SADDLE_POWER, SADDLE_SPEED, add
from cvt_hpc.models.elastic_belt.rings import FIRST_LAYER, Rings
from cvt_hpc.models.elastic_belt.sampling import SCALARS, Samples
from cvt_hpc.physics.layers import ring_friction

# Sums over the judged part: of surfaces the loss [W] and the mean size of their sliding on both
# arcs [m/s]; of layers the tension in the middle of both strands [N] and the mean speed [m/s].
SUMS = ("loss", "sliding driving", "sliding driven", "tension t1", "tension t2", "speed")
LOSS, SLIDING, TENSION, SPEED_SUM = 0, 1, 3, 5


class LaneRings(NamedTuple):
    """Constants of n layers of W runs."""

    constants: LaneArray  # (1, 11 + n + 4 (n + 1)), see above
    number: int  # n
    falls: bool  # whether static friction is above the kinetic one in any run
    middles: np.ndarray  # cell in the middle of each strand, (2,) int


def lane_rings(belts: Sequence[Belt], rings: Sequence[Rings], dtype: DTypeLike) -> LaneRings:
    """Constants of several runs on the same mesh, with as many layers, one for each lane."""
    n, first = rings[0].length.size, belts[0]
    constants = LaneArray(1, lf.FIRST_OFFSET + n + 4 * (n + 1), len(rings), dtype)
    for lane, (belt, ring) in enumerate(zip(belts, rings, strict=True)):
        factors = []
        for radius in (belt.driving_radius, belt.driven_radius):
            surface = 1.0 + ring.surface / radius
            neutral = 1.0 + ring.offset / radius
            # the elements below the saddle and above the last layer are at the pitch line
            above, below = surface / [*neutral, 1.0], surface / [1.0, *neutral]
            factors += np.column_stack([above, below]).ravel().tolist()
        one = [ring.mass, ring.stiffness, ring.damping, ring.relief]
        friction = [ring.static_excess, 1.0 / ring.stribeck_speed, 1.0 / ring.friction_speed]
        friction += [ring.kinetic[0], ring.kinetic[1] if n > 1 else 0.0]
        rates = [ring.stiffness / ring.mass, 2.0 * ring.damping / ring.mass]
        constants.data[0, :, lane] = [*one, *friction, *rates, *ring.offset, *factors]
    stations = np.arange(first.cell.size)
    straight = first.curvature == 0.0
    middle = first.driven_stations[first.driven_stations.size // 2]
    strands = (stations[straight & (beyond == (stations > middle))] for beyond in (False, True))
    falls = any(ring.static_excess > 0.0 for ring in rings)
    return LaneRings(constants, n, falls, np.array([strand[strand.size // 2] for strand in strands]))


def parted_rings(rings: LaneRings, parts: int) -> LaneRings:
    """Constants of one run, its stations in linked parts."""
    return rings._replace(constants=alike(rings.constants, parts))


@merged_kernel
def surface_factors(rings: LaneRings, k: int, is_driven):
    """Factors of the layer above surface k and of the one below, on the arc where a station lies."""
    first, c = lf.FIRST_OFFSET + rings.number + 2 * k, rings.constants
    second = first + 2 * (rings.number + 1)
    above = select(is_driven, c[0, second], c[0, first])
    below = select(is_driven, c[0, second + 1], c[0, first + 1])
    return above, below


@merged_kernel
def layer_strain(rings: LaneRings, state: LaneState, j: int, k: int, kappa, bent):
    """Strain of layer k in cell j [1], which is bent by kappa w = `bent`."""
    more = state.fields[j, FIRST_LAYER + rings.number + k]
    content = fma(rings.constants[0, lf.FIRST_OFFSET + k], kappa, more + 1.0)
    return (bent - more) / content


@kernel
def unite_strains(belt: LaneBelt, rings: LaneRings, state: LaneState, layers: LaneArray, stride: int) -> None:
    """Strains of the layers into field k `stride` of `layers`."""
    fields = state.fields
    for j in range(fields.rows):
        kappa = belt.curvature[j]
        bent = (fields[j, f.W] + ahead(fields, j, f.W)) * (0.5 * kappa)
        for k in range(rings.number):
            layers[j, k * stride] = layer_strain(rings, state, j, k, kappa, bent)


@kernel
def audit_layers(
    belt: LaneBelt,
    rings: LaneRings,
    state: LaneState,
    layers: LaneArray,
    samples: Samples,
    k: int,
    sums: LaneArray,
) -> None:
    """Part of the layers in the audit of a belt whose rings as one do not rub, and in sums over samples.

    `belt`, `rings` and `state` are not in parts, `layers` (N, n) is work space, `samples` and `k` are as of
    `sample`, which comes before. SUMS of this state are added to `sums` (n + 1, 6), of doubles, where the
    samples' profiles take any.
    """
    rows, profiles, first = samples.rows, samples.profiles, samples.sensing.matrix.shape[0] + len(SCALARS)
    n, fields, c = rings.number, state.fields, rings.constants
    unite_strains(belt, rings, state, layers, 1)
    zero = like(0.0, fields[0, f.W])
    share = lane_speed_share(belt, state.time[0], zero)
    belt_speed = share * belt.constants[0, lf.BELT_SPEED]
    relief = c[0, lf.LAYER_RELIEF] * share * share
    mass, stiffness = c[0, lf.LAYER_MASS], c[0, lf.LAYER_STIFFNESS]
    ring_stiffness = belt.constants[0, lf.RING_STIFFNESS]
    offset = belt.constants[0, lf.RING_OFFSET]
    summed = profiles.rows > 0
    least = LEAST_SHARE_OF_WIDTH / c[0, lf.PER_WIDTH]
    loss = stored = zero
    length = driving = driven = 0.0
    for j in range(fields.rows):
        length += belt.cell[j]
        if belt.arc_curvature[j] > 0.0:
            on_driven = belt.on_driven[j] > 0.5
            driving += 0.0 if on_driven else belt.dual[j]
            driven += belt.dual[j] if on_driven else 0.0
    for j in range(fields.rows):
        right, dual, turn = belt.cell[j], belt.dual[j], belt.ring_curvature[j]
        kappa, united = belt.curvature[j], fields[j, f.V_RING]
        mean = zero
        for i in range(n):
            v, eps = fields[j, FIRST_LAYER + i], layers[j, i]
            longer = fma(c[0, lf.FIRST_OFFSET + i], turn, 1.0)
            stored += (0.5 * dual) * mass * longer * (v - united) * (2.0 * belt_speed + v + united)
            content = fma(c[0, lf.FIRST_OFFSET + i], kappa, fields[j, FIRST_LAYER + n + i] + 1.0)
            stored += (0.5 * right) * stiffness * content * eps * eps
            mean += eps
            if summed:
                add(sums, i, SPEED_SUM, (belt_speed + v) * (right / length))
        mean = mean / n
        content = fma(offset, kappa, fields[j, f.N_RING] + 1.0)
        stored -= (0.5 * right) * ring_stiffness * content * mean * mean
        if belt.arc_curvature[j] == 0.0:
            continue
        is_driven = belt.on_driven[j] > 0.5
        below = largest = zero
        for i in range(n):
            below += _inward(belt, rings, layers, j, i, stiffness, relief)
            largest = maximum(below, largest)
        below, under = zero, fields[j, f.V_ELEMENT]
        for i in range(n + 1):
            above_factor, below_factor = surface_factors(rings, i, is_driven)
            over = fields[j, FIRST_LAYER + i] if i < n else fields[j, f.V_ELEMENT]
            sliding = fma(below_factor, belt_speed + under, -above_factor * (belt_speed + over))
            level = c[0, lf.LAYER_FRICTION_LEVEL] if 0 < i < n else c[0, lf.SADDLE_FRICTION_LEVEL]
            secant, slope = ring_friction(
                sliding,
                level,
                rings.falls,
                c[0, lf.STATIC_EXCESS],
                c[0, lf.PER_STRIBECK],
                c[0, lf.PER_WIDTH],
                least,
            )
            drag = dual * (largest - below) * secant * sliding
            loss += drag * sliding
            if summed:
                add(sums, i, LOSS, drag * sliding)
                arc, per_arc = (1, dual / driven) if is_driven else (0, dual / driving)
                add(sums, i, SLIDING + arc, absolute(sliding) * per_arc)
                if i == 0:
                    add(profiles, j, SADDLE_POWER, drag * sliding)
                    add(profiles, j, SADDLE_FRICTION, drag)
                    lever = fma(offset, belt.arc_curvature[j], 1.0)
                    as_one = fma(lever, belt_speed + under, -(belt_speed + united))
                    add(profiles, j, SADDLE_SPEED, sliding - as_one)
            if i < n:
                below += _inward(belt, rings, layers, j, i, stiffness, relief)
                under = over
    if summed:
        for strand in range(2):
            for i in range(n):
                add(sums, i, TENSION + strand, stiffness * layers[rings.middles[strand], i])
    rows[k, first + f.RING_LOSS] = rows[k, first + f.RING_LOSS] + like(loss, rows[k, first])
    rows[k, first + f.STORED_ENERGY] = rows[k, first + f.STORED_ENERGY] + like(stored, rows[k, first])


@merged_kernel
def _inward(belt: LaneBelt, rings: LaneRings, layers: LaneArray, j: int, i: int, stiffness, relief):
    """Line force with which layer i presses inward at station j [N/m], layers' strains in fields 0, 1, .."""
    turn = belt.ring_curvature[j]
    bent = belt.cell[j] * belt.curvature[j] * layers[j, i]
    bent += behind(belt.cell, j, 0) * behind(belt.curvature, j, 0) * behind(layers, j, i)
    weight = relief * fma(rings.constants[0, lf.FIRST_OFFSET + i], turn, 1.0)
    inward = fma(0.5 * belt.per_dual[j] * stiffness, bent, -weight * turn)
    return inward
