"""Statements of Cepon and Boltezar 2011 about figs 3, 7 to 12 and 14 to 16: rubber belt drives."""

import json
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator

from cvt_hpc.analysis import figures
from cvt_hpc.analysis.history_panels import draw_group
from cvt_hpc.analysis.telling_apart import entitle_runs
from cvt_hpc.job import stored_job
from cvt_hpc.papers.verdicts import Kept, Measured, Statement, listed, over_arc
from cvt_hpc.physics.friction import FrictionLaw, friction_coefficients, given_law
from cvt_hpc.variables import Vibrates

POINTS, LEVELS = 120, 10  # forces and speeds at which a table of friction is drawn, and lines of it
SHARE = 0.05  # of the largest coefficient: a change that counts


def _table(kept: Kept) -> FrictionLaw:
    """The table of friction that a study takes."""
    job: Any = stored_job(json.loads(kept.results.attrs["job"]), "results")
    return given_law(job.point_at({"friction_law": "table"}))


@figures.styled
def friction_table_figure(kept: Kept) -> Figure:
    """Draw the coefficient of friction over normal force per length and sliding speed, above 0."""
    law = _table(kept)
    forces, speeds = (np.geomspace(of[0], of[-1], POINTS) for of in (law.table_force, law.table_speed[1:]))
    speed, force = np.meshgrid(speeds, forces)
    mu = friction_coefficients(law, speed.ravel(), force.ravel()).reshape(force.shape)
    figure = Figure((figures.WIDTH, 3.8), layout="constrained")
    axes = figure.subplots()
    where = 1e-3 * force, 1e3 * speed, mu
    axes.contourf(*where, LEVELS, cmap="viridis")
    axes.clabel(axes.contour(*where, LEVELS, colors="white", linewidths=0.8), fontsize=9)
    axes.set(xscale="log", yscale="log", xlabel="normal force [kN/m]", ylabel="sliding speed [mm/s]")
    for axis, nodes in ((axes.xaxis, 1e-3 * law.table_force), (axes.yaxis, 1e3 * law.table_speed[1:])):
        axis.set_minor_locator(NullLocator())
        axis.set_ticks(nodes, [figures.number(node, "g") for node in nodes])
    told = "table of the job, which is assumed; bilinear between its nodes, the ticks"
    figures.entitle(figure, [figures.headline("Coefficient of friction", kept.results.attrs), told], 76)
    return figure


