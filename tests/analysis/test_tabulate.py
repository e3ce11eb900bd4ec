"""jobs/tabulate.py: the table that is kept of a slow study."""

import csv
import runpy
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from cvt_hpc.errors import InputError
from cvt_hpc.variables import Status, Vibrates
from support.studies import study

ROWS = runpy.run_path(str(Path(__file__).parents[2] / "jobs" / "tabulate.py"))["rows"]


def table():
    results = study(gradients=(-2.4, -0.8))
    shape = results["status"].shape
    results["mode"] = (results["amplitude"].dims, np.full((*shape, 2), [2, 3], np.int8))
    for name in ("power_residual", "core_seconds"):
        results[name] = (results["status"].dims, np.full(shape, 0.25))
    return results, list(csv.DictReader(ROWS(results)))


def test_each_run_has_its_row_in_the_order_of_the_axes():
    results, rows = table()
    assert len(rows) == results["status"].size
    wanted = [
        (g, s, q) for g in (-2.4, -0.8) for s in (1.0, 1.2, 1.5, np.inf) for q in results["load"].values
    ]
    found = [(float(r["friction_gradient"]), float(r["sheave_stiffness"]), float(r["load"])) for r in rows]
    assert found == wanted


def test_values_are_those_of_the_dataset_in_the_units_of_the_head():
    results, rows = table()
    row, run = rows[4], results.isel(friction_gradient=0, sheave_stiffness=0, load=4)
    assert row["status"] == "done" and row["vibrates"] == "yes"
    # two digits after the point in um, one in Hz
    assert abs(float(row["amplitude_t1 [um]"]) - run["amplitude"].values[0] * 1e6) <= 0.005
    assert abs(float(row["frequency_t2 [Hz]"]) - run["frequency"].values[1]) <= 0.05
    assert (row["mode_t1"], row["mode_t2"], row["power_residual"]) == ("2", "3", "0.25")


def test_a_run_that_failed_has_no_numbers():
    _, rows = table()
    failed = [row for row in rows if row["status"] != "done"]
    assert {row["status"] for row in failed} >= {"failed_numerics", "failed_error", "timed_out", "not_run"}
    for row in failed:
        assert not any(
            row[key] for key in row if key.startswith(("vibrates", "amplitude", "frequency", "mode"))
        )


def test_an_unknown_variable_is_told_with_the_nearest():
    with pytest.raises(InputError, match="frequncy: unknown variable; did you mean frequency"):
        list(ROWS(table()[0], ["frequncy"]))


def test_samples_have_their_place_in_the_table():
    results, rows = table()
    stacked = results.stack(run=("friction_gradient", "sheave_stiffness", "load")).reset_index("run")
    assert list(csv.DictReader(ROWS(stacked.transpose("run", ...)))) == rows


def test_lags_of_the_tilt_are_counted_by_ranges():
    of_lags = runpy.run_path(str(Path(__file__).parents[2] / "jobs" / "tilt_lag.py"))["table"]
    lags = np.array([0.25, 0.25, 0.4, 0.4, 1.5, 4.0, 4.0])
    status = np.array([Status.DONE] * 6 + [Status.FAILED_NUMERICS])
    yes, no, open_one = Vibrates.YES, Vibrates.NO, Vibrates.UNDECIDED
    verdicts = np.array([yes, no, yes, yes, no, open_one, yes])
    runs = {"tilt_lag": 1e-3 * lags, "status": status, "vibrates": verdicts}
    found = of_lags(xr.Dataset({name: ("run", values) for name, values in runs.items()}))
    assert found["samples"].tolist() == [2, 2, 0, 1, 1]
    assert found["vibrating"].tolist() == [1, 2, 0, 0, 0]
    assert found["undecided"].tolist() == [0, 0, 0, 0, 1]
