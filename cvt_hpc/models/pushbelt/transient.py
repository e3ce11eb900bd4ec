"""A transient run of the planar pushbelt: it starts from geometry, is clamped and loaded, and recorded.

Steps of the planar pushbelt in time.

From q_k and X_{k-1/2} a step finds X_{k+1/2}. All directions are those at q_k. Rings, springs of tilt, flanks
and contacts between elements act at mean positions, which damps nothing (`chain.BETA`); rings and these
contacts have dampers of their own.

The nose of each element in the hole of the next one, in lanes: it holds neighbours side by side.

The nose's tip P lies at the front of element i, the hole's centre Q at the rear of element j, both
`nose_height` above the saddle. Their offset across the next element, (P - Q).o_j, is free up to the clearance
to either side; beyond, the hole pushes back elastically and without friction.

An offset grows by the speeds times (o_j, a, 0) of element i and (-o_j, b, 0) of j, a and b being levers.
"""

from functools import partial

import numpy as np
from numba.extending import register_jitable

from cvt_hpc.kernels import called_alike, kernel
from cvt_hpc.lanes import absolute, ahead, around, behind, maximum
from cvt_hpc.models.marched import batches_of_one
from cvt_hpc.models.pushbelt import assembly, run
from cvt_hpc.models.pushbelt import fields as f
from cvt_hpc.models.pushbelt.belt import NEWTON, of_lanes, outset, start, workspace
from cvt_hpc.models.pushbelt.border import (
    accept_border,
    book,
    book_weight,
    close_border,
    move_sheaves,
    set_shapes,
)
from cvt_hpc.models.pushbelt.chain import before_step, contact_shares, linear_blocks, link, predict, turned
from cvt_hpc.models.pushbelt.friction import filtered_slip
from cvt_hpc.models.pushbelt.readings import SCALARS, Reading
from cvt_hpc.models.pushbelt.ring_bending import set_bending
from cvt_hpc.models.pushbelt.run import COURSES, ElementRun
from cvt_hpc.models.pushbelt.stepping import Equations, advance_by
from cvt_hpc.parameters import Parameters
from cvt_hpc.physics.contact_laws import pressed

CHANNELS = (*COURSES, *SCALARS)


class Transient(ElementRun):
    """One run of the planar pushbelt; parameters as of `ElementRun`."""

    def _begin(self, p: Parameters) -> None:
        self._advance = partial(called_alike(advance_by), EQUATIONS)
        self._belt, self._state = start(outset(p))
        self._work = workspace(self._belt, p["elements"])
        self._method = NEWTON._replace(
            tolerance=p["speed_tolerance"],
            power_tolerance=p["power_tolerance"],
            most_iterations=p["most_iterations"],
        )

    def _read(self) -> Reading:
        return Reading(self._readings, self._elements(), self._state.pulleys)

    def _elements(self) -> np.ndarray:
        """Fields of the elements in the order of the belt, (n, fields)."""
        return of_lanes(self._state.elements)

    def _stored_energy(self, found: Reading) -> float:
        return found.stored_energy(self._state.openings)


batch = batches_of_one(Transient)
forget = run.forget


@kernel
def _prepare(belt, state, work, dt):
    """Values that all iterates of a step have in common: geometry, directions, linear laws."""
    elements, step = state.elements, work.step
    predict(belt, elements, state.pulleys, step, dt)
    link(belt, elements, step, dt)
    if belt.nose_clearance < np.inf:
        predict_noses(belt, elements, step, dt)
    linear_blocks(belt, step, dt)
    set_bending(belt, state, work, f.Y, f.BENDING, f.BENT_Y, dt)
    for j in range(step.rows):
        set_shapes(belt, step[j, f.R_Y], step[j, f.R_Z], work.shapes, j)
        if belt.local_compliance == 0.0:
            elements[j, f.SPREAD] = 0.0
        step[j, f.LAST_SPREAD] = elements[j, f.SPREAD]


