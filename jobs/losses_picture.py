"""Losses by contact in each phase of the driving cycle: losses_picture.py losses_of_cycle.csv PICTURE.png.

As fig. 6 of Geier et al. 2007. Phases and clamping are those of losses.py.
"""

import sys

import matplotlib.pyplot as plt
import pandas as pd

if __name__ == "__main__":
    table = pd.read_csv(sys.argv[1], comment="#")
    phases = table["phase"].unique()
    parts = table.columns[table.columns.get_loc("flanks [W]") : table.columns.get_loc("loss [W]")]
    figure, panels = plt.subplots(1, len(phases), figsize=(11, 3.6), layout="constrained")
    for panel, (phase, rows) in zip(panels, table.groupby("phase", sort=False), strict=True):
        rows.set_index("torque_ratio")[parts].plot.bar(stacked=True, ax=panel, legend=False, rot=0)
        panel.set(title=f"{phase}, {rows['duration [s]'].iloc[0]} s", xlabel="", ylabel="")
    panels[0].set_ylabel("losses [W]")
    names = [part.removesuffix(" [W]").replace("_", " ") for part in parts]
    figure.legend(panels[0].containers, names, loc="outside upper center", ncols=len(parts), frameon=False)
    figure.supxlabel("torque ratio that is held")
    figure.savefig(sys.argv[2], dpi=110)
