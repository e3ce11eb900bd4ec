"""Curves of friction over sliding speed, and where motion is fed: fig. 3.12 of Lebrecht et al. 2004."""

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from cvt_hpc.analysis.error_axes import COLOURS, LINES
from cvt_hpc.analysis.figures import WIDTH, entitle, headline, styled
from cvt_hpc.job import stored_job
from cvt_hpc.physics.friction import friction_coefficients, given_law
from cvt_hpc.variables import Vibrates

POINTS = 400
MARKS = {
    Vibrates.YES: ({"marker": "o", "ms": 4.5}, "fed"),
    Vibrates.UNDECIDED: ({"marker": "o", "ms": 4.5, "fillstyle": "none"}, "undecided"),
}


def curves_of(dataset: xr.Dataset, speeds: np.ndarray) -> dict[float, np.ndarray]:
    """Coefficients of friction, regularised, at sliding speeds by the gradient [s/m] of each law of a study.

    Parameters
    ----------
    dataset : Dataset
        Results of a study of the energy criterion over `friction_gradient` and `radial_speed`.
    speeds : (n,) array
        [m/s]
    """
    job: Any = stored_job(json.loads(dataset.attrs["job"]), "dataset")
    found = {}
    for gradient in dataset["friction_gradient"].values:
        point = job.point_at({"friction_gradient": float(gradient)})
        found[float(gradient)] = regularised(point, speeds)
    return found


def regularised(point: Mapping[str, Any], speeds: np.ndarray) -> np.ndarray:
    """Coefficients of friction (n,) of a run's parameters [SI] at sliding speeds (n,) [m/s], unloaded."""
    coefficients = friction_coefficients(given_law(point), speeds, np.zeros(speeds.size))
    return np.asarray(coefficients * np.tanh(speeds / point["friction_speed"]))


@styled
def friction_figure(dataset: xr.Dataset) -> Figure:
    """Draw the curves of a study, with marks where the criterion says that radial motion is fed.

    Parameters
    ----------
    dataset : Dataset
        As `curves_of` takes it.
    """
    sliding = dataset["radial_speed"].values
    along = np.linspace(0.0, sliding.max(), POINTS)
    figure = Figure((WIDTH, 3.8), layout="constrained")
    axes = figure.subplots()
    for k, (gradient, curve) in enumerate(curves_of(dataset, along).items()):
        colour = COLOURS[k % len(COLOURS)]
        label = f"{gradient:g} s/m".replace("-", "−")
        axes.plot(1e3 * along, curve, color=colour, ls=LINES[k % len(LINES)], lw=1.4, label=label)
        verdicts = dataset["vibrates"].sel(friction_gradient=gradient).values
        for verdict, (style, _) in MARKS.items():
            at = sliding[verdicts == verdict]
            axes.plot(1e3 * at, np.interp(at, along, curve), ls="", color=colour, **style)
    for style, label in MARKS.values():
        axes.plot([], [], ls="", color="#333333", label=f"radial motion {label}", **style)
    axes.set(xlabel="sliding speed [mm/s]", ylabel="coefficient of friction", xlim=(0.0, 1e3 * along[-1]))
    axes.set_ylim(bottom=0.0)
    axes.grid(lw=0.4, alpha=0.5)
    figure.legend(loc="outside lower center", frameon=False, ncols=3)
    marks = "marks: by the energy criterion, of radial sliding at that speed"
    entitle(figure, [headline("Curves of friction", dataset.attrs), marks], 76)
    return figure
