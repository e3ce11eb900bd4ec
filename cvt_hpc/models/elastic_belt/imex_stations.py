"""The fast step at each station: forces, and slopes with the speeds, without the stresses T and P."""

from cvt_hpc.kernels import kernel, merged_kernel
from cvt_hpc.lanes import (
    ahead,
    anywhere,
    behind,
    fma,
    like,
    minimum,
    reciprocals,
    select,
)
from cvt_hpc.models.elastic_belt import fields as f
from cvt_hpc.models.elastic_belt import lane_fields as lf
from cvt_hpc.models.elastic_belt import lane_forces as forces
from cvt_hpc.models.elastic_belt.imex_bending import DAMPED, LAG_SHARE
from cvt_hpc.models.elastic_belt.lane_belt import LaneBelt, LaneState, Work
from cvt_hpc.models.elastic_belt.lane_column import across_by_curvature, column_across
from cvt_hpc.models.elastic_belt.lane_tilt import tilt_damping
from cvt_hpc.physics.flank import flank_shares


@merged_kernel
def implicit_shares(one, other, inertia):
    """Two slopes, weighted by 1/2 (time-centred) where slow, 1 where stiff; inertia = mass / dt.

    The linearised step then multiplies the velocity by an approximation of exp(-slope / inertia) that never
    changes sign.
    """
    per_one, per_other = reciprocals(fma(2.0, one, 12.0 * inertia), fma(2.0, other, 12.0 * inertia))
    return one * fma(one, per_one, 0.5), other * fma(other, per_other, 0.5)


@kernel
def damp_across(belt: LaneBelt, state: LaneState, work: Work) -> None:
    """Take the layers' damping across the belt from the stations at both ends of each cell, into BENT.

    By the speeds that the step begins with. Of a cell's lengthening v_0,s + kappa u, in which the dampers
    along the belt are implicit, a step of both leaves with a = 4 c dt / (m_0 h^2) and b = c dt kappa^2 / m
    the share (1 - b) / (1 + a): it is stable up to b = 2 + a.
    """
    fields, stations, c = state.fields, work.stations, belt.constants
    stiffness, damper_0 = c[0, lf.ELEMENT_STIFFNESS], c[0, lf.ELEMENT_DAMPING]
    damper_1 = c[0, lf.RING_DAMPING]
    zero = like(0.0, stiffness)
    for j in range(fields.rows):
        half, bent = 0.5 * belt.curvature[j] * belt.cell[j], zero
        if anywhere(half > 0.0):
            lifts = half * (fields[j, f.U] + ahead(fields, j, f.U))
            opening = ahead(fields, j, f.V_ELEMENT) - fields[j, f.V_ELEMENT] + lifts
            stretching = ahead(fields, j, f.V_RING) - fields[j, f.V_RING] + lifts
            # It never makes elements pull; those that are apart have none, but for what remains of a push
            # beyond the length at rest.
            pull = stiffness * forces.pressed_strain(belt, state, stations, j)
            viscous = damper_0 * belt.per_cell[j] * opening
            beyond = select(stations[j, lf.LINK_0] > 0.0, minimum(pull + viscous, 0.0), zero)
            damped = select(pull < 0.0, minimum(viscous, -pull), beyond)
            bent = half * fma(damper_1 * belt.per_cell[j], stretching, damped)
        stations[j, lf.BENT] = bent


