"""Common parts of all pictures: their arguments, a style, units for people, and how they are written.

Pictures of results take

    dataset    Dataset: results of a study over the axes of its job, as `open_results` returns them
    at         mapping, optional: axes to fix, name -> value, as a number [SI] or a text
    source     str, optional: where the results are from, for the errors
    sides      Sides, optional: which axis runs along x, along y and over the panels
    vmax       float, optional: value at which the colours end [SI]
    measured   str or Path, optional: measured file that is drawn over the picture (`measured.py`)

and pictures of runs

    history    Dataset: one run as `simulate` returns it, or `histories`, a sequence of them
    source     str, or `sources`, a sequence, optional: where they are from, for errors, and for titles and
               legends where the axes of the runs do not tell them apart
    vmax, measured as above.

A function `..._figure` composes a matplotlib Figure, unknown to pyplot, and writes nothing;
`figure.savefig(path)` does, and `draw` writes it as `save_figure` does. `picture_kinds.py` lists those drawn
by a kind. InputError is raised where a dataset holds no results, a single run or not what is to be drawn,
where `at` names no axis or no value on it, or where a page has no room for all panels; what else a picture
refuses its docstring says.

Ticks at the values of an axis are numbers as short as they may be, and only those for which there is room.

Methods and models that are compared by error and cost have the lines and markers of `line_style`.
"""

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial, wraps
from io import BytesIO
from pathlib import Path
from textwrap import wrap
from typing import Any, NamedTuple, ParamSpec, TypeAlias
from weakref import WeakSet

import matplotlib
import numpy as np
import xarray as xr
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.axis import Axis, XAxis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.container import Container
from matplotlib.figure import Figure
from matplotlib.patheffects import AbstractPathEffect, Normal, withStroke
from matplotlib.text import Text
from matplotlib.ticker import FuncFormatter, Locator, LogFormatter, NullFormatter, ScalarFormatter
from numpy.typing import NDArray
from PIL import Image

from cvt_hpc.analysis.sobol import WITHOUT
from cvt_hpc.errors import mismatch, one_line
from cvt_hpc.job.values import JOB_UNITS, shown_number, shown_unit
from cvt_hpc.storage.files import written_aside

# Okabe and Ito's colours, told apart by those who do not see all; with the lines enough for 21 methods.
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#333333")
LINES = ("-", "--", ":")
MARKERS = ("o", "s", "^", "D", "v", "P", "<", ">")
LEGEND = {"loc": "outside lower center", "frameon": False, "fontsize": 8, "columnspacing": 1.0}
MARGIN = 1.6  # factor by which axes reach beyond the points
_LEAST_SPAN = 100.0  # of an error's axis, so that two powers of ten stand at it

ROUNDED = 0.005  # of the distance of two values: by so much a number on an axis may be off
_MOST_DECIMALS = 12
LETTER, LINE, GAP = 5.6, 11.0, 5.0  # [point]: width and height of a tick's letters, and space between two
TEXTS = 55  # letters of texts side by side along x; more stand upright

P = ParamSpec("P")
Handle: TypeAlias = "Artist | Container"  # of a legend
Panels = np.ndarray  # of axes, by row and column
_AS_WRITTEN: WeakSet[Figure] = WeakSet()
_NUMBERS = (ScalarFormatter, NullFormatter)  # whose labels have no `$`

WIDTH = 6.4  # [inch]: letters of 10 points stay readable across a page and on a telephone held sideways
NARROW, LONG = 7.1, 10.5  # [inch]: sides of a page of A4 within margins of 15 mm
RESOLUTION = 170  # dots per inch
_INLINE = 100  # the same, between the cells of a notebook
SETTLED = 1000  # pixels: the palette is refined until no more than these, one in a thousand, change colour
FORMATS = (".png", ".svg", ".pdf")
_LEGEND_LETTERS, _HANDLE_LETTERS = 84, 8  # across the page, and what a handle with its space takes of them
LONGEST_NAME = 27  # letters of a name on an axis

