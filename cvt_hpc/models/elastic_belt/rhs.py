"""Right-hand side of the elastic belt, written for reading: the plain form that faster steps are judged by.

Derived by virtual power on the moving belt (Eulerian, path coordinate s, belt speed v, displacement w
outward):

    stretch        eps_i = (1 + kappa (w + d_i)) / n_i - 1
    forces         T = EA_1 eps_1,   P = -EA_0 eps_0 where eps_0 < 0 else 0,   F = T - P - m v^2
    content        n_i,t + (v_i / (1 + eps_i)),s = 0
    elements       m_0 (v_0,t + v_0 v_0,s) = -P,s + f_t - (1 + kappa d_1) q + (p_r - d_b (w_t + v_0 w_s)) w_s
    rings          m_1 (v_1,t + v_1 v_1,s) =  T,s + q
    transverse     m (w_tt + 2 v w_ts + v' w_s) = (F w_s),s - EI w_ssss - F kappa - d_b (w_t + v_0 w_s) + p_r
    memory         v_f,t + v v_f,s = (|v| - v_f) / tau_f in contact, v_f = |v| where that begins
    tilt           d_a (th_t + v_0 th_s) = -k_a th - d_1 q, where elements tilt (`column.py`)
    pulleys        J omega_dn' = -sum f_t (r + w) - i M,   T_1 k z_dn' = sum f_ax - F_dn   (and `pulleys.py`)
    dampers        T_d,i = c_i (v_i,s + kappa w_t): +T_d,i,s along the belt, -kappa T_d,i across it

with q the friction of the rings on the elements' saddle, p_r, f_t the flanks' forces, |v| their sliding
speed and M the load; v = r_dr omega_dr is the speed of the pitch line at the driving pulley's present speed,
and v' its rate. The last term of the elements' equation is the radial load in the direction of the
belt's actual tangent: it carries the power that radial sliding dissipates, and closes the balance of power.
An element is in a groove as long as that touches it, on the arc and beyond: x past a tangent point of the
pitch radius R the pulley's axis is at the distance rho = hypot(x, R + w), and its radial unit vector has the
angle theta = atan(x / (R + w)) to the path's normal. So with u = w_t + v_0 w_s

    gap            g = z + 2 tan d_0 (rho - R) + C f,   f >= 0, g >= 0, f g = 0
    sliding        v_r = u cos theta + v_0 sin theta,   v_t = v_0 cos theta - u sin theta - omega rho
    on the belt    along: p_r sin theta + f_t cos theta,   across: p_r cos theta - f_t sin theta
    on the pulley  rho f_t

and the equations above are those of theta = 0. Material that flows along the path lengthens, by the equations
of stretch and content, at the rate

    D ln(1 + eps_i) / Dt = (v_i,s + kappa w_t) / (1 + kappa (w + d_i)),

on which a layer's damper acts (the divisor is left out): elements that move outwards on an arc and spread as
they do strain nothing. Stresses of T and P enter cells, everything else stations; the
content is upwinded, since centred fluxes leave a free checkerboard mode where P = 0.
"""

import numpy as np

from cvt_hpc.kernels import kernel, merged_kernel
from cvt_hpc.models.elastic_belt import fields as f
from cvt_hpc.models.elastic_belt.belt import Belt, State
from cvt_hpc.models.elastic_belt.column import column_across, column_forces, tilt_rate, tilted_sliding
from cvt_hpc.physics import compliance
from cvt_hpc.physics.compliance import Contact, plain_contact, solve_wrap
from cvt_hpc.physics.flank import flank_forces, flank_sliding
from cvt_hpc.physics.friction import friction_coefficient, saturation
from cvt_hpc.variator import course

LEAST_WAY = 0.02  # share of a cell from the place where contact begins to a station, for its memory


@merged_kernel
def load_at(belt: Belt, time: float) -> float:
    """Torque at the driving pulley [N m]: a smooth rise to load_start, then linear to load, or a profile."""
    load = course.load_course(time, belt.rise_time, belt.ramp_end, belt.load_start, belt.load)
    return load * course.multiple_at(belt.profile, course.LOAD, time)


@merged_kernel
def thrust_at(belt: Belt, time: float) -> float:
    """Thrust on the driven pulley [N], by its profile."""
    return belt.thrust * course.multiple_at(belt.profile, course.THRUST, time)


