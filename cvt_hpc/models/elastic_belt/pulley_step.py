"""The pulleys' part of a step in lanes, and of the audit of power; their laws stand in `pulleys.py`."""

from cvt_hpc.kernels import kernel, merged_kernel
from cvt_hpc.lanes import LaneArray, fma, like, select, sqrt
from cvt_hpc.models.elastic_belt import fields as f
from cvt_hpc.models.elastic_belt import lane_fields as lf
from cvt_hpc.models.elastic_belt.lane_belt import LaneBelt, LaneState
from cvt_hpc.models.elastic_belt.lane_forces import lane_given_thrust, lane_load, lane_speed_share
from cvt_hpc.models.elastic_belt.pulleys import beyond_clearance, drive_torque, pulley_rates
from cvt_hpc.physics import compliance
from cvt_hpc.physics.compliance import Contact


@kernel
def _lane_thrust(state: LaneState):
    """Axial force of the belt on the driven sheave [N]."""
    weight, pushed = state.contacts[1].weight, state.contacts[1].stations
    total = like(0.0, pushed[0, compliance.FORCED])
    for k in range(weight.size):
        total = fma(weight[k], pushed[k, compliance.FORCED], total)
    return total


@merged_kernel
def _pull(contact: Contact, pattern):
    """Axial force of the belt on a sheave [N], and its tilting force, times the cosine and times the sine."""
    pushed = contact.stations
    total, one, other = like(0.0, pattern), like(0.0, pattern), like(0.0, pattern)
    for k in range(contact.weight.size):
        pressed = contact.weight[k] * like(pushed[k, compliance.FORCED], pattern)
        total = total + pressed
        one, other = fma(contact.cosine[k], pressed, one), fma(contact.sine[k], pressed, other)
    return total, one, other


@kernel
def _lane_pulley_rates(belt: LaneBelt, state: LaneState, taken, moment):
    """Rates of free pulleys, ten, by the torques of the belt [N m], as `pulleys.pulley_rates` has them.

    Then the tilting forces on the sheaves, four [N], and the axial forces, two [N].
    """
    c, scalars, time = belt.constants, state.scalars, state.time[0]
    speed = scalars[0, lf.SPEED]
    turning = lane_speed_share(belt, time, speed) * like(c[0, lf.DRIVING_SPEED], speed)
    turning = turning + scalars[0, f.FIRST_STATE + f.EXCESS]
    axial_driving, driving_cos, driving_sin = _pull(state.contacts[0], speed)
    axial_driven, driven_cos, driven_sin = _pull(state.contacts[1], speed)
    axial, tilting = (axial_driving, axial_driven), (driving_cos, driving_sin, driven_cos, driven_sin)
    load, ratio = lane_load(belt, time, speed), like(c[0, lf.RATIO], speed)
    given = load, ratio, lane_given_thrust(belt, time, speed), like(c[0, lf.AXIAL_DAMPING], speed)
    going, pulled = 1.0 if time >= belt.rise_time else 0.0, (taken, moment, axial, tilting)
    turnings, position = (turning, speed), scalars[0, lf.POSITION]
    found = pulley_rates(c, lf.FIRST_LAW, scalars, going, turnings, position, pulled, given)
    return found, tilting, axial


@kernel
def advance_pulleys(belt: LaneBelt, state: LaneState, taken, moment, step: float) -> None:
    """Pulleys' speeds, openings and tilts at the end of a step, by torques of the belt [N m] and its forces.

    `taken` is the torque that the belt takes from the driving pulley, which counts where that is free;
    `moment` is its torque on the driven one.
    """
    c, scalars = belt.constants, state.scalars
    speed = scalars[0, lf.SPEED]
    if belt.is_free:
        rates, tilting, axial = _lane_pulley_rates(belt, state, taken, moment)
        scalars[0, lf.SPEED] = fma(step, rates[0], speed)
        scalars[0, lf.POSITION] = fma(step, rates[1], scalars[0, lf.POSITION])
        for k in range(f.STATES):
            scalars[0, f.FIRST_STATE + k] = fma(step, rates[2 + k], scalars[0, f.FIRST_STATE + k])
    else:
        load = like(c[0, lf.RATIO], speed) * lane_load(belt, state.time[0], speed)
        scalars[0, lf.SPEED] = speed + step * (moment - load) / like(c[0, lf.DRIVEN_INERTIA], speed)
        axial = like(_lane_thrust(state), speed)
        scalars[0, lf.POSITION] = scalars[0, lf.POSITION] + step * (
            axial - lane_given_thrust(belt, state.time[0], speed)
        ) / like(c[0, lf.AXIAL_DAMPING], speed)


