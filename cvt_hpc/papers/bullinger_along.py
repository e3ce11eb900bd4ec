"""Statements of Bullinger, Funk and Pfeiffer 2005 about figs 4, 20 and 21: along the belt at ratio 1."""

import numpy as np
import xarray as xr

from cvt_hpc.papers.verdicts import Arc, Kept, Measured, Statement, listed, on_strand, over_arc

LOW_RATIOS, ALL_RATIOS = (0.26, 0.51), (0.26, 0.51, 0.77)  # torque ratios
ALIKE = 0.2  # of two forces that are said to be in equilibrium
CONSTANT = 0.01  # of a force that is said to be constant
APART = 1.0  # [N]: push force below which elements count as apart
FORCES = ("friction_force", "ring_friction")
SLIDING = ("radial_sliding", "tangential_sliding")
HALF_TURN = 0.5 * np.pi


def _each(kept: Kept, shares: tuple[float, ...] = ALL_RATIOS) -> list[xr.Dataset]:
    return [kept.history(load_share=share) for share in shares]


def _front(history: xr.Dataset) -> int:
    """First station of the driving arc at which elements press."""
    return int(np.argmax(over_arc(history, "push_force", "driving").values > APART))


def _both_stiffnesses(kept: Kept) -> list[xr.Dataset]:
    """Elastic sheaves first, then rigid ones."""
    return [kept.history(sheave_stiffness=stiffness) for stiffness in (1.0, np.inf)]


def _has_both_parts(kept: Kept) -> Measured:
    elastic, _ = _both_stiffnesses(kept)
    sizes = {}
    for pulley in ("driving", "driven"):
        parts = (over_arc(elastic, name, pulley).values for name in SLIDING)
        sizes[pulley] = [1e3 * float(np.sqrt(np.mean(speed**2))) for speed in parts]
    holds = [0.1 < radial / tangential < 10.0 for radial, tangential in sizes.values()]
    said = (f"{pulley} {a:.3g} and {b:.3g} mm/s" for pulley, (a, b) in sizes.items())
    return Measured(holds, f"radial and tangential (rms): {', '.join(said)}")


def _elasticity_gives_radial(kept: Kept) -> Measured:
    sizes = []
    for history in _both_stiffnesses(kept):
        arcs = (over_arc(history, "radial_sliding", pulley) for pulley in ("driving", "driven"))
        sizes.append(1e3 * max(float(np.abs(arc.values).max()) for arc in arcs))
    said = f"largest radial sliding {sizes[0]:.3g} mm/s on elastic, {sizes[1]:.3g} mm/s on rigid sheaves"
    return Measured([sizes[1] < 0.5 * sizes[0]], said)


def _friction_is_not_tangential(kept: Kept) -> Measured:
    elastic, _ = _both_stiffnesses(kept)
    shares = []
    for pulley in ("driving", "driven"):
        radial, tangential = (over_arc(elastic, name, pulley).values for name in SLIDING)
        normal = over_arc(elastic, "normal_force", pulley).values
        parts = normal * np.abs(tangential) / np.hypot(radial, tangential)
        shares.append(float(parts.sum() / normal.sum()))
    said = listed(100 * np.array(shares))
    holds = [share < 0.95 for share in shares]
    return Measured(holds, f"of friction's size {said} % are tangential on the driving and the driven pulley")


FIGURE_4 = (
    Statement("Sliding has a radial and a tangential part", _has_both_parts),
    Statement("The thrust deforms sheaves and elements, which gives the radial part",
              _elasticity_gives_radial),
    Statement("So friction is not tangential alone, as eq. 2 assumes", _friction_is_not_tangential),
)  # fmt: skip


def _before(front: int) -> slice:
    """Places inside the arc before the one where the push appears: one at least, as of a coarse belt."""
    return slice(1, max(front - 1, 2))


def _enters_apart(kept: Kept) -> Measured:
    push = [over_arc(history, "push_force", "driving").values[0] for history in _each(kept)]
    return Measured([force < APART for force in push], f"P at the inlet {listed(push)} N")