@kernel
def _evaluate(belt, state, work, load, dt):
    """Forces of the iterate, and the residuals that they leave; return the power residual [W]."""
    elements, step, iterate, scratch = state.elements, work.step, work.iterate, work.scratch
    pulleys, increments, openings, shapes = state.pulleys, state.increments, state.openings, work.shapes
    assembly.pair_forces(belt, elements, step, iterate, dt)
    if belt.nose_clearance < np.inf:
        nose_forces(belt, elements, step, iterate, dt)
    assembly.flank_depths(belt, elements, increments, openings, shapes, step, iterate, work.bent, dt)
    assembly.element_forces(belt, elements, pulleys, increments, step, iterate, dt)
    changes = increments, work.increments
    return assembly.residuals(
        belt, elements, changes, openings, shapes, load, step, iterate, scratch, work.border, dt
    )


@kernel
def _assemble(belt, state, work, dt):
    """The linear system of the elements."""
    assembly.assemble(belt, state.elements, work.shapes, work.step, work.iterate, work.blocks)
    if belt.nose_clearance < np.inf:
        add_nose_blocks(state.elements, work.step, work.iterate, work.blocks)


@kernel
def _close(belt, state, work, dt):
    """Close the system of the border."""
    step, iterate, blocks = work.step, work.iterate, work.blocks
    assembly.border_sums(belt, state.elements, work.shapes, step, iterate, blocks, work.sums, dt)
    close_border(belt, work.sums, work.border, dt)


@kernel
def _changes(kept, k):
    """Changes of contact forces, of the element behind (k = 1) only of those to the next one."""
    own = 1.0 - k
    flank = kept[k, f.FLANK] ** 2 + kept[k, f.FLANK_FRICTION_M] ** 2 + kept[k, f.FLANK_FRICTION_T] ** 2
    return (
        kept[k, f.EDGE],
        kept[k, f.HEAD],
        own * np.sqrt(flank),
        own * kept[k, f.RING_FRICTION],
        kept[k, f.NOSE],
    )


@kernel
def _accept(belt, state, work, inputs, dt):
    """Advance the state to the end of the step, and add up the works."""
    elements, step, iterate, scratch = state.elements, work.step, work.iterate, work.scratch
    totals, pulleys = state.totals, state.pulleys
    book(belt, state, work, dt)
    if belt.gravity != 0.0:
        book_weight(belt, state, work, dt)
    for k in range(3):
        scratch[0, k] = 0.0
    per_dt, fall = 1.0 / dt, dt * belt.gravity
    for j in range(step.rows):
        t_y, t_z = step[j, f.T_Y], step[j, f.T_Z]
        ahead_of_it, tension = iterate[j, f.ITERATE_TENSION], behind(iterate, j, f.ITERATE_TENSION)
        pull = ahead_of_it * (t_z * step[j, f.TENSION_I_Y] - t_y * step[j, f.TENSION_I_Z])
        pull -= tension * (t_z * behind(step, j, f.TENSION_J_Y) - t_y * behind(step, j, f.TENSION_J_Z))
        pull += t_z * step[j, f.BENT_Y] - t_y * step[j, f.BENT_Z]
        across = per_dt * (t_z * elements[j, f.CHANGE_Y] - t_y * (elements[j, f.CHANGE_Z] + fall))
        elements[j, f.SADDLE] = absolute(belt.ring_mass * across - pull)
        elements[j, f.TENSION] = ahead_of_it
        elements[j, f.LENGTH] += dt * (elements[j, f.RING_SLIP] - ahead(elements, j, f.RING_SLIP))

        u_y, u_z = elements[j, f.U_Y] + elements[j, f.CHANGE_Y], elements[j, f.U_Z] + elements[j, f.CHANGE_Z]
        omega = elements[j, f.OMEGA] + elements[j, f.CHANGE_W]
        elements[j, f.U_Y], elements[j, f.U_Z], elements[j, f.OMEGA] = u_y, u_z, omega
        elements[j, f.V] += elements[j, f.CHANGE_V]
        elements[j, f.Y] += dt * u_y
        elements[j, f.Z] += dt * u_z
        x_y, x_z = turned(elements[j, f.HEADING_Y], elements[j, f.HEADING_Z], dt * omega)
        elements[j, f.HEADING_Y], elements[j, f.HEADING_Z] = x_y, x_z

        driven = elements[j, f.DRIVEN]
        thrust = elements[j, f.FLANK] * belt.cosine + elements[j, f.FLANK_FRICTION_M] * belt.sine
        scratch[0, 0] += (1.0 - driven) * thrust
        scratch[0, 1] += driven * thrust
        scratch[0, 2] += (1.0 - driven) * step[j, f.MID_RADIUS] * iterate[j, f.FORCE_T]
        slip_m, slip_t = elements[j, f.FLANK_SLIP_M], elements[j, f.FLANK_SLIP_T]
        filtered = filtered_slip(belt, slip_m, slip_t, elements[j, f.FLANK], elements[j, f.V_FILTERED], dt)
        elements[j, f.V_FILTERED] = filtered
    for k in range(3):
        scratch[0, k] = around(scratch[0, k])
    driving_thrust, driven_thrust = scratch.data[0, 0, 0], scratch.data[0, 1, 0]
    move_sheaves(belt, state, inputs, driving_thrust, driven_thrust, dt)
    totals[f.WORK_IN] += dt * scratch.data[0, 2, 0] * pulleys[f.DRIVING_SPEED]
    accept_border(belt, state, work, inputs, dt)