@merged_kernel
def speed_share_at(belt: Belt, time: float) -> float:
    """Speed of the driving pulley over driving_speed [1]: that of speed_start, from rise_time linear to 1.

    Or by its profile.
    """
    share = course.speed_course(time, belt.rise_time, belt.ramp_end, belt.speed_start / belt.driving_speed)
    return share * course.multiple_at(belt.profile, course.SPEED, time)


@merged_kernel
def driving_speed_at(belt: Belt, state: State) -> float:
    """Speed of the driving pulley [rad/s]: that of its course, and by how much it deviates from that."""
    course = speed_share_at(belt, state.scalars[f.TIME]) * belt.driving_speed
    return course + state.scalars[f.FIRST_STATE + f.EXCESS]


@merged_kernel
def _belt_acceleration_at(belt: Belt, time: float) -> float:
    """Rate v' of the belt speed [m/s^2]; 0 but along a ramp or a profile of speed, of which a run has one."""
    rate = course.slope_at(belt.profile, course.SPEED, time)
    if belt.rise_time <= time < belt.ramp_end:
        rate += (1.0 - belt.speed_start / belt.driving_speed) / (belt.ramp_end - belt.rise_time)
    return rate * belt.belt_speed


@merged_kernel
def damping_at(belt: Belt, time: float) -> float:
    """Transverse damping [N s/m^2]: the belt's own, and the start-up's until rise_time."""
    damping = belt.transverse_damping + course.faded_damping(time, belt.rise_time, belt.start_damping)
    return damping


@merged_kernel
def strains(belt: Belt, fields: np.ndarray, eps: np.ndarray) -> None:
    """Strains of elements and rings in the cells, into `eps` (2, N) [1]."""
    n = belt.cell.size
    for c in range(n):
        kappa = belt.curvature[c]
        w = 0.5 * (fields[f.W, c] + fields[f.W, (c + 1) % n])
        eps[0, c] = (1.0 + kappa * w) / fields[f.N_ELEMENT, c] - 1.0
        eps[1, c] = (1.0 + kappa * (w + belt.ring_offset)) / fields[f.N_RING, c] - 1.0


def fresh_contacts(belt: Belt) -> tuple[Contact, Contact]:
    """Contact of the driving and of the driven wrap, as `contact_forces` takes them, all stations closed."""
    return plain_contact(belt.driving), plain_contact(belt.driven)


@merged_kernel
def _wrap_contact(
    belt: Belt,
    contact: Contact,
    places: np.ndarray,
    w: np.ndarray,
    opening: float,
    tilt: np.ndarray,
    force: np.ndarray,
) -> int:
    """Axial line forces of one wrap from its displacements; returns the solver's count, 0 where it failed.

    `places` (m,) are its stations, `opening` and `tilt` (2,) those of the rigid sheaves [m]; `w` and the
    result `force` have all N stations. Where a station does not touch, it is the pull that would close its
    gap, negative.
    """
    gap, found = np.empty(places.size), np.empty(places.size)
    for k in range(places.size):
        gap[k] = contact.rise[k] + contact.upright[k] * w[places[k]]
    gap = opening + 2.0 * np.tan(belt.half_wedge_angle) * gap
    gap = gap + (contact.cosine * tilt[0] + contact.sine * tilt[1])
    solves = solve_wrap(contact, gap, found)
    for k in range(places.size):
        force[places[k]] = found[k] if found[k] > 0.0 else min(contact.stations[k, compliance.PUSH], 0.0)
    return solves


@merged_kernel
def contact_forces(belt: Belt, state: State, contacts: tuple[Contact, Contact], force: np.ndarray) -> int:
    """Axial line forces, or pulls, of both wraps into `force` (N,) [N/m]; 0 solves: failure."""
    force[:] = 0.0
    w = state.fields[f.W]
    scalars, states = state.scalars, state.scalars[f.FIRST_STATE :]
    opening, tilt = belt.driving_position + states[f.SHIFT], states[f.DRIVING_COS : f.DRIVING_COS + 2]
    solves = _wrap_contact(belt, contacts[0], belt.driving_stations, w, opening, tilt, force)
    opening, tilt = scalars[f.DRIVEN_POSITION], states[f.DRIVEN_COS : f.DRIVEN_COS + 2]
    more = _wrap_contact(belt, contacts[1], belt.driven_stations, w, opening, tilt, force)
    return solves + more if solves > 0 and more > 0 else 0


