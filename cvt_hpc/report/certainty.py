"""Certainty of the findings of a study with uncertain parameters, in sentences with numbers."""

from collections.abc import Iterator, Sequence

import numpy as np
import xarray as xr

from cvt_hpc.analysis.arrangement import value_text
from cvt_hpc.analysis.figures import coordinate_unit, in_words
from cvt_hpc.analysis.probability import CONTOURS, PROBABILITY
from cvt_hpc.analysis.sensitivity import (
    COARSE,
    ONSET,
    QUANTILES,
    indices_of,
    members,
    onset_axes,
    onset_scatter,
    widest_row,
)
from cvt_hpc.analysis.value_maps import WIDE
from cvt_hpc.errors import few_of
from cvt_hpc.job.axes import SAMPLE, SWAPPED
from cvt_hpc.report.findings import counted, is_number, length_unit, lines_along, place_of
from cvt_hpc.vibration.classes import onsets

_MOST_SURE = 3  # of uncertain parameters: the onset of all is drawn
_MOST_HARDLY = 4  # cells of such a line that are hardly known
_MATTERS = 0.05  # of the variance of a result, or of the band of the onset: a parameter below hardly does


def probability_sentences(dataset: xr.Dataset, told: xr.Dataset, x: str) -> Iterator[str]:
    """Yield how sure the vibration of a study with uncertain parameters is, along the axis of its onset.

    `told` are the `probabilities` of the results; without an axis of numbers, lines lie along x.
    """
    along = next(iter(onset_axes(dataset)), "")
    x = along or x
    others = [name for name in map(str, told["status"].dims) if name != x]
    yield f"{told.attrs['counted']}.".replace(";", ", with", 1)
    uncertain = (
        f"{in_words(axis)} ({axis.attrs['derived']})"
        for axis in dataset.coords.values()
        if SAMPLE in axis.dims and "derived" in axis.attrs
    )
    yield f"Uncertain: {'; '.join(uncertain)}."
    yield (
        "The intervals are those of independent samples, rather too wide for Sobol points. All cells have "
        "the same samples: their errors are alike. Runs without a verdict widen the intervals."
    )
    told = told.sortby([name for name in (x, *others) if is_number(told[name])])
    places, lines = lines_along(told, others)
    moving = [k for k, line in enumerate(lines) if (line[PROBABILITY] > 0.0).any()]
    ends = np.linspace(0, len(moving) - 1, min(len(moving), _MOST_SURE)).round().astype(int)
    yield from (_how_sure(lines[moving[k]], x, places[moving[k]]) for k in ends)
    if (more := len(moving) - _MOST_SURE) > 0:
        yield f"In {counted(more, 'more line')} along {in_words(told[x])} samples vibrate."
    if quiet := len(lines) - len(moving):
        where = f" in {quiet} of {len(lines)} lines along {in_words(told[x])}" if others else ""
        yield f"No sample is known to vibrate{where}."
    if "total_order" in told:
        yield from _owed(told)
    if along:
        yield from _onset_owed(dataset, along)
    slip = told["slip_probability"]
    if (slip > 0.0).any():
        largest = int(np.nanargmax(slip.values))
        at = place_of(told, list(map(str, slip.dims)), largest)
        yield f"The belt slips with a probability of up to {_percent(slip.values.flat[largest])} %, at {at}."


def _owed(told: xr.Dataset) -> Iterator[str]:
    """State the Sobol indices of the verdict in the cell that has any and is least certain."""
    shares = told[PROBABILITY].where(told["total_order"].notnull().any("parameter"))
    if not shares.notnull().any():
        yield "No cell has Sobol indices of vibration: nine of ten samples need verdicts that differ."
        return
    cell = int(np.nanargmin(np.abs(shares.values - 0.5)))
    dims = list(map(str, shares.dims))
    here = told.isel(dict(zip(dims, map(int, np.unravel_index(cell, shares.shape)), strict=True)))
    having = int(shares.notnull().sum())
    where = "where vibration is least certain"
    if having < shares.size:
        where = f"of {having} of {counted(shares.size, 'cell')}, {where} among these"
    yield from _indices(told, here, f"{where}, at {place_of(told, dims, cell)}")


def _indices(dataset: xr.Dataset, here: xr.Dataset, where: str) -> Iterator[str]:
    """State the total Sobol indices of a cell or row, and which parameter decides."""
    ends = (here[f"total_order{end}"].values for end in ("", "_low", "_high"))
    names = (_members(dataset, name) for name in here["parameter"].values)
    known = [(name, *map(float, values)) for name, *values in zip(names, *ends, strict=True)]
    known = sorted((row for row in known if np.isfinite(row[1])), key=lambda row: -row[1])
    if known:
        listed = (f"{name} {value:.2f} ({low:.2f} to {high:.2f})" for name, value, low, high in known)
        yield f"Total Sobol indices {where}: {', '.join(listed)}."
        yield from _deciding(known)