def _balanced_before_front(kept: Kept) -> Measured:
    ratios = []
    for history in _each(kept):
        before = _before(_front(history))
        flank, ring = (over_arc(history, name, "driving").values[before].mean() for name in FORCES)
        ratios.append(flank / ring)
    holds = [abs(ratio - 1.0) < ALIKE for ratio in ratios]
    return Measured(holds, f"f_Pt / f_Rt where P = 0: {listed(ratios)}")


def _appears_later_with_load(kept: Kept) -> Measured:
    shares = [over_arc(h, "push_force", "driving").share[_front(h)] for h in _each(kept)]
    return Measured([a < b for a, b in zip(shares, shares[1:], strict=False)],
                    f"P appears after {listed(np.multiply(100, shares))} % of the wrap")  # fmt: skip


def _grows_to_exit(kept: Kept) -> Measured:
    holds, exits, falls = [], [], []
    for history in _each(kept):
        push = over_arc(history, "push_force", "driving").values
        fall = (np.maximum.accumulate(push) - push).max() / push.max()
        holds.append(np.argmax(push) == push.size - 1 and fall < CONSTANT)
        exits.append(push[-1])
        falls.append(100 * fall)
    said = f"P at the exit {listed(exits)} N; it falls by {listed(falls, '.2g')} % on the way"
    return Measured(holds, said)


def _raises_flank_friction(kept: Kept) -> Measured:
    steps = []
    for history in _each(kept):
        force, k = over_arc(history, "friction_force", "driving").values, _front(history)
        steps.append(force[k + 1 : k + 3].mean() / force[_before(k)].mean())
    holds = [step > 1.1 for step in steps]
    return Measured(holds, f"f_Pt behind the front over that before it: {listed(steps)}")


def _ring_friction_jumps(kept: Kept) -> Measured:
    steps, before = [], []
    for history in _each(kept):
        force, k = over_arc(history, "ring_friction", "driving").values, _front(history)
        before.append(1e-3 * force[_before(k)].mean())
        steps.append(1e-3 * force[k + 2])
    holds = [abs(b - a) > 0.5 * abs(a) for a, b in zip(before, steps, strict=True)]
    return Measured(holds, f"f_Rt from {listed(before)} to {listed(steps, '.2g')} kN/m within three cells")


def _constant_in_t1(kept: Kept) -> Measured:
    forces = (on_strand(history, "push_force", "t1") for history in _each(kept))
    spreads = [np.ptp(force) / force.mean() for force in forces]
    holds = [spread < CONSTANT for spread in spreads]
    return Measured(holds, f"P varies by {listed(100 * np.array(spreads), '.2g')} % in t1")


def _driven(kept: Kept, name: str, shares: tuple[float, ...] = (0.0, *ALL_RATIOS)) -> list[Arc]:
    return [over_arc(history, name, "driven") for history in _each(kept, shares)]


def _pressed_to_driven_exit(kept: Kept) -> Measured:
    ends = [100 * arc.share[arc.values > APART].max() for arc in _driven(kept, "push_force", ALL_RATIOS)]
    return Measured([end > 95.0 for end in ends], f"pressed up to {listed(ends)} % of the driven wrap")


def _rises_after_driven_entry(kept: Kept) -> Measured:
    arcs = [arc.values for arc in _driven(kept, "push_force", LOW_RATIOS)]
    rises, ends = [100 * (p.max() / p[0] - 1) for p in arcs], [100 * p[-1] / p.max() for p in arcs]
    holds = [rise > 1 for rise in rises] + [end < 10 for end in ends]
    said = f"P rises by {listed(rises)} % and ends with {listed(ends, '.2g')} % of its largest value"
    return Measured(holds, said)


