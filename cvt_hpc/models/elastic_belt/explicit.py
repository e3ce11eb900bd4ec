"""The plain explicit step of the elastic belt: symplectic Euler, the judge of faster ones, in lanes.

Velocities by the forces of the present state, then positions by the new velocities. Each rate is that of
`rhs.py` to round-off (tests/run/test_explicit_step.py); its form is that of lanes: velocities and contents as
deviations, each cell's stresses computed once.
"""

from cvt_hpc.kernels import kernel
from cvt_hpc.lanes.functions import anywhere, fma, like, minimum, reciprocals, select
from cvt_hpc.lanes.kinds import LaneArray
from cvt_hpc.lanes.rings import ahead, around, behind, from_ahead, from_behind
from cvt_hpc.models.elastic_belt import fields as f
from cvt_hpc.models.elastic_belt import lane_fields as lf
from cvt_hpc.models.elastic_belt import lane_forces as forces
from cvt_hpc.models.elastic_belt import lane_tilt as tilting
from cvt_hpc.models.elastic_belt.lane_belt import LaneBelt, LaneState, Work
from cvt_hpc.models.elastic_belt.lane_column import across_by_curvature, column_across
from cvt_hpc.models.elastic_belt.pulley_step import advance_pulleys
from cvt_hpc.physics.flank import flank_shares, flank_sliding

# Fields of Work.stations, after those of `lane_forces`: slope w_s; a step's increments of u, v_element and
# v_ring; forces of the layers' dampers in the cells
SLOPE, DU, DV_0, DV_1, DAMPED_0, DAMPED_1 = range(lf.FIELDS_OF_FORCES, lf.FIELDS_OF_FORCES + 6)
FIELDS_OF_WORK = lf.FIELDS_OF_FORCES + 6


@kernel
def step_explicit(belt: LaneBelt, state: LaneState, work: Work, step: float) -> None:
    """Advance the state by a step [s], with the results of `derive` for it in the work space.

    It is stable below 2 / (largest rate), some 0.2 us with the default belt.
    """
    stations = work.stations
    forces.lane_sliding(belt, state, stations)
    if belt.tilts:
        tilting.lane_tilt(belt, state, stations, 0.0)
    taken, moment = _accelerate(belt, state, stations, step)
    advance_pulleys(belt, state, taken, moment, step)
    if belt.tilts:
        tilting.turn_elements(belt, state, 0.0)
        tilting.carry_tilt(belt, state, step)
        tilting.add_turn(state, step)
    state.time[0] += step
    _advance_layers(belt, state, stations, step)
    _advance_across(belt, state, stations, step)
    forces.derive(belt, state, stations)


