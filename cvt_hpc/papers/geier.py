"""Statements of Geier, Schindler et al. 2007 about figs 4 to 7: push force and losses of a pushbelt."""

from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from cvt_hpc.analysis.profiles import profile_figure
from cvt_hpc.papers.verdicts import Kept, Measured, Statement, courses, listed, on_strand, over_arc

LOW, NEAR, HIGH = (0.0, 0.15), (0.3,), (0.6, 0.95)  # torque ratios before, at and behind the transition
APART = 10.0  # [N]: push force below which elements count as apart
CLOSE = 0.1  # of the largest push: below it one counts as small, and a state as close to the transition
CONSTANT = 0.01  # of a force that is said to be constant
ALIKE = 0.05  # of two forces that are said to compensate each other
EXIT = 0.95  # share of a wrap behind which its exit lies


def _push(kept: Kept, strand: str, shares: Sequence[float], name: str = "push_force") -> np.ndarray:
    """Means over a strand [N], by torque ratios."""
    return np.array([on_strand(kept.history(load_share=share), name, strand).mean() for share in shares])


def _arcs(kept: Kept, pulley: str) -> list[np.ndarray]:
    """Push over the arc of a pulley [N] at low torque ratios."""
    return [over_arc(kept.history(load_share=share), "push_force", pulley).values for share in LOW]


def _apart_in_t1(kept: Kept) -> Measured:
    push = _push(kept, "t1", LOW)
    return Measured(push < APART, f"P in t1 {listed(push)} N at r 0, 0.15")


def _largest_at_driven_exit(kept: Kept) -> Measured:
    holds, said = [], []
    for push in _arcs(kept, "driven"):
        place = np.argmax(push) / (push.size - 1)
        holds += [push[0] < CLOSE * push.max(), place > EXIT]
        said.append(f"{push.max():.0f} N at {100 * place:.0f} % of the wrap, {push[-1]:.0f} N at its end")
    return Measured(holds, f"largest at r 0, 0.15: {', '.join(said)}")


def _pressed_in_t2(kept: Kept) -> Measured:
    push, ends = _push(kept, "t2", LOW), [arc[-1] for arc in _arcs(kept, "driving")]
    said = f"P in t2 {listed(push)} N at r 0, 0.15; {listed(ends, '.2g')} N at the end of the driving arc"
    return Measured([*(push > APART), *np.less(ends, APART)], said)


def _compensated_by_rings(kept: Kept) -> Measured:
    push, tension = (
        float(np.subtract(*(_push(kept, strand, [0.0], name)[0] for strand in ("t2", "t1"))))
        for name in ("push_force", "ring_tension")
    )
    return Measured([push > 0.0, abs(tension - push) < ALIKE * push],
                    f"without load P_t2 - P_t1 {push:.0f} N, T_t2 - T_t1 {tension:.0f} N")  # fmt: skip


def _close_to_transition(kept: Kept) -> Measured:
    before, near, behind = (_push(kept, "t1", r) - _push(kept, "t2", r) for r in (LOW, NEAR, HIGH))
    said = f"P_t1 - P_t2 {listed(before)} N at r 0, 0.15; {near[0]:.3g} N at 0.3; {listed(behind)} N beyond"
    changes = (before < 0.0).all() and (behind > 0.0).all()
    return Measured([changes and abs(near[0]) < CLOSE * behind[-1]], said)


def _reversed(kept: Kept) -> Measured:
    pressed, apart = _push(kept, "t1", HIGH), _push(kept, "t2", HIGH)
    return Measured([*(pressed > APART), *(apart < APART)],
                    f"P {listed(pressed)} N in t1, {listed(apart, '.2g')} N in t2")  # fmt: skip


def _constant_along_strands(kept: Kept) -> Measured:
    cases = {0.0: "t2"} | dict.fromkeys(HIGH, "t1")
    spreads = [_spread(kept.history(load_share=r), "push_force", strand) for r, strand in cases.items()]
    said = listed(np.multiply(100, spreads), ".2g")
    return Measured(np.less(spreads, CONSTANT), f"within {said} % in t2 at r 0, in t1 at r 0.6, 0.95")


def _spread(history: xr.Dataset, name: str, strand: str) -> float:
    force = on_strand(history, name, strand)
    return float(np.ptp(force) / force.mean())


FIGURE_4 = (
    Statement("At low torque (r 0, 0.15) elements are apart in t1", _apart_in_t1),
    Statement("On the driven arc push builds up, and is largest where elements leave it",
              _largest_at_driven_exit,
              "elastic sheaves press the belt most in the middle of an arc, where push is largest"),
    Statement("In t2 there is push, which decreases to zero on the driving arc", _pressed_in_t2),
    Statement("So elements carry a negative torque, which the rings compensate", _compensated_by_rings),
    Statement("At r 0.30 the system is close to the state in which push changes strands",
              _close_to_transition,
              "it does so at r 0.17; if the paper's M_max is 0.6 of what friction carries, at the same r"),
    Statement("At r 0.60 and 0.95 push is in t1, and helps to drive", _reversed),
    Statement("In simulations push is constant along the strands", _constant_along_strands),
)  # fmt: skip