@merged_kernel
def ring_drag(
    belt: Belt, j: int, a: int, eps: np.ndarray, v_element: float, v_ring: float, share: float, tilt: float
) -> tuple[float, float]:
    """Friction of the elements' saddles on the rings at station j of an arc, between cells a and j.

    The rings press on the saddles with what their own weight leaves (Bullinger et al. 2005, eq. 48), at
    `share` of the belt's nominal speed. Where elements tilt, theirs is `tilt` [rad]. Returns the line force
    on the rings [N/m] and the speed of the saddles against them [m/s].
    """
    sliding_speed = (1.0 + belt.ring_offset * belt.arc_curvature[j]) * v_element - v_ring
    relief = belt.ring_relief[j] * share * share
    pressure = max(belt.ring_stiffness * eps[1, j] - relief, 0.0) * belt.cell[j] * belt.curvature[j]
    pressure += max(belt.ring_stiffness * eps[1, a] - relief, 0.0) * belt.cell[a] * belt.curvature[a]
    grip, per_width = 0.5 * pressure / belt.dual[j] * belt.ring_friction, 1.0 / belt.ring_friction_speed
    if belt.tilts:
        lever = belt.ring_offset
        held, damping = belt.tilt_spring * tilt / lever, belt.tilt_damper / (lever * lever)
        sliding_speed = tilted_sliding(sliding_speed, held, grip, damping, per_width)
    factor, _ = saturation(sliding_speed, per_width)
    return grip * factor, sliding_speed


@merged_kernel
def lengthening(belt: Belt, v: np.ndarray, u: np.ndarray, c: int) -> float:
    """Rate v_s + kappa w_t at which the material of cell c lengthens [1/s], by its layer's speed v (N,)."""
    b = c + 1 if c < v.size - 1 else 0
    return (v[b] - v[c]) / belt.cell[c] + 0.5 * belt.curvature[c] * (u[c] + u[b])


@merged_kernel
def damped_push(belt: Belt, eps: float, opening: float) -> float:
    """Push force with its damper [N], never a pull, of a cell that is strained and lengthens [1/s]."""
    if eps >= 0.0 and belt.bridging_stiffness == np.inf:
        return 0.0
    stiffness = belt.element_stiffness if eps < 0.0 else belt.bridging_stiffness
    return max(-stiffness * eps - belt.element_damping * opening, 0.0)