@kernel
def _accelerate(belt: LaneBelt, state: LaneState, stations: LaneArray, step: float):
    """Increments of the velocities into DU and DV; the flanks' torques on both pulleys [N m].

    That taken from the driving pulley, where that is free, and the moment on the driven one.
    """
    n, fields, c = state.fields.rows, state.fields, belt.constants
    sine, cosine, offset = c[0, lf.SINE], c[0, lf.COSINE], c[0, lf.RING_OFFSET]
    per_cosine, radius, driving_radius = 1.0 / cosine, c[0, lf.DRIVEN_RADIUS], c[0, lf.DRIVING_RADIUS]
    element_stiffness, ring_stiffness = c[0, lf.ELEMENT_STIFFNESS], c[0, lf.RING_STIFFNESS]
    element_damping, ring_damping = c[0, lf.ELEMENT_DAMPING], c[0, lf.RING_DAMPING]
    speed_share = forces.lane_speed_share(belt, state.time[0], sine)
    mass, ring_mass, belt_speed = c[0, lf.MASS], c[0, lf.RING_MASS], speed_share * c[0, lf.BELT_SPEED]
    bending, ring_friction = c[0, lf.BENDING_STIFFNESS], c[0, lf.RING_FRICTION]
    ring_relief = c[0, lf.RING_RELIEF] * speed_share * speed_share
    acceleration = forces.lane_acceleration(belt, state.time[0], step)
    centrifugal, gyroscopic = mass * belt_speed * belt_speed, 2.0 * mass * belt_speed
    damping = forces.lane_damping(belt, state.time[0])
    mobility, element_mobility, ring_mobility = step / mass, step / c[0, lf.ELEMENT_MASS], step / ring_mass
    masses = c[0, lf.ELEMENT_MASS], ring_mass
    rise, zero = acceleration * step, like(0.0, sine)
    taken = moment = net_left = ring_left = stress_left_0 = stress_left_1 = zero
    gap_left_0 = gap_left_1 = bent_left = zero
    for k in range(-1, n):
        # the last cell first, which is behind row 0
        j = k if k >= 0 else n - 1
        per_cell = belt.per_cell[j]
        v0, v1 = fields[j, f.V_ELEMENT], fields[j, f.V_RING]
        push = element_stiffness * minimum(forces.pressed_strain(belt, state, stations, j), 0.0)
        ring_right = ring_stiffness * stations[j, lf.EPS_1]
        net_right = push + (ring_right - centrifugal)
        gap_0 = (ahead(fields, j, f.V_ELEMENT) - v0) * per_cell
        gap_1 = (ahead(fields, j, f.V_RING) - v1) * per_cell
        kappa = belt.curvature[j]
        lifting = (0.5 * kappa) * (fields[j, f.U] + ahead(fields, j, f.U))
        # elements that are apart have no damper, and it never makes them pull
        damped_0 = select(push < 0.0, minimum(element_damping * (gap_0 + lifting), -push), 0.0)
        damped_1 = ring_damping * (gap_1 + lifting)
        bent = (0.5 * kappa * belt.cell[j]) * (damped_0 + damped_1)
        stress_0, stress_1 = push + damped_0, ring_right + damped_1
        if k >= 0:
            stations[j, DAMPED_0], stations[j, DAMPED_1] = damped_0, damped_1
            span, per_dual, touches = belt.per_span[j], belt.per_dual[j], belt.touches[j]
            u, full_speed = fields[j, f.U], belt_speed + v0
            slope = (ahead(fields, j, f.W) - behind(fields, j, f.W)) * span
            across = forces.lane_transverse(belt, fields, j, net_left, net_right, bending, 0.0)
            across = fma(-gyroscopic, (ahead(fields, j, f.U) - behind(fields, j, f.U)) * span, across)
            across = fma(-acceleration * mass, slope, across)
            across = fma(-per_dual, bent_left + bent, across)
            if belt.has_column:
                across += column_across(belt, state, j)
            if belt.is_curved:
                across += across_by_curvature(belt, state, j, bending, belt_speed, masses)
            outward = -damping * fma(full_speed, slope, u)
            along_element = (stress_0 - stress_left_0) * per_dual
            along_ring = (stress_1 - stress_left_1) * per_dual
            if anywhere(touches > 0.0):
                longer = fma(offset, belt.ring_curvature[j], 1.0)
                lever = fma(offset, belt.arc_curvature[j], 1.0)
                grip = forces.ring_grip(belt, j, ring_left, ring_right, ring_relief * longer, ring_friction)
                drag = grip * stations[j, lf.RING_FACTOR]
                mu = stations[j, lf.COEFFICIENT] * stations[j, lf.FACTOR]
                per_speed = stations[j, lf.PER_SPEED]
                climb = stations[j, lf.SLIDING_R] * per_cosine * per_speed
                axial_share, radial_share = flank_shares(mu, climb, sine, cosine)
                per_normal, per_ring = reciprocals(axial_share, longer * ring_mass)
                force = select(touches > 0.0, stations[j, lf.FORCE], zero)
                twice_normal = 2.0 * force * per_normal
                radial = twice_normal * radial_share
                tangential = -twice_normal * (mu * (stations[j, lf.SLIDING_T] * per_speed))
                is_driven = belt.on_driven[j] > 0.5
                upright, lean = belt.upright[j], forces.leaning(belt, j, fields[j, f.W])
                outward = fma(upright, radial, fma(-lean, tangential, outward))
                distance = select(is_driven, radius, driving_radius)
                distance += fma(upright, fields[j, f.W], belt.rise[j])
                turning_moment = tangential * (distance * belt.dual[j])
                moment -= select(is_driven, turning_moment, zero)
                taken += select(is_driven, zero, turning_moment)
                along_element += fma(-lever, drag, fma(lean, radial, upright * tangential))
                along_ring = (along_ring + drag) * (per_ring * step)
            else:
                along_ring *= ring_mobility
            along_element = fma(outward, slope, along_element)
            stations[j, SLOPE] = slope
            stations[j, DU] = (across + outward) * mobility
            dv_0 = fma(along_element, element_mobility, -full_speed * (step * gap_left_0))
            dv_1 = fma(-(belt_speed + v1), step * gap_left_1, along_ring)
            if belt.is_curved:
                turning = belt.ring_curvature[j] * u * step
                dv_0 = fma(-turning, full_speed, dv_0)
                longer = fma(offset, belt.ring_curvature[j], 1.0)
                dv_1 = fma(-turning, (belt_speed + v1) / longer, dv_1)
            stations[j, DV_0], stations[j, DV_1] = dv_0 - rise, dv_1 - rise
        net_left, ring_left, stress_left_0, stress_left_1 = net_right, ring_right, stress_0, stress_1
        gap_left_0, gap_left_1, bent_left = gap_0, gap_1, bent
        if k < 0:
            net_left, ring_left = from_behind(net_left), from_behind(ring_left)
            stress_left_0, stress_left_1 = from_behind(stress_left_0), from_behind(stress_left_1)
            gap_left_0, gap_left_1 = from_behind(gap_left_0), from_behind(gap_left_1)
            bent_left = from_behind(bent_left)
    return around(taken), around(moment)


