"""Losses of a pushbelt by contact, and in bearings: losses_picture.py TABLE.csv PICTURE.png, of jobs/results.

Of losses_of_cycle.csv: each phase of the driving cycle by the held torque ratio, as fig. 6 of Geier et al.
Of losses.csv: maps over ratio and torque ratio at each clamping force, with bearings as in losses.py.
"""

import sys

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import xarray as xr
from losses import JOB, LOSSES, bearing_loss
from matplotlib.colors import LogNorm

from cvt_hpc import load_job

FORCES = "mean_ring_tension", "mean_push_force"
DARK = 3.0  # [% of the driving power]: colours on which black is not read


def of_phases(table):
    """Draw bars of each phase."""
    phases = table["phase"].unique()
    figure, panels = plt.subplots(1, len(phases), figsize=(11, 3.6), layout="constrained")
    for panel, (phase, rows) in zip(panels, table.groupby("phase", sort=False), strict=True):
        rows.set_index("torque_ratio")[[*LOSSES]].plot.bar(stacked=True, ax=panel, legend=False, rot=0)
        panel.set(title=f"{phase}, {rows['duration'].iloc[0]} s", xlabel="", ylabel="")
    panels[0].set_ylabel("losses [W]")
    names = [name.replace("_", " ") for name in LOSSES]
    figure.legend(panels[0].containers, names, loc="outside upper center", ncols=len(names), frameon=False)
    figure.supxlabel("torque ratio that is held")
    return figure


def by_group(table):
    """Return a table with the losses of each run by the groups of LOSSES [W]."""
    job, bearings = load_job(JOB), []
    for _, row in table.iterrows():
        forces = {name: ("strand", [row[f"{name}_t1"], row[f"{name}_t2"]]) for name in FORCES}
        p = job.point_at({axis.name: row[axis.name] for axis in job.axes})
        bearings.append(bearing_loss(xr.Dataset(forces), p))
    groups = (
        table["flank_loss_driving"] + table["flank_loss_driven"], table["ring_loss"],
        table["element_loss"] + table["tilt_loss"],
        table["belt_loss"] + table["stretch_loss"] + table["lag_loss"], bearings,
    )  # fmt: skip
    return table.assign(**dict(zip(LOSSES, groups, strict=True)))


def over_ratio_and_load(table):
    """Draw what each group takes: the share of the driving power in colour, and the power in words."""
    table = by_group(table)
    thrusts = sorted(table["thrust"].unique())
    figure, panels = plt.subplots(
        len(thrusts), len(LOSSES), figsize=(11, 7), layout="constrained", sharex=True, sharey=True
    )
    for row, thrust in zip(panels, thrusts, strict=True):
        runs = table[table["thrust"] == thrust].pivot(index="ratio", columns="load_share")
        row[0].set_ylabel(f"{thrust / 1e3:g} kN")
        for panel, name in zip(row, LOSSES, strict=True):
            share = 100.0 * runs[name] / runs["driving_power"]
            drawn = panel.imshow(share, origin="lower", norm=LogNorm(0.01, 10.0), cmap="YlOrRd")
            for place, watts in np.ndenumerate(runs[name].to_numpy()):
                told = "slips" if np.isnan(watts) else f"{watts:.{0 if watts > 10.0 else 1}f} W"
                ink = "white" if share.to_numpy()[place] > DARK else "black"
                panel.text(*place[::-1], told, ha="center", va="center", fontsize=8, color=ink)
            panel.set_xticks(range(len(share.columns)), share.columns)
            panel.set_yticks(range(len(share.index)), share.index)
    for panel, name in zip(panels[0], LOSSES, strict=True):
        panel.set_title(name.replace("_", " "))
    figure.supxlabel("torque ratio")
    figure.supylabel("speed ratio, at each clamping force")
    figure.colorbar(drawn, ax=panels, label="share of the driving power [%]")
    return figure


if __name__ == "__main__":
    read = pd.read_csv(sys.argv[1], comment="#").rename(columns=lambda name: name.partition(" [")[0])
    draw = of_phases if "phase" in read else over_ratio_and_load
    draw(read).savefig(sys.argv[2], dpi=110)
