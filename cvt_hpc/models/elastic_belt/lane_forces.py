"""Forces of the elastic belt in lanes, as steps, recording and audit need them for one state.

Steps keep it in a LaneArray of N stations, their work space: its first fields are those named here, further
ones each step's own.
"""

from cvt_hpc.kernels import kernel, merged_kernel
from cvt_hpc.lanes.functions import anywhere, decay, fma, like, maximum, reciprocals, select, sqrt
from cvt_hpc.lanes.kinds import LaneArray
from cvt_hpc.lanes.rings import ahead, at_station, behind, from_ahead, from_behind, set_station
from cvt_hpc.models.elastic_belt import fields as f
from cvt_hpc.models.elastic_belt import lane_fields as lf
from cvt_hpc.models.elastic_belt.lane_belt import LaneBelt, LaneState
from cvt_hpc.models.elastic_belt.lane_column import lane_column
from cvt_hpc.models.elastic_belt.rhs import LEAST_WAY
from cvt_hpc.physics import compliance
from cvt_hpc.physics.compliance import contact_force, solve_contact
from cvt_hpc.physics.flank import flank_sliding, tangential_sliding
from cvt_hpc.physics.friction import formula_coefficient, law_numbers, saturation, table_coefficient
from cvt_hpc.physics.friction_laws import Law
from cvt_hpc.physics.moving_discs import open_gaps, turn_discs
from cvt_hpc.variator import course

_MOST_CONTACT_ROUNDS = 200
LEAST_FORCE = 1e-12  # [N/m]: for a quotient of forces that may both be 0
LEAST_SHARE_OF_WIDTH = 1e-3  # of friction_speed: below it friction is linear to 1e-6, and has no direction


@kernel
def derive(belt: LaneBelt, state: LaneState, stations: LaneArray) -> None:
    """Contact forces and strains of the present state."""
    lane_contact_forces(belt, state, stations)
    _lane_strains(belt, state, stations)
    if belt.has_column:
        lane_column(belt, state, stations, lf.EPS_0)


@merged_kernel
def pressed_strain(belt: LaneBelt, state: LaneState, stations: LaneArray, j: int):
    """-P / EA of cell j, positive where its elements are apart."""
    return state.column[j, lf.PRESSED] if belt.has_column else stations[j, lf.EPS_0]


@merged_kernel
def pressed_behind(belt: LaneBelt, state: LaneState, stations: LaneArray, j: int):
    """Return `pressed_strain` of the cell behind station j."""
    return behind(state.column, j, lf.PRESSED) if belt.has_column else behind(stations, j, lf.EPS_0)


@kernel
def note_speeds(belt: LaneBelt, state: LaneState, stations: LaneArray, taken: int, steps: int) -> None:
    """Note the speeds for `step_ripple` before a step, `taken` of the `steps` up to the sample being done."""
    if taken < steps - 2:
        return
    fields = state.fields
    is_first = taken == max(steps - 2, 0)
    weight = 0.0 if taken < steps - 1 else -2.0
    for j in range(fields.rows):
        for k, row in enumerate((f.U, f.V_ELEMENT, f.V_RING)):
            speed = fields[j, row]
            if is_first:
                stations[j, lf.NOTED + k] = speed
            stations[j, lf.NOTED + k] = fma(weight, speed, stations[j, lf.NOTED + k])


@kernel
def step_ripple(belt: LaneBelt, state: LaneState, stations: LaneArray):
    """Speed that alternates from step to step [m/s], root mean square over the belt's mass.

    A speed that alternates by A at every step has the second difference 4 A; one that vibrates with the
    amplitude A at the angular frequency w has (w step)^2 A, below A / 3000 at 600 Hz and 4.6 us.
    """
    n, fields, c = state.fields.rows, state.fields, belt.constants
    element_mass, ring_mass, mass = c[0, lf.ELEMENT_MASS], c[0, lf.RING_MASS], c[0, lf.MASS]
    total = like(0.0, mass)
    length = 0.0
    for j in range(n):
        u = fields[j, f.U] + stations[j, lf.NOTED]
        v0 = fields[j, f.V_ELEMENT] + stations[j, lf.NOTED + 1]
        v1 = fields[j, f.V_RING] + stations[j, lf.NOTED + 2]
        moving = fma(mass * u, u, fma(element_mass * v0, v0, ring_mass * v1 * v1))
        total = fma(belt.dual[j], moving, total)
        length += belt.dual[j]
    return 0.25 * sqrt(total / ((element_mass + ring_mass) * length))


