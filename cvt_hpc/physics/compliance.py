"""Elastic sheaves under the belt: the unilateral contact of one wrap, solved exactly in linear time.

Stations j of a wrap carry axial line forces f_j [N/m] and leave gaps g_j [m] (Bullinger et al. 2005, eqs
33-35):

    g_j = G_j + f_j / c_e + a (b y_j + U_j . t),   f_j >= 0,  g_j >= 0,  f_j g_j = 0,

G_j the gap of the rigid bodies (negative: overlap), c_e the axial stiffness of the elements per length, a the
compliance of the sheaves as a whole and b that of their discs (1 reference, 0 rigid), y the local bending and
t the tilt about two axes,

    y_j = sum_k exp(-|x_j - x_k| / l) / (2 l k) h_k f_k,
    t = r^2 / c_tilt sum_k U_k h_k f_k,   U = (cos phi, sin phi),

h_k the length that station k stands for. The kernel's inverse is tridiagonal (Markov), the tilt is of rank
two; so for a given set of closed stations the solution takes one tridiagonal solve and a 2x2 system. The set
is found by flipping every station that violates its sign, warm from the last set, and, should that not
settle, by flipping the first violator only, which ends for every P-matrix (Murty 1974); this matrix is
symmetric positive definite. A matrix of flexibilities in the place of the kernel takes `closed_set`. A
collar with clearance adds one scalar equation to each solution (`clearance.py`).

Of a single run by plain numbers, or of several at once, each lane with stiffnesses and gaps of its own: lanes
that have found their set repeat their last solve, with the same numbers, until the slowest has found its own.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import DTypeLike

from cvt_hpc.kernels import kernel, merged_kernel
from cvt_hpc.lanes import LaneArray, anywhere, fma, like, maximum, select
from cvt_hpc.physics.clearance import bearing_direction, principal_axes
from cvt_hpc.physics.closed_set import factorise_closed, solve_closed
from cvt_hpc.physics.moving_discs import MovingDiscs, inert_part, lane_discs
from cvt_hpc.physics.ritz import NO_MODES
from cvt_hpc.physics.sheaves import Sheaves, disc_factor, elastic_matrix

ROUNDS_OF_BLOCK_FLIPS = 10

# fields of Contact.stations
GAP, PUSH, DIAGONAL, _OFF_DIAGONAL, PIVOT, _MULTIPLIER = range(6)
_RESPONSE_1, _RESPONSE_2, Y, CLOSED, FORCED = range(6, 11)
# fields of Contact.scalars
ELEMENT_STIFFNESS, COMPLIANCE, _DISC_COMPLIANCE, TILT_COMPLIANCE = range(4)
_INVERSE_11, _INVERSE_12, _INVERSE_22, ROUND_OFF, SOLVES, UNSOLVED = range(4, 10)
_CLEARANCE, LEAST_LOAD, DIRECTION_ERROR, _AXIS_COSINE, _AXIS_SINE, _LARGER, _LESSER = range(10, 17)
LOOSE_1, LOOSE_2 = range(17, 19)

# Forces of the default scene are 1e5 N/m and come from openings that are 1 % of their parts: the error [N/m]
# that each precision leaves.
_ROUND_OFF = {np.dtype(np.float64): 1e-6, np.dtype(np.float32): 2.0}
_DIRECTION_ERROR = {np.dtype(np.float64): 1e-13, np.dtype(np.float32): 1e-6}  # some ten roundings


class Contact(NamedTuple):
    """The contact of one wrap of m stations, and the data that its solver keeps between calls.

    `stations` (m, 11) and `scalars` (1, 19) are LaneArrays or arrays of the fields above. Of stations: gap of
    the rigid bodies [m] (set by the caller), -c_e times the opening without f / c_e [N/m]; the local kernel's
    diagonal and the entry beside it, factors, the tilt's response, work space, closed set (1 or 0), and the
    force that the caller takes from it [N/m]. Of scalars: constants of the wrap, the inverse of the tilt's
    2x2 system, the round-off of forces [N/m]; linear solves so far, and whether (1) a search for the closed
    set did not end. Of a collar with clearance: c [m], the load from which on it bears [N], the error of its
    direction, the principal axis of L and its eigenvalues [N], and the opening c p of the last solution [m].
    """

    weight: np.ndarray  # length that a station stands for, (m,) [m]
    cosine: np.ndarray  # of the tilt's directions, (m,)
    sine: np.ndarray  # (m,)
    rise: np.ndarray  # distance of the reference path from the axis beyond the pitch radius, (m,) [m]
    upright: np.ndarray  # its slope with the belt's displacement, (m,)
    stations: Any
    scalars: Any
    fresh: np.ndarray  # (1,) bool: False until the factors belong to the closed set
    root: np.ndarray  # sqrt(h) [m^(1/2)], (m,) where the sheaves have a matrix of flexibilities, else empty
    matrix: Any  # LaneArray or array of that matrix and its factor, (m, 2 m), as in `closed_set`; else empty
    discs: MovingDiscs  # modes with inertia; without any, as in plain numbers, discs follow at once
    has_clearance: bool  # whether any lane's collar has


def lane_contact(wraps: list[Sheaves], dtype: DTypeLike) -> Contact:
    """All stations closed, for wraps of the same stations, one for each lane, in np.float64 or np.float32."""
    weight = wraps[0].weight
    stations = LaneArray(weight.size, 11, len(wraps), dtype)
    scalars = LaneArray(1, 19, len(wraps), dtype)
    stations.data[:, CLOSED] = 1.0
    scalars.data[:, DIRECTION_ERROR] = _DIRECTION_ERROR[np.dtype(dtype)]
    # the inverse of a tilt that is part of a matrix
    scalars.data[:, [_INVERSE_11, _INVERSE_22]] = 1.0
    for lane, wrap in enumerate(wraps):
        stations.data[:, DIAGONAL, lane] = wrap.diagonal
        stations.data[:, _OFF_DIAGONAL, lane] = wrap.off_diagonal
        round_off = _ROUND_OFF[np.dtype(dtype)] * wrap.line_forces
        scalars.data[0, [ROUND_OFF, LEAST_LOAD], lane] = round_off, round_off * weight.sum()
        scalars.data[0, :_INVERSE_11, lane] = (
            wrap.element_stiffness,
            wrap.compliance,
            wrap.disc_compliance,
            wrap.tilt_compliance,
        )
        scalars.data[0, _CLEARANCE, lane] = wrap.clearance
    has_matrix = wraps[0].flexibilities.size > 0
    m = weight.size if has_matrix else 0
    root, matrix = np.sqrt(weight[:m]), LaneArray(m, 2 * m, len(wraps), dtype)
    for lane, wrap in enumerate(wraps if has_matrix else []):
        scale = wrap.element_stiffness * root
        elastic = elastic_matrix(wrap)
        if wrap.modes.place.size:
            elastic -= inert_part(wrap.modes, disc_factor(wrap))
        matrix.data[:, :m, lane] = np.eye(m) + scale[:, None] * elastic * root
    fresh = np.zeros(1, dtype=np.bool_)
    cosine, sine = wraps[0].tilt.astype(dtype)
    rise, upright = wraps[0].rise.astype(dtype), wraps[0].upright.astype(dtype)
    own = weight.astype(dtype), cosine, sine, rise, upright
    discs = lane_discs([wrap.modes for wrap in wraps], [disc_factor(wrap) for wrap in wraps], dtype)
    has_clearance = any(wrap.clearance > 0.0 for wrap in wraps)
    return Contact(*own, stations, scalars, fresh, root.astype(dtype), matrix, discs, has_clearance)


def plain_contact(wrap: Sheaves) -> Contact:
    """All stations closed, for a single wrap in plain numbers; its discs follow at once."""
    contact = lane_contact([wrap._replace(modes=NO_MODES)], np.float64)
    names = ("stations", "scalars", "matrix")
    plain = contact._replace(**{name: getattr(contact, name).data[:, :, 0] for name in names})
    return plain._replace(discs=contact.discs._replace(states=contact.discs.states.data[:, :, 0]))


@kernel
def _bend(m: int, stations) -> None:
    """Solve the tridiagonal system in place of Y."""
    y = stations[0, Y]
    for j in range(1, m):
        y = fma(-stations[j, _MULTIPLIER], y, stations[j, Y])
        stations[j, Y] = y
    y = y * stations[m - 1, PIVOT]
    stations[m - 1, Y] = y
    for j in range(m - 2, -1, -1):
        y = fma(-stations[j + 1, _MULTIPLIER], y, stations[j, Y] * stations[j, PIVOT])
        stations[j, Y] = y


@kernel
def _factorise(contact: Contact) -> None:
    """Factors and tilt responses for the present closed set."""
    if contact.root.size > 0:
        factorise_closed(contact.matrix, contact.stations, CLOSED, contact.weight.size)
        if contact.has_clearance:
            _respond_by_matrix(contact)
    else:
        _factorise_kernel(contact)
    if contact.has_clearance:
        _loosen(contact)
    contact.fresh[0] = True


@kernel
def _factorise_kernel(contact: Contact) -> None:
    stations, scalars, weight = contact.stations, contact.scalars, contact.weight
    m = weight.size
    ce = scalars[0, ELEMENT_STIFFNESS]
    whole = ce * scalars[0, COMPLIANCE]
    grip = whole * scalars[0, _DISC_COMPLIANCE]
    pivot = like(0.0, ce)
    for j in range(m):
        off = stations[j, _OFF_DIAGONAL]
        multiplier = off * pivot
        d = stations[j, DIAGONAL] + weight[j] * grip * stations[j, CLOSED] - off * multiplier
        pivot = 1.0 / d
        stations[j, _MULTIPLIER], stations[j, PIVOT] = multiplier, pivot
    for b in range(2):
        tilt = contact.sine if b else contact.cosine
        for j in range(m):
            stations[j, Y] = weight[j] * tilt[j] * grip * stations[j, CLOSED]
        _bend(m, stations)
        for j in range(m):
            stations[j, _RESPONSE_1 + b] = tilt[j] - stations[j, Y]
    gain = scalars[0, TILT_COMPLIANCE] * whole
    s11, s12, s22 = like(1.0, ce), like(0.0, ce), like(1.0, ce)
    for j in range(m):
        h = gain * stations[j, CLOSED] * weight[j]
        s11 += h * contact.cosine[j] * stations[j, _RESPONSE_1]
        s12 += h * contact.cosine[j] * stations[j, _RESPONSE_2]
        s22 += h * contact.sine[j] * stations[j, _RESPONSE_2]
    per_determinant = 1.0 / (s11 * s22 - s12 * s12)
    scalars[0, _INVERSE_11], scalars[0, _INVERSE_22] = s22 * per_determinant, s11 * per_determinant
    scalars[0, _INVERSE_12] = -s12 * per_determinant


@kernel
def _respond_by_matrix(contact: Contact) -> None:
    """The tilt's response where it is part of a matrix: opening under a groove that tilts by 1 m."""
    stations, ce = contact.stations, contact.scalars[0, ELEMENT_STIFFNESS]
    for b in range(2):
        tilt = contact.sine if b else contact.cosine
        for j in range(contact.weight.size):
            stations[j, _MULTIPLIER] = tilt[j] + 0.0 * ce
        solve_closed(contact.matrix, contact.root, stations, (CLOSED, _MULTIPLIER, Y, PIVOT), ce)
        for j in range(contact.weight.size):
            stations[j, _RESPONSE_1 + b] = -stations[j, PIVOT] / ce


