"""What the laws of a step take from the motion, in lanes: losses, and what the step damps by itself.

As in the planar pushbelt (`models.pushbelt.power`, which derives it) a force takes its magnitude times the
mean rate (X + X_old) / 2 along its direction. Bending of the rings and the yaw spring damp nothing.
"""

from __future__ import annotations

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.lanes import around, like
from cvt_hpc.models.pushbelt import fields as planar
from cvt_hpc.models.pushbelt.border import book_openings, groove_of, of_pulley
from cvt_hpc.models.spatial_pushbelt import fields as f
from cvt_hpc.models.spatial_pushbelt.chain import mean_stretch
from cvt_hpc.models.spatial_pushbelt.flank import (
    along_arc,
    flank_directions,
    flank_point,
    lever_of,
    pulley_axis,
)
from cvt_hpc.models.spatial_pushbelt.rotations import (
    cross,
    dot,
    minus,
    moved,
    plus,
    vector,
    vector_ahead,
)
from cvt_hpc.models.spatial_pushbelt.saddle import ring_slip
from cvt_hpc.physics.contact_laws import damped

_FIRST, _COUNT = (
    planar.FLANK_LOSS,
    planar.TILT_DAMPED + 1 - planar.FLANK_LOSS,
)  # totals that are added up here


@kernel
def book_pairs(belt, state, work, dt):
    """Add to the totals what a solved step takes between elements and in the rings, before it is accepted."""
    elements, step, iterate, scratch = state.elements, work.step, work.iterate, work.scratch
    has_pins = belt.pin_clearance < np.inf
    contact = 0.5 * belt.contact_stiffness
    ring = tilt = drag = between = stretching = turning = like(0.0, elements[0, f.FLANK])
    for j in range(step.rows):
        du, dw = vector(elements, j, f.CHANGE), vector(elements, j, f.CHANGE + 3)
        ju, jw = vector_ahead(elements, j, f.CHANGE), vector_ahead(elements, j, f.CHANGE + 3)
        u, w = moved(vector(elements, j, f.SPEED), 0.5, du), moved(vector(elements, j, f.SPEED + 3), 0.5, dw)
        next_u = moved(vector_ahead(elements, j, f.SPEED), 0.5, ju)
        next_w = moved(vector_ahead(elements, j, f.SPEED + 3), 0.5, jw)
        stretch = mean_stretch(elements, step, j)
        stretching += step[j, f.TENSION_SLOPE] * stretch * stretch

        apart, more = minus(next_u, u), minus(ju, du)
        chord_i, chord_j = vector(step, j, f.CHORD_I), vector(step, j, f.CHORD_J)
        turn_i, turn_j = vector(step, j, f.TURN_I), vector(step, j, f.TURN_J)
        rate_i, rate_j = dot(chord_i, apart) + dot(turn_i, w), dot(chord_j, apart) + dot(turn_j, next_w)
        last_i = rate_i + 0.5 * (dot(chord_i, more) + dot(turn_i, dw))
        last_j = rate_j + 0.5 * (dot(chord_j, more) + dot(turn_j, jw))
        tilt += 0.5 * belt.angle_damping * (last_i * rate_i + last_j * rate_j)
        turning += 0.5 * dt * belt.angle_stiffness * (rate_i * rate_i + rate_j * rate_j)
        y = vector(step, j, f.YAW)
        yaw = dot(y, w) - elements[j, f.SPEED + 7] - 0.5 * elements[j, f.CHANGE + 7]
        last = yaw + 0.5 * (dot(y, dw) - elements[j, f.CHANGE + 7])
        tilt += belt.yaw_damping * yaw * last

        closing = dot(vector_ahead(elements, j, f.HEADING), apart)
        for p in range(f.POINTS):
            a, b = vector(step, j, f.PUSH_LEVER_I + 3 * p), vector(step, j, f.PUSH_LEVER_J + 3 * p)
            change = dt * (closing + dot(a, w) + dot(b, next_w))
            between += damped(iterate[j, f.PUSH_REACHED + p], change, contact)
        if has_pins:
            a, b = vector(step, j, f.PIN_LEVER_I), vector(step, j, f.PIN_LEVER_J)
            change = dt * (dot(vector(step, j, f.PIN_NORMAL), apart) - dot(a, w) + dot(b, next_w))
            between += damped(iterate[j, f.PIN_REACHED], change, belt.pin_stiffness)

        ring += elements[j, f.RING_FRICTION] * ring_slip(elements, step, j, 0.5)
        n_y, n_z = step[j, f.NORMAL], step[j, f.NORMAL + 1]
        across = n_y * u[0] + n_z * u[1]
        drag += belt.transverse_damping * across * (across + 0.5 * (n_y * du[0] + n_z * du[1]))
        drag += belt.lateral_damping * u[2] * (u[2] + 0.5 * du[2])
    for k in range(_COUNT):
        scratch[0, k] = 0.0
    scratch[0, planar.RING_LOSS - _FIRST] = dt * ring
    scratch[0, planar.DAMPING_LOSS - _FIRST], scratch[0, planar.BELT_LOSS - _FIRST] = dt * tilt, dt * drag
    scratch[0, planar.ELEMENT_DAMPED - _FIRST] = between
    scratch[0, planar.RING_DAMPED - _FIRST], scratch[0, planar.TILT_DAMPED - _FIRST] = (
        dt * stretching,
        dt * turning,
    )
    for k in range(_COUNT):
        scratch[0, k] = around(scratch[0, k])
        state.totals[_FIRST + k] += scratch.data[0, k, 0]