def _deciding(known: Sequence[tuple[str, float, float, float]]) -> Iterator[str]:
    """State which parameter decides, by shares with their bounds, the largest first, as far as these tell."""
    (first, _, least, _), *others = known
    if not others:
        return
    start = f"{first[0].upper()}{first[1:]}"
    rivals = [name for name, _, _, high in others if high > least]
    if least <= 0.0 or rivals:
        others_do = f"{' or '.join(rivals)} does" if rivals else "it does"
        yield f"{start} seems to decide most; more samples would tell whether {others_do}."
        return
    then = [name for name, share, _, _ in others if share >= _MATTERS]
    hardly = [name for name, share, _, _ in others if share < _MATTERS]
    text = f"{start} decides"
    text += f", then {', then '.join(then)}" if then else ""
    yield f"{text}; {' and '.join(hardly)} hardly matter{'s' * (len(hardly) == 1)}." if hardly else f"{text}."


def _members(dataset: xr.Dataset, name: object) -> str:
    return " with ".join(members(dataset, str(name)))


def _onset_owed(dataset: xr.Dataset, along: str) -> Iterator[str]:
    """State to which parameters the scatter of the onset is due, where that is widest."""
    found = onset_scatter(dataset, along)
    if "band" not in found:
        return
    row = widest_row(found)
    here, shape = found.isel(row), found["band"].shape
    place = place_of(found, [*row], int(np.ravel_multi_index([*row.values()], shape))) if row else ""
    factor, unit = coordinate_unit(found["onset"].attrs)
    band = factor * here["band"].item()
    has_indices = SWAPPED in dataset["status"].dims
    if has_indices:
        where = f"of the onset in {in_words(dataset[along])}{f', at {place}' * bool(place)}"
        yield from _indices(dataset, indices_of(dataset, ONSET, along).isel(row), where)
    if not np.isfinite(band):
        return
    first, _, last = QUANTILES
    start = f"The onset in {in_words(dataset[along])} scatters{f' most at {place}' * bool(place)}"
    start += f": {first} to {last} of the samples within {band:.3g} {unit}"
    if band < COARSE * (step := factor * here["step"].item()):
        yield f"{start}, known no better than the step of {step:.3g} {unit}: take a finer axis."
        return
    yield f"{start}."
    shares = []
    for name in here["parameter"].values:
        one = here.sel(parameter=name)
        width, low, high = (factor * one[f"halved_band{end}"].item() for end in ("", "_low", "_high"))
        if np.isfinite(width):
            yield _halved(_members(dataset, name), band, (width, low, high), unit)
            shares.append((_members(dataset, name), *(1.0 - one / band for one in (width, high, low))))
    if shares and not has_indices:
        yield from _deciding(sorted(shares, key=lambda row: -row[1]))


def _halved(words: str, band: float, widths: Sequence[float], unit: str) -> str:
    """State what half the scatter of a parameter makes of a band: width and bounds, by the digits told."""
    told, *values = (f"{value:.3g}" for value in (band, *widths))
    width, low, high = values
    bounds = f"{low} to {high}" if np.isfinite(widths[2]) else f"{low} or more"
    start = f"Halve the scatter of {words}, and"
    if told == width or float(low) <= float(told) <= float(high):
        return f"{start} it is not certain that this band changes: {width} {unit} ({bounds})."
    verb = "shrinks" if float(width) < float(told) else "grows"
    return f"{start} this band {verb} from {told} to {width} {unit} ({bounds})."


def _how_sure(line: xr.Dataset, x: str, place: str) -> str:
    """State where the probability along a line crosses the contours, and where it is largest."""
    shares = line[PROBABILITY].values
    crossed: dict[bool, list[str]] = {True: [], False: []}
    for share in CONTOURS if is_number(line[x]) else ():
        found = onsets(line[x].values.astype(float), shares - share)
        for rising, outer in ((True, min), (False, max)):
            if places := [one.load for one in found if one.rising == rising]:
                factor, unit = coordinate_unit(line[x].attrs)
                crossed[rising].append(f"{_percent(share)} % at {factor * outer(places):.4g} {unit}".rstrip())
    lows, highs = (line[f"{PROBABILITY}_{end}"].values for end in ("low", "high"))
    # of several alike the one that is known best
    largest = int(np.argmax(np.where(shares == np.nanmax(shares), lows, -1.0)))
    low, high = float(lows[largest]), float(highs[largest])
    text = f"At {place} the" if place else "The"
    text += " probability of vibration "
    verbs = (("passes", crossed[True]), ("falls below", crossed[False][::-1]))
    told = ", ".join(f"{verb} {', '.join(places)}" for verb, places in verbs if places)
    text += f"{told} of {in_words(line[x])}, and " if told else ""
    most = f"{_percent(shares[largest])} % ({_percent(low)} to {_percent(high)} %)"
    text += f"is largest at {value_text(line[x], largest)}: {most}"
    if "amplitude_quantiles" in line:
        quantiles = line["amplitude_quantiles"].transpose("quantile", ...).values[:, largest]
        factor, unit = length_unit(quantiles)
        first, _, last = QUANTILES
        text += f", with amplitudes of {factor * quantiles[0]:.3g} to {factor * quantiles[-1]:.3g} {unit} "
        text += f"({first} to {last} of the samples that vibrate)"
    hardly = np.flatnonzero(~np.isnan(shares) & (highs - lows > WIDE))
    if any(crossed.values()) and hardly.size:
        at = few_of([value_text(line[x], int(k)) for k in hardly], _MOST_HARDLY)
        text += f"; hardly known, with intervals wider than {WIDE:g}, at {at}"
    return text + "."


def _percent(share: float) -> str:
    return f"{100.0 * share:.3g}"
