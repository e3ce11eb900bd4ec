"""`cvt-hpc growth`: growth rates and frequencies of the modes of any transient model, by twin runs.

Each cell of a job is run three times, without a kick, with half of it and with the whole, in one ordinary
study; `twins` finds the modes. Beside those of the elastic belt stand the eigenvalues of its steady state.
"""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from cvt_hpc.errors import InputError, mismatch
from cvt_hpc.experiments.outcome import Outcome, Tell
from cvt_hpc.experiments.sweeps import Sweep, handed, load_sweep, maker_of, run_sweeps, sweep_lines
from cvt_hpc.job import Job, rebuild_job
from cvt_hpc.job.assignments import Assignments
from cvt_hpc.job.loading import load_job
from cvt_hpc.job.values import heading, in_words, read_value, shown_number
from cvt_hpc.models import MODELS
from cvt_hpc.models.contract import load_model
from cvt_hpc.storage.files import write_rows
from cvt_hpc.storage.netcdf import attributes, global_attributes, open_netcdf, store
from cvt_hpc.storage.provenance import origin_lines
from cvt_hpc.study import process_rank
from cvt_hpc.study.status import STALLED
from cvt_hpc.tables import columns, number, short
from cvt_hpc.variables import Status, Vibrates
from cvt_hpc.vibration.twins import MOST_MODES, Found, found_modes, nothing

_TWINS, _EIGENVALUES = "twins", "linear_stability"
SHARES = (0.0, 0.5, 1.0)  # of the kick
# By key what a run is given, where its model knows the key: a run that is prolonged or done again at another
# step has no twin, and chatter by rounding would hide small motions
_RUN = {"shortest_duration": 0.0, "most_refinements": 0, "precision": "double"}
# Variable -> its name, unit and meaning: of a mode, and of a cell
_OF_MODES = {
    "frequency": ("frequency", "Hz", ""),
    "frequency_error": ("error of frequency", "Hz", "largest deviation of a decomposition"),
    "growth_rate": ("growth rate", "s-1", "negative: decay"),
    "growth_rate_error": ("error of growth rate", "s-1", "largest deviation of a decomposition"),
    "share": ("share", "1", "of the energy of the difference, in the part where the mode is strongest"),
}
_OF_CELLS = {
    "window": ("linear record", "s", "from the kick to where twice the kick does not double the difference"),
    "difference": ("difference", "m", "rms, by the kick, within the linear record"),
    "floor": ("floor", "m", "rms that chatter and nonlinear terms leave in the difference"),
    "unrest": ("unrest", "m", "rms of the motion without a kick, apart from its drift"),
}


class Growth(NamedTuple):
    """A job whose modes are asked for."""

    job: Job  # as it was given
    kick: float  # largest value of the model's parameter of a kick [SI]
    rungs: tuple[Sweep, ...]  # the twin runs; the eigenvalues, where there are any
    refusals: dict[str, str]  # why there are none, by the name of the model


def load(path: str | Path, overrides: Assignments = (), kick: str | None = None) -> Growth:
    """Read a job, with overrides as of `load_job`, and return the runs by which its modes are found.

    The kick's size has a unit; by default it is the model's own.

    Raises
    ------
    InputError
        If the job is not legal, or its model has no kick.
    """
    job = load_job(path, overrides)
    key, size = _kick_of(job)
    if key in _axes(job):
        raise mismatch(f"{job.source}: [axes] {key}", "none: growth takes a kick of its own", "an axis")
    if job.design:
        raise mismatch(f"{job.source}: [design]", "none: growth goes over the whole grid", job.design["kind"])
    if job.parameters.get("profile_time"):
        expected = "none: growth is that about one steady state"
        raise mismatch(f"{job.source}: [{job.schema.section_of['profile_time']}]", expected, "profiles")
    if kick is not None:
        size = read_value(job.schema.parameters[key], kick, "--kick")
        if not size > 0.0:
            raise mismatch("--kick", "a value above 0", kick)
    rungs, refusals = [Sweep(_TWINS, (), _twin_job(job, key, size))], {}
    if job.model == "elastic_belt":
        try:
            rungs.append(Sweep(_EIGENVALUES, (), handed(job, _EIGENVALUES, {})))
        except InputError as error:
            refusals[_EIGENVALUES] = str(error)
    return Growth(job, size, tuple(rungs), refusals)


