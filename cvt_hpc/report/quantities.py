"""Quantities of the runs that a page shows: numbers, one for each run, that vary over the study."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from cvt_hpc.analysis.classes import OccurrenceClass, at_strongest_strand, occurrence_classes
from cvt_hpc.analysis.figures import in_words, value_unit

MOST_NUMBERS = 1_000_000  # of all quantities together: some 5 MB of the page
MOST_PLACES = 4  # of a dimension that the runs have in common, such as both strands: a quantity for each
AMPLITUDE, FREQUENCY = "amplitude", "frequency"  # at the stronger strand; that of runs that vibrate
OF_COMPUTATION = (  # come behind what is about the belt
    *("power_residual", "step_ripple", "fluctuation_remainder", "unsolved_share", "iterations"),
    *("core_seconds", "simulated_seconds", "time_step", "refinements", "steps", "contact_solves"),
)


class Quantity(NamedTuple):
    """A number of each run.

    Attributes
    ----------
    key : str
        The variable of the dataset.
    name : str
        In words.
    unit : str
        For people.
    values : array
        In that unit, over the dimensions of `status`; nan where it is not known.
    """

    key: str
    name: str
    unit: str
    values: NDArray[np.float64]

    @property
    def label(self) -> str:
        """Name and unit."""
        return f"{self.name} [{self.unit}]" if self.unit else self.name


def quantities(dataset: xr.Dataset) -> list[Quantity]:
    """Return amplitude and frequency, then all that vary, in the order of the dataset, up to MOST_NUMBERS."""
    dims = dataset["status"].dims
    room = max(MOST_NUMBERS // max(dataset["status"].size, 1), 2)
    found = []
    for key, array in _candidates(dataset):
        values = array.transpose(*dims).values.astype(float)
        known = values[np.isfinite(values)]
        if not known.size or (key not in (AMPLITUDE, FREQUENCY) and known.min() == known.max()):
            continue
        factor, unit = length_unit(known) if key == AMPLITUDE else value_unit(array)
        found.append(Quantity(key, in_words(array), unit, factor * values))
        if len(found) == room:
            break
    return found


def length_unit(lengths: NDArray[np.float64]) -> tuple[float, str]:
    """Factor and unit in which lengths of vibrations [m] are shown."""
    return (1e3, "mm") if np.abs(lengths).max(initial=0.0) >= 1e-3 else (1e6, "µm")


def _candidates(dataset: xr.Dataset) -> Iterator[tuple[str, xr.DataArray]]:
    moves = occurrence_classes(dataset).isin([OccurrenceClass.VIBRATING, OccurrenceClass.IRREGULAR])
    yield AMPLITUDE, at_strongest_strand(dataset, AMPLITUDE).assign_attrs(units="m", long_name=AMPLITUDE)
    # what is quiet has none
    frequency = at_strongest_strand(dataset, FREQUENCY).where(moves)
    yield FREQUENCY, frequency.assign_attrs(units="Hz", long_name=FREQUENCY)
    dims = dataset["status"].dims
    names = [str(name) for name, array in dataset.data_vars.items() if _is_quantity(array, dims)]
    for name in sorted(names, key=OF_COMPUTATION.__contains__):
        array = dataset[name]
        extra = next((dim for dim in array.dims if dim not in dims), None)
        if extra is None:
            yield name, array
            continue
        for place in range(array.sizes[extra]):
            is_text = dataset[extra].dtype.kind not in "iuf"
            label = (
                str(dataset[extra].values[place]) if is_text else f"{in_words(dataset[extra])} {place + 1}"
            )
            part = array.isel({extra: place}, drop=True)
            # the name of a variable may be long; what stands there is never taken for a sentence
            yield name, part.rename(f"{in_words(array)}, {label}").assign_attrs(long_name="")


def _is_quantity(array: xr.DataArray, dims: tuple[object, ...]) -> bool:
    extra = [dim for dim in array.dims if dim not in dims]
    is_split = len(extra) == 1 and array.sizes[extra[0]] <= MOST_PLACES and extra[0] in array.coords
    return (
        set(dims) <= set(array.dims)
        and array.dtype.kind in "iuf"
        and "flag_values" not in array.attrs
        and str(array.name) not in ("status", "vibrates", "inferred_class", AMPLITUDE, FREQUENCY)
        and (not extra or is_split)
    )
