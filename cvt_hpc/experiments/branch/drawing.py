"""The picture of a branch, by the usual conventions of bifurcation diagrams.

Above the steady state, solid where it is stable and dashed where it is not, its Hopf points and the
amplitudes of limit cycles as dots; below growth rates and frequencies of its modes. Between loads without a
steady state nothing is drawn. Runs that failed or slip have no limit cycle: they stand at the upper edge.
"""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from cvt_hpc.analysis.figures import WIDTH, balanced, coordinate_unit
from cvt_hpc.experiments.branch.attractors import FROM, OF_MODES, Attractor, Followed, Stability
from cvt_hpc.experiments.branch.job import Diagram, load_attributes
from cvt_hpc.experiments.branch.table import gap_lines, place_text
from cvt_hpc.models.linear_stability.branch import Onset
from cvt_hpc.vibration.classes import OccurrenceClass
from cvt_hpc.vibration.criticality import Kind

STRANDS = ("#0072b2", "#d55e00")  # t1 and t2
HOPF, GAP = "#c00000", "#e6e6e6"
STARTS = (("o", "#000000"), ("D", "#009e73"))  # of runs from the steady state and from the large start
EDGE = (0.96, 0.90)  # how high up the sheet runs without a limit cycle stand, of either start
_AT_EDGE = {  # their marks, and words
    OccurrenceClass.FAILED: ("X", "failed {} (no amplitude)"),
    OccurrenceClass.SLIPPING: (">", "slips {} (no limit cycle)"),
}
IRREGULAR = "#f3dca3"  # inside of the dots
_MARK = 4.5  # [point]
KINDS = {
    Kind.SUPERCRITICAL: {"marker": "s", "markersize": 7},
    Kind.SUBCRITICAL: {"marker": "s", "markersize": 7, "markerfacecolor": "white", "markeredgewidth": 1.5},
    Kind.UNDECIDED: {"marker": "x", "markersize": 7, "markeredgewidth": 1.5},
}


def branch_figure(diagram: Diagram, followed: Followed) -> Figure:
    """Compose the picture of one branch; to be called within STYLE."""
    figure = Figure((WIDTH, 8.2), layout="constrained")
    upper, middle, lower = figure.subplots(3, 1, sharex=True, height_ratios=(1.2, 1.1, 1.0))
    scale, unit = coordinate_unit(load_attributes(diagram.job))
    _draw_attractors(upper, followed, scale)
    _draw_modes(middle, lower, followed, scale)
    loads = followed.states["load"]
    for axes in (upper, middle, lower):
        for low, high in _gaps(loads, followed.missed):
            axes.axvspan(scale * low, scale * high, color=GAP, linewidth=0, zorder=0)
        for onset in followed.onsets:
            axes.axvline(scale * onset.load, color=HOPF, linewidth=0.8, linestyle=":", zorder=1)
        axes.set_xlim(scale * loads[0], scale * loads[-1])
    lower.set_xlabel(f"load [{unit}]")
    lines = [f"Steady states along the load: {diagram.job.name}", place_text(diagram, followed.asked)]
    lines += gap_lines(diagram, followed)
    figure.suptitle("\n".join(balanced(line, 90) for line in lines if line), fontsize=10)
    figure.legend(handles=_legend(followed), loc="outside lower center", ncols=2, frameon=False)
    return figure


def stable_parts(loads: np.ndarray, is_stable: bool, onsets: list[Onset]) -> list[tuple[float, float, bool]]:
    """Return the loads between which steady states are stable, or not: from, to [N m], whether stable.

    Loads are ascending, without a gap between them [N m]; `is_stable` tells whether the state under the first
    one is. Onsets are Hopf points of the branch, except those of states that are unstable anyway.
    """
    first, last = loads[0], loads[-1]
    turns = [onset for onset in onsets if first < onset.load < last and not onset.others]
    ends = [first, *(onset.load for onset in turns), last]
    stable = [turns[0].rising if turns else is_stable]
    stable += [not onset.rising for onset in turns]
    return list(zip(ends[:-1], ends[1:], stable, strict=True))


