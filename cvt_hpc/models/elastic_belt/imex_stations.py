"""The fast step at each station: forces, and slopes with the speeds, without the stresses T and P; bending.

Bending is implicit, so that the shortest waves limit no step. Explicit bending is stable up to dt = 2 / w of
the shortest waves, w^2 = 16 EI / (m h^4): steps would fall with the square of the cells. Here the increments
of a step have, with K = EI d^4/ds^4,

    A du + C dv_0 = F,   A = m / dt + r + IMPLICIT dt K,

r being the slope of friction and damping with u, C that of friction with v_0. No wave of bending turns by
more than 2 asin(1 / sqrt(4 IMPLICIT)) in a step. States at rest stay what they are, and waves of a frequency
w are slower by the share IMPLICIT (w dt)^2 / 2 of what bending has in their stiffness: 2e-4 at 600 Hz and 4.6
us, if all of it were bending. Pressed elements that bear a moment count into EI.

With M = -(q dt / m) d^2/ds^2 du and q^2 = IMPLICIT EI m it is one symmetric system of blocks [du, M] along
the belt, solved without dv_0 and, once that is known, with it. The block of dv_0, with its own slope d, lacks
the term -C A^-1 C, which couples all stations; LAG_SHARE C^2 / (m / dt + r) stands for it. That is the step
of a symmetric mass: of A, C, and d + C (A^-1 - LAG_SHARE / (m / dt + r)) C. It is stable as long as that
outweighs S = (1 + 2 DAMPED) dt K / 4 in every direction. With b = 4 IMPLICIT / (1 + 2 DAMPED), A contains b
S, and of du = x - A^-1 C dv_0 the energy S is at most that of b x and b / (b - 1) A^-1 C dv_0; the latter has
no more than dv_0.C^2 dv_0 / (4 (b - 1) (m / dt + r)), as y - y^2 <= 1/4. LAG_SHARE leaves as much, so that no
wave grows whatever mesh and friction are. A mass that is not symmetric, as of increments that are spread
after friction has taken its part, feeds the shortest waves.
"""

from cvt_hpc.kernels import kernel, merged_kernel
from cvt_hpc.lanes.functions import absolute, anywhere, fma, like, minimum, reciprocals, select, sqrt
from cvt_hpc.lanes.kinds import LaneArray
from cvt_hpc.lanes.rings import ahead, behind, from_ahead, from_behind, ring_solution
from cvt_hpc.models.elastic_belt import fields as f
from cvt_hpc.models.elastic_belt import lane_fields as lf
from cvt_hpc.models.elastic_belt import lane_forces as forces
from cvt_hpc.models.elastic_belt.lane_belt import LaneBelt, LaneState
from cvt_hpc.models.elastic_belt.lane_column import across_by_curvature, column_across
from cvt_hpc.models.elastic_belt.lane_forces import lane_belt_speed
from cvt_hpc.models.elastic_belt.lane_tilt import tilt_damping
from cvt_hpc.physics.flank import flank_shares

IMPLICIT = 1.0
# Share of a step by which bending leads, K (w + DAMPED dt u): in a step it damps waves of a frequency w by
# DAMPED (w dt)^2 / 2 of what bending has in their stiffness. Without it the shortest waves, which A makes
# heavy and contact stirs up as it ends station by station, go on for ever.
DAMPED = 0.25
LAG_SHARE = 1.0 - 1.0 / (4.0 * (4.0 * IMPLICIT / (1.0 + 2.0 * DAMPED) - 1.0))
# Forces: without and with the gyroscopic one, and with C dv_0
ALONE, TURNING, WITH_LAYERS = range(3)


@merged_kernel
def _coupling(belt: LaneBelt):
    """Coupling q [N s]: the root of a product, so that it scales with the units of force as all else does."""
    stiffness = belt.constants[0, lf.BENDING_STIFFNESS]
    if belt.has_column:
        stiffness = stiffness + belt.constants[0, lf.COLUMN_STIFFNESS]
    return sqrt(IMPLICIT * stiffness * belt.constants[0, lf.MASS])


