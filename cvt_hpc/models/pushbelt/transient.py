"""A transient run of the planar pushbelt: it starts from geometry, is clamped and loaded, and recorded.

Steps of the planar pushbelt in time.

From q_k and X_{k-1/2} a step finds X_{k+1/2}. All directions are those at q_k. Rings, springs of tilt, flanks
and contacts between elements act at mean positions, which damps nothing (`chain.BETA`); rings and these
contacts have dampers of their own.
"""

from functools import partial

import numpy as np

from cvt_hpc.kernels import called_alike, kernel
from cvt_hpc.lanes import absolute, ahead, around, behind
from cvt_hpc.models.marched import batches_of_one
from cvt_hpc.models.pushbelt import assembly, run
from cvt_hpc.models.pushbelt import fields as f
from cvt_hpc.models.pushbelt.belt import NEWTON, newton_of, of_lanes, outset, start, workspace
from cvt_hpc.models.pushbelt.border import (
    accept_border,
    book,
    move_sheaves,
    set_shapes,
)
from cvt_hpc.models.pushbelt.chain import linear_blocks, link, predict, turned
from cvt_hpc.models.pushbelt.friction import filtered_slip
from cvt_hpc.models.pushbelt.readings import SCALARS, Reading
from cvt_hpc.models.pushbelt.ring_bending import set_bending
from cvt_hpc.models.pushbelt.run import COURSES, ElementRun
from cvt_hpc.models.pushbelt.stepping import Equations, advance_by
from cvt_hpc.parameters import Parameters

CHANNELS = (*COURSES, *SCALARS)


class Transient(ElementRun):
    """One run of the planar pushbelt; parameters as of `ElementRun`."""

    def _begin(self, p: Parameters) -> None:
        self._advance = partial(called_alike(advance_by), EQUATIONS)
        self._belt, self._state = start(outset(p))
        self._work = workspace(self._belt, p["elements"])
        self._method = newton_of(p, NEWTON)

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
    assembly.pair_forces(belt, state, work, dt)
    assembly.flank_depths(belt, state, work, dt)
    assembly.element_forces(belt, state, work, dt)
    return assembly.residuals(belt, state, work, load, dt)


@kernel
def _changes(kept, k):
    """Changes of contact forces, of the element behind (k = 1) only of those to the next one."""
    own = 1.0 - k
    flank = kept[k, f.FLANK] ** 2 + kept[k, f.FLANK_FRICTION_M] ** 2 + kept[k, f.FLANK_FRICTION_T] ** 2
    flank, ring = own * np.sqrt(flank), own * kept[k, f.RING_FRICTION]
    return kept[k, f.EDGE], kept[k, f.HEAD], flank, ring, kept[k, f.NOSE]


@kernel
def _accept(belt, state, work, inputs, dt):
    """Advance the state to the end of the step, and add up the works."""
    elements, step, iterate, scratch = state.elements, work.step, work.iterate, work.scratch
    totals, pulleys = state.totals, state.pulleys
    book(belt, state, work, dt)
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


EQUATIONS = Equations(_prepare, _evaluate, assembly.assemble, assembly.close, _accept, _changes, f.CHANGE)
advance = partial(advance_by, EQUATIONS)
