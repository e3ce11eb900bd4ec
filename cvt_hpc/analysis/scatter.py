"""Maps of a sampled study: a mark for each run, in a panel for each pair of axes."""

from itertools import combinations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.axis import XAxis, YAxis
from matplotlib.figure import Figure, FigureBase
from matplotlib.markers import MarkerStyle
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from numpy.typing import NDArray

from cvt_hpc.analysis import cells, figures
from cvt_hpc.analysis.arrangement import Fixed
from cvt_hpc.analysis.classes import OccurrenceClass, at_strongest_strand, count_classes, occurrence_classes
from cvt_hpc.analysis.courses import line_of_study
from cvt_hpc.errors import mismatch

_MOST_AXES = 4  # six pairs; the first axes of the job
BESIDE, HEIGHT = 2, 2.6  # panels side by side, and their height [inch]
_SIZE = 6.0  # [point], of the mark of a vibrating run
_FIRST = ("load", "friction_gradient")  # along x and along y, where they are


def is_sampled(dataset: xr.Dataset) -> bool:
    """Whether the runs of a dataset are samples, not a grid."""
    return dataset["status"].dims == ("run",)


def scatter_figure(dataset: xr.Dataset, at: Fixed, source: str, vmax: cells.End = None) -> Figure:
    """Compose the map of a sampled study; arguments as of `map_figure`.

    The axes are coordinates along `run`, and `at` has to be empty: no two samples lie at one value of one.
    """
    if at:
        raise mismatch(f"{source}: at {next(iter(at))}", "results over a grid", "samples, all apart")
    figure = Figure((figures.WIDTH, scatter_height(dataset)), layout="constrained")
    classes = occurrence_classes(dataset).values
    vibrates = classes == OccurrenceClass.VIBRATING
    amplitude = np.where(vibrates, at_strongest_strand(dataset, "amplitude") * 1e6, np.nan)
    scale = cells.amplitude_scale(amplitude, vmax)
    panels = draw_samples(figure, dataset, classes, amplitude, scale)
    if np.isfinite(amplitude).any():
        cells.colour_bar(figure, scale, amplitude, ax=panels, pad=0.02)
    head = figures.headline("Vibration occurrence", dataset.attrs)
    title = [head, f"{classes.size} samples: {count_classes(classes)}"]
    names = sample_axes(dataset)
    if len(names) > _MOST_AXES:
        title.append(f"the first {_MOST_AXES} of {len(names)} axes")
    figures.entitle(figure, [*title, line_of_study(dataset)])
    figures.legend_below(figure, figures.entries_of(panels[0, :1]), cells.LEGEND_COLUMNS)
    return figure


def scatter_height(dataset: xr.Dataset, beside: int = BESIDE, height: float = HEIGHT) -> float:
    """Height [inch] of the map of a sampled study, of so many panels side by side and so high."""
    pairs = len(_pairs(dataset))
    return 3.6 if pairs == 1 else height * -(-pairs // beside) + 1.2


def draw_samples(
    figure: FigureBase,
    dataset: xr.Dataset,
    classes: NDArray[np.int8],
    amplitude: NDArray[np.float64],
    scale: cells.Scale,
    beside: int = BESIDE,
) -> figures.Panels:
    """Draw the runs of a sampled study by class, in a panel for each pair of axes, and return the panels.

    Classes (run,) are keys of `cells.ALL_STYLES`. The amplitude (run,) colours the vibrating runs by the
    scale; not a number leaves the colour of the class. `beside` panels stand side by side at most.
    """
    pairs = _pairs(dataset)
    columns = min(len(pairs), beside)
    panels = figure.subplots(-(-len(pairs) // columns), columns, squeeze=False)
    for axes, (x, y) in zip(panels.flat, pairs, strict=False):
        _draw_runs(axes, dataset, x, y, classes, amplitude, scale)
    for axes in panels.flat[len(pairs) :]:
        axes.set_axis_off()
    return panels


def sample_axes(dataset: xr.Dataset) -> list[str]:
    """Names of the axes of a sampled study, those that lie along x and y first."""
    along = {str(name): array for name, array in dataset.coords.items() if array.dims == ("run",)}
    names = [name for name, array in along.items() if "derived" not in array.attrs]
    return sorted(names, key=lambda name: _FIRST.index(name) if name in _FIRST else len(_FIRST))


def _pairs(dataset: xr.Dataset) -> list[tuple[str, str | None]]:
    names = sample_axes(dataset)[:_MOST_AXES]
    return list(combinations(names, 2)) or [(names[0], None)]


def _draw_runs(
    axes: Axes,
    dataset: xr.Dataset,
    x: str,
    y: str | None,
    classes: NDArray[np.int8],
    amplitude: NDArray[np.float64],
    scale: cells.Scale,
) -> None:
    """Mark the runs of one panel; without a second axis all at one height."""
    across, x_label = _along(dataset[x])
    up, y_label = _along(dataset[y]) if y else (np.zeros(across.size), "")
    for kind, style in cells.ALL_STYLES.items():
        of_kind = classes == kind
        if not of_kind.any():
            continue
        is_filled = MarkerStyle(style.mark).is_filled()
        size = (_SIZE * min(style.mark_size, 1.5)) ** 2
        look = {"marker": style.mark, "edgecolors": style.rim if is_filled else None, "linewidths": 0.6}
        marks = axes.scatter(across[of_kind], up[of_kind], size, label=kind.label, **look)
        # a mark that stands alone has the colour of the cell in which it would stand on a grid
        alike = is_filled and (kind is OccurrenceClass.VIBRATING or kind in cells.OF_PAIRS)
        marks.set_facecolor(cells.fills_of(kind, amplitude[of_kind], scale) if alike else style.ink)
    axes.set(xlabel=x_label, ylabel=y_label)
    if y is None:
        axes.set_yticks([])
    for side, name in (("x", x), ("y", y)):
        if name and dataset[name].attrs.get("spacing") == "log":
            axes.set(**{f"{side}scale": "log"})
            _tick_logarithmic(axes.xaxis if side == "x" else axes.yaxis)


def _tick_logarithmic(axis: XAxis | YAxis) -> None:
    """Label a logarithmic axis by plain numbers, the closer the shorter it is."""
    low, high = axis.get_view_interval()
    multiples = (1, 1.5, 2, 3, 5, 7) if high < 10 * low else (1, 2, 5) if high < 1e3 * low else (1,)
    axis.set_major_locator(LogLocator(subs=multiples))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def _along(coordinate: xr.DataArray) -> tuple[NDArray[np.float64], str]:
    """Values of an axis in display units, and its label."""
    factor, unit = figures.coordinate_unit(coordinate.attrs)
    return coordinate.values * factor, figures.axis_label(coordinate, unit)