@kernel
def accelerations(
    belt: Belt, state: State, force: np.ndarray, eps: np.ndarray, rate: np.ndarray, moments: np.ndarray
) -> None:
    """Accelerations of u, v_element and v_ring, into rows U, V_ELEMENT and V_RING of `rate` (7, N) [m/s^2].

    Of elements that tilt it is (8, N), with ELEMENT_TILT [rad/s]. From axial line forces of the flanks
    `force` (N,) [N/m] and strains of the cells `eps` (2, N). Into `moments` (N,) go the moments of the
    stations' flanks on the driven pulley, and, of those that the driving one holds, the torque that they take
    from it [N m].
    """
    n = belt.cell.size
    w, u = state.fields[f.W], state.fields[f.U]
    v0, v1, vf = state.fields[f.V_ELEMENT], state.fields[f.V_RING], state.fields[f.V_FILTERED]
    sine, cosine = np.sin(belt.half_wedge_angle), np.cos(belt.half_wedge_angle)
    speed_share = speed_share_at(belt, state.scalars[f.TIME])
    belt_speed, driving_speed = speed_share * belt.belt_speed, driving_speed_at(belt, state)
    acceleration = _belt_acceleration_at(belt, state.scalars[f.TIME])
    centrifugal = belt.mass * belt_speed * belt_speed
    damping, light = damping_at(belt, state.scalars[f.TIME]), belt.mass - belt.element_mass
    pressed, moment = eps[0], eps[0]
    if belt.has_column:
        pressed, moment = np.empty(n), np.empty(n)
        column_forces(belt, state.fields, eps[0], pressed, moment)
    for j in range(n):
        a, b = j - 1 if j > 0 else n - 1, j + 1 if j < n - 1 else 0
        left, right, dual = belt.cell[a], belt.cell[j], belt.dual[j]
        ring_left, ring_right = belt.ring_stiffness * eps[1, a], belt.ring_stiffness * eps[1, j]
        push_left = max(-belt.element_stiffness * pressed[a], 0.0)
        push_right = max(-belt.element_stiffness * pressed[j], 0.0)
        net_left, net_right = ring_left - push_left - centrifugal, ring_right - push_right - centrifugal
        slope = (w[b] - w[a]) / (left + right)
        # stress of the layers with their dampers; elements never pull
        stress_left = ring_left + belt.ring_damping * lengthening(belt, v1, u, a)
        stress_right = ring_right + belt.ring_damping * lengthening(belt, v1, u, j)
        push_left = damped_push(belt, pressed[a], lengthening(belt, v0, u, a))
        push_right = damped_push(belt, pressed[j], lengthening(belt, v0, u, j))

        transverse = (net_right * (w[b] - w[j]) / right - net_left * (w[j] - w[a]) / left) / dual
        bent_left = (stress_left - push_left - centrifugal) * left * belt.curvature[a]
        bent_right = (stress_right - push_right - centrifugal) * right * belt.curvature[j]
        transverse -= 0.5 * (bent_right + bent_left) / dual
        transverse -= 2.0 * belt.mass * belt_speed * (u[b] - u[a]) / (left + right)
        transverse -= belt.mass * acceleration * slope
        for k in range(5):
            transverse += belt.bending[j, k] * w[(j + k - 2) % n]
        if belt.has_column:
            transverse += column_across(belt, moment, j)
        turning = 0.0
        if belt.curvature_terms > 0:
            turning = 0.5 * (right * belt.curvature[j] + left * belt.curvature[a]) / dual
            transverse += belt.bending_load[j]
            transverse += turning * belt.element_mass * (v0[j] * v0[j] - belt_speed * belt_speed)
            transverse += turning * light * (v1[j] * v1[j] - belt_speed * belt_speed)
        v_radial = u[j] + v0[j] * slope
        outward = -damping * v_radial

        along_ring = (stress_right - stress_left) / dual
        along_element = -(push_right - push_left) / dual

        moments[j] = 0.0
        if belt.touches[j] * force[j] > 0.0:
            climb, v_tangential, radius = sliding_speeds(belt, state, j, v_radial, driving_speed)
            speed, _ = flank_sliding(climb, v_tangential, 1.0 / cosine)
            v_law = speed if belt.friction_memory == 0.0 else vf[j]
            coefficient, _ = friction_coefficient(belt.law, v_law, force[j] / cosine)
            radial, tangential = flank_forces(
                coefficient, belt.friction_speed, sine, cosine, force[j], climb, v_tangential
            )
            lean = leaning(belt, j, w[j])
            outward += belt.upright[j] * radial - lean * tangential
            along_element += belt.upright[j] * tangential + lean * radial
            moments[j] = (1.0 - 2.0 * belt.on_driven[j]) * dual * tangential * radius
        drag = 0.0
        if belt.arc_curvature[j] > 0.0:
            tilt = state.fields[f.ELEMENT_TILT, j] if belt.tilts else 0.0
            drag, _ = ring_drag(belt, j, a, eps, v0[j], v1[j], speed_share, tilt)
            along_ring += drag
            along_element -= (1.0 + belt.ring_offset * belt.arc_curvature[j]) * drag
        along_element += outward * slope
        if belt.tilts:
            rate[f.ELEMENT_TILT, j] = tilt_rate(belt, state, j, drag)
        rate[f.U, j] = (transverse + outward) / belt.mass
        along_element -= turning * belt.element_mass * v0[j] * u[j]
        along_ring -= turning * light * v1[j] * u[j]
        rate[f.V_ELEMENT, j] = along_element / belt.element_mass - v0[j] * (v0[j] - v0[a]) / left
        rate[f.V_RING, j] = along_ring / belt.ring_mass[j] - v1[j] * (v1[j] - v1[a]) / left


@kernel
def content_rates(belt: Belt, state: State, eps: np.ndarray, rate: np.ndarray) -> None:
    """Rates of the layers' content [1/s] into rows N_ELEMENT and N_RING: upwind flux v / (1 + eps)."""
    n = belt.cell.size
    for layer in range(2):
        v, out = state.fields[f.V_ELEMENT + layer], rate[f.N_ELEMENT + layer]
        for c in range(n):
            b = c + 1 if c < n - 1 else 0
            a = c - 1 if c > 0 else n - 1
            inflow = v[c] / (1.0 + eps[layer, a if v[c] >= 0.0 else c])
            outflow = v[b] / (1.0 + eps[layer, c if v[b] >= 0.0 else b])
            out[c] = (inflow - outflow) / belt.cell[c]