@kernel
def assemble(belt: LaneBelt, state: LaneState, work: Work, step: float, again: bool) -> None:
    """Forces and slopes at the stations, but for the stresses T and P: the system's blocks and right side.

    `again` takes the secant of friction where a pass before has found that it would turn sliding about. For
    the increments of u it finds the force ACROSS and its slopes, which `move_across` couples by bending.
    """
    n, fields, stations, c = state.fields.rows, state.fields, work.stations, belt.constants
    per_step = 1.0 / step
    sine, cosine, width = c[0, lf.SINE], c[0, lf.COSINE], c[0, lf.FRICTION_SPEED]
    per_cosine, per_width = 1.0 / cosine, 1.0 / width
    element_stiffness, ring_stiffness = c[0, lf.ELEMENT_STIFFNESS], c[0, lf.RING_STIFFNESS]
    element_mass, ring_mass, mass = c[0, lf.ELEMENT_MASS], c[0, lf.RING_MASS], c[0, lf.MASS]
    offset = c[0, lf.RING_OFFSET]
    speed_share = forces.lane_speed_share(belt, state.time[0], sine)
    belt_speed, bending = speed_share * c[0, lf.BELT_SPEED], c[0, lf.BENDING_STIFFNESS]
    acceleration = forces.lane_acceleration(belt, state.time[0], step)
    ring_friction, per_ring_width = c[0, lf.RING_FRICTION], 1.0 / c[0, lf.RING_FRICTION_SPEED]
    ring_relief = c[0, lf.RING_RELIEF] * speed_share * speed_share
    centrifugal, gyroscopic = mass * belt_speed * belt_speed, 2.0 * mass * belt_speed
    masses = element_mass, ring_mass
    damping = forces.lane_damping(belt, state.time[0])
    base_mass = fma(mass, per_step, 0.5 * damping)
    element_rate = element_mass * per_step
    zero = like(0.0, sine)
    for j in range(n):
        touches = belt.touches[j]
        dual, per_left, span = belt.dual[j], behind(belt.per_cell, j, 0), belt.per_span[j]
        u, v0, v1 = fields[j, f.U], fields[j, f.V_ELEMENT], fields[j, f.V_RING]
        ring_left = ring_stiffness * behind(stations, j, lf.EPS_1)
        ring_right = ring_stiffness * stations[j, lf.EPS_1]
        net_left = minimum(forces.pressed_behind(belt, state, stations, j), 0.0)
        net_left = fma(element_stiffness, net_left, ring_left - centrifugal)
        net_right = minimum(forces.pressed_strain(belt, state, stations, j), 0.0)
        net_right = fma(element_stiffness, net_right, ring_right - centrifugal)
        slope = (ahead(fields, j, f.W) - behind(fields, j, f.W)) * span
        transverse = forces.lane_transverse(belt, fields, j, net_left, net_right, bending, DAMPED * step)
        transverse = fma(-gyroscopic, (ahead(fields, j, f.U) - behind(fields, j, f.U)) * span, transverse)
        transverse = fma(-acceleration * mass, slope, transverse)
        transverse = fma(-belt.per_dual[j], behind(stations, j, lf.BENT) + stations[j, lf.BENT], transverse)
        if belt.has_column:
            transverse += column_across(belt, state, j)
        if belt.is_curved:
            transverse += across_by_curvature(belt, state, j, bending, belt_speed, masses)
        full_speed = belt_speed + v0
        v_across = fma(full_speed, slope, u)
        outward = -damping * v_across
        longer = fma(offset, belt.ring_curvature[j], 1.0)
        ring_here = ring_mass * longer
        element, ring, coupling = element_rate, ring_here * per_step, zero
        along_element = -full_speed * ((v0 - behind(fields, j, f.V_ELEMENT)) * per_left) * element_mass
        along_ring = -(belt_speed + v1) * ((v1 - behind(fields, j, f.V_RING)) * per_left) * ring_here
        along_element = fma(-acceleration, element_mass, along_element)
        along_ring = fma(-acceleration, ring_here, along_ring)
        radial_mass, cross, push_along = base_mass, zero, zero
        if anywhere(touches > 0.0):
            lever = fma(offset, belt.arc_curvature[j], 1.0)
            v_tangential, coefficient = stations[j, lf.SLIDING_T], stations[j, lf.COEFFICIENT]
            per_speed, factor = stations[j, lf.PER_SPEED], stations[j, lf.FACTOR]
            ring_factor, force = stations[j, lf.RING_FACTOR], stations[j, lf.FORCE]
            meridian = stations[j, lf.SLIDING_R] * per_cosine
            upright, lean = belt.upright[j], forces.leaning(belt, j, fields[j, f.W])

            grip = forces.ring_grip(belt, j, ring_left, ring_right, ring_relief * longer, ring_friction)
            drag = grip * ring_factor
            stiff = grip * (fma(-ring_factor, ring_factor, 1.0) * per_ring_width)
            if again:
                # by the secant friction stops, and never turns the sliding about
                stiff = select(stations[j, lf.RING_REVERSING] > 0.5, drag / stations[j, lf.SADDLE], stiff)
            if belt.tilts:
                yielding = tilt_damping(belt, step)
                stiff *= yielding / (yielding + stiff)

            # with the slopes of friction along and across the sliding
            mu = coefficient * factor
            climb, run = meridian * per_speed, v_tangential * per_speed
            axial_share, radial_share = flank_shares(mu, climb, sine, cosine)
            per_normal, per_stiff = reciprocals(axial_share, fma(2.0, stiff, 12.0 * ring))
            twice_normal = select(touches > 0.0, 2.0 * force * per_normal, zero)
            radial = twice_normal * radial_share
            friction = twice_normal * mu
            tangential = -friction * run
            across = friction * per_speed
            thrown = stations[j, lf.REVERSING] > 0.5 if again else zero > 0.0
            along = twice_normal * coefficient * (fma(-factor, factor, 1.0) * per_width)
            along, across = implicit_shares(select(thrown, across, along), across, element_rate)
            excess = along - across
            # slopes with radial and tangential sliding, turned into those across and along the path
            radial_slope = fma(excess, climb * climb, across) * (per_cosine * per_cosine)
            mixed, slope_along = excess * climb * run * per_cosine, fma(excess, run * run, across)
            turned, square = upright * lean, fma(upright, upright, -lean * lean)
            difference = radial_slope - slope_along
            radial_mass += fma(lean * lean, -difference, fma(-2.0 * turned, mixed, radial_slope))
            cross = fma(turned, difference, square * mixed)
            flank_slope = fma(lean * lean, difference, fma(2.0 * turned, mixed, slope_along))
            outward = fma(upright, radial, fma(-lean, tangential, outward))
            push_along = fma(lean, radial, upright * tangential)
            stiff *= fma(stiff, per_stiff, 0.5)
            if belt.tilts:
                state.tilt[j, lf.DRAG_SLOPE] = select(belt.arc_curvature[j] > 0.0, stiff, zero)
            along_element += fma(-lever, drag, push_along)
            along_ring += drag
            element += fma(lever * lever, stiff, flank_slope)
            ring += stiff
            coupling = -lever * stiff
            if belt.is_free or anywhere(belt.on_driven[j] > 0.5):
                stations[j, lf.FLANK] = tangential
                stations[j, lf.FLANK_SLOPE] = fma(upright, slope_along, lean * mixed)
                stations[j, lf.FLANK_CROSS] = fma(upright, mixed, -lean * slope_along)
        along_element = fma(outward, slope, along_element)
        lag = LAG_SHARE * cross / radial_mass
        if anywhere(touches > 0.0):
            stations[j, lf.LAG], stations[j, lf.SLOPE], stations[j, lf.D_01] = lag, slope, dual * coupling
        stations[j, lf.D_00], stations[j, lf.D_11] = dual * fma(-cross, lag, element), dual * ring
        stations[j, lf.Y_0], stations[j, lf.Y_1] = dual * along_element, dual * along_ring
        stations[j, lf.ACROSS], stations[j, lf.MASS_ACROSS] = transverse + outward, radial_mass
        stations[j, lf.CROSS] = cross
