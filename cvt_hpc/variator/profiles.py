"""Profiles: values over time as multiples of the job's, such as a load cycle, given or from a measured file.

Between the times of a profile multiples are linear, before the first and after the last they are constant.
The start-up comes on top: the load rises within `rise_time` to what its profile has then.

A profile that ends before a run is judged leads to a constant scene; one that goes on is judged all along,
as a ramp is (`vibration/ramp.py`), over time.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from cvt_hpc.parameters import Column, FromFile, Parameter, Parameters, Problem, RowError
from cvt_hpc.variator.scene import course_problems, nested_problems

TIME = "profile_time"
FILE = "profile_file"
# of a profile whose name does not say it all
_WORDS = {"ratio": "ratio, by the position of the driving sheave, which moves; from 1 on"}
_UNITS = {  # of a file's columns
    "load": "N m",
    "driving_speed": "rad/s",
    "thrust": "N",
    "driving_thrust": "N",
    "driven_pressure": "Pa",
}
OTHER_NAMES = {
    "t": "time",
    "torque": "load",
    "driving_torque": "load",
    "input_torque": "load",
    "speed": "driving_speed",
    "input_speed": "driving_speed",
    "primary_speed": "driving_speed",
    "driven_thrust": "thrust",
    "clamping_force": "thrust",
    "pressure": "driven_pressure",
    "secondary_pressure": "driven_pressure",
}
MOST_TIMES = 1000  # of a file: longer ones are averaged over as many equal parts
# Of a file that is sampled: more than so many steps in one are a gap; least rows, and share of steps alike
GAP, LEAST_ROWS, ALIKE = 5.0, 20, 0.9


def declared(names: Sequence[str], of_file: Sequence[str]) -> dict[str, Parameter]:
    """Return the parameters of a model's profiles, of the values `names`.

    A file may have the columns `of_file` beside `time`: some of the names, and `driven_pressure`.
    """
    columns = {"time": ("s",), **{name: (_UNITS[name],) for name in of_file}}
    gives = (TIME, *of_file, *(f"{name}_profile" for name in of_file))
    file = FromFile(columns, ("time",), gives, _arranged, OTHER_NAMES)
    told = f"columns time, which counts from its start, and some of {', '.join(of_file)}"
    text = f"CSV, netCDF, MAT or MDF4 file of profiles, measured or not: {told}"
    found = {
        FILE: Parameter("", "", text, file=file),
        TIME: Parameter((), "s", "times of the profiles, ascending", sensible=(1e-4, 2000.0)),
        **{
            f"{name}_profile": Parameter((), "", f"multiples at these times of {_WORDS.get(name, name)}")
            for name in names
        },
    }
    if "driven_pressure" in of_file:
        found["driven_pressure_profile"] = Parameter(
            (), "", "multiples at these times of driven_pressure, in the place of a profile of thrust"
        )
    return found


def _arranged(columns: Mapping[str, Column]) -> dict[str, Any]:
    """Return times and multiples, and for each measured column its greatest value, which they multiply."""
    times = np.array(columns["time"].values)
    others = {name: column for name, column in columns.items() if name != "time"}
    if not others:
        raise ValueError("expected a column beside time, found none")
    if times.size < 2:
        raise ValueError(f"expected two times or more, found {times.size}")
    check_times(times)
    found: dict[str, Any] = {}
    values = {name: np.array(column.values) for name, column in others.items()}
    for name, value in values.items():
        found[name] = most = float(value[np.argmax(np.abs(value))])
        if name != "load" and (low := np.flatnonzero(value <= 0.0)).size:
            raise RowError(int(low[0]), f"a {name} above 0", f"{value[low[0]]:g} {_UNITS[name]}")
        values[name] = value / most if most else np.ones_like(value)
    times = times - times[0]
    if times.size > MOST_TIMES:
        times, values = _averaged(times, values)
    found[TIME] = times.tolist()
    return found | {f"{name}_profile": value.tolist() for name, value in values.items()}


def check_times(times: np.ndarray) -> None:
    """Raise RowError where times [s] do not ascend, or samples of a regular file are missing."""
    steps = np.diff(times)
    if (back := np.flatnonzero(steps <= 0.0)).size:
        row = int(back[0]) + 1
        raise RowError(row, f"a time after {times[row - 1]:g} s, that of the row before", f"{times[row]:g} s")
    usual = float(np.median(steps))
    is_sampled = times.size > LEAST_ROWS and np.mean(np.abs(steps - usual) < 0.1 * usual) >= ALIKE
    if is_sampled and (gaps := np.flatnonzero(steps > GAP * usual)).size:
        row = int(gaps[0]) + 1
        expected = f"samples every {usual:.3g} s without a gap"
        raise RowError(row, expected, f"none from {times[row - 1]:g} to {times[row]:g} s")


def _averaged(
    times: np.ndarray, values: Mapping[str, np.ndarray]
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Return means over MOST_TIMES equal parts, at the mean times of their samples."""
    parts = np.minimum((times / times[-1] * MOST_TIMES).astype(int), MOST_TIMES - 1)
    counts = np.bincount(parts, minlength=MOST_TIMES)
    there = counts > 0

    def means(samples: np.ndarray) -> np.ndarray:
        return np.asarray(np.bincount(parts, samples, MOST_TIMES)[there] / counts[there])

    return means(times), {name: means(value) for name, value in values.items()}


