"""Local bending of sheaves, which spreads along the arc: of both pushbelts.

The deflection y of a sheave under the forces F of flanks follows y - l^2 y'' = b F (a plate on a bedding, of
which the shorter of two lengths is left out): each force deflects its surroundings by exp(-|s| / l). Forces that
are alike all along deflect as by a bedding, b F, which is in series with the element within the flank of a
step. The rest of y is the spread, z = y - b F.

An element takes F = c max(0, depth - y). With its place i along the belt on one pulley

    (1 + 2 a + b c [pressed]) y_i - a (y_{i-1} + y_{i+1}) = b c [pressed] depth_i,   a = r / (1 - r)^2,

r = exp(-pitch / l). Sheaves of both pulleys are apart: half way along a strand nothing is handed on. The matrix is
an M-matrix, so that the set of pressed elements settles by full steps.
"""

from cvt_hpc.kernels import kernel
from cvt_hpc.models.pushbelt import fields as f

MOST_SETS = 50  # of pressed elements that are tried


@kernel
def _first(elements):
    """Place of the first element on a pulley: the one behind it is on the other pulley."""
    rows, count = elements.rows, elements.rows * elements.data.shape[2]
    driven = elements.data[:, f.DRIVEN]
    for place in range(count):
        behind = (place - 1) % count
        if driven[place % rows, place // rows] != driven[behind % rows, behind // rows]:
            return place
    return 0


@kernel
def spread_bending(elements, depth, spread, work, compliance, stiffness, decay):
    """Set the spread at all elements by the depths of an iterate.

    Parameters
    ----------
    elements : LaneArray
        State of the elements.
    depth, spread : (rows, lanes) array
        Depth of each element without local bending, and the spread of the iterate before, which is set [m].
    work : (elements, 3) array
        Work space.
    compliance, stiffness, decay : float
        b [m/N] and c [N/m] of an element, and r [1].
    """
    rows, count = elements.rows, elements.rows * elements.data.shape[2]
    driven, held, link = elements.data[:, f.DRIVEN], compliance * stiffness, decay / (1.0 - decay) ** 2
    first = _first(elements)
    # presumed: where the spread of the iterate before leaves a force
    for k in range(count):
        place = (first + k) % count
        j, lane = place % rows, place // rows
        work[k, 0] = 1.0 if depth[j, lane] > spread[j, lane] else 0.0
    for _ in range(MOST_SETS):
        behind = y = share = 0.0
        for k in range(count):
            place, beyond = (first + k) % count, (first + k + 1) % count
            j, lane = place % rows, place // rows
            ahead = link if driven[j, lane] == driven[beyond % rows, beyond // rows] else 0.0
            per_pivot = 1.0 / (1.0 + behind * (1.0 - share) + ahead + held * work[k, 0])
            y = (held * work[k, 0] * depth[j, lane] + behind * y) * per_pivot
            share = ahead * per_pivot
            work[k, 1], work[k, 2] = share, y
            behind = ahead
        y, settled = 0.0, True
        for back in range(count):
            k = count - 1 - back
            place = (first + k) % count
            j, lane = place % rows, place // rows
            y = work[k, 2] + work[k, 1] * y
            was = work[k, 0]
            work[k, 0] = 1.0 if depth[j, lane] > y else 0.0
            settled = settled and work[k, 0] == was
            spread[j, lane] = y - held * max(depth[j, lane] - y, 0.0)
        if settled:
            break
