"""Pictures of one run: quantities on the variator, powers around the belt, phase portraits."""

import json

import numpy as np
import pytest
import xarray as xr

from cvt_hpc.analysis.histories import SAMPLES, SHOWN_PERIODS, phase_figure
from cvt_hpc.analysis.on_variator import LARGEST, energy_figure, region_powers, variator_figure
from cvt_hpc.cli import main
from cvt_hpc.errors import InputError
from cvt_hpc.models.belt_drive.layout import layout
from cvt_hpc.physics.belt_path import points_at
from cvt_hpc.physics.geometry import variator
from cvt_hpc.storage.netcdf import write_history
from cvt_hpc.variator.variables import Means

POINT = {"ratio": 1.0, "driven_radius": 0.05, "centre_distance": 0.155}
PATH = variator(**POINT)
STATIONS, RATE = 400, 20e3


def history():
    """A belt at ratio 1 with a push of 2 kN, sliding that changes its sign, and known powers."""
    position = np.arange(STATIONS) * PATH.path_length / STATIONS
    borders = np.cumsum(PATH.lengths)[:3]
    region = np.array(["driving arc", "t1", "driven arc", "t2"])[np.searchsorted(borders, position, "right")]
    time = np.arange(8000) / RATE
    motion = np.stack([20e-6 * np.sin(2 * np.pi * 500 * time), 5e-6 * np.sin(2 * np.pi * 500 * time)], 1)
    slow = 40e-6 * np.sin(2 * np.pi * 50 * time)[:, None]  # as turns of a pulley give
    return xr.Dataset(
        {
            "displacement": (("time", "probe"), motion + slow, {"units": "m"}),
            "push_force": ("position", np.full(STATIONS, 2000.0), {"units": "N"}),
            "sliding": ("position", np.sin(2 * np.pi * position / PATH.path_length), {"units": "m s-1"}),
            "flank_feed": ("position", np.where(region == "driven arc", 10.0, 0.0), {"units": "W m-1"}),
            "damping_feed": ("position", np.where(region == "t1", -4.0, 0.0), {"units": "W m-1"}),
            "part_flank_loss": (("pulley", "arc_part"), np.arange(8.0).reshape(2, 4), {"units": "W"}),
        },
        {
            "position": ("position", position, {"units": "m"}),
            "region": ("position", region),
            "pulley": ["driving", "driven"],
            "time": time,
            "probe": ["t1 1/2", "t2 1/2"],
        },
        {"point": json.dumps(POINT), "job_name": "one $run$"},
    )


def test_bars_stand_outwards_on_the_belt_and_their_length_is_the_quantity():
    axes, bar = variator_figure(history()).axes
    assert (axes.get_xlabel(), axes.get_ylabel(), bar.get_ylabel()) == ("y [mm]", "z [mm]", "push force [kN]")
    bars = np.array(axes.collections[0].get_segments())
    assert bars.shape == (STATIONS, 2, 2)
    np.testing.assert_allclose(axes.collections[0].get_array(), 2.0)
    np.testing.assert_allclose(np.hypot(*(bars[:, 1] - bars[:, 0]).T), 1e3 * LARGEST * 0.155)
    # of two pulleys alike the belt is 50 mm off the line of their centres, or round about one of them
    feet, ends = bars[:, 0], bars[:, 1]
    nearest = np.clip(feet[:, 0], 0.0, 155.0)
    np.testing.assert_allclose(np.hypot(feet[:, 0] - nearest, feet[:, 1]), 50.0)
    np.testing.assert_allclose(
        np.hypot(ends[:, 0] - np.clip(ends[:, 0], 0.0, 155.0), ends[:, 1]), 50.0 + 1e3 * LARGEST * 0.155
    )


def test_negative_values_point_inwards_and_unknown_ones_have_no_bar():
    run = history()
    run["sliding"][:10] = np.nan
    axes, bar = variator_figure(run, ["sliding"]).axes
    bars, values = np.array(axes.collections[0].get_segments()), axes.collections[0].get_array()
    assert len(bars) == STATIONS - 10 and bar.get_ylabel() == "sliding [mm/s]"
    end = bars[:, 1]
    off = np.hypot(end[:, 0] - np.clip(end[:, 0], 0.0, 155.0), end[:, 1]) - 50.0
    assert (np.sign(off[np.abs(values) > 1.0]) == np.sign(values[np.abs(values) > 1.0])).all()
    low, high = axes.collections[0].get_clim()
    assert low == -high  # zero is the middle of the colours


SERPENTINE = {
    "pulley_x": [0.0, 0.25, 0.5, 0.396, 0.2],
    "pulley_y": [0.0, -0.035, 0.05, 0.264, 0.4],
    "pulley_radius": [0.07, 0.04, 0.05, 0.04, 0.07],
    "pulley_turn": [1, -1, 1, -1, 1],
    "pulley_inertia": [0.013, 1e-4, 0.001, 1e-4, 0.004],
    "pulley_load": [0, 0, 0, 0, 1],
}
LISTS = dict.fromkeys(SERPENTINE, [])


