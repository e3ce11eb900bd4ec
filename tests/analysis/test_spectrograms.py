"""Spectrograms of ramps and Campbell diagrams: ridges, eigenfrequencies and orders at their places."""

import json
from itertools import combinations

import numpy as np
import pytest
import xarray as xr

from cvt_hpc.analysis.eigenfrequencies import along_axis
from cvt_hpc.analysis.ramps import HIGHEST, WINDOW, changing_of, spectrogram_figure
from cvt_hpc.analysis.waterfall import campbell_figure
from cvt_hpc.errors import InputError
from cvt_hpc.variator.band import strand_frequencies

POINT = {
    "ratio": 2.52,
    "driven_radius": 0.075,
    "centre_distance": 0.155,
    "driving_speed": 300.0,
    "thrust": 50e3,
    "load": 100.0,
    "element_mass": 1.0,
    "ring_mass": 0.3,
    "bending_stiffness": 0.5,
    "kinetic_friction": 0.08,
    "half_wedge_angle": 0.19,
}
RATE, PER_RAD = 10e3, 2.0 * np.pi


def history(ramped=None):
    """Of 0.4 s: t1 moves at 400 Hz, t2 at 8 times the turns of the driving pulley, and less."""
    time = np.arange(int(0.4 * RATE)) / RATE
    speed = np.full(time.size, 300.0) if ramped != "driving_speed" else np.linspace(200.0, 600.0, time.size)
    load = np.full(time.size, 100.0) if ramped != "load" else np.linspace(20.0, 140.0, time.size)
    phase = 8.0 * np.cumsum(speed) / RATE
    motion = np.stack([5e-6 * np.sin(PER_RAD * 400.0 * time), 2e-6 * np.sin(phase)], 1)
    return xr.Dataset(
        {
            "displacement": (("time", "probe"), motion, {"units": "m"}),
            "load": ("time", load, {"units": "N m"}),
            "driving_speed": ("time", speed, {"units": "rad s-1"}),
        },
        {"time": time, "probe": ["t1 1/2", "t2 1/2"]},
        {"point": json.dumps(POINT), "job_name": "ramp"},
    )


def ridge(axes):
    """Places and frequencies of the largest amplitude in a panel."""
    mesh = axes.collections[0]
    places = mesh.get_coordinates()
    cells = mesh.get_array().reshape(places.shape[0] - 1, places.shape[1] - 1)
    middles = 0.5 * (places[0, 1:, 0] + places[0, :-1, 0])
    lines = 0.5 * (places[1:, 0, 1] + places[:-1, 0, 1])
    return middles, lines[cells.argmax(axis=0)]


def test_another_course_than_a_ramp_is_shown_over_time():
    assert [changing_of(history(ramped)) for ramped in (None, "load", "driving_speed")] == [
        *(None, "load", "driving_speed")
    ]
    along = history("load")
    time = along["time"].values
    swinging = along.assign(
        driving_speed=300.0 * (1.0 + 1e-3 * np.sin(PER_RAD * 50.0 * xr.DataArray(time, dims="time")))
    )
    assert changing_of(swinging) == "load"  # of a free pulley
    course = np.interp(time, [0.1, 0.2, 0.3], [50.0, 150.0, 80.0])
    bent = history().assign(load=("time", course, {"units": "N m"}))
    assert changing_of(bent) == "time"
    panels = spectrogram_figure([bent]).axes
    assert panels[0].get_xlabel() == "time [s]" and panels[0].get_xlim()[1] == pytest.approx(
        0.4 - 0.5 * WINDOW, abs=1e-3
    )
    # eigenfrequencies follow the load of each time: t1's fall while it rises, as push takes its tension
    lines = [line for line in panels[0].lines if line.get_linestyle() == "--"]
    x, first = lines[0].get_data()
    assert first[np.argmin(np.abs(x - 0.2))] < first[0] - 1.0


def test_strands_lie_side_by_side_over_time_or_along_the_ramp():
    figure = spectrogram_figure([history()])
    t1, t2, bar = figure.axes
    assert (t1.get_xlabel(), t1.get_ylabel(), bar.get_ylabel()) == (
        "time [s]",
        "frequency [Hz]",
        "amplitude [µm]",
    )
    assert [axes.get_title(loc="left") for axes in (t1, t2)] == ["strand t1", "strand t2"]
    # lines lie 1 / (2 WINDOW) apart
    np.testing.assert_allclose(ridge(t1)[1], 400.0, atol=0.5 / WINDOW)
    assert t1.collections[0].get_array().max() == pytest.approx(5.0, rel=0.02)
    assert spectrogram_figure([history("load")]).axes[0].get_xlabel() == "load [N m]"


def test_eigenfrequencies_along_a_ramp_of_load_are_those_of_the_strand_model():
    figure = spectrogram_figure([history("load")])
    for k, axes in enumerate(figure.axes[:2]):
        assert [text.get_text() for text in axes.texts][:2] == ["1", "2"]
        first = axes.lines[0]
        for load, line in zip(first.get_xdata()[::10], first.get_ydata()[::10], strict=True):
            assert line == pytest.approx(strand_frequencies(POINT | {"load": load})[k, 0])
    without = history("load").assign_attrs(point="{}")
    figure = spectrogram_figure([without])
    assert not figure.axes[0].lines and "eigenfrequencies" not in figure.get_suptitle()


def history_over_time():
    """Of lines that are crowded: low orders, and eigenfrequencies beside them."""
    one = history()
    speed = 300.0 + 20.0 * np.sin(PER_RAD * 3.0 * one["time"].values)
    point = POINT | {"profile_time": [0.0, 0.4], "driving_speed_profile": [1.0, 1.1]}
    changed = one.assign(driving_speed=("time", speed, {"units": "rad s-1"}))
    return changed.assign_attrs(point=json.dumps(point))