STYLE = {
    "font.family": "DejaVu Sans", "font.size": 10, "figure.titlesize": 11, "figure.labelsize": 10,
    "axes.labelsize": 10, "axes.titlesize": 10, "axes.linewidth": 0.8, "axes.unicode_minus": True,
    "xtick.labelsize": 9, "ytick.labelsize": 9, "legend.fontsize": 9, "hatch.linewidth": 0.7,
    "svg.hashsalt": "cvt_hpc",
}  # fmt: skip

_DISPLAY_UNITS = {
    "m": (1e3, "mm"), "s": (1e3, "ms"), "N": (1e-3, "kN"), "1": (1.0, ""),
    "rad s-1": (30 / 3.141592653589793, "rpm"), "rad": (180 / 3.141592653589793, "°"),
}  # fmt: skip
_POWER = re.compile(r"([A-Za-z]+)(-?)(\d?)")
_RAISED = str.maketrans("23456789", "²³⁴⁵⁶⁷⁸⁹")
# largest value below which a smaller unit is shown [SI], with its factor
_SMALL = {"m": (1e-4, (1e6, "µm")), "rad": (0.1, (1e3, "mrad")), "N": (500.0, (1.0, "N"))}


def display_unit(unit: str) -> tuple[float, str]:
    """Factor and unit in which a quantity with this SI unit is shown: ("N") -> (1e-3, "kN")."""
    known = _DISPLAY_UNITS.get(unit.replace("rad/s", "rad s-1"))
    return known if known is not None else (1.0, as_fraction(unit))


def as_fraction(unit: str) -> str:
    """A product of powers as a fraction: "N s m-2" as "N s/m²"; what is none, or has no power, as it is."""
    factors = [_POWER.fullmatch(factor) for factor in unit.split()]
    if None in factors or "-" not in unit:
        return unit
    above: list[str] = []
    below: list[str] = []
    for symbol, sign, power in (factor.groups() for factor in factors if factor):
        (below if sign else above).append(symbol + power.replace("1", "").translate(_RAISED))
    divisor = f"({' '.join(below)})" if len(below) > 1 else "".join(below)
    return f"{' '.join(above) or '1'}/{divisor}"


def value_unit(array: xr.DataArray) -> tuple[float, str]:
    """Factor and unit in which the values of a variable are shown: `display_unit`, or a smaller one."""
    unit = str(array.attrs.get("units", ""))
    if unit in _SMALL:
        values, (least, smaller) = np.abs(array.values), _SMALL[unit]
        if 0.0 < values.max(initial=0.0, where=np.isfinite(values)) < least:
            return smaller
    return display_unit(unit)


def coordinate_unit(attributes: Mapping[str, object]) -> tuple[float, str]:
    """Factor and unit in which a coordinate is shown: those of the job where it names one."""
    if JOB_UNITS not in attributes:
        return display_unit(str(attributes.get("units", "")))
    unit = shown_unit(attributes)
    return shown_number(1.0, attributes), f"µ{unit[1:]}" if unit in ("um", "us") else unit


def in_words(array: xr.DataArray) -> str:
    """Name of a variable for people: its `long_name` if that is short, else `name` without underscores."""
    words = str(array.attrs.get("long_name", ""))
    # datasets of earlier versions have sentences there
    return words if 0 < len(words) <= LONGEST_NAME else str(array.name).replace("_", " ")


def axis_label(array: xr.DataArray, unit: str) -> str:
    """Name of a variable in words, with its display unit in brackets."""
    return f"{in_words(array)} [{unit}]" if unit else in_words(array)


def check_known(dataset: xr.Dataset, names: Iterable[str], source: str) -> None:
    """Raise InputError if none of some variables, which a picture draws, has a finite value."""
    names = list(names)
    if not any(name in dataset and bool(np.isfinite(dataset[name]).any()) for name in names):
        reasons = (str(dataset[name].attrs.get(WITHOUT, "")) for name in names if name in dataset)
        raise mismatch(
            source, f"known values of {' or '.join(names)}", "none", next(filter(None, reasons), "")
        )


def headline(subject: str, *attributes: Mapping[str, str]) -> str:
    """First line above a picture of datasets with these attributes: its subject, and their jobs."""
    jobs = dict.fromkeys(one_line(one.get("job_name", "")) for one in attributes)
    return f"{subject}: {', '.join(filter(None, jobs))}".removesuffix(": ")


