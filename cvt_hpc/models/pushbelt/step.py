"""Steps of the planar pushbelt in time.

From q_k and X_{k-1/2} a step finds X_{k+1/2}. The magnitudes of stiff laws are those at q_{k+1} = q_k +
dt X_{k+1/2} and all directions those at q_k: implicit Euler along the direction of each law, symplectic Euler
for slow motion.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.lanes import absolute, ahead, around, behind
from cvt_hpc.models.pushbelt.assembly import (
    assemble,
    border_sums,
    element_forces,
    pair_forces,
    residuals,
)
from cvt_hpc.models.pushbelt.belt import (
    CHANGE,
    DRIVEN,
    DRIVEN_RADIUS,
    DRIVING_RADIUS,
    DRIVING_SPEED,
    EDGE,
    FLANK,
    FLANK_FRICTION_M,
    FLANK_FRICTION_T,
    FLANK_SLIP_M,
    FLANK_SLIP_T,
    FORCE_T,
    HEAD,
    HEADING_Y,
    HEADING_Z,
    IN_DRIVEN_THRUST,
    IN_DRIVING_SHIFT,
    IN_DRIVING_THRUST,
    ITERATE_TENSION,
    LENGTH,
    MID_RADIUS,
    NOSE,
    OMEGA,
    R_Y,
    R_Z,
    RING_FRICTION,
    RING_SLIP,
    SADDLE,
    T_Y,
    T_Z,
    TENSION,
    TENSION_I_Y,
    TENSION_I_Z,
    TENSION_J_Y,
    TENSION_J_Z,
    THRUST_WORK,
    U_Y,
    U_Z,
    V_FILTERED,
    WORK_IN,
    V,
    Y,
    Z,
)
from cvt_hpc.models.pushbelt.border import accept_border, close_border, set_shapes
from cvt_hpc.models.pushbelt.chain import linear_blocks, link, predict, turned
from cvt_hpc.models.pushbelt.friction import filtered_slip
from cvt_hpc.models.pushbelt.nose import add_nose_blocks, nose_forces, predict_noses
from cvt_hpc.models.pushbelt.power import book
from cvt_hpc.models.pushbelt.stepping import Equations, advance_by


@kernel
def _prepare(belt, state, work, dt):
    """Values that all iterates of a step have in common: geometry, directions, linear laws."""
    predict(belt, state.elements, state.pulleys, work.step, dt)
    link(belt, state.elements, work.step, dt)
    if belt.nose_clearance < np.inf:
        predict_noses(belt, state.elements, work.step)
    linear_blocks(belt, work.step, dt)
    for j in range(work.step.rows):
        set_shapes(belt, work.step[j, R_Y], work.step[j, R_Z], work.shapes, j)


@kernel
def _evaluate(belt, state, work, load, dt):
    """Forces of the iterate, and the residuals that they leave; return the power residual [W]."""
    elements, step, iterate = state.elements, work.step, work.iterate
    pulleys, increments, openings, shapes = state.pulleys, state.increments, state.openings, work.shapes
    pair_forces(belt, elements, step, iterate, dt)
    if belt.nose_clearance < np.inf:
        nose_forces(belt, elements, step, iterate, dt)
    element_forces(belt, elements, pulleys, increments, openings, shapes, step, iterate, dt)
    return residuals(
        belt,
        elements,
        pulleys,
        increments,
        openings,
        shapes,
        load,
        step,
        iterate,
        work.scratch,
        work.border,
        dt,
    )


@kernel
def _assemble(belt, state, work, dt):
    """The linear system of the elements."""
    assemble(belt, state.elements, work.shapes, work.step, work.iterate, work.blocks)
    if belt.nose_clearance < np.inf:
        add_nose_blocks(state.elements, work.step, work.iterate, work.blocks)


@kernel
def _close(belt, state, work, dt):
    """That of the border."""
    border_sums(belt, state.elements, work.shapes, work.step, work.iterate, work.blocks, work.sums, dt)
    close_border(belt, work.sums, work.border, dt)


@kernel
def _changes(kept, k):
    """Changes of contact forces, of the element behind (k = 1) only of those to the next one."""
    own = 1.0 - k
    flank = kept[k, FLANK] ** 2 + kept[k, FLANK_FRICTION_M] ** 2 + kept[k, FLANK_FRICTION_T] ** 2
    return (
        kept[k, EDGE],
        kept[k, HEAD],
        own * np.sqrt(flank),
        own * kept[k, RING_FRICTION],
        kept[k, NOSE],
    )


@kernel
def _accept(belt, state, work, inputs, dt):
    """Advance the state to the end of the step, and add up the works."""
    elements, step, iterate, scratch = state.elements, work.step, work.iterate, work.scratch
    totals, pulleys = state.totals, state.pulleys
    book(belt, state, work, dt)
    for k in range(3):
        scratch[0, k] = 0.0
    per_dt = 1.0 / dt
    for j in range(step.rows):
        t_y, t_z = step[j, T_Y], step[j, T_Z]
        ahead_of_it, tension = iterate[j, ITERATE_TENSION], behind(iterate, j, ITERATE_TENSION)
        pull = ahead_of_it * (t_z * step[j, TENSION_I_Y] - t_y * step[j, TENSION_I_Z])
        pull -= tension * (t_z * behind(step, j, TENSION_J_Y) - t_y * behind(step, j, TENSION_J_Z))
        across = per_dt * (t_z * elements[j, CHANGE] - t_y * elements[j, CHANGE + 1])
        elements[j, SADDLE] = absolute(belt.ring_mass * across - pull)
        elements[j, TENSION] = ahead_of_it
        elements[j, LENGTH] += dt * (elements[j, RING_SLIP] - ahead(elements, j, RING_SLIP))

        u_y, u_z = elements[j, U_Y] + elements[j, CHANGE], elements[j, U_Z] + elements[j, CHANGE + 1]
        omega = elements[j, OMEGA] + elements[j, CHANGE + 2]
        elements[j, U_Y], elements[j, U_Z], elements[j, OMEGA] = u_y, u_z, omega
        elements[j, V] += elements[j, CHANGE + 3]
        elements[j, Y] += dt * u_y
        elements[j, Z] += dt * u_z
        x_y, x_z = turned(elements[j, HEADING_Y], elements[j, HEADING_Z], dt * omega)
        elements[j, HEADING_Y], elements[j, HEADING_Z] = x_y, x_z

        driven = elements[j, DRIVEN]
        thrust = elements[j, FLANK] * belt.cosine + elements[j, FLANK_FRICTION_M] * belt.sine
        scratch[0, 0] += (1.0 - driven) * thrust
        scratch[0, 1] += driven * thrust
        scratch[0, 2] += (1.0 - driven) * step[j, MID_RADIUS] * iterate[j, FORCE_T]
        slip_m, slip_t = elements[j, FLANK_SLIP_M], elements[j, FLANK_SLIP_T]
        filtered = filtered_slip(belt, slip_m, slip_t, elements[j, FLANK], elements[j, V_FILTERED], dt)
        elements[j, V_FILTERED] = filtered
    for k in range(3):
        scratch[0, k] = around(scratch[0, k])
    driving_thrust, driven_thrust = scratch.data[0, 0, 0], scratch.data[0, 1, 0]
    driving = dt * belt.driving_rate * (inputs[IN_DRIVING_THRUST] - driving_thrust)
    driving += dt * inputs[IN_DRIVING_SHIFT]
    driven = dt * belt.driven_rate * (inputs[IN_DRIVEN_THRUST] - driven_thrust)
    pulleys[DRIVING_RADIUS] += driving
    pulleys[DRIVEN_RADIUS] += driven
    totals[WORK_IN] += dt * scratch.data[0, 2, 0] * pulleys[DRIVING_SPEED]
    accept_border(belt, state, inputs, dt)
    # both sheaves of a pulley close by the tangent of the wedge angle
    closing = 2.0 * belt.sine / belt.cosine
    totals[THRUST_WORK] -= closing * (driving_thrust * driving + driven_thrust * driven)


EQUATIONS = Equations(_prepare, _evaluate, _assemble, _close, _accept, _changes, CHANGE)
advance = partial(advance_by, EQUATIONS)
