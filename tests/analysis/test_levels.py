"""Orders, levels, third octaves and exported signals, against sines and noise in closed form."""

import json
import re
import sys

import numpy as np
import pandas as pd
import pytest
import pyuff
import xarray as xr
from scipy import signal as scipy_signal
from scipy.io import wavfile

import cvt_hpc.accessor  # noqa: F401  # gives datasets their `cvt`
from cvt_hpc.analysis.export import AUDIO_RATE, FULL_SCALE, PEAK, export, loop_of
from cvt_hpc.analysis.orders import order_cuts_figure, orders_figure, track
from cvt_hpc.analysis.time_signals import (
    SHAFT_FORCES,
    Signal,
    centre,
    level,
    nominal,
    read_signal,
    third_octaves,
    third_octaves_figure,
)
from cvt_hpc.cli import main
from cvt_hpc.errors import InputError
from cvt_hpc.physics.geometry import variator
from cvt_hpc.storage.netcdf import write_history
from support import pictured

RATE = 20e3
TURN = 2.0 * np.pi


def history(duration=1.0, speeds=(300.0, 300.0), **of_angle):
    """A run along a ramp of speed: t1 moves by what `of_angle` gives of the driving pulley's angle [rad]."""
    time = np.arange(1, round(duration * RATE) + 1) / RATE
    speed = np.linspace(*speeds, time.size)
    angle = speeds[0] * time + 0.5 * (speeds[1] - speeds[0]) * time**2 / duration
    moved = of_angle.get("motion", lambda angle: np.sin(8.0 * angle) * 1e-6)(angle)
    return xr.Dataset(
        {
            "displacement": (("time", "probe"), np.stack([moved, 0.5 * moved], 1), {"units": "m"}),
            "driving_speed": ("time", speed, {"units": "rad s-1"}),
            "load": ("time", np.full(time.size, 100.0), {"units": "N m"}),
        },
        {"time": ("time", time, {"units": "s"}), "probe": ["t1 1/2", "t2 1/2"]},
        {"point": json.dumps(pictured.POINT), "job_name": "run"},
    )


def lines_of(figure):
    return {line.get_label(): np.array(line.get_data()) for line in figure.axes[0].lines}


@pytest.mark.parametrize("band", [(3.5, 4.5), (59.0, 61.0)])
def test_an_order_has_its_amplitude_while_the_speed_doubles(band):
    """By transforms over the angle a ramp smears nothing, up to half the sampling rate."""
    time = np.arange(40000) / RATE
    turned = 25.0 * time + 6.25 * time**2
    order = 0.5 * sum(band)
    values = 3.0 * np.sin(TURN * order * turned) + np.sin(TURN * 5.0 * turned) + 100.0 - 20.0 * time**2
    middles, amplitude = track(values, turned, band, 8.0)
    np.testing.assert_allclose(amplitude, 3.0, rtol=1e-3)
    np.testing.assert_allclose(np.diff(turned[middles]), 4.0, atol=0.01)


def test_power_within_the_band_is_summed():
    turned = 50.0 * np.arange(20000) / RATE
    values = 3.0 * np.sin(TURN * 7.9 * turned) + 4.0 * np.cos(TURN * 8.1 * turned)
    _, amplitude = track(values, turned, (7.0, 9.0), 40.0)
    np.testing.assert_allclose(amplitude, 5.0, rtol=2e-3)


def test_orders_of_both_pulleys_and_of_elements_are_told_apart():
    def motion(angle):
        return 1e-6 * (2.0 * np.sin(4.0 * angle) + 3.0 * np.sin(2.6 * angle) + 4.0 * np.sin(60.3 * angle))

    run = history(2.0, (200.0, 400.0), motion=motion)
    run["driven_speed"] = run["driving_speed"] / 2.0
    run["passing_frequency"] = 60.0 * float(run["driving_speed"][20000:].mean()) / TURN  # slip: 60.3
    for bandwidth, said in ((np.inf, "above 0, found inf"), (1e4, "the largest of the default orders")):
        with pytest.raises(InputError, match=said):
            orders_figure([run], bandwidth=bandwidth)
    with pytest.raises(InputError, match="expected orders of the bandwidth, 1, or more.*found driven:0.5"):
        orders_figure([run], orders=["driven:0.5"])
    with pytest.raises(
        InputError, match="x.nc: bandwidth: expected at most 78.5 orders, whose windows have 32"
    ):
        orders_figure([run], orders=[10000], bandwidth=1e4, sources=["x.nc"])
    figure = orders_figure([run], orders=["4", "driven:5.2", "elements:1"], bandwidth=1.0)
    for words, expected in {"4×": 2.0, "5.2× driven": 3.0, "1× elements": 4.0}.items():
        speed, amplitude = lines_of(figure)[words]
        np.testing.assert_allclose(amplitude, expected, rtol=5e-3)
        assert 1900.0 < speed[0] < speed[-1] < 3820.0
    levels = lines_of(orders_figure([run], orders=[4], level=True))["4×"][1]
    np.testing.assert_allclose(levels, 20.0 * np.log10(2.0 / np.sqrt(2.0)), atol=0.05)
    speed, velocity = lines_of(orders_figure([run], orders=[4], velocity=True))["4×"]
    np.testing.assert_allclose(velocity, 2e-3 * 4.0 * speed * np.pi / 30.0, rtol=5e-3)  # [mm/s]