def draw(compose: Callable[[], Figure], out: Path) -> Path:
    """Compose a figure in the style of all pictures and write it as `save_figure` does, or refuse before."""
    _check_format(Path(out))
    with matplotlib.rc_context():  # a user's settings do not change the picture, nor the picture these
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(STYLE)
        return save_figure(as_written(compose()), out)


def styled(compose: Callable[P, Figure]) -> Callable[P, Figure]:
    """Make a function compose its figure in the style of all pictures, as one that a notebook shows."""

    @wraps(compose)
    def within(*args: P.args, **options: P.kwargs) -> Figure:
        with matplotlib.rc_context(STYLE):
            figure = as_written(compose(*args, **options))
        # Jupyter shows figures that pyplot does not know only after `%matplotlib inline`
        figure.__dict__["_repr_png_"] = partial(_as_png, figure)
        return figure

    return within


def _as_png(figure: Figure) -> bytes:
    """A picture of a figure for a notebook."""
    written = BytesIO()
    figure.savefig(written, format="png", dpi=_INLINE)
    return written.getvalue()


def as_written(figure: Figure) -> Figure:
    """Let all texts of a figure stand as they are: two `$` in a name or label begin no formula.

    The powers of ten on logarithmic axes remain formulas. It takes long, and is done once for a figure.
    """
    if figure in _AS_WRITTEN:
        return figure
    _AS_WRITTEN.add(figure)
    for text in _texts_within(figure):
        text.set_parse_math(False)
    return figure


def _texts_within(artist: Artist) -> Iterator[Text]:
    """All texts of an artist that are drawn, but for numbers along axes.

    Those of hidden axes would be made first, and so would be numbers, which takes long.
    """
    if isinstance(artist, Text):
        yield artist
    elif isinstance(artist, Axis) and artist.get_visible():
        yield from (artist.label, artist.offsetText)
        major, minor = artist.get_major_formatter(), artist.get_minor_formatter()
        for formatter, ticks in ((major, artist.get_major_ticks), (minor, artist.get_minor_ticks)):
            if isinstance(major, LogFormatter) or type(formatter) in _NUMBERS:
                ticks(1)  # in the present style, which others take over from it
                continue
            for tick in ticks():
                yield from _texts_within(tick)
    elif artist.get_visible():
        for child in artist.get_children():
            yield from _texts_within(child)


class Grid(NamedTuple):
    """Layout of panels: how many stand side by side, and the height of each with its title [inch]."""

    columns: int
    height: float