@kernel
def _loosen(contact: Contact) -> None:
    """L of `clearance.py` by its principal axes."""
    stations, scalars = contact.stations, contact.scalars
    gain = scalars[0, _CLEARANCE] * scalars[0, ELEMENT_STIFFNESS]
    m11, m12, m22 = like(0.0, gain), like(0.0, gain), like(0.0, gain)
    for j in range(contact.weight.size):
        h = gain * stations[j, CLOSED] * contact.weight[j]
        m11 += h * contact.cosine[j] * stations[j, _RESPONSE_1]
        m12 += h * contact.cosine[j] * stations[j, _RESPONSE_2]
        m22 += h * contact.sine[j] * stations[j, _RESPONSE_2]
    i11, i12, i22 = scalars[0, _INVERSE_11], scalars[0, _INVERSE_12], scalars[0, _INVERSE_22]
    cosine, sine, larger, lesser = principal_axes(
        fma(m11, i11, m12 * i12), fma(m11, i12, m12 * i22), fma(m12, i12, m22 * i22)
    )
    scalars[0, _AXIS_COSINE], scalars[0, _AXIS_SINE] = cosine, sine
    scalars[0, _LARGER], scalars[0, _LESSER] = larger, lesser


@kernel
def _give_way(contact: Contact) -> None:
    """PUSH of a sheave that tilts by its clearance beside its compliance."""
    stations, scalars, weight = contact.stations, contact.scalars, contact.weight
    ce = scalars[0, ELEMENT_STIFFNESS]
    one, other = like(0.0, ce), like(0.0, ce)
    for j in range(weight.size):
        pressed = weight[j] * stations[j, CLOSED] * stations[j, PUSH]
        one, other = fma(contact.cosine[j], pressed, one), fma(contact.sine[j], pressed, other)
    cosine, sine = scalars[0, _AXIS_COSINE], scalars[0, _AXIS_SINE]
    p_1, p_2, left = bearing_direction(
        fma(cosine, one, sine * other),
        fma(cosine, other, -sine * one),
        scalars[0, _LARGER],
        scalars[0, _LESSER],
        scalars[0, LEAST_LOAD],
        scalars[0, DIRECTION_ERROR],
    )
    scalars[0, UNSOLVED] = select(left, like(1.0, ce), scalars[0, UNSOLVED])
    clearance = scalars[0, _CLEARANCE]
    one, other = clearance * fma(cosine, p_1, -sine * p_2), clearance * fma(sine, p_1, cosine * p_2)
    scalars[0, LOOSE_1], scalars[0, LOOSE_2] = one, other
    t1 = -ce * (scalars[0, _INVERSE_11] * one + scalars[0, _INVERSE_12] * other)
    t2 = -ce * (scalars[0, _INVERSE_12] * one + scalars[0, _INVERSE_22] * other)
    for j in range(weight.size):
        opened = fma(t2, stations[j, _RESPONSE_2], t1 * stations[j, _RESPONSE_1])
        stations[j, PUSH] = stations[j, PUSH] + opened


