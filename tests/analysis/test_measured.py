"""Measured files beside made-up studies: what is read, where it is drawn, and the score."""

import csv
import json
import re
import warnings
from pathlib import Path

import dask
import numpy as np
import pytest
import xarray as xr
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from matplotlib.colors import to_hex

import cvt_hpc.accessor  # noqa: F401 (dataset.cvt)
from cvt_hpc.analysis.arrangement import ruler
from cvt_hpc.analysis.measured import INK, read_measured, side_of
from cvt_hpc.analysis.measured_score import score, score_sentences
from cvt_hpc.cli import main
from cvt_hpc.errors import InputError, JobWarning
from cvt_hpc.job import build_job
from cvt_hpc.picture_kinds import HISTORIES, KINDS, MEASURED, RESULTS
from cvt_hpc.storage.netcdf import write_history
from cvt_hpc.variables import Status, Vibrates
from support import pictured
from support.studies import study

pytestmark = pytest.mark.usefixtures("unarranged")  # test_pictures.py looks at the places

Q, V, U, F, S = "quiet vibrating undecided failed slipping".split()
FLAGS = {
    Q: (Status.DONE, Vibrates.NO),
    V: (Status.DONE, Vibrates.YES),
    U: (Status.DONE, Vibrates.UNDECIDED),
    F: (Status.FAILED_NUMERICS, Vibrates.UNDECIDED),
    S: (Status.DONE, Vibrates.SLIPS),
}
WINDOWS = "load_from [N m],load_to [N m]"
RANGE = ",measured_load_from [N m],measured_load_to [N m]"


def results(rows, frequencies=550.0):
    """A study of a row of classes for each stiffness, at loads of 10, 20, ... N m; amplitudes of 10 um."""
    flags = np.array([[FLAGS[kind] for kind in row] for row in rows], np.int8)
    dims = ("sheave_stiffness", "load")
    over = (*dims, "strand")
    known = np.full((*flags.shape[:2], 2), [10e-6, 5e-6])
    return xr.Dataset(
        {
            "status": (dims, flags[..., 0]),
            "vibrates": (dims, flags[..., 1]),
            "amplitude": (over, known, {"units": "m"}),
            "frequency": (
                over,
                np.broadcast_to(np.asarray(frequencies)[..., None], known.shape),
                {"units": "Hz"},
            ),
        },
        {
            "sheave_stiffness": ("sheave_stiffness", 1.0 + 0.5 * np.arange(len(rows)), {"units": "1"}),
            "load": ("load", 10.0 * (1 + np.arange(len(rows[0]))), {"units": "N m"}),
            "strand": ["t1", "t2"],
        },
        {"job_name": "made up"},
    )


@pytest.fixture
def write(tmp_path):
    """Return a function that writes a measured file and returns its path."""

    def write_file(*lines):
        path = tmp_path / "rig.csv"
        path.write_text("\n".join(lines) + "\n")
        return path

    return write_file


def test_cells_of_windows_are_counted(write):
    # range 20 to 80, noise 30 to 50: cells 20, 60, 70, 80 are measured silent, and 10, 90 not measured
    dataset = results([[V, Q, V, V, Q, V, Q, U, V], [V, V, Q, F, V, S, Q, Q, V]])
    path = write("# a rig", WINDOWS + RANGE, "30,50,20,80")
    found = score(dataset, path)
    assert [line[:5] for _, line in found.lines] == [(2, 1, 1, 2, 1), (1, 1, 1, 2, 2)]
    assert found.total[:5] == (3, 2, 2, 4, 3) and found.contradicts
    told = " ".join(score_sentences(found))
    assert (
        "Of 11 decided cells in the measured range of rig.csv 7 agree: 3 hits, 4 correct silences; " in told
    )
    assert "2 misses, 2 false alarms. 3 more count on neither side" in told
    # of one stiffness alone, and without a range: all loads
    found = score(dataset, write(f"{WINDOWS},sheave_stiffness", "30,50,1.6"))
    ((place, line),) = found.lines
    assert (place, line[:5]) == (["1.5"], (1, 1, 3, 2, 2))
    assert "states no measured range: all values of load count" in " ".join(score_sentences(found))
    assert not score(results([[Q, V, Q]]), write(WINDOWS, "15,25")).contradicts


