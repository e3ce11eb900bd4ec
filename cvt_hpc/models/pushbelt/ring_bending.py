"""Bending of the rings in the plane against leaving the path's curvature: of both pushbelts.

An element at r_j has a place p_j on the path: at its angle about the pulley, or at the foot of its
perpendicular on the strand. The segment to the next one has the angle a_j against p_{j+1} - p_j, read by its
sine. With the pitch h the curvature beyond that of the path is (a_j - a_{j-1}) / h, and the energy, of which
each force is the gradient,

    V = EI / (2 h) sum (a_j - a_{j-1})^2,     C_j = dV/da_j = EI / h (2 a_j - a_{j-1} - a_{j+1}):

couples of forces across the segments, and on arcs forces along the path, which turns beside a segment that
moves on. It is the energy of the elastic belt without `curvature_terms`, EI/2 int w''^2, w' being the belt's
angle against its path.

Forces act at q_k, which damps nothing. As such they would need a step below h^2 sqrt(m' / EI) / 2. So angles
are smoothed first, by (1 + b D^2)^-1 with D the second difference and b = EI dt^2 / (m' h^4). Then no wave
has a frequency above 1 / dt from bending, and the energy is that of the smoothed angles times the angles:
symmetric, and conserved as well. Of a wave that has the frequency w from bending, it leaves out (w dt)^2.
The inverse is the real part of A z^|n|, of the root z of 1 + b D^2 that decays.

A path that moves with its sheaves does work on the bent belt, which the balance of power leaves open.
"""

import numpy as np
from numba.extending import register_jitable

from cvt_hpc.kernels import kernel
from cvt_hpc.models.pushbelt import fields as f

# Columns of the work space: saddle point, place on the path and its rate by the saddle point along the path's
# running direction, direction of that; sine of a segment's angle, and the smoothed one
(Y, Z, PATH_Y, PATH_Z, RATE, ALONG_Y, ALONG_Z, ANGLE, SMOOTH) = range(9)
COLUMNS = 9


@register_jitable
def _place_on_path(belt, pulleys, work, k):
    """Set the place of an element on the path."""
    driving = pulleys[f.DRIVING_RADIUS] + belt.pitch_depth
    sine = (pulleys[f.DRIVEN_RADIUS] - pulleys[f.DRIVING_RADIUS]) / belt.centre_distance
    cosine, y, z = np.sqrt(1.0 - sine * sine), work[k, Y], work[k, Z]
    side = -1.0 if z < 0.0 else 1.0
    reach = cosine * y + side * sine * z
    if 0.0 < reach < cosine * belt.centre_distance:
        o_y, o_z = -sine, side * cosine
        away = driving - o_y * y - o_z * z
        work[k, PATH_Y], work[k, PATH_Z], work[k, RATE] = y + away * o_y, z + away * o_z, 1.0
    else:
        driven = y > 0.5 * belt.centre_distance
        centre = belt.centre_distance if driven else 0.0
        radius = pulleys[f.DRIVEN_RADIUS] + belt.pitch_depth if driven else driving
        distance = np.hypot(y - centre, z)
        o_y, o_z, work[k, RATE] = (y - centre) / distance, z / distance, radius / distance
        work[k, PATH_Y], work[k, PATH_Z] = centre + radius * o_y, radius * o_z
    work[k, ALONG_Y], work[k, ALONG_Z] = -o_z, o_y


@register_jitable
def _direction(work, k, beyond, first):
    """Direction from a point of an element to that of the next one, of columns from `first`; 1 / distance."""
    y, z = work[beyond, first] - work[k, first], work[beyond, first + 1] - work[k, first + 1]
    per_length = 1.0 / np.sqrt(y * y + z * z)
    return y * per_length, z * per_length, per_length


@register_jitable
def _smooth(work, share):
    """Set SMOOTH to (1 + share D^2)^-1 of ANGLE, around the ring."""
    count = work.shape[0]
    half = 1.0 + 0.5 / (1j * np.sqrt(share))
    root = np.sqrt(half * half - 1.0)
    z = 1.0 / (half + root)
    if abs(z) > 1.0:
        z = 1.0 / (half - root)
    size, once_around = (1.0 - z) / (1.0 + z), 1.0 / (1.0 - z**count)
    behind = ahead = 0j
    for k in range(count):
        behind = work[k, ANGLE] + z * behind
        ahead = work[count - 1 - k, ANGLE] + z * ahead
    behind, ahead = behind * once_around, ahead * once_around
    for k in range(count):
        behind = work[k, ANGLE] + z * behind
        work[k, SMOOTH] = (size * behind).real
    for back in range(count):
        k = count - 1 - back
        work[k, SMOOTH] += (size * z * ahead).real
        ahead = work[k, ANGLE] + z * ahead


@kernel
def bend_rings(belt, pulleys, places, forces, energy, work, dt):
    """Set forces of the rings' bending on the elements, (rows, 2, lanes) [N], and each segment's energy [J].

    `places` are saddle points in the plane, (rows, 2, lanes) [m]; element p rows + j stands in row j, lane p.
    The step is `dt` [s].
    """
    rows, count, stiffness = places.shape[0], work.shape[0], belt.bending_stiffness / belt.pitch
    for k in range(count):
        for axis in range(2):
            work[k, Y + axis] = places[k % rows, axis, k // rows]
            forces[k % rows, axis, k // rows] = 0.0
        _place_on_path(belt, pulleys, work, k)
    for k in range(count):
        e_y, e_z, _ = _direction(work, k, (k + 1) % count, Y)
        p_y, p_z, _ = _direction(work, k, (k + 1) % count, PATH_Y)
        work[k, ANGLE] = p_y * e_z - p_z * e_y
    _smooth(work, stiffness * (dt / belt.pitch) ** 2 / (belt.mass + belt.ring_mass))
    for k in range(count):
        beyond = (k + 1) % count
        e_y, e_z, per_length = _direction(work, k, beyond, Y)
        p_y, p_z, per_chord = _direction(work, k, beyond, PATH_Y)
        couple = stiffness * (2.0 * work[k, SMOOTH] - work[k - 1, SMOOTH] - work[beyond, SMOOTH])
        energy[k % rows, k // rows] = 0.5 * couple * work[k, ANGLE]
        couple *= p_y * e_y + p_z * e_z
        across = -couple * per_length * e_z, couple * per_length * e_y
        for end, sign in ((k, 1.0), (beyond, -1.0)):
            rising = p_y * work[end, ALONG_Z] - p_z * work[end, ALONG_Y]
            along = couple * per_chord * work[end, RATE] * rising
            for axis in range(2):
                force = across[axis] - along * work[end, ALONG_Y + axis]
                forces[end % rows, axis, end // rows] += sign * force


@kernel
def set_bending(belt, state, work, place, energy, force, dt):
    """Set the forces of a step, 0 without bending.

    `place` and `energy` are fields of an element, of the first coordinate of its saddle and of its segment's
    energy, and `force` is that of a step with the first component.
    """
    elements, step = state.elements, work.step
    if belt.bending_stiffness > 0.0:
        places, forces = elements.data[:, place : place + 2], step.data[:, force : force + 2]
        bend_rings(belt, state.pulleys, places, forces, elements.data[:, energy], work.bent, dt)
        return
    for j in range(step.rows):
        elements[j, energy] = 0.0
        for axis in range(2):
            step[j, force + axis] = 0.0