@kernel
def move_across(belt: LaneBelt, state: LaneState, stations: LaneArray, step: float) -> int:
    """Increments of u without those of the layers, PUSH, from ACROSS and MASS_ACROSS.

    Returns how many rows are still coupled to the last one behind as the elimination reaches them: a dozen,
    since bending reaches no further. Those beyond have no B.

    The gyroscopic force is taken with the mean of u over the step: it then neither damps nor feeds. By one
    correction with the increments without it, since it changes them little: by v step / h, some 0.02.
    Extrapolated from earlier steps it feeds waves of a frequency w that run against the belt, at the rate
    (v / h) (w step)^3 / 4.
    """
    c = belt.constants
    last, q, mass_rate = stations.rows - 1, _coupling(belt), c[0, lf.MASS] * (1.0 / step)
    zero = like(0.0, q)
    # of the last row, for the one behind; of a row's coupling to the last one behind; of the row before
    own00 = own01 = own11 = c00 = c11 = t00 = t01 = t11 = zero
    link = from_behind(q * belt.per_cell[last])
    c01 = c10 = -link
    coupled = last
    for j in range(last + 1):
        onward = q * belt.per_cell[j]
        dual = like(belt.dual[j], q)
        d00, d01 = fma(dual, stations[j, lf.MASS_ACROSS], -t00), link + onward - t01
        d11 = -mass_rate * dual - t11
        if j == last:
            stations[j, lf.A_00], stations[j, lf.A_01] = d00 + from_ahead(own00), d01 + from_ahead(own01)
            stations[j, lf.A_11] = d11 + from_ahead(own11)
            stations[j, lf.B_00], stations[j, lf.B_01] = c00, c01
            stations[j, lf.B_10], stations[j, lf.B_11] = c10, c11
        else:
            per_determinant = 1.0 / fma(d00, d11, -d01 * d01)
            i00, i01, i11 = d11 * per_determinant, -d01 * per_determinant, d00 * per_determinant
            stations[j, lf.A_00], stations[j, lf.A_01], stations[j, lf.A_11] = i00, i01, i11
            square = onward * onward
            t00, t01, t11 = square * i11, square * i01, square * i00
            if j < coupled:
                g00, g01 = fma(i00, c00, i01 * c10), fma(i00, c01, i01 * c11)
                g10, g11 = fma(i01, c00, i11 * c10), fma(i01, c01, i11 * c11)
                own00 = fma(-c00, g00, fma(-c10, g10, own00))
                own01 = fma(-c00, g01, fma(-c10, g11, own01))
                own11 = fma(-c01, g01, fma(-c11, g11, own11))
                stations[j, lf.B_00], stations[j, lf.B_01] = g00, g01
                stations[j, lf.B_10], stations[j, lf.B_11] = g10, g11
                c00, c01 = (onward * g10 + belt.faded) - belt.faded, (onward * g11 + belt.faded) - belt.faded
                c10, c11 = (onward * g00 + belt.faded) - belt.faded, (onward * g01 + belt.faded) - belt.faded
                if not anywhere(absolute(c00) + absolute(c01) + absolute(c10) + absolute(c11) > 0.0):
                    coupled = j + 1
        link = onward
    gyration = -c[0, lf.MASS] * lane_belt_speed(belt, state.time[0])
    _solve(belt, stations, q, gyration, ALONE, coupled)
    _solve(belt, stations, q, gyration, TURNING, coupled)
    belt_speed, fields = lane_belt_speed(belt, state.time[0]), state.fields
    for j in range(last + 1):
        push = stations[j, lf.PUSH]
        along = -stations[j, lf.CROSS] * push
        if belt.is_curved:
            # of the mean velocity of the step without the part due to the layers' speeds
            turning = belt.ring_curvature[j] * fma(0.5, push, fields[j, f.U])
            along = fma(-turning * c[0, lf.ELEMENT_MASS], belt_speed + fields[j, f.V_ELEMENT], along)
            ring = turning * c[0, lf.RING_MASS] * (belt_speed + fields[j, f.V_RING])
            stations[j, lf.Y_1] = fma(-belt.dual[j], ring, stations[j, lf.Y_1])
        stations[j, lf.Y_0] = fma(belt.dual[j], along, stations[j, lf.Y_0])
    return coupled


@kernel
def move_with_layers(belt: LaneBelt, state: LaneState, stations: LaneArray, coupled: int) -> None:
    """Increments of u, PUSH, with those of the elements, DV_0; `coupled` is the result of `move_across`."""
    gyration = -belt.constants[0, lf.MASS] * lane_belt_speed(belt, state.time[0])
    _solve(belt, stations, _coupling(belt), gyration, WITH_LAYERS, coupled)