@kernel
def _advance_layers(belt: LaneBelt, state: LaneState, stations: LaneArray, step: float) -> None:
    """Speeds of both layers, contents by the fluxes of the new speeds, work of the layers' dampers."""
    n, fields, scalars = state.fields.rows, state.fields, state.scalars
    belt_speed = forces.lane_belt_speed(belt, state.time[0])
    work_done = like(0.0, belt_speed)
    for layer in range(2):
        v_row, dv_row, eps_row = f.V_ELEMENT + layer, DV_0 + layer, lf.EPS_0 + layer
        n_row = f.N_ELEMENT + layer
        short_row, damped_row = lf.SHORT_0 + layer, DAMPED_0 + layer
        # at the station ahead of a cell: increment, speed, and the flux of content less the belt speed
        dv_b = stations[0, dv_row]
        v_b = fields[0, v_row] + dv_b
        flux_b = fma(-belt_speed, behind(stations, 0, eps_row), v_b) * behind(stations, 0, short_row)
        dv_b, v_b, flux_b = from_ahead(dv_b), from_ahead(v_b), from_ahead(flux_b)
        u_b = from_ahead(fma(0.5, stations[0, DU], fields[0, f.U]))
        for j in range(n - 1, -1, -1):
            dv, u = stations[j, dv_row], fma(0.5, stations[j, DU], fields[j, f.U])
            v = fields[j, v_row] + dv
            flux = fma(-belt_speed, behind(stations, j, eps_row), v) * behind(stations, j, short_row)
            # a damper's force at the start of the step times the mean speed at which its cell lengthens
            longer = fma(0.5 * belt.curvature[j] * belt.cell[j], u + u_b, fma(-0.5, dv_b - dv, v_b - v))
            work_done = fma(stations[j, damped_row], longer, work_done)
            fields[j, n_row] = fma(step * belt.per_cell[j], flux - flux_b, fields[j, n_row])
            fields[j, v_row] = v
            dv_b, v_b, flux_b, u_b = dv, v, flux, u
    scalars[0, lf.LAYER_WORK] = scalars[0, lf.LAYER_WORK] + around(work_done) * step


@kernel
def _advance_across(belt: LaneBelt, state: LaneState, stations: LaneArray, step: float) -> None:
    """Transverse velocity, memory by the sliding speeds of the new velocities, and displacement."""
    n, fields, c = state.fields.rows, state.fields, belt.constants
    speed_share = forces.lane_speed_share(belt, state.time[0], c[0, lf.BELT_SPEED])
    per_cosine, belt_speed = 1.0 / c[0, lf.COSINE], speed_share * c[0, lf.BELT_SPEED]
    pulleys = forces.lane_pulleys(belt, speed_share, state.scalars)
    before = behind(fields, 0, f.V_FILTERED)
    for j in range(n):
        u, w = fields[j, f.U] + stations[j, DU], fields[j, f.W]
        touches, old = belt.touches[j], fields[j, f.V_FILTERED]
        if belt.memory and anywhere(touches > 0.0):
            v_element = fields[j, f.V_ELEMENT]
            v_across = fma(belt_speed + v_element, stations[j, SLOPE], u)
            v_radial, along = forces.groove_sliding(belt, j, pulleys, belt_speed, v_across, v_element, w)
            speed, _ = flank_sliding(v_radial, along, per_cosine)
            filtered = forces.remembered(belt, j, stations[j, lf.WAY], belt_speed, step, speed, old, before)
            filtered = select(stations[j, lf.FORCE] > 0.0, filtered, speed)
            fields[j, f.V_FILTERED] = select(touches > 0.0, filtered, 0.0)
        before = old
        fields[j, f.U], fields[j, f.W] = u, fma(step, u, w)
