"""Data of map.js: axes, classes and quantities of a study as numbers."""

import json
from base64 import b64encode
from collections.abc import Iterator

import numpy as np
import xarray as xr
from matplotlib.colors import Colormap, to_hex
from numpy.typing import DTypeLike, NDArray

from cvt_hpc.analysis import cells
from cvt_hpc.analysis.arrangement import arrange, ruler, value_text
from cvt_hpc.analysis.classes import ALONG, OccurrenceClass, map_classes, occurrence_classes
from cvt_hpc.analysis.figures import axis_label, coordinate_unit, in_words
from cvt_hpc.analysis.hysteresis_bands import INK, lowest_onsets, of_each_start
from cvt_hpc.analysis.maps import AXIS, has_starts, join_starts
from cvt_hpc.analysis.probability import PROBABILITY
from cvt_hpc.analysis.scatter import is_sampled, sample_axes
from cvt_hpc.analysis.value_maps import COLOURS
from cvt_hpc.errors import escaped
from cvt_hpc.report.findings import AMPLITUDE, Quantity, is_judged, quantities
from cvt_hpc.vibration.classes import StartClass

LARGEST = 3e38  # in 4 bytes
KEPT = "\n\t\u00a0"  # characters on a page that do not print, and are no harm
_SYMBOLS = {  # marks of the plotting library on cells of a class, and for legends
    StartClass.FAILED: ("x", "✖"), StartClass.NOT_RUN: ("line-ew-open", "–"),
    StartClass.UNDECIDED: ("", "?"), StartClass.IRREGULAR: ("star", "★"),
    StartClass.SLIPPING: ("triangle-right", "▶"), StartClass.LARGE_START_ONLY: ("diamond", "◆"),
}  # fmt: skip


def map_data(dataset: xr.Dataset, source: str = "results") -> dict[str, object]:
    """Gather what the map shows of a study over a grid or of samples, of one run at least along one axis.

    Returned are JSON types; numbers of cells are base64 of bytes, or of floats of 4 bytes, the last axis
    running fastest.
    """
    sampled = is_sampled(dataset)
    sides: dict[str, str | None]
    if sampled:
        names = sample_axes(dataset)
        axes = [_sampled_axis(dataset[name]) for name in names]
        sides = {"x": names[0], "y": names[1] if len(names) > 1 else None, "panel": None}
    else:
        arrangement = arrange(dataset, {}, source)
        sides = {"x": arrangement.x, "y": arrangement.y, "panel": arrangement.panel}
        names = list(map(str, dataset["status"].dims))
        dataset = dataset.sortby([name for name in names if dataset[name].dtype.kind in "iuf"])
        axes = [_grid_axis(dataset[name]) for name in names]
    classes, runs = map_classes(dataset), occurrence_classes(dataset)
    starts = _from_both_starts(dataset, names)
    onsets = [] if sampled else list(_onsets(classes.values, dataset, axes, from_both=False))
    if starts is not None:
        onsets += _onsets(starts, dataset, axes, from_both=True)
    data = {
        "sampled": sampled,
        "axes": axes,
        "sides": {side: names.index(name) if name else -1 for side, name in sides.items()},
        "classes": _bytes(classes.values, np.int8),
        "inferred": _bytes(classes.values != runs.values, np.int8) if (classes != runs).any() else "",
        "starts": "" if starts is None else _bytes(starts, np.int8),
        "onsets": onsets,
        "onsetColour": INK,
        "kinds": {int(kind): _kind(kind) for kind in StartClass},
        "inferredVibration": cells.INFERRED_VIBRATION,
        "vibrating": int(OccurrenceClass.VIBRATING),
        "colours": _colours(cells.AMPLITUDE_COLOURS),
        "amplitudes": cells.AMPLITUDE_TICKS,  # [um]
        # as in print
        "others": _colours(cells.FREQUENCY_COLOURS if is_judged(dataset) else COLOURS),
        "quantities": [_quantity(one) for one in quantities(dataset)],
    }
    # a cell of many samples has no class
    data["ofSamples"] = PROBABILITY in dataset and bool(data["quantities"])
    # where nothing is judged, a quantity comes first
    return data | {"first": -1 if is_judged(dataset) or not data["quantities"] else 0}