FIGURE_20 = (
    Statement("The elements enter the driving pulley separated and uncompressed, P = 0", _enters_apart),
    Statement("So f_Pt and f_Rt have to be in equilibrium to each other", _balanced_before_front),
    Statement("P appears at a load depending position in the driving pulley", _appears_later_with_load),
    Statement("and grows rapidly up to the exit of the pulley", _grows_to_exit,
              "at low torque the belt outruns the pulley where it is innermost, and friction turns round"),
    Statement("This increases the tangential force f_Pt", _raises_flank_friction),
    Statement("and influences the ring friction f_Rt by a jump", _ring_friction_jumps),
    Statement("In t1 the compression force stays constant", _constant_in_t1),
    Statement("In the driven pulley the compression area continues up to the exit", _pressed_to_driven_exit),
    Statement("At low r, P increases after entering the driven pulley before it decreases to zero at the "
              "exit", _rises_after_driven_entry),
)  # fmt: skip


def _turn(arc: Arc) -> float:
    """Share of the wrap at which sliding turns round."""
    return arc.share[np.argmax(arc.values < HALF_TURN)]


def _no_push_without_load(kept: Kept) -> Measured:
    without, loaded = (kept.run(load_share=share)["mean_push_force"].values for share in (0.0, 0.26))
    return Measured(without < 0.01 * loaded.max(), f"P in t1 and t2 without load: {listed(without, '.2g')} N")


def _radius_decreases(kept: Kept) -> Measured:
    arcs = _driven(kept, "mean_displacement")
    depths = [1e3 * (arc.values[0] - arc.values.min()) for arc in arcs]
    places = [100 * arc.share[np.argmin(arc.values)] for arc in arcs]
    holds = [depth > 0 and place > 50 for depth, place in zip(depths, places, strict=True)]
    return Measured(holds, f"by {listed(depths)} mm, innermost at {listed(places)} % of the driven wrap")


def _sliding_increases(kept: Kept) -> Measured:
    arcs = _driven(kept, "tangential_sliding")
    places, gains = [100 * arc.largest for arc in arcs], [1e3 * (a.values.max() - a.values[0]) for a in arcs]
    holds = [gain > 0 and place > 50 for gain, place in zip(gains, places, strict=True)]
    return Measured(holds, f"by {listed(gains)} mm/s, up to {listed(places)} % of the driven wrap")


def _angle_passes_right_angle(kept: Kept) -> Measured:
    arcs = _driven(kept, "sliding_angle")
    first = [np.degrees(arc.values[1]) for arc in arcs]
    turns = [100 * _turn(arc) for arc in arcs]
    falls = [np.all(np.diff(arc.values[arc.share < 0.75]) < 0) for arc in arcs]
    holds = [a > 90 and 0 < b < 100 and c for a, b, c in zip(first, turns, falls, strict=True)]
    said = f"from {listed(first)} deg, below 90 deg from {listed(turns)} % of the driven wrap on"
    return Measured(holds, said)


def _turns_where_push_is_largest(kept: Kept) -> Measured:
    pairs = zip(_driven(kept, "push_force"), _driven(kept, "sliding_angle"), strict=True)
    apart = [100 * abs(push.largest - _turn(angle)) for push, angle in pairs]
    holds = [gap < 10 for gap in apart]
    return Measured(holds, f"largest P and turn of sliding are {listed(apart)} % of the wrap apart")


def _turns_earlier_with_load(kept: Kept) -> Measured:
    turns = [100 * _turn(arc) for arc in _driven(kept, "sliding_angle")]
    holds = [a > b for a, b in zip(turns, turns[1:], strict=False)]
    return Measured(holds, f"at {listed(turns)} % of the driven wrap")


FIGURE_21 = (
    Statement("The local contact radius decreases passing through the driven pulley", _radius_decreases),
    Statement("The tangential relative velocity increases on the way", _sliding_increases),
    Statement("The sliding angle decreases from above pi/2 (the pulley drives) to below (the belt drives)",
              _angle_passes_right_angle),
    Statement("The elements are pressed most around where the tangential velocity changes sign",
              _turns_where_push_is_largest),
    Statement("The rise of P needs low r: sliding turns earlier as r grows", _turns_earlier_with_load),
    Statement("At i = 1 and no load the compression force disappears in both spans", _no_push_without_load),
)  # fmt: skip