EQUATIONS = Equations(_prepare, _evaluate, _assemble, _close, _accept, _changes, f.CHANGE)
advance = partial(advance_by, EQUATIONS)


@register_jitable
def _offset(ri, xi, rj, xj, thickness, height):
    """(P - Q) along o_j and x_j [m]."""
    d_y = ri[0] - rj[0] + 0.5 * thickness * (xi[0] + xj[0]) + height * (xi[1] - xj[1])
    d_z = ri[1] - rj[1] + 0.5 * thickness * (xi[1] + xj[1]) - height * (xi[0] - xj[0])
    return d_y * xj[1] - d_z * xj[0], d_y * xj[0] + d_z * xj[1]


@kernel
def predict_noses(belt, state, step, dt):
    """Offsets by which noses press at the old speeds, and levers at q_k."""
    thickness, height = belt.thickness, belt.nose_height
    ahead_share, share, behind_share = contact_shares(belt, dt)
    for j in range(state.rows):
        ri, rj = (state[j, f.Y], state[j, f.Z]), (ahead(state, j, f.Y), ahead(state, j, f.Z))
        xi = (state[j, f.HEADING_Y], state[j, f.HEADING_Z])
        xj = (ahead(state, j, f.HEADING_Y), ahead(state, j, f.HEADING_Z))
        now, along = _offset(ri, xi, rj, xj, thickness, height)
        cosine, sine = xi[0] * xj[0] + xi[1] * xj[1], xi[0] * xj[1] - xi[1] * xj[0]
        step[j, f.NOSE_LEVER_I] = height * sine - 0.5 * thickness * cosine
        step[j, f.NOSE_LEVER_J] = along - 0.5 * thickness
        si = (step[j, f.PREDICTED_Y], step[j, f.PREDICTED_Z])
        sj = (ahead(step, j, f.PREDICTED_Y), ahead(step, j, f.PREDICTED_Z))
        zi = (step[j, f.PREDICTED_HEADING_Y], step[j, f.PREDICTED_HEADING_Z])
        zj = (ahead(step, j, f.PREDICTED_HEADING_Y), ahead(step, j, f.PREDICTED_HEADING_Z))
        reached, _ = _offset(si, zi, sj, zj, thickness, height)
        bi, yi = before_step(ri, xi, (state[j, f.U_Y], state[j, f.U_Z], state[j, f.OMEGA]), dt)
        speeds = ahead(state, j, f.U_Y), ahead(state, j, f.U_Z), ahead(state, j, f.OMEGA)
        bj, yj = before_step(rj, xj, speeds, dt)
        before, _ = _offset(bi, yi, bj, yj, thickness, height)
        step[j, f.NOSE_OFFSET] = ahead_share * reached + share * now + behind_share * before
        step[j, f.NOSE_MEAN] = 0.5 * (reached + now)