def _by_force_and_speed(kept: Kept) -> Measured:
    mu = _table(kept).table_mu
    by_force, by_speed = mu[[0, -1], mu.shape[1] // 2], mu[mu.shape[0] // 2, [0, -1]]
    return Measured([abs(np.diff(of)[0]) > SHARE * mu.max() for of in (by_force, by_speed)],
                    f"the assumed table has {listed(by_force)} at its least and its largest force, "
                    f"{listed(by_speed)} at its least and its largest speed")  # fmt: skip


FIGURE_3 = (
    Statement("The friction coefficient depends on the normal contact force and the sliding velocity",
              _by_force_and_speed),
)  # fmt: skip


def _by_speed(kept: Kept) -> dict[float, xr.Dataset]:
    """Runs under load, in the order of the torque, by the speed of the driving pulley [rad/s]."""
    loaded = kept.results.sel(load=kept.results["load"] > 0.0).sortby("load")
    return {float(speed): loaded.sel(driving_speed=speed) for speed in loaded["driving_speed"]}


def _above_creep(kept: Kept) -> Measured:
    holds, said = [], []
    for speed, runs in _by_speed(kept).items():
        held = runs.isel(load=(runs["vibrates"] != Vibrates.SLIPS).values)
        creep = held["creep_speed_loss"].values
        losses = ("speed_loss", "expected_speed_loss")
        more, by_compliance = (held[name].values / creep - 1.0 for name in losses)
        part = float(np.median(by_compliance / more))
        holds += [(more > 0.0).all(), part > 0.5]
        said.append(f"{speed:g} rad/s: {100 * more.min():.2g} to {100 * more.max():.2g} % above, of which "
                    f"compliance gives {100 * part:.0f} % (median)")  # fmt: skip
    return Measured(holds, "; ".join(said))


def _slips_through(kept: Kept) -> Measured:
    holds, said = [], []
    for speed, runs in _by_speed(kept).items():
        slips, load = (runs["vibrates"] == Vibrates.SLIPS).values, runs["load"].values
        first = int(np.argmax(slips))
        holds.append(0 < first and slips[first:].all())
        said.append(f"{speed:g} rad/s: " + (f"at {load[first]:g} N m, not at {load[first - 1]:g} N m"
                                            if holds[-1] else "no such torque"))  # fmt: skip
    return Measured(holds, "; ".join(said))


FIGURES_7_8 = (
    Statement("The model's speed loss is above eq. 4, by the radial compliance of the belt", _above_creep,
              "bending takes the rest: it presses the belt into the rubber and stretches it as it comes out"),
    Statement("The model has a torque at which the belt slips through, eq. 4 has none", _slips_through),
)  # fmt: skip


PEAK = 1.3  # times what is beside it
END = 0.2  # share of a wrap: an end, and what is beside it
STIFF = 0.026  # [N m^2]: the paper's bending stiffness


def _peaks_at_both_ends(kept: Kept, name: str) -> Measured:
    """Force over tension, since both rise along an arc by friction, without any peak."""
    keys = (name, "tension")
    force, tension = (over_arc(kept.history(bending_stiffness=STIFF), key, "driven") for key in keys)
    size = np.abs(force.values)
    peaks, beside = [], []
    for share in (force.share, 1.0 - force.share):
        scaled = size / tension.values
        place = int(np.argmax(np.where(share <= END, scaled, 0.0)))
        peaks.append(1e-3 * size[place])
        next_to_it = (share > END) & (share <= 2.0 * END)
        beside.append(1e-3 * float(np.median(scaled[next_to_it])) * tension.values[place])
    said = f"{listed(peaks)} N/mm at entry and exit; tension alone gives {listed(beside, '.2g')} N/mm there"
    return Measured([peak > PEAK * other for peak, other in zip(peaks, beside, strict=True)], said)


def _tension_by_bending(kept: Kept) -> Measured:
    runs = kept.results.sel(load=kept.results["load"].max()).sortby("bending_stiffness")
    slack = runs["strand_tension"].min("strand").transpose("bending_stiffness", ...).values
    return Measured(
        [(slack[-1] > slack[0]).all(), (slack[-1] - slack[0] > 0.5 * slack[-1]).all()],
        f"slack span at {float(runs['load']):g} N m: {listed(slack[-1])} N on soft and hard contacts, "
        f"{listed(slack[0])} N with a tenth of the bending stiffness",
    )


FIGURES_9_10 = (
    Statement("The normal force has peaks where the belt enters and leaves the driven pulley",
              lambda kept: _peaks_at_both_ends(kept, "normal_force")),
    Statement("The tangential force has peaks there",
              lambda kept: _peaks_at_both_ends(kept, "friction_force")),
    Statement("At high torque the slack span's force results mainly from bending, which bulges it outwards",
              _tension_by_bending, "most of it is what friction leaves of the tension at rest"),
)  # fmt: skip


MESH = 248.0  # [Hz]: of 96 elements at 62.8 rad/s
NEAR, AROUND = 0.07, 0.3  # of an eigenfrequency: where its ridge is sought, and what is beside that
STANDS_OUT, FOUND = 1.5, 0.75  # times the spectrum beside it; share of the loads at which a ridge does so


def _ridge_moves(kept: Kept, strand: str, way: float, *modes: int) -> Measured:
    runs = kept.results.sel(strand=strand).sortby("load").transpose("load", ...)
    bins, holds, said = runs["frequency_bin"].values, [], []
    for mode in modes:
        lines, heights = [], []
        theory = runs["eigenfrequency"].sel(half_waves=mode).values
        for expected, spectrum in zip(theory, runs["spectrum"].values, strict=True):
            off = np.abs(bins / expected - 1.0)
            place = int(np.argmax(np.where(off < NEAR, spectrum, 0.0)))
            lines.append(bins[place])
            heights.append(spectrum[place] / np.median(spectrum[(off > NEAR) & (off < AROUND)]))
        seen = float(np.mean(np.greater(heights, STANDS_OUT)))
        holds += [way * np.polyfit(runs["load"].values, lines, 1)[0] > 0.0, seen > FOUND]
        said.append(f"mode {mode} {lines[0]:g} to {lines[-1]:g} Hz, seen at {100 * seen:.0f} % of the loads")
    return Measured(holds, "; ".join(said))


def _first_is_largest(kept: Kept) -> Measured:
    holds, said, passing = [], [], []
    for strand in map(str, kept.results["strand"].values):
        runs = kept.results.sel(strand=strand).transpose("load", ...)
        bins, spectra = runs["frequency_bin"].values, runs["spectrum"].values
        largest = bins[spectra.argmax(axis=1)]
        near = np.abs(largest / runs["eigenfrequency"].sel(half_waves=1).values - 1.0) < 0.1
        holds.append(near.all())
        said.append(f"{strand} at {near.sum()} of {near.size} loads")
        of_mesh = spectra[:, np.abs(bins / MESH - 1.0) < 0.05].max(axis=1)
        passing.append(float(np.median(of_mesh / spectra.max(axis=1))))
    return Measured(holds, f"it has the largest line of {', '.join(said)}; that of passing elements, at "
                           f"{MESH:g} Hz, has {listed(passing, '.2g')} of it (median)")  # fmt: skip


RIDGES = (
    Statement("The first frequency of the slack span falls as the torque rises",
              lambda kept: _ridge_moves(kept, "t1", -1.0, 1)),
    Statement("In the simulation higher ones can be identified too",
              lambda kept: _ridge_moves(kept, "t1", -1.0, 2, 3)),
    Statement("The frequencies of the tight span rise", lambda kept: _ridge_moves(kept, "t2", 1.0, 1, 2)),
)  # fmt: skip
FIRST = "The first natural frequency is the most pronounced"
FIGURES_11_12 = (
    *RIDGES,
    Statement(FIRST, _first_is_largest,
              "belt and pulleys are even, and passing elements excite the strands most, at 245 to 248 Hz"),
)  # fmt: skip
ROUGH_FIGURES_11_12 = (
    *RIDGES,
    Statement(FIRST, _first_is_largest,
              "elsewhere long waves of the belt and run-out, at 5 and 10 Hz, have the largest line, or the "
              "wave of this frequency moves the ends of the strand against each other"),
)  # fmt: skip


SLACK, TIGHT, ARM = "tension_P3-P4", "tension_P5-P1", "arm_T2"
NEGLIGIBLE = 0.01  # speed loss


@figures.styled
def drive_figure(history: xr.Dataset) -> Figure:
    """Draw forces of slack and tight span [N], rotation of an arm [rad] and speeds [rad/s] over time."""
    speeds = [history[name] for name in map(str, history.data_vars) if name.startswith("speed_P")]
    arm = history[ARM].copy(data=np.degrees(history[ARM].values)).assign_attrs(units="°")
    groups = [history[SLACK], history[TIGHT]], [arm], speeds
    figure = Figure((figures.WIDTH, 6.6), layout="constrained")
    for axes, group in zip(figure.subplots(len(groups), 1, sharex=True), groups, strict=True):
        draw_group(axes, group)
        axes.set_xlabel("time [ms]" if group is speeds else "")
        axes.grid(lw=0.4, alpha=0.5)
    entitle_runs(figure, [history], "Serpentine belt drive", "P5-P1, P3-P4: P1-P2, P3-P5 of the paper")
    return figure


def _judged(kept: Kept, name: str) -> np.ndarray:
    """The last half of a course."""
    values: np.ndarray = kept.histories[0][name].values
    return values[values.size // 2 :]


def _forces_follow_speed(kept: Kept) -> Measured:
    ripple = json.loads(kept.histories[0].attrs["point"])["ripple_frequency"]
    step = float(np.diff(kept.histories[0]["time"].values).mean())
    lines = []
    for force in (_judged(kept, SLACK), _judged(kept, TIGHT)):
        size = np.abs(np.fft.rfft(force - force.mean()))
        lines.append(np.fft.rfftfreq(force.size, step)[size.argmax()])
    return Measured([abs(line - ripple) < 0.05 * ripple for line in lines],
                    f"largest lines at {listed(lines)} Hz, ripple of the speed at {ripple:g} Hz")  # fmt: skip


def _slack_varies_less(kept: Kept) -> Measured:
    slack, tight = _judged(kept, SLACK).std(), _judged(kept, TIGHT).std()
    holds = [slack < 0.5 * tight]
    return Measured(holds, f"{slack:.0f} N in the slack, {tight:.0f} N in the tight span (rms)")


def _arm_turns(kept: Kept) -> Measured:
    angle = np.degrees(_judged(kept, ARM))
    mean, swing = float(angle.mean()), float(np.ptp(angle))
    return Measured([abs(mean) > 0.1, swing > 0.1], f"by {mean:.3g} deg, and swings by {swing:.3g} deg")


def _loses_no_speed(kept: Kept) -> Measured:
    loss = 1.0 - _judged(kept, "speed_P5").mean() / _judged(kept, "speed_P1").mean()
    return Measured([0.0 < loss < NEGLIGIBLE], f"{100 * loss:.2g} %")


FIGURES_14_16 = (
    Statement("Axial forces depend on time, as the speed does", _forces_follow_speed),
    Statement("The force varies considerably less in the slack span (fig. 14)", _slack_varies_less),
    Statement("The simulation tells how arm T2 rotates (fig. 15)", _arm_turns),
    Statement("The speed loss from P1 to P2 is practically negligible (fig. 16)", _loses_no_speed),
)
