"""The map of a study as a plotly figure: values of a cell where the pointer is, quantities by a menu."""

from __future__ import annotations

import html
from typing import Any

import numpy as np
import plotly.graph_objects as go
import xarray as xr
from numpy.typing import NDArray
from plotly.subplots import make_subplots

from cvt_hpc.analysis import cells
from cvt_hpc.analysis.arrangement import Arrangement, Ruler, value_text
from cvt_hpc.analysis.classes import OccurrenceClass
from cvt_hpc.analysis.figures import axis_label, display_unit, in_words
from cvt_hpc.analysis.maps import Sheet

MOST_PANELS = 12
STACKED = 3  # panels in one column, which suits a telephone; more go into two
LONGEST_TITLE = 40  # letters above a panel
MOST_GAPS = 40  # cells side by side that are set apart: more gaps would bleach the colours
MOST_QUANTITIES = 12  # in the menu, beside occurrence
PANEL, FRAME = 260, 150  # [pixel]: height of a row of panels, and of all around them
_AMPLITUDES = [
    [k / 23, f"rgb{tuple(int(255 * c) for c in cells.AMPLITUDE_COLOURS(k)[:3])}"] for k in range(24)
]
_OTHERS = "Viridis"
_TEXT_ALONE = "%{text}<extra></extra>"
_CROSS = {"symbol": "x", "size": 7, "color": cells.STYLES[OccurrenceClass.FAILED].ink}
_LEGEND = {
    "orientation": "h",
    "yref": "container",
    "y": 0.0,
    "yanchor": "bottom",
    "itemclick": False,
    "itemdoubleclick": False,
}