def test_a_row_of_one_value_twice_states_silence(write):
    for row in ("20,20,20,40", "90,95,20,40"):  # beyond the last load of the study it says the same
        assert score(results([[V, V, Q, Q, V]]), write(WINDOWS + RANGE, row)).total[:5] == (0, 0, 1, 2, 0)


def test_errors_of_frequency_amplitude_and_onset(write):
    # computed onset at 25, end at 55; measured noise from 28 to 50 in a wider range
    dataset = results([[Q, Q, V, V, V, Q, Q]], [[0, 0, 480, 550, 730, 0, 0]])
    path = write(f"{WINDOWS},frequency_from [kHz],frequency_to [kHz],amplitude [um]", "28,50,0.5,0.7,20")
    found = score(dataset, path)
    told, total = list(score_sentences(found)), found.total
    assert "Error of the frequency: 20 Hz (median), 30 Hz (largest)." in told
    assert "Error of the onset: 4 N m (median), 5 N m (largest)." in told
    assert total.frequency == pytest.approx((20.0, 0.0, 30.0))
    assert total.amplitude == pytest.approx((0.5, 0.5, 0.5))
    assert sorted(total.onset) == pytest.approx([3.0, 5.0])
    # windows that touch are one; one that reaches the end of the range has no end there
    total = score(dataset, write(WINDOWS + RANGE, "28,40,10,50", "40,50,10,50")).total
    assert total.onset == pytest.approx((3.0,)) and total[:5] == (3, 0, 0, 2, 0)


def test_onsets_are_paired_by_their_direction(write):
    dataset = results([[Q, Q, V, V, Q, V, Q]])  # rising at 25 and 55, falling at 45 and 65
    total = score(dataset, write("onset_load [N m],direction", "20,1", "60,-1")).total
    assert total[:3] == (2, 0, 2) and sorted(total.onset) == pytest.approx([5.0, 5.0])
    total = score(dataset, write("onset_load [N m]", "20", "50", "70")).total
    assert total[:3] == (2, 1, 0) and sorted(total.onset) == pytest.approx([5.0, 5.0])
    # beyond the measured range nothing is a false alarm
    total = score(dataset, write(f"onset_load [N m]{RANGE}", "20,10,40")).total
    assert total[:3] == (1, 0, 0)
    # nor between two ranges, nor in one of the other direction
    longer = results([[Q, Q, V, V, Q, V, Q, Q, Q, Q, Q, V]])  # rising at 25, 55 and 115
    total = score(longer, write(f"onset_load [N m]{RANGE}", "20,10,30", "112,100,120")).total
    assert total[:3] == (2, 0, 0)
    total = score(dataset, write(f"onset_load [N m],direction{RANGE}", "20,1,10,60", "66,-1,60,70")).total
    assert total[:3] == (2, 0, 1)


def test_peaks_tell_of_their_cells_alone(write):
    dataset = results([[Q, V, V, V, U]], [[0, 500, 510, 520, 0]])
    path = write(
        "load [N m],frequency [Hz],amplitude [mm]", "12,600,0.01", "21,480,0.02", "38,525,0.01", "52,600,1"
    )
    found = score(dataset, path)
    assert found.total[:5] == (2, 1, 0, 0, 1)
    assert found.total.frequency == pytest.approx((20.0, 5.0))
    assert found.total.amplitude == pytest.approx((0.5, 1.0))
    # of two peaks in a cell the one of the nearest frequency gives both
    for rows in (("22,505,0.1", "21,480,0.02"), ("21,480,0.02", "22,505,0.1")):
        total = score(dataset, write("load [N m],frequency [Hz],amplitude [mm]", *rows)).total
        assert (*total.frequency, *total.amplitude) == pytest.approx((5.0, 0.1))


