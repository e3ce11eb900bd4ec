"""The fast step of the elastic belt with ring layers: `imex` with the layers eliminated at each station.

At a station friction couples elements, layer 1, .., layer n and, where the outer layer bears on the ears,
the elements again; along the belt only stresses couple. The tension of the rings as one is treated as `imex`
does, by backward Euler: it is a force f that all layers have in common. So the chain of the layers is
eliminated station by station,

    A dv = r + f 1 + b dv_0,      dv the layers' increments, dv_0 the elements',

and the 2x2 block of `imex` remains, of elements and the layers' mean dv_1, exactly:

    f = (n dv_1 - 1.A^-1 r - dv_0 1.A^-1 b) / 1.A^-1 1.

A layer's tension beyond the mean, T_k - T / n, is explicit (leapfrog): waves of layers against each other,
at 5 km/s. Where these cross more than a cell in a step, the motion of layers against their mean has as much
more inertia as keeps the step stable,

    factor = max(1, 1.1 (EA dt^2 / h^2 + 2 D dt / h^2) / m),

h being the shorter cell beside a station: 345 at the arcs' ends and 25 far from them at 4.6 us and 160
stations, 1 below 0.2 us: the error vanishes with the step. Friction is implicit,
with its slope, or where it would turn sliding about by itself with as much of the secant as prevents that.
"""

from collections.abc import Sequence
from typing import NamedTuple

from cvt_hpc.kernels import kernel, merged_kernel
from cvt_hpc.lanes import LaneArray, ahead, anywhere, around, behind, fma, like, maximum, split
from cvt_hpc.models.elastic_belt import fields as f
from cvt_hpc.models.elastic_belt import imex, lane_rings
from cvt_hpc.models.elastic_belt import lane_fields as lf
from cvt_hpc.models.elastic_belt import lane_forces as forces
from cvt_hpc.models.elastic_belt.belt import Belt
from cvt_hpc.models.elastic_belt.imex_stations import assemble, damp_across, move_across, move_with_layers
from cvt_hpc.models.elastic_belt.lane_belt import LaneBelt, LaneState, work_space
from cvt_hpc.models.elastic_belt.lane_rings import LaneRings
from cvt_hpc.models.elastic_belt.pulley_step import advance_pulleys
from cvt_hpc.models.elastic_belt.rings import FIRST_LAYER, Rings
from cvt_hpc.models.elastic_belt.sampling import Sampled, Samples, take_sample
from cvt_hpc.physics.layers import ring_friction

# Fields of RingWork.layers, STRIDE of each layer: strain; of the eliminated chain the increment by its own
# forces, those per common force, per increment of the elements by way of the ears, and of the layer, or the
# elements, below. Before that the sum of inward forces below the layer, after it the flux of content. Behind
# them, of the station, the factors that give f, and the force of the ears.
EPS, PART, COMMON, ELEMENTS, LINK = range(5)
DRAG, STIFF = COMMON, LINK
STRIDE = 5
OWN_SUM, ELEMENT_SUM, PER_COMMON_SUM, ON_EARS = FIELDS_OF_STATION = range(4)


class RingWork(NamedTuple):
    """Work space of the step with n layers."""

    stations: LaneArray  # (N, 57), as of `Work`
    layers: LaneArray  # (N, 5 n + 4), see above
    rings: LaneRings  # constants of the layers
    whole: LaneRings  # the same for samples, which like the other two are not in parts
    audited: LaneArray  # of samples, (N, n)
    sums: LaneArray  # `lane_rings.SUMS` over the judged part, (n + 1, 6) doubles


def ring_work(state: LaneState, belts: Sequence[Belt], rings: Sequence[Rings]) -> RingWork:
    """Work space for a state; `derive` has to be called before the first step."""
    rows, _, lanes = state.fields.data.shape
    dtype, count = state.fields.data.dtype, rings[0].length.size
    constants = lane_rings.lane_rings(belts, rings, dtype)
    stations = work_space(state, lf.FIELDS_OF_WORK).stations
    layers = LaneArray(rows, STRIDE * count + len(FIELDS_OF_STATION), lanes, dtype)
    sums = LaneArray(count + 1, len(lane_rings.SUMS), lanes)
    return RingWork(stations, layers, constants, constants, LaneArray(rows, count, lanes, dtype), sums)


