"""Balance of the power that enters and leaves the belt drive and is stored: the audit of a run.

The driving pulley's speed is prescribed, and its power is its moment times its momentary speed. In a steady
state, on average over a vibration,

    driving = load + thrust + losses,    losses = flanks + rings + belt + layers + lag + seating + tilt,

and before that, or along a ramp, the difference goes into the stored energy; along a ramp of speed it is
mostly the kinetic energy of the belt and of the driven pulley. The open part is the work of the numerics:
upwinded transport, backward Euler in the layers, leading bending, and the linear stretch that leaves the
product of changing tension and slope squared out. The layers' loss is not taken from a state, as all else is,
but from the work of their dampers in the steps since the last one: a damper acts in a cell that is just
closing, for a step or two, and instants now and then would not meet it as often as it acts.

Seating is the energy that the belt carries out of the sheaves' elastic contact beyond the energy that it
brings in: none, but for the mesh, since contact begins and ends without force, and between both the elastic
forces do no work on the whole.
"""

from cvt_hpc.kernels import kernel
from cvt_hpc.lanes import LaneArray, fma, like, maximum, minimum
from cvt_hpc.models.elastic_belt import fields as f
from cvt_hpc.models.elastic_belt import lane_fields as lf
from cvt_hpc.models.elastic_belt import lane_forces as forces
from cvt_hpc.models.elastic_belt import moments
from cvt_hpc.models.elastic_belt.lane_belt import LaneBelt, LaneState
from cvt_hpc.models.elastic_belt.lane_column import curving
from cvt_hpc.models.elastic_belt.lane_tilt import tilt_damping, tilted_saddle
from cvt_hpc.models.elastic_belt.pulley_step import audit_pulleys, taken_by_clearance
from cvt_hpc.physics.flank import flank_sliding
from cvt_hpc.physics.friction import law_numbers, saturation


