"""The picture of a comparison: a map of the cells in which studies differ, and amplitude B against A."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from numpy.typing import NDArray

from cvt_hpc.analysis import cells
from cvt_hpc.analysis.arrangement import Arrangement, arrange, first_panel
from cvt_hpc.analysis.comparison import Comparison
from cvt_hpc.analysis.figures import WIDTH, draw, entitle
from cvt_hpc.analysis.maps import TITLE_HEIGHT, draw_block, sheet_of
from cvt_hpc.analysis.scatter import draw_samples, is_sampled, scatter_height
from cvt_hpc.vibration.classes import CONTRADICTIONS, NEAR, OccurrenceClass

_SCATTER_HEIGHT, FRAME = 4.2, 6.4  # [inch], and what the page holds beside the panels of the map
MOST_PANELS = 24  # that a page then holds
_SAMPLES_BESIDE, _SAMPLES_HEIGHT = 3, 1.5  # panels of samples side by side, and their height [inch]
LOWEST = 1e-2  # of the threshold: smaller amplitudes are drawn at the border
_NO_SCALE = cells.Scale(cells.AMPLITUDE_COLOURS, cells.norm_over(np.empty(0)), "")


def draw_comparison(found: Comparison, out: Path, sources: tuple[str, str]) -> Path:
    """Draw where two studies agree and where they contradict each other; written as by `save_figure`.

    `sources` say for the title what A and B are. Of a single run there is no map.
    """
    return draw(lambda: _figure(found, sources), out)


def _figure(found: Comparison, sources: tuple[str, str]) -> Figure:
    arrangement = _arrangement(found)
    pairs = arrangement.dataset["occurrence_class"].values
    kinds = {kind: style for kind, style in cells.ALL_STYLES.items() if np.any(pairs == kind)}
    height = _map_height(arrangement) + 0.3 * -(-len(kinds) // 3)
    figure = Figure((WIDTH, height + _SCATTER_HEIGHT + 1.0), layout="constrained")
    above, below = figure.subfigures(2, 1, height_ratios=(height, _SCATTER_HEIGHT))
    _draw_map(above, arrangement)
    cells.class_legend(above, kinds, 3)
    _draw_amplitudes(below, found)
    entitle(figure, _title(found, pairs, sources) + list(arrangement.notes))
    return figure


def _arrangement(found: Comparison) -> Arrangement:
    """Lay out the cells of a grid; samples, and a single run, stay as they are."""
    if is_sampled(found.cells) or found.pairs.ndim == 0:
        return Arrangement(found.cells, "", None, None, ())
    arrangement = arrange(found.cells, {}, "")
    panels = found.cells.sizes[arrangement.panel] if arrangement.panel else 1
    return first_panel(arrangement) if panels > MOST_PANELS else arrangement


def _map_height(arrangement: Arrangement) -> float:
    """Height [inch] of the map."""
    if is_sampled(arrangement.dataset):
        return scatter_height(arrangement.dataset, _SAMPLES_BESIDE, _SAMPLES_HEIGHT)
    if not arrangement.x:
        return 0.0
    sheet = sheet_of(arrangement, frame=FRAME)
    return sheet.rows * sheet.panel_height + TITLE_HEIGHT


def _draw_map(figure: SubFigure, arrangement: Arrangement) -> None:
    if is_sampled(arrangement.dataset):
        pairs = arrangement.dataset["occurrence_class"].values
        nothing = np.full(pairs.shape, np.nan)
        draw_samples(figure, arrangement.dataset, pairs, nothing, _NO_SCALE, _SAMPLES_BESIDE)
    elif arrangement.x:
        sheet = sheet_of(arrangement, frame=FRAME)
        axes = figure.subplots(sheet.rows, sheet.columns, sharex=True, sharey=True, squeeze=False)
        draw_block(figure, axes, sheet, np.full(sheet.classes.shape, np.nan), _NO_SCALE)
        figure.supylabel(sheet.y.label)


def _title(found: Comparison, shown: NDArray[np.int8], sources: tuple[str, str]) -> list[str]:
    total, beyond = int(found.contradicts.sum()), int(found.contradicts_beyond.sum())
    better, worse = int(found.better.sum()), int(found.worse.sum())
    lines = [f"A: {sources[0]}; B: {sources[1]}"]
    lines.append(f"{int(found.answered.sum())} of {found.pairs.size} cells have results in both")
    if found.are_designs:
        lines.append(f"B is better in {better} (quiet where A vibrates), worse in {worse} (the reverse)")
    else:
        lines.append(f"{total} contradict, {beyond} of these beyond the threshold")
    hidden = total - int(np.isin(shown, CONTRADICTIONS).sum())
    kind = "of these" if found.are_designs else "contradicting"
    return lines + ([f"{hidden} {kind} cells are not on this map"] if hidden else [])


def _draw_amplitudes(figure: SubFigure, found: Comparison) -> None:
    """Mark the cells in which a run vibrates by both amplitudes, on logarithmic axes."""
    axes = figure.subplots()
    a, b = (found.cells[f"amplitude_{study}"].values * 1e6 for study in "ab")
    vibrates = [found.cells[name].values == OccurrenceClass.VIBRATING for name in ("class_a", "class_b")]
    drawn = (vibrates[0] | vibrates[1]) & np.isfinite(a) & np.isfinite(b) & (np.maximum(a, b) > 0.0)
    axes.set(xlabel="amplitude in A [µm]", ylabel="amplitude in B [µm]")
    if not drawn.any():
        axes.text(0.5, 0.5, "no amplitudes of vibrating runs", ha="center", transform=axes.transAxes)
        return
    threshold = np.array(found.thresholds) * 1e6
    largest = [each[drawn].max() for each in (a, b)]
    known = np.nanmin(threshold) if np.isfinite(threshold).any() else min(v for v in largest if v > 0.0)
    low, high = LOWEST * known, 1.5 * max(largest)
    for kind, style in cells.ALL_STYLES.items():
        of_kind = drawn & (found.pairs == kind)
        look = {**style.marks(4.0), "color": style.fill, "mec": "#000000", "mew": 0.5, "zorder": 2}
        x, y = (np.clip(amplitude[of_kind], low, None) for amplitude in (a, b))
        axes.plot(x, y, **look, clip_on=False, rasterized=True)
    _draw_guides(axes, threshold, low, high)


def _draw_guides(axes: Axes, threshold: np.ndarray, low: float, high: float) -> None:
    """Draw equal amplitudes, and the thresholds with what counts as near them."""
    axes.plot([low, high], [low, high], color="#7c8a96", linewidth=0.8, zorder=1)
    ways = (axes.axvline, axes.axvspan), (axes.axhline, axes.axhspan)
    for value, (line, span) in zip(threshold, ways, strict=True):
        if np.isfinite(value):
            line(value, color="#202020", linewidth=0.8, linestyle="--", zorder=1)
            span((1 - NEAR) * value, (1 + NEAR) * value, color="#e9eef2", zorder=0)
    axes.set(xscale="log", yscale="log", xlim=(low, high), ylim=(low, high), aspect="equal")
