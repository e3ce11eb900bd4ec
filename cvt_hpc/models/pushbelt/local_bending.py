"""Local bending of sheaves, which spreads along the arc: of both pushbelts.

The deflection y of a sheave under the forces F of flanks follows y - l^2 y'' = b F (a plate on a bedding, of
which the shorter of two lengths is left out): each force deflects its surroundings by exp(-|s| / l). Forces
that are alike all along deflect as by a bedding, b F. The laws of a step have this bedding in series with
the element, as the stiffness k of a flank, b k < 1. The rest of y is the spread, z = y - b F, by which the
flank is less deep in the sheave: F = sum k_p max(0, depth_p - z) over the points p of a flank. Of two points
each has an equal share of k, bedding included: one of them alone gives way by 2 / k under a force alike.

With K = sum k_p and D = sum k_p depth_p over the points that press, F = (D - K y) / (1 - b K), and with its
place i along the belt on one pulley

    (1 + 2 a + h) y_i - a (y_{i-1} + y_{i+1}) = b D / (1 - b K),   h = b K / (1 - b K),   a = r / (1 - r)^2,

r = exp(-pitch / l). Sheaves of both pulleys are apart: half way along a strand nothing is handed on. The
matrix is an M-matrix, so that the set of pressing points settles by full steps.

Newton's method of a step takes the slope of the bedding, K, alone. In the plane the inertia of elements is
far stiffer within a step, so that each iteration leaves some tenth of the spread's error. Along the axis of
the spatial pushbelt, where flanks are steep and act at the step's end, it is not. The slope of F by depths,

    S = K (1 + a L) / (1 + (1 - b K) a L),   L = 4 sin^2(q / 2),

for waves of phase q from element to element, rises from K of the longest ones to K / (1 - b K), which is that
of the element alone. `axial_excess` makes the slope the mean of both, by which an iteration leaves b K /
(2 - b K) of the error at most, whatever inertia and rings resist. A tridiagonal slope nearest to S
takes as many iterations (216 and 432 elements, 10 and 20 us).
"""

import numpy as np
from numba.extending import register_jitable

from cvt_hpc.kernels import kernel

_MOST_SETS = 50  # of pressing points that are tried; 400 random scenes of 32 to 216 elements take at most 5


@register_jitable
def _first(driven):
    """Place of the first element on a pulley: the one behind it is on the other pulley."""
    rows, count = driven.shape[0], driven.size
    for place in range(count):
        behind = (place - 1) % count
        if driven[place % rows, place // rows] != driven[behind % rows, behind // rows]:
            return place
    return 0


@register_jitable
def _pressing(depths, j, lane, spread, stiffness):
    """K [N/m] and D [N] of an element."""
    held = pressed = 0.0
    for p in range(depths.shape[1]):
        if depths[j, p, lane] > spread:
            held += stiffness
            pressed += stiffness * depths[j, p, lane]
    return held, pressed


@register_jitable
def axial_excess(compliance, pressing):
    """Slope [N/m] beyond K that Newton's method takes, by b [m/N] and K [N/m]."""
    share = compliance * pressing
    return 0.5 * pressing * share / (1.0 - share)


@kernel
def spread_bending(driven, depths, spread, work, compliance, stiffness, decay):
    """Set the spread at all elements, (rows, lanes) [m], by the depths of an iterate.

    `driven`, (rows, lanes), is 1 for elements on the driven pulley, else 0; `depths`, (rows, points, lanes),
    are those of each point of a flank in the sheave without local bending [m]; `work` has (elements, 4 or
    more). Compliance and stiffness of an element are b [m/N] and k_p [N/m], the decay is r [1].
    """
    rows, count, link = driven.shape[0], driven.size, decay / (1.0 - decay) ** 2
    first = _first(driven)
    # presumed: points that press by the spread of the iterate before
    for k in range(count):
        place = (first + k) % count
        j, lane = place % rows, place // rows
        work[k, 0], work[k, 1] = _pressing(depths, j, lane, spread[j, lane], stiffness)
    for _ in range(_MOST_SETS):
        behind = y = share = 0.0
        for k in range(count):
            place, beyond = (first + k) % count, (first + k + 1) % count
            alike = driven[place % rows, place // rows] == driven[beyond % rows, beyond // rows]
            ahead = link if alike and k < count - 1 else 0.0
            eased = compliance / (1.0 - compliance * work[k, 0])
            per_pivot = 1.0 / (1.0 + behind * (1.0 - share) + ahead + eased * work[k, 0])
            y = (eased * work[k, 1] + behind * y) * per_pivot
            share = ahead * per_pivot
            work[k, 2], work[k, 3] = share, y
            behind = ahead
        y, settled = 0.0, True
        for back in range(count):
            k = count - 1 - back
            place = (first + k) % count
            j, lane = place % rows, place // rows
            held, pressed = work[k, 0], work[k, 1]
            y = work[k, 3] + work[k, 2] * y
            spread[j, lane] = y - compliance * (pressed - held * y) / (1.0 - compliance * held)
            work[k, 0], work[k, 1] = _pressing(depths, j, lane, spread[j, lane], stiffness)
            settled = settled and work[k, 0] == held and work[k, 1] == pressed
        if settled:
            return
    spread[0, 0] = np.nan  # which ends the march as not finite