NOTICED = 0.01  # share of the push that counts as a part of it
PARTS = {"edge_push": "push of rocking edges", "head_push": "push of heads"}
PRESSED = {60.0: "t1", 0.0: "t2"}  # the strand that pushes, by load [N m]


def _divided(kept: Kept) -> list[tuple[xr.Dataset, str]]:
    """Aligned runs with what rocking edges and heads carry of the push [N], and the strand that pushes."""
    found = []
    for load, strand in PRESSED.items():
        history = kept.history(misalignment=0.0, load=load)
        heads = history["head_force_left"] + history["head_force_right"]
        parts = zip(PARTS.items(), (history["push_force"] - heads, heads), strict=True)
        told = {key: part.assign_attrs(units="N", long_name=name) for (key, name), part in parts}
        found.append((history.assign(told), strand))
    return found


def push_parts_figure(kept: Kept) -> Figure:
    """Fig. 5: push of the aligned belt, and what a sensor in the rocking edge would feel of it."""
    return profile_figure([history for history, _ in _divided(kept)], ("push_force", *PARTS))


def _edges_on_arcs(kept: Kept) -> Measured:
    shares = []
    for history, _ in _divided(kept):
        heads, push = (
            sum(over_arc(history, name, pulley).values[1:-1].sum() for pulley in ("driving", "driven"))
            for name in ("head_push", "push_force")
        )
        shares.append(heads / push)
    said = listed(np.multiply(100, shares), ".2g")
    return Measured(np.less(shares, NOTICED), f"heads carry {said} % on the arcs at 60, 0 N m")


def _heads_on_strands(kept: Kept) -> Measured:
    shares = []
    for history, strand in _divided(kept):
        heads, push = (on_strand(history, name, strand).mean() for name in ("head_push", "push_force"))
        shares.append(heads / push)
    said = listed(np.multiply(100, shares), ".2g")
    return Measured(np.greater(shares, NOTICED), f"heads carry {said} % in t1 at 60, in t2 at 0 N m")


def _sum_is_constant(kept: Kept) -> Measured:
    edges, whole = (
        np.array([_spread(history, name, strand) for history, strand in _divided(kept)])
        for name in ("edge_push", "push_force")
    )
    return Measured((whole < CONSTANT) & (edges > CONSTANT),
                    f"there push varies by {listed(100 * whole, '.2g')} %, that of rocking edges by "
                    f"{listed(100 * edges, '.2g')} %")  # fmt: skip


FIGURE_5 = (
    Statement("On the arcs elements touch at the rocking edge alone", _edges_on_arcs),
    Statement("On a strand the contact is divided, partly to the top of the elements", _heads_on_strands),
    Statement("There the edge's signal changes, and the whole push is constant", _sum_is_constant),
)


LOSSES = ("flank_loss", "ring_loss", "tilt_loss", "element_loss", "belt_loss")
OVERALL = 0.01  # of all losses: by how much those of the contacts may miss them


def _losses(kept: Kept, *names: str) -> dict[str, np.ndarray]:
    """Losses [W] or efficiency by rising clamping force, of both pulleys together."""
    found = courses(kept, "thrust", *names)
    return {name: (of.sum("pulley") if "pulley" in of.dims else of).values for name, of in found.items()}


def _losses_by_contact(kept: Kept) -> Measured:
    parts = _losses(kept, *LOSSES, "loss")
    whole = parts.pop("loss")
    said = (f"{name} {listed(100 * (part / whole)[[0, -1]])}" for name, part in parts.items())
    return Measured([np.abs(sum(parts.values()) / whole - 1.0).max() < OVERALL],
                    f"[%] at the least and the largest force: {', '.join(said)}")  # fmt: skip


def _falls_with_clamping(kept: Kept, *names: str) -> Measured:
    found = _losses(kept, *names)
    said = (f"{name} {of[-1]:.3g} to {of[0]:.3g}" for name, of in found.items())
    return Measured([np.all(np.diff(of) > 0.0) for of in found.values()], f"[W] {', '.join(said)}")


def _gains_efficiency(kept: Kept) -> Measured:
    efficiency = _losses(kept, "efficiency")["efficiency"]
    return Measured([np.all(np.diff(efficiency) < 0.0)], f"efficiency {listed(100 * efficiency[::-1])} %")


FIGURES_6_7 = (
    Statement("Losses are found at the single contacts (fig. 6)", _losses_by_contact),
    Statement("Lower clamping forces decrease the losses between elements and pulleys",
              lambda kept: _falls_with_clamping(kept, *LOSSES[:1])),
    Statement("and those within the pushbelt", lambda kept: _falls_with_clamping(kept, *LOSSES[1:]),
              "contacts between elements take about the same at all clamping forces"),
    Statement("which improves the economy", _gains_efficiency),
)  # fmt: skip