@pytest.mark.parametrize(
    ("point", "names"),
    [
        (SERPENTINE, ["P1", "P2", "P3", "P4", "P5"]),
        (LISTS | POINT | {"driven_inertia": 0.01, "crossed": True}, ["driving", "driven", "t1", "t2"]),
    ],
)
def test_a_belt_drive_is_drawn_on_its_pulleys(point, names):
    drawn = layout(point)
    position = np.arange(STATIONS) * drawn.path.path_length / STATIONS
    run = xr.Dataset(
        {"tension": ("position", np.full(STATIONS, 300.0), {"units": "N"})},
        {"position": position},
        {"point": json.dumps(point)},
    )
    axes, bar = variator_figure(run).axes
    assert bar.get_ylabel() == "tension [N]" and [text.get_text() for text in axes.texts] == names
    feet = np.array(axes.collections[0].get_segments())[:, 0]
    for circle, centre, radius in zip(axes.patches, drawn.path.centre, drawn.path.radius, strict=True):
        assert circle.center == pytest.approx(1e3 * centre) and circle.radius == pytest.approx(1e3 * radius)
        away = np.hypot(*(feet - 1e3 * centre).T)
        assert away.min() == pytest.approx(1e3 * radius)  # the belt touches each pulley
    np.testing.assert_allclose(feet, 1e3 * points_at(drawn.path, position)[0])


@pytest.mark.parametrize(
    "point", [SERPENTINE | {"pulley_x": [0.0, 1e9]}, SERPENTINE | {"pulley_radius": None}]
)
def test_pulleys_that_are_none_are_refused(point):
    with pytest.raises(InputError, match="expected the history of a run of a variator or belt drive"):
        variator_figure(history().assign_attrs(point=json.dumps(point)))


def test_powers_of_regions_are_feeds_times_their_lengths():
    powers = region_powers(history())
    cell = PATH.path_length / STATIONS  # a border lies within a cell
    assert float(powers.sel(cause="flank_feed", region="driven arc")) == pytest.approx(
        10.0 * PATH.lengths[2], abs=10.0 * cell
    )
    assert float(powers.sel(cause="damping_feed", region="t1")) == pytest.approx(
        -4.0 * PATH.lengths[1], abs=4.0 * cell
    )
    assert float(np.abs(powers).sum()) == pytest.approx(
        float(powers.sel(cause="flank_feed").sum() - powers.sel(cause="damping_feed").sum())
    )


def test_energy_has_losses_of_arc_parts_and_feeds_of_regions():
    figure = energy_figure(history())
    above, below = figure.axes
    assert [bar.get_height() for bar in above.patches] == list(range(8))
    powers = region_powers(history())
    np.testing.assert_allclose([bar.get_height() for bar in below.patches], powers.values.ravel())
    assert "not all terms known" in below.get_title(loc="left")
    texts = [text.get_text() for text in figure.legends[0].get_texts()]
    assert texts == ["friction of the flanks", "damping, rings' friction"]
    ramp = history()
    ramp["flank_feed"][:] = ramp["damping_feed"][:] = np.nan
    assert len(energy_figure(ramp).axes) == 1


def balanced_history():
    """With the record of a run that puts in 40 kW, whose balance is open by 20 W."""
    found = Means()
    found.powers = {"driving_power": 40e3, "load_power": 37e3, "loss": 2.9e3, "storing_power": 50.0}
    found.powers |= {"thrust_power": 20.0, "numerical_damping": np.array([4.0, 6.0])}
    watts = {"units": "W"}
    run = history().assign_coords(pulley=["driving", "driven"])
    run = run.assign(
        {name: ((), value, watts) for name, value in found.powers.items() if np.ndim(value) == 0}
    )
    run["power_residual"] = ((), found.power_residual, watts)
    run["flank_loss"] = ("pulley", [800.0, 1200.0], watts)
    run["ring_loss"] = ((), 700.0, watts)  # 200 W of the loss have no cause of their own
    run["numerical_damping"] = ("spring", found.powers["numerical_damping"], watts)
    run["speed_loss"] = ((), 0.03, {"units": "1"})
    return run


def test_what_goes_in_comes_out_or_is_lost_up_to_what_the_record_leaves_open():
    run = balanced_history()
    whole, parts, *rest = energy_figure(run).axes
    assert len(rest) == 2
    put_in, taken_out, lost, others = (1e3 * bar.get_width() for bar in whole.patches)
    widths = [bar.get_width() for bar in parts.patches]
    named = dict(
        zip((label.get_text().split("  ")[0] for label in parts.get_yticklabels()), widths, strict=True)
    )
    assert (named["flank loss, driven"], named["other losses"], named["time step"]) == pytest.approx(
        (1200, 200, 10)
    )
    assert "speed loss" not in named
    assert sum(power for name, power in named.items() if "loss" in name) == pytest.approx(lost)
    still_open = put_in - taken_out - sum(power for name, power in named.items() if name != "left open")
    assert still_open == pytest.approx(float(run["power_residual"]) * put_in) and still_open == pytest.approx(
        20.0
    )
    assert named["left open"] == pytest.approx(still_open)
    assert [label.get_text() for label in whole.get_yticklabels()] == [
        "driving pulley, in  40",
        "load, out  37",
        "all losses  2.9",
        "all of the rest  0.1",
    ]
    assert put_in == pytest.approx(taken_out + lost + others)
    run["driving_power"] = ((), np.nan)
    assert len(energy_figure(run).axes) == 2  # of a run that failed nothing is told