def map_with_values(sheet: Sheet) -> go.Figure:
    """Compose the map.

    Parameters
    ----------
    sheet : Sheet
        Of a study over a grid, with at most MOST_PANELS panels.

    Returns
    -------
    Figure
        A panel for each value of the panels' axis. Occurrence comes first: classes as in the printed map,
        vibrating cells by amplitude [um]. The menu shows other scalar quantities of the runs in their place.
    """
    arrangement = sheet.arrangement
    columns = 1 if sheet.panels <= STACKED else 2
    rows = -(-sheet.panels // columns)
    figure = make_subplots(
        rows,
        columns,
        shared_xaxes=True,
        shared_yaxes=True,
        horizontal_spacing=0.05,
        vertical_spacing=min(0.12, 0.3 / rows),
        subplot_titles=_titles(arrangement),
    )
    shown: dict[str, list[int]] = {"": []}
    labels = {"": "occurrence"}
    for panel in range(sheet.panels):
        where = {"row": panel // columns + 1, "col": panel % columns + 1}
        for trace in _occurrence(sheet, panel):
            shown[""].append(len(figure.data))
            figure.add_trace(trace, **where)
    places = _all_places(sheet)
    for name, values in _quantities(arrangement).items():
        labels[name] = label = _label(arrangement.dataset[name])
        for panel in range(sheet.panels):
            where = {"row": panel // columns + 1, "col": panel % columns + 1}
            shown.setdefault(name, []).append(len(figure.data))
            trace = _cells(sheet, values[panel]).update(coloraxis="coloraxis2", visible=False)
            # the place of the run, which is not the middle of its cell on an uneven axis
            template = f"%{{text}}<br>{escape(label)}: %{{z:.4g}}<extra></extra>"
            trace.update(text=places, hovertemplate=template)
            figure.add_trace(trace, **where)
    for kind in _present(sheet):
        style = cells.STYLES[kind]
        mark = {"size": 13, "symbol": "square", "color": style.fill, "line": {"color": "#606060", "width": 1}}
        mark = _CROSS if kind == OccurrenceClass.FAILED else mark
        shown[""].append(len(figure.data))
        name = kind.label
        figure.add_trace(
            go.Scatter(x=[None], y=[None], mode="markers", name=name, marker=mark, showlegend=True)
        )
    figure.update_layout(
        height=rows * PANEL + FRAME,
        margin={"l": 70, "r": 20, "t": 90, "b": 95},
        coloraxis={"colorscale": _AMPLITUDES, "cmin": 0.0, "cmax": _end(sheet), "colorbar": {"title": "µm"}},
        coloraxis2={"colorscale": _OTHERS, "showscale": False},
        legend=_LEGEND,
        plot_bgcolor="#ffffff",
        font={"family": "sans-serif", "size": 13},
        updatemenus=[_menu(shown, labels, len(figure.data))],
        hoverlabel={"align": "left"},
    )
    for column in range(1, columns + 1):
        figure.update_xaxes(title_text=escape(sheet.x.label), row=rows, col=column)
    figure.update_yaxes(title_text=escape(sheet.y.label), col=1)
    figure.update_xaxes(**_ticks(sheet.x))
    figure.update_yaxes(**_ticks(sheet.y))
    return figure


def escape(text: str) -> str:
    """Escape a text for the plotting library, which takes a few tags, and leaves quotes as they are."""
    return html.escape(text, quote=False)


def _present(sheet: Sheet) -> list[OccurrenceClass]:
    return [kind for kind in OccurrenceClass if kind in cells.STYLES and np.any(sheet.classes == kind)]


def _titles(arrangement: Arrangement) -> list[str]:
    if not arrangement.panel:
        return [""]
    axis = arrangement.dataset[arrangement.panel]
    titles = (f"{in_words(axis)}: {value_text(axis, k)}" for k in range(axis.size))
    return [
        escape(title if len(title) <= LONGEST_TITLE else f"{title[: LONGEST_TITLE - 1]}…") for title in titles
    ]


def _occurrence(sheet: Sheet, panel: int) -> list[go.Heatmap | go.Scatter]:
    """A layer for each class that occurs, that of vibrating cells by amplitude; crosses on failed ones."""
    classes, layers = sheet.classes[panel], []
    amplitude = sheet.amplitude[panel]
    for kind in _present(sheet):
        inside = classes == kind
        if not inside.any():
            continue
        if kind == OccurrenceClass.VIBRATING and np.isfinite(amplitude[inside]).any():
            layer = _cells(sheet, np.where(inside, amplitude, np.nan)).update(coloraxis="coloraxis")
        else:
            fill = cells.STYLES[kind].fill
            layer = _cells(sheet, np.where(inside, 0.0, np.nan))
            layer.update(colorscale=[[0, fill], [1, fill]], showscale=False)
        layers.append(layer.update(text=_hover(sheet, panel, inside), hovertemplate=_TEXT_ALONE))
        if kind == OccurrenceClass.FAILED:
            rows, columns = np.nonzero(inside)
            places = {"x": sheet.x.centres[columns], "y": sheet.y.centres[rows]}
            cross = {"mode": "markers", "marker": _CROSS, "hoverinfo": "skip", "showlegend": False}
            layers.append(go.Scatter(**places, **cross))
    return layers


def _cells(sheet: Sheet, values: NDArray[np.float64]) -> go.Heatmap:
    gap = 1 if max(values.shape) <= MOST_GAPS else 0
    return go.Heatmap(x=sheet.x.edges, y=sheet.y.edges, z=values, hoverongaps=False, xgap=gap, ygap=gap)


def _hover(sheet: Sheet, panel: int, inside: NDArray[np.bool_]) -> NDArray[Any]:
    """What stands beside the pointer on some cells: place, class, amplitude and frequency."""
    arrangement, dataset = sheet.arrangement, sheet.arrangement.dataset
    texts = np.full(inside.shape, "", object)
    names = {kind.value: kind.label for kind in OccurrenceClass}
    above = [_place(dataset, arrangement.panel, panel)] if arrangement.panel else []
    for row, column in np.argwhere(inside):
        lines = [*above, *_places(sheet, row, column)]
        inferred = " (inferred)" if sheet.inferred[panel][row, column] else ""
        lines.append(names[int(sheet.classes[panel][row, column])] + inferred)
        for values, text in (
            (sheet.amplitude, "amplitude: {:.3g} µm"),
            (sheet.irregular, "amplitude: {:.3g} µm"),
            (sheet.frequency, "frequency: {:.0f} Hz"),
        ):
            if np.isfinite(value := values[panel][row, column]):
                lines.append(text.format(value))
        texts[row, column] = "<br>".join(map(escape, lines))
    return texts


def _place(dataset: xr.Dataset, name: str, index: int) -> str:
    return f"{in_words(dataset[name])}: {value_text(dataset[name], index)}"


def _places(sheet: Sheet, row: int, column: int) -> list[str]:
    arrangement = sheet.arrangement
    sides = (arrangement.y, row), (arrangement.x, column)
    return [_place(arrangement.dataset, name, int(index)) for name, index in sides if name]


def _all_places(sheet: Sheet) -> NDArray[Any]:
    """Where each run of a panel lies (row, column), for the pointer."""
    texts = np.full(sheet.classes.shape[1:], "", object)
    for row, column in np.ndindex(*texts.shape):
        texts[row, column] = "<br>".join(map(escape, _places(sheet, row, column)))
    return texts


def _quantities(arrangement: Arrangement) -> dict[str, NDArray[np.float64]]:
    """Scalar quantities of the runs that vary, in display units (panel, row, column), by name."""
    dataset = arrangement.dataset
    found: dict[str, NDArray[np.float64]] = {}
    names = [arrangement.panel, arrangement.y, arrangement.x]
    dims = set(filter(None, names))
    for name, array in dataset.data_vars.items():
        plain = set(array.dims) == dims and array.dtype.kind == "f" and "flag_values" not in array.attrs
        if not plain or len(found) == MOST_QUANTITIES:
            continue
        values = array.transpose(*filter(None, names)).values
        if np.isfinite(values).any() and np.nanmin(values) < np.nanmax(values):
            factor, _ = display_unit(str(array.attrs.get("units", "")))
            shape = [dataset.sizes[side] if side else 1 for side in names]
            found[str(name)] = factor * values.reshape(shape)
    return found


def _label(array: xr.DataArray) -> str:
    return axis_label(array, display_unit(str(array.attrs.get("units", "")))[1])


def _end(sheet: Sheet) -> float:
    return float(cells.norm_over(sheet.amplitude, 0.0).vmax or 1.0)


def _ticks(ruled: Ruler) -> dict[str, Any]:
    fixed: dict[str, Any] = {"showgrid": False, "zeroline": False, "range": [ruled.edges[0], ruled.edges[-1]]}
    if ruled.ticks is not None:
        fixed |= {"tickvals": ruled.ticks, "ticktext": list(map(escape, ruled.tick_labels))}
    return fixed


def _menu(shown: dict[str, list[int]], labels: dict[str, str], traces: int) -> dict[str, Any]:
    buttons = []
    for name, indices in shown.items():
        visible = [k in set(indices) for k in range(traces)]
        scale = {"coloraxis2.showscale": bool(name), "coloraxis.showscale": not name}
        buttons.append(
            {"label": escape(labels[name]), "method": "update", "args": [{"visible": visible}, scale]}
        )
    return {"buttons": buttons, "x": 0.0, "xanchor": "left", "y": 1.0, "yanchor": "bottom", "pad": {"b": 30}}
