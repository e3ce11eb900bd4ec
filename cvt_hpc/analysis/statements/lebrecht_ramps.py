"""Statements of Lebrecht, Pfeiffer and Ulbrich 2004 about their ramps: figs 3.1, 3.9, 3.13 and 3.14."""

from itertools import pairwise

import numpy as np
import xarray as xr

from cvt_hpc.analysis.ramps import NOISE, envelope, read_ramp
from cvt_hpc.analysis.statements.verdicts import Kept, Measured, Statement
from cvt_hpc.vibration.settings import PARAMETERS

# [um] of the strand under load, from which on a run counts as vibrating
THRESHOLD = 1e6 * PARAMETERS["vibration"]["amplitude_threshold"].default
GAP = 10.0  # [N m]: quieter loads between two areas
SECOND_AREA = (
    "above 140 N m the strand moves by 20 um, but at 50 to 250 Hz and with rigid sheaves as well: judder, "
    "below the band of the noise"
)


Areas = list[tuple[float, float, float]]


def load_areas(history: xr.Dataset) -> Areas:
    """First and last load [N m] and largest amplitude [um] of each area in which strand t1 vibrates."""
    loads, amplitude = envelope(read_ramp(history, "t1"))
    areas: list[list[float]] = []
    for load, size in zip(loads, amplitude, strict=True):
        if size <= THRESHOLD:
            continue
        if areas and load - areas[-1][1] <= GAP:
            areas[-1] = [areas[-1][0], load, max(areas[-1][2], size)]
        else:
            areas.append([load, load, size])
    return [(first, last, size) for first, last, size in areas]


def _told(areas: Areas) -> str:
    return ", ".join(f"{a:.0f}-{b:.0f} N m ({size:.2g} um)" for a, b, size in areas) or "nothing"


def _two_areas(kept: Kept, stiffness: float) -> Measured:
    areas = load_areas(kept.history(sheave_stiffness=stiffness))
    return Measured([len(areas) >= 1, len(areas) >= 2], f"x{stiffness:g}: {_told(areas)}")


def _lower_area_goes(kept: Kept) -> Measured:
    inside = [_largest_inside(kept, stiffness) for stiffness in (1.0, 1.5)]
    return Measured([inside[0] > THRESHOLD, inside[1] < THRESHOLD],
                    f"80-120 N m: {inside[0]:.2g} um at x1, {inside[1]:.2g} um at x1.5")  # fmt: skip


def _largest_inside(kept: Kept, stiffness: float) -> float:
    loads, amplitude = envelope(read_ramp(kept.history(sheave_stiffness=stiffness), "t1"))
    return float(amplitude[(loads >= 80.0) & (loads <= 120.0)].max())


def _starts_at_200(kept: Kept) -> Measured:
    areas = load_areas(kept.history(sheave_stiffness=1.5))
    return Measured([bool(areas) and 180.0 <= areas[0][0] <= 220.0], f"x1.5: {_told(areas)}")


def _rigid_is_quiet(kept: Kept) -> Measured:
    areas = load_areas(kept.history(sheave_stiffness=np.inf))
    return Measured([not areas], f"rigid: {_told(areas)}")


FIGURE_3_14 = (
    Statement("With the original stiffness the belt oscillates in two load areas",
              lambda kept: _two_areas(kept, 1.0), SECOND_AREA),
    Statement("This is also true if the stiffness of the sheaves is 20 % increased",
              lambda kept: _two_areas(kept, 1.2), SECOND_AREA),
    Statement("At 50 % more the oscillations between 80 and 120 N m disappear", _lower_area_goes),
    Statement("and the belt starts to oscillate firstly at about 200 N m", _starts_at_200, SECOND_AREA),
    Statement("In case of non-elastic sheaves the vibration disappears completely", _rigid_is_quiet),
)  # fmt: skip


def _moment_swings_with_noise(kept: Kept) -> Measured:
    history = kept.histories[0]
    loads, moment = envelope(read_ramp(history, "driving_moment"), NOISE)
    noisy = np.zeros(loads.size, bool)
    for first, last, _ in load_areas(history):
        noisy |= (loads > first) & (loads < last)
    loud, quiet = float(np.median(moment[noisy])), float(np.median(moment[~noisy]))
    return Measured(
        [loud > 2.0 * quiet], f"{loud:.2g} N m at 400-800 Hz where t1 vibrates, {quiet:.2g} N m elsewhere"
    )


def _starts_at_a_load(kept: Kept) -> Measured:
    history = kept.histories[0]
    areas, first = load_areas(history), float(read_ramp(history, "t1").values[0])
    return Measured([bool(areas) and areas[0][0] > first + GAP], f"{_told(areas)}; from {first:.0f} N m on")


def _about_ten_micrometres(kept: Kept) -> Measured:
    size = max((size for _, _, size in load_areas(kept.histories[0])), default=0.0)
    # half to twice as much
    return Measured([5.0 <= size <= 20.0], f"at most {size:.2g} um")


FIGURE_3_1 = (
    Statement("The amplitude of the moment at the driving pulley is related to the noise",
              _moment_swings_with_noise),
)  # fmt: skip

FIGURE_3_9 = (
    Statement("At a certain load the belt starts to oscillate", _starts_at_a_load),
    Statement("with amplitudes of about 0.01 mm", _about_ten_micrometres),
)  # fmt: skip


def _by_gradient(kept: Kept) -> dict[float, Areas]:
    """Areas by the fall of friction [s/m], steepest last."""
    gradients = sorted(kept.results["friction_gradient"].values, reverse=True)
    return {gradient: load_areas(kept.history(friction_gradient=gradient)) for gradient in gradients}


def _steeper_is_larger(kept: Kept) -> Measured:
    found = _by_gradient(kept)
    sizes = [max((size for _, _, size in areas), default=0.0) for areas in found.values()]
    said = ", ".join(f"{size:.2g} um at {g:g} s/m" for g, size in zip(found, sizes, strict=True))
    return Measured([a < b for a, b in pairwise(sizes)], said)


def _gradient_moves_area(kept: Kept) -> Measured:
    found = _by_gradient(kept)
    ends = [[(a, b) for a, b, _ in areas] for areas in found.values()]
    differ = [a != b for a, b in pairwise(ends)]
    return Measured(differ, "; ".join(f"{g:g} s/m: {_told(areas)}" for g, areas in found.items()))


FIGURE_3_13 = (
    Statement("A steeper gradient of the friction curve causes a greater excitation", _steeper_is_larger),
    Statement("and influences the load area where vibration occurs", _gradient_moves_area),
)