def parted_ring_work(work: RingWork, parts: int) -> RingWork:
    """Work space of one run, its stations in linked parts."""
    return work._replace(
        stations=split(work.stations, parts),
        layers=split(work.layers, parts),
        rings=lane_rings.parted_rings(work.rings, parts),
    )


@kernel
def begin_rings(belt: LaneBelt, state: LaneState, work: RingWork) -> None:
    """Find the layers' strains, from which a step begins."""
    lane_rings.unite_strains(belt, work.rings, state, work.layers, STRIDE)


@kernel
def take_sample_of_rings(
    state: LaneState, work: RingWork, sampled: Sampled, samples: Samples, k: int
) -> None:
    """Take a sample as `take_sample` does, with the layers' part."""
    take_sample(state, work, sampled, samples, k)
    lane_rings.audit_layers(sampled.belt, work.whole, sampled.state, work.audited, samples, k, work.sums)


@kernel
def step_rings(belt: LaneBelt, state: LaneState, work: RingWork, step: float) -> None:
    """Advance the state of a belt whose rings as one do not rub by a step [s].

    The work space holds the results of `derive` for this state, and the layers' strains.
    """
    stations = work.stations
    forces.lane_sliding(belt, state, stations)
    damp_across(belt, state, stations)
    assemble(belt, state, stations, step, False)
    coupled = move_across(belt, state, stations, step)
    _couple_layers(belt, state, work, step)
    for attempt in range(imex.MOST_PASSES):
        imex.eliminate(belt, state, stations, step, attempt > 0)
        found = imex.substitute(belt, state, stations, step)
        if found == 0 and attempt == 0:
            break
        if found == 0 or attempt == imex.MOST_PASSES - 1:
            imex.forget(stations)
            break
        if found & imex.TURNS_BACK:
            assemble(belt, state, stations, step, True)
            coupled = move_across(belt, state, stations, step)
            _couple_layers(belt, state, work, step)
    move_with_layers(belt, state, stations, coupled)
    taken, moment = imex.advance_belt(belt, state, stations, step)
    _advance_layers(belt, state, work, step)
    advance_pulleys(belt, state, taken, moment, step)
    state.time[0] += step
    forces.advance_discs(belt, state, step)
    forces.lane_contact_forces(belt, state, stations)


@merged_kernel
def _heavier_by(belt: LaneBelt, rings: LaneRings, j: int, step: float):
    """Factor on the inertia of the layers' motion against their mean at station j."""
    c = rings.constants
    rate = step * fma(step, c[0, lf.STRESS_RATE], c[0, lf.DAMPING_RATE])
    shorter = maximum(like(belt.per_cell[j], rate), like(behind(belt.per_cell, j, 0), rate))
    return maximum(1.1 * shorter * shorter * rate, 1.0)


@merged_kernel
def _force_along(rings: LaneRings, fields: LaneArray, layers: LaneArray, j: int, k: int, along):
    """Force per length on layer k at station j beyond that common to all [N/m], and its inertia [kg/m].

    `along` is, of the station, the result of `_couple_layers`.
    """
    (per_left, per_cell, even_l, even_r), (stiffness, damping), moving, turn, per_dual = along
    heavy, carried, belt_speed, acceleration = moving
    v, v_a = fields[j, FIRST_LAYER + k], behind(fields, j, FIRST_LAYER + k)
    v_b, first = ahead(fields, j, FIRST_LAYER + k), STRIDE * k
    stress_l = fma(stiffness, behind(layers, j, first), damping * per_left * (v - v_a)) - even_l
    stress_r = fma(stiffness, layers[j, first], damping * per_cell * (v_b - v)) - even_r
    inertia = heavy * fma(rings.constants[0, lf.FIRST_OFFSET + k], turn, 1.0)
    moved = fma((belt_speed + v) * per_left, v - v_a, acceleration)
    force = fma(stress_r - stress_l, per_dual, fma(-inertia, moved, carried))
    return force, inertia