@merged_kernel
def lane_load(belt: LaneBelt, time: float, pattern):
    """Torque at the driving pulley [N m], as `rhs.load_at` has it, in lanes like `pattern`."""
    c = belt.constants
    start, load = like(c[0, lf.LOAD_START], pattern), like(c[0, lf.LOAD], pattern)
    torque = course.load_course(time, belt.rise_time, belt.ramp_end, start, load)
    return torque * course.multiple_at(belt.profile, course.LOAD, time)


@merged_kernel
def lane_speed_share(belt: LaneBelt, time: float, pattern):
    """Speed of the driving pulley over `driving_speed`, as `rhs.speed_share_at`, in lanes like `pattern`."""
    share = like(1.0, pattern)
    if belt.speed_changes:
        start = like(belt.constants[0, lf.START_SHARE], pattern)
        share = course.speed_course(time, belt.rise_time, belt.ramp_end, start)
        share = share * course.multiple_at(belt.profile, course.SPEED, time)
    return share


@merged_kernel
def lane_given_thrust(belt: LaneBelt, time: float, pattern):
    """Thrust on the driven pulley [N], as `rhs.thrust_at`, in lanes like `pattern`."""
    return like(belt.constants[0, lf.THRUST], pattern) * course.multiple_at(belt.profile, course.THRUST, time)


@merged_kernel
def lane_belt_speed(belt: LaneBelt, time: float):
    """Belt speed at the driving pulley's speed [m/s], from which the layers' speeds are counted."""
    nominal = belt.constants[0, lf.BELT_SPEED]
    return lane_speed_share(belt, time, nominal) * nominal


@merged_kernel
def lane_acceleration(belt: LaneBelt, time: float, step: float):
    """Mean rate of the belt speed in a step [m/s^2].

    A step has it act on the layers, so that their speeds are then counted from the belt speed at its end, and
    the slopes of friction act on their speeds against pulleys that accelerate as well.
    """
    return (lane_belt_speed(belt, time + step) - lane_belt_speed(belt, time)) / step


@merged_kernel
def lane_pulleys(belt: LaneBelt, share, scalars: LaneArray):
    """Speeds of both pulleys [rad/s], and of their surfaces less the belt speed [m/s], driving and driven.

    `share` is the result of `lane_speed_share`, whose precision they take; `scalars` are those of the state.
    """
    c = belt.constants
    driven_speed, excess = scalars[0, lf.SPEED], like(scalars[0, f.FIRST_STATE + f.EXCESS], share)
    belt_speed = like(share * c[0, lf.BELT_SPEED], driven_speed)
    driving = share * (c[0, lf.DRIVING_SPEED] * c[0, lf.DRIVING_RADIUS] - c[0, lf.BELT_SPEED])
    driving = driving + excess * c[0, lf.DRIVING_RADIUS]
    driven = driven_speed * like(c[0, lf.DRIVEN_RADIUS], driven_speed) - belt_speed
    turning = share * c[0, lf.DRIVING_SPEED] + excess
    return (turning, like(driven_speed, share)), (driving, like(driven, share))


@merged_kernel
def leaning(belt: LaneBelt, j: int, w):
    """Part along the path of the pulley's radial unit vector, as `rhs.leaning`."""
    return fma(-belt.lean_rate[j], w, belt.lean[j])


@merged_kernel
def groove_sliding(belt: LaneBelt, j: int, pulleys, belt_speed, v_across, v_element, w):
    """Radial and tangential sliding of station j in its groove [m/s], as `rhs.sliding_speeds`.

    `pulleys` are those of `lane_pulleys`, `v_across`, `v_element`, `w` the station's own.
    """
    turnings, surfaces = pulleys
    is_driven = belt.on_driven[j] > 0.5
    turning = select(is_driven, turnings[1], turnings[0])
    surface = select(is_driven, surfaces[1], surfaces[0])
    upright, lean = belt.upright[j], leaning(belt, j, w)
    v_radial = fma(upright, v_across, lean * (belt_speed + v_element))
    v_along = fma(upright - 1.0, belt_speed, upright * v_element) - lean * v_across
    return v_radial, tangential_sliding(v_along, fma(upright, w, belt.rise[j]), turning, surface)


