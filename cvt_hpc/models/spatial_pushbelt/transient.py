"""A transient run of the spatial pushbelt: it starts from geometry, is clamped and loaded, and recorded.

Steps of the spatial pushbelt in time.

From q_k and X_{k-1/2} a step finds X_{k+1/2}. All directions are those at q_k. The magnitude of flanks along
the axis is that at q_{k+1} = q_k + dt X_{k+1/2}: implicit Euler along these directions, symplectic Euler for
what is slow. Tension and lateral bending of the rings, springs of pitch and yaw, flanks in the plane and
contacts between elements act at mean positions, which damps nothing (`pushbelt.chain.BETA`); rings and these
contacts have dampers of their own.
"""

from functools import partial

import numpy as np
from numba.extending import register_jitable

from cvt_hpc.kernels import called_alike, kernel
from cvt_hpc.lanes import absolute, ahead, around, like
from cvt_hpc.models.marched import batches_of_one
from cvt_hpc.models.pushbelt import fields as planar
from cvt_hpc.models.pushbelt import run
from cvt_hpc.models.pushbelt.belt import newton_of, of_lanes
from cvt_hpc.models.pushbelt.border import accept_border, of_pulley, set_shapes
from cvt_hpc.models.pushbelt.friction import filtered_slip
from cvt_hpc.models.pushbelt.ring_bending import set_bending
from cvt_hpc.models.pushbelt.run import COURSES, ElementRun
from cvt_hpc.models.pushbelt.stepping import Equations, advance_by
from cvt_hpc.models.spatial_pushbelt import assembly, flank, readings, two_flows
from cvt_hpc.models.spatial_pushbelt import fields as f
from cvt_hpc.models.spatial_pushbelt import vectors as vec
from cvt_hpc.models.spatial_pushbelt.assembly import bending_forces, predict_bending
from cvt_hpc.models.spatial_pushbelt.belt import NEWTON, NEWTON_OF_TWO_FLOWS, start, with_two_flows, workspace
from cvt_hpc.models.spatial_pushbelt.chain import chain_forces, link, predict, pull_across, saddle_forces
from cvt_hpc.models.spatial_pushbelt.faces import face_forces, predict_faces
from cvt_hpc.models.spatial_pushbelt.losses import book_flanks, book_pairs
from cvt_hpc.parameters import Parameters
from cvt_hpc.variator import LARGEST_DISPLACEMENT, STRANDS

CHANNELS = (*COURSES, *readings.SCALARS)
# Turned by this, the flanks of an element have moved by a quarter of its half width, and no saddle holds the
# rings. Elements of sound runs turn by 0.05 at most, also where the belt slips through.
_LARGEST_TURN = 0.25  # [1], sine