CLASSES = st.lists(st.sampled_from([Q, V, U, F, S]), min_size=3, max_size=9)
ENDS = st.tuples(st.integers(0, 120), st.integers(0, 120)).map(sorted)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(CLASSES, st.lists(st.tuples(ENDS, ENDS), min_size=1, max_size=4))
def test_any_windows_are_counted_as_by_hand(write, classes, windows):
    path = write(WINDOWS + RANGE, *(",".join(map(str, (*noise, *swept))) for noise, swept in windows))
    last = 10 * len(classes) + 5  # cells reach halfway beyond the first and the last load
    windows = [pair for pair in windows if any(low <= last and high >= 5 for low, high in pair)]
    expected = [0] * 5
    for k, kind in enumerate(classes):
        load = 10 * (k + 1)
        noisy = any(low <= load <= high and low < high for (low, high), _ in windows)
        if noisy or any(low <= load <= high for _, (low, high) in windows):
            places = {(V, True): 0, (Q, True): 1, (V, False): 2, (Q, False): 3}
            expected[places.get((kind, noisy), 4)] += 1
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", JobWarning)
        if windows:
            assert list(score(results([classes]), path).total[:5]) == expected
        else:
            with pytest.raises(InputError, match="found 0 of"):
                score(results([classes]), path)


@pytest.mark.parametrize("spacing", ["linear", "log"])
@pytest.mark.parametrize("values", [[-4.0, -2.0, -1.0, -0.5], [0.1, 1.0, 10.0, np.inf], [20.0, 40.0, 60.0]])
def test_values_lie_where_the_axis_has_them(values, spacing):
    attributes = {"units": "rad/s", "job_units": "rpm", "spacing": spacing}
    axis = xr.Dataset(coords={"speed": ("speed", values, attributes)})
    side, drawn = side_of(axis, "speed"), ruler(axis["speed"])
    for k, value in enumerate(values):
        if np.isfinite(value):
            assert side.place(value) == pytest.approx(drawn.centres[k]) and side.cell(value) == k
    assert side.cell(1e9 * abs(values[0])) is None  # an infinite value is no neighbour of a large one


def test_units_are_those_of_the_file_and_rows_elsewhere_are_left_out(write):
    dataset = results([[Q, V, V, Q]])
    path = write("Load from (kN mm);Load to (kN mm);sheave stiffness", "15;25,5;1", "15;25,5;3")
    with pytest.warns(JobWarning) as told:
        measured = read_measured(path, dataset)
    (row,) = measured.rows
    assert row.span == (15.0, 25.5) and row.at == {"sheave_stiffness": 1.0}
    assert any("1 of 2; the first that it has not: load_from 15 N m" in str(one.message) for one in told)
    scene = {"ratio": 2.52, "thrust": "50 kN"}
    job = json.dumps(build_job({"name": "x", "model": "elastic_belt", "scene": scene}).resolved())
    path = write(f"{WINDOWS},ratio,thrust [kN]", "15,25,2.5,50")
    assert len(read_measured(path, dataset.assign_attrs(job=job)).rows) == 1
    path = write(f"{WINDOWS},ratio,thrust [kN]", "15,25,2.5,40")
    with pytest.raises(
        InputError, match="expected rows at values that results has, found 0 of 1; .*thrust 40000 N"
    ):
        read_measured(path, dataset.assign_attrs(job=job))