def test_orders_that_a_run_does_not_tell_are_refused_or_noted():
    run = history(speeds=(250.0, 350.0))
    figure = orders_figure([run], sources=["x.nc"])
    assert "no orders of elements: no passing_frequency is recorded" in " ".join(
        figure.get_suptitle().split()
    )
    assert "band of 1 order, by Hann windows of 8 turns" in figure.get_suptitle()
    assert figure.axes[0].get_ylabel() == "amplitude [µm]"
    with pytest.raises(InputError, match="x.nc: orders of elements: .* no passing_frequency"):
        orders_figure([run], orders=["elements:1"], sources=["x.nc"])
    with pytest.raises(
        InputError, match=r"8 turns or more after the start-up, found [\d.]+; a larger --band"
    ):
        orders_figure([run.isel(time=slice(2000))], sources=["x.nc"])
    with pytest.raises(InputError, match="found pulley:3"):
        orders_figure([run], orders=["pulley:3"])


def test_cuts_of_spectra_are_the_largest_lines_about_the_orders():
    results = pictured.results()
    figure = order_cuts_figure(results, {"load": 20.0, "ratio": 1.0}, orders=[8, "driven:8"])
    found = lines_of(figure)
    np.testing.assert_allclose(found["8×"][1], 3.0, rtol=0.17)  # a harmonic, between two bins
    np.testing.assert_allclose(found["8×"], found["8× driven"])
    slower = order_cuts_figure(results, {"load": 20.0, "ratio": 2.52}, orders=["driven:20.16"])
    np.testing.assert_allclose(lines_of(slower)["20.16× driven"][1], found["8×"][1], rtol=1e-6)
    with pytest.raises(InputError, match="orders of elements"):
        order_cuts_figure(results, orders=["elements:1"])
    shown = order_cuts_figure(results, {"load": 20.0, "ratio": 1.0}, orders=[8], velocity=True, level=True)
    assert shown.axes[0].get_ylabel() == "RMS level [dB re 1 mm/s]"
    speeds = results["driving_speed"].values
    expected = 20.0 * np.log10(1e-3 * found["8×"][1] * 8.0 * speeds / np.sqrt(2.0))
    np.testing.assert_allclose(lines_of(shown)["8×"][1], expected)


def test_orders_of_the_driven_pulley_follow_a_ratio_that_follows_the_speed():
    """A line at 40 Hz times the place on the axis is another order of the driven pulley at each speed."""
    results = pictured.results().isel(ratio=0, drop=True)
    speeds, bins = results["driving_speed"].values, results["frequency_bin"].values
    ratio = np.linspace(0.5, 2.5, speeds.size)
    lines = 5.0 * speeds / (TURN * ratio)  # 5 turns of the driven pulley
    spectrum = 2e-6 * np.exp(-(((bins - lines[:, None]) / 15.0) ** 2)) + 1e-12
    shape = results["spectrum"].transpose("driving_speed", "frequency_bin", ...)
    filled = np.broadcast_to(spectrum[..., None, None], shape.shape)
    results["spectrum"] = shape.dims, filled, {"units": "m"}
    results = results.assign_coords(ratio=("driving_speed", ratio))
    found = lines_of(order_cuts_figure(results, {"load": 20.0}, orders=["driven:5", 5], bandwidth=0.5))
    np.testing.assert_allclose(found["5× driven"][1], 2.0, rtol=0.15)
    assert found["5×"][1].min() < 0.1
    # the same of a run that shifts: 3 turns of the driven pulley while the ratio doubles
    run = history(2.0)
    ratio = np.linspace(1.0, 2.0, run.sizes["time"])
    run["driven_speed"] = run["driving_speed"] / ratio
    turned = np.cumsum(run["driven_speed"].values) / RATE
    run["displacement"][:] = 1e-6 * np.sin(3.0 * turned)[:, None]
    found = lines_of(orders_figure([run], orders=["driven:3", 3]))
    np.testing.assert_allclose(found["3× driven"][1], 1.0, rtol=5e-3)
    assert found["3×"][1][-1] < 0.1