@merged_kernel
def remembered(belt: LaneBelt, j: int, way, belt_speed, step: float, speed, old, before):
    """Filtered sliding speed of station j at the end of a step [m/s], as `rhs.memory_rates` has its rate.

    `way` is WAY, `speed` the station's sliding speed; `old` and `before` are its filtered speed and that of
    the station behind it, which is its sliding speed where it does not touch.
    """
    forget = belt.constants[0, lf.FORGET]
    left = decay(forget * way * behind(belt.cell, j, 0) / belt_speed)
    carry = forget * left / (1.0 - left)
    entering = select(way < 1.0, fma(way, before - speed, speed), before)
    target = fma(carry, entering, forget * speed) / (carry + forget)
    return fma(old - target, decay((carry + forget) * step), target)


@merged_kernel
def lane_damping(belt: LaneBelt, time: float):
    """Transverse damping [N s/m^2], as `rhs.damping_at`."""
    damping = belt.constants[0, lf.TRANSVERSE_DAMPING] + course.faded_damping(
        time, belt.rise_time, belt.start_damping
    )
    return damping


@merged_kernel
def lane_transverse(belt: LaneBelt, fields: LaneArray, j: int, net_left, net_right, bending, lead: float):
    """Line force across the belt at station j [N/m], outward, of tension and bending.

    `net_left`, `net_right` are T - P - m v^2 in the cells beside it [N], `bending` is EI [N m^2], that of the
    displacement after `lead` [s].
    """
    n = fields.rows
    # of the rows two away, those beside the neighbours
    a, b = j - 1 if j > 0 else n - 1, j + 1 if j < n - 1 else 0
    w, w_a, w_b = fields[j, f.W], behind(fields, j, f.W), ahead(fields, j, f.W)
    w_aa, w_bb = behind(fields, a, f.W), ahead(fields, b, f.W)
    if j == 0:
        w_aa = from_behind(w_aa)
    if j == n - 1:
        w_bb = from_ahead(w_bb)
    bent = _bent(belt, j, w_aa, w_a, w, w_b, w_bb)
    if lead > 0.0:
        u_aa, u_bb = behind(fields, a, f.U), ahead(fields, b, f.U)
        if j == 0:
            u_aa = from_behind(u_aa)
        if j == n - 1:
            u_bb = from_ahead(u_bb)
        u_a, u, u_b = behind(fields, j, f.U), fields[j, f.U], ahead(fields, j, f.U)
        bent = fma(lead, _bent(belt, j, u_aa, u_a, u, u_b, u_bb), bent)
    tension = net_right * ((w_b - w) * belt.per_cell[j]) - net_left * (
        (w - w_a) * behind(belt.per_cell, j, 0)
    )
    inward = net_right * (0.5 * belt.cell[j] * belt.curvature[j])
    inward += net_left * (0.5 * behind(belt.cell, j, 0) * behind(belt.curvature, j, 0))
    return fma(tension - inward, belt.per_dual[j], bending * bent)


@merged_kernel
def _bent(belt: LaneBelt, j: int, w_aa, w_a, w, w_b, w_bb):
    """Fourth derivative at station j by the displacements of five, negative."""
    bent = fma(belt.bending[j, 0], w_aa, fma(belt.bending[j, 4], w_bb, belt.bending[j, 2] * w))
    return fma(belt.bending[j, 1], w_a, fma(belt.bending[j, 3], w_b, bent))


@merged_kernel
def saddle_pressure(belt: LaneBelt, j: int, ring_left, ring_right, relief):
    """Twice the force of the rings on the saddles at station j of an arc [N].

    `ring_left`, `ring_right` are T in the cells beside it [N], `relief` the part taken by the rings' own
    weight.
    """
    pressure = maximum(ring_right - relief, 0.0) * (belt.cell[j] * belt.curvature[j])
    bent = behind(belt.cell, j, 0) * behind(belt.curvature, j, 0)
    pressure += maximum(ring_left - relief, 0.0) * bent
    return pressure