def _kick_of(job: Job) -> tuple[str, float]:
    """Return the parameter by which runs of a job are kicked, and a small value of it."""
    kick = load_model(job.model).kick
    if kick is None:
        known = ", ".join(name for name in MODELS if load_model(name).kick)
        raise mismatch(f"{job.source}: model", f"one whose runs can be kicked ({known})", job.model)
    return kick


def _twin_job(job: Job, key: str, size: float) -> Job:
    """Return a job of three runs for each cell, whose histories are kept."""
    document, section_of = job.resolved(), job.schema.section_of
    changed = {**_RUN, "longest_duration": job.parameters["duration"]}
    if "precision" in job.given:
        del changed["precision"]
    for name, value in changed.items():
        if name in section_of:
            document[section_of[name]][name] = value
    document[section_of[key]].pop(key, None)
    document["axes"][key] = [share * size for share in SHARES]
    document.setdefault("record", {})["history"] = list(range(len(SHARES) * job.size))
    return rebuild_job(document, job.source, job.units)


def plan_lines(asked: Growth, out: Path) -> Iterator[str]:
    """Yield the lines that state the runs and their expected cost."""
    yield f"growth {asked.job.name} ({asked.job.source}): {asked.job.size} cells, three runs each"
    yield from sweep_lines(asked.rungs, asked.refusals, out)


def make(asked: Growth, out: Path, *, fresh: bool, tell: Tell) -> Outcome:
    """Do the runs, find the modes, and write table and dataset; see `experiment_kinds`.

    Raises
    ------
    InputError
        If a folder holds another job, or the system refuses to read or write a file.
    """
    status = run_sweeps(asked.rungs, asked.refusals, out, fresh=fresh, tell=tell)
    if status >= STALLED or process_rank() != 0:
        return Outcome(status=status)
    dataset = _growth_dataset(asked, find_growth(asked, out), out)
    path, table = store(dataset, out / "growth.nc"), _write_table(asked, dataset, out / "growth.csv")
    return Outcome(tuple(_lines(asked, dataset)), (("written", table), ("written", path)), status)


def find_growth(asked: Growth, out: Path) -> list[Found]:
    """Return the modes of each cell of a job, in the order of its runs, from the folder with done studies.

    Raises
    ------
    InputError
        If a file cannot be read.
    """
    dataset = load_sweep(_TWINS, out)
    status = dataset["status"].values.reshape(-1, len(SHARES))
    reasons, verdicts = (dataset[name].values.reshape(status.shape) for name in ("reason", "vibrates"))
    found = []
    for cell, (ended, why) in enumerate(zip(status, reasons, strict=True)):
        failed = np.flatnonzero(ended != Status.DONE)
        if failed.size:
            text = why[failed[0]]
            text = text.decode() if isinstance(text, bytes) else str(text)
            found.append(nothing(f"{Status(int(ended[failed[0]])).name.lower()}: {text}"))
            continue
        runs = range(cell * len(SHARES), (cell + 1) * len(SHARES))
        motions = [_displacement(out / _TWINS / "histories" / f"run-{run:06d}.nc") for run in runs]
        shortest = min(map(len, motions))  # of runs that the belt's slipping through ends
        point = asked.job.point(cell)
        motion = np.array([motion[:shortest] for motion in motions])
        vibrates = verdicts[cell, 0] in (Vibrates.YES, Vibrates.IRREGULAR)
        found.append(found_modes(motion, point["sampling_rate"], point["band_high"], vibrates=bool(vibrates)))
    return found


def _displacement(path: Path) -> np.ndarray:
    with open_netcdf(path) as history:
        return history["displacement"].values