def as_script(data: dict[str, object]) -> str:
    """JSON that ends no script and turns no direction, whatever the texts of a dataset are."""
    text = json.dumps(_as_they_stand(data), separators=(",", ":"), allow_nan=False)
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def _as_they_stand(data: object) -> object:
    """JSON types with escapes in all texts, as a page shows them."""
    if isinstance(data, str):
        return escaped(data, KEPT)
    if isinstance(data, dict):
        return {key: _as_they_stand(value) for key, value in data.items()}
    return list(map(_as_they_stand, data)) if isinstance(data, (list, tuple)) else data


def _grid_axis(axis: xr.DataArray) -> dict[str, object]:
    ruled = ruler(axis)
    ticks = None if ruled.ticks is None else {"at": ruled.ticks.tolist(), "texts": list(ruled.tick_labels)}
    places = {"centres": ruled.centres.tolist(), "edges": ruled.edges.tolist(), "ticks": ticks}
    return {**_named(axis, ruled.label), **places, "minor": ruled.minor.tolist()}


def _named(axis: xr.DataArray, label: str) -> dict[str, object]:
    texts = [value_text(axis, place) for place in range(axis.size)]
    return {"name": in_words(axis), "label": label, "texts": texts}


def _sampled_axis(axis: xr.DataArray) -> dict[str, object]:
    factor, unit = coordinate_unit(axis.attrs)
    is_number = axis.dtype.kind in "iuf"
    values: list[object] = list(map(str, axis.values))
    if is_number:
        values = [factor * value if np.isfinite(value) else None for value in axis.values.tolist()]
    named = _named(axis, axis_label(axis, unit if is_number else ""))
    return {**named, "values": values, "log": axis.attrs.get("spacing") == "log"}


def _from_both_starts(dataset: xr.Dataset, names: list[str]) -> NDArray[np.int8] | None:
    """Classes from the smallest and the largest disturbance, over the whole grid; None without that axis."""
    if not has_starts(dataset, {}):
        return None
    return map_classes(join_starts(dataset)).expand_dims({AXIS: dataset.sizes[AXIS]}).transpose(*names).values


def _onsets(
    classes: NDArray[np.int8], dataset: xr.Dataset, axes: list[dict[str, object]], from_both: bool
) -> Iterator[dict[str, object]]:
    """Yield the onset lines along each axis on which a vibration may set in.

    Of each line the places along its axis, over all other axes.
    """
    names = list(map(str, dataset["status"].dims))
    for name in (name for name in ALONG if name in names and len(names) > 1):
        axis = names.index(name)
        centres = np.array(axes[axis]["centres"])
        for label, style, kinds in of_each_start(classes, dataset[name]):
            lowest = lowest_onsets(centres, np.moveaxis(kinds, axis, -1).reshape(-1, centres.size))
            if np.isfinite(lowest).any():
                line = {"axis": axis, "starts": from_both, "label": label, "dashed": style == "--"}
                yield line | {"at": _bytes(lowest, np.dtype("<f4"))}


def _kind(kind: StartClass) -> dict[str, object]:
    style = cells.ALL_STYLES[next(one for one in cells.ALL_STYLES if one == kind)]
    symbol, letter = _SYMBOLS.get(kind, ("", ""))
    moves = kind in (StartClass.VIBRATING, StartClass.IRREGULAR)
    look = {"fill": style.fill, "ink": style.ink, "symbol": symbol, "letter": letter}
    return {"label": kind.label, **look, "moves": moves}


def _colours(colours: Colormap) -> list[list[float | str]]:
    return [[k / 23, to_hex(colours(k))] for k in range(24)]


def _quantity(quantity: Quantity) -> dict[str, object]:
    norm = cells.norm_over(quantity.values, 0.0 if quantity.key == AMPLITUDE else None)
    named = {"key": quantity.key, "name": quantity.name, "unit": quantity.unit}
    values = _bytes(np.clip(quantity.values, -LARGEST, LARGEST), np.dtype("<f4"))
    return {**named, "least": norm.vmin, "most": norm.vmax, "values": values}


def _bytes(values: np.ndarray, kind: DTypeLike) -> str:
    return b64encode(np.ascontiguousarray(values, kind).tobytes()).decode()