@kernel
def book_flanks(belt, state, work, dt):
    """Add to the totals what a solved step takes at the flanks, before it is accepted."""
    elements, step, iterate, scratch = state.elements, work.step, work.iterate, work.scratch
    driving_speed = state.pulleys[planar.DRIVING_SPEED]
    driven_speed = state.pulleys[planar.DRIVEN_SPEED] + 0.5 * state.increments[0]
    flank = sheaves = like(0.0, elements[0, f.FLANK])
    for j in range(step.rows):
        u = moved(vector(elements, j, f.SPEED), 0.5, vector(elements, j, f.CHANGE))
        w = moved(vector(elements, j, f.SPEED + 3), 0.5, vector(elements, j, f.CHANGE + 3))
        driven = elements[j, f.DRIVEN]
        axis = pulley_axis(belt, driven)
        rotation = of_pulley(driving_speed, driven_speed, driven)
        o = vector(elements, j, f.OUTWARD)
        a = cross(o, vector(elements, j, f.HEADING))
        # the groove opens where an element is, and is another where it gets to
        c, s = along_arc(belt, elements, j)
        opening, lean, bend = groove_of(belt, state, work, j, c, s, driven)
        for p in range(f.POINTS):
            side, height, width = flank_point(belt, p)
            lever = lever_of(o, a, side, height, width)
            n, m, t = flank_directions(belt, vector(step, j, f.RADIAL + 3 * p), axis, side)
            q = plus(u, cross(w, lever))
            around_it, radius = dot(t, q), step[j, f.MID_RADIUS + p]
            flank += elements[j, f.FLANK_FRICTION_M + p] * dot(m, q)
            flank += elements[j, f.FLANK_FRICTION_T + p] * (around_it - radius * rotation)
            angle = dt * around_it / radius
            change = dt * dot(n, q) + belt.cosine * (opening + angle * lean)
            sheaves += damped(iterate[j, f.FLANK_REACHED + p], change, 0.5 * belt.flank_stiffness)
            # an element presses at the step's end where it was at its start: modes lag by that angle
            sheaves += belt.cosine * elements[j, f.FLANK + p] * angle * angle * bend
    scratch[0, 0], scratch[0, 1] = around(dt * flank), around(sheaves)
    state.totals[planar.FLANK_LOSS] += scratch.data[0, 0, 0]
    state.totals[planar.FLANK_DAMPED] += scratch.data[0, 1, 0]
    book_openings(belt, state, work)