def _growth_dataset(asked: Growth, found: Sequence[Found], out: Path) -> xr.Dataset:
    """Return the modes over the axes of the job and `mode`, the strongest first."""
    job, size = asked.job, max(asked.job.size, 1)
    names = _axes(job)
    values = {name: np.full((size, MOST_MODES), np.nan) for name in _OF_MODES}
    for cell, one in enumerate(found):
        modes = one.modes
        numbers = modes.frequency, one.frequency_error, modes.growth, one.growth_error, modes.share
        for array, row in zip(values.values(), numbers, strict=True):
            array[cell, : len(row)] = row
    variables: dict[str, Any] = {
        name: ((*names, "mode"), values[name].reshape(*job.shape, MOST_MODES), attributes(*words))
        for name, words in _OF_MODES.items()
    }
    for name, words in _OF_CELLS.items():
        cells = np.array([getattr(one, name) for one in found]).reshape(job.shape)
        variables[name] = (names, cells, attributes(*words))
    reasons = np.array([one.reason for one in found], object).reshape(job.shape)
    variables["reason"] = (names, reasons, attributes("reason", comment="why there are no modes"))
    results = load_sweep(_TWINS, out)
    coordinates, makers = {name: results[name] for name in names}, [maker_of(results)]
    told = global_attributes(job, job.resolved(), "modes by twin runs", makers=makers)
    dataset = xr.Dataset(variables, coordinates, {**told, "job_fingerprint": job.fingerprint()})
    if len(asked.rungs) > 1:
        results = load_sweep(_EIGENVALUES, out)
        for name in ("growth_rate", "loosened_growth_rate", "frequency"):
            dataset[f"linear_{name}"] = results[name]
    return dataset


def _write_table(asked: Growth, dataset: xr.Dataset, path: Path) -> Path:
    numbers = [*_OF_MODES, *_OF_CELLS, *(str(name) for name in dataset if str(name).startswith("linear_"))]
    head = [heading(str(name), dataset[name].attrs) for name in (*_axes(asked.job), *numbers)]
    rows = (
        [*place, *(number(here[name].item()) for name in numbers), here["reason"].item()]
        for place, here in _modes(asked.job, dataset)
    )
    return write_rows(path, [*head, "reason"], rows, origin_lines(dataset.attrs))


def _lines(asked: Growth, dataset: xr.Dataset) -> Iterator[str]:
    """Yield the lines that show the modes to people."""
    job, key = asked.job, _kick_of(asked.job)[0]
    yield f"kick: {key} {job.schema.in_words(key, asked.kick)}; rms of motions in um"
    heads = [heading(name, dataset[name].attrs) for name in _axes(job)]
    lines = [
        [*heads, "[Hz]", "growth [1/s]", "share", "for [ms]", "moved", "floor", "unrest", "eigenvalue", ""]
    ]
    for place, here in _modes(job, dataset):
        value = {str(name): here[name].item() for name in here}
        sizes = (short(1e6 * value[name]) for name in ("difference", "floor", "unrest"))
        lines.append(
            [
                *place,
                *(_within(value[name], value[f"{name}_error"]) for name in ("frequency", "growth_rate")),
                *(short(value["share"]), number(1e3 * value["window"], 3), *sizes),
                _eigenvalue(value),
                value["reason"],
            ]
        )
    yield from columns(lines)


def _within(value: float, error: float) -> str:
    """Return a value with its error to two digits of the error, at most to the third decimal."""
    if np.isnan(value):
        return ""
    decimals = int(np.clip(1 - np.floor(np.log10(max(error, 1e-3))), 0, 3))
    return f"{value:.{decimals}f} +- {error:.{decimals}f}"


def _eigenvalue(value: Mapping[str, Any]) -> str:
    """Return the eigenvalue that grows fastest, in words; "" where there is none."""
    growth = value.get("linear_growth_rate", np.nan)
    return "" if np.isnan(growth) else f"{number(growth, 3)} at {number(value['linear_frequency'], 4)} Hz"


def _axes(job: Job) -> list[str]:
    return [axis.name for axis in job.axes]


def _modes(job: Job, dataset: xr.Dataset) -> Iterator[tuple[list[str], xr.Dataset]]:
    """Yield values on the axes, in the job's units, and variables of each mode, of a cell at least once."""
    for cell in np.ndindex(job.shape):
        at = dataset.isel(dict(zip(_axes(job), cell, strict=True)))
        place = [in_words(shown_number(at[name].item(), at[name].attrs), "") for name in _axes(job)]
        for mode in range(max(int(at["frequency"].notnull().sum()), 1)):
            yield place, at.isel(mode=mode)