@kernel
def audit(
    belt: LaneBelt,
    state: LaneState,
    stations: LaneArray,
    axial,
    interval: float,
    rows: LaneArray,
    k: int,
    first: int,
    profiles: LaneArray,
) -> None:
    """Powers [W] and stored energy [J] of a state, as POWERS into row k of `rows` from field `first` on.

    The work of the dampers since the last audit, `interval` [s] ago, is used up. `stations` have the forces
    and strains of this state, `axial` is the axial force of the belt on the driven sheave [N]. MOMENTS of
    this state are added to the first fields of `profiles` (N, M), of doubles; one without rows takes none.
    """
    n, fields, c, scalars = belt.cell.size, state.fields, belt.constants, state.scalars
    speed = scalars[0, lf.SPEED]
    zero = like(0.0, axial)
    speed_share = forces.lane_speed_share(belt, state.time[0], zero)
    belt_speed, sine, cosine = speed_share * c[0, lf.BELT_SPEED], c[0, lf.SINE], c[0, lf.COSINE]
    wedge = c[0, lf.WEDGE]
    per_cosine, width = 1.0 / cosine, c[0, lf.FRICTION_SPEED]
    per_width, per_ring_width = 1.0 / width, 1.0 / c[0, lf.RING_FRICTION_SPEED]
    numbers = law_numbers(c[0, lf.KINETIC_FRICTION], c[0, lf.FRICTION_GRADIENT], c[0, lf.LAW_SPEED])
    least = forces.LEAST_SHARE_OF_WIDTH * width
    damping = forces.lane_damping(belt, state.time[0])
    element_mass, ring_mass, mass = c[0, lf.ELEMENT_MASS], c[0, lf.RING_MASS], c[0, lf.MASS]
    offset = c[0, lf.RING_OFFSET]
    ring_stiffness, element_stiffness = c[0, lf.RING_STIFFNESS], c[0, lf.ELEMENT_STIFFNESS]
    element_damping, centrifugal = c[0, lf.ELEMENT_DAMPING], mass * belt_speed * belt_speed
    turnings, surfaces = forces.lane_pulleys(belt, speed_share, scalars)
    opening_driving = c[0, lf.DRIVING_POSITION] + like(scalars[0, f.FIRST_STATE + f.SHIFT], zero)
    opening_driven = like(scalars[0, lf.POSITION], zero)
    ring_relief = c[0, lf.RING_RELIEF] * speed_share * speed_share
    summed = profiles.rows > 0
    driving = turned = driving_rub = driven_rub = ring_loss = belt_loss = seating = tilt_loss = zero
    stored = 0.5 * c[0, lf.DRIVEN_INERTIA] * turnings[1] * turnings[1]
    for j in range(n):
        a, b = j - 1 if j > 0 else n - 1, j + 1 if j < n - 1 else 0
        aa, bb = a - 1 if a > 0 else n - 1, b + 1 if b < n - 1 else 0
        right, dual = belt.cell[j], belt.dual[j]
        w, u = fields[j, f.W], fields[j, f.U]
        v0, v1 = belt_speed + fields[j, f.V_ELEMENT], belt_speed + fields[j, f.V_RING]
        slope = (fields[b, f.W] - fields[a, f.W]) * belt.per_span[j]
        v_across = fma(v0, slope, u)
        belt_loss += dual * damping * v_across * v_across
        bent = belt.bending[j, 0] * fields[aa, f.W] + belt.bending[j, 1] * fields[a, f.W]
        bent += (
            belt.bending[j, 2] * w
            + belt.bending[j, 3] * fields[b, f.W]
            + belt.bending[j, 4] * fields[bb, f.W]
        )
        longer = fma(offset, belt.ring_curvature[j], 1.0)
        ring_here = ring_mass * longer
        moving = element_mass * v0 * v0 + ring_here * v1 * v1 + mass * u * u
        stored += (0.5 * dual) * (moving - c[0, lf.BENDING_STIFFNESS] * w * bent)
        if belt.is_curved:
            stored -= dual * c[0, lf.BENDING_STIFFNESS] * w * belt.bending_load[j]
        pressed = minimum(forces.pressed_strain(belt, state, stations, j), 0.0)
        stretched = stations[j, lf.EPS_1]
        rings = fields[j, f.N_ELEMENT + 1] + 1.0 + belt.curvature[j] * offset
        elastic = (fields[j, f.N_ELEMENT] + 1.0) * element_stiffness * pressed * pressed
        if belt.has_column:
            elastic = (fields[j, f.N_ELEMENT] + 1.0) * state.column[j, lf.COLUMN_ENERGY]
        tension, push = ring_stiffness * stretched, -element_stiffness * pressed
        opening = fields[b, f.V_ELEMENT] - fields[j, f.V_ELEMENT]
        curved = 0.5 * belt.curvature[j] * (u + fields[b, f.U])
        lifting = right * curved
        lifting += (fields[b, f.W] - w) * (fields[b, f.U] - u) * belt.per_cell[j]
        working = push * opening - tension * (fields[b, f.V_RING] - fields[j, f.V_RING])
        working -= (tension - push - centrifugal) * lifting
        if belt.has_column:
            working -= state.column[j, lf.COLUMN_MOMENT] * dual * curving(belt, fields, j, f.U)
        damped = -element_stiffness * forces.pressed_strain(belt, state, stations, j)
        damped -= element_damping * fma(belt.per_cell[j], opening, curved)
        if summed:
            moments.add_stresses(profiles, j, working, tension, push, maximum(damped, zero) - push)
        stored += (0.5 * right) * (elastic + rings * ring_stiffness * stretched * stretched)
        v_element, across = fields[j, f.V_ELEMENT], -damping * v_across
        if summed:
            moments.add_speeds(profiles, j, v_across, u, v_element, fields[j, f.V_RING])
        if belt.tilts:
            angle = state.tilt[j, lf.ANGLE]
            stored += (0.5 * dual) * c[0, lf.TILT_SPRING] * angle * angle
            if belt.arc_curvature[j] == 0.0:
                fading = c[0, lf.TILT_SPRING] * angle
                tilt_loss += dual * fading * fading / c[0, lf.TILT_DAMPER]
        if belt.touches[j] == 0.0:
            if summed:
                moments.add_forces(profiles, j, across, u, across * slope, v_element)
            continue
        force = stations[j, lf.FORCE]
        on_driven, upright, lean = belt.on_driven[j] > 0.5, belt.upright[j], forces.leaning(belt, j, w)
        omega, radius = (
            (turnings[1], c[0, lf.DRIVEN_RADIUS]) if on_driven else (turnings[0], c[0, lf.DRIVING_RADIUS])
        )
        v_radial, v_tangential = forces.groove_sliding(
            belt, j, (turnings, surfaces), belt_speed, v_across, v_element, w
        )
        sliding, meridian = flank_sliding(v_radial, v_tangential, per_cosine)
        sliding = maximum(sliding, least)
        v_law = fields[j, f.V_FILTERED] if belt.memory else sliding
        factor, _ = saturation(sliding, per_width)
        mu = forces.lane_coefficient(belt, numbers, v_law, force * per_cosine) * factor
        upward = mu * meridian / sliding
        twice_normal = 2.0 * force / fma(upward, sine, cosine)
        elastic_radial = wedge * force
        radial = twice_normal * (sine - upward * cosine) - elastic_radial
        tangential = -twice_normal * mu * v_tangential / sliding
        distance = radius + fma(upright, w, belt.rise[j])
        # less the power that a change of displacement in place takes from the sheaves
        seating -= dual * elastic_radial * (v_radial - upright * u)
        rubbed = -dual * fma(radial, v_radial, tangential * v_tangential)
        power = dual * tangential * distance * omega
        if on_driven:
            driven_rub += rubbed
            turned += power
        else:
            driving_rub += rubbed
            driving += power
        rubbing, along = fma(upright, radial, -lean * tangential), fma(lean, radial, upright * tangential)
        across += rubbing
        along += fma(across + upright * elastic_radial, slope, lean * elastic_radial)
        if summed:
            moments.add_forces(profiles, j, across, u, along, v_element)
            moments.add_flanks(profiles, j, radial, tangential, v_radial, v_tangential)
        lever = fma(offset, belt.arc_curvature[j], 1.0)
        saddle = fma(lever, v0, -v1)
        ring_left = ring_stiffness * stations[a, lf.EPS_1]
        pressure = forces.saddle_pressure(belt, j, ring_left, tension, ring_relief * longer)
        grip = c[0, lf.RING_FRICTION] * 0.5 * pressure
        if belt.tilts and belt.arc_curvature[j] > 0.0:
            free, saddle = saddle, tilted_saddle(belt, state, j, saddle, grip * belt.per_dual[j], 0.0)
            tilt_loss += dual * tilt_damping(belt, 0.0) * (saddle - free) * (saddle - free)
        factor, _ = saturation(saddle, per_ring_width)
        drag = grip * factor
        ring_loss += drag * saddle
        if summed:
            moments.add_saddles(profiles, j, drag, saddle)
        opening_0 = opening_driven if on_driven else opening_driving
        stored -= 0.5 * dual * force * fma(wedge, fma(upright, w, belt.rise[j]), opening_0)
    thrust = forces.lane_given_thrust(belt, state.time[0], axial)
    axial_speed = (axial - thrust) / c[0, lf.AXIAL_DAMPING]
    rows[k, first + f.DRIVING_POWER] = driving
    rows[k, first + f.LOAD_POWER] = (
        like(c[0, lf.RATIO], speed) * forces.lane_load(belt, state.time[0], speed) * speed
    )
    rows[k, first + f.THRUST_POWER] = thrust * axial_speed
    rows[k, first + f.DRIVING_FLANK_LOSS] = driving_rub
    rows[k, first + f.DRIVEN_FLANK_LOSS] = driven_rub
    rows[k, first + f.RING_LOSS] = ring_loss
    rows[k, first + f.BELT_LOSS] = belt_loss
    rows[k, first + f.LAYER_LOSS] = scalars[0, lf.LAYER_WORK] / interval
    rows[k, first + f.LAG_LOSS] = c[0, lf.AXIAL_DAMPING] * axial_speed * axial_speed
    rows[k, first + f.SEATING_LOSS] = seating
    rows[k, first + f.TILT_LOSS] = tilt_loss
    rows[k, first + f.STORED_ENERGY] = stored
    if state.contacts[0].has_clearance or state.contacts[1].has_clearance:
        rows[k, first + f.STORED_ENERGY] = rows[k, first + f.STORED_ENERGY] - taken_by_clearance(state)
    if belt.is_free:
        audit_pulleys(belt, state, like(driving, speed), like(turned, speed), rows, k, first)
    scalars[0, lf.LAYER_WORK] = 0.0