def test_what_feeds_the_vibration_and_what_takes_from_it_is_nothing_in_sum():
    """On a path whose cells differ from arc to arc, with the terms that have no region."""
    run = history()
    lengths = np.where(run["region"] == "driven arc", 2.0, 1.0)
    position = np.cumsum(lengths) - lengths
    run = run.assign_coords(position=position * PATH.path_length / lengths.sum())
    fed = float(region_powers(run).sum())
    cells = np.diff(run["position"], append=PATH.path_length)
    feeds = (run["flank_feed"] + run["damping_feed"]).values
    assert fed == pytest.approx(float(feeds @ (cells + np.roll(cells, 1)) / 2.0))
    taken = {"layer_taken": 0.5, "lag_taken": 0.1, "carried_power": 0.2}
    run = run.assign(taken | {"fluctuation_remainder": fed - sum(taken.values())})
    below = energy_figure(run).axes[-1]
    assert sum(bar.get_height() for bar in below.patches) == pytest.approx(0.0, abs=1e-12)
    names = [label.get_text().replace("\n", " ") for label in below.get_xticklabels()]
    assert names[4:] == ["layer dampers", "sheave lag", "mean motion", "left open"]
    assert "0 W with what is left open" in below.get_title(loc="left")


def test_a_phase_portrait_is_an_ellipse_of_the_vibration_alone():
    figure = phase_figure(history())
    figure.draw_without_rendering()
    for axes, size in zip(figure.axes, (20.0, 5.0), strict=True):
        whole, last, end = axes.lines
        x, v = whole.get_data()
        speed = 1e-3 * size * 2 * np.pi * 500  # [mm/s]
        # the slow motion of eight times the size in t2 leaves some 2 % at the ends
        np.testing.assert_allclose(np.hypot(x / size, v / speed), 1.0, atol=0.03)
        assert last.get_xdata().size == SHOWN_PERIODS * SAMPLES + 1
        assert end.get_xdata()[0] == x[-1]
        assert axes.get_title(loc="left").endswith(", 500 Hz")
        assert (axes.get_xlabel(), axes.get_ylabel()) == ("displacement [µm]", "velocity [mm/s]")


def test_each_kept_history_of_a_folder_has_a_picture(tmp_path, capsys):
    """Of a study with three kept runs, one of which ended before it moved."""
    folder = tmp_path / "histories"
    for index in (2, 3, 12):
        run = history() if index != 3 else history().drop_vars("displacement")
        write_history(run, folder / f"run-{index:06d}.nc")
    assert main(["plot", "phase", str(tmp_path)]) == 1
    out, err = capsys.readouterr()
    assert out.splitlines() == [f"picture: {tmp_path}/run-{index:06d}_phase.png" for index in (2, 12)]
    (line,) = err.splitlines()
    assert f"{folder}/run-000003.nc: expected the history of a run with the motion of strands" in line
    (folder / "run-000003.nc").unlink()
    assert main(["plot", "phase", str(tmp_path), "--out", str(tmp_path / "x.svg")]) == 0
    written = sorted(path.name for path in tmp_path.iterdir() if path.is_file())
    assert written == ["run-000002_phase.png", "run-000012_phase.png", "x_run-000002.svg", "x_run-000012.svg"]
    (folder / "run-000012.nc").unlink()
    assert main(["plot", "phase", str(tmp_path), "--out", str(tmp_path / "one.svg")]) == 0
    assert (tmp_path / "one.svg").exists()


@pytest.mark.parametrize(
    ("compose", "lacks", "found"),
    [
        (variator_figure, {"drop": ["push_force"]}, "push_force: unknown quantity along the belt"),
        (variator_figure, {"point": "{}"}, "expected the history of a run of a variator"),
        (
            energy_figure,
            {"drop": ["part_flank_loss", "flank_feed", "damping_feed"]},
            "expected a history with",
        ),
        (
            phase_figure,
            {"drop": ["displacement"]},
            "expected the history of a run with the motion of strands",
        ),
    ],
)
def test_what_is_missing_is_told_in_one_line(compose, lacks, found):
    run = history().drop_vars(lacks.get("drop", []))
    run = run.assign_attrs(point=lacks.get("point", run.attrs["point"]))
    with pytest.raises(InputError, match=f"x.nc: {found}") as told:
        compose(run, source="x.nc")
    assert "\n" not in str(told.value)