class Transient(ElementRun):
    """One run of the spatial pushbelt; parameters as of `ElementRun`.

    Displacement is in the plane at the probes of both strands, outwards, and then out of it at the same ones,
    to the right.
    """

    _contacts = f.CONTACTS
    _channels = CHANNELS
    _profiles = tuple(readings.PROFILES)
    _directions = (*STRANDS, *readings.LATERAL)
    _saddle = tuple(range(f.POSITION, f.POSITION + f.AXIAL))
    _speeds = (*range(f.SPEED, f.SPEED + f.AXIAL), f.OMEGA + f.AXIAL)

    def _begin(self, p: Parameters) -> None:
        flows = p["ring_flows"]
        self._advance = partial(called_alike(advance_by), EQUATIONS)
        self._belt, self._state = start(p)
        method = NEWTON
        if flows == 2:
            self._state, method = with_two_flows(self._belt, self._state), NEWTON_OF_TWO_FLOWS
            self._profiles = (*readings.PROFILES, *readings.OF_TWO_FLOWS)
        self._work = workspace(self._belt, p["elements"], flows)
        self._method = newton_of(p, method)

    def _inputs_along(self, sample: int) -> np.ndarray:
        still = np.zeros((2, f.INPUTS - f.IN_DRIVING_DRIFT))
        return np.column_stack([super()._inputs_along(sample), still])

    def _read(self) -> readings.Reading:
        return readings.Reading(self._readings, self._state)

    def _tilting_inertia(self) -> float:
        return self._belt.pitch_inertia

    def _out_of_place(self) -> str | None:
        """Reason why a sheave is at its stop, or an element is beyond all grooves; None where all is well."""
        elements = of_lanes(self._state.elements)
        lateral = np.abs(elements[:, f.POSITION + f.AXIAL])
        most = LARGEST_DISPLACEMENT * self.parameters["centre_distance"]
        most += 0.5 * abs(self.parameters["misalignment"])
        if (largest := lateral.max()) > most:
            element = int(lateral.argmax())
            return f"element {element} has left the grooves: it is {largest * 1e3:.3g} mm out of the plane"
        turned = np.abs(readings.angles(elements))
        if (largest := turned.max()) > _LARGEST_TURN:
            angle, element = np.unravel_index(turned.argmax(), turned.shape)
            found = np.arcsin(min(largest, 1.0))
            return f"element {element} has left the rings: its {readings.ANGLES[angle]} is {found:.3g} rad"
        return super()._out_of_place()

    def _stored_energy(self, found: readings.Reading) -> float:
        return found.stored_energy(self._state.openings, self._state.leans)


batch = batches_of_one(Transient)
forget = run.forget


@kernel
def _open_sheaves(belt, state, leans, step, shapes):
    """psi_k at the elements; the sheaves' leans go into the gaps."""
    modes = belt.modal_stiffness.shape[1]
    for j in range(step.rows):
        driven = state[j, f.DRIVEN]
        c, s = flank.along_arc(belt, state, j)
        set_shapes(belt, c, s, shapes, j)
        lean = like(0.0, c)
        for k in range(modes):
            lean = lean + of_pulley(leans[0, k], leans[1, k], driven) * shapes[j, k]
        lean = belt.cosine * lean
        for p in range(f.POINTS):
            step[j, f.FLANK_GAP + p] += lean if p >= f.RIGHT_LOW else -lean


@register_jitable
def _has_two_flows(elements):
    """Whether each ring package has a flow of its own."""
    return elements.data.shape[1] == f.WIDE_STATE_FIELDS


@kernel
def _prepare(belt, state, work, dt):
    """Values that all iterates of a step have in common: geometry, directions, linear laws."""
    elements, step = state.elements, work.step
    predict(belt, elements, state.pulleys, step, dt)
    link(belt, elements, step, dt)
    predict_bending(belt, elements, step)
    predict_faces(belt, elements, step, dt)
    flank.predict_flanks(belt, elements, state.pulleys, step, dt)
    set_bending(belt, state, work, f.POSITION, f.BENDING, f.BENT_Y, dt)
    _open_sheaves(belt, elements, state.leans, step, work.shapes)
    if _has_two_flows(elements):
        two_flows.predict_flows(belt, elements, step, dt)
    assembly.linear_blocks(belt, step, dt)


@kernel
def _evaluate(belt, state, work, load, dt):
    """Forces of the iterate, and the residuals that they leave; return the power residual [W]."""
    elements, step, iterate = state.elements, work.step, work.iterate
    increments, openings, shapes = state.increments, state.openings, work.shapes
    has_two_flows = _has_two_flows(elements)
    chain_forces(belt, elements, step, iterate, dt)
    bending_forces(belt, elements, step, iterate, dt)
    face_forces(belt, elements, step, iterate, dt)
    flank.bend_sheaves(belt, state, work, dt)
    flank.flank_forces(belt, elements, state.pulleys, increments, openings, shapes, step, iterate, dt)
    if has_two_flows:
        two_flows.difference_forces(elements, step, iterate)
        two_flows.saddle_forces_of_two(belt, elements, step, iterate)
    else:
        saddle_forces(belt, elements, step, iterate)
    power = assembly.residuals(belt, state, work, load, dt)
    if has_two_flows:
        power += two_flows.half_residuals(belt, elements, step, iterate, work.scratch, dt)
    return power


