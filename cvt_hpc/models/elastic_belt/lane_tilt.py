"""Tilt of the elements in lanes: the functions of `column.py` for one run."""

from cvt_hpc.kernels import kernel, merged_kernel
from cvt_hpc.lanes import LaneArray, anywhere, behind, fma, like
from cvt_hpc.models.elastic_belt import fields as f
from cvt_hpc.models.elastic_belt import lane_fields as lf
from cvt_hpc.models.elastic_belt import lane_forces as forces
from cvt_hpc.models.elastic_belt.column import tilted_sliding
from cvt_hpc.models.elastic_belt.lane_belt import LaneBelt, LaneState
from cvt_hpc.physics.friction import saturation


@merged_kernel
def tilt_damping(belt: LaneBelt, step: float):
    """Force at a saddle by its speed [N s/m^2]: of the damper, and of the spring at the end of a step [s]."""
    c = belt.constants
    lever = c[0, lf.RING_OFFSET]
    return fma(step, c[0, lf.TILT_SPRING], c[0, lf.TILT_DAMPER]) / (lever * lever)


@merged_kernel
def tilted_saddle(belt: LaneBelt, state: LaneState, j: int, free, grip, step: float):
    """Sliding of the saddle at station j [m/s], as of `tilted_sliding`, the spring's at a step's end."""
    c = belt.constants
    held = c[0, lf.TILT_SPRING] * state.tilt[j, lf.ANGLE] / c[0, lf.RING_OFFSET]
    return tilted_sliding(free, held, grip, tilt_damping(belt, step), 1.0 / c[0, lf.RING_FRICTION_SPEED])


@kernel
def lane_tilt(belt: LaneBelt, state: LaneState, stations: LaneArray, step: float) -> None:
    """Sliding of the saddles, and their friction DRAG, of elements that tilt; RING_FACTOR and SADDLE anew.

    `step` is that at whose end the tilt's spring acts [s]; 0: as the state is.
    """
    c, tilt = belt.constants, state.tilt
    ring_stiffness, offset, friction = c[0, lf.RING_STIFFNESS], c[0, lf.RING_OFFSET], c[0, lf.RING_FRICTION]
    share = forces.lane_speed_share(belt, state.time[0], offset)
    relief = c[0, lf.RING_RELIEF] * share * share
    per_width, zero = 1.0 / c[0, lf.RING_FRICTION_SPEED], like(0.0, offset)
    for j in range(tilt.rows):
        tilt[j, lf.DRAG] = tilt[j, lf.DRAG_SLOPE] = zero
        if anywhere(belt.arc_curvature[j] > 0.0):
            longer = fma(offset, belt.ring_curvature[j], 1.0)
            left, right = behind(stations, j, lf.EPS_1), stations[j, lf.EPS_1]
            grip = forces.ring_grip(
                belt, j, ring_stiffness * left, ring_stiffness * right, relief * longer, friction
            )
            saddle = tilted_saddle(belt, state, j, stations[j, lf.SADDLE], grip, step)
            factor, _ = saturation(saddle, per_width)
            stations[j, lf.SADDLE], stations[j, lf.RING_FACTOR] = saddle, factor
            tilt[j, lf.DRAG] = grip * factor


@kernel
def follow_layers(belt: LaneBelt, state: LaneState, stations: LaneArray) -> None:
    """Friction of the saddles with the increments DV_0, DV_1 of the layers' speeds."""
    offset, tilt = belt.constants[0, lf.RING_OFFSET], state.tilt
    for j in range(tilt.rows):
        change = fma(fma(offset, belt.arc_curvature[j], 1.0), stations[j, lf.DV_0], -stations[j, lf.DV_1])
        tilt[j, lf.DRAG] = fma(tilt[j, lf.DRAG_SLOPE], change, tilt[j, lf.DRAG])


@kernel
def turn_elements(belt: LaneBelt, state: LaneState, step: float) -> None:
    """Rate TURN of the tilt under the friction DRAG, with the spring at a step's end as of `lane_tilt`."""
    c, tilt = belt.constants, state.tilt
    lever = c[0, lf.RING_OFFSET]
    mobility, spring = 1.0 / (lever * tilt_damping(belt, step)), c[0, lf.TILT_SPRING] / lever
    for j in range(tilt.rows):
        tilt[j, lf.TURN] = -mobility * fma(spring, tilt[j, lf.ANGLE], tilt[j, lf.DRAG])


@kernel
def carry_tilt(belt: LaneBelt, state: LaneState, step: float) -> None:
    """Tilt carried with the elements over a step, by their speeds as they are."""
    tilt = state.tilt
    belt_speed = forces.lane_belt_speed(belt, state.time[0])
    last = behind(tilt, 0, lf.ANGLE)
    for j in range(tilt.rows - 1, -1, -1):
        angle = tilt[j, lf.ANGLE]
        before = tilt[j - 1, lf.ANGLE] if j > 0 else last
        speed = belt_speed + state.fields[j, f.V_ELEMENT]
        tilt[j, lf.ANGLE] = fma(speed * (before - angle), step * behind(belt.per_cell, j, 0), angle)


@kernel
def add_turn(state: LaneState, step: float) -> None:
    """Tilt by its rate TURN over a step."""
    tilt = state.tilt
    for j in range(tilt.rows):
        tilt[j, lf.ANGLE] = fma(step, tilt[j, lf.TURN], tilt[j, lf.ANGLE])