def multiple(parameters: Parameters, name: str, time: Any) -> Any:
    """Return the multiple of a value at a time, or at times [s]; 1 without a profile."""
    p, key = parameters, f"{name}_profile"
    if name == "thrust" and p.get("driven_pressure_profile"):
        # A p + F of the spring: the pressure's part changes
        spring = p["driven_spring_force"] / p["thrust"]
        return spring + (1.0 - spring) * np.interp(time, p[TIME], p["driven_pressure_profile"])
    return np.interp(time, p[TIME], p[key]) if p.get(key) else 1.0


def extremes(parameters: Parameters, name: str) -> tuple[float, float]:
    """Return the least and the greatest value of one that has a profile, along the run."""
    multiples = parameters.get(f"{name}_profile") or (1.0,)
    values = [parameters[name] * value for value in (min(multiples), max(multiples))]
    return min(values), max(values)


def profile_problems(parameters: Parameters) -> list[Problem]:
    """Return problems of courses in time, in the form of a model's check: (key, expected, found)."""
    p, found = parameters, course_problems(parameters)
    profiles = {key: p[key] for key in p if key.endswith("_profile") and p[key]}
    times = p[TIME]
    if not (profiles or times):
        return found
    if wrong := nested_problems(p, (TIME, *profiles)):
        return wrong
    if not times or times[0] < 0.0 or any(np.diff(times) <= 0.0):
        found.append((TIME, "ascending times from 0 on", f"{list(times)}"))
    elif times[-1] > p["duration"] * (1.0 + 1e-9):
        found.append(("duration", f"{times[-1]:g} s or more, the end of {TIME}", f"{p['duration']:g} s"))
    for key, values in profiles.items():
        if len(values) != len(times):
            found.append((key, f"as many values as {TIME} has, {len(times)}", f"{len(values)}"))
        elif key != "load_profile" and min(values) <= 0.0:
            found.append((key, "multiples above 0", f"{min(values):g}"))
    if {"thrust_profile", "driven_pressure_profile"} <= profiles.keys():
        found.append(("thrust_profile", "a profile of thrust or of driven_pressure", "both"))
    ramps = [key for key in ("load_history", "speed_history") if p[key] == "ramp"]
    found += [(key, "constant where there are profiles", "ramp") for key in ramps]
    first = profiles.get("ratio_profile", (1.0,))[0]
    if first != 1.0:
        found.append(("ratio_profile", "1 at first: a run begins at its ratio", f"{first:g}"))
    return found