def fitting(count: int, columns: Sequence[int], heights: tuple[float, float], page: float) -> Grid | None:
    """Lay panels out within the height of a page [inch], or return None where they are too low to be read.

    `columns` say how many may stand side by side, the best one first: rows are lowered before the next one is
    taken. `heights` are of a panel with its title [inch]: the least that is readable, and the wanted one.
    """
    least, wanted = heights
    for side_by_side in columns:
        height = min(wanted, page / -(-count // side_by_side))
        if height >= min(least, wanted):
            return Grid(side_by_side, height)
    return None


def on_a_page(
    count: int, columns: Sequence[int], heights: tuple[float, float], frame: float, source: str, then: str
) -> Grid:
    """Lay panels out as `fitting` does, on a page of which title, labels and legend take `frame` [inch].

    If they do not fit, InputError names the source, and says what to do `then`.
    """
    if (grid := fitting(count, columns, heights, LONG - frame)) is not None:
        return grid
    most = max(columns) * int((LONG - frame) / min(heights))
    raise mismatch(source, f"at most {most} panels, which one page holds", str(count), then)


def panels_on_a_page(
    count: int,
    columns: Sequence[int],
    heights: tuple[float, float],
    frame: float,
    source: str,
    then: str,
    *,
    each: int = 1,
    width: float = WIDTH,
    **sharing: Any,
) -> tuple[Figure, Panels, float]:
    """Figure with panels laid out as by `on_a_page`, of which nothing is drawn beyond those that are used.

    Instead of one panel there may be `each`, side by side. Returned are the figure, all panels by row and
    column, and the height of a row [inch].
    """
    grid = on_a_page(count, columns, heights, frame, source, then)
    rows = -(-count // grid.columns)
    figure = Figure((width, rows * grid.height + frame), layout="constrained")
    panels = figure.subplots(rows, grid.columns * each, squeeze=False, **sharing)
    for axes in panels.flat[count * each :]:
        axes.set_axis_off()
    return figure, panels, grid.height


def label_x(panels: Panels, count: int, label: str) -> None:
    """Name what runs along x below the last panels of the columns, of which `count` are used."""
    for axes in panels.flat[:count][-panels.shape[1] :]:
        axes.set_xlabel(label)
        axes.tick_params(labelbottom=True)


def entries_of(panels: Iterable[Axes]) -> dict[str, Handle]:
    """Entries for a legend of several panels: handles by label."""
    entries: dict[str, Handle] = {}
    for axes in panels:
        handles, labels = axes.get_legend_handles_labels()
        entries |= dict(zip(labels, handles, strict=True))
    return entries


def legend_below(figure: Figure, entries: Mapping[str, Handle], columns: int | None = None) -> None:
    """Put a legend of handles by label below the panels, if there are any, in as many columns as fit."""
    if entries:
        place = {"loc": "outside lower center", "frameon": False}
        ncols = columns or legend_columns(list(entries))
        figure.legend(entries.values(), entries.keys(), **place, ncols=ncols)


def outlined(width: float, colour: str = "white") -> list[AbstractPathEffect]:
    """Outline of a line or a text, which keeps it apart from what it is drawn over."""
    return [withStroke(linewidth=width, foreground=colour), Normal()]


def with_units(line: str) -> str:
    """A line whose numbers are not parted from their units where it is broken."""
    return re.sub(r"\b(\d[\d.]*) ", "\\1\u00a0", line)


def balanced(line: str, width: int) -> str:
    """Break a line into no more lines than it takes, of like length, `width` letters at most.

    Numbers stay with their units, and phrases whole where that takes no further line.
    """
    line, least = with_units(line), 1
    whole = re.sub("(?<![:;,]) ", "\0", line)
    longest = max(map(len, whole.split()), default=0)
    if longest <= width and len(wrap(whole, width)) == len(wrap(line, width)):
        line, least = whole, longest
    lines = wrap(line, width)
    while width > least and len(narrower := wrap(line, width - 1)) == len(lines):
        lines, width = narrower, width - 1
    return "\n".join(lines).replace("\0", " ")


def entitle(figure: Figure, lines: Sequence[str], width: int = 72) -> None:
    """Put lines that are not empty above a picture, each broken as by `balanced`."""
    figure.suptitle("\n".join(balanced(line, width) for line in lines if line).replace("\u00a0", " "))


def legend_columns(labels: Sequence[str]) -> int:
    """Entries side by side in a legend below a picture of WIDTH."""
    longest = max((len(label) for label in labels), default=0)
    return max(min(len(labels), _LEGEND_LETTERS // (longest + _HANDLE_LETTERS)), 1)


def save_figure(figure: Figure, out: Path) -> Path:
    """Write a picture in the format that the suffix names, and return its path.

    Its folder is made if needed. InputError if the suffix is none of .png, .svg, .pdf, or the system refuses;
    what stood there is then untouched.
    """
    out = Path(out)
    _check_format(out)
    suffix = out.suffix.lower()
    with written_aside(out, parents=True) as aside:
        if suffix == ".png":
            _write_png(figure, aside)
        else:  # without the date, so that the same results give the same file
            undated = {"Date" if suffix == ".svg" else "CreationDate": None}
            figure.savefig(aside, format=suffix[1:], metadata=undated, dpi=1.5 * RESOLUTION)
    return out


def _write_png(figure: Figure, path: Path) -> None:
    """Write a picture of 256 colours: a quarter of the size of full colour, and no different to the eye."""
    figure.set_dpi(RESOLUTION)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    picture = Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")
    reduced = picture.quantize(256, Image.Quantize.MEDIANCUT, kmeans=SETTLED, dither=Image.Dither.NONE)
    reduced.save(path, "png", dpi=(RESOLUTION, RESOLUTION))


def _check_format(out: Path) -> None:
    """Raise InputError unless the suffix names a picture format."""
    if out.suffix.lower() not in FORMATS:
        raise mismatch(str(out), f"a picture: {', '.join(FORMATS)}", out.suffix or "no suffix")


def number(value: float, layout: str = ".6g") -> str:
    """A number in at most six digits, or in another layout, with a true minus."""
    return format(value, layout).replace("-", "−")


def short_numbers(values: NDArray[np.float64], *, is_log: bool = False) -> tuple[str, ...]:
    """Numbers with as few decimals as tell them apart: 954.93 and 1909.86 as 955 and 1910.

    Each is off by at most ROUNDED of the smallest distance, or of itself on a logarithmic axis.
    """
    steps = np.abs(values) if is_log or values.size < 2 else np.abs(np.diff(values)).min()
    allowed = np.broadcast_to(ROUNDED * steps, values.shape)
    texts = []
    for value, off in zip(values.tolist(), allowed, strict=True):
        tried = (round(value, decimals) for decimals in range(_MOST_DECIMALS))
        texts.append(number(next((one for one in tried if abs(one - value) <= off), value)))
    return tuple(texts)


class Places(Locator):
    """Given places on an axis in ascending order, or every second, third, ... where labels would touch."""

    def __init__(self, places: NDArray[np.float64], labels: Sequence[str], letters: float = LETTER) -> None:
        self.places, self.labels, self.letters = np.asarray(places), labels, letters

    def __call__(self) -> NDArray[np.float64]:
        """Return the places that have room at the axis' present length."""
        return self.tick_values(*self.axis.get_view_interval())

    def tick_values(self, vmin: float, vmax: float) -> NDArray[np.float64]:
        """Return the places that have room between two limits of the axis."""
        box, along_x = self.axis.axes.bbox, isinstance(self.axis, XAxis)
        length = 72.0 * (box.width if along_x else box.height) / self.axis.axes.figure.dpi
        scale = length / (abs(vmax - vmin) or 1.0)
        sizes = np.array([self.letters * len(label) if along_x else 0.0 for label in self.labels])
        for stride in range(1, self.places.size):
            kept = slice(None, None, stride)  # alike everywhere, so that an eye can fill the gaps
            needed = 0.5 * (sizes[kept][1:] + sizes[kept][:-1]) + (GAP if sizes.any() else LINE)
            if (scale * np.diff(self.places[kept]) >= needed).all():
                return self.places[kept]
        return self.places[:1]


def put_ticks(axis: Axis, places: NDArray[np.float64], labels: Sequence[str]) -> None:
    """Put labelled ticks at places of an axis; texts that are too long for a line stand upright along x."""
    is_upright = isinstance(axis, XAxis) and sum(map(len, labels)) > TEXTS
    is_upright &= not all(label[:1] in "−0123456789" for label in labels)
    axis.set_major_locator(Places(places, labels, 0.0 if is_upright else LETTER))
    if is_upright:
        axis.set_tick_params(rotation=90)

    def label_at(place: float, _: int | None = None) -> str:
        return labels[int(np.argmin(np.abs(places - place)))] if len(labels) else ""

    axis.set_major_formatter(FuncFormatter(label_at))


def line_style(k: int) -> dict[str, Any]:
    """Line and marker of the k-th method."""
    line = LINES[k // len(COLOURS) % len(LINES)]
    style = {"color": COLOURS[k % len(COLOURS)], "ls": line, "marker": MARKERS[k % len(MARKERS)]}
    return style | {"lw": 1.3, "ms": 4.5}


def set_error_axis(axes: Axes, values: Sequence[float]) -> float:
    """Make room for the values, and return the lower limit."""
    low, high = min(values, default=1e-3) / MARGIN, max(values, default=1.0) * MARGIN
    wanting = max(_LEAST_SPAN * low / high, 1.0) ** 0.5
    axes.set_xlim(low / wanting, high * wanting)
    axes.xaxis.set_minor_formatter(NullFormatter())
    return low / wanting
