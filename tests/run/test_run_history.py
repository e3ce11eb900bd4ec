"""One run with its history: the same numbers as the record's, and histories and profiles that agree with them."""

import json

import numpy as np
import pytest

from cvt_hpc import simulate
from cvt_hpc.errors import InputError
from cvt_hpc.job import build_job
from cvt_hpc.models.elastic_belt.belt import REGIONS, belt_constants, mesh
from cvt_hpc.models.elastic_belt.sampling import probes
from cvt_hpc.simulation import record_coordinates, record_variables
from cvt_hpc.variables import Status, Vibrates
from support.marched import CHEAP, alone, fresh_record, job

LOADED = CHEAP | {"load": 120.0}
JUDGED = slice(400, None)  # of 800 samples


@pytest.fixture(scope="module")
def history():
    return simulate(alone(**LOADED))


@pytest.fixture(scope="module")
def failed():
    """Slips through before the judged part begins."""
    return simulate(job(**LOADED | {"load": 450.0, "duration": 0.08, "precision": "single"}))


def test_the_record_is_in_it_bit_by_bit(history):
    asked, record = job(**LOADED), fresh_record(**LOADED)
    for variable in record_variables(asked):
        found = history[variable.name]
        assert found.dims == variable.dims
        assert found.attrs["long_name"] == variable.long_name
        assert found.attrs.get("units", "") == variable.units
        if variable.flags is not None:
            assert found.attrs["flag_values"].tolist() == [int(flag) for flag in variable.flags]
            assert found.attrs["flag_meanings"].split() == [flag.name.lower() for flag in variable.flags]
        if variable.dtype.startswith("S"):
            assert found.item() == record[variable.name]
        elif not variable.volatile:
            assert found.dtype == variable.dtype
            expected = np.asarray(record[variable.name], variable.dtype)
            assert found.values.tobytes() == expected.tobytes(), variable.name


def test_coordinates_are_the_records_and_those_of_the_belt(history):
    for name, coordinate in record_coordinates(job(**LOADED)).items():
        assert np.array_equal(history[name].values, coordinate.values)
    grid = mesh(job(**LOADED).parameters)
    places = probes(grid, 5, 3)
    assert history["probe"].values.tolist() == [place.label for place in places]
    assert history["probe_position"].values.tolist() == [place.position for place in places]
    assert history["position"].values == pytest.approx(grid.position)
    assert history["region"].values.tolist() == [REGIONS[region] for region in grid.region]
    # 800 samples at 20 kHz, the first one after an interval
    assert history["time"].values == pytest.approx(np.arange(1, 801) / 20e3)
    for name in ("time", "position", "probe_position"):
        assert history[name].attrs["units"] in ("s", "m")


def test_everything_has_a_name_and_a_unit(history):
    for name, variable in history.variables.items():
        assert variable.attrs["long_name"], name
        if variable.dtype.kind == "f":
            assert variable.attrs["units"], name


def test_displacement_at_a_probe_is_that_of_the_belt(history):
    # a probe is linear in the displacement of the two stations beside it, so its mean is that of the profile
    mean = history["displacement"][JUDGED].mean("time").values
    profile = history["mean_displacement"].values
    expected = np.interp(history["probe_position"], history["position"], profile)
    # sums over 400 samples, each rounded
    assert mean == pytest.approx(expected, rel=1e-12, abs=1e-16)


def test_contact_force_adds_up_to_the_axial_forces(history):
    belt = belt_constants(job(**LOADED).parameters)
    force = history["contact_force"].values
    assert np.all(force >= 0)
    for pulley, stations in (("driving", belt.driving_stations), ("driven", belt.driven_stations)):
        axial = belt.dual[stations] @ force[stations]
        assert axial == pytest.approx(history["axial_force"].sel(pulley=pulley).item(), rel=1e-12)
    assert history["thrust_ratio"].item() == pytest.approx(np.divide(*history["axial_force"].values))
    # the grooves reach a little beyond the arcs
    assert np.all(force[belt.touches == 0.0] == 0)