def test_bands_are_those_of_the_standard():
    assert [nominal(number) for number in (-10, -8, 0, 1, 5, 10)] == [
        "100", "160", "1000", "1250", "3150", "10000"
    ]  # fmt: skip
    np.testing.assert_allclose(centre([-10, 0, 3]), [100.0, 1000.0, 1995.262315], rtol=1e-9)


def test_a_sine_has_its_level_in_its_band_and_a_velocity_by_its_frequency():
    time = np.arange(round(0.5 * RATE)) / RATE
    values = 2e-6 * np.sin(TURN * 1000.0 * time)
    bands = third_octaves(values, RATE, "m")
    assert level(bands.rms, "m")[bands.numbers == 0] == pytest.approx(20.0 * np.log10(np.sqrt(2.0)), abs=1e-3)
    assert level(np.hypot.reduce(bands.rms[bands.numbers != 0]), "m") < -50.0
    # of whole periods the spectrum by scipy has the same level, that of the RMS value
    _, power = scipy_signal.periodogram(values, RATE, "hann", scaling="spectrum")
    assert level(np.sqrt(power.max()), "m") == pytest.approx(
        level(bands.rms, "m")[bands.numbers == 0].item(), abs=1e-3
    )
    speeds = third_octaves(values, RATE, "m", velocity=True)
    assert speeds.unit == "m s-1"
    np.testing.assert_allclose(
        speeds.rms[speeds.numbers == 0], TURN * 1000.0 * 2e-6 / np.sqrt(2.0), rtol=1e-4
    )
    # at 10^(1/20) of a centre its power goes to both bands
    edge = third_octaves(np.sin(TURN * 1000.0 * 10.0**0.05 * time), RATE)
    np.testing.assert_allclose(edge.rms[(edge.numbers == 0) | (edge.numbers == 1)] ** 2, 0.25, atol=0.06)


def test_white_noise_has_power_by_the_width_of_bands_and_all_bands_have_all_power():
    values = np.random.default_rng(1).standard_normal(400_000)
    bands = third_octaves(values, RATE)
    width = centre(bands.numbers) * (10.0**0.05 - 10.0**-0.05)
    np.testing.assert_allclose(bands.rms[-15:] ** 2, width[-15:] / (0.5 * RATE), rtol=0.08)
    lowest, highest = centre(bands.numbers[[0, -1]]) * [10.0**-0.05, 10.0**0.05]
    assert np.sum(bands.rms**2) == pytest.approx((highest - lowest) / (0.5 * RATE), rel=0.01)
    assert highest <= 0.5 * RATE < highest * 10.0**0.1
    # sines between the outermost edges: their power, whatever band has it
    time = np.arange(round(0.5 * RATE)) / RATE
    mixed = sum(a * np.sin(TURN * f * time) for a, f in ((1.0, 224.0), (2.0, 707.0), (0.5, 3548.0)))
    assert np.sum(third_octaves(mixed, RATE).rms ** 2) == pytest.approx(0.5 * (1.0 + 4.0 + 0.25), rel=1e-3)


def test_a_picture_of_third_octaves_states_rms_and_reference():
    run = history()
    figure = third_octaves_figure([run, run], sources=["a", "b"])
    assert [axes.get_ylabel() for axes in figure.axes] == ["RMS level [dB re 1 µm]"] * 2
    assert [axes.get_title(loc="left") for axes in figure.axes] == ["t1 1/2", "t2 1/2"]
    assert figure.axes[0].get_legend().get_texts()[0].get_text().endswith("all bands −3.0 dB")
    assert "no casing is modelled" in figure.get_suptitle()
    figure = third_octaves_figure([run], ["load", "t1"])
    assert figure.axes[0].get_ylabel() == "RMS level [dB re 1 N m]"
    with pytest.raises(InputError, match=r"load: expected a displacement \[m\] for a velocity"):
        third_octaves_figure([run], ["load"], velocity=True)


def with_forces(t1, t2):
    """The run with net forces of its strands [N]: half of each is a push force."""
    run, one = history(0.2), np.ones(round(0.2 * RATE))
    for name, force in (("t1", t1), ("t2", t2)):
        run[f"ring_tension_{name}"] = "time", 1.5 * force * one, {"units": "N"}
        run[f"push_force_{name}"] = "time", 0.5 * force * one, {"units": "N"}
    return run