@kernel
def _pushes(contact: Contact) -> bool:
    """PUSH for the present closed set; whether a station of any lane is on the wrong side."""
    stations, scalars = contact.stations, contact.scalars
    ce, round_off = scalars[0, ELEMENT_STIFFNESS], scalars[0, ROUND_OFF]
    if contact.root.size > 0:
        solve_closed(contact.matrix, contact.root, stations, (CLOSED, GAP, Y, PUSH), ce)
    else:
        _push_by_kernel(contact)
    if contact.has_clearance:
        _give_way(contact)
    wrong = ce < 0.0
    for j in range(contact.weight.size):
        push = stations[j, PUSH]
        # closed stations that pull, open ones that overlap
        outward = select(stations[j, CLOSED] > 0.5, -push, push)
        wrong |= outward > round_off
    return anywhere(wrong)


@kernel
def _push_by_kernel(contact: Contact) -> None:
    stations, scalars, weight = contact.stations, contact.scalars, contact.weight
    m = weight.size
    ce, a, disc = scalars[0, ELEMENT_STIFFNESS], scalars[0, COMPLIANCE], scalars[0, _DISC_COMPLIANCE]
    y = like(0.0, ce)
    for j in range(m):
        y = fma(-stations[j, _MULTIPLIER], y, -weight[j] * stations[j, CLOSED] * ce * stations[j, GAP])
        stations[j, Y] = y
    y = p1 = p2 = multiplier = like(0.0, ce)
    for j in range(m - 1, -1, -1):
        y = fma(-multiplier, y, stations[j, Y] * stations[j, PIVOT])
        multiplier = stations[j, _MULTIPLIER]
        bent = disc * y
        stations[j, Y] = bent
        overlap = weight[j] * stations[j, CLOSED] * fma(a, bent, stations[j, GAP])
        p1 = fma(-contact.cosine[j], overlap, p1)
        p2 = fma(-contact.sine[j], overlap, p2)
    gain = scalars[0, TILT_COMPLIANCE] * ce
    t1 = gain * (scalars[0, _INVERSE_11] * p1 + scalars[0, _INVERSE_12] * p2)
    t2 = gain * (scalars[0, _INVERSE_12] * p1 + scalars[0, _INVERSE_22] * p2)
    for j in range(m):
        elastic = fma(t2, stations[j, _RESPONSE_2], fma(t1, stations[j, _RESPONSE_1], stations[j, Y]))
        stations[j, PUSH] = -ce * fma(a, elastic, stations[j, GAP])