def test_profiles_of_force_agree_with_the_means_of_the_strands(history):
    for name in ("ring_tension", "push_force"):
        for strand in ("t1", "t2"):
            here = history[name].values[history["region"].values == strand]
            middle = here[len(here) // 4 : 3 * len(here) // 4].mean()
            # nothing but inertia, air and the layers' dampers changes T and P along a strand: below 10 N
            expected = history[f"mean_{name}"].sel(strand=strand).item()
            assert middle == pytest.approx(expected, rel=2e-3, abs=10.0), (name, strand)


def test_load_and_speed_are_those_of_the_record(history):
    time, load = history["time"].values, history["load"].values
    rising = time < 0.01
    assert load[rising] == pytest.approx(
        120 * (1 - np.cos(np.pi * time[rising] / 0.01)) / 2, rel=1e-9, abs=1e-9
    )
    assert np.all(load[~rising] == 120)
    speed = history["driven_speed"].values[JUDGED]
    nominal = job(**LOADED).parameters["driving_speed"] / 2.52
    assert history["speed_loss"].item() == pytest.approx(1 - speed.mean() / nominal, abs=1e-12)
    assert history["driven_speed_ripple"].item() == pytest.approx(speed.std())


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("load", {"load": 120.0, "load_start": 40.0, "load_history": "ramp"}),
        ("driving_speed", {"driving_speed": 120.0, "speed_start": 40.0, "speed_history": "ramp"}),
    ],
)
def test_a_ramp_goes_from_its_start_to_its_end(name, values):
    ramp = simulate(job(**CHEAP, **values), {"lanes": "runs"})[name].values
    at = {0.01: 40.0, 0.025: 80.0, 0.04: 120.0}
    assert [ramp[round(time * 20e3) - 1] for time in at] == pytest.approx(list(at.values()))


def test_the_file_alone_is_enough_to_repeat_the_run():
    axes = {"sheave_stiffness": [1.0, "inf"], "load": {"from": 0.0, "to": 120.0, "count": 3}}
    asked = job(axes=axes, precision="single", **CHEAP)
    dataset = simulate(asked, {"sheave_stiffness": np.inf, "load": "0.1 kN m", "seed": 7})
    again = build_job(json.loads(dataset.attrs["job"]), "again")
    assert (again.fingerprint(), again.axes) == (asked.fingerprint(), asked.axes)
    assert json.loads(dataset.attrs["point_units"])["load"] == "kN m"
    point = json.loads(dataset.attrs["point"])
    assert (point["sheave_stiffness"], point["load"], point["seed"]) == ("inf", 100.0, 7)
    chosen = {"sheave_stiffness": np.inf, "load": 100.0, "seed": 7, "lanes": "stations"}
    assert again.point_at(point) == asked.point_at(chosen)
    repeated = simulate(again, point)
    assert np.array_equal(repeated["displacement"], dataset["displacement"])
    assert dataset.attrs["job_name"] == asked.name


class Stopped(Exception):
    """Before anything runs."""


@pytest.mark.parametrize(
    ("values", "at", "expected"),
    [
        ({}, {}, "stations"),
        ({"lanes": "runs"}, {}, "runs"),
        ({}, {"numerics.lanes": "runs"}, "runs"),
        ({}, ["lanes=runs"], "runs"),
    ],
)
def test_stations_fill_the_lanes_where_nothing_else_is_asked_for(monkeypatch, values, at, expected):
    def do(asked, points, *others, **options):
        assert points[0]["lanes"] == expected
        raise Stopped

    monkeypatch.setattr("cvt_hpc.simulation.running.do", do)
    with pytest.raises(Stopped):
        simulate(job(**CHEAP, **values), at)


def test_a_value_that_is_not_fit_is_refused_before_anything_runs(monkeypatch):
    monkeypatch.setattr("cvt_hpc.simulation.running.do", None)
    with pytest.raises(InputError, match="sheave_stifness.*did you mean sheave_stiffness"):
        simulate(job(**CHEAP), {"sheave_stifness": 1.0})
    with pytest.raises(InputError, match="ratio.*pulleys that do not overlap"):
        simulate(job(**CHEAP), {"ratio": 0.5})


def test_a_run_that_ends_early_keeps_its_history_to_the_end(failed):
    assert (failed["status"], failed["vibrates"]) == (Status.DONE, Vibrates.SLIPS)
    done = failed.sizes["time"]
    assert 0 < done / 20e3 <= failed["simulated_seconds"] <= done / 20e3 + 5.001e-5
    assert np.all(np.isfinite(failed["displacement"]))
    # its last sample but one is not yet half as slow as the speeds ask, but on the way
    speed = failed["driven_speed"].values
    assert 0.5 < speed[-1] / (job().parameters["driving_speed"] / 2.52) < 0.7


def test_profiles_of_a_run_that_was_not_judged_are_unknown(failed):
    for name in ("ring_tension", "push_force", "contact_force", "mean_displacement"):
        assert np.all(np.isnan(failed[name])), name