@merged_kernel
def ring_grip(belt: LaneBelt, j: int, ring_left, ring_right, relief, friction):
    """Largest friction of the saddles on the rings at station j of an arc [N/m]; as `saddle_pressure`."""
    pressure = saddle_pressure(belt, j, ring_left, ring_right, relief)
    return friction * (0.5 * belt.per_dual[j]) * pressure


@kernel
def lane_contact_forces(belt: LaneBelt, state: LaneState, stations: LaneArray) -> None:
    """Axial line forces of both wraps into FORCE [N/m], where contact begins into WAY.

    Both stay 0 where no groove can hold the belt.
    """
    fields, c = state.fields, belt.constants
    wedge, scalars = c[0, lf.WEDGE], state.scalars
    for wrap in range(2):
        contact = state.contacts[1] if wrap else state.contacts[0]
        pushed = contact.stations
        slope = like(wedge, pushed[0, compliance.GAP])
        shift = scalars[0, f.FIRST_STATE + f.SHIFT]
        opening = like(
            scalars[0, lf.POSITION] if wrap else like(c[0, lf.DRIVING_POSITION], shift) + shift, slope
        )
        tilted = f.FIRST_STATE + (f.DRIVEN_COS if wrap else f.DRIVING_COS)
        rows, parts = belt.places[wrap]
        for k in range(contact.weight.size):
            lifted = fma(contact.upright[k], at_station(fields, rows[k], parts[k], f.W), contact.rise[k])
            pushed[k, compliance.GAP] = fma(slope, lifted, opening)
        if belt.is_free:
            one, other = like(scalars[0, tilted], slope), like(scalars[0, tilted + 1], slope)
            for k in range(contact.weight.size):
                tilt = fma(contact.sine[k], other, contact.cosine[k] * one)
                pushed[k, compliance.GAP] = pushed[k, compliance.GAP] + tilt
        if contact.discs.place.size > 0:
            open_gaps(contact.discs, pushed, compliance.GAP)
        solve_contact(contact, _MOST_CONTACT_ROUNDS)
        before = like(-1.0, slope)
        for k in range(contact.weight.size):
            force, push = contact_force(pushed, k), pushed[k, compliance.PUSH]
            pushed[k, compliance.FORCED] = force
            set_station(stations, rows[k], parts[k], lf.FORCE, force)
            begins = maximum(push / maximum(push - before, LEAST_FORCE), LEAST_WAY)
            way = select(before > 0.0, 1.0, begins)
            set_station(stations, rows[k], parts[k], lf.WAY, select(push > 0.0, way, LEAST_WAY))
            before = push


@kernel
def advance_discs(belt: LaneBelt, state: LaneState, step: float) -> None:
    """Discs with inertia at the end of a step, before its forces; with the pulleys' speeds there."""
    share = lane_speed_share(belt, state.time[0], belt.constants[0, lf.BELT_SPEED])
    turnings, surfaces = lane_pulleys(belt, share, state.scalars)
    for wrap in range(2):
        contact = state.contacts[1] if wrap else state.contacts[0]
        if contact.discs.place.size > 0:
            turning = like(turnings[1] if wrap else turnings[0], contact.discs.states[0, 0])
            turn_discs(contact.discs, contact.weight, contact.stations, compliance.FORCED, turning, step)


@kernel
def _lane_strains(belt: LaneBelt, state: LaneState, stations: LaneArray) -> None:
    """Strains of elements and rings in the cells, with 1 / (1 + strain) and 1 / content."""
    fields, offset = state.fields, belt.constants[0, lf.RING_OFFSET]
    w_b = from_ahead(fields[0, f.W])
    for j in range(fields.rows - 1, -1, -1):
        w = fields[j, f.W]
        cell_strains(belt, stations, j, w, w_b, fields[j, f.N_ELEMENT], fields[j, f.N_RING], offset)
        w_b = w