@kernel
def solve_contact(contact: Contact, most_rounds: int) -> None:
    """Closed sets and pushes from GAP; forces are the pushes of closed stations, where positive.

    The search starts from the last closed set. After `most_rounds` the lanes whose search has not ended are
    marked UNSOLVED.
    """
    stations, scalars = contact.stations, contact.scalars
    m = contact.weight.size
    round_off = scalars[0, ROUND_OFF]
    scalars[0, SOLVES] = scalars[0, SOLVES] + 1.0
    busy = round_off < 0.0
    for round_ in range(most_rounds):
        if not contact.fresh[0]:
            _factorise(contact)
        if not _pushes(contact):
            return
        busy = round_off < 0.0
        for j in range(m):
            push, closed = stations[j, PUSH], stations[j, CLOSED]
            wrong = select(closed > 0.5, -push, push) > round_off
            if round_ >= ROUNDS_OF_BLOCK_FLIPS:
                # one at a time: ends for every P-matrix
                wrong &= ~busy
            busy |= wrong
            stations[j, CLOSED] = select(wrong, 1.0 - closed, closed)
        scalars[0, SOLVES] = scalars[0, SOLVES] + select(busy, like(1.0, round_off), 0.0)
        contact.fresh[0] = False
    scalars[0, UNSOLVED] = select(busy, like(1.0, round_off), scalars[0, UNSOLVED])


