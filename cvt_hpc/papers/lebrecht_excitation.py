"""Statements of Lebrecht, Pfeiffer and Ulbrich 2004 about the excitation: figs 3.12, 4.1, 4.2 and 4.4."""

import json
from itertools import pairwise

import numpy as np
import xarray as xr

from cvt_hpc.analysis.followed_drawing import mean_there, one_passage
from cvt_hpc.analysis.paper_pictures import curves_of, powers_of, regularised
from cvt_hpc.papers.verdicts import Kept, Measured, Statement, listed, over_arc
from cvt_hpc.variables import Vibrates

SWING = 0.02  # of the radial speed: how far it swings at least where it is jagged


def _goes_in(kept: Kept) -> Measured:
    arc = over_arc(kept.histories[0], "mean_displacement", "driven")
    depth = 1e3 * (arc.values[0] - arc.values.min())
    place = float(arc.share[np.argmin(arc.values)])
    holds = [depth > 0.0, 0.0 < place < 1.0]
    return Measured(holds, f"{depth:.2g} mm into the groove, innermost at {100 * place:.0f} % of the wrap")


def _turns_and_goes_out(kept: Kept) -> Measured:
    arc = over_arc(kept.histories[0], "mean_displacement", "driven")
    speed = over_arc(kept.histories[0], "radial_sliding", "driven")
    inner = float(arc.share[np.argmin(arc.values)])
    turn = float(speed.share[1:][np.argmax(speed.values[1:] > 0.0)])
    rise = 1e3 * (arc.values[-1] - arc.values.min())
    return Measured(
        [abs(turn - inner) < 0.1, rise > 0.0],
        f"radial sliding changes its sign at {100 * turn:.0f} % of the wrap, the innermost point is at "
        f"{100 * inner:.0f} %; out by {rise:.2g} mm up to the outlet",
    )


FIGURE_4_1 = (
    Statement("Elements move into the sheave till the innermost point is reached", _goes_in),
    Statement("Then the direction of the relative velocity changes, and they move out", _turns_and_goes_out),
)


def _radial_through_zero(kept: Kept) -> Measured:
    radial = 1e3 * one_passage(kept.histories[0], "driven")["radial_sliding"].values
    n = radial.size // 4
    said = f"{radial[1:n].mean():.3g} mm/s in the first, {radial[-n:].mean():.3g} mm/s in the last quarter"
    return Measured([radial[1:n].mean() < 0.0 < radial[-n:].mean()], said)


def _jagged(kept: Kept) -> Measured:
    history = kept.histories[0]
    element = one_passage(history, "driven")
    off = 1e3 * (element["radial_sliding"].values - mean_there(history, element, "radial_sliding"))[5:-5]
    turns = int((np.diff(np.sign(off)) != 0).sum())
    size = 1e3 * float(np.sqrt(np.mean(element["radial_sliding"].values ** 2)))
    said = f"it swings {off.std():.2g} mm/s (rms) about its mean, with {turns} changes of sign"
    return Measured([turns >= 6 and off.std() > SWING * size], said)


def _falls_at_that_speed(kept: Kept) -> Measured:
    """Mark times at which the element slides faster than the top of the curve of friction lies."""
    history, speeds = kept.histories[0], np.linspace(0.0, 1.0, 2000)
    curve = regularised(json.loads(history.attrs["point"]), speeds)
    top = float(speeds[np.argmax(curve)])
    speed = one_passage(history, "driven")["sliding_speed"].values
    share = float(np.mean(speed > top))
    beyond = f"{1e3 * top:.3g} mm/s, where the element is for {100 * share:.0f} % of its way"
    said = f"{1e3 * np.median(speed):.3g} mm/s (median); the curve falls beyond {beyond}"
    return Measured([share > 0.5], said)


FIGURE_4_2 = (
    Statement("The radial relative velocity passes from inwards to outwards", _radial_through_zero),
    Statement("Around v0 small movements of the elements make it a jagged curve", _jagged),
    Statement("v0 is high enough for the gradient of the friction characteristic to be negative",
              _falls_at_that_speed),
)  # fmt: skip


