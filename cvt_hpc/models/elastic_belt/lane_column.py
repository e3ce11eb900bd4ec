"""The column of pressed elements in lanes: the functions of `column.py` for one run."""

from cvt_hpc.kernels import kernel, merged_kernel
from cvt_hpc.lanes import LaneArray, ahead, behind, fma, like, minimum, select
from cvt_hpc.models.elastic_belt import fields as f
from cvt_hpc.models.elastic_belt import lane_fields as lf
from cvt_hpc.models.elastic_belt.column import rocking_column
from cvt_hpc.models.elastic_belt.lane_belt import LaneBelt, LaneState


@merged_kernel
def curving(belt: LaneBelt, array: LaneArray, j: int, field: int):
    """Second derivative of a field at station j, and where curvature terms count kappa^2 times the field."""
    here = array[j, field]
    rise = (ahead(array, j, field) - here) * belt.per_cell[j]
    rise -= (here - behind(array, j, field)) * behind(belt.per_cell, j, 0)
    return fma(rise, belt.per_dual[j], belt.squared_curvature[j] * here)


@kernel
def lane_column(belt: LaneBelt, state: LaneState, stations: LaneArray, strain: int) -> None:
    """Push and moment of the column by the present displacements and strains, into `state.column`.

    `strain` is the stations' field that holds those of the elements.
    """
    fields, column, c = state.fields, state.column, belt.constants
    stiffness, bending = c[0, lf.ELEMENT_STIFFNESS], c[0, lf.COLUMN_STIFFNESS]
    outer, inner = c[0, lf.OUTER_EDGE], c[0, lf.INNER_EDGE]
    n, half_a_cell = fields.rows, like(0.5, outer)
    for j in range(n):
        column[j, lf.DEVIATION] = -curving(belt, fields, j, f.W)
    for j in range(n):
        kappa = belt.curvature[j]
        eps = fma(inner, kappa, stations[j, strain])
        near, give, turn, moment = rocking_column(
            eps, column[j, lf.DEVIATION] + kappa, stiffness, bending, outer, inner
        )
        far, give_far, turn_far, moment_far = rocking_column(
            eps, ahead(column, j, lf.DEVIATION) + kappa, stiffness, bending, outer, inner
        )
        pushed, pushed_far = minimum(near, 0.0), minimum(far, 0.0)
        closed = 0.5 * (pushed + pushed_far)
        pressed = closed < 0.0
        # where nothing is pressed both halves come to rest on each other; else those that are
        part = select(pressed & (near >= 0.0), 0.0, half_a_cell)
        part_far = select(pressed & (far >= 0.0), 0.0, half_a_cell)
        column[j, lf.PRESSED] = select(pressed, closed, minimum(near, far))
        column[j, lf.GIVE] = fma(part, give, part_far * give_far)
        column[j, lf.TURN_NEAR], column[j, lf.TURN_FAR] = part * turn, part_far * turn_far
        half = (0.5 * belt.cell[j]) * (fields[j, f.N_ELEMENT] + 1.0)
        column[j, lf.BEARING_NEAR], column[j, lf.BEARING_FAR] = half * moment, half * moment_far
        bent = fma(moment, moment, moment_far * moment_far) / bending
        column[j, lf.COLUMN_ENERGY] = 0.5 * fma(stiffness, fma(pushed, pushed, pushed_far * pushed_far), bent)
    for j in range(n):
        borne = behind(column, j, lf.BEARING_FAR) + column[j, lf.BEARING_NEAR]
        column[j, lf.COLUMN_MOMENT] = borne * belt.per_dual[j]


@kernel
def foresee_column(belt: LaneBelt, state: LaneState, stations: LaneArray, push: int, step: float) -> None:
    """Change of -P / EA by the turning of the belt within a step, into SHIFT.

    With the transverse velocities at its end without the part due to the layers' speeds, whose increments
    stand in field `push` of the stations, and with the contacts between elements at its beginning.
    """
    column = state.column
    for j in range(state.fields.rows):
        column[j, lf.TURNING] = -step * (
            curving(belt, state.fields, j, f.U) + curving(belt, stations, j, push)
        )
    for j in range(state.fields.rows):
        far = column[j, lf.TURN_FAR] * ahead(column, j, lf.TURNING)
        column[j, lf.SHIFT] = fma(column[j, lf.TURN_NEAR], column[j, lf.TURNING], far)


@merged_kernel
def across_by_curvature(belt: LaneBelt, state: LaneState, j: int, bending, belt_speed, masses):
    """Line force across the belt that the path's curvature adds at station j [N/m].

    The load of a belt that is straight at rest, and the centripetal force of the layers' own speeds less that
    of the belt speed. `bending` is EI [N m^2], `masses` those of elements and rings [kg/m].
    """
    element_mass, ring_mass = masses
    v0, v1 = state.fields[j, f.V_ELEMENT], state.fields[j, f.V_RING]
    faster = fma(element_mass * v0, fma(2.0, belt_speed, v0), ring_mass * v1 * fma(2.0, belt_speed, v1))
    return fma(belt.ring_curvature[j], faster, bending * belt.bending_load[j])


@merged_kernel
def column_across(belt: LaneBelt, state: LaneState, j: int):
    """Line force of the column's moment across the belt at station j, outwards [N/m]."""
    return -curving(belt, state.column, j, lf.COLUMN_MOMENT)