@pytest.mark.parametrize(
    ("lines", "told"),
    [
        ((), "expected columns load_from and load_to, or onset_load, or load and frequency"),
        (("laod_from [N m]", "1"), "found .*did you mean load_from?"),
        ((f"{WINDOWS},sheave_stifness", "1,2,1"), 'found "sheave_stifness"; did you mean sheave_stiffness?'),
        (("load_from [N m]", "1"), r"line 1: expected a column load_to [N m], found none among load_from"),
        (("load_from [kN],load_to [kN]", "1,2"), 'expected load_from [N m], found "load_from [kN]"'),
        ((WINDOWS, "2,1"), "line 2: expected load_from of at most load_to, found 2 N m and 1 N m"),
        (("load_from [kN m],load_to [kN m]", "0.09,0.03"), "found 0.09 kN m and 0.03 kN m"),
        ((WINDOWS, "1,2", "1,two"), 'line 3, load_to: expected a number such as 1500 or 0.13, found "two"'),
        (
            (WINDOWS + ",frequency_from [Hz]", "1,2,3"),
            "frequency_from and frequency_to, found frequency_from alone",
        ),
        ((WINDOWS + ",amplitude [m]", "1,2,0"), "line 2: expected amplitude > 0, found 0"),
        (("onset_load [N m],direction", "20,2"), "expected direction 1 (rising) or -1 (falling), found 2"),
        (
            ("load [N m],frequency [Hz],level [dB]", "10,500,40", "20,500,40"),
            "expected 8 frequencies or more in each spectrum, found 1",
        ),
        (
            ("load [N m],frequency [Hz],level [dB]", *2 * [f"10,{500 + 5 * k},40" for k in range(8)]),
            "expected each frequency once in a spectrum, found some twice; average spectra of one place",
        ),
        (
            ("load [N m],frequency [Hz],level [dB re 20 uPa]", "10,500,40"),
            "expected 8 frequencies or more in each spectrum, found 1",
        ),
        (("load [N m],frequency [Hz],level [um]", "10,500,40"), "expected level [dB], found .*level [um]"),
        (
            (WINDOWS, "300,400"),
            "expected rows at values that .* has, found 0 of 1; the first that it has not: load_fr",
        ),
    ],
)
def test_bad_files_get_one_line(lines, told, write, tmp_path, capsys):
    results([[Q, V, V]]).to_netcdf(tmp_path / "results.nc")
    path = write(*lines)
    assert main(["compare", str(tmp_path), str(path)]) == 2
    out, err = capsys.readouterr()
    pattern = re.escape(told).replace(r"\.\*", ".*")
    assert out == "" and err.count("\n") == 1 and re.search(pattern, err) and "rig.csv" in err


def test_a_missing_file_and_another_axis_are_named(write, tmp_path, capsys):
    dataset = results([[Q, V, V]])
    dataset.to_netcdf(tmp_path / "results.nc")
    write(WINDOWS, "1,2")
    assert main(["map", str(tmp_path), "--measured", str(tmp_path / "rik.csv")]) == 2
    assert "expected a CSV file, found nothing; did you mean " in capsys.readouterr().err
    with pytest.raises(
        InputError, match="expected results over the axis load, as in rig.csv, found sheave_stiffness"
    ):
        score(dataset.isel(load=1), write(WINDOWS, "15,25"))
    with pytest.raises(InputError, match="expected results over a grid, .* found samples"):
        dataset.stack(run=("sheave_stiffness", "load")).reset_index("run").cvt.map(
            measured=write(WINDOWS, "1,2")
        )