def _draw_attractors(axes: Axes, followed: Followed, scale: float) -> None:
    """Draw the steady state, its Hopf points and the results of runs over `scale` times the load."""
    loads, is_stable = followed.states["load"], followed.states["stability"] == Stability.STABLE
    for piece in np.ma.clump_unmasked(np.ma.array(loads, mask=followed.missed)):
        for low, high, stable in stable_parts(loads[piece], is_stable[piece][0], followed.onsets):
            style = "-" if stable else (0, (4, 3))
            ends = [scale * low, scale * high]
            axes.plot(ends, [0.0, 0.0], color="black", linewidth=1.8, linestyle=style, clip_on=False)
    for start, (mark, colour) in enumerate(STARTS):
        fills = (
            (OccurrenceClass.VIBRATING, colour),
            (OccurrenceClass.UNDECIDED, "none"),
            (OccurrenceClass.IRREGULAR, IRREGULAR),
        )
        for kind, fill in fills:
            shown = [run for run in followed.runs if (run.start, run.occurrence) == (start, kind)]
            axes.plot(
                [scale * run.value for run in shown],
                [run.amplitude * 1e6 for run in shown],
                linestyle="",
                marker=mark,
                markersize=_MARK - 1.5 * start,
                markeredgecolor=colour,
                markerfacecolor=fill,
                zorder=3 + start,
            )
    for run in _at_edge(followed):
        axes.plot(
            scale * run.value,
            EDGE[run.start],
            transform=axes.get_xaxis_transform(),
            marker=_AT_EDGE[run.occurrence][0],
            markersize=_MARK + 2.0,
            color=STARTS[run.start][1],
            linestyle="",
            clip_on=False,
            zorder=6,
        )
    for onset, criticality in zip(followed.onsets, followed.kinds, strict=True):
        axes.plot(scale * onset.load, 0.0, color=HOPF, clip_on=False, zorder=6, **KINDS[criticality.kind])
    axes.set_ylabel("amplitude [µm]")
    axes.set_ylim(bottom=0.0)


def _at_edge(followed: Followed) -> list[Attractor]:
    """Return the runs that have come to no limit cycle."""
    return [run for run in followed.runs if run.occurrence in _AT_EDGE]


def _draw_modes(growth: Axes, frequency: Axes, followed: Followed, scale: float) -> None:
    """Draw growth rate and frequency of the modes over `scale` times the load, unstable ones thick."""
    growth.axhline(0.0, color="black", linewidth=0.8)
    values = [followed.states[name].T for name in OF_MODES]
    for line in zip(*values, strict=True):
        there = np.isfinite(line[0])
        loads = scale * followed.states["load"][there]
        rates, frequencies, strands, waves = (value[there] for value in line)
        leading = rates.argmax()
        style = {"color": STRANDS[int(strands[leading]) - 1], "marker": ".", "markersize": 4.0}
        style["linewidth"] = 1.8 if rates[leading] > 0.0 else 0.8
        growth.plot(loads, rates, **style)
        frequency.plot(loads, frequencies, **style)
        if rates[leading] > 0.0:
            at, told = (loads[leading], frequencies[leading]), _waves(int(waves[leading]))
            frequency.annotate(told, at, (0, 5), textcoords="offset points", fontsize=8)
    growth.set_ylabel("growth rate [1/s]")
    frequency.set_ylabel("frequency [Hz]")


def _waves(count: int) -> str:
    return f"{count} half wave{'s' if count > 1 else ''}"


def _gaps(loads: np.ndarray, missed: np.ndarray) -> list[tuple[float, float]]:
    """Return pairs of loads with a steady state, between which there is none."""
    gaps = np.ma.clump_masked(np.ma.array(loads, mask=missed))
    last = len(loads) - 1
    return [(loads[max(gap.start - 1, 0)], loads[min(gap.stop, last)]) for gap in gaps]


def _legend(followed: Followed) -> list[Line2D | Patch]:
    """Return the entries of the legend."""
    handles: list[Line2D | Patch] = [
        Line2D([], [], color="black", linewidth=1.8, label="steady state, stable"),
        Line2D([], [], color="black", linewidth=1.8, linestyle=(0, (4, 3)), label="unstable"),
    ]
    handles += [
        Line2D([], [], color=HOPF, linestyle="", label=f"Hopf point, {kind.name.lower()}", **KINDS[kind])
        for kind in sorted({one.kind for one in followed.kinds})
    ]
    if followed.runs:
        handles += [
            Line2D([], [], color=colour, marker=mark, markersize=_MARK, ls="", label=f"limit cycle {text}")
            for (mark, colour), text in zip(STARTS, FROM, strict=True)
        ]
        open_mark = {"marker": "o", "markerfacecolor": "none", "markeredgecolor": "black", "linestyle": ""}
        handles.append(Line2D([], [], markersize=_MARK, label="undecided", **open_mark))
        if any(run.occurrence == OccurrenceClass.IRREGULAR for run in followed.runs):
            filled = open_mark | {"markerfacecolor": IRREGULAR}
            handles.append(Line2D([], [], markersize=_MARK, label="irregular", **filled))
    for kind, start in sorted({(run.occurrence, run.start) for run in _at_edge(followed)}):
        mark, words = _AT_EDGE[kind]
        style = {"color": STARTS[start][1], "marker": mark, "markersize": _MARK + 2.0, "linestyle": ""}
        handles.append(Line2D([], [], label=words.format(FROM[start]), **style))
    handles += [
        Line2D([], [], color=colour, marker=".", label=f"mode of strand t{k}")
        for k, colour in enumerate(STRANDS, 1)
    ]
    if followed.missed.any():
        handles.append(Patch(color=GAP, label="no steady state found"))
    return handles