@merged_kernel
def contact_force(stations, j: int):
    """Axial line force of station j >= 0 [N/m], of the last solution."""
    return select(stations[j, CLOSED] > 0.5, maximum(stations[j, PUSH], 0.0), 0.0)


@kernel
def solve_wrap(contact: Contact, gap: np.ndarray, force: np.ndarray) -> int:
    """Axial line forces f >= 0 of one wrap, into `force` (m,) [N/m], from the gaps of the rigid bodies.

    In plain numbers, from G in `gap` (m,) [m], negative where rigid bodies would overlap, and from the last
    closed set on. Returns the number of linear solves taken (1 where the set has not changed); 0 if the
    search did not end, which happens for gaps that are not numbers only.
    """
    stations, scalars, m = contact.stations, contact.scalars, gap.size
    for j in range(m):
        stations[j, GAP] = gap[j]
    scalars[0, SOLVES] = scalars[0, UNSOLVED] = 0.0
    solve_contact(contact, ROUNDS_OF_BLOCK_FLIPS + 10 * m)
    solved = scalars[0, UNSOLVED] == 0.0
    for j in range(m):
        solved &= np.isfinite(stations[j, PUSH])
        force[j] = contact_force(stations, j)
    return int(scalars[0, SOLVES]) if solved else 0