def test_compare_leaves_a_table_and_a_picture(write, tmp_path, capsys):
    results([[Q, V, Q], [Q, V, V]]).to_netcdf(tmp_path / "results.nc")
    call = ["compare", str(tmp_path), str(write(WINDOWS, "15,25")), "--out", str(tmp_path / "found")]
    assert main(call) == 1
    out = capsys.readouterr().out.splitlines()
    assert out[0] == f"computed: {tmp_path}; measured: {tmp_path / 'rig.csv'}"
    assert out[-2:] == [f"table: {tmp_path}/found/compare.csv", f"picture: {tmp_path}/found/compare.png"]
    rows = list(csv.DictReader((tmp_path / "found/compare.csv").open()))
    assert [(row["sheave_stiffness"], row["hits"], row["false_alarms"]) for row in rows] == [
        ("1", "1", "0"),
        ("1.5", "1", "1"),
    ]
    assert rows[0]["onset_error_largest [N m]"] == "0"
    assert (tmp_path / "found/compare.png").read_bytes().startswith(b"\x89PNG")
    whole = results([[Q, V, Q]] * 200)
    many = xr.concat([whole, whole], xr.DataArray([-1.0, -2.0], dims="friction_gradient"), data_vars="all")
    many.to_netcdf(tmp_path / "results.nc")
    assert main(call) == 0  # the score needs no page that holds 200 panels
    assert "no picture: " in capsys.readouterr().err


def test_the_page_says_the_score_and_shows_the_map(write, tmp_path, monkeypatch):
    figures = []
    monkeypatch.setattr("cvt_hpc.report.page._encoded", lambda compose: figures.append(compose) or "AA==")
    path = results([[Q, V, Q]]).cvt.report(tmp_path / "report.html", measured=write(WINDOWS, "15,35"))
    text = path.read_text().replace("\xa0", " ")
    assert (
        "Of 3 decided cells in the measured range of rig.csv 2 agree: 1 hits, 1 correct silences; 1 misses"
        in text
    )
    assert '<div class="">' in text  # the printed map, beside that of the browser
    assert ink_of(figures[0]())


def test_the_probability_of_samples_has_a_score(write, tmp_path, capsys):
    # at 10, 20, 30 and 40 N m two, one, none and none of two samples vibrate; at 30 one has no verdict
    dataset = xr.concat([results([[V, V, U, Q]]), results([[V, Q, Q, Q]])], xr.Variable("sample", [0, 1]))
    found = score(dataset, path := write(WINDOWS + RANGE, "15,35,15,45"))
    assert [values.tolist() for values in found.probabilities()] == [[0.5, 0.0], [0.0]]
    dataset.to_netcdf(tmp_path / "results.nc")
    assert main(["compare", str(tmp_path), str(path)]) == 1
    told = "on average 0.25 in 2 cells of measured noise, 0 in 1 cells of measured silence; Brier score 0.42"
    assert f"Probability of vibration: {told} (" in capsys.readouterr().out
    # a further axis, at one value of which it was measured, and a file without silence
    # of two rows that the second one alone was measured in
    rows = [results([[Q, Q, Q, Q], row]) for row in ([V, V, U, Q], [V, Q, Q, Q])]
    both = xr.concat(rows, xr.Variable("sample", [0, 1])).transpose("load", ...)
    found = score(both, write(f"{WINDOWS},sheave_stiffness", "15,35,1.5"))
    assert [values.tolist() for values in found.probabilities()] == [[0.5, 0.0], [1.0, 0.0]]
    assert not any(
        "Brier" in line for line in score_sentences(score(dataset, write("onset_load [N m]", "15")))
    )
    assert not any("Brier" in line for line in score_sentences(score(results([[Q, V]]), path)))


def test_a_measured_onset_far_from_the_bands_is_drawn_beside_them(write):
    dataset = xr.concat([results([[Q, V, V, V, V, V, V, V]] * 2)] * 2, xr.Variable("sample", [0, 1]))
    figure = dataset.cvt.onset_bands(measured=write("onset_load [N m],sheave_stiffness", "75,1.5"))
    ((_, line),) = ink_of(figure)
    assert (line.get_xdata()[1], line.get_ydata()[1]) == (1.5, 75.0)
    low, high = figure.axes[0].get_ylim()
    assert (low <= 10.0, high) == (True, 80.0) and "measured: rig.csv" in figure.get_suptitle()
    alone = dataset.isel(load=[1])  # an axis of one value has no ends
    assert ink_of(alone.cvt.onset_bands(measured=write("onset_load [N m]", "20")))


