"""Maps of vibration occurrence over a study's grid: classes first, then amplitude and frequency.

The classes differ in lightness, in hatching and in the mark on the grid point, so that a map reads the
same in colour, in grey and in small print. Cells whose class is inferred have level lines and no mark.
Vibrating cells are coloured by amplitude, darker for larger. Their frequency is written into the cells where
there is room, and drawn as a second set of panels where there is none. Cells whose strongest line is a higher
harmonic of it have a diamond for a dot. Into irregular cells their amplitude is written where there is room.

Where runs begin with a small and with a large disturbance, one map shows where the start decides.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import xarray as xr
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from cvt_hpc.analysis import arrangement as layout
from cvt_hpc.analysis import cells, figures
from cvt_hpc.analysis.arrangement import arrange, value_text
from cvt_hpc.analysis.classes import (
    ALONG,
    OccurrenceClass,
    at_strongest_strand,
    check_results,
    count_classes,
    map_classes,
    occurrence_classes,
)
from cvt_hpc.analysis.conversion import standard
from cvt_hpc.analysis.courses import line_of_study
from cvt_hpc.analysis.eigenfrequencies import eigenfrequency_figure
from cvt_hpc.analysis.hysteresis_bands import draw_onsets
from cvt_hpc.analysis.measured import File, Overlay, side_of
from cvt_hpc.analysis.probability import PROBABILITY, has_samples
from cvt_hpc.analysis.probability_drawing import probability_figure
from cvt_hpc.analysis.scatter import is_sampled, scatter_figure
from cvt_hpc.errors import mismatch
from cvt_hpc.variables import Vibrates, shortened
from cvt_hpc.vibration.classes import StartClass, classify_starts

AXIS = "disturbance"
_LEADS = 1.5  # strongest line over the fundamental, which is a whole number

FRAME = 1.9  # [inch]: what title, labels and legend take of a page's height
MOST_COLUMNS, NAMED = 6, 2  # panels side by side; in how many columns each has room for the name of its axis
_ROOMY = 4  # panels side by side with ticks that are all labelled
_SMALLEST_APART = 3.0  # [point]: on smaller cells marks, and the lines between, would hide the classes
TITLE_HEIGHT = 0.42  # [inch], of a panel with the space around it
LEAST = TITLE_HEIGHT + 0.6  # [inch], of a panel that is readable
_TITLE_LETTERS = 78  # of titles side by side


@figures.styled
def map_figure(
    dataset: xr.Dataset,
    at: layout.At = None,
    source: str = "results",
    sides: layout.Sides = layout.CHOSEN,
    vmax: cells.End = None,
    measured: File = None,
) -> Figure:
    """Draw where vibration occurs.

    Arguments as of all pictures of results (`figures.py`): `status` and `vibrates` over the job's axes;
    `amplitude` [m], `frequency` and `strongest_frequency` [Hz], per strand, where known; `inferred_class` of
    a trace. The stronger strand is shown. Of a study of samples the axes lie along `run`: each run is a mark,
    there is a panel for each pair of axes, and neither `at`, `sides` nor `measured` can be given. Results
    that hold `eigenfrequency` but no `amplitude` are drawn as lines over the axis that else runs along x. Of
    a study with the axis `disturbance` the runs from the smallest and the largest value make one cell. Of
    samples of uncertain parameters the probability of vibration is drawn.

    `vmax` is the amplitude at which linear colours end [m], or "fit", that of this map, of 98 % of the
    vibrating cells where few lie far above; by default they are logarithmic, and those of all maps.
    """
    dataset = standard(dataset, source)
    check_results(dataset, source)
    over = Overlay(measured, dataset, source)
    if is_sampled(dataset):
        if sides != layout.CHOSEN:
            found = "samples, in a panel for each pair"
            raise mismatch(f"{source}: x, y, panel", "results over a grid", found)
        return scatter_figure(dataset, at or {}, source, vmax)
    if has_samples(dataset, at or {}) or PROBABILITY in dataset:
        return probability_figure(dataset, at, source, sides, measured)
    if "eigenfrequency" in dataset and "amplitude" not in dataset:
        return eigenfrequency_figure(dataset, at or {}, source, sides, measured)
    if has_starts(dataset, at or {}):
        dataset = join_starts(dataset)
    return _grid_figure(layout.arrange(dataset, at or {}, source, sides), vmax, source, over)


@dataclass(frozen=True)
class Sheet:
    """Contents of the panels, arrays of shape (panel, row, column), and their places."""

    arrangement: layout.Arrangement
    x: layout.Ruler
    y: layout.Ruler
    classes: NDArray[np.int8]
    inferred: NDArray[np.bool_]  # whether the class of a cell is not that of a run
    amplitude: NDArray[np.float64]  # [um], nan where a run does not vibrate
    frequency: NDArray[np.float64]  # [Hz], likewise
    leads: NDArray[np.bool_]  # whether a harmonic is stronger than the fundamental
    irregular: NDArray[np.float64]  # amplitude [um] of runs that are irregular, nan elsewhere
    columns: int = 1  # panels side by side
    panel_height: float = LEAST  # [inch], with the title

    @property
    def writes_frequency(self) -> bool:
        """Whether the frequency is written into the cells; else it has panels of its own."""
        return self.has_room and self.has_frequency

    @property
    def has_frequency(self) -> bool:
        """Whether that of any cell is known."""
        return bool(np.isfinite(self.frequency).any())

    @property
    def frequency_label(self) -> str:
        """Name and unit of the frequency: of datasets of earlier versions it is the dominant one."""
        return f"{figures.in_words(self.arrangement.dataset['frequency'])} [Hz]"

    @property
    def blocks(self) -> int:
        """Sets of panels above each other: amplitude, and frequency where it is not written into them."""
        return 2 if self.has_frequency and not self.writes_frequency else 1

    @property
    def height(self) -> float:
        """Height of all panels [inch]."""
        return self.blocks * self.rows * self.panel_height

    @property
    def panels(self) -> int:
        """Number of panels."""
        return len(self.classes)

    @property
    def rows(self) -> int:
        """Panels above each other."""
        return -(-self.panels // self.columns)

    @property
    def wanted_height(self) -> float:
        """Height of a panel [inch]: rows of cells hold a line of text as long as the page allows it."""
        rows = self.y.centres.size
        tall = TITLE_HEIGHT + 0.36 * rows
        height = tall if tall * self.rows <= 6.5 else TITLE_HEIGHT + float(np.clip(0.14 * rows, 0.35, 2.0))
        return max(height, 2.0 / self.rows)  # room for the colour bar's label

    @property
    def smallest_cell(self) -> tuple[float, float]:
        """Width and height of the smallest cell [point]."""
        width = (figures.WIDTH - 1.9) / self.columns  # ticks, labels and the colour bar take the rest
        height = self.panel_height - TITLE_HEIGHT
        x, y = (np.diff(side.edges).min() / np.ptp(side.edges) for side in (self.x, self.y))
        return 72 * width * x, 72 * height * y

    @property
    def has_room(self) -> bool:
        """Whether three digits fit into the smallest cell, above a dot."""
        width, height = self.smallest_cell
        return width >= 22 and height >= 22  # [point]


def _grid_figure(arrangement: layout.Arrangement, vmax: cells.End, source: str, over: Overlay) -> Figure:
    """Compose the map of a study over a grid; to be called within STYLE."""
    sheet = sheet_of(arrangement, source)
    figure = Figure((figures.WIDTH, sheet.height + FRAME), layout="constrained")
    # not shared: matplotlib would go through all panels for each
    axes = figure.subplots(sheet.blocks * sheet.rows, sheet.columns, squeeze=False)
    amplitude = cells.amplitude_scale(sheet.amplitude, vmax)
    draw_block(figure, axes[: sheet.rows], sheet, sheet.amplitude, amplitude)
    texts = [(OccurrenceClass.IRREGULAR, sheet.irregular)] if sheet.has_room else []
    texts += [(OccurrenceClass.VIBRATING, sheet.frequency)] if sheet.writes_frequency else []
    for kind, values in texts:
        panels = zip(axes.flat, sheet.classes, values, sheet.amplitude, strict=False)
        for ax, classes, numbers, fills in panels:
            for row, column in np.argwhere((classes == kind) & np.isfinite(numbers)):
                (fill,) = cells.fills_of(kind, fills[row : row + 1, column], amplitude)
                value, place = numbers[row, column], (sheet.x.centres[column], sheet.y.centres[row])
                text = f"{value:.0f}" if value >= 10.0 else f"{value:.2g}"
                cells.write_value(ax, place, text, fill, above=2.5)
    if sheet.blocks == 2:
        norm = cells.norm_over(sheet.frequency)
        frequency = cells.Scale(cells.FREQUENCY_COLOURS, norm, sheet.frequency_label)
        draw_block(figure, axes[sheet.rows :], sheet, sheet.frequency, frequency)
    further = _draw_onsets(axes, sheet)
    x, y = (side_of(arrangement.dataset, name) for name in (arrangement.x, arrangement.y))
    for panel, ax in _panels_of(axes, sheet):
        at = {arrangement.panel: panel} if arrangement.panel else {}
        over.draw(ax, x, y, arrangement.dataset.coords.to_dataset().isel(at, missing_dims="ignore"))
    further += over.handles
    if sheet.leads.any() and min(sheet.smallest_cell) >= _SMALLEST_APART:
        further.append(Line2D([], [], **cells.LEADING.marks(4.0), label="harmonics lead"))
    figures.entitle(figure, [*_title(sheet), over.note])
    figure.supylabel(sheet.y.label)
    styles, columns = cells.STYLES, cells.LEGEND_COLUMNS - bool(over.handles)  # whose names are longer
    if "starts" in arrangement.dataset.attrs:
        styles, columns = cells.STYLES | cells.OF_STARTS, 3  # as wide as the page with the longest label
    shown = {kind: style for kind, style in styles.items() if np.any(sheet.classes == kind)}
    cells.class_legend(figure, shown, columns, with_inferred=bool(sheet.inferred.any()), further=further)
    if sheet.columns > NAMED:
        _lay_out(figure, [ax for ax in axes.flat if not (ax.xaxis.get_visible() or ax.yaxis.get_visible())])
    return figure


def _lay_out(figure: Figure, inner: list[Axes]) -> None:
    """Find the places of all panels by the outer ones, once: to ask each takes as long as to draw it."""
    figures.as_written(figure)
    for ax in inner:
        ax.set_visible(False)
    engine = figure.get_layout_engine()
    assert engine is not None
    engine.execute(figure)
    figure.set_layout_engine("none")
    for ax in inner:
        ax.set_visible(True)


def _draw_onsets(axes: figures.Panels, sheet: Sheet) -> list[Artist]:
    """Lines of onset along the load, or the axis in its place; return handles for the legend."""
    arrangement = sheet.arrangement
    along = next((name for name in ALONG if name in (arrangement.x, arrangement.y)), None)
    handles: dict[str, Artist] = {}
    if along is None or arrangement.y is None:
        return []  # of a single row the cells show it
    for panel, ax in _panels_of(axes, sheet):
        cells_of, axis = (sheet.x, sheet.y, sheet.classes[panel]), arrangement.dataset[along]
        for handle in draw_onsets(ax, *cells_of, axis, along == arrangement.y):
            handles.setdefault(handle.get_label(), handle)
    return list(handles.values())


def _panels_of(axes: figures.Panels, sheet: Sheet) -> Iterator[tuple[int, Axes]]:
    """Yield the panels that hold cells, of all blocks, with their numbers within these."""
    for k, ax in enumerate(axes.flat):
        if (panel := k % (sheet.rows * sheet.columns)) < sheet.panels:
            yield panel, ax


def sheet_of(arrangement: layout.Arrangement, source: str = "results", frame: float = FRAME) -> Sheet:
    """The arranged variables with all three dimensions, missing ones of length one, laid out on a page.

    `frame` [inch] is what else the page holds; InputError, which names the source, where it is too small.
    """
    dataset = arrangement.dataset
    names = [arrangement.panel, arrangement.y, arrangement.x]

    def grid(variable: xr.DataArray) -> np.ndarray:
        present = variable.transpose(*filter(None, names))
        return present.values.reshape([dataset.sizes[name] if name else 1 for name in names])

    runs, classes = grid(occurrence_classes(dataset)), grid(map_classes(dataset))
    vibrating = runs == OccurrenceClass.VIBRATING
    irregular = runs == OccurrenceClass.IRREGULAR
    if "vibrates" in dataset:
        # of a cell from two starts the amplitude is that from the small one
        irregular &= grid(dataset["vibrates"]) == Vibrates.IRREGULAR
    read = ("amplitude", "frequency", "strongest_frequency")
    amplitude, frequency, strongest = (grid(at_strongest_strand(dataset, name)) for name in read)
    amplitude *= 1e6
    sheet = Sheet(
        arrangement,
        layout.ruler(dataset[arrangement.x]),
        layout.ruler(dataset[arrangement.y]) if arrangement.y else layout.ONE_ROW,
        classes,
        classes != runs,
        np.where(vibrating, amplitude, np.nan),
        np.where(vibrating, frequency, np.nan),
        vibrating & (strongest > _LEADS * frequency),
        np.where(irregular, amplitude, np.nan),
    )
    return _laid_out(sheet, source, frame)


def _laid_out(sheet: Sheet, source: str, frame: float) -> Sheet:
    """The sheet on a page: in few columns, else with lower panels, in more columns, or without frequency."""
    for columns in range(1, min(_ROOMY, sheet.panels) + 1):
        roomy = replace(sheet, columns=columns)
        roomy = replace(roomy, panel_height=roomy.wanted_height)
        if roomy.height + frame <= figures.LONG:
            return roomy
    name = sheet.arrangement.panel
    then = f"fix an axis, as by `--at {name}=VALUE`, or choose another one by `--panel AXIS`"
    counts = range(1, min(MOST_COLUMNS, sheet.panels) + 1)
    sizes = LEAST, sheet.wanted_height
    half = 0.5 * (figures.LONG - frame)
    grid = figures.fitting(sheet.panels, counts, sizes, half) if sheet.has_frequency else None
    if grid is None:
        sheet = replace(sheet, frequency=np.full_like(sheet.frequency, np.nan))
        grid = figures.on_a_page(sheet.panels, counts, sizes, frame, source, then)
    return replace(sheet, columns=grid.columns, panel_height=grid.height)


def draw_block(
    figure: Figure, axes: figures.Panels, sheet: Sheet, values: NDArray[np.float64], scale: cells.Scale
) -> None:
    """One set of panels, their vibrating cells coloured by `values`, and the colour bar."""
    mark = float(np.clip(0.35 * min(sheet.smallest_cell), 1.5, 5.0))
    apart = min(sheet.smallest_cell) >= _SMALLEST_APART
    for panel, ax in enumerate(axes.flat):
        if panel >= sheet.panels:
            ax.set_axis_off()
            continue
        classes, inferred = sheet.classes[panel], sheet.inferred[panel]
        cells.draw_cells(ax, sheet.x, sheet.y, classes, inferred, values[panel], scale)
        if apart:
            cells.draw_grid(ax, sheet.x, sheet.y)
            cells.draw_marks(ax, sheet.x, sheet.y, classes, ~inferred, mark)
            rows, columns = np.nonzero(sheet.leads[panel])
            look = {**cells.LEADING.marks(mark), "mew": 0.2 * mark, "zorder": 2.3}  # over the dots
            if rows.size:
                ax.plot(sheet.x.centres[columns], sheet.y.centres[rows], **look, rasterized=True)
        _label_panel(ax, sheet, panel)
    if np.isfinite(values).any():
        cells.colour_bar(figure, scale, values, ax=axes, aspect=12 * len(axes), pad=0.02)


def _label_panel(ax: Axes, sheet: Sheet, panel: int) -> None:
    """Title and ticks of a panel."""
    name = sheet.arrangement.panel
    if name:
        text = layout.value_text(sheet.arrangement.dataset[name], panel)
        heading = f"{figures.in_words(sheet.arrangement.dataset[name])}: " if sheet.columns <= NAMED else ""
        ax.set_title(shortened(f"{heading}{text}", _TITLE_LETTERS // sheet.columns), loc="left", pad=3)
    sheet.x.lay_out(ax.xaxis)
    sheet.y.lay_out(ax.yaxis)
    is_lowest = panel + sheet.columns >= sheet.panels
    is_first = panel % sheet.columns == 0
    if sheet.columns > NAMED:  # of many panels inner ticks take long, and tell little
        ax.xaxis.set_visible(is_lowest)
        ax.yaxis.set_visible(is_first)
    ax.tick_params(labelbottom=is_lowest, labelleft=is_first)
    if is_lowest:
        ax.set_xlabel(sheet.x.label)


def _title(sheet: Sheet) -> list[str]:
    """Title: quantity, job, number of runs of each class, and what is fixed."""
    runs, inferred = sheet.classes[~sheet.inferred], sheet.classes[sheet.inferred]
    attributes = sheet.arrangement.dataset.attrs
    counted = f"{runs.size} {'cells' if 'starts' in attributes else 'runs'}: {count_classes(runs)}"
    lines = [figures.headline("Vibration occurrence", attributes), counted]
    if "starts" in attributes:
        lines.append(f"each from a small and a large start: disturbance {attributes['starts']}")
    if inferred.size:
        lines.append(f"{inferred.size} cells inferred: {count_classes(inferred)}")
    lines += [", ".join(sheet.arrangement.notes), line_of_study(sheet.arrangement.dataset)]
    if sheet.arrangement.panel and sheet.columns > NAMED:
        lines.append(f"panels: {figures.in_words(sheet.arrangement.dataset[sheet.arrangement.panel])}")
    if sheet.writes_frequency:
        lines.append(f"in the cells: {sheet.frequency_label}")
    if sheet.has_room and np.isfinite(sheet.irregular).any():
        lines.append("in irregular cells: amplitude [µm]")
    return lines


def has_starts(dataset: xr.Dataset, at: layout.Fixed) -> bool:
    """Whether a map is to join runs from several disturbances: that axis is free, and not alone."""
    dims = dataset["status"].dims
    return AXIS in dims and AXIS not in at and dataset.sizes[AXIS] > 1 and len(set(dims) - set(at)) > 1


def join_starts(dataset: xr.Dataset) -> xr.Dataset:
    """Results over the axes beside `disturbance` [m]: the runs from the smallest, and the classes of both.

    They have `occurrence_class`, values of `StartClass`, `inferred_class` where the study is a trace, and
    both disturbances in words in the attribute `starts`.
    """
    ordered = dataset.sortby(AXIS)
    small, large = (ordered.isel({AXIS: place}, drop=True) for place in (0, -1))
    joined = {"occurrence_class": _joined(occurrence_classes(small), occurrence_classes(large))}
    if "inferred_class" in dataset:
        joined["inferred_class"] = _joined(map_classes(small), map_classes(large))
    words = " and ".join(value_text(ordered[AXIS], place) for place in (0, -1))
    return small.assign(joined).assign_attrs(starts=words)


def start_line(dataset: xr.Dataset, at: layout.Fixed, source: str) -> str:
    """State how many cells of a map vibrate from the large start only."""
    drawn = arrange(join_starts(dataset), at, source).dataset
    classes = map_classes(drawn)
    found = int(np.count_nonzero(classes == StartClass.LARGE_START_ONLY))
    return f"{found} of {classes.size} cells: vibration from the large start only ({drawn.attrs['starts']})"


def _joined(small: xr.DataArray, large: xr.DataArray) -> xr.DataArray:
    return small.copy(data=classify_starts(small.values, large.transpose(*small.dims).values))