@kernel
def _assemble(belt, state, work, dt):
    """The linear system of the elements."""
    assembly.assemble_pairs(belt, state, work)
    flank.add_flank_blocks(belt, state, work, dt)
    if _has_two_flows(state.elements):
        two_flows.widen(belt, work.step, work.iterate, work.narrow, work.blocks, dt)


@kernel
def _close(belt, state, work, dt):
    """Close the system of the border."""
    if _has_two_flows(state.elements):
        two_flows.narrow_solutions(work.blocks, work.narrow)
    assembly.close_pairs(belt, state, work, dt)


@register_jitable
def _flank_change(kept, k, p):
    """Change of the force at a point of the flanks."""
    grip_m, grip_t = kept[k, f.FLANK_FRICTION_M + p], kept[k, f.FLANK_FRICTION_T + p]
    return np.sqrt(kept[k, f.FLANK + p] ** 2 + grip_m**2 + grip_t**2)


@kernel
def _changes(kept, k):
    """Changes of contact forces, of the element behind (k = 1) only of those to the next one."""
    own = 1.0 - k
    edges = kept[k, f.PUSH + f.EDGE_LEFT], kept[k, f.PUSH + f.EDGE_RIGHT]
    heads = kept[k, f.PUSH + f.HEAD_LEFT], kept[k, f.PUSH + f.HEAD_RIGHT]
    left = own * _flank_change(kept, k, f.LEFT_LOW), own * _flank_change(kept, k, f.LEFT_HIGH)
    right = own * _flank_change(kept, k, f.RIGHT_LOW), own * _flank_change(kept, k, f.RIGHT_HIGH)
    return *edges, *heads, kept[k, f.PIN], *left, *right, own * kept[k, f.RING_FRICTION]


@kernel
def _accept_elements(belt, state, work, dt):
    """Take the elements to the end of the step."""
    elements, step, iterate = state.elements, work.step, work.iterate
    per_dt, fall = 1.0 / dt, dt * belt.gravity
    for j in range(step.rows):
        x, o = vec.at(elements, j, f.HEADING), vec.at(elements, j, f.OUTWARD)
        outward = vec.cross(vec.at(step, j, f.RING_LINE), vec.cross(o, x))
        pull = pull_across(step, iterate, j, outward)
        d_y, d_z, d_x = vec.at(elements, j, f.CHANGE)
        across = per_dt * vec.dot(outward, (d_y, d_z + fall, d_x))
        elements[j, f.SADDLE] = absolute(belt.ring_mass * across - pull)
        elements[j, f.TENSION] = iterate[j, f.ITERATE_TENSION]
        elements[j, f.LENGTH] += dt * (elements[j, f.RING_SLIP] - ahead(elements, j, f.RING_SLIP))
        for r in range(f.SIZE):
            elements[j, f.SPEED + r] += elements[j, f.CHANGE + r]
        u, omega = vec.screw(elements, j, f.SPEED)
        vec.store(elements, j, f.POSITION, vec.moved(vec.at(elements, j, f.POSITION), dt, u))
        factors = vec.turning(omega, dt)
        x, o = vec.squared_up(vec.turned(x, omega, factors), vec.turned(o, omega, factors))
        vec.store(elements, j, f.HEADING, x)
        vec.store(elements, j, f.OUTWARD, o)
        elements[j, f.SLOPE] += dt * elements[j, f.SLOPE_RATE]
        for p in range(f.POINTS):
            along, around_it = elements[j, f.FLANK_SLIP_M + p], elements[j, f.FLANK_SLIP_T + p]
            filtered = elements[j, f.V_FILTERED + p]
            filtered = filtered_slip(belt, along, around_it, elements[j, f.FLANK + p], filtered, dt)
            elements[j, f.V_FILTERED + p] = filtered