def ink_of(figure):
    """What is drawn of measurements in each panel."""
    found = [(axes, artist) for axes in figure.axes for artist in axes.get_children()]
    return [
        (axes, artist)
        for axes, artist in found
        for colour in (getattr(artist, "get_edgecolor", getattr(artist, "get_color", str))(),)
        if np.size(colour) and np.ndim(colour) < 2 and colour != "" and to_hex(colour) == INK
    ]


def test_a_window_is_outlined_in_the_rows_where_it_was_measured(write):
    path = write(f"{WINDOWS},friction_gradient [s/m]{RANGE}", "60,100,-1.6,30,150")
    figure = study().cvt.map(measured=path, sheave_stiffness=1.0)
    (_, swept), (_, noise) = ink_of(figure)
    assert noise.get_bbox().bounds == pytest.approx((60.0, -2.0, 40.0, 0.8))
    assert swept.get_bbox().bounds == pytest.approx((30.0, -2.0, 120.0, 0.8))
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert {"measured noise", "measured range", "vibrating"} <= {*labels}
    assert "measured: rig.csv" in figure.get_suptitle()
    turned = study().cvt.map(measured=path, sheave_stiffness=1.0, x="friction_gradient", y="load")
    assert ink_of(turned)[1][1].get_bbox().bounds == pytest.approx((-2.0, 60.0, 0.8, 40.0))
    # at a load outside of the window, and at another gradient, there is nothing to show
    for load, gradient, count in ((80.0, -1.6, 1), (120.0, -1.6, 0), (80.0, -2.4, 0)):
        at = {"load": load, "friction_gradient": gradient}
        assert len(ink_of(study().cvt.map(measured=path, x="sheave_stiffness", **at))) == count


def spectrogram(lines, floor=20.0):
    """Rows of spectra from 100 to 900 Hz at loads of 10, 20, ... N m, with lines (frequency, level) in each."""
    rows, places = ["load [N m],frequency [Hz],level [dB]"], np.arange(100.0, 901.0, 10.0)
    for k, own in enumerate(lines):
        levels = np.full(places.size, floor) + np.sin(places)  # a noise that stands out by 2 dB at most
        for frequency, level in own:
            levels = np.maximum(levels, level - 0.3 * abs(places - frequency))
        rows += [f"{10 * (k + 1)},{f:g},{level:.6f}" for f, level in zip(places, levels, strict=True)]
    return rows


def test_a_spectrogram_is_read_as_the_lines_that_stand_out(write):
    """In any order of its rows; a line 21 dB below the highest, or 3 dB above the valley beside it, is none."""
    dataset = results([[Q, V, V]], [[0, 500, 510]])
    head, *rows = spectrogram([[(500, 58)], [(500, 80), (700, 61), (760, 59)], [(520, 75), (560, 72)]])
    with pytest.warns(JobWarning, match="rig.csv: 3 peaks of 3 spectra are read: maxima that stand out by 6"):
        found = read_measured(write(head, *np.random.default_rng(2).permutation(rows)), dataset)
    assert found.kind == "peak"
    assert sorted((row.cell, row.frequency[0]) for row in found.rows) == [(20, 500), (20, 700), (30, 520)]
    as_peaks = score(dataset, write("load [N m],frequency [Hz]", "20,500", "20,700", "30,520")).total
    assert score(dataset, write(head, *rows)).total == as_peaks and as_peaks[:2] == (2, 0)
    sizes = write(f"{head},amplitude [um]", *(f"{row},{1 + k}" for k, row in enumerate(rows)))
    assert [row.frequency[0] for row in read_measured(sizes, dataset).rows] == [500, 700, 520]
    with pytest.raises(InputError, match="rig.csv: expected maxima .*, found none in 3 spectra"):
        read_measured(write(*spectrogram([[], [], []])), dataset)


