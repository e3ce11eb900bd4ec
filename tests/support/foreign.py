"""Datasets as xarray, pint-xarray and their users leave them: in other units, lazy, quantified."""

from functools import cache
from itertools import cycle

import cf_xarray.units  # noqa: F401  units as CF writes them
import numpy as np
import pint_xarray

REGISTRY = pint_xarray.unit_registry
# units in text as pint writes them: "millimeter", "mm", "µm"; and their prefixes
WAYS = tuple(zip(("D", "~", "~P", "~C", "P", "cf"), cycle(("milli", "kilo", "micro")), strict=False))


@cache
def other_unit(unit, way):
    """A unit of the same dimension, its text, and how many of it make one of the given."""
    text, prefix = WAYS[way % len(WAYS)]
    own = REGISTRY.Unit(unit)
    parts = dict(own._units) or {"dimensionless": 1}
    first = next(iter(parts))
    other = REGISTRY.Unit("percent") if not own._units else own / REGISTRY.Unit(first) ** parts[first]
    if own._units:
        other = other * REGISTRY.Unit(prefix + first.removeprefix("kilo")) ** parts[first]
    return other, format(other, text), REGISTRY.Quantity(1.0, own).to(other).magnitude


def numbers(dataset):
    """Names and units of variables and coordinates that have one."""
    return [
        (name, array.attrs["units"]) for name, array in dataset.variables.items() if "units" in array.attrs
    ]


def in_other_units(dataset, quantified=False):
    """All that has a unit in another one, written in all ways; or as quantities of pint."""
    changed = {}
    for way, (name, unit) in enumerate(numbers(dataset)):
        other, text, factor = other_unit(unit, way)
        array = dataset.variables[name]
        values, attributes = array.data * factor, {**array.attrs, "units": text}
        if quantified and name not in dataset.coords:
            values = REGISTRY.Quantity(values, other)
            del attributes["units"]
        changed[name] = (array.dims, values, attributes)
    coordinates = {name: changed.pop(name) for name in [*changed] if name in dataset.coords}
    return dataset.assign_coords(coordinates).assign(changed)


def drawn(figure):
    """The data of all artists of a figure, and its texts."""
    found, texts = [], []
    for axes in figure.axes:
        found += [line.get_xydata() for line in axes.lines]
        found += [image.get_array() for image in axes.images]
        found += [patch.get_path().vertices for patch in axes.patches]
        found += [patch.get_extents().bounds for patch in axes.patches]
        for each in axes.collections:
            found += [each.get_offsets(), [] if each.get_array() is None else each.get_array()]
            found += [path.vertices for path in each.get_paths()]
        found += [axes.get_xlim(), axes.get_ylim()]
        texts += [
            axes.get_title(loc="left"),
            axes.get_xlabel(),
            axes.get_ylabel(),
            *(t.get_text() for t in axes.texts),
        ]
    return [np.ma.filled(np.ma.asarray(values, float), np.nan) for values in found], texts