@kernel
def _add_loads(belt, state, work):
    """Axial forces on the sheaves and torques on the pulleys, and how far sheaves would lean under them."""
    elements, step, scratch, loads = state.elements, work.step, work.scratch, state.loads
    modes = belt.modal_stiffness.shape[1]
    sums = loads.size + 2 * modes
    for k in range(sums):
        scratch[0, k] = 0.0
    for j in range(step.rows):
        driven = elements[j, f.DRIVEN]
        driving = 1.0 - driven
        for p in range(f.POINTS):
            side = p // 2
            axial = elements[j, f.FLANK + p] * belt.cosine + elements[j, f.FLANK_FRICTION_M + p] * belt.sine
            scratch[0, f.DRIVING_LEFT + side] += driving * axial
            scratch[0, f.DRIVEN_LEFT + side] += driven * axial
        torque = assembly.side_torque(elements, step, j, f.LEFT_LOW)
        torque = torque + assembly.side_torque(elements, step, j, f.RIGHT_LOW)
        scratch[0, f.DRIVING_TORQUE] += driving * torque
        scratch[0, f.DRIVEN_TORQUE] += driven * torque
        if modes > 0:
            low_left, high_left = elements[j, f.FLANK + f.LEFT_LOW], elements[j, f.FLANK + f.LEFT_HIGH]
            low_right, high_right = elements[j, f.FLANK + f.RIGHT_LOW], elements[j, f.FLANK + f.RIGHT_HIGH]
            lean = 0.5 * belt.cosine * ((low_right + high_right) - (low_left + high_left))
            for k in range(modes):
                scratch[0, loads.size + k] += driving * lean * work.shapes[j, k]
                scratch[0, loads.size + modes + k] += driven * lean * work.shapes[j, k]
    for k in range(sums):
        scratch[0, k] = around(scratch[0, k])
    for k in range(loads.size):
        loads[k] = scratch.data[0, k, 0]


@kernel
def _accept(belt, state, work, inputs, dt):
    """Take the state to the end of the step, and add up what it has done."""
    totals, pulleys, loads = state.totals, state.pulleys, state.loads
    if _has_two_flows(state.elements):
        two_flows.book_difference(belt, state, work, dt)
        two_flows.accept_difference(belt, state, work, dt)
    book_pairs(belt, state, work, dt)
    book_flanks(belt, state, work, dt)
    _accept_elements(belt, state, work, dt)
    _add_loads(belt, state, work)
    modes = belt.modal_stiffness.shape[1]
    follow = dt / belt.lean_lag
    for k in range(2 * modes):
        pulley, mode = k // modes, k % modes
        target = work.scratch.data[0, loads.size + k, 0] / belt.modal_stiffness[pulley, mode]
        state.leans[pulley, mode] += follow * (target - state.leans[pulley, mode])

    totals[planar.WORK_IN] -= dt * loads[f.DRIVING_TORQUE] * pulleys[planar.DRIVING_SPEED]
    accept_border(belt, state, work, inputs, dt)
    tangent = belt.sine / belt.cosine
    for pulley in range(2):
        left, right = loads[2 * pulley], loads[2 * pulley + 1]
        side = belt.loose_side[pulley]
        pressed = 0.5 * ((1.0 - side) * left + (1.0 + side) * right)  # on what moves
        excess = inputs[planar.IN_DRIVING_THRUST + pulley] - pressed
        if pulley == 0:
            closing = dt * (belt.driving_rate * excess + inputs[planar.IN_DRIVING_SHIFT])
        else:
            closing = dt * belt.driven_rate * excess
        drift = dt * inputs[f.IN_DRIVING_DRIFT + pulley]
        pulleys[planar.DRIVING_RADIUS + pulley] += closing
        pulleys[f.DRIVING_MIDDLE + pulley] += drift - side * tangent * closing
        totals[planar.THRUST_WORK] += (right - left) * drift - 2.0 * tangent * pressed * closing


EQUATIONS = Equations(_prepare, _evaluate, _assemble, _close, _accept, _changes, f.CHANGE)
advance = partial(advance_by, EQUATIONS)
