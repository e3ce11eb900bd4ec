"""The border of a belt's equations: unknowns that all elements share, of driven pulley and sheaves.

Sheaves of a pulley open by sum a_k psi_k(phi), psi 1, cos, sin, cos 2, sin 2, ..., each mode with a stiffness
of its own. Unknowns are the changes of the driven pulley's speed, and of a_k of the driving and of the driven
sheaves.
"""

from numba.extending import register_jitable

from cvt_hpc.kernels import kernel
from cvt_hpc.lanes import around, like
from cvt_hpc.models.pushbelt import fields as f


@register_jitable
def of_pulley(driving, driven_one, driven):
    """The one of two numbers that belongs to the pulley of an element."""
    return driving + driven * (driven_one - driving)


@register_jitable
def set_shapes(belt, c, s, shapes, j):
    """psi_k at an element, from cosine and sine of its angle about its pulley."""
    cosine, sine = like(1.0, c), like(0.0, c)
    for k in range(belt.modal_stiffness.shape[1]):
        if k % 2 == 1:
            cosine, sine = cosine * c - sine * s, sine * c + cosine * s
            shapes[j, k] = cosine
        elif k > 0:
            shapes[j, k] = sine
        else:
            shapes[j, k] = 1.0


@register_jitable
def add_to_totals(state, scratch, total, share):
    """Add what each part of the ring has to one of the totals."""
    scratch[0, 0] = around(share)
    state.totals[total] += scratch.data[0, 0, 0]


@kernel
def border_residuals(belt, increments, openings, load, torque, power, scratch, border, dt):
    """Set the last column of `border`; return the power residual of the belt [W].

    Parameters
    ----------
    torque, power : lanes
        Of the elements on the driven pulley [N m], and the power that the residuals of the elements leave
        open [W].
    scratch : LaneArray
        Its row holds the axial forces of the elements by the modes of both pulleys [N].
    """
    modes, last = belt.modal_stiffness.shape[1], border.shape[0]
    for k in range(2 * modes):
        scratch[0, k] = around(scratch[0, k])
        pulley, mode = k // modes, k % modes
        opening = openings[pulley, mode] + increments[1 + k]
        border[1 + k, last] = scratch.data[0, k, 0] - belt.modal_stiffness[pulley, mode] * opening
    scratch[0, 0], scratch[0, 1] = around(torque), around(power)
    border[0, last] = scratch.data[0, 0, 0] - load - belt.driven_inertia * increments[0] / dt
    return scratch.data[0, 1, 0]


@kernel
def close_border(belt, sums, border, dt):
    """Set the matrix of the border, and complete its right side, from sums over the elements.

    A row of `sums` for each unknown: the contribution of the elements' solutions without border, then by
    column.
    """
    unknowns, modes = border.shape[0], belt.modal_stiffness.shape[1]
    for row in range(unknowns):
        for column in range(unknowns + 1):
            place = (unknowns + 1) * row + column
            sums[0, place] = around(sums[0, place])
            found = sums.data[0, place, 0]
            if column == 0:
                border[row, unknowns] += found
            else:
                border[row, column - 1] = found
        if row == 0:
            border[row, row] += belt.driven_inertia / dt
        else:
            border[row, row] += belt.modal_stiffness[(row - 1) // modes, (row - 1) % modes]


@register_jitable
def groove_of(belt, state, work, j, c, s, driven):
    """How sheaves move at an element, from cosine and sine of its angle about its pulley.

    Returns
    -------
    lanes
        Mean opening of each within the step [m], and slope [m] and negative curvature [m] of the opening over
        that angle.
    """
    modes = belt.modal_stiffness.shape[1]
    opening, lean, bend = like(0.0, c), like(0.0, c), like(0.0, c)
    cosine, sine = like(1.0, c), like(0.0, c)
    for k in range(modes):
        order = 0.5 * (k + k % 2)
        if k % 2 == 1:
            cosine, sine = cosine * c - sine * s, sine * c + cosine * s
            slope = -order * sine
        else:
            slope = order * cosine
        open_ = of_pulley(state.openings[0, k], state.openings[1, k], driven)
        lean, bend = lean + open_ * slope, bend + open_ * order * order * work.shapes[j, k]
        driving = 0.5 * (state.increments[1 + k] + work.increments[1 + k])
        driven_one = 0.5 * (state.increments[1 + modes + k] + work.increments[1 + modes + k])
        opening = opening + of_pulley(driving, driven_one, driven) * work.shapes[j, k]
    return opening, lean, bend


@kernel
def book_openings(belt, state, work):
    """Add to the totals the numerical damping of the step by the modes of the sheaves (`power`)."""
    modes = belt.modal_stiffness.shape[1]
    for k in range(2 * modes):
        change = 0.5 * (state.increments[1 + k] + work.increments[1 + k])
        state.totals[f.FLANK_DAMPED] += 2.0 * belt.modal_stiffness[k // modes, k % modes] * change * change


@kernel
def accept_border(belt, state, inputs, dt):
    """Take driven pulley, sheaves and time to the end of the step."""
    modes = belt.modal_stiffness.shape[1]
    for k in range(2 * modes):
        state.openings[k // modes, k % modes] += state.increments[1 + k]
    state.pulleys[f.DRIVEN_SPEED] += state.increments[0]
    state.totals[f.TIME] += dt
    state.totals[f.WORK_OUT] += (
        dt * inputs[f.IN_LOAD] * (state.pulleys[f.DRIVEN_SPEED] - 0.5 * state.increments[0])
    )