def test_onsets_and_peaks_lie_at_their_places(write):
    path = write("onset_load [N m],direction", "75,1", "150,-1")
    lines = [artist for _, artist in ink_of(study().cvt.map(measured=path, sheave_stiffness=1.0))]
    assert [(line.get_xdata()[1], line.get_marker()) for line in lines] == [(75.0, ">"), (150.0, "<")]
    path = write("load [N m],frequency [Hz]", "75,520")
    dataset = pictured.results()
    marks = [artist for _, artist in ink_of(dataset.cvt.waterfall(measured=path, ratio=1.0))]
    assert [(mark.get_xdata()[0], mark.get_ydata()[0]) for mark in marks] == [(75.0, 520.0)] * 2
    (mark,) = [artist for _, artist in ink_of(study().cvt.map(measured=path, sheave_stiffness=1.0))]
    assert mark.get_ydata()[0] == pytest.approx(-2.8)  # the lower edge: it tells nothing of friction


FILES = {
    "windows": (f"{WINDOWS},frequency_from [Hz],frequency_to [Hz]", "60,150,500,700"),
    "onsets": ("onset_load [N m],direction", "75,1", "150,-1"),
    "peaks": ("load [N m],frequency [Hz],amplitude [um]", "75,520,3", "100,540,4"),
    "spectrogram": spectrogram([[(520, 80)]] * 10),
}
OF_KINDS = [name for name, kind in KINDS.items() if MEASURED in kind.options]


@pytest.mark.parametrize("kind", ["map", *OF_KINDS])
def test_every_picture_takes_every_file_on_lazy_data(kind, write, tmp_path):
    assert {"waterfall", "campbell", "ramp", "spectrogram", "hysteresis", "onset_bands"} == {*OF_KINDS}
    subject = KINDS[kind].subject if kind in KINDS else RESULTS
    if subject == HISTORIES:
        write_history(pictured.history(ramped="load"), tmp_path / "run.nc")
        dataset = xr.open_dataset(tmp_path / "run.nc", chunks={})
    else:
        dataset = (pictured.ramps() if kind == "hysteresis" else pictured.results()).chunk()
        dataset = dataset.expand_dims(sample=4) if kind == "onset_bands" else dataset
    at = {"load": 100.0, "ratio": 1.0} if kind == "campbell" else {}
    for name, lines in FILES.items():
        with dask.config.set(scheduler="synchronous"):
            figure = getattr(dataset.cvt, kind)(measured=write(*lines), **at)
        shows = name != "onsets" or kind != "campbell"  # where the load does not vary no onset has a place
        assert bool(ink_of(figure)) == shows
        labels = [text.get_text() for legend in figure.legends for text in legend.get_texts()]
        assert any(label.startswith("measured ") for label in labels) == shows
    dataset.close()


def test_maps_of_values_of_probabilities_and_of_eigenfrequencies_have_it(write):
    path = write(*FILES["windows"])
    assert ink_of(pictured.results().cvt.map("efficiency", measured=path, ratio=1.0))
    lines = 100.0 * np.arange(1.0, 4.0) + np.zeros((2, 10, 2, 3))
    over = ("friction_gradient", "load", "strand", "half_waves")
    bare = study().isel(sheave_stiffness=0, friction_gradient=[0, 1]).drop_vars(["amplitude", "frequency"])
    modes = bare.assign(eigenfrequency=(over, lines, {"units": "Hz"})).assign_coords(half_waves=[1, 2, 3])
    assert ink_of(
        modes.cvt.map(measured=write(f"{WINDOWS},frequency_from [Hz],frequency_to [Hz]", "60,90,200,250"))
    )
    samples = study().isel(sheave_stiffness=0).expand_dims(sample=4).copy()
    for part in (samples, samples.isel(friction_gradient=0)):
        assert ink_of(part.cvt.map(measured=write(WINDOWS, "60,90")))


