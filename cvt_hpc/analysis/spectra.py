"""Spectra of the strands of one run, as fig. 3.11 of Lebrecht et al. 2004."""

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from cvt_hpc.analysis.figures import WIDTH, entitle, headline, styled

COLOURS = {"t1": "#0072b2", "t2": "#d55e00"}
LINES = {"t1": "-", "t2": "--"}


@styled
def spectrum_figure(run: xr.Dataset) -> Figure:
    """Draw the amplitude of each strand over frequency, with the mode of its peaks.

    Parameters
    ----------
    run : Dataset
        Results of one run: `spectrum` [m] over `strand` and `frequency_bin` [Hz]; `peak_frequency` [Hz],
        `peak_amplitude` [m] and `peak_mode` over `strand` and `peak` (`[record] modal_peaks`).
    """
    figure = Figure((WIDTH, 3.6), layout="constrained")
    axes = figure.subplots()
    lines = run["frequency_bin"].values
    for strand in map(str, run["strand"].values):
        of = run.sel(strand=strand)
        amplitude = 1e6 * of["spectrum"].values
        style = {"color": COLOURS[strand], "ls": LINES[strand], "lw": 1.3}
        axes.plot(lines, amplitude, label=f"strand {strand}", **style)
        largest = np.nanmax(of["peak_amplitude"].values, initial=0.0)
        for peak in range(of.sizes["peak"]):
            mode, size = int(of["peak_mode"][peak]), float(of["peak_amplitude"][peak])
            if mode and size > 0.05 * largest:
                at = float(of["peak_frequency"][peak])
                place = at, float(np.interp(at, lines, amplitude))
                words = {"textcoords": "offset points", "color": COLOURS[strand], "fontsize": 9}
                axes.annotate(f"mode {mode}", place, (5 if strand == "t2" else -38, 3), **words)
    axes.axvspan(500.0, 700.0, color="#ececec", lw=0, zorder=0, label="500 to 700 Hz")
    axes.set(xlabel="frequency [Hz]", ylabel="amplitude [µm]", xlim=(0.0, lines[-1]))
    axes.set_ylim(bottom=0.0)
    axes.grid(lw=0.4, alpha=0.5)
    figure.legend(loc="outside lower center", frameon=False, ncols=3)
    entitle(figure, [headline("Spectra of the strands", run.attrs)], 76)
    return figure