@kernel
def opening_by_tilt(state: LaneState, wrap: int):
    """Largest opening of a groove by the tilt of its sheaves and the bending of its shaft [m]."""
    scalars = state.scalars
    contact = state.contacts[1] if wrap else state.contacts[0]
    total, one, other = _pull(contact, scalars[0, lf.SPEED])
    give = like(
        contact.scalars[0, compliance.COMPLIANCE] * contact.scalars[0, compliance.TILT_COMPLIANCE], total
    )
    tilted = f.FIRST_STATE + (f.DRIVEN_COS if wrap else f.DRIVING_COS)
    one, other = fma(give, one, scalars[0, tilted]), fma(give, other, scalars[0, tilted + 1])
    if contact.has_clearance:
        one = one + like(contact.scalars[0, compliance.LOOSE_1], total)
        other = other + like(contact.scalars[0, compliance.LOOSE_2], total)
    return sqrt(fma(one, one, other * other))


@kernel
def taken_by_clearance(state: LaneState):
    """Part of half the force times overlap that closed stations do not store [J]: a loose collar takes it."""
    energy = like(0.0, state.scalars[0, lf.SPEED])
    for wrap in range(2):
        contact = state.contacts[1] if wrap else state.contacts[0]
        if contact.has_clearance:
            total, one, other = _pull(contact, energy)
            loose = (
                like(contact.scalars[0, compliance.LOOSE_1], energy),
                like(contact.scalars[0, compliance.LOOSE_2], energy),
            )
            energy = fma(0.5 * loose[0], one, fma(0.5 * loose[1], other, energy))
    return energy


@kernel
def audit_pulleys(
    belt: LaneBelt, state: LaneState, driving, driven, rows: LaneArray, k: int, first: int
) -> None:
    """Powers and stored energy of free pulleys, in the place of those of pulleys that are not.

    A lag's oil takes the work of the axial forces, or moments, beyond the energy in springs. Thrusts work
    with all pressing forces but the springs. Results of `power.audit` stand in the row; `driving` and
    `driven` are the power that the belt takes from the driving pulley, and the torque that it takes from the
    driven one times that pulley's speed [W].
    """
    c, scalars = belt.constants, state.scalars
    speed = scalars[0, lf.SPEED]
    excess, shift = scalars[0, f.FIRST_STATE + f.EXCESS], scalars[0, f.FIRST_STATE + f.SHIFT]
    position = scalars[0, lf.POSITION]
    turning = lane_speed_share(belt, state.time[0], speed) * like(c[0, lf.DRIVING_SPEED], speed) + excess
    rates, tilting, axial = _lane_pulley_rates(belt, state, driving / turning, -driven / speed)
    mobility = like(c[0, lf.FIRST_LAW + f.DRIVING_MOBILITY], speed)
    torque = drive_torque(c, lf.FIRST_LAW, excess, lane_load(belt, state.time[0], speed))
    rows[k, first + f.DRIVING_POWER] = select(mobility > 0.0, torque * turning, driving)
    is_free = like(c[0, lf.FIRST_LAW + f.DRIVEN_MOBILITY], speed) > 0.0
    rows[k, first + f.LOAD_POWER] = select(is_free, rows[k, first + f.LOAD_POWER], -driven)
    stored = rows[k, first + f.STORED_ENERGY]
    stored += select(mobility > 0.0, 0.5 * turning * turning / mobility, 0.0)
    # both sheaves along the shaft: axial force in, thrust and spring out, the rest is the lag's
    damping = like(c[0, lf.AXIAL_DAMPING], speed)
    lag = damping * fma(rates[1], rates[1], rates[3] * rates[3])
    springs = (
        like(c[0, lf.FIRST_LAW + f.DRIVING_SPRING_RATE], speed) * shift,
        like(c[0, lf.FIRST_LAW + f.DRIVEN_SPRING_RATE], speed) * position,
    )
    thrust_power = fma(-damping, rates[1], axial[1] - springs[1]) * rates[1]
    thrust_power += fma(-damping, rates[3], axial[0] - springs[0]) * rates[3]
    rows[k, first + f.THRUST_POWER] = thrust_power
    stored += 0.5 * fma(springs[0], shift, springs[1] * position)
    for wrap in range(2):
        tilted = f.FIRST_STATE + (f.DRIVEN_COS if wrap else f.DRIVING_COS)
        give = like(c[0, lf.FIRST_LAW + (f.DRIVEN_TILT if wrap else f.DRIVING_TILT)], speed)
        free = like(c[0, lf.FIRST_LAW + (f.DRIVEN_FREE if wrap else f.DRIVING_FREE)], speed)
        one, other = scalars[0, tilted], scalars[0, tilted + 1]
        elastic, beside = beyond_clearance(one, other, free)
        stiffness = select(give > 0.0, 1.0 / give, 0.0)
        put_in, across = tilting[2 * wrap], tilting[2 * wrap + 1]
        opening, moving = rates[4 + 2 * wrap], rates[5 + 2 * wrap]
        lag += fma(fma(-stiffness, elastic, put_in), opening, fma(-stiffness, beside, across) * moving)
        # of the energy stored by closed stations: their gap is less by the opening
        stored += 0.5 * (
            stiffness * fma(elastic, elastic, beside * beside) - fma(put_in, one, across * other)
        )
    rows[k, first + f.LAG_LOSS] = lag
    rows[k, first + f.STORED_ENERGY] = stored