@kernel
def nose_forces(belt, state, step, iterate, dt):
    """Forces that take the offsets back, signed as these, and their increase by the offsets' rates."""
    stiffness, clearance = belt.nose_stiffness, belt.nose_clearance
    ahead_share, _, _ = contact_shares(belt, dt)
    pressing = ahead_share * dt
    for j in range(step.rows):
        x_y, x_z = ahead(state, j, f.HEADING_Y), ahead(state, j, f.HEADING_Z)
        y = state[j, f.CHANGE_Y] - ahead(state, j, f.CHANGE_Y)
        z = state[j, f.CHANGE_Z] - ahead(state, j, f.CHANGE_Z)
        rate = x_z * y - x_y * z + step[j, f.NOSE_LEVER_I] * state[j, f.CHANGE_W]
        offset = step[j, f.NOSE_OFFSET] + pressing * (
            rate + step[j, f.NOSE_LEVER_J] * ahead(state, j, f.CHANGE_W)
        )
        above, k = pressed(clearance - offset, stiffness)
        below, m = pressed(clearance + offset, stiffness)
        state[j, f.NOSE], iterate[j, f.NOSE_SLOPE] = above - below, pressing * maximum(k, m)
        iterate[j, f.NOSE_REACHED] = offset


@kernel
def add_nose_blocks(state, step, iterate, blocks):
    """Add the slopes to the blocks of both elements, as `assembly.assemble` has left them."""
    for j in range(step.rows):
        o_y, o_z = ahead(state, j, f.HEADING_Z), -ahead(state, j, f.HEADING_Y)
        k, a, b = iterate[j, f.NOSE_SLOPE], step[j, f.NOSE_LEVER_I], step[j, f.NOSE_LEVER_J]
        yy, yz, zz = k * o_y * o_y, k * o_y * o_z, k * o_z * o_z
        yw, zw, ww = k * o_y * a, k * o_z * a, k * a * a
        blocks[j, f.LINKED + f.YY] -= yy
        blocks[j, f.LINKED + f.ZY] -= yz
        blocks[j, f.LINKED + f.WY] -= yw
        blocks[j, f.LINKED + f.YZ] -= yz
        blocks[j, f.LINKED + f.ZZ] -= zz
        blocks[j, f.LINKED + f.WZ] -= zw
        blocks[j, f.LINKED + f.YW] += k * o_y * b
        blocks[j, f.LINKED + f.ZW] += k * o_z * b
        blocks[j, f.LINKED + f.WW] += k * a * b

        o_y, o_z = state[j, f.HEADING_Z], -state[j, f.HEADING_Y]
        k, b = behind(iterate, j, f.NOSE_SLOPE), behind(step, j, f.NOSE_LEVER_J)
        yy, yz, zz = yy + k * o_y * o_y, yz + k * o_y * o_z, zz + k * o_z * o_z
        yw, zw, ww = yw - k * o_y * b, zw - k * o_z * b, ww + k * b * b
        blocks[j, f.YY] += yy
        blocks[j, f.ZY] += yz
        blocks[j, f.WY] += yw
        blocks[j, f.YZ] += yz
        blocks[j, f.ZZ] += zz
        blocks[j, f.WZ] += zw
        blocks[j, f.YW] += yw
        blocks[j, f.ZW] += zw
        blocks[j, f.WW] += ww