def _steeper(kept: Kept) -> Measured:
    curves = curves_of(kept.results, np.linspace(0.05, 0.25, 50))
    ordered = [curves[gradient] for gradient in sorted(curves, reverse=True)]
    falls = [float(curve[0] - curve[-1]) for curve in ordered]
    gradients = listed(sorted(curves, reverse=True), "g")
    said = f"mu falls by {listed(falls, '.2g')} from 50 to 250 mm/s at {gradients} s/m"
    return Measured([a < b for a, b in pairwise(falls)], said)


def _fed_where_it_falls(kept: Kept) -> Measured:
    holds, said = [], []
    for gradient in sorted(kept.results["friction_gradient"].values, reverse=True):
        fed = kept.results["vibrates"].sel(friction_gradient=gradient).values == Vibrates.YES
        holds.append(fed.any() == (gradient < 0.0))
        speeds = 1e3 * kept.results["radial_speed"].values[fed]
        where = f"{speeds.min():.0f}-{speeds.max():.0f} mm/s" if fed.any() else "nowhere"
        said.append(f"{gradient:g} s/m: {where}")
    return Measured(holds, "; ".join(said))


def _fed_more(kept: Kept) -> Measured:
    ordered = kept.results["growth_rate"].max("radial_speed").sortby("friction_gradient", ascending=False)
    gradients = listed(ordered["friction_gradient"].values, "g")
    said = f"fastest growth {listed(ordered.values)} 1/s at {gradients} s/m"
    return Measured([a < b for a, b in pairwise(ordered.values)], said)


FIGURE_3_12 = (
    Statement("Another curve of friction has a steeper gradient (figs 3.8, 3.12)", _steeper),
    Statement("A negative gradient feeds radial motion, one that is not negative does not (eq. 19)",
              _fed_where_it_falls),
    Statement("A steeper gradient causes a greater excitation of the belt", _fed_more),
)  # fmt: skip


def _falling_and_constant(kept: Kept) -> tuple[xr.Dataset, xr.Dataset]:
    gradients = kept.results["friction_gradient"].values
    return kept.history(friction_gradient=gradients.min()), kept.history(friction_gradient=gradients.max())


def _spiral_is_a_source(kept: Kept) -> Measured:
    falling, _ = _falling_and_constant(kept)
    found = powers_of(falling)
    fed = f"friction takes {found.spiral:.0f} W from the radial motion through the arcs"
    damped = f"what damps the vibration takes {found.taken:.2g} W"
    return Measured([found.spiral > found.taken > 0.0], f"{fed}; {damped}")


def _switch_feeds(kept: Kept) -> Measured:
    falling, constant = (powers_of(history) for history in _falling_and_constant(kept))
    return Measured(
        [falling.outlet > 0.0, constant.outlet <= 0.0, falling.outlet + falling.elsewhere > 0.0],
        f"the last quarter of the driven arc feeds {falling.outlet:.2g} W with the falling curve and "
        f"{constant.outlet:.2g} W with the constant one; all flanks together "
        f"{falling.outlet + falling.elsewhere:.2g} W, push and tension {falling.stresses:.2g} W",
    )


def _oscillates_with_switch(kept: Kept) -> Measured:
    swings = [1e6 * float(history["amplitude"].max()) for history in _falling_and_constant(kept)]
    holds = [swings[0] > 5.0, swings[1] < 1.0]
    return Measured(holds, f"{swings[0]:.2g} um, and {swings[1]:.2g} um with constant friction")


FIGURE_4_4 = (
    Statement("The spiral movement of the belt in the arc of contact is the source of energy",
              _spiral_is_a_source),
    Statement("The friction curve is the switch that supplies the oscillator with energy", _switch_feeds,
              "the front of the push moves over cells that open and close, where flanks take what stresses "
              "feed"),
    Statement("The oscillator is the belt: without a negative gradient it is silent",
              _oscillates_with_switch),
)  # fmt: skip