@kernel
def _couple_layers(belt: LaneBelt, state: LaneState, work: RingWork, step: float) -> None:
    """Eliminate the layers: their part of the blocks and right side of elements and rings as one."""
    rings, fields, stations, layers = work.rings, state.fields, work.stations, work.layers
    n, falls, c = rings.number, rings.falls, rings.constants
    sine = belt.constants[0, lf.RING_OFFSET]
    share = forces.lane_speed_share(belt, state.time[0], sine)
    belt_speed = share * belt.constants[0, lf.BELT_SPEED]
    acceleration = forces.lane_acceleration(belt, state.time[0], step)
    per_step = 1.0 / step
    mass, stiffness, damping = c[0, lf.LAYER_MASS], c[0, lf.LAYER_STIFFNESS], c[0, lf.LAYER_DAMPING]
    relief = c[0, lf.LAYER_RELIEF] * share * share
    excess, per_stribeck, per_width = c[0, lf.STATIC_EXCESS], c[0, lf.PER_STRIBECK], c[0, lf.PER_WIDTH]
    least = forces.LEAST_SHARE_OF_WIDTH * belt.constants[0, lf.RING_FRICTION_SPEED]
    zero = like(0.0, sine)
    element_mass = belt.constants[0, lf.ELEMENT_MASS]
    for j in range(fields.rows):
        heavier = _heavier_by(belt, rings, j, step)
        free = 1.0 / (heavier * mass * per_step)
        # reduced masses over the step: of two layers; of the inner one with all it takes along, and elements
        between = 0.5 * heavier * mass * per_step
        inner = mass / (1.0 / n + (1.0 - 1.0 / n) / heavier)
        per_free = zero
        for _ in range(n):
            per_free += free
        per_free = 1.0 / per_free
        at_saddle = inner * element_mass / (inner + element_mass) * per_step
        dual, per_dual, turn = belt.dual[j], belt.per_dual[j], belt.ring_curvature[j]
        per_cell, per_left = belt.per_cell[j], behind(belt.per_cell, j, 0)
        united, united_a = fields[j, f.V_RING], behind(fields, j, f.V_RING)
        united_b = ahead(fields, j, f.V_RING)
        # a layer's share of the stress as one, on both sides
        even_l = fma(stiffness, behind(stations, j, lf.EPS_1), damping * per_left * (united - united_a))
        even_r = fma(stiffness, stations[j, lf.EPS_1], damping * per_cell * (united_b - united))
        longer = fma(belt.constants[0, lf.RING_OFFSET], turn, 1.0)
        carried = fma((belt_speed + united) * per_left, united - united_a, acceleration)
        carried = (heavier - 1.0) * mass * longer * carried
        beside = per_left, per_cell, even_l, even_r
        moving = heavier * mass, carried, belt_speed, acceleration
        along = beside, (stiffness, damping), moving, turn, per_dual
        on_arc = anywhere(belt.arc_curvature[j] > 0.0)
        is_driven = belt.on_driven[j] > 0.5
        element = fields[j, f.V_ELEMENT]
        left = right = largest = below = zero
        if on_arc:
            left = (0.5 * per_dual) * behind(belt.cell, j, 0) * behind(belt.curvature, j, 0) * stiffness
            right = (0.5 * per_dual) * belt.cell[j] * belt.curvature[j] * stiffness
            for k in range(n):
                layers[j, STRIDE * k + PART] = below
                weight = relief * turn * fma(c[0, lf.FIRST_OFFSET + k], turn, 1.0)
                inward = fma(left, behind(layers, j, STRIDE * k), fma(right, layers[j, STRIDE * k], -weight))
                below += inward
                largest = maximum(below, largest)
        bearing = largest - below
        own_sum = element_sum = zero
        per_common = per_free
        if not on_arc:
            for k in range(n - 1, -1, -1):
                force, inertia = _force_along(rings, fields, layers, j, k, along)
                part = free * force
                own_sum += part
                layers[j, STRIDE * k + PART] = part
        else:
            # Friction of all surfaces first: each is a long chain of operations, and a processor works on
            # several of them at a time only where no elimination is in between.
            for k in range(n):
                first = STRIDE * k
                above_factor, below_factor = lane_rings.surface_factors(rings, k, is_driven)
                under = fields[j, FIRST_LAYER + k - 1] if k > 0 else element
                over = fields[j, FIRST_LAYER + k]
                sliding = fma(below_factor, belt_speed + under, -above_factor * (belt_speed + over))
                level = c[0, lf.LAYER_FRICTION_LEVEL] if k > 0 else c[0, lf.SADDLE_FRICTION_LEVEL]
                level = level * (largest - layers[j, first + PART])
                secant, slope = ring_friction(sliding, level, falls, excess, per_stribeck, per_width, least)
                layers[j, first + DRAG] = secant * sliding
                # not less than the inertia that keeps friction from reversing sliding within the step
                enough = secant - (between if k > 0 else at_saddle)
                layers[j, first + STIFF] = maximum(slope, enough)
            # of the surface above the present layer: friction, slope, the factor of the layer below it
            drag_up = stiff_up = factor_up = zero
            # of the ears: friction on the elements and its slopes
            ear_drag = ear_stiff = ear_cross = zero
            on_ears = anywhere(bearing > 0.0)
            if on_ears:
                above_factor, below_factor = lane_rings.surface_factors(rings, n, is_driven)
                outer = fields[j, FIRST_LAYER + n - 1]
                sliding = fma(below_factor, belt_speed + outer, -above_factor * (belt_speed + element))
                level = bearing * c[0, lf.SADDLE_FRICTION_LEVEL]
                secant, slope = ring_friction(sliding, level, falls, excess, per_stribeck, per_width, least)
                drag_up = secant * sliding
                stiff_up = maximum(slope, secant - at_saddle)
                factor_up = below_factor
                ear_drag, ear_stiff = above_factor * drag_up, above_factor * above_factor * stiff_up
                ear_cross = above_factor * below_factor * stiff_up
            # of the layer above: its link to this one, inverse pivot and increments
            link = pivot = part = common = elements = zero
            common_sum = own_element = element_element = by_elements = by_common = zero
            for k in range(n - 1, -1, -1):
                first = STRIDE * k
                force, inertia = _force_along(rings, fields, layers, j, k, along)
                drag, stiff = layers[j, first + DRAG], layers[j, first + STIFF]
                above_factor, below_factor = lane_rings.surface_factors(rings, k, is_driven)
                by_common = fma(link, common, 1.0)
                if on_ears:
                    by_elements = ear_cross if k == n - 1 else link * elements
                cross = above_factor * below_factor * stiff
                force += above_factor * drag - factor_up * drag_up
                diagonal = inertia * per_step
                diagonal += above_factor * above_factor * stiff + factor_up * factor_up * stiff_up
                diagonal = fma(-link * link, pivot, diagonal)
                force = fma(link, part, force)
                drag_up, stiff_up, factor_up, link = drag, stiff, below_factor, cross
                pivot = 1.0 / diagonal
                part, common = pivot * force, pivot * by_common
                own_sum, common_sum = fma(part, by_common, own_sum), fma(common, by_common, common_sum)
                layers[j, first + PART], layers[j, first + COMMON] = part, common
                layers[j, first + LINK] = pivot * cross
                if on_ears:
                    elements = pivot * by_elements
                    layers[j, first + ELEMENTS] = elements
                    if k > 0:
                        element_sum = fma(elements, by_common, element_sum)
                        own_element = fma(part, by_elements, own_element)
                        element_element = fma(elements, by_elements, element_element)
            # the inner layer, on the saddle, takes the elements along by its link
            by_elements += link
            elements = fma(pivot, link, elements)
            element_sum = fma(elements, by_common, element_sum)
            own_element = fma(part, by_elements, own_element)
            element_element = fma(elements, by_elements, element_element)
            per_common = 1.0 / common_sum
            taken = factor_up * drag_up
            stiff = fma(factor_up * factor_up, stiff_up, ear_stiff - element_element)
            stiff = fma(element_sum * per_common, element_sum, stiff)
            push = fma(-own_sum * per_common, element_sum, own_element + ear_drag - taken)
            stations[j, lf.D_00] = fma(dual, stiff, stations[j, lf.D_00])
            stations[j, lf.Y_0] = fma(dual, push, stations[j, lf.Y_0])
        last = STRIDE * n
        layers[j, last + OWN_SUM], layers[j, last + ELEMENT_SUM] = own_sum, element_sum
        layers[j, last + PER_COMMON_SUM], layers[j, last + ON_EARS] = per_common, bearing
        # the rings as one neither rub nor turn sliding about
        stations[j, lf.SADDLE] = 0.0
        stations[j, lf.D_01] = -(n * dual) * element_sum * per_common
        united_rate = n * mass * longer * per_step
        stations[j, lf.D_11] = dual * fma(-(heavier - 1.0), united_rate, (n * n) * per_common)
        stations[j, lf.Y_1] = (n * dual) * own_sum * per_common