@pytest.mark.parametrize(("window", "is_drawn"), [("60,150", True), ("120,150", False)])
def test_over_time_a_window_is_drawn_where_it_holds_the_load_of_the_run(window, is_drawn, write):
    run = pictured.history(load=100.0)
    assert bool(ink_of(run.cvt.spectrogram(measured=write(WINDOWS, window)))) == is_drawn


def test_noise_measured_over_the_time_of_a_course_is_drawn_at_its_time(write):
    run = pictured.history(load=100.0)
    path = write("time_from [ms],time_to [ms],frequency_from [Hz],frequency_to [Hz]", "50,80,500,700")
    (row,) = read_measured(path, run).rows
    assert row.span == pytest.approx((0.05, 0.08)) and row.frequency == (500.0, 700.0)
    assert bool(ink_of(run.cvt.spectrogram(measured=path)))


def test_a_spreadsheet_of_windows_letters_is_read(tmp_path):
    path = tmp_path / "rig.csv"
    path.write_bytes("Rig A\nLoad from [N·m];Load to [N·m];amplitude [µm]\n15,5;25,5;1,5\n".encode("utf-16"))
    with pytest.warns(JobWarning, match="UTF-16 letters, .* decimal commas"):
        (row,) = read_measured(path, results([[Q, V, Q]])).rows
    assert (row.span, row.amplitude) == ((15.5, 25.5), 1.5e-6)


def test_the_noise_that_a_paper_states_is_a_measured_file():
    path = Path(__file__).parents[2] / "jobs" / "lebrecht_measured.csv"
    (row,) = read_measured(path, study()).rows
    assert row[:5] == ({}, (130.0, 200.0), pytest.approx(np.nan, nan_ok=True), (500.0, 700.0), 2e-5)


def test_onsets_far_apart_are_no_pair(write):
    """Beyond three standard errors: half a step of 5 N m, and the deviation that the file states."""
    dataset = results([[Q, Q, V, V, V, V, V, V, V]])  # sets in at 25 N m
    for place, deviation, expected in (
        (39, 0.1, (1, 0, 0)),
        (41, 0.1, (0, 1, 1)),
        (64, 12, (1, 0, 0)),
        (65, 12, (0, 1, 1)),
    ):
        path = write("onset_load [N m],load_deviation [kN mm]", f"{place},{deviation}")
        total = score(dataset, path).total
        assert total[:3] == expected
        assert total.standard == pytest.approx((np.hypot(5.0, deviation),) * expected[0])
    # cells without a verdict between the two that are known make the onset less certain
    total = score(results([[Q, Q, U, U, V, V, V]]), write("onset_load [N m]", "70")).total
    assert total.standard == pytest.approx((15.0,)) and total[:3] == (1, 0, 0)
    # as many pairs as there can be: each takes the partner that leaves one to the other
    dataset = results([[Q, V, V, Q, V, V, V]])  # at 15 and 45
    assert score(dataset, write("onset_load [N m]", "30", "44")).total[:3] == (2, 0, 0)


def test_a_window_between_two_cells_is_said_in_a_line(write, tmp_path, capsys):
    path = write(WINDOWS, "15,25", "32,38")
    results([[Q, V, V, V]]).to_netcdf(tmp_path / "results.nc")
    assert main(["compare", str(tmp_path), str(path)]) == 1
    (line,) = [one for one in capsys.readouterr().err.splitlines() if "row" in one][:1]
    expected = "rig.csv: row 2: no load from 32 N m to 38 N m was run in "
    assert expected in line and line.endswith("but 10, 20, 30, 40 [N m]")
    with warnings.catch_warnings():
        warnings.simplefilter("error", JobWarning)
        score(results([[Q, V, V, V]]), write(WINDOWS + RANGE, "30,30,10,40", "90,95,10,40", "15,40,10,40"))