def test_forces_on_shafts_are_the_sums_of_the_strands_without_the_flux_of_momentum():
    path = variator(*(pictured.POINT[key] for key in ("ratio", "driven_radius", "centre_distance")))
    flux = 1.3 * (300.0 * path.driving_radius) ** 2
    sine = (path.driven_radius - path.driving_radius) / pictured.POINT["centre_distance"]
    run = with_forces(4000.0, 7000.0)
    forces = {name: read_signal(run, name).values[0] for name in SHAFT_FORCES}
    along = (11e3 - 2.0 * flux) * np.sqrt(1.0 - sine**2)
    np.testing.assert_allclose(
        list(forces.values()), [along, 3000.0 * sine, -along, -3000.0 * sine], rtol=1e-12
    )
    # a belt that runs so fast that its strands carry nothing but their own turning presses on no shaft
    floating = with_forces(flux, flux)
    np.testing.assert_allclose([read_signal(floating, name).values for name in SHAFT_FORCES], 0.0, atol=1e-9)
    with pytest.raises(
        InputError, match=r"x.nc: shaft_force_driving_y: expected push force and ring tension"
    ):
        read_signal(history(), "shaft_force_driving_y", "x.nc")


def test_forces_on_shafts_of_an_elastic_belt_are_those_of_its_last_profiles():
    run = with_forces(4000.0, 7000.0)
    wanted = read_signal(run, "shaft_force_driven_z")
    region = np.repeat(["driving arc", "t1", "driven arc", "t2"], 8)
    tension = np.where(region == "t1", 4500.0, np.where(region == "t2", 7500.0, np.nan))
    tension[[8, 15, 24, 31]] = np.nan  # ends of strands do not count
    last = run["time"].values[-1000:]
    profiles = run.drop_vars([name for name in run if "_t" in name]).assign_coords(
        profile_time=last, region=("position", region)
    )
    for name, values in (("ring_tension", tension), ("push_force", np.full(32, 500.0))):
        profiles[f"momentary_{name}"] = ("profile_time", "position"), np.tile(values, (1000, 1))
    found = read_signal(profiles, "shaft_force_driven_z")
    np.testing.assert_allclose(found.values, wanted.values[-1000:])
    assert (found.times[0], found.judged) == (last[0], 0)


def test_a_loop_has_whole_periods_and_no_jump_at_its_seam():
    time = np.arange(round(0.2 * RATE)) / RATE
    for values in (
        np.sin(TURN * 613.7 * time),
        np.exp(3.0 * time) * np.sin(TURN * 613.7 * time) + 0.4 * np.sin(TURN * 811.3 * time) + 9.0 * time,
    ):
        loop = loop_of(Signal("x", "m", time, values, 0), (100.0, 1500.0))
        assert loop.periods / loop.length == pytest.approx(613.7, rel=2e-4)
        steps = np.diff(np.append(loop.values, loop.values[0]))
        bends = np.diff(np.append(steps, steps[0]))
        assert abs(steps[-1]) <= np.abs(steps[:-1]).max()
        # neither value nor slope jumps: the curve bends no more at the seam than elsewhere
        assert np.abs(bends[-2:]).max() <= 1.001 * np.abs(bends[:-2]).max()
    with pytest.raises(InputError, match="expected a judged part of 0.0[0-9]* s or more"):
        loop_of(Signal("x", "m", time[:200], values[:200], 0), (100.0, 1500.0))


def test_a_sound_has_its_peak_at_3_db_below_full_scale_and_its_frequency(tmp_path):
    run = history(motion=lambda angle: 4e-6 * np.sin(13.0 * angle))
    lines = export(run, [], tmp_path / "x.wav")
    rate, samples = wavfile.read(tmp_path / "x.wav")
    assert (rate, samples.dtype) == (AUDIO_RATE, np.int16) and samples.size > 5 * rate
    assert abs(20.0 * np.log10(np.abs(samples).max() / FULL_SCALE) + 3.0) < 0.01
    full, peak = (float(number) for number in re.findall(r"[\d.]+(?= µm)", lines[1]))
    assert (peak, full) == (pytest.approx(4.0, rel=0.01), pytest.approx(peak / PEAK, rel=1e-4))
    told = (tmp_path / "x.txt").read_text()
    assert (
        all(line in told for line in lines[:-1])
        and "# job: run" in told
        and "not modelled: the casing" in told
    )
    lines_in = np.abs(np.fft.rfft(samples))
    assert np.argmax(lines_in) * rate / samples.size == pytest.approx(13.0 * 300.0 / TURN, rel=1e-3)
    # repeated, it goes on over each seam
    steps = np.abs(np.diff(samples.astype(float)))
    assert steps.max() <= 1.01 * PEAK * FULL_SCALE * 13.0 * 300.0 / rate
    lines = export(run, ["t2"], tmp_path / "v.wav", velocity=True)
    speed = float(re.search(r"peak ([\d.]+) mm/s", lines[1])[1])
    assert speed == pytest.approx(2e-3 * 13.0 * 300.0, rel=0.01)
    ramp = history(speeds=(200.0, 400.0))
    export(ramp, ["t1"], tmp_path / "ramp.wav")
    _, swept = wavfile.read(tmp_path / "ramp.wav")
    assert swept.size == AUDIO_RATE and abs(int(swept[0])) < 10 > abs(int(swept[-1]))