@kernel
def _advance_layers(belt: LaneBelt, state: LaneState, work: RingWork, step: float) -> None:
    """Apply the layers' increments; their strains, and those of the rings as one."""
    rings, fields, stations, layers = work.rings, state.fields, work.stations, work.layers
    n, c = rings.number, rings.constants
    offset = belt.constants[0, lf.RING_OFFSET]
    belt_speed = forces.lane_speed_share(belt, state.time[0], offset) * belt.constants[0, lf.BELT_SPEED]
    damping, last = c[0, lf.LAYER_DAMPING], STRIDE * n
    lost = zero = offset * 0.0
    for j in range(fields.rows + 1):
        if j < fields.rows:
            free = step / (_heavier_by(belt, rings, j, step) * c[0, lf.LAYER_MASS])
            element = stations[j, lf.DV_0]
            common = fma(stations[j, lf.DV_1], n, -layers[j, last + OWN_SUM])
            common = fma(-layers[j, last + ELEMENT_SUM], element, common) * layers[j, last + PER_COMMON_SUM]
            on_arc = anywhere(belt.arc_curvature[j] > 0.0)
            on_ears = on_arc and anywhere(layers[j, last + ON_EARS] > 0.0)
            change, total = element, zero
            for k in range(n):
                first = STRIDE * k
                own = layers[j, first + PART]
                if on_arc:
                    own = fma(layers[j, first + COMMON], common, own)
                    if on_ears:
                        own = fma(layers[j, first + ELEMENTS], element, own)
                    change = fma(layers[j, first + LINK], change, own)
                else:
                    change = fma(free, common, own)
                v = fields[j, FIRST_LAYER + k] + change
                fields[j, FIRST_LAYER + k] = v
                total += v
                # content that goes through, less that by the belt speed; 1 / (1 + eps) by its series
                eps = behind(layers, j, first)
                short = fma(-eps, fma(-eps, 1.0 - eps, 1.0), 1.0)
                layers[j, first + PART] = fma(-belt_speed, eps, v) * short
            fields[j, f.V_RING] = total / n
        if j > 0:
            # the cell behind the station, whose old strain is no longer needed
            i = j - 1
            kappa, per_cell = belt.curvature[i], belt.per_cell[i]
            bent = (fields[i, f.W] + ahead(fields, i, f.W)) * (0.5 * kappa)
            united, mean = ahead(fields, i, f.V_RING) - fields[i, f.V_RING], zero
            for k in range(n):
                first, row = STRIDE * k, FIRST_LAYER + n + k
                outflow = ahead(layers, i, first + PART) - layers[i, first + PART]
                fields[i, row] = fma(-step * per_cell, outflow, fields[i, row])
                eps = lane_rings.layer_strain(rings, state, i, k, kappa, bent)
                layers[i, first] = eps
                mean += eps
                closing = ahead(fields, i, FIRST_LAYER + k) - fields[i, FIRST_LAYER + k] - united
                lost = fma(damping * per_cell * closing, closing, lost)
            mean = mean / n
            longer, short = fma(offset, kappa, 1.0), 1.0 / (mean + 1.0)
            stations[i, lf.EPS_1], stations[i, lf.SHORT_1] = mean, short
            stations[i, lf.PER_CONTENT_1] = (mean + 1.0) / (bent + longer)
            fields[i, f.N_RING] = fma(-longer, mean, bent) * short
    work_done = state.scalars[0, lf.LAYER_WORK]
    state.scalars[0, lf.LAYER_WORK] = work_done + around(like(lost, work_done)) * step