@merged_kernel
def cell_strains(belt: LaneBelt, stations: LaneArray, j: int, w, w_b, more_0, more_1, offset):
    """Return `_lane_strains` of cell j, by the displacement at both ends [m] and the contents' deviations."""
    kappa = belt.curvature[j]
    content_0, content_1 = more_0 + 1.0, fma(offset, kappa, more_1 + 1.0)
    per_0, per_1 = reciprocals(content_0, content_1)
    if anywhere(kappa > 0.0):
        bent = (w + w_b) * (0.5 * kappa)
        length_0, length_1 = bent + 1.0, fma(offset, kappa, bent + 1.0)
        per_length_0, per_length_1 = reciprocals(length_0, length_1)
        stations[j, lf.EPS_0], stations[j, lf.EPS_1] = (bent - more_0) * per_0, (bent - more_1) * per_1
        stations[j, lf.SHORT_0] = content_0 * per_length_0
        stations[j, lf.SHORT_1] = content_1 * per_length_1
    else:
        stations[j, lf.EPS_0], stations[j, lf.EPS_1] = -more_0 * per_0, -more_1 * per_1
        stations[j, lf.SHORT_0], stations[j, lf.SHORT_1] = content_0, content_1
    stations[j, lf.PER_CONTENT_0], stations[j, lf.PER_CONTENT_1] = per_0, per_1


@merged_kernel
def lane_coefficient(belt: LaneBelt, numbers, v_law, normal):
    """Coefficient of friction at a sliding speed [m/s] and a normal line force [N/m], by a law's numbers."""
    law = belt.law
    if law.kind == Law.TABLE:
        table = law.table_force, law.table_speed, law.table_mu
        coefficient, _ = table_coefficient(table, v_law, normal)
    else:
        coefficient, _ = formula_coefficient(law.kind, numbers, v_law)
    return coefficient


@kernel
def lane_sliding(belt: LaneBelt, state: LaneState, stations: LaneArray) -> None:
    """Sliding speeds where a groove may hold the belt, and the results of friction that depend on them alone.

    A loop of its own: the chain of operations from a speed to the system's rows is longer than what a
    processor looks ahead, so that it would not begin a station before the last one is nearly done.
    """
    n, fields, c = state.fields.rows, state.fields, belt.constants
    numbers = law_numbers(c[0, lf.KINETIC_FRICTION], c[0, lf.FRICTION_GRADIENT], c[0, lf.LAW_SPEED])
    share = lane_speed_share(belt, state.time[0], c[0, lf.BELT_SPEED])
    per_cosine, belt_speed, offset = 1.0 / c[0, lf.COSINE], share * c[0, lf.BELT_SPEED], c[0, lf.RING_OFFSET]
    least = LEAST_SHARE_OF_WIDTH * c[0, lf.FRICTION_SPEED]
    per_width, per_ring_width = 1.0 / c[0, lf.FRICTION_SPEED], 1.0 / c[0, lf.RING_FRICTION_SPEED]
    pulleys = lane_pulleys(belt, share, state.scalars)
    for j in range(n):
        if not anywhere(belt.touches[j] > 0.0):
            continue
        full_speed = belt_speed + fields[j, f.V_ELEMENT]
        slope = (ahead(fields, j, f.W) - behind(fields, j, f.W)) * belt.per_span[j]
        v_across = fma(full_speed, slope, fields[j, f.U])
        v_radial, v_tangential = groove_sliding(
            belt, j, pulleys, belt_speed, v_across, fields[j, f.V_ELEMENT], fields[j, f.W]
        )
        speed, _ = flank_sliding(v_radial, v_tangential, per_cosine)
        v_law = fields[j, f.V_FILTERED] if belt.memory else speed
        coefficient = lane_coefficient(belt, numbers, v_law, stations[j, lf.FORCE] * per_cosine)
        # of the flanks tanh(x) = (1 - e^-2x) / (1 + e^-2x) and 1 / speed by one division
        speed = maximum(speed, least)
        saddle = fma(fma(offset, belt.arc_curvature[j], 1.0), full_speed, -(belt_speed + fields[j, f.V_RING]))
        rest = decay(speed * (2.0 * per_width))
        ring_factor, _ = saturation(saddle, per_ring_width)
        per_flank = 1.0 / (speed * (1.0 + rest))
        stations[j, lf.SLIDING_R], stations[j, lf.SLIDING_T] = v_radial, v_tangential
        stations[j, lf.COEFFICIENT] = coefficient
        stations[j, lf.FACTOR] = (1.0 - rest) * (speed * per_flank)
        stations[j, lf.PER_SPEED] = (1.0 + rest) * per_flank
        stations[j, lf.RING_FACTOR], stations[j, lf.SADDLE] = ring_factor, saddle
