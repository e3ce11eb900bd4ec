"""One element along its path, and spectral peaks with their modes: against closed forms."""

import numpy as np
import pytest
import xarray as xr

from cvt_hpc.analysis.followed_drawing import element_figure, follow_element, one_passage, path_of
from cvt_hpc.errors import InputError
from cvt_hpc.vibration.peaks import modal_peaks

LENGTH, STATIONS, RATE = 0.64, 160, 20e3
PLACES = np.linspace(0.0, LENGTH, STATIONS + 1)


def history(duration=0.15, speed=10.0):
    """Sliding that tells the place, 0.1 s^-1 s, on arcs of a path on which everything runs at one speed."""
    time, position = np.arange(round(duration * RATE)) / RATE, PLACES[:-1]
    region = np.array(["driving arc", "t1", "driven arc", "t2"], object)[(position // 0.16).astype(int)]
    on_arc = np.where(np.char.endswith(region.astype(str), "arc"), 1.0, np.nan)
    along = np.broadcast_to(0.1 * position * on_arc, (time.size, STATIONS))
    over = ("profile_time", "position")
    variables = {
        f"momentary_{name}": (over, along)
        for name in ("radial_sliding", "tangential_sliding", "sliding_speed")
    }
    variables["momentary_element_speed"] = (over, np.full((time.size, STATIONS), speed))
    coordinates = {"profile_time": time, "position": position, "region": ("position", region)}
    return xr.Dataset(variables, coordinates, {"job_name": "made up"})


def test_an_element_goes_round_at_the_belts_speed():
    followed = follow_element(history(), 0.1)
    assert followed["travelled"].values == pytest.approx(0.1 + 10.0 * followed["time"].values)
    assert followed["position"].values == pytest.approx(
        np.mod(0.1 + 10.0 * followed["time"].values, LENGTH), abs=1e-9
    )
    known = np.isfinite(followed["sliding_speed"].values)
    assert followed["sliding_speed"].values[known] == pytest.approx(0.1 * followed["position"].values[known])


@pytest.mark.parametrize("rate", [20e3, 40e3])
def test_a_speed_that_depends_on_place_and_time(rate, tell):
    """ds/dt = (a + b s) (1 + c t) has a closed form; Heun's method has the second order."""
    a, b, c = 8.0, 3.0, 5.0
    time = np.arange(round(0.05 * rate)) / rate
    speed = (a + b * PLACES[:-1]) * (1.0 + c * time[:, None])
    found = path_of(time, PLACES, speed, 0.0)
    exact = (a / b) * np.expm1(b * (time + 0.5 * c * time**2))
    inside = exact < PLACES[-2]
    tell("place of an element along its path [m]", found[inside], exact[inside])
    assert np.abs(found - exact)[inside].max() < 4e-7 * (20e3 / rate) ** 2


def test_one_passage_of_an_arc():
    passed = one_passage(history(), "driven")
    assert set(passed["region"].values) == {"driven arc"}
    assert passed.sizes["time"] == pytest.approx(0.016 * RATE, abs=10)
    axes = element_figure(history(), "driven").axes[0]
    assert axes.get_xlabel() == "time since the element entered the driven arc [ms]"
    with pytest.raises(InputError, match="whole passage of the driven arc"):
        one_passage(history(0.005), "driven")
    with pytest.raises(InputError, match="profile_duration"):
        follow_element(history().drop_vars("momentary_element_speed"), 0.0)


def test_each_peak_has_its_mode():
    time = np.arange(4000) / RATE
    modes = np.zeros((4000, 2, 5))
    modes[:, 0, 1] = 3e-6 * np.sin(2 * np.pi * 494.3 * time)
    modes[:, 0, 2] = 1e-6 * np.cos(2 * np.pi * 988.6 * time)
    modes[:, 1, 0] = 2e-6 * np.sin(2 * np.pi * 494.3 * time)
    modes[:, 1, 2] = 5e-6 * np.sin(2 * np.pi * 1010.0 * time)
    modes[:, 1, 3] = 9e-6 * np.sin(2 * np.pi * 2000.0 * time)  # beyond the band
    found = modal_peaks(modes, RATE, (300.0, 1500.0))
    assert found.mode.tolist() == [[2, 3, 0], [3, 1, 0]]
    assert found.frequency[:, :2] == pytest.approx(np.array([[494.3, 988.6], [1010.0, 494.3]]), abs=0.05)
    assert found.amplitude[:, :2] == pytest.approx(np.array([[3e-6, 1e-6], [5e-6, 2e-6]]), rel=0.01)
    assert found.frequency_ratio[:2] == pytest.approx([1010.0 / 494.3, 1.0], rel=1e-4)
    assert np.isnan(found.frequency[:, 2]).all()
