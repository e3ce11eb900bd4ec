"""Kinds of pictures beside the map: one table for `cvt-hpc plot KIND` and for `dataset.cvt.KIND()`.

A new kind is a function that composes its figure, by the arguments of all pictures (`analysis/figures.py`)
and options of its own, and an entry here. The command line reads this table at its start, when nothing that
draws has been imported yet; what a picture needs is imported when `compose` draws it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib import import_module
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

# A study; runs in a picture each; runs together in one picture.
RESULTS, HISTORY, HISTORIES = "RESULTS", "HISTORY", "HISTORIES"
END = "vmax"  # where colours end: a number [SI], by the command line with its unit


class Option(NamedTuple):
    """A choice that a kind offers."""

    key: str  # argument of the figure's function
    text: str  # what it chooses
    flag: str  # of the command line; "" where its words stand behind the dataset
    settings: Mapping[str, Any]  # of the command line: how `argparse` reads it
    is_named: bool = False  # whether the picture's file has it in its name
    is_word: bool = False  # whether the accessor takes it without its key, as its first arguments


class Kind(NamedTuple):
    """A kind of pictures."""

    subject: str  # RESULTS, HISTORY or HISTORIES
    figure: str  # module of `analysis/`, and its function that composes the figure
    text: str  # what it shows
    options: tuple[Option, ...] = ()  # beside those of all kinds of the subject
    sides: tuple[str, ...] = ()  # of `x`, `y`, `panel`: sides on which an axis can be put
    data: str = ""  # as `figure`: a function that gives a dataset of what is drawn, where there is one


def _several(text: str) -> Option:
    settings = {"action": "append", "default": [], "metavar": "QUANTITY"}
    return Option(
        "quantities", f"variable over position; may be repeated ({text})", "--of", settings, True, True
    )


def _end(of: str) -> Option:
    text = f"value at which the colours end, such as '20 um' (default: that of 98 %% of the {of})"
    return Option(END, text, "--vmax", {"metavar": "VALUE"})


def _region(text: str) -> Option:
    return Option("region", text, "--region", {"choices": ("driving", "driven")}, True)


MEASURED = Option(
    "measured",
    "CSV file of a test rig, drawn over it: noise windows, onsets, peaks or a spectrogram",
    "--measured",
    {"metavar": "CSV"},
)
_FLAG = {"action": "store_true"}

ALONG = Option(
    "along",
    "axis along which vibration sets in (default: the load, or where most rows change)",
    "--along",
    {"metavar": "AXIS"},
)

ORDERS = Option(
    "orders",
    "orders: 8 of the driving pulley, driven:2, elements:1 (default: 1 2 4 8 16 driven:1 elements:1)",
    "--orders",
    {"nargs": "+", "metavar": "ORDER"},
)
BANDWIDTH = Option(
    "bandwidth",
    "band of an order, in orders (default: 1)",
    "--bandwidth",
    {"type": float, "metavar": "ORDERS"},
)
_VELOCITY = Option("velocity", "of velocities in the place of displacements", "--velocity", _FLAG)
LEVEL = Option("level", "RMS levels in dB in the place of amplitudes", "--level", _FLAG)

KINDS = {
    "waterfall": Kind(
        RESULTS,
        "waterfall.waterfall_figure",
        "spectra of the strands over an axis, with eigenfrequencies where they are known",
        (_end("runs"), MEASURED),
        sides=("x", "panel"),
    ),
    "campbell": Kind(
        RESULTS,
        "waterfall.campbell_figure",
        "Campbell diagram: spectra over the driving speed, with eigenfrequencies and orders",
        (
            Option(
                "orders",
                "multiples of the driving pulley's turns (default: 1 2 4 8 16)",
                "--orders",
                {"nargs": "+", "type": float, "metavar": "ORDER"},
            ),
            _end("runs"),
            MEASURED,
        ),
        sides=("panel",),
    ),
    "hysteresis": Kind(
        RESULTS,
        "hysteresis_bands.hysteresis_figure",
        "where vibration begins and ends along ramps up and down, and the bands between them",
        (MEASURED,),
        sides=("y", "panel"),
    ),
    "onset_bands": Kind(
        RESULTS,
        "probability_drawing.onset_bands_figure",
        "onset of vibration over an axis, with its scatter over the samples of uncertain parameters",
        (ALONG, MEASURED),
        sides=("x", "panel"),
    ),
    "sensitivity": Kind(
        RESULTS,
        "probability_drawing.sensitivity_figure",
        "which uncertain parameters the onset of vibration depends on, and what half their scatter changes",
        (ALONG,),
    ),
    "curve": Kind(
        RESULTS,
        "curves.curves_figure",
        "a quantity over an axis as marks, and others of its unit as lines beside it",
        (
            Option(
                "quantities",
                "variable of the results; with --lines, A+B share a panel",
                "",
                {"nargs": "+", "metavar": "QUANTITY"},
                True,
                True,
            ),
            Option(
                "lines",
                "a curve for each value of that axis, and a panel for each quantity",
                "--lines",
                {"metavar": "AXIS"},
            ),
        ),
    ),
    "wrap": Kind(
        HISTORIES,
        "profiles.wrap_figure",
        "forces between belt and pulleys over the wrap, of one run or of several",
    ),
    "profile": Kind(
        HISTORIES,
        "profiles.profile_figure",
        "quantities along the belt of one run or of several, such as forces and sliding",
        (
            _several("default: push force or tension, and friction"),
            _region("over the wrap of that pulley alone"),
            Option(
                "columns", "a column of panels for each value of an axis", "--columns", {"metavar": "AXIS"}
            ),
        ),
    ),
    "ramp": Kind(
        HISTORIES,
        "ramps.ramp_figure",
        "motion of a strand along a ramp of load or speed, with its spectrogram",
        (
            Option(
                "of",
                "t1, t2 or a variable over time (default: t1)",
                "--of",
                {"default": "t1", "metavar": "WHAT"},
                True,
                True,
            ),
            _end("moments"),
            MEASURED,
        ),
    ),
    "spectrogram": Kind(
        HISTORIES,
        "ramps.spectrogram_figure",
        "spectra of the strands side by side along a ramp or over time, with eigenfrequencies",
        (_end("moments"), MEASURED),
    ),
    "orders": Kind(
        HISTORIES,
        "orders.orders_figure",
        "orders of the pulleys' turns and of passing elements along a ramp of speed, or over time",
        (
            Option(
                "of",
                "t1, t2, a probe, variable over time or shaft force (default: t1)",
                "--of",
                {"default": "t1", "metavar": "WHAT"},
                True,
                True,
            ),
            ORDERS,
            BANDWIDTH,
            _VELOCITY,
            LEVEL,
        ),
    ),
    "order_cuts": Kind(
        RESULTS,
        "orders.order_cuts_figure",
        "orders of the pulleys' turns and of passing elements over the driving speeds of a study",
        (ORDERS, BANDWIDTH, _VELOCITY, LEVEL),
    ),
    "third_octaves": Kind(
        HISTORIES,
        "time_signals.third_octaves_figure",
        "RMS levels of the judged part in third octaves, in dB re 1 um, 1 mm/s or the unit",
        (
            Option(
                "quantities",
                "t1, t2, a probe, variable over time or shaft force; may be repeated (default: t1 and t2)",
                "--of",
                {"action": "append", "default": [], "metavar": "WHAT"},
                True,
                True,
            ),
            _VELOCITY,
        ),
    ),
    "element": Kind(
        HISTORY,
        "followed_drawing.element_figure",
        "sliding of one element on the sheaves over time, along its path",
        (_region("one passage of that arc alone"),),
        data="followed_drawing.followed_of",
    ),
    "strands": Kind(
        RESULTS,
        "paper_pictures.strand_bars_figure",
        "tension and push force of the strands over an axis, as bars",
        sides=("x", "panel"),
    ),
    "history": Kind(
        HISTORY,
        "histories.history_figure",
        "a kept run: displacement, spectrum, load, forces and feeds around the belt",
    ),
    "phase": Kind(
        HISTORY, "histories.phase_figure", "phase portraits: velocity of each strand over its displacement"
    ),
    "flanks": Kind(
        HISTORY,
        "profiles.flanks_figure",
        "left and right flank of a spatial pushbelt, with the ends of the arcs enlarged",
    ),
    "energy": Kind(
        HISTORY,
        "on_variator.energy_figure",
        "powers around the belt: what friction takes on the arcs, what feeds the vibration",
    ),
    "variator": Kind(
        HISTORY,
        "on_variator.variator_figure",
        "quantities along the belt drawn on the variator, such as forces, speeds and slip",
        (_several("default: push_force, of belt drives tension"),),
    ),
}


def compose(
    name: str,
    datasets: Sequence[xr.Dataset],
    at: Mapping[str, Any] | None = None,
    sources: Sequence[str] = (),
    **options: Any,
) -> Figure:
    """Compose a picture of a kind.

    Parameters
    ----------
    name : str
        Of KINDS.
    datasets : sequence of Dataset
        Results of one study, one history or several, by the kind's subject.
    at : mapping, optional
        Axes of results to fix.
    sources : sequence of str, optional
        Where the datasets are from, for the errors.
    **options
        By their keys, and by the sides the axes put there; those left out have the defaults of the figure.

    Raises
    ------
    InputError
        As of the figure.
    """
    kind, given = KINDS[name], dict(options)
    if sides := {side: given.pop(side) for side in kind.sides if side in given}:
        from cvt_hpc.analysis.arrangement import Sides

        given["sides"] = Sides(**sides)
    if kind.subject == RESULTS:
        given["at"] = at
    subject: Any = datasets
    if kind.subject != HISTORIES:
        (subject,) = datasets
    if sources:
        given |= {"sources": sources} if kind.subject == HISTORIES else {"source": sources[0]}
    return function_of(kind.figure)(subject, **given)


def function_of(place: str) -> Any:
    """A function by its module in this room and its name."""
    module, _, name = place.partition(".")
    return getattr(import_module(f"cvt_hpc.analysis.{module}"), name)