@merged_kernel
def _force(belt: LaneBelt, stations: LaneArray, j: int, gyration, part: int):
    """Force of a station [N]; by `part` with the gyroscopic force of PUSH, and friction's by the layers."""
    force = stations[j, lf.ACROSS]
    if part == WITH_LAYERS:
        force = fma(-stations[j, lf.CROSS], stations[j, lf.DV_0], force)
    if part != ALONE:
        difference = ahead(stations, j, lf.PUSH) - behind(stations, j, lf.PUSH)
        force = fma(gyration * belt.per_span[j], difference, force)
    return belt.dual[j] * force


@kernel
def _solve(belt: LaneBelt, stations: LaneArray, q, gyration, part: int, coupled: int) -> None:
    last, zero = stations.rows - 1, like(0.0, q)
    y1 = own0 = own1 = rest = zero
    for j in range(last):
        y0 = _force(belt, stations, j, gyration, part) + rest
        i01 = stations[j, lf.A_01]
        z0, z1 = fma(stations[j, lf.A_00], y0, i01 * y1), fma(i01, y0, stations[j, lf.A_11] * y1)
        if j < coupled:
            own0 = fma(-stations[j, lf.B_00], y0, fma(-stations[j, lf.B_10], y1, own0))
            own1 = fma(-stations[j, lf.B_01], y0, fma(-stations[j, lf.B_11], y1, own1))
        stations[j, lf.X_0], stations[j, lf.X_1] = z0, z1
        onward = q * belt.per_cell[j]
        rest, y1 = onward * z1, onward * z0
    y0 = _force(belt, stations, last, gyration, part) + rest + from_ahead(own0)
    y1 = y1 + from_ahead(own1)
    d00, d01, d11 = stations[last, lf.A_00], stations[last, lf.A_01], stations[last, lf.A_11]
    c00, c01 = stations[last, lf.B_00], stations[last, lf.B_01]
    c10, c11 = stations[last, lf.B_10], stations[last, lf.B_11]
    x0, x1 = ring_solution(d00, d01, d11, y0, y1, c00, c01, c10, c11, belt.faded)
    behind0, behind1 = from_behind(x0), from_behind(x1)
    stations[last, lf.PUSH] = x0
    for j in range(last - 1, -1, -1):
        onward = q * belt.per_cell[j]
        e0, e1 = onward * x1, onward * x0
        i01 = stations[j, lf.A_01]
        z0, z1 = stations[j, lf.X_0], stations[j, lf.X_1]
        if j < coupled:
            z0 = fma(-stations[j, lf.B_01], behind1, fma(-stations[j, lf.B_00], behind0, z0))
            z1 = fma(-stations[j, lf.B_11], behind1, fma(-stations[j, lf.B_10], behind0, z1))
        x0 = fma(stations[j, lf.A_00], e0, fma(i01, e1, z0))
        x1 = fma(i01, e0, fma(stations[j, lf.A_11], e1, z1))
        stations[j, lf.PUSH] = x0


@merged_kernel
def implicit_shares(one, other, inertia):
    """Two slopes, weighted by 1/2 (time-centred) where slow, 1 where stiff; inertia = mass / dt.

    The linearised step then multiplies the velocity by an approximation of exp(-slope / inertia) that never
    changes sign.
    """
    per_one, per_other = reciprocals(fma(2.0, one, 12.0 * inertia), fma(2.0, other, 12.0 * inertia))
    return one * fma(one, per_one, 0.5), other * fma(other, per_other, 0.5)


@kernel
def damp_across(belt: LaneBelt, state: LaneState, stations: LaneArray) -> None:
    """Take the layers' damping across the belt from the stations at both ends of each cell, into BENT.

    By the speeds that the step begins with. Of a cell's lengthening v_0,s + kappa u, in which the dampers
    along the belt are implicit, a step of both leaves with a = 4 c dt / (m_0 h^2) and b = c dt kappa^2 / m
    the share (1 - b) / (1 + a): it is stable up to b = 2 + a.
    """
    fields, c = state.fields, belt.constants
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
def assemble(belt: LaneBelt, state: LaneState, stations: LaneArray, step: float, again: bool) -> None:
    """Forces and slopes at the stations, but for the stresses T and P: the system's blocks and right side.

    `again` takes the secant of friction where a pass before has found that it would turn sliding about. For
    the increments of u it finds the force ACROSS and its slopes, which `move_across` couples by bending.
    """
    n, fields, c = state.fields.rows, state.fields, belt.constants
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