@pytest.mark.parametrize("count", [1, 4])
def test_names_of_lines_stand_at_their_own_lines_and_apart(count):
    figure = spectrogram_figure([history_over_time()] * count)
    figure.canvas.draw()
    for axes in figure.axes[:-1]:
        ends = {**{f"{k}×": None for k in (1, 2, 4, 8, 16)}}
        dotted = [line.get_ydata()[-1] for line in axes.lines if line.get_linestyle() == ":"]
        ends = dict(zip(ends, dotted, strict=True))
        dashed = [line.get_ydata()[-1] for line in axes.lines if line.get_linestyle() == "--"]
        ends |= {str(k): end for k, end in enumerate(dashed, 1)}
        assert len(axes.texts) > 4
        for text in axes.texts:
            end = ends[text.get_text()]
            # below the title names at the upper side are lowered by half their height
            assert text.xy[1] == pytest.approx(end, abs=70.0 if end > HIGHEST - 70.0 else 1e-6)
        boxes = [text.get_window_extent() for text in axes.texts]
        for one, other in combinations(boxes, 2):
            assert not one.padded(-1.0).overlaps(other.padded(-1.0))
    assert "orders 1, 2, 4, 8, 16 of" in figure.get_suptitle()


def test_the_eighth_order_lies_on_the_ridge_that_it_excites():
    figure = spectrogram_figure([history("driving_speed")])
    axes = figure.axes[1]
    dotted = [line for line in axes.lines if line.get_linestyle() == ":"]
    order = {text.get_text() for text in axes.texts if text.get_text().endswith("×")}
    assert order == {"1×", "4×", "8×", "16×"}  # 2× has no room
    rpm, frequency = ridge(axes)
    expected = np.interp(rpm, dotted[3].get_xdata(), dotted[3].get_ydata())
    # a window's ridge is that of its middle, within a line of the spectrum
    np.testing.assert_allclose(frequency[1:-1], expected[1:-1], atol=1.0 / WINDOW)


@pytest.mark.parametrize(
    ("broken", "found"),
    [
        (history().drop_vars("displacement"), "none"),
        (history().isel(time=slice(0, 300)), "a shorter one"),
        (history().assign_coords(probe=["a", "b"]), "none"),
    ],
)
def test_a_history_without_motion_of_strands_is_refused(broken, found):
    with pytest.raises(InputError, match=f"x.nc: expected .*, found {found}"):
        spectrogram_figure([broken], ["x.nc"])


def speeds():
    """Spectra over four speeds, with the mean forces of the strands."""
    values = np.array([100.0, 200.0, 300.0, 400.0])
    bins = np.arange(0.0, 1010.0, 10.0)
    spectrum = np.full((4, 2, bins.size), 1e-8)
    spectrum[:, :, 40] = 1e-5
    over = ("driving_speed", "strand")
    tables = {"scene": {key: value for key, value in POINT.items() if key != "driving_speed"}}
    return xr.Dataset(
        {
            "status": ("driving_speed", np.ones(4, np.int8)),
            "vibrates": ("driving_speed", np.zeros(4, np.int8)),
            "spectrum": ((*over, "frequency_bin"), spectrum, {"units": "m"}),
            "mean_ring_tension": (over, np.tile([8e3, 9e3], (4, 1))),
            "mean_push_force": (over, np.tile([2e3, 0.0], (4, 1))),
        },
        {
            "driving_speed": ("driving_speed", values, {"units": "rad s-1"}),
            "strand": ["t1", "t2"],
            "frequency_bin": ("frequency_bin", bins, {"units": "Hz"}),
        },
        {"job": json.dumps(tables), "job_name": "speeds"},
    )


def test_a_campbell_diagram_has_orders_and_eigenfrequencies_of_the_mean_forces():
    results = speeds()
    figure = campbell_figure(results, orders=(1.0, 4.0))
    t1, t2, _ = figure.axes
    assert "Campbell diagram: speeds" in figure.get_suptitle()
    assert t1.get_xlabel() == "driving speed [rpm]"
    for k, axes in enumerate((t1, t2)):
        dashed = [line for line in axes.lines if line.get_linestyle() == "--"]
        expected = strand_frequencies(POINT | {"driving_speed": 200.0}, (6e3, 9e3))[k]
        assert dashed[0].get_ydata()[1] == pytest.approx(expected[0])
        dotted = [line for line in axes.lines if line.get_linestyle() == ":"]
        np.testing.assert_allclose(dotted[0].get_ydata(), results.driving_speed / PER_RAD)
        np.testing.assert_allclose(dotted[1].get_ydata(), 4.0 * results.driving_speed / PER_RAD)
        np.testing.assert_allclose(dotted[0].get_xdata(), results.driving_speed * 30.0 / np.pi)
    # more force, higher frequency
    assert strand_frequencies(POINT, (6e3, 9e3))[1, 0] > strand_frequencies(POINT, (6e3, 9e3))[0, 0]


def test_without_parameters_there_are_no_eigenfrequencies():
    results = speeds()
    assert along_axis(results.assign_attrs(job="{}"), "driving_speed") is None
    assert along_axis(results.drop_vars("mean_push_force"), "driving_speed") is None
    assert campbell_figure(results.assign_attrs(job="not json")).axes


def test_a_campbell_diagram_needs_an_axis_of_speeds():
    results = speeds().rename(driving_speed="thrust")
    with pytest.raises(InputError, match="x: expected results over the axis driving_speed, found thrust"):
        campbell_figure(results, source="x")