@kernel
def memory_rates(belt: Belt, state: State, force: np.ndarray, rate: np.ndarray) -> None:
    """Rate of the filtered sliding speed [m/s^2]; where a station does not touch it is |v| at once."""
    vf = state.fields[f.V_FILTERED]
    belt_speed = speed_share_at(belt, state.scalars[f.TIME]) * belt.belt_speed
    for j in range(vf.size):
        rate[f.V_FILTERED, j] = 0.0
        if belt.touches[j] == 0.0 or belt.friction_memory == 0.0:
            continue
        speed = sliding_speed(belt, state, j)
        if force[j] > 0.0:
            before = vf[j - 1]
            if force[j - 1] <= 0.0:
                before = sliding_speed(belt, state, j - 1 if j > 0 else vf.size - 1)
            carried, entering = transported(belt, force, j, belt_speed, speed, before)
        else:
            carried, entering = _memory_transport(belt, LEAST_WAY * belt.cell[j - 1], belt_speed), speed
        rate[f.V_FILTERED, j] = carried * (entering - vf[j]) + (speed - vf[j]) / belt.friction_memory


@merged_kernel
def transported(
    belt: Belt, force: np.ndarray, j: int, belt_speed: float, speed: float, before: float
) -> tuple[float, float]:
    """Rate [1/s] of the memory's transport to station j, which touches, and the speed [m/s] that comes.

    From the station behind, whose filtered speed is `before`; where that is open contact begins in between,
    where the line from its pull to the force is 0, with the sliding speed |v| there.
    """
    cell, behind = belt.cell[j - 1], force[j - 1]
    if behind > 0.0:
        return _memory_transport(belt, cell, belt_speed), before
    way = max(force[j] / (force[j] - behind), LEAST_WAY)
    return _memory_transport(belt, way * cell, belt_speed), speed + way * (before - speed)


@merged_kernel
def _memory_transport(belt: Belt, spacing: float, belt_speed: float) -> float:
    """Upwind rate of the memory's transport [1/s], fitted: a steady memory decays as exp(-s / (v tau_f))."""
    return 1.0 / (belt.friction_memory * np.expm1(spacing / (belt_speed * belt.friction_memory)))


@merged_kernel
def sliding_speed(belt: Belt, state: State, j: int) -> float:
    """Sliding speed |v| of the flanks at station j, which a groove may hold [m/s]."""
    n = belt.cell.size
    a, b = j - 1 if j > 0 else n - 1, j + 1 if j < n - 1 else 0
    w, v = state.fields[f.W], state.fields[f.V_ELEMENT, j]
    v_across = state.fields[f.U, j] + v * (w[b] - w[a]) / (belt.cell[a] + belt.cell[j])
    climb, v_tangential, _ = sliding_speeds(belt, state, j, v_across, driving_speed_at(belt, state))
    speed, _ = flank_sliding(climb, v_tangential, 1.0 / np.cos(belt.half_wedge_angle))
    return speed


@merged_kernel
def leaning(belt: Belt, j: int, w: float) -> float:
    """Part along the path of the pulley's radial unit vector at station j, displaced by w [1]."""
    return belt.lean[j] - belt.lean_rate[j] * w


@merged_kernel
def sliding_speeds(
    belt: Belt, state: State, j: int, v_across: float, driving_speed: float
) -> tuple[float, float, float]:
    """Sliding of station j in its groove: radial, tangential [m/s], and the distance from the axis [m].

    `v_across` is u = w_t + v_0 w_s, the element's speed across the path [m/s].
    """
    w, v = state.fields[f.W, j], state.fields[f.V_ELEMENT, j]
    lean, upright = leaning(belt, j, w), belt.upright[j]
    omega = state.scalars[f.DRIVEN_SPEED] if belt.on_driven[j] > 0.0 else driving_speed
    distance = (belt.driven_radius if belt.on_driven[j] > 0.0 else belt.driving_radius) + belt.rise[j]
    distance += upright * w
    return (v_across * upright + v * lean, v * upright - v_across * lean - omega * distance, distance)
