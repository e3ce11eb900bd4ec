"""Statements of Lebrecht, Pfeiffer and Ulbrich 2004 about fig. 3.14: load areas over stiffness."""

from __future__ import annotations

import numpy as np

from cvt_hpc.analysis.ramps import envelope, read_ramp
from cvt_hpc.analysis.statements.kept import Kept
from cvt_hpc.analysis.statements.verdicts import Measured, Statement
from cvt_hpc.vibration.settings import PARAMETERS

# [um] of the strand under load, from which on a run counts as vibrating
THRESHOLD = 1e6 * PARAMETERS["vibration"]["amplitude_threshold"].default
GAP = 10.0  # [N m]: quieter loads between two areas
SECOND_AREA = (
    "above 140 N m the strand moves by 20 um, but at 50 to 250 Hz and with rigid sheaves as well: judder, "
    "below the band of the noise"
)


def load_areas(kept: Kept, stiffness: float) -> list[tuple[float, float, float]]:
    """First and last load [N m] and largest amplitude [um] of each area in which strand t1 vibrates."""
    loads, amplitude = envelope(read_ramp(kept.history(sheave_stiffness=stiffness), "t1"))
    areas: list[list[float]] = []
    for load, size in zip(loads, amplitude, strict=True):
        if size <= THRESHOLD:
            continue
        if areas and load - areas[-1][1] <= GAP:
            areas[-1] = [areas[-1][0], load, max(areas[-1][2], size)]
        else:
            areas.append([load, load, size])
    return [(first, last, size) for first, last, size in areas]


def _told(areas: list[tuple[float, float, float]]) -> str:
    return ", ".join(f"{a:.0f}-{b:.0f} N m ({size:.2g} um)" for a, b, size in areas) or "nothing"


def _two_areas(kept: Kept, stiffness: float) -> Measured:
    areas = load_areas(kept, stiffness)
    return Measured([len(areas) >= 1, len(areas) >= 2], f"x{stiffness:g}: {_told(areas)}")


def _lower_area_goes(kept: Kept) -> Measured:
    inside = [size for stiffness in (1.0, 1.5) for size in [_largest_between(kept, stiffness, 80.0, 120.0)]]
    return Measured([inside[0] > THRESHOLD, inside[1] < THRESHOLD],
                    f"80-120 N m: {inside[0]:.2g} um at x1, {inside[1]:.2g} um at x1.5")  # fmt: skip


def _largest_between(kept: Kept, stiffness: float, low: float, high: float) -> float:
    loads, amplitude = envelope(read_ramp(kept.history(sheave_stiffness=stiffness), "t1"))
    return float(amplitude[(loads >= low) & (loads <= high)].max())


def _starts_at_200(kept: Kept) -> Measured:
    areas = load_areas(kept, 1.5)
    return Measured([bool(areas) and 180.0 <= areas[0][0] <= 220.0], f"x1.5: {_told(areas)}")


def _rigid_is_quiet(kept: Kept) -> Measured:
    areas = load_areas(kept, np.inf)
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