def test_tables_and_uff_files_are_read_again_by_their_libraries(tmp_path, monkeypatch):
    run = with_forces(4000.0, 7000.0)
    names = ["t1", "shaft_force_driving_y"]
    assert export(run, names, tmp_path / "x.csv") == [
        f"signals: {tmp_path / 'x.csv'}: 2 of 4000 samples, 20000 Hz"
    ]
    table = pd.read_csv(tmp_path / "x.csv", comment="#")
    assert list(table) == ["time [s]", "displacement t1 1/2 [m]", "shaft_force_driving_y [N]"]
    signals = [read_signal(run, name) for name in names]
    np.testing.assert_array_equal(table.values.T, [run["time"], *(one.values for one in signals)])
    export(run, names, tmp_path / "x.uff")
    units, *sets = pyuff.UFF(str(tmp_path / "x.uff")).read_sets()
    assert (units["type"], units["length"], units["force"]) == (164, 1.0, 1.0)
    for found, signal, kind in zip(sets, signals, (8, 13), strict=True):
        assert (found["type"], found["func_type"], found["id1"]) == (58, 1, signal.name)
        assert (found["ordinate_spec_data_type"], found["ordinate_axis_units_lab"]) == (kind, signal.unit)
        np.testing.assert_allclose(found["data"], signal.values, rtol=1e-11, atol=1e-20)
        np.testing.assert_allclose(found["x"], signal.times, rtol=1e-5)
    export(run, [], tmp_path / "all.csv")
    assert len(pd.read_csv(tmp_path / "all.csv", comment="#").columns) == 1 + 2 + 2 + 4 + 4
    # a course that ends in nothing is left out of all, and refused by its name
    broken = run.copy(deep=True)
    broken["load"][-5:] = np.nan
    lines = export(broken, [], tmp_path / "rest.csv")
    assert "left out" in lines[0] and "load" in lines[0]
    assert "load" not in "".join(pd.read_csv(tmp_path / "rest.csv", comment="#").columns)
    monkeypatch.setitem(sys.modules, "pyuff", None)
    with pytest.raises(InputError, match=r'the library pyuff, found none; `pip install "cvt_hpc\[uff\]"`'):
        export(run, names, tmp_path / "y.uff")
    assert not (tmp_path / "y.uff").exists()


def test_the_command_exports_and_refuses_in_a_line(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    write_history(history(), tmp_path / "run.nc")
    assert main(["export", "run.nc", "--of", "t1 1/2", "--out", "x.wav"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("sound: x.wav: t1 1/2, ") and lines[-1] == "text: x.txt"
    assert main(["export", "run.nc", "--of", "t2", "--out", "x.wav"]) == 0  # its own text is replaced
    (tmp_path / "notes.txt").write_text("what I heard\n")
    for words, refusal in (
        (["--of", "t1", "--of", "t2", "--out", "x.wav"], "expected one signal, which a sound has, found 2"),
        (["--velocity", "--out", "x.csv"], "expected velocities as .wav alone"),
        (["--out", "x.mp3"], "expected a file name in .wav, .csv, .uff"),
        (["--of", "lood", "--out", "x.csv"], "run.nc: lood: unknown signal; did you mean load?"),
        (["--of", "load", "--out", "y.wav"], "load: expected a signal that changes, found a constant one"),
        (["--out", "notes.wav"], "notes.txt: expected a new file, or the text of a sound written by cvt_hpc"),
    ):
        assert main(["export", "run.nc", *words]) == 2
        assert refusal in capsys.readouterr().err
    assert (tmp_path / "notes.txt").read_text() == "what I heard\n" and not (tmp_path / "notes.wav").exists()
    with pytest.raises(SystemExit):
        main(["export", "--help"])
    assert "No casing, and no sound that it radiates, is modelled." in " ".join(
        capsys.readouterr().out.split()
    )
    assert history().cvt.export(tmp_path / "z.csv", "load")[0].endswith("1 of 20000 samples, 20000 Hz")
